//! How a topic was offered, as `rosbag2` keeps it with a channel: a player offers it again so.

use crate::msg::topic::Qos;

/// In the words of `rosbag2` since Jazzy; readers want every field.
pub(super) fn offered(Qos { reliable, latched, depth }: Qos) -> String {
    let reliability = if reliable { "reliable" } else { "best_effort" };
    let durability = if latched { "transient_local" } else { "volatile" };
    format!(
        "- {{history: keep_last, depth: {depth}, reliability: {reliability}, durability: {durability}, \
         deadline: {{sec: 0, nsec: 0}}, lifespan: {{sec: 0, nsec: 0}}, liveliness: automatic, \
         liveliness_lease_duration: {{sec: 0, nsec: 0}}, avoid_ros_namespace_conventions: false}}"
    )
}

/// The policies that were numbers before Jazzy, with the words for these (`rmw/types.h`, `rmw/qos_string_conversions.h`).
const POLICIES: [(&str, &[&str]); 4] = [
    ("history", &["system_default", "keep_last", "keep_all", "unknown"]),
    ("reliability", &["system_default", "reliable", "best_effort", "unknown", "best_available"]),
    ("durability", &["system_default", "transient_local", "volatile", "unknown", "best_available"]),
    (
        "liveliness",
        &["system_default", "automatic", "manual_by_node", "manual_by_topic", "unknown", "best_available"],
    ),
];

/// What a recorder offered, with words for the numbers: a result has topics of ours, which are in words, and a player reads all
/// of a bag in one way.
pub(super) fn in_words(offered: &str) -> String {
    let mut text = String::with_capacity(offered.len());
    for line in offered.split_inclusive('\n') {
        match worded(line) {
            Some((key, word)) => text.extend([key, ": ", word, &line[line.trim_end().len()..]]),
            None => text.push_str(line),
        }
    }
    text
}

/// A line of a policy that is a number: all before the colon, and the word.
fn worded(line: &str) -> Option<(&str, &'static str)> {
    let (key, value) = line.trim_end().split_once(": ")?;
    let name = key.trim_start().trim_start_matches("- ");
    let (_, words) = POLICIES.iter().find(|(policy, _)| *policy == name)?;
    let word = words.get(value.trim().parse::<usize>().ok()?)?;
    Some((key, word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_humble_recorded_is_said_in_words_and_what_is_in_words_stays() {
        let humble = "- history: 3\n  depth: 0\n  reliability: 1\n  durability: 2\n  deadline:\n    sec: 9223372036\n    \
                      nsec: 854775807\n  liveliness: 1\n  avoid_ros_namespace_conventions: false\n- history: 1\r\n  durability: 1";
        let words = "- history: unknown\n  depth: 0\n  reliability: reliable\n  durability: volatile\n  deadline:\n    \
                     sec: 9223372036\n    nsec: 854775807\n  liveliness: automatic\n  avoid_ros_namespace_conventions: false\n- \
                     history: keep_last\r\n  durability: transient_local";
        assert_eq!(in_words(humble), words);
        for same in [words, &offered(Qos::latched(1)), "", "- history: 99\n  depth: 1", "  history 3"] {
            assert_eq!(in_words(same), same);
        }
    }
}
