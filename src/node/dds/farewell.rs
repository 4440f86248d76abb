//! The last word of a participant that is gone, at which Fast DDS forgets it and all that it had.
//!
//! RustDDS 0.15.1 disposes of a participant by its GUID alone, in 28 bytes of payload and without the hash of that key
//! (`DisposeByKey` in its `rtps/message.rs`). Fast DDS leaves out a key of more than 16 bytes that comes without its hash
//! (eProsima/Fast-DDS#958 and #5262): for it the node would still be there, with its topics and services, until the
//! lease of 50 s is over. So the same is said once more, with the hash. It comes when nothing can come of the participant any
//! more, for an announcement after it would be that of a new one. Who has forgotten the participant already leaves it out.
//!
//! Source: RTPS 2.5, sections 8.5.3 (how participants are found and lost), 9.6.4.8 (the hash of a key, which is the key where that
//! has 16 bytes as a GUID has) and 9.6.4.9 (what has become of what has the key).
//!
//! With DDS Security it is not said: it has no signature, and nobody should believe it.

use std::net::{Ipv4Addr, UdpSocket};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use rustdds::{DomainParticipant, RTPSEntity as _};
use socket2::SockRef;
use tracing::debug;

use super::threads::Threads;

/// Where participants are announced, by RTPS 2.5, 9.6.2.
const GROUP: Ipv4Addr = Ipv4Addr::new(239, 255, 0, 1);
const FIRST_PORT: u16 = 7400;
const PORTS_OF_DOMAIN: u16 = 250;

/// Whose own ports RustDDS 0.15.1 announces a participant to on the same machine, where loopback has no multicast.
const PARTICIPANTS: u16 = 12;

/// Greater than that of any announcement, its high half first: Fast DDS heeds no message of a lesser number than one that it has.
const SEQUENCE_NUMBER: (i32, u32) = (1, 0);

/// Time for threads to be gone that have been joined: Linux lists them a little longer.
const JOINED: (u32, Duration) = (100, Duration::from_millis(10));

/// Time for the last of those who hold a network that was left; after it peers have forgotten a participant that is gone.
const HELD: (u32, Duration) = (200, Duration::from_millis(250));

/// What remains to be said of a participant when it is gone.
pub(super) struct Farewell {
    guid: [u8; 16],
    domain: u16,
    /// Those of this machine that it is said from.
    addresses: Vec<Ipv4Addr>,
    threads: Arc<Threads>,
}

impl Farewell {
    pub(super) fn of(
        participant: &DomainParticipant,
        threads: &Arc<Threads>,
        addresses: Vec<Ipv4Addr>,
    ) -> Self {
        let (guid, domain) = (participant.guid().to_bytes(), participant.domain_id());
        Self { guid, domain, addresses, threads: Arc::clone(threads) }
    }

    /// Says it; everything that holds the participant must have been dropped. RustDDS has joined its threads by that: where the
    /// system does not tell of them it is said as well.
    pub(super) fn say(self) {
        let (looks, pause) = JOINED;
        let is_gone = (0..looks).any(|_| {
            self.threads.have_ended().unwrap_or(true) || {
                thread::sleep(pause);
                false
            }
        });
        self.send_if(is_gone);
    }

    /// Says it once everything that holds the participant has been dropped, which only the system can tell.
    pub(super) async fn say_once_gone(self) {
        let (mut looks, pause) = HELD;
        while looks > 0 && self.threads.have_ended() == Some(false) {
            looks -= 1;
            tokio::time::sleep(pause).await;
        }
        self.send_if(self.threads.have_ended() == Some(true));
    }

    /// One that may still announce itself is left alone: all that had forgotten it would find it anew.
    fn send_if(&self, is_gone: bool) {
        if is_gone {
            self.send();
        } else {
            debug!("peers are not told that the node has left: its middleware is not known to have ended");
        }
    }

    /// To whom RustDDS announces a participant. Who does not hear it forgets the node when its lease is over.
    fn send(&self) {
        let datagram = datagram(self.guid);
        let first = FIRST_PORT + PORTS_OF_DOMAIN * self.domain;
        let to_all = |from: &Ipv4Addr| {
            let socket = UdpSocket::bind((*from, 0))?;
            SockRef::from(&socket).set_multicast_if_v4(from)?;
            socket.send_to(&datagram, (GROUP, first))
        };
        let to_one = |participant: u16| {
            let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
            socket.send_to(&datagram, (Ipv4Addr::LOCALHOST, first + 10 + 2 * participant))
        };
        let sent = self.addresses.iter().map(to_all).chain((0..PARTICIPANTS).map(to_one));
        for error in sent.filter_map(Result::err) {
            debug!("some peers may take the node to be there until its lease is over: {error}");
        }
    }
}

/// Is said where it is dropped: the last field of what holds the participant.
pub(super) struct LastWord(pub(super) Option<Farewell>);

impl Drop for LastWord {
    fn drop(&mut self) {
        self.0.take().into_iter().for_each(Farewell::say);
    }
}

/// That the participant of this GUID is disposed of, and unregistered.
fn datagram(guid: [u8; 16]) -> Vec<u8> {
    const VERSION: [u8; 2] = [2, 4];
    const RUSTDDS: [u8; 2] = [1, 0x12];
    const DATA: u8 = 0x15;
    const LITTLE_ENDIAN: u8 = 1;
    const INLINE_QOS: u8 = 2;
    const EXTRA_FLAGS: [u8; 2] = [0, 0];
    const UNTIL_INLINE_QOS: u16 = 16;
    const READER: [u8; 4] = [0, 1, 0, 0xc7];
    const WRITER: [u8; 4] = [0, 1, 0, 0xc2];
    const KEY_HASH: u16 = 0x70;
    const STATUS_INFO: u16 = 0x71;
    const DISPOSED: u8 = 1;
    const UNREGISTERED: u8 = 2;
    const SENTINEL: u16 = 1;

    let (high, low) = SEQUENCE_NUMBER;
    let data = [
        &EXTRA_FLAGS[..],
        &UNTIL_INLINE_QOS.to_le_bytes(),
        &READER,
        &WRITER,
        &high.to_le_bytes(),
        &low.to_le_bytes(),
        &parameter(KEY_HASH, &guid),
        &parameter(STATUS_INFO, &[0, 0, 0, DISPOSED | UNREGISTERED]),
        &parameter(SENTINEL, &[]),
    ]
    .concat();
    let header = [&b"RTPS"[..], &VERSION, &RUSTDDS, &guid[..12]].concat();
    [&header[..], &[DATA, LITTLE_ENDIAN | INLINE_QOS], &length(&data), &data].concat()
}

fn parameter(id: u16, value: &[u8]) -> Vec<u8> {
    [&id.to_le_bytes()[..], &length(value), value].concat()
}

/// In bytes, of which there are few.
const fn length(bytes: &[u8]) -> [u8; 2] {
    (bytes.len() as u16).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_datagram_disposes_of_the_participant_by_the_hash_of_its_key() {
        let guid = *b"\x01\x12ten bytes!\x00\x00\x01\xc1";
        // Each field as RTPS 2.5, 9.4, puts it.
        let expected: [&[u8]; 18] = [
            b"RTPS",
            b"\x02\x04",                         // protocol version
            b"\x01\x12",                         // vendor
            b"\x01\x12ten bytes!",               // GUID prefix
            b"\x15",                             // DATA
            b"\x03",                             // E: little-endian, Q: inline QoS, no payload
            b"\x34\x00",                         // 52 bytes follow
            b"\x00\x00\x10\x00",                 // extra flags, 16 bytes until the inline QoS
            b"\x00\x01\x00\xc7",                 // reader: SPDPbuiltinParticipantReader
            b"\x00\x01\x00\xc2",                 // writer: SPDPbuiltinParticipantWriter
            b"\x01\x00\x00\x00\x00\x00\x00\x00", // sequence number: 2^32
            b"\x70\x00\x10\x00",                 // PID_KEY_HASH, 16 bytes
            b"\x01\x12ten bytes!",
            b"\x00\x00\x01\xc1", // ENTITYID_PARTICIPANT
            b"\x71\x00\x04\x00", // PID_STATUS_INFO, 4 bytes
            b"\x00\x00\x00\x03", // big-endian always: disposed, unregistered
            b"\x01\x00",         // PID_SENTINEL
            b"\x00\x00",
        ];
        assert_eq!(datagram(guid), expected.concat());
    }
}
