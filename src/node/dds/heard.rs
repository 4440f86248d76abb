//! One publisher, two readers: reliable where it offers that, best effort where not.
//!
//! A raw depth image is ten datagrams sent at once, and a stock socket buffer holds six. What is lost of them comes again
//! only to a reliable reader, which a best-effort publisher does not serve. So both kinds of reader are open, and what the
//! reliable one has of a publisher is not taken twice.

use std::collections::BTreeMap;

use ros2_client::Gid;

/// What has been heard of each publisher.
#[derive(Debug, Default)]
pub(super) struct Heard {
    publishers: BTreeMap<Gid, Publisher>,
    /// A sample that cannot be decoded came reliably; it does not tell its publisher.
    garbled_reliably: bool,
}

#[derive(Debug, Default)]
struct Publisher {
    reliably: bool,
    /// Newest number that came by best effort before the reliable reader was heard.
    newest: Option<i64>,
}

impl Heard {
    /// Publishers to remember; a driver that restarts is a new one each time.
    const PUBLISHERS: usize = 1000;

    /// Notes a sample that cannot be decoded; says whether it is to be told: once, where both readers have it.
    pub(super) fn tells_garbled(&mut self, reliably: bool) -> bool {
        self.garbled_reliably |= reliably;
        reliably || !(self.garbled_reliably || self.publishers.values().any(|publisher| publisher.reliably))
    }

    /// Whether a sample of this number is to be taken from the reader, `reliably` or not, that has it.
    pub(super) fn takes(&mut self, publisher: Gid, number: i64, reliably: bool) -> bool {
        if self.publishers.len() >= Self::PUBLISHERS {
            self.publishers.clear();
        }
        let heard = self.publishers.entry(publisher).or_default();
        if reliably {
            heard.reliably = true;
            return heard.newest.is_none_or(|newest| number > newest);
        }
        if !heard.reliably {
            heard.newest = heard.newest.max(Some(number));
        }
        !heard.reliably
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Publishers of different names.
    fn publisher(number: u32) -> Gid {
        let mut name = [0; 16];
        name[..4].copy_from_slice(&number.to_le_bytes());
        cdr_encoding::from_bytes::<Gid, byteorder::LittleEndian>(&name).unwrap().0
    }

    #[test]
    fn ever_new_publishers_are_not_remembered_for_ever() {
        let mut heard = Heard::default();
        for number in 0..10_000 {
            assert!(heard.takes(publisher(number), 1, false));
            assert!(heard.publishers.len() <= Heard::PUBLISHERS);
        }
    }

    #[test]
    fn a_sample_is_taken_once_and_reliably_where_it_can_be() {
        let (mut heard, publisher) = (Heard::default(), Gid::default());
        assert!(heard.takes(publisher, 1, false));
        assert!(heard.takes(publisher, 2, false));
        assert!(!heard.takes(publisher, 1, true) && !heard.takes(publisher, 2, true));
        assert!(heard.takes(publisher, 3, true) && !heard.tells_garbled(false) && heard.tells_garbled(true));
        assert!(!heard.takes(publisher, 3, false) && !heard.takes(publisher, 4, false));
        assert!(heard.takes(publisher, 4, true));
    }

    #[test]
    fn without_a_reliable_reader_every_sample_is_taken() {
        let (mut heard, publisher) = (Heard::default(), Gid::default());
        assert!([5, 7, 6].into_iter().all(|number| heard.takes(publisher, number, false)));
    }
}
