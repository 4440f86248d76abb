//! What a replay knows beside its story.

use std::collections::BTreeMap;

use crate::reason::Reason;

/// What the page says in words and numbers; all of it is shown as text, whatever it holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// Name of the input.
    pub title: String,
    /// The frame in which the map lives.
    pub fixed_frame: String,
    /// Parameters as (name, value).
    pub parameters: Vec<(String, String)>,
    /// Messages that could not be used, by reason.
    pub skipped: BTreeMap<Reason, u64>,
    /// What became of the points that were put into no voxel, by reason; empty where there are none.
    pub points_unused: String,
    /// Time that the replay took (s).
    pub wall_seconds: f64,
    /// Whole sentences that a reader must know, such as that the file is cut.
    pub warnings: Vec<String>,
    /// Other whole sentences, such as where the map is made.
    pub remarks: Vec<String>,
    /// Further figures.
    pub figures: Vec<Figure>,
}

/// A figure of the caller's.
///
/// The page shows it as an image, so that nothing in it can run, load or restyle the page.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Figure {
    /// What it is called, for those who cannot see it: a heading is the drawing's own.
    pub title: String,
    /// A whole SVG document.
    pub svg: String,
    /// What is to be seen.
    pub caption: String,
}
