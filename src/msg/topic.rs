//! What a topic is called, of which type it is, and how it is offered or listened to.

/// Of a topic or service: its name, and its type as `sensor_msgs/msg/PointCloud2`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say all")]
pub struct Named<'a> {
    pub name: &'a str,
    pub type_name: &'a str,
}

/// A quality of service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Qos {
    /// What is lost on the way is sent again.
    pub reliable: bool,
    /// The newest are kept for late readers: "transient local".
    pub latched: bool,
    /// Messages that are kept.
    pub depth: usize,
}

impl Qos {
    /// For those who read now.
    pub const fn reliable(depth: usize) -> Self {
        Self { reliable: true, latched: false, depth }
    }

    /// For late readers too.
    pub const fn latched(depth: usize) -> Self {
        Self { reliable: true, latched: true, depth }
    }

    /// What may be lost.
    pub const fn best_effort(depth: usize) -> Self {
        Self { reliable: false, latched: false, depth }
    }
}

/// A topic that is sent, or heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Its name in the program: remappings give it another.
    pub name: &'static str,
    /// Its type, as `sensor_msgs/msg/PointCloud2`.
    pub type_name: &'static str,
    /// How it is offered, or listened to.
    pub qos: Qos,
}

impl Topic {
    /// A topic's row.
    pub const fn new(name: &'static str, type_name: &'static str, qos: Qos) -> Self {
        Self { name, type_name, qos }
    }

    /// Name and type, without the quality of service.
    pub const fn named(self) -> Named<'static> {
        Named { name: self.name, type_name: self.type_name }
    }
}
