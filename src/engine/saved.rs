//! A whole map as plain data: all that an engine needs to go on as if it had never stopped.
//!
//! What can be found again is not in it: patches, joins, outlines and sums of clusters follow from the voxels and come out
//! the same to the last bit. So nothing in a restored map can contradict its voxels, and what is read is checked where it is
//! taken in: sums and counts within their bounds, places within the grid, clusters that hang together.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::consistent::NoiseModel;
use super::now::Taken;
use super::params::{Mode, Params};
use super::{consistent, paper};

/// A map as it was after a scan; see [`Frozen::save`](super::Frozen::save). What is written of a large one is better made of a
/// [`Frozen`](super::Frozen) itself, piece by piece.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct SavedMap(pub(super) Saved<consistent::SavedConsistent>);

/// `C` is what a map of mode `consistent` is held in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Saved<C> {
    pub(super) shape: Shape,
    pub(super) taken: Taken,
    pub(super) method: Method<C>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Method<C> {
    Paper(Box<paper::SavedCfodi>),
    Consistent(Box<C>),
}

/// The parameters without which a map is another one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Shape {
    mode: Mode,
    voxel_size: f64,
    min_points: u32,
    depth: u8,
    max_normal_angle: f64,
    min_vicinity: u32,
    noise_model: NoiseModel,
    pose_sigma: f64,
}

/// A saved map that cannot be resumed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum RestoreError {
    /// It was made with another parameter.
    #[error("the map was made with {name} {saved}, now it is {now}")]
    Parameter {
        /// The parameter.
        name: &'static str,
        /// Its value then.
        saved: String,
        /// Its value now.
        now: String,
    },
    /// It is not what an engine saves.
    #[error("the map contradicts itself: {0}")]
    Contradiction(String),
}

/// A contradiction where `holds` is false; `what` says which, with its numbers.
pub(super) fn ensure(holds: bool, what: impl FnOnce() -> String) -> Result<(), RestoreError> {
    if holds { Ok(()) } else { Err(RestoreError::Contradiction(what())) }
}

/// What was saved with its slot, by slot; there are `slots` of these.
pub(super) fn in_slots<'a, T>(
    what: &str,
    saved: &'a [(u32, T)],
    slots: usize,
) -> Result<Vec<Option<&'a T>>, RestoreError> {
    let mut places = vec![None; slots];
    for (slot, item) in saved {
        let place = places.get_mut(*slot as usize).filter(|place| place.is_none());
        let Some(place) = place else {
            let text = format!("{what} {slot} is there twice, or not among {slots}");
            return Err(RestoreError::Contradiction(text));
        };
        *place = Some(item);
    }
    Ok(places)
}

/// Scans, and ids given, beyond which no map has got: they go on counting up from there.
const MOST_COUNTED: u64 = 1 << 60;

/// Revisions of a cluster beyond which no map has got: there is one more at most with each scan.
pub(super) const MOST_REVISIONS: u32 = 1 << 31;

/// Checks a count that goes on.
pub(super) fn ensure_counted(name: &str, count: u64) -> Result<(), RestoreError> {
    ensure(count <= MOST_COUNTED, || format!("{name} is {count}, more than {MOST_COUNTED}"))
}

impl SavedMap {
    /// Number of scans taken in so far.
    pub const fn sequence(&self) -> u64 {
        self.0.taken.sequence
    }
}

impl<C> Saved<C> {
    /// Checks the parts that both methods have.
    pub(super) fn check(&self, params: &Params) -> Result<(), RestoreError> {
        self.shape.check(params)?;
        ensure_counted("the number of scans", self.taken.sequence)?;
        ensure(self.taken.stamp.is_some() == (self.taken.sequence > 0), || {
            format!("stamp {:?} after {} scans", self.taken.stamp, self.taken.sequence)
        })
    }
}

impl Shape {
    pub(super) const fn of(params: &Params) -> Self {
        Self {
            mode: params.mode(),
            voxel_size: params.voxel_size(),
            min_points: params.min_points(),
            depth: params.depth(),
            max_normal_angle: params.max_normal_angle(),
            min_vicinity: params.min_vicinity(),
            noise_model: params.noise_model(),
            pose_sigma: params.pose_sigma(),
        }
    }

    /// The parameters by name. `consistent` asks for neither depth nor vicinity, `paper` for no noise and no error of poses.
    fn values(&self) -> Vec<(&'static str, String)> {
        let both = [
            ("mode", self.mode.as_str().to_owned()),
            ("voxel_size", self.voxel_size.to_string()),
            ("min_points", self.min_points.to_string()),
            ("max_normal_angle", self.max_normal_angle.to_string()),
        ];
        let own = match self.mode {
            Mode::Paper => {
                vec![("depth", self.depth.to_string()), ("min_vicinity", self.min_vicinity.to_string())]
            }
            Mode::Consistent => {
                vec![
                    ("noise_model", self.noise_model.to_string()),
                    ("pose_sigma", self.pose_sigma.to_string()),
                ]
            }
        };
        both.into_iter().chain(own).collect()
    }

    fn check(&self, params: &Params) -> Result<(), RestoreError> {
        let pairs = self.values().into_iter().zip(Self::of(params).values());
        let mut others = pairs.filter(|(saved, now)| saved != now);
        let Some(((name, saved), (_, now))) = others.next() else { return Ok(()) };
        Err(RestoreError::Parameter { name, saved, now })
    }
}
