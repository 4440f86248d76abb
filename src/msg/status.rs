//! One part of a report on `/diagnostics`.

use std::fmt::Display;

use crate::line::one_line;
use crate::msg::reports::{DiagnosticStatus, KeyValue, Level};

/// A part of the node, with the worst that is to be said of it.
pub(crate) struct StatusBuilder {
    pub(crate) status: DiagnosticStatus,
    level: Level,
}

impl StatusBuilder {
    pub(crate) fn new(node: &str, part: &str, fine: impl Into<String>) -> Self {
        let name = format!("{}: {part}", node.trim_start_matches('/'));
        Self {
            status: DiagnosticStatus { name, message: fine.into(), ..Default::default() },
            level: Level::Ok,
        }
    }

    pub(crate) fn value(&mut self, key: impl Into<String>, value: impl Display) -> &mut Self {
        self.status.values.push(KeyValue { key: key.into(), value: value.to_string() });
        self
    }

    /// Says this, with what was said before where that is as bad, alone where that is better.
    pub(crate) fn raise(&mut self, level: Level, line: impl AsRef<str>) {
        let line = one_line(line.as_ref());
        if level > self.level {
            self.level = level;
            self.status.message = line.into_owned();
        } else if level == self.level {
            self.status.message += "; ";
            self.status.message += &line;
        }
    }

    pub(crate) fn finish(mut self) -> DiagnosticStatus {
        self.status.level = self.level as u8;
        self.status
    }
}
