//! Where the sensor stood: the tree of coordinate frames from `/tf` and `/tf_static`.
//!
//! Keeps true: a transform is checked where it comes in, and one that is refused is not taken in; a lookup interpolates
//! between two samples and never extrapolates; memory is bounded in time ([`MAX_AGE`]), in frames ([`MAX_FRAMES`]) and in
//! samples ([`MAX_SAMPLES`]), the work of a lookup by [`MAX_DEPTH`].
//! The arithmetic is that of the `transforms` crate; the rules around it are those that tf2's users expect. Metres,
//! unit quaternions, and times from the messages.

mod error;
mod inserted;
mod jumps;
mod kept;
mod room;
mod sample;
mod way;

#[cfg(test)]
mod tests;

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use transforms::Registry;
use transforms::errors::RegistryError;
use transforms::geometry::Transform;
use transforms::time::Timestamp;

use crate::engine::{JUMP_BACK, Stamp};
use crate::msg::ros::TransformStamped;

pub use error::{FrameError, Lack, LookupError, Span};
pub use inserted::Inserted;
pub use sample::{MAX_NAME_BYTES, NORM_TOLERANCE};

use jumps::Jumps;
use kept::Kept;
use sample::{Sample, instant, stamp_of};

/// Dynamic samples older than this against their frame's newest are forgotten; tf2's cache time.
pub const MAX_AGE: Duration = Duration::from_secs(10);

/// Most child frames that are kept.
pub const MAX_FRAMES: usize = 10_000;

/// Most samples of one dynamic frame: those of [`MAX_AGE`] at 1000 Hz, three times. Of one that comes more often a sample is kept
/// each ms.
pub const MAX_FRAME_SAMPLES: usize = 30_000;

/// Most samples of all dynamic frames, about 100 bytes each.
pub const MAX_SAMPLES: usize = 500_000;

/// Most frames between one and its root; robots have ten to thirty.
pub const MAX_DEPTH: usize = 256;

/// The tree of frames with the recent past of its dynamic edges.
///
/// Names are compared as they are: those that are read have no leading slash.
#[derive(Debug)]
pub struct Frames {
    registry: Registry,
    /// One edge a child frame, as in `registry`, which does not tell its own.
    edges: BTreeMap<String, Edge>,
    /// How many edges each parent is that of.
    parents: BTreeMap<String, usize>,
    /// Bound of all samples that are kept.
    samples: usize,
    /// No dynamic sample that is kept is newer; `None` where there is none.
    newest: Option<Stamp>,
    /// The time at which the tree was full and looked through for what is out of date.
    looked: Option<Stamp>,
    jumps: Jumps,
}

#[derive(Debug)]
struct Edge {
    parent: String,
    /// The samples of a dynamic edge, `None` for a static one.
    kept: Option<Kept>,
}

impl Edge {
    fn newest(&self) -> Option<Stamp> {
        self.kept.map(|kept| kept.newest())
    }

    fn samples(&self) -> usize {
        self.kept.map_or(0, |kept| kept.bound())
    }
}

impl Default for Frames {
    fn default() -> Self {
        Self::new()
    }
}

impl Frames {
    /// An empty tree.
    pub fn new() -> Self {
        let registry = Registry::with_max_age(MAX_AGE);
        let (edges, parents) = (BTreeMap::new(), BTreeMap::new());
        Self { registry, edges, parents, samples: 0, newest: None, looked: None, jumps: Jumps::default() }
    }

    /// Takes in one transform of `/tf_static` (`is_static`) or `/tf`; the stamp of a static one is not looked at.
    ///
    /// The newest message decides on the parent of a frame and on whether it is static.
    ///
    /// # Errors
    ///
    /// A [`FrameError`], and nothing of the message is in the tree. To make room for it, dynamic frames that are out of date may
    /// have been forgotten, and all of them where it jumps back.
    pub fn insert(&mut self, message: &TransformStamped, is_static: bool) -> Result<Inserted, FrameError> {
        let sample = Sample::check(message, is_static)?;
        let jumped_back = self.jumps_back(&sample);
        self.check_place(&sample, jumped_back)?;
        let newest = self.newest(sample.child);
        let mut apart = None;
        if jumped_back {
            self.jumps.note_back(sample.child, newest, sample.stamp);
            self.clear_dynamic();
        } else {
            apart = self.jumps.note_on(sample.child, newest, sample.stamp);
        }
        let inserted = if self.can_spare(&sample) {
            Inserted::Stored
        } else {
            self.make_room(&sample)?;
            self.store(&sample)?
        };
        Ok(match apart {
            Some(apart) => Inserted::ToAndFro { apart },
            None if jumped_back => Inserted::JumpedBack,
            None => inserted,
        })
    }

    /// Whether a transform of `/tf` that was overtaken by others should still be inserted: its frame is dynamic and has this parent,
    /// and it neither jumps back in time nor is of the time before a jump. One that [`Self::insert`] would refuse should be too, so
    /// that the refusal is told.
    pub fn is_of_use(&self, message: &TransformStamped) -> bool {
        let Ok(sample) = Sample::check(message, false) else { return true };
        let edge = self.edges.get(sample.child);
        edge.is_none_or(|edge| edge.parent == sample.parent && edge.kept.is_some())
            && !self.jumps_back(&sample)
            && !self.was_before_a_jump(&sample)
    }

    /// Whether an overtaken transform is of the time before a jump back: what has overtaken it is in, so that it lies far ahead of
    /// all else for no other reason. Of its own frame it may, where that comes seldom.
    fn was_before_a_jump(&self, sample: &Sample<'_>) -> bool {
        let ahead = self.newest.zip(sample.stamp).map(|(newest, stamp)| stamp.seconds_since(newest));
        ahead.is_some_and(|ahead| ahead > JUMP_BACK)
            || self.jumps.is_leap(sample.child, self.newest(sample.child), sample.stamp)
    }

    fn jumps_back(&self, sample: &Sample<'_>) -> bool {
        self.jumps.is_back(sample.child, self.newest(sample.child), sample.stamp)
    }

    /// The newest stamp of a frame, where it is a dynamic one.
    fn newest(&self, child: &str) -> Option<Stamp> {
        self.edges.get(child).and_then(Edge::newest)
    }

    /// Whether the tree has a place for the sample's edge: no cycle, and not too deep.
    fn check_place(&self, sample: &Sample<'_>, only_statics_stay: bool) -> Result<(), FrameError> {
        let known = self.edges.get(sample.child);
        if known.is_some_and(|edge| edge.parent == sample.parent) {
            return Ok(());
        }
        let stays = |edge: &&Edge| !only_statics_stay || edge.kept.is_none();
        let above = |frame: &str| self.edges.get(frame).filter(stays).map(|edge| edge.parent.as_str());
        check_place(sample.parent, sample.child, above)
    }

    /// Stores a sample that has a place.
    fn store(&mut self, sample: &Sample<'_>) -> Result<Inserted, FrameError> {
        let refused = |reason: String| FrameError::Refused {
            parent: sample.parent.into(),
            child: sample.child.into(),
            reason,
        };
        let transform = sample.transform().map_err(|error| refused(error.to_string()))?;
        let inserted = self.compare(sample, &transform);
        if inserted.begins_anew() {
            // The registry ties a frame to its parent and kind until the frame is released.
            self.remove(sample.child);
        }
        self.registry.add_transform(transform).map_err(|error| refused(error.to_string()))?;
        self.count(sample);
        Ok(inserted)
    }

    /// What a sample that is about to be stored changes; `transform` is the same in the registry's terms.
    fn compare(&self, sample: &Sample<'_>, transform: &Transform<Timestamp>) -> Inserted {
        match self.edges.get(sample.child) {
            Some(edge) if edge.kept.is_none() != sample.stamp.is_none() => Inserted::KindChanged,
            Some(edge) if edge.parent != sample.parent => {
                Inserted::Reparented { before: edge.parent.clone() }
            }
            Some(_) if sample.stamp.is_none() => {
                let any_time = Timestamp::from_nanos(0);
                let before = self.registry.get_transform(sample.parent, sample.child, any_time).ok();
                let both = before.as_ref().and_then(isometry).zip(isometry(transform));
                both.map_or(Inserted::Stored, |(before, now)| Inserted::static_after(&before, &now))
            }
            _ => Inserted::Stored,
        }
    }

    /// Notes a sample that the registry has taken.
    fn count(&mut self, sample: &Sample<'_>) {
        if let Some(edge) = self.edges.get_mut(sample.child) {
            self.samples -= edge.samples();
            edge.kept = edge.kept.zip(sample.stamp).map(|(kept, stamp)| kept.with(stamp));
            self.samples += edge.samples();
        } else {
            let edge = Edge { parent: sample.parent.into(), kept: sample.stamp.map(Kept::first) };
            self.samples += edge.samples();
            *self.parents.entry(edge.parent.clone()).or_default() += 1;
            self.edges.insert(sample.child.into(), edge);
        }
        self.newest = self.newest.max(sample.stamp);
    }

    fn remove(&mut self, child: &str) {
        let Some(edge) = self.edges.remove(child) else { return };
        self.registry.remove_frame(child);
        self.samples -= edge.samples();
        if let Entry::Occupied(mut edges) = self.parents.entry(edge.parent) {
            *edges.get_mut() -= 1;
            if *edges.get() == 0 {
                edges.remove();
            }
        }
    }

    fn retain(&mut self, stays: impl Fn(&Edge) -> bool) {
        let gone = self.edges.iter().filter(|(_, edge)| !stays(edge));
        let gone: Vec<_> = gone.map(|(child, _)| child.clone()).collect();
        gone.iter().for_each(|child| self.remove(child));
        self.newest = self.edges.values().filter_map(Edge::newest).max();
    }

    /// Forgets all dynamic transforms and keeps the static ones.
    pub fn clear_dynamic(&mut self) {
        self.retain(|edge| edge.kept.is_none());
    }

    /// Forgets all dynamic transforms if the newest of them lies more than [`JUMP_BACK`] after `stamp`; says whether
    /// it did.
    ///
    /// For a clock that has jumped back: the transforms may still be of the time before the jump, or already of the time
    /// after it.
    pub fn forget_after(&mut self, stamp: Stamp) -> bool {
        let forget = reach_beyond(self.edges.values(), stamp);
        if forget {
            self.clear_dynamic();
        }
        forget
    }

    /// How often transforms have jumped back: see [`Inserted::JumpedBack`].
    pub const fn jumps(&self) -> u64 {
        self.jumps.count()
    }

    /// The isometry that maps coordinates of the frame `sensor` into the frame `fixed` at `stamp`.
    ///
    /// Equal names give the identity, known or not: the answer holds either way. Between two samples the way is a straight line,
    /// as in tf2, however far apart they are within [`MAX_AGE`], and whether or not others between them were refused or spared.
    ///
    /// # Errors
    ///
    /// A [`LookupError`] that says what is lacking.
    pub fn lookup(&self, fixed: &str, sensor: &str, stamp: Stamp) -> Result<Isometry3<f64>, LookupError> {
        if fixed == sensor {
            return Ok(Isometry3::identity());
        }
        self.find(fixed, sensor, stamp).map_err(|lack| LookupError {
            fixed: fixed.into(),
            sensor: sensor.into(),
            at: stamp,
            lack,
        })
    }

    fn find(&self, fixed: &str, sensor: &str, stamp: Stamp) -> Result<Isometry3<f64>, Lack> {
        if self.is_deep(fixed) || self.is_deep(sensor) {
            return Err(Lack::TooDeep { max: MAX_DEPTH });
        }
        self.check_joined(fixed, sensor)?;
        let found = self.registry.get_transform(fixed, sensor, instant(stamp));
        let transform = found.map_err(|error| lack(error, stamp))?;
        isometry(&transform)
            .ok_or_else(|| Lack::Numeric { reason: "the composed transform is not finite".into() })
    }

    /// Whether a frame has more above it than is followed: a part of the tree can be put under another one.
    fn is_deep(&self, frame: &str) -> bool {
        self.up_from(frame).nth(MAX_DEPTH).is_some()
    }

    /// Whether the frames are known, and of one tree. Where a lookup fails, the registry looks through all of its frames, and it
    /// reports a gap in time even where the frames are not connected: so the tree is asked first.
    fn check_joined(&self, fixed: &str, sensor: &str) -> Result<(), Lack> {
        let root_of =
            |frame| self.root_of(frame).ok_or_else(|| Lack::UnknownFrame { frame: frame.to_owned() });
        let (fixed_root, sensor_root) = (root_of(fixed)?, root_of(sensor)?);
        if fixed_root == sensor_root {
            return Ok(());
        }
        Err(Lack::NotConnected { fixed_root: fixed_root.into(), sensor_root: sensor_root.into() })
    }

    /// All frames, as child or parent, by name.
    pub fn frame_names(&self) -> Vec<String> {
        self.edges.keys().chain(self.parents.keys()).collect::<BTreeSet<_>>().into_iter().cloned().collect()
    }

    /// Whether a transform says where `frame` is, so that it has a parent.
    pub fn is_placed(&self, frame: &str) -> bool {
        self.edges.contains_key(frame)
    }

    /// The root of the tree that `frame` is in; the frame itself where it has no parent, `None` where it is unknown.
    pub fn root_of(&self, frame: &str) -> Option<&str> {
        // No cycle has a place in the tree, so this ends.
        let above = self.up_from(frame).last().map(|edge| &edge.parent);
        above.or_else(|| self.parents.get_key_value(frame).map(|(root, _)| root)).map(String::as_str)
    }
}

/// What a lookup in one tree lacks that failed.
fn lack(error: RegistryError, at: Stamp) -> Lack {
    match error {
        RegistryError::NotFoundAt { frame, covered: Some((from, until)), .. } => {
            let covered = Span { from: stamp_of(from), until: stamp_of(until) };
            if at < covered.from {
                Lack::TooEarly { frame, covered }
            } else {
                Lack::TooLate { frame, covered }
            }
        }
        other => Lack::Numeric { reason: other.to_string() },
    }
}

/// Whether the newest of the dynamic ones lies more than [`JUMP_BACK`] after `stamp`.
fn reach_beyond<'a>(edges: impl Iterator<Item = &'a Edge>, stamp: Stamp) -> bool {
    let newest = edges.filter_map(Edge::newest).max();
    newest.is_some_and(|newest| stamp.jump_back_from(newest).is_some())
}

/// Whether a tree in which `above` gives the parent of a frame has a place for a new link: no cycle, and not too deep.
pub(crate) fn check_place<'a>(
    parent: &'a str,
    child: &str,
    above: impl Fn(&'a str) -> Option<&'a str>,
) -> Result<(), FrameError> {
    let mut frame = parent;
    let mut depth = 1;
    while let Some(next) = above(frame) {
        frame = next;
        if frame == child {
            return Err(FrameError::Cycle { parent: parent.into(), child: child.into() });
        }
        depth += 1;
        if depth > MAX_DEPTH {
            return Err(FrameError::TooDeep { child: child.into(), max: MAX_DEPTH });
        }
    }
    Ok(())
}

/// Whether a transform is well formed by itself; whether the tree has a place for it is another question.
pub(crate) fn check(message: &TransformStamped, is_static: bool) -> Result<(), FrameError> {
    Sample::check(message, is_static).map(drop)
}

/// In the engine's types; `None` where a long chain has overflowed.
fn isometry(transform: &Transform<Timestamp>) -> Option<Isometry3<f64>> {
    let (t, r) = (transform.translation(), transform.rotation());
    let finite = [t.x, t.y, t.z, r.w, r.x, r.y, r.z].iter().all(|value| value.is_finite());
    // Normalised once more: interpolating and composing let the norm drift.
    let rotation = UnitQuaternion::try_new(Quaternion::new(r.w, r.x, r.y, r.z), 0.5)?;
    finite.then(|| Isometry3::from_parts(Translation3::new(t.x, t.y, t.z), rotation))
}
