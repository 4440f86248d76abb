//! The messages of a bag in the order of its file, or of its files by time.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use mcap::sans_io::LinearReaderOptions;

use super::attachments::WithoutLarge;
use super::bag_file::{BagFile, ZSTD, reading};
use super::channels::Channels;
use super::error::{BagError, Damage};
use super::records::Records;
use super::survey::channels_of_summary;

/// The largest message that is read (bytes): a cloud of 4,000,000 points in double precision with colour has 160 MB.
pub const MAX_MESSAGE_BYTES: usize = 512 << 20;

/// Bytes to read at once: small records then cost no call of the system each.
const BUFFER: usize = 256 << 10;

/// No sensor's message shrinks to less than this part.
const MOST_COMPRESSED: u64 = 64;

/// Files that are read side by side at most: each has a chunk and a message in memory.
const AT_ONCE: usize = 64;

/// A record that is taken whatever the file's size (bytes).
const SMALL_RECORD: u64 = 64 << 20;

/// A message as the bag holds it, decompressed when its turn comes.
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
    /// Those that are still to be opened.
    files: VecDeque<BagFile>,
    /// Those that are being read, each with its next message: one that is compressed by itself waits so for its turn.
    open: Vec<(Reader, Option<Message>)>,
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
    bag_file: BagFile,
    /// What of it is damaged.
    damage: Option<Damage>,
    /// Bytes read of it, as they are on disk.
    bytes: Arc<AtomicU64>,
}

/// A file has no more messages, and what of it could not be read.
struct End(Option<BagError>);

impl Messages {
    pub(super) fn new(files: Vec<BagFile>) -> Self {
        let (files, open) = (files.into(), Vec::new());
        Self { files, open, bytes: Arc::default(), failure: None, other_failures: 0 }
    }

    /// A counter of the bytes read so far of `Bag::size`; another thread may look at it.
    pub fn bytes_read(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.bytes)
    }

    /// Opens the next file, where none is open or its messages begin by the time `until`; says whether it did.
    fn open_next(&mut self, until: Option<u64>) -> bool {
        let is_due = |bag_file: &BagFile| {
            until.is_none_or(|until| bag_file.begins.is_some_and(|begins| begins <= until))
        };
        if self.open.len() >= AT_ONCE || !self.files.front().is_some_and(is_due) {
            return false;
        }
        let Some(bag_file) = self.files.pop_front() else { return false };
        match Reader::open(bag_file, &self.bytes) {
            Ok(reader) => self.open.push((reader, None)),
            Err(error) => self.fail(error),
        }
        true
    }

    /// Reads the next message of each file that is open; one that has none is closed.
    fn fill(&mut self) {
        let mut i = 0;
        while let Some((reader, head)) = self.open.get_mut(i) {
            match head.take().map_or_else(|| reader.advance(), Ok) {
                Ok(message) => {
                    *head = Some(message);
                    i += 1;
                }
                Err(End(error)) => {
                    self.open.remove(i);
                    error.into_iter().for_each(|error| self.fail(error));
                }
            }
        }
    }

    /// What is to be said at the end.
    fn failure(&mut self) -> Option<BagError> {
        let first = self.failure.take()?;
        let others = std::mem::take(&mut self.other_failures);
        Some(if others == 0 { first } else { BagError::Several { first: Box::new(first), others } })
    }

    fn fail(&mut self, error: BagError) {
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
            self.fill();
            let heads = self.open.iter().enumerate();
            let heads = heads.filter_map(|(i, (_, head))| Some((head.as_ref()?.log_time, i)));
            let earliest = heads.min();
            if self.open_next(earliest.map(|(time, _)| time)) {
                continue;
            }
            return match earliest {
                Some((_, i)) => {
                    let (reader, head) = &mut self.open[i];
                    head.take().map(|message| Ok(reader.decompressed(message)))
                }
                None => self.failure().map(Err),
            };
        }
    }
}

impl BagFile {
    /// Reads it, and counts the bytes.
    fn records(&self, bytes: Counters) -> Result<Records<WithoutLarge<Source>>, BagError> {
        let failed = |source| reading(&self.path, source);
        Self::check_regular(&self.path)?;
        let file = File::open(&self.path).map_err(failed)?;
        let file = BufReader::with_capacity(BUFFER, Counted { file, bytes });
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
    /// Opens a file; the bytes that are read of it are counted in `all`, too.
    fn open(bag_file: BagFile, all: &Arc<AtomicU64>) -> Result<Self, BagError> {
        let bytes = Arc::default();
        let records = bag_file.records([Arc::clone(all), Arc::clone(&bytes)])?;
        Ok(Self { records, channels: Channels::default(), bag_file, damage: None, bytes })
    }

    /// The next message, still compressed where it is so by itself. A chunk that is damaged costs what is left of it alone.
    fn advance(&mut self) -> Result<Message, End> {
        loop {
            let Some(record) = self.records.next() else { return Err(End(self.damaged())) };
            match record.and_then(|record| self.channels.take(record)) {
                Ok(Some(message)) => return Ok(message),
                Ok(None) => {}
                Err(reason) => match self.records.pass_chunk() {
                    Some(bytes) => self.pass(bytes, reason),
                    None => return Err(self.cut(reason)),
                },
            }
        }
    }

    /// A chunk of so many bytes is damaged.
    fn pass(&mut self, bytes: u64, reason: String) {
        if self.damage.as_ref().is_none_or(|damage| damage.chunks == 0) {
            self.channels.lack(channels_of_summary(&self.bag_file));
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
    /// no other. Done when a message's turn has come: of all files that are read side by side, one holds an unpacked message at a time.
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
    fn damaged(&self) -> Option<BagError> {
        Some(BagError::Damaged { path: self.bag_file.path.clone(), damage: self.damage()? })
    }

    /// What of it is damaged, and what is lost with that.
    fn damage(&self) -> Option<Damage> {
        let without_channel = self.channels.passed_over();
        self.damage.clone().map(|damage| Damage { without_channel, ..damage })
    }

    fn cut(&self, reason: String) -> End {
        if self.bag_file.size == 0 {
            return End(Some(BagError::Empty { path: self.bag_file.path.clone() }));
        }
        let before = self.damage().map_or_else(String::new, |damage| format!("; before that, {damage}"));
        let reason = reason + &before;
        let bytes = self.bytes.load(Ordering::Relaxed);
        End(Some(BagError::Cut { path: self.bag_file.path.clone(), bytes, size: self.bag_file.size, reason }))
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

/// Bytes read of all files, and of one.
type Counters = [Arc<AtomicU64>; 2];

/// A file that counts what is read of it.
struct Counted {
    file: File,
    bytes: Counters,
}

impl Read for Counted {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(buffer)?;
        for bytes in &self.bytes {
            bytes.fetch_add(read as u64, Ordering::Relaxed);
        }
        Ok(read)
    }
}
