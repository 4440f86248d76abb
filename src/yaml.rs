//! YAML from outside, read within bounds: the library follows nesting by recursion and copies what an alias names.
//!
//! Keeps true: nothing is loaded before its nesting, its nodes and its text are known to be within bounds, all that its
//! aliases stand for among them, and a file is read no further than they reach.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use thiserror::Error;
use yaml_rust2::parser::{Event, Parser, Tag};
use yaml_rust2::{ScanError, Yaml, YamlLoader};

/// Longest text (bytes): the `metadata.yaml` of a bag of a week in files of a minute has two million.
pub const MAX_BYTES: usize = 8 << 20;

/// Deepest nesting.
pub const MAX_DEPTH: usize = 64;

/// Most nodes, those that an alias stands for counted each time.
pub const MAX_NODES: usize = 1_000_000;

/// Most text in scalars and tags (bytes), that which an alias stands for counted each time: one node may have all of a file.
pub const MAX_TEXT_BYTES: usize = 64 << 20;

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
    /// Too much text in it, perhaps one long text by many aliases: so many bytes up to where that was seen.
    #[error("{0} bytes of text in YAML and more, aliases written out; at most {MAX_TEXT_BYTES} are read")]
    Heavy(usize),
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
    let text = String::from_utf8(bytes).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))?;
    // YAML 1.2, 5.2: a byte order mark at its beginning is no part of it. The parser takes it for a letter of the first key.
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
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

/// How many nodes and bytes of text a part of a document has, and how deep it is.
#[derive(Clone, Copy, Default)]
struct Size {
    nodes: usize,
    bytes: usize,
    depth: usize,
}

impl Size {
    /// That of a single node; a tag stands for the prefix that the document declares for it.
    fn of(text: &str, tag: Option<&Tag>) -> Self {
        let tag = tag.map_or(0, |tag| tag.handle.len() + tag.suffix.len());
        Self { nodes: 1, bytes: text.len() + tag, depth: 1 }
    }
}

/// What has been met so far.
#[derive(Default)]
struct Extent {
    nodes: usize,
    bytes: usize,
    /// Sequences and mappings that are open, each with its anchor (0: none).
    open: Vec<(usize, Size)>,
    anchored: BTreeMap<usize, Size>,
}

impl Extent {
    fn take(&mut self, event: &Event) -> Result<(), YamlError> {
        match event {
            Event::SequenceStart(anchor, tag) | Event::MappingStart(anchor, tag) => {
                let size = Size::of("", tag.as_ref());
                self.open.push((*anchor, size));
                self.grow(size)?;
            }
            Event::SequenceEnd | Event::MappingEnd => {
                if let Some((anchor, size)) = self.open.pop() {
                    self.close(anchor, size)?;
                }
            }
            Event::Scalar(text, _, anchor, tag) => {
                let size = Size::of(text, tag.as_ref());
                self.grow(size)?;
                self.close(*anchor, size)?;
            }
            Event::Alias(anchor) => {
                // One that names nothing closed stands for nothing.
                let size = self.anchored.get(anchor).copied().unwrap_or(Size::of("", None));
                self.grow(size)?;
                self.close(0, size)?;
            }
            _ => {}
        }
        if self.open.len() > MAX_DEPTH { Err(YamlError::Deep) } else { Ok(()) }
    }

    fn grow(&mut self, size: Size) -> Result<(), YamlError> {
        self.nodes += size.nodes;
        self.bytes += size.bytes;
        if self.nodes > MAX_NODES {
            return Err(YamlError::Many);
        }
        if self.bytes > MAX_TEXT_BYTES { Err(YamlError::Heavy(self.bytes)) } else { Ok(()) }
    }

    /// Adds a part that is whole to the one around it.
    fn close(&mut self, anchor: usize, size: Size) -> Result<(), YamlError> {
        if anchor > 0 {
            // The library copies what has a name.
            self.grow(size)?;
            self.anchored.insert(anchor, size);
        }
        if let Some((_, around)) = self.open.last_mut() {
            around.nodes += size.nodes;
            around.bytes += size.bytes;
            around.depth = around.depth.max(1 + size.depth);
        }
        if self.open.len() + size.depth > MAX_DEPTH { Err(YamlError::Deep) } else { Ok(()) }
    }
}

/// Nine words, named and repeated nine times, which is repeated nine times, and so on.
#[cfg(test)]
pub fn billion_laughs() -> String {
    let first = "a0: &a0 [ha, ha, ha, ha, ha, ha, ha, ha, ha]\n".to_owned();
    (1..10).fold(first, |text, i| {
        text + &format!("a{i}: &a{i} [{}]\n", vec![format!("*a{}", i - 1); 9].join(", "))
    })
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
    fn a_byte_order_mark_is_no_part_of_the_first_key() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("of-an-editor.yaml");
        std::fs::write(&path, "\u{feff}cfodi: 7\n").unwrap();
        assert_eq!(load(&read(&path).unwrap()).unwrap()[0]["cfodi"].as_i64(), Some(7));
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
        let error = load(&billion_laughs()).unwrap_err();
        assert!(matches!(error, YamlError::Many), "{error}");
    }

    #[test]
    fn a_long_text_by_many_aliases_is_refused_before_it_is_loaded() {
        let text = |bytes, aliases| {
            format!("a: &x \"{}\"\nb: [{}]\n", "y".repeat(bytes), vec!["*x"; aliases].join(", "))
        };
        assert!(check(&text(1 << 20, 61)).is_ok());
        // Twice four MiB for a text with a name, fourteen times for its aliases, and two keys; all would be a terabyte.
        let error = load(&text(4 << 20, 300_000)).unwrap_err().to_string();
        assert_eq!(
            error,
            "67108866 bytes of text in YAML and more, aliases written out; at most 67108864 are read"
        );
        // The prefix of a tag is copied for each node as well.
        let tags = format!("%TAG !e! tag:{}\n---\n[{}1]\n", "y".repeat(1 << 20), "!e!a 1, ".repeat(1000));
        assert!(matches!(load(&tags), Err(YamlError::Heavy(_))));
    }

    #[test]
    fn a_file_without_an_end_is_read_no_further_than_the_bound() {
        let text = read(Path::new("/dev/zero")).unwrap();
        assert_eq!(text.len(), MAX_BYTES + 1);
        assert!(matches!(load(&text), Err(YamlError::Long)));
    }
}
