//! Which topics a bag holds.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read as _, Seek as _, SeekFrom};
use std::sync::atomic::{AtomicBool, Ordering};

use mcap::records::op;
use mcap::sans_io::LinearReaderOptions;

use super::attachments::{Bounded, PREFIX};
use super::bag_file::BagFile;
use super::channels::Channels;
use super::read::{MAX_MESSAGE_BYTES, Messages};
use super::records::{Record, Records};
use super::topic::{Survey, Topic};

/// From the summaries where each file has one, else from `listed`, else by reading all up to `stop`.
pub(super) fn survey(files: &[BagFile], listed: &[Topic], stop: &AtomicBool) -> Survey {
    let summaries: Option<Vec<_>> = files.iter().map(of_summary).collect();
    let (found, is_complete): (Vec<Topic>, bool) = match summaries {
        Some(summaries) => (summaries.into_iter().flatten().collect(), true),
        None if !listed.is_empty() => (listed.to_vec(), true),
        None => of_messages(files, stop),
    };
    // A bag in several files names a topic in each.
    let mut topics = BTreeMap::<(String, String, String), Option<u64>>::new();
    for topic in found {
        let known = topics.entry((topic.name, topic.type_name, topic.encoding)).or_insert(Some(0));
        // A sum that 64 bits do not hold is of numbers that are not true.
        *known = known.zip(topic.messages).and_then(|(a, b)| a.checked_add(b));
    }
    let topic = |((name, type_name, encoding), messages)| Topic { name, type_name, encoding, messages };
    Survey { topics: topics.into_iter().map(topic).collect(), is_complete }
}

/// From the end of the file; `None` where that cannot be sought or is missing.
fn of_summary(bag_file: &BagFile) -> Option<Vec<Topic>> {
    if bag_file.is_compressed {
        return None;
    }
    let (mut channels, mut counts) = (Channels::default(), None);
    for record in summary(bag_file)? {
        match record.ok()? {
            // An empty list of counts is one that was not made.
            Record::Statistics(all) => {
                counts = Some(all.channel_message_counts).filter(|counts| !counts.is_empty());
            }
            record => drop(channels.take(record).ok()?),
        }
    }
    let count = |id| counts.as_ref().map(|counts| counts.get(&id).copied().unwrap_or(0));
    let mut topics: Vec<_> = channels.all().map(|channel| topic(&channel, count(channel.id))).collect();
    topics.sort();
    // A summary may leave channels out: it then tells nothing.
    (!topics.is_empty()).then_some(topics)
}

impl Bounded for BufReader<File> {
    /// A summary has no chunks.
    fn has(&self, _: usize) -> bool {
        true
    }
}

/// The schemas and channels of a summary, as far as there is one and it can be read.
pub(super) fn channels_of_summary(bag_file: &BagFile) -> impl Iterator<Item = Record> {
    let records = Some(bag_file).filter(|bag_file| !bag_file.is_compressed).and_then(summary);
    let named = |record: &Record| matches!(record, Record::Schema { .. } | Record::Channel(_));
    records.into_iter().flatten().map_while(Result::ok).filter(named)
}

/// When the first and the last message of a file were recorded (ns), as its summary says; 0 where it has none.
pub(super) fn times(bag_file: &BagFile) -> Option<(u64, u64)> {
    let records = summary(bag_file).filter(|_| !bag_file.is_compressed)?;
    records.map_while(Result::ok).find_map(|record| match record {
        Record::Statistics(all) => Some((all.message_start_time, all.message_end_time)),
        _ => None,
    })
}

fn topic(channel: &mcap::Channel<'_>, messages: Option<u64>) -> Topic {
    Topic {
        name: channel.topic.clone(),
        type_name: channel.schema.as_ref().map_or_else(String::new, |schema| schema.name.clone()),
        encoding: channel.message_encoding.clone(),
        messages,
    }
}

/// The records of the summary, from where the footer says that it begins.
fn summary(bag_file: &BagFile) -> Option<Records<BufReader<File>>> {
    BagFile::check_regular(&bag_file.path).ok()?;
    let mut file = BufReader::new(File::open(&bag_file.path).ok()?);
    let start = summary_start(&mut file, bag_file.size)?;
    // No record is longer than what is left of the file, whatever it claims.
    let left = usize::try_from(bag_file.size.checked_sub(start)?).unwrap_or(usize::MAX);
    file.seek(SeekFrom::Start(start)).ok()?;
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_record_length_limit(left.min(MAX_MESSAGE_BYTES));
    Some(Records::new(file, options))
}

fn summary_start(file: &mut BufReader<File>, size: u64) -> Option<u64> {
    /// Where the summary begins, where its offsets begin, and a checksum.
    const FOOTER: usize = 20;
    let mut end = [0; PREFIX + FOOTER + mcap::MAGIC.len()];
    file.seek(SeekFrom::Start(size.checked_sub(end.len() as u64)?)).ok()?;
    file.read_exact(&mut end).ok()?;
    let (record, magic) = end.split_at(PREFIX + FOOTER);
    let (start, _) = record[PREFIX..].split_first_chunk()?;
    let start = u64::from_le_bytes(*start);
    (record[0] == op::FOOTER && magic == mcap::MAGIC && start > 0).then_some(start)
}

/// By reading all of it: a cut bag has no summary, and one that is compressed as a whole cannot be sought.
fn of_messages(files: &[BagFile], stop: &AtomicBool) -> (Vec<Topic>, bool) {
    let mut topics = BTreeMap::<(String, String, String), Topic>::new();
    for message in Messages::new(files.to_vec()) {
        let message = message.ok().filter(|_| !stop.load(Ordering::Relaxed));
        let Some(message) = message else { return (topics.into_values().collect(), false) };
        let found = topic(&message.channel, Some(0));
        let key = (found.name.clone(), found.type_name.clone(), found.encoding.clone());
        let known = topics.entry(key).or_insert(found);
        known.messages = known.messages.map(|count| count + 1);
    }
    (topics.into_values().collect(), true)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn numbers_whose_sum_overflows_are_no_number() {
        let topic = |messages| Topic {
            name: "/tf".to_owned(),
            type_name: "tf2_msgs/msg/TFMessage".to_owned(),
            encoding: "cdr".to_owned(),
            messages: Some(messages),
        };
        let sum = |counts: [u64; 2]| {
            // Without a summary it is the list that counts.
            let files = [BagFile::unopened(Path::new("/no/such.mcap"))];
            survey(&files, &counts.map(topic), &AtomicBool::new(false)).topics[0].messages
        };
        assert_eq!(sum([u64::MAX - 1, 1]), Some(u64::MAX));
        assert_eq!(sum([u64::MAX, 1]), None);
    }

    #[test]
    fn a_bag_that_must_be_read_for_its_topics_is_read_up_to_a_signal() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let mut writer = mcap::Writer::new(File::create(&path).unwrap()).unwrap();
        let channel_id = writer.add_channel(0, "/points", "cdr", &BTreeMap::new()).unwrap();
        let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 1, publish_time: 1 };
        (0..3).for_each(|_| writer.write_to_known_channel(&header, b"").unwrap());
        writer.finish().unwrap();
        let files = [BagFile::open(&path).unwrap()];
        let (topics, is_complete) = of_messages(&files, &AtomicBool::new(false));
        assert_eq!((topics[0].messages, is_complete), (Some(3), true));
        assert_eq!(of_messages(&files, &AtomicBool::new(true)), (Vec::new(), false));
    }
}
