//! Why a command line was refused.

use std::path::PathBuf;

use ros2args::Ros2ArgsError;
use thiserror::Error;
use yaml_rust2::ScanError;

use super::params_file::MAX_NAME_BYTES;
use crate::config::ConfigError;
use crate::yaml::YamlError;

/// A command line that cannot be.
#[derive(Debug, Error)]
pub enum ArgsError {
    /// Not in the form of ROS arguments.
    #[error(transparent)]
    Form(#[from] Ros2ArgsError),
    /// A parameter that cannot be.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A parameter of a file that is refused.
    #[error("{error}; it stands in {file} under `{section}`")]
    InFile {
        /// Why.
        error: Box<Self>,
        /// The file.
        file: PathBuf,
        /// The nodes that it is for there.
        section: String,
    },
    /// A parameter of a type that no parameter has.
    #[error("{name} is {value}; it must be {must}")]
    Type {
        /// The parameter.
        name: String,
        /// As given.
        value: String,
        /// What it can be, of a parameter that is not known any type there is.
        must: String,
    },
    /// A parameter without a value.
    #[error("{name} is given no value; an empty text is -p \"{name}:=''\"")]
    Empty {
        /// The parameter.
        name: String,
    },
    /// A list without its end: the shell takes it apart at blanks.
    #[error(
        "{name} is `{begin}`, which is cut short: quote the whole of it for the shell: -p '{name}:=[...]'"
    )]
    Cut {
        /// The parameter.
        name: String,
        /// How the value begins.
        begin: String,
    },
    /// A value that cannot be read.
    #[error("{name} is `{begin}`, which is no YAML: {error}")]
    NoYaml {
        /// The parameter.
        name: String,
        /// How the value begins.
        begin: String,
        /// Why.
        error: ScanError,
    },
    /// A name that is too long, perhaps joined from those of nested maps.
    #[error("the name of the parameter `{begin}...` has {bytes} bytes; at most {MAX_NAME_BYTES} are read")]
    LongName {
        /// How it begins.
        begin: String,
        /// Its length.
        bytes: usize,
    },
    /// A value that is more than is read.
    #[error("the value of {name} is refused: {bound}")]
    Value {
        /// What stands before `:=`.
        name: String,
        /// Why.
        bound: YamlError,
    },
    /// `ROS_DOMAIN_ID` out of range.
    #[error("ROS_DOMAIN_ID is {0:?}; it must be from 0 to 232")]
    Domain(String),
    /// Two sensors that would be read from one topic.
    #[error(
        "the sensors {first} and {second} are both read from {topic}, which would fill the map twice; give one of them another topic with -r"
    )]
    SameTopic {
        /// The sensor that is named first.
        first: String,
        /// The sensor that would be read from its topic too.
        second: String,
        /// Fully qualified.
        topic: String,
    },
    /// A topic that would be read as messages of two types.
    #[error(
        "{topic} is read as {first} and as {second}: it can carry one of them; give the other another topic with -r"
    )]
    TwoTypes {
        /// The first, with the name that a rule for it begins with.
        first: String,
        /// The second, with its name.
        second: String,
        /// Fully qualified.
        topic: String,
    },
    /// A name that cannot be resolved.
    #[error("the name `{0}` cannot be resolved: {1}")]
    Name(String, Ros2ArgsError),
}
