//! What is said: lines so often that none comes without end, and remarks at the end.

use std::collections::BTreeMap;

/// Different lines that are said at most: a bag can make up ever new ones.
const LINES: usize = 20;

/// How much of a line tells it from others: names from a bag can be of any length.
const CHARACTERS: usize = 500;

/// What is said at the end of a replay.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Remark {
    /// A line of the log.
    pub text: String,
    /// Whether something may be wrong.
    pub is_warning: bool,
}

impl Remark {
    pub(super) const fn warning(text: String) -> Self {
        Self { text, is_warning: true }
    }
}

/// What has been said how often.
#[derive(Debug, Default)]
pub(super) struct Said(BTreeMap<String, u32>);

impl Said {
    /// Counts a line; says whether it is to be said: the first `most` times, and of different lines the first [`LINES`].
    pub(super) fn is_due(&mut self, line: &str, most: u32) -> bool {
        let line: String = line.chars().take(CHARACTERS).collect();
        if !self.0.contains_key(&line) && self.0.len() >= LINES {
            return false;
        }
        let times = self.0.entry(line).or_default();
        *times = times.saturating_add(1);
        *times <= most
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_said_so_often_and_ever_new_ones_are_not_said_for_ever() {
        let mut said = Said::default();
        assert_eq!([(); 3].map(|()| said.is_due("a", 2)), [true, true, false]);
        assert_eq!((0..1000).filter(|i| said.is_due(&i.to_string(), 1)).count(), LINES - 1);
    }
}
