//! The topics of a bag.

/// A topic of a bag.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Topic {
    /// Its name.
    pub name: String,
    /// As in `sensor_msgs/msg/PointCloud2`.
    pub type_name: String,
    /// How its messages are serialised: `cdr` can be read.
    pub encoding: String,
    /// The number of its messages, where the bag tells.
    pub messages: Option<u64>,
}

impl Topic {
    /// Whether it has this name, with or without the slash before it.
    pub fn is_called(&self, name: &str) -> bool {
        self.name.trim_start_matches('/') == name.trim_start_matches('/')
    }
}

/// What is known of a bag's topics.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Survey {
    /// By name.
    pub topics: Vec<Topic>,
    /// Whether these are all: a bag that is cut gives those before the cut, and a signal ends the search.
    pub is_complete: bool,
}
