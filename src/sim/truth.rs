//! What each simulated surface is, in the words a planner uses.
//!
//! The names are those of the clusters' classes, so that a result can be compared with the truth by name; the enum is
//! the simulator's own and knows nothing of how clusters are classified.

/// What a surface is to a planner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Class {
    /// What the robot drives on.
    Floor,
    /// What closes a room at the top.
    Ceiling,
    /// Upright: walls, closed flush doors, sides of furniture from 0.1 m of height and width on.
    Wall,
    /// A door leaf that stands open by 15 degrees or more.
    Door,
    /// Raised and facing up: tables, shelves, seats, steps, from 0.1 m of length and width on.
    Horizontal,
    /// Facing up at an angle of 10 to 80 degrees from the level: ramps, leaning boards.
    Slope,
    /// Bent: sides of cylinders, balls.
    Curved,
    /// None of these: undersides, legs, edges of boards.
    Other,
}

impl Class {
    /// Its name; `unknown` where no class of a planner is meant.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Floor => "floor",
            Self::Ceiling => "ceiling",
            Self::Wall => "wall",
            Self::Door => "door",
            Self::Horizontal => "horizontal",
            Self::Slope => "slope",
            Self::Curved => "curved",
            Self::Other => "unknown",
        }
    }
}
