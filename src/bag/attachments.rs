//! Attachments of any size are passed over: a recording may carry a map, a log or a video, of which no message tells. So is what
//! is left of a chunk that is damaged.

use std::io::{self, Read};

use mcap::MAGIC;
use mcap::records::op;

/// Opcode and length of a record (bytes).
pub(super) const PREFIX: usize = 9;

/// The checksum of the data (bytes).
const CHECKSUM: usize = 4;

/// What knows where its records end.
pub(super) trait Bounded: Read {
    /// Whether there can be so many bytes more for what is read of a chunk.
    fn has(&self, bytes: usize) -> bool;
}

impl<R: Read> Bounded for WithoutLarge<R> {
    fn has(&self, bytes: usize) -> bool {
        // Behind its end what the next record begins with is asked for.
        let left = if self.plain == 0 { PREFIX as u64 } else { self.plain };
        !matches!(self.current, Some((op::CHUNK, _))) || bytes as u64 <= left || !self.ready.is_empty()
    }
}

/// An MCAP file without its attachments of more than `limit` bytes. These are read by their length and never held in memory. All
/// other bytes come out as they are, but for the checksum of the data where something of it is left out: that is then 0, which
/// stands for none.
pub(super) struct WithoutLarge<R> {
    source: R,
    limit: u64,
    /// What comes out first.
    ready: Vec<u8>,
    /// So many bytes of the source come out behind it; then a record begins.
    plain: u64,
    /// What the record is of which the last bytes came out, and its length; `None` where another was to begin and there was none.
    current: Option<(u8, u64)>,
    has_left_out: bool,
}

impl<R: Read> WithoutLarge<R> {
    /// Reads a file from its start.
    pub(super) const fn new(source: R, limit: u64) -> Self {
        Self {
            source,
            limit,
            ready: Vec::new(),
            plain: MAGIC.len() as u64,
            current: None,
            has_left_out: false,
        }
    }

    /// Passes over what is left of a chunk; gives its length. `None` where something else came out last, or the source ends within
    /// the chunk.
    pub(super) fn pass_chunk(&mut self) -> io::Result<Option<u64>> {
        let Some((op::CHUNK, length)) = self.current.take() else { return Ok(None) };
        self.ready.clear();
        self.plain -= io::copy(&mut self.source.by_ref().take(self.plain), &mut io::sink())?;
        self.has_left_out = true;
        Ok((self.plain == 0).then_some(length))
    }

    /// Reads what a record begins with; says whether there was anything.
    fn begin_record(&mut self) -> io::Result<bool> {
        self.current = None;
        let prefix = self.some(PREFIX)?;
        let Some((opcode, length)) = opcode_and_length(&prefix) else {
            // The end of a file that is cut, or the magic of one that is whole.
            self.ready = prefix;
            return Ok(!self.ready.is_empty());
        };
        if opcode == op::ATTACHMENT && length > self.limit {
            self.has_left_out = true;
            io::copy(&mut self.source.by_ref().take(length), &mut io::sink())?;
            return Ok(true);
        }
        self.current = Some((opcode, length));
        (self.ready, self.plain) = (prefix, length);
        if opcode == op::DATA_END && self.has_left_out && length >= CHECKSUM as u64 {
            let checksum = self.some(CHECKSUM)?;
            self.plain -= checksum.len() as u64;
            self.ready.extend(checksum.iter().map(|_| 0));
        }
        Ok(true)
    }

    /// So many bytes; fewer where the source ends.
    fn some(&mut self, count: usize) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::with_capacity(count);
        self.source.by_ref().take(count as u64).read_to_end(&mut bytes)?;
        Ok(bytes)
    }
}

fn opcode_and_length(prefix: &[u8]) -> Option<(u8, u64)> {
    let (opcode, length) = prefix.split_first()?;
    Some((*opcode, u64::from_le_bytes(length.try_into().ok()?)))
}

impl<R: Read> Read for WithoutLarge<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.ready.is_empty() && self.plain == 0 {
            if buffer.is_empty() || !self.begin_record()? {
                return Ok(0);
            }
        }
        if !self.ready.is_empty() {
            let count = self.ready.len().min(buffer.len());
            buffer[..count].copy_from_slice(&self.ready[..count]);
            self.ready.drain(..count);
            return Ok(count);
        }
        let most = usize::try_from(self.plain).map_or(buffer.len(), |plain| plain.min(buffer.len()));
        let read = self.source.read(&mut buffer[..most])?;
        self.plain -= read as u64;
        Ok(read)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bytes of a record of this many.
    fn record(opcode: u8, length: u64, there: &[u8]) -> Vec<u8> {
        [&[opcode][..], &length.to_le_bytes(), there].concat()
    }

    fn whole(records: &[Vec<u8>]) -> Vec<u8> {
        [MAGIC, &records.concat(), MAGIC].concat()
    }

    /// Read in pieces of every size.
    fn passed(file: &[u8]) -> Vec<u8> {
        let read = |piece: usize| {
            let (mut source, mut out) = (WithoutLarge::new(file, 5), Vec::new());
            let mut buffer = vec![0; piece];
            loop {
                match source.read(&mut buffer).unwrap() {
                    0 => return out,
                    read => out.extend(&buffer[..read]),
                }
            }
        };
        let out = read(64);
        assert!((1..30).all(|piece| read(piece) == out));
        out
    }

    #[test]
    fn an_attachment_that_is_too_large_is_left_out_and_the_checksum_with_it() {
        let [small, large] = [5, 6].map(|size| record(op::ATTACHMENT, size as u64, &vec![7; size]));
        let message = record(op::MESSAGE, 9, b"a message");
        let [end, without] = [[1, 2, 3, 4], [0; 4]].map(|checksum| record(op::DATA_END, 4, &checksum));
        let footer = record(op::FOOTER, 3, b"end");
        let kept = whole(&[small.clone(), message.clone(), end.clone(), footer.clone()]);
        assert_eq!(passed(&kept), kept);
        let file = whole(&[large.clone(), small.clone(), large, message.clone(), end, footer.clone()]);
        assert_eq!(passed(&file), whole(&[small, message, without, footer]));
    }

    #[test]
    fn what_is_left_of_a_chunk_is_passed_over_and_of_nothing_else() {
        let [chunk, message] = [op::CHUNK, op::MESSAGE].map(|opcode| record(opcode, 9, b"some data"));
        let file = whole(&[message.clone(), chunk.clone(), message.clone()]);
        let begin = MAGIC.len() + message.len();
        for read in 1..=chunk.len() {
            let mut source = WithoutLarge::new(&file[..], 5);
            io::copy(&mut source.by_ref().take(begin as u64), &mut io::sink()).unwrap();
            assert_eq!(source.pass_chunk().unwrap(), None);
            io::copy(&mut source.by_ref().take(read as u64), &mut io::sink()).unwrap();
            assert_eq!(source.pass_chunk().unwrap(), Some(9), "{read}");
            let mut rest = Vec::new();
            source.read_to_end(&mut rest).unwrap();
            assert_eq!(rest, [&message[..], MAGIC].concat(), "{read}");
        }
        // Neither where it is cut, nor once more, nor where the file ends behind it.
        let cut = &file[..begin + chunk.len() - 1];
        let mut source = WithoutLarge::new(cut, 5);
        io::copy(&mut source.by_ref().take(begin as u64 + 1), &mut io::sink()).unwrap();
        assert_eq!([(); 2].map(|()| source.pass_chunk().unwrap()), [None; 2]);
        for more in 0..PREFIX {
            let mut source = WithoutLarge::new(&file[..begin + chunk.len() + more], 5);
            io::copy(&mut source, &mut io::sink()).unwrap();
            assert_eq!(source.pass_chunk().unwrap(), None, "{more}");
        }
    }

    #[test]
    fn what_is_cut_anywhere_or_goes_on_behind_its_end_comes_out_up_to_there() {
        let message = record(op::MESSAGE, 9, b"a message");
        let large = record(op::ATTACHMENT, u64::MAX, b"and some");
        let before = [MAGIC, &message].concat();
        assert_eq!(passed(&[&before[..], &large].concat()), before);
        for cut in 0..before.len() {
            assert_eq!(passed(&before[..cut]), before[..cut]);
        }
        let more = [&whole(&[message])[..], b"and more behind it"].concat();
        assert_eq!(passed(&more), more);
    }
}
