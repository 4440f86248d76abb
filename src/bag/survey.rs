//! Which topics a bag holds.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek};

use mcap::sans_io::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};

use super::part::Part;
use super::read::{MAX_MESSAGE_BYTES, Messages};
use super::topic::{Survey, Topic};

/// From the summaries where each file has one, else from `listed`, else by reading all.
pub(super) fn survey(files: &[Part], listed: &[Topic]) -> Survey {
    let summaries: Option<Vec<_>> = files.iter().map(of_summary).collect();
    let (found, is_complete): (Vec<Topic>, bool) = match summaries {
        Some(summaries) => (summaries.into_iter().flatten().collect(), true),
        None if !listed.is_empty() => (listed.to_vec(), true),
        None => of_messages(files),
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
fn of_summary(part: &Part) -> Option<Vec<Topic>> {
    if part.is_compressed {
        return None;
    }
    let summary = read_summary(part)?;
    // An empty list of counts is one that was not made.
    let counts = summary.stats.as_ref().map(|stats| &stats.channel_message_counts);
    let counts = counts.filter(|counts| !counts.is_empty());
    let mut topics: Vec<_> = summary
        .channels
        .values()
        .map(|channel| topic(channel, counts.map(|counts| counts.get(&channel.id).copied().unwrap_or(0))))
        .collect();
    topics.sort();
    // A summary may leave channels out: it then tells nothing.
    (!topics.is_empty()).then_some(topics)
}

fn topic(channel: &mcap::Channel<'_>, messages: Option<u64>) -> Topic {
    Topic {
        name: channel.topic.clone(),
        type_name: channel.schema.as_ref().map_or_else(String::new, |schema| schema.name.clone()),
        encoding: channel.message_encoding.clone(),
        messages,
    }
}

fn read_summary(part: &Part) -> Option<mcap::Summary> {
    Part::check_regular(&part.path).ok()?;
    let mut file = File::open(&part.path).ok()?;
    let options =
        SummaryReaderOptions::default().with_file_size(part.size).with_record_length_limit(MAX_MESSAGE_BYTES);
    let mut reader = SummaryReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event.ok()? {
            SummaryReadEvent::ReadRequest(wanted) => {
                let read = file.read(reader.insert(wanted)).ok()?;
                reader.notify_read(read);
            }
            SummaryReadEvent::SeekRequest(to) => reader.notify_seeked(file.seek(to).ok()?),
        }
    }
    reader.finish()
}

/// By reading all of it: a cut bag has no summary, and one that is compressed as a whole cannot be sought.
fn of_messages(files: &[Part]) -> (Vec<Topic>, bool) {
    let mut topics = BTreeMap::<(String, String, String), Topic>::new();
    for message in Messages::new(files.to_vec()) {
        let Ok(message) = message else { return (topics.into_values().collect(), false) };
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
            let files = [Part::unopened(Path::new("/no/such.mcap"))];
            survey(&files, &counts.map(topic)).topics[0].messages
        };
        assert_eq!(sum([u64::MAX - 1, 1]), Some(u64::MAX));
        assert_eq!(sum([u64::MAX, 1]), None);
    }
}
