//! The records of an MCAP file that tell something of its messages, in the order of the file.

use std::io::{ErrorKind, Read};
use std::panic::{AssertUnwindSafe, catch_unwind};

use mcap::records::op;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// A record that says something of the bag's messages; it owns what it holds.
pub(super) type Record = mcap::records::Record<'static>;

/// Reads records; chunks are unpacked. Nothing comes after the first error.
pub(super) struct Records<R> {
    source: R,
    reader: LinearReader,
    is_done: bool,
}

impl<R: Read> Records<R> {
    pub(super) fn new(source: R, options: LinearReaderOptions) -> Self {
        Self { source, reader: LinearReader::new_with_options(options), is_done: false }
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
            let read = match self.source.read(self.reader.insert(wanted)) {
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                read => read.map_err(|error| reason(&error.into()))?,
            };
            self.reader.notify_read(read);
        }
    }
}

impl<R: Read> Iterator for Records<R> {
    type Item = Result<Record, String>;

    /// The next record, or what is wrong. Where overflow is checked, the library panics on a record that is longer than its
    /// chunk; where it is not, it reads on to the end of the file.
    fn next(&mut self) -> Option<Self::Item> {
        if self.is_done {
            return None;
        }
        let record = catch_unwind(AssertUnwindSafe(|| self.advance()))
            .unwrap_or_else(|_| Err("a record does not fit its chunk".to_owned()));
        self.is_done = !matches!(record, Ok(Some(_)));
        record.transpose()
    }
}

/// `None` for a record that says nothing of the messages: what is wrong inside of an attachment costs nothing.
fn parse(opcode: u8, body: &[u8]) -> Result<Option<Record>, String> {
    let strings = match opcode {
        op::HEADER => Strings(body).skip(2),
        op::SCHEMA => Strings(body).bytes(2).and_then(|rest| rest.skip(2)),
        op::CHANNEL => Strings(body).bytes(4).and_then(|rest| rest.skip(2)).and_then(Strings::map),
        op::MESSAGE | op::STATISTICS | op::DATA_END => Ok(Strings(body)),
        _ => return Ok(None),
    };
    let vetted = strings.map_err(|claimed| {
        format!(
            "a record of {} bytes (opcode {opcode:#04x}) claims to hold {claimed} more than it has",
            body.len()
        )
    });
    vetted?;
    mcap::parse_record(opcode, body).map(|record| Some(record.into_owned())).map_err(|error| reason(&error))
}

/// The rest of a record's body. The library takes memory for a string by the length that stands before it, up to 4 GB, and
/// looks afterwards whether the record has so much: so the lengths are held against the record before the library sees them.
struct Strings<'a>(&'a [u8]);

/// By how many bytes a length exceeds what is there.
type Excess = usize;

impl Strings<'_> {
    fn bytes(self, count: usize) -> Result<Self, Excess> {
        self.0.get(count..).map(Self).ok_or_else(|| count - self.0.len())
    }

    /// Length of what comes next, which is there.
    fn length(self) -> Result<(Self, usize), Excess> {
        let (length, rest) = self.0.split_first_chunk().ok_or_else(|| 4 - self.0.len())?;
        let length = usize::try_from(u32::from_le_bytes(*length)).unwrap_or(usize::MAX);
        if length > rest.len() { Err(length - rest.len()) } else { Ok((Self(rest), length)) }
    }

    fn skip(self, strings: usize) -> Result<Self, Excess> {
        (0..strings).try_fold(self, |rest, _| rest.length().and_then(|(rest, length)| rest.bytes(length)))
    }

    /// Pairs of strings that fill a length in bytes.
    fn map(self) -> Result<Self, Excess> {
        let (rest, length) = self.length()?;
        let (pairs, rest) = rest.0.split_at(length);
        let mut pairs = Self(pairs);
        while !pairs.0.is_empty() {
            pairs = pairs.skip(2)?;
        }
        Ok(Self(rest))
    }
}

/// An error with what it comes from, which its own words leave out.
pub(super) fn reason(error: &mcap::McapError) -> String {
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
            assert!(refused.contains("more than it has"), "{length}: {refused}");
        }
        for place in [4, 11, 18, 22, 27] {
            let mut lies = whole.clone();
            lies[place..place + 4].fill(0xff);
            let refused = parse(op::CHANNEL, &lies).unwrap_err();
            assert!(refused.contains("claims to hold 42949672"), "{place}: {refused}");
        }
    }
}
