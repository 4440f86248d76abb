//! What a surface is to a robot.

use serde::{Deserialize, Serialize};

/// The class of a cluster, numbered as in `SurfaceCluster.msg`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[repr(u8)]
pub enum SurfaceClass {
    /// Not computed, or none of the others.
    #[default]
    Unknown = 0,
    /// Level, faces up, the ground of its storey.
    Floor = 1,
    /// Level, faces down, above the sensor, or was so before.
    Ceiling = 2,
    /// Upright.
    Wall = 3,
    /// Level, faces up, raised: table, shelf, step.
    Horizontal = 4,
    /// Neither level nor upright.
    Slope = 5,
    /// No plane fits.
    Curved = 6,
    /// Upright, of a door's size, within a wall and out of its plane, or hinged to one and open.
    Door = 7,
}

impl SurfaceClass {
    /// The number in the message.
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// The class as a person reads it, and other messages name it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Floor => "floor",
            Self::Ceiling => "ceiling",
            Self::Wall => "wall",
            Self::Horizontal => "horizontal",
            Self::Slope => "slope",
            Self::Curved => "curved",
            Self::Door => "door",
        }
    }
}
