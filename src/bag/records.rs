//! The records of an MCAP file that tell something of its messages, in the order of the file.

use std::any::Any;
use std::io::{ErrorKind, Read};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use mcap::records::{DataEnd, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::attachments::{Bounded, WithoutLarge};
use crate::count::count_of;

/// The longest header, schema or channel that is read (bytes): the definition of a large message has 100 kB.
const MAX_DESCRIPTION: usize = 1 << 20;

/// Bytes to read at once at most.
const PIECE: usize = 256 << 10;

/// Channel, sequence number and two times (bytes).
const MESSAGE_HEADER: usize = 22;

/// What stands before the counts of single channels (bytes).
const STATISTICS_COUNTS: usize = 42;

const NO_FIT: &str = "a record does not fit its chunk";

/// A record that says something of the bag's messages; it owns what it holds.
pub(super) type Record = mcap::records::Record<'static>;

/// Reads records; chunks are unpacked. Nothing comes after an error, but where [`Records::pass_chunk`] goes on.
pub(super) struct Records<R> {
    source: R,
    reader: LinearReader,
    options: LinearReaderOptions,
    is_done: bool,
}

impl<R: Bounded> Records<R> {
    pub(super) fn new(source: R, options: LinearReaderOptions) -> Self {
        let reader = LinearReader::new_with_options(options.clone());
        Self { source, reader, options, is_done: false }
    }

    fn advance(&mut self) -> Result<Option<Record>, String> {
        loop {
            let wanted = match self.reader.next_event().transpose().map_err(|error| reason(&error))? {
                None => return Ok(None),
                Some(LinearReadEvent::ReadRequest(wanted)) => wanted,
                Some(LinearReadEvent::Record { opcode, data }) => match parse(opcode, data)? {
                    Some(record) => return Ok(Some(record)),
                    None => continue,
                },
            };
            if !self.source.has(wanted) {
                return Err(NO_FIT.to_owned());
            }
            // Memory follows what arrives, not what a length claims: what is wanted beyond that is asked for again.
            let read = match self.source.read(self.reader.insert(wanted.min(PIECE))) {
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                read => read.map_err(|error| reason(&error.into()))?,
            };
            self.reader.notify_read(read);
        }
    }
}

impl<R: Read> Records<WithoutLarge<R>> {
    /// After an error within a chunk, goes on behind that; gives its length. `None` where the error lies elsewhere, or is that the
    /// file ends: it stays the last word.
    pub(super) fn pass_chunk(&mut self) -> Option<u64> {
        let length = self.source.pass_chunk().ok().flatten()?;
        let options = self.options.clone().with_skip_start_magic(true);
        (self.reader, self.is_done) = (LinearReader::new_with_options(options), false);
        Some(length)
    }
}

impl<R: Bounded> Iterator for Records<R> {
    type Item = Result<Record, String>;

    /// The next record, or what is wrong. Of a record that is longer than its chunk, if that is not compressed, the library reads
    /// on to the end of the file, or panics where overflow is checked; unless its source says before that there is no more.
    fn next(&mut self) -> Option<Self::Item> {
        if self.is_done {
            return None;
        }
        let record = catch_unwind(AssertUnwindSafe(|| self.advance())).unwrap_or_else(|panic| {
            if is_overflow(&*panic) { Err(NO_FIT.to_owned()) } else { resume_unwind(panic) }
        });
        self.is_done = !matches!(record, Ok(Some(_)));
        record.transpose()
    }
}

fn is_overflow(panic: &(dyn Any + Send)) -> bool {
    panic.downcast_ref::<&str>().is_some_and(|text| *text == "attempt to subtract with overflow")
}

/// `None` for a record that says nothing of the messages: what is wrong inside of an attachment costs nothing.
fn parse(opcode: u8, body: &[u8]) -> Result<Option<Record>, String> {
    let about = || format!("a record of {} (opcode {opcode:#04x})", count_of(body.len(), "byte"));
    let fields = Fields(body);
    let rest = match opcode {
        op::HEADER | op::SCHEMA | op::CHANNEL if body.len() > MAX_DESCRIPTION => {
            return Err(format!("{}: at most {MAX_DESCRIPTION} are read", about()));
        }
        op::HEADER => fields.skip(2),
        op::SCHEMA => fields.bytes(2).and_then(|rest| rest.skip(3)),
        op::CHANNEL => fields.bytes(4).and_then(|rest| rest.skip(2)).and_then(Fields::map),
        op::MESSAGE => fields.bytes(MESSAGE_HEADER),
        op::STATISTICS => fields.bytes(STATISTICS_COUNTS).and_then(|rest| rest.skip(1)),
        // The library has checked it already, except in a chunk, where the format does not allow it and it ends nothing.
        op::DATA_END => return Ok(Some(Record::DataEnd(DataEnd { data_section_crc: 0 }))),
        _ => return Ok(None),
    };
    rest.map_err(|missing| format!("{}: bytes that are missing: {missing}", about()))?;
    mcap::parse_record(opcode, body).map(|record| Some(record.into_owned())).map_err(|error| reason(&error))
}

/// What comes next of a record's body. The library takes memory for a string by the length that stands before it, up to 4 GB,
/// and looks afterwards whether the record has so much: so the lengths are held against the record before the library sees
/// them.
struct Fields<'a>(&'a [u8]);

/// How many bytes there are less than a field needs.
type Missing = usize;

impl Fields<'_> {
    fn bytes(self, count: usize) -> Result<Self, Missing> {
        self.0.get(count..).map(Self).ok_or_else(|| count - self.0.len())
    }

    /// The length that stands before a string, of which all is there.
    fn length(self) -> Result<(Self, usize), Missing> {
        let (length, rest) = self.0.split_first_chunk().ok_or_else(|| 4 - self.0.len())?;
        let length = usize::try_from(u32::from_le_bytes(*length)).unwrap_or(usize::MAX);
        if length > rest.len() { Err(length - rest.len()) } else { Ok((Self(rest), length)) }
    }

    /// Strings and other bytes behind their length.
    fn skip(self, strings: usize) -> Result<Self, Missing> {
        (0..strings).try_fold(self, |rest, _| rest.length().and_then(|(rest, length)| rest.bytes(length)))
    }

    /// Pairs of strings that fill a length in bytes.
    fn map(self) -> Result<Self, Missing> {
        let (rest, length) = self.length()?;
        let (pairs, rest) = rest.0.split_at(length);
        let mut pairs = Self(pairs);
        while !pairs.0.is_empty() {
            pairs = pairs.skip(2)?;
        }
        Ok(Self(rest))
    }
}

/// An error with what it comes from, which its own words leave out, on one line.
pub(super) fn reason(error: &mcap::McapError) -> String {
    if let mcap::McapError::Parse(source) = error {
        return format!("{error}: {}", source.root_cause());
    }
    let source = std::error::Error::source(error);
    source.map_or_else(|| error.to_string(), |source| format!("{error}: {source}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn string(text: &str) -> Vec<u8> {
        [&u32::try_from(text.len()).unwrap().to_le_bytes()[..], text.as_bytes()].concat()
    }

    fn channel(metadata: &[u8]) -> Vec<u8> {
        let length = u32::try_from(metadata.len()).unwrap().to_le_bytes();
        [&[1, 0, 0, 0][..], &string("/tf"), &string("cdr"), &length, metadata].concat()
    }

    #[test]
    fn strings_that_fill_their_record_are_read() {
        let pairs = ["a", "", "quality", "of service"].map(string).concat();
        for metadata in [&pairs[..], &[]] {
            let Ok(Some(Record::Channel(read))) = parse(op::CHANNEL, &channel(metadata)) else {
                panic!("none")
            };
            assert_eq!(read.topic, "/tf");
            assert_eq!(read.metadata.len(), if metadata.is_empty() { 0 } else { 2 });
        }
    }

    /// Whatever is cut off of a record, or claimed by one of its lengths, is refused with a number before the library looks.
    #[test]
    fn a_record_cut_anywhere_says_by_how_much() {
        let whole = channel(&["a", "b"].map(string).concat());
        for length in 0..whole.len() {
            let refused = parse(op::CHANNEL, &whole[..length]).unwrap_err();
            assert!(refused.contains("bytes that are missing: "), "{length}: {refused}");
        }
        for place in [4, 11, 18, 22, 27] {
            let mut lies = whole.clone();
            lies[place..place + 4].fill(0xff);
            let refused = parse(op::CHANNEL, &lies).unwrap_err();
            assert!(refused.contains(": 42949672"), "{place}: {refused}");
        }
    }

    #[test]
    fn what_cannot_be_parsed_is_said_on_one_line() {
        let refused =
            parse(op::CHANNEL, &channel(&[&string("a")[..], &[1, 0, 0, 0, 0xff]].concat())).unwrap_err();
        assert!(refused.starts_with("Record parse failed: invalid utf-8 sequence"), "{refused}");
        assert!(refused.len() < 100 && !refused.contains(['\n', '\u{1b}']), "{refused}");
    }

    /// What is read from it is one record that claims 60 MiB, and then nothing.
    struct Claims {
        start: &'static [u8],
        asked: usize,
    }

    impl Read for Claims {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            self.asked = self.asked.max(buffer.len());
            self.start.read(buffer)
        }
    }

    impl Bounded for Claims {
        fn has(&self, _: usize) -> bool {
            true
        }
    }

    #[test]
    fn no_more_is_asked_for_at_once_than_a_piece() {
        let start = b"\x89MCAP0\r\n\x05\0\0\xc0\x03\0\0\0\0abc";
        let options = LinearReaderOptions::default().with_record_length_limit(64 << 20);
        let mut records = Records::new(Claims { start, asked: 0 }, options);
        assert!(records.next().unwrap().unwrap_err().contains("ended in the middle of a record"));
        assert!(records.next().is_none());
        assert_eq!(records.source.asked, PIECE);
    }
}
