//! Why a bag cannot be read, or not to its end.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::files::METADATA;

/// A bag, or a part of one, that cannot be read.
#[derive(Debug, Error)]
pub enum BagError {
    /// The system gives no access.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A recording of ROS 1.
    #[error(
        "{} is a bag of ROS 1; convert it: rosbags-convert --src {} --dst {} --dst-storage mcap",
        path.display(),
        quoted(path),
        quoted(folder)
    )]
    Ros1 {
        /// The file.
        path: PathBuf,
        /// A folder for the result.
        folder: PathBuf,
    },
    /// A recording in a data base.
    #[error(
        "{} is a bag in SQLite; convert it: {}",
        path.display(),
        conversion(sources, folder)
    )]
    Sqlite {
        /// The file, or the folder that names it.
        path: PathBuf,
        /// The folder with its `metadata.yaml`, or its files where it has none.
        sources: Vec<PathBuf>,
        /// A folder for the result.
        folder: PathBuf,
    },
    /// What the node has learned.
    #[error(
        "{} is a saved map and no bag; the node goes on with it: cfodi run --resume --ros-args -p snapshot_path:={}",
        path.display(),
        quoted(path)
    )]
    SavedMap {
        /// The file.
        path: PathBuf,
    },
    /// Something else.
    #[error("{} is no MCAP file: it begins with {start}{}", path.display(), instead_of(path))]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// Its first bytes, escaped.
        start: String,
    },
    /// A folder without a recording.
    #[error("{} holds neither a metadata.yaml nor a file *.mcap", path.display())]
    NoBag {
        /// The folder.
        path: PathBuf,
    },
    /// A `metadata.yaml` that says nothing.
    #[error("{}: {what}", path.display())]
    Metadata {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// Several files of a bag.
    #[error("{first}; {others} more of its files could not be read in full")]
    Several {
        /// Of the first of them.
        first: Box<Self>,
        /// The number of the others.
        others: usize,
    },
    /// Nothing is in it.
    #[error("{} is empty", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// It has been read to its end, but for what is damaged.
    #[error("{} is damaged; {damage}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What of it.
        damage: Damage,
    },
    /// The bag ends in the middle, or what is damaged leaves no way to go on.
    #[error("{} is cut or damaged; {bytes} of its {size} bytes were looked at: {reason}", path.display())]
    Cut {
        /// The file.
        path: PathBuf,
        /// How much of it has been read.
        bytes: u64,
        /// All of it.
        size: u64,
        /// What was found there.
        reason: String,
    },
}

/// Chunks of a file, and messages that are compressed by themselves, which could not be read in full; and what was lost with them.
#[derive(Clone, Debug, Default, PartialEq, Eq, Error)]
#[error(
    "{}, of {bytes} bytes, could not be read in full{}: {reason}",
    parts(*.chunks, *.messages),
    lost(*.without_channel)
)]
pub struct Damage {
    /// How many chunks.
    pub chunks: u64,
    /// How many messages.
    pub messages: u64,
    /// Of all of these, as they are in the file.
    pub bytes: u64,
    /// How many messages were passed over, because one of these chunks alone has named their channel or its schema.
    pub without_channel: u64,
    /// What was found in the first.
    pub reason: String,
}

impl BagError {
    /// Whether another argument would have been right, as opposed to an input that cannot be read in full.
    pub fn is_wrong_argument(&self) -> bool {
        matches!(
            self,
            Self::Ros1 { .. }
                | Self::Sqlite { .. }
                | Self::SavedMap { .. }
                | Self::NotMcap { .. }
                | Self::NoBag { .. }
        )
    }
}

/// What to give in place of a file that is no recording, but stands beside one.
fn instead_of(path: &Path) -> &'static str {
    let is_metadata = path.file_name().is_some_and(|name| name == METADATA);
    if is_metadata { "; give the folder that it lies in" } else { "" }
}

/// How many parts of a file, by kind; none of a kind of which there are none.
fn parts(chunks: u64, messages: u64) -> String {
    let kinds = [(chunks, "chunks"), (messages, "compressed messages")];
    let kinds = kinds.iter().filter(|(count, _)| *count > 0);
    kinds.map(|(count, kind)| format!("{count} of its {kind}")).collect::<Vec<_>>().join(" and ")
}

/// What else is lost of a file; nothing where there are no such messages.
fn lost(without_channel: u64) -> String {
    if without_channel == 0 {
        return String::new();
    }
    format!(", nor could {without_channel} of its messages, whose channel or schema nothing else names")
}

/// The commands that convert data bases; `rosbags-convert` takes no file that is packed.
fn conversion(sources: &[PathBuf], folder: &Path) -> String {
    let is_packed = |path: &Path| path.extension().is_some_and(|end| end == "zst" || end == "zstd");
    let (mut commands, mut unpacked) = (Vec::new(), Vec::new());
    for path in sources {
        if is_packed(path) {
            let plain = quoted(&path.with_extension(""));
            commands.push(format!("zstd -d {} -o {plain}", quoted(path)));
            unpacked.push(plain);
        } else {
            unpacked.push(quoted(path));
        }
    }
    let sources = unpacked.join(" ");
    commands.push(format!("rosbags-convert --src {sources} --dst {} --dst-storage mcap", quoted(folder)));
    commands.join(" && ")
}

/// As a shell takes it.
fn quoted(path: &Path) -> String {
    let text = path.to_string_lossy();
    let is_plain = |letter: char| letter.is_alphanumeric() || "/._-+".contains(letter);
    if text.chars().all(is_plain) { text.into_owned() } else { format!("'{}'", text.replace('\'', r"'\''")) }
}
