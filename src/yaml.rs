//! YAML from outside, read within bounds: the library follows nesting by recursion and copies what an alias names.
//!
//! Keeps true: nothing is loaded before its nesting, its size and the size of all that its aliases stand for are known to
//! be within bounds, and a file is read no further than they reach.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use thiserror::Error;
use yaml_rust2::parser::{Event, Parser};
use yaml_rust2::{ScanError, Yaml, YamlLoader};

/// Longest text (bytes): the `metadata.yaml` of a bag of a week in files of a minute has two million.
pub const MAX_BYTES: usize = 8 << 20;

/// Deepest nesting.
pub const MAX_DEPTH: usize = 64;

/// Most nodes, those that an alias stands for counted each time.
pub const MAX_NODES: usize = 1_000_000;

/// A text that is no YAML, or more than is read.
#[derive(Debug, Error)]
pub enum YamlError {
    /// Too long.
    #[error("more than {MAX_BYTES} bytes of YAML")]
    Long,
    /// Nested too deep.
    #[error("YAML nested deeper than {MAX_DEPTH}")]
    Deep,
    /// Too much in it, perhaps by aliases of aliases.
    #[error("more than {MAX_NODES} nodes of YAML, aliases written out")]
    Many,
    /// Not YAML.
    #[error(transparent)]
    Form(#[from] ScanError),
}

/// The documents of a text.
///
/// # Errors
/// A [`YamlError`].
pub fn load(text: &str) -> Result<Vec<Yaml>, YamlError> {
    check(text)?;
    Ok(YamlLoader::load_from_str(text)?)
}

/// The text of a file that may be YAML; what is longer than [`MAX_BYTES`] is cut behind that, so that [`load`] refuses it.
///
/// # Errors
/// Those of the system, and where the file is no UTF-8.
pub fn read(path: &Path) -> io::Result<String> {
    let mut bytes = Vec::new();
    File::open(path)?.take(MAX_BYTES as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > MAX_BYTES {
        // The cut may go through a letter.
        return Ok(String::from_utf8_lossy(&bytes).into_owned());
    }
    String::from_utf8(bytes).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
}

/// Whether a text is within bounds; event by event, without a tree.
///
/// # Errors
/// A [`YamlError`].
pub fn check(text: &str) -> Result<(), YamlError> {
    if text.len() > MAX_BYTES {
        return Err(YamlError::Long);
    }
    let mut extent = Extent::default();
    let mut parser = Parser::new_from_str(text);
    loop {
        let (event, _) = parser.next_token()?;
        if event == Event::StreamEnd {
            return Ok(());
        }
        extent.take(&event)?;
    }
}

/// How many nodes a part of a document has, and how deep it is.
#[derive(Clone, Copy, Default)]
struct Size {
    nodes: usize,
    depth: usize,
}

/// What has been met so far.
#[derive(Default)]
struct Extent {
    nodes: usize,
    /// Sequences and mappings that are open, each with its anchor (0: none).
    open: Vec<(usize, Size)>,
    anchored: BTreeMap<usize, Size>,
}

impl Extent {
    fn take(&mut self, event: &Event) -> Result<(), YamlError> {
        match event {
            Event::SequenceStart(anchor, _) | Event::MappingStart(anchor, _) => {
                self.open.push((*anchor, Size { nodes: 1, depth: 1 }));
                self.grow(1)?;
            }
            Event::SequenceEnd | Event::MappingEnd => {
                if let Some((anchor, size)) = self.open.pop() {
                    self.close(anchor, size)?;
                }
            }
            Event::Scalar(_, _, anchor, _) => {
                self.grow(1)?;
                self.close(*anchor, Size { nodes: 1, depth: 1 })?;
            }
            Event::Alias(anchor) => {
                // One that names nothing closed stands for nothing.
                let size = self.anchored.get(anchor).copied().unwrap_or(Size { nodes: 1, depth: 1 });
                self.grow(size.nodes)?;
                self.close(0, size)?;
            }
            _ => {}
        }
        if self.open.len() > MAX_DEPTH { Err(YamlError::Deep) } else { Ok(()) }
    }

    fn grow(&mut self, nodes: usize) -> Result<(), YamlError> {
        self.nodes += nodes;
        if self.nodes > MAX_NODES { Err(YamlError::Many) } else { Ok(()) }
    }

    /// Adds a part that is whole to the one around it.
    fn close(&mut self, anchor: usize, size: Size) -> Result<(), YamlError> {
        if anchor > 0 {
            // The library copies what has a name.
            self.grow(size.nodes)?;
            self.anchored.insert(anchor, size);
        }
        if let Some((_, around)) = self.open.last_mut() {
            around.nodes += size.nodes;
            around.depth = around.depth.max(1 + size.depth);
        }
        if self.open.len() + size.depth > MAX_DEPTH { Err(YamlError::Deep) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_yaml_is_loaded_aliases_and_all() {
        let documents = load("a: &x [1, 2]\nb: *x\n").unwrap();
        assert_eq!(documents[0]["b"][1].as_i64(), Some(2));
        assert!(load("").unwrap().is_empty());
        assert!(load("a: [").is_err() && load("*unknown").is_err());
    }

    #[test]
    fn nesting_is_refused_before_it_is_followed() {
        let deep = [
            "- ".repeat(300_000),
            "[".repeat(300_000),
            format!("{}1", "{a: ".repeat(200)),
            "? ".repeat(100_000),
            // Forty deep, twice one within the other.
            format!(
                "a: &x {}1{}\nb: {}*x{}\n",
                "[".repeat(40),
                "]".repeat(40),
                "[".repeat(40),
                "]".repeat(40)
            ),
        ];
        for text in deep {
            let error = load(&text).unwrap_err().to_string();
            // Of brackets the library itself follows 255, and it reads ahead.
            assert!(error.contains("nested deeper than 64") || error.contains("recursion limit"), "{error}");
        }
        assert!(matches!(load(&"[".repeat(100)), Err(YamlError::Deep)));
        assert!(load(&format!("{}1{}", "[".repeat(60), "]".repeat(60))).is_ok());
    }

    #[test]
    fn a_billion_laughs_are_refused_before_the_first_copy() {
        let mut text = "a0: &a0 [ha, ha, ha, ha, ha, ha, ha, ha, ha]\n".to_owned();
        for i in 1..10 {
            let line: Vec<_> = (0..9).map(|_| format!("*a{}", i - 1)).collect();
            text.extend([format!("a{i}: &a{i} ["), line.join(", "), "]\n".to_owned()]);
        }
        let error = load(&text).unwrap_err();
        assert!(matches!(error, YamlError::Many), "{error}");
    }

    #[test]
    fn a_file_without_an_end_is_read_no_further_than_the_bound() {
        let text = read(Path::new("/dev/zero")).unwrap();
        assert_eq!(text.len(), MAX_BYTES + 1);
        assert!(matches!(load(&text), Err(YamlError::Long)));
    }
}
