//! The messages of a bag in the order of its file.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use mcap::sans_io::LinearReaderOptions;

use super::attachments::WithoutLarge;
use super::channels::Channels;
use super::error::{BagError, Damage};
use super::part::{Part, ZSTD, reading};
use super::records::Records;
use super::survey::channels_of_summary;

/// The largest message that is read (bytes): a cloud of 4,000,000 points in double precision with colour has 160 MB.
pub const MAX_MESSAGE_BYTES: usize = 512 << 20;

/// Bytes to read at once: small records then cost no call of the system each.
const BUFFER: usize = 256 << 10;

/// No sensor's message shrinks to less than this part.
const MOST_COMPRESSED: u64 = 64;

/// A record that is taken whatever the file's size (bytes).
const SMALL_RECORD: u64 = 64 << 20;

/// A message as the bag holds it; decompressed.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Topic, type and encoding.
    pub channel: Arc<mcap::Channel<'static>>,
    /// When it was recorded (ns).
    pub log_time: u64,
    /// When it was sent, as its sender or the recorder says (ns).
    pub publish_time: u64,
    /// Its number among those of its sender; 0 where nobody counts.
    pub sequence: u32,
    /// The serialised message, with the four bytes that begin CDR; compressed as it was, where that could not be undone.
    pub data: Vec<u8>,
    /// Why its compression could not be undone.
    pub damage: Option<String>,
}

impl Message {
    /// The topic's name.
    pub fn topic(&self) -> &str {
        &self.channel.topic
    }

    /// The type, as in `sensor_msgs/msg/PointCloud2`; empty where the bag does not tell.
    pub fn type_name(&self) -> &str {
        self.channel.schema.as_ref().map_or("", |schema| &schema.name)
    }

    /// The serialised message, or why there is none.
    pub(super) fn plain(&self) -> Result<&[u8], String> {
        self.damage.as_ref().map_or(Ok(&self.data), |damage| Err(damage.clone()))
    }
}

/// Reads a bag's messages. What cannot be read of a file is said last, after the messages of the files behind it.
pub struct Messages {
    files: Vec<Part>,
    /// The file being read, and its place among the bag's files.
    current: Option<Reader>,
    next: usize,
    /// Bytes read of all files, as they are on disk.
    bytes: Arc<AtomicU64>,
    /// The first error, and the number of files with further ones.
    failure: Option<BagError>,
    other_failures: usize,
}

type Source = Box<dyn Read + Send>;

struct Reader {
    records: Records<WithoutLarge<Source>>,
    channels: Channels,
    part: Part,
    /// What of it is damaged.
    damage: Option<Damage>,
    /// Bytes read of the files before.
    before: u64,
}

impl Messages {
    pub(super) fn new(files: Vec<Part>) -> Self {
        Self { files, current: None, next: 0, bytes: Arc::default(), failure: None, other_failures: 0 }
    }

    /// A counter of the bytes read so far of `Bag::size`; another thread may look at it.
    pub fn bytes_read(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.bytes)
    }

    /// Opens the next file; there is none where this gives `None`.
    fn open_next(&mut self) -> Option<Result<Reader, BagError>> {
        let part = self.files.get(self.next).cloned()?;
        self.next += 1;
        let before = self.bytes.load(Ordering::Relaxed);
        let records = part.records(&self.bytes);
        Some(records.map(|records| Reader {
            records,
            channels: Channels::default(),
            part,
            damage: None,
            before,
        }))
    }

    /// What is to be said at the end.
    fn failure(&mut self) -> Option<BagError> {
        let first = self.failure.take()?;
        let others = std::mem::take(&mut self.other_failures);
        Some(if others == 0 { first } else { BagError::Several { first: Box::new(first), others } })
    }

    fn fail(&mut self, error: BagError) {
        self.current = None;
        if self.failure.is_none() {
            self.failure = Some(error);
        } else {
            self.other_failures += 1;
        }
    }
}

impl Iterator for Messages {
    type Item = Result<Message, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let Some(reader) = &mut self.current else {
                match self.open_next() {
                    Some(Ok(reader)) => self.current = Some(reader),
                    Some(Err(error)) => self.fail(error),
                    None => return self.failure().map(Err),
                }
                continue;
            };
            match reader.advance() {
                Some(Ok(message)) => return Some(Ok(message)),
                Some(Err(reason)) => {
                    let error = reader.cut(reason, &self.bytes);
                    self.fail(error);
                }
                None => match reader.damaged() {
                    Some(error) => self.fail(error),
                    None => self.current = None,
                },
            }
        }
    }
}

impl Part {
    fn records(&self, bytes: &Arc<AtomicU64>) -> Result<Records<WithoutLarge<Source>>, BagError> {
        let failed = |source| reading(&self.path, source);
        Self::check_regular(&self.path)?;
        let file = File::open(&self.path).map_err(failed)?;
        let file = BufReader::with_capacity(BUFFER, Counted { file, bytes: Arc::clone(bytes) });
        // A record's length is an unchecked number, and memory is taken by it: a small file has no giant ones.
        let limit = self.size.saturating_mul(MOST_COMPRESSED).max(SMALL_RECORD).min(MAX_MESSAGE_BYTES as u64);
        let options = LinearReaderOptions::default()
            .with_check_finishes_after_end_magic(true)
            .with_validate_chunk_crcs(true)
            .with_validate_data_section_crc(true)
            .with_record_length_limit(usize::try_from(limit).unwrap_or(usize::MAX));
        let source: Source = if self.is_compressed {
            Box::new(zstd::Decoder::with_buffer(file).map_err(failed)?)
        } else {
            Box::new(file)
        };
        Ok(Records::new(WithoutLarge::new(source, limit), options))
    }
}

impl Reader {
    /// The next message, or what is wrong. A chunk that is damaged costs what is left of it alone.
    fn advance(&mut self) -> Option<Result<Message, String>> {
        loop {
            let record = match self.records.next()? {
                Ok(record) => record,
                Err(reason) => match self.records.pass_chunk() {
                    Some(bytes) => {
                        self.pass(bytes, reason);
                        continue;
                    }
                    None => return Some(Err(reason)),
                },
            };
            if let Some(message) = self.channels.take(record).transpose() {
                return Some(message.map(|message| self.decompressed(message)));
            }
        }
    }

    /// A chunk of so many bytes is damaged.
    fn pass(&mut self, bytes: u64, reason: String) {
        if self.damage.as_ref().is_none_or(|damage| damage.chunks == 0) {
            self.channels.lack(channels_of_summary(&self.part));
        }
        self.count(bytes, reason).chunks += 1;
    }

    /// Counts so many damaged bytes.
    fn count(&mut self, bytes: u64, reason: String) -> &mut Damage {
        let damage = self.damage.get_or_insert_with(|| Damage { reason, ..Damage::default() });
        damage.bytes += bytes;
        damage
    }

    /// Undoes the compression of single messages, which no record tells: their channel still says `cdr`. One that is damaged costs
    /// no other.
    fn decompressed(&mut self, mut message: Message) -> Message {
        if message.data.starts_with(ZSTD) {
            match decompress(&message.data) {
                Ok(plain) => message.data = plain,
                Err(error) => {
                    let reason = format!("a compressed message: {error}");
                    self.count(message.data.len() as u64, reason.clone()).messages += 1;
                    message.damage = Some(reason);
                }
            }
        }
        message
    }

    /// What is to be said of a file that has been read to its end.
    fn damaged(&mut self) -> Option<BagError> {
        let damage = self.damage.take()?;
        Some(BagError::Damaged { path: self.part.path.clone(), damage })
    }

    fn cut(&self, reason: String, bytes: &AtomicU64) -> BagError {
        if self.part.size == 0 {
            return BagError::Empty { path: self.part.path.clone() };
        }
        let before =
            self.damage.as_ref().map_or_else(String::new, |damage| format!("; before that, {damage}"));
        let reason = reason + &before;
        let bytes = bytes.load(Ordering::Relaxed) - self.before;
        BagError::Cut { path: self.part.path.clone(), bytes, size: self.part.size, reason }
    }
}

/// The size that the frame claims is not believed: memory is doubled as long as something really comes out, and never taken
/// beyond the bound.
fn decompress(data: &[u8]) -> io::Result<Vec<u8>> {
    const FIRST: usize = 1 << 16;
    let mut decoder = zstd::Decoder::with_buffer(data)?;
    let mut plain = Vec::new();
    loop {
        let more = plain.len().max(FIRST).min(MAX_MESSAGE_BYTES + 1 - plain.len());
        plain.try_reserve_exact(more)?;
        let read = decoder.by_ref().take(more as u64).read_to_end(&mut plain)?;
        if plain.len() > MAX_MESSAGE_BYTES {
            return Err(io::Error::other(format!("more than {MAX_MESSAGE_BYTES} bytes")));
        }
        if read < more {
            return Ok(plain);
        }
    }
}

/// A file that counts what is read of it.
struct Counted {
    file: File,
    bytes: Arc<AtomicU64>,
}

impl Read for Counted {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(buffer)?;
        self.bytes.fetch_add(read as u64, Ordering::Relaxed);
        Ok(read)
    }
}
