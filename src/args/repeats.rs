//! YAML in which a mapping may have a key several times, as rcl reads files of parameters: two files in one, each with a
//! section `/**`, are both read. The library refuses that.
//!
//! Keeps true: all that stands in the text is in the result, in its order; from the second time on a key has a mark, which
//! [`name`] takes off.

use std::collections::BTreeMap;

use yaml_rust2::parser::{Event, MarkedEventReceiver, Parser};
use yaml_rust2::scanner::Marker;
use yaml_rust2::{Yaml, YamlLoader};

use crate::yaml::{self, YamlError};

/// Stands before the number of a key that has come before; no name in ROS has it.
const MARK: char = '\0';

/// The documents of a text.
///
/// # Errors
/// A [`YamlError`].
pub(super) fn load(text: &str) -> Result<Vec<Yaml>, YamlError> {
    // What comes before an error of form was found to be within bounds, and no more than that is read below.
    let refused = match yaml::load(text) {
        Err(refused @ YamlError::Form(_)) => refused,
        loaded => return loaded,
    };
    let mut marking = Marking::default();
    let read = Parser::new_from_str(text).load(&mut marking, true);
    let documents = marking.loader.documents();
    // The loader does not say that it has refused something: it then has fewer documents than have ended.
    if read.is_err() || documents.len() < marking.ended { Err(refused) } else { Ok(documents.to_vec()) }
}

/// A key as it stands in the text, where it is a text.
pub(super) fn name(key: &Yaml) -> Option<&str> {
    key.as_str().map(|key| unmarked(key).unwrap_or(key))
}

/// A key that has come before in its mapping, without its mark. What a text itself has behind such a letter is no mark unless it is
/// a number.
pub(super) fn unmarked(key: &str) -> Option<&str> {
    let (name, times) = key.split_once(MARK)?;
    times.parse::<usize>().is_ok().then_some(name)
}

/// Hands events on to the loader, and marks keys.
#[derive(Default)]
struct Marking {
    loader: YamlLoader,
    open: Vec<Open>,
    /// Documents that have come to their end.
    ended: usize,
}

/// A mapping or a sequence whose end has not come.
struct Open {
    /// How often each key has come; `None` in a sequence.
    keys: Option<BTreeMap<String, usize>>,
    /// Whether what comes next is a key, where it is a mapping.
    is_key: bool,
}

impl Marking {
    fn mark(&mut self, text: &mut String) {
        let Some(Open { keys: Some(keys), is_key: true }) = self.open.last_mut() else { return };
        let times = keys.entry(text.clone()).or_default();
        if *times > 0 {
            text.push(MARK);
            text.push_str(&times.to_string());
        }
        *times += 1;
    }

    fn closes(&mut self) {
        if let Some(around) = self.open.last_mut() {
            around.is_key = !around.is_key;
        }
    }
}

impl MarkedEventReceiver for Marking {
    fn on_event(&mut self, mut event: Event, at: Marker) {
        match &mut event {
            Event::MappingStart(..) => self.open.push(Open { keys: Some(BTreeMap::new()), is_key: true }),
            Event::SequenceStart(..) => self.open.push(Open { keys: None, is_key: false }),
            Event::MappingEnd | Event::SequenceEnd => {
                self.open.pop();
                self.closes();
            }
            Event::Scalar(text, _, anchor, _) => {
                // What an alias stands for stays as it is.
                if *anchor == 0 {
                    self.mark(text);
                }
                self.closes();
            }
            Event::Alias(_) => self.closes(),
            Event::DocumentEnd => self.ended += 1,
            _ => {}
        }
        self.loader.on_event(event, at);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The names and values of the mapping that a text is.
    fn of(text: &str) -> Vec<(String, Yaml)> {
        let documents = load(text).unwrap();
        assert_eq!(documents.len(), 1, "{text}");
        let map = documents[0].as_hash().unwrap();
        map.iter().map(|(key, value)| (name(key).unwrap().to_owned(), value.clone())).collect()
    }

    #[test]
    fn a_key_that_comes_again_is_there_as_often_in_its_order() {
        let integer = |name: &str, value| (name.to_owned(), Yaml::Integer(value));
        assert_eq!(
            of("a: 1\nb: 2\na: 3\na: 4\n"),
            [integer("a", 1), integer("b", 2), integer("a", 3), integer("a", 4)]
        );
        assert_eq!(of("{a: 1, 'a': 2}"), [integer("a", 1), integer("a", 2)]);
        let nested = of("x: {a: 1, a: 2}\ny: [{a: 1}, {a: 2}, a, a]\n");
        assert_eq!(nested[0].1.as_hash().unwrap().len(), 2);
        assert_eq!(nested[1].1, yaml::load("[{a: 1}, {a: 2}, a, a]").unwrap()[0]);
    }

    #[test]
    fn values_are_those_of_the_library_and_never_marked() {
        let text = "a: a\nb: [b, &x c, *x]\nc:\n  ? {k: 1, j: k}\n  : k\na: &y 1.5\nd: *y\n";
        let plain = "p: a\nb: [b, c, c]\nc:\n  ? {k: 1, j: k}\n  : k\nq: 1.5\nd: 1.5\n";
        let values =
            |found: Vec<(String, Yaml)>| found.into_iter().map(|(_, value)| value).collect::<Vec<_>>();
        assert_eq!(values(of(text)), values(of(plain)));
    }

    #[test]
    fn what_else_is_refused_stays_so() {
        for text in ["a: [", "a: b: c", "{[1]: 2, [1]: 3}", "&x a: 1\n*x : 2\n", "a: 1\na: 2\nb: [\n"] {
            assert!(matches!(load(text), Err(YamlError::Form(_))), "{text}");
        }
        let deep = format!("a: 1\na: {}1{}", "[".repeat(100), "]".repeat(100));
        assert!(matches!(load(&deep), Err(YamlError::Deep)));
        assert_eq!(load("a: 1\n---\na: 1\na: 2\n").unwrap().len(), 2);
    }
}
