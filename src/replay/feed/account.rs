//! Where every cloud of a bag went, and what is to be said of it, at once and at the end.

use std::collections::BTreeSet;
use std::time::Duration;

use crate::bag::TransformTopics;
use crate::cloud::{Cloud, CloudError};
use crate::count::count_of;
use crate::join::{GivenUp, Join, TransformsFrom, Waited};
use crate::msg::ros::TransformStamped;
use crate::reason::{Reason, SESSION_ENDED};
use crate::replay::disorder::Disorder;
use crate::replay::said::{Remark, Said};
use crate::replay::summary::Tally;
use crate::tf::{FrameError, Inserted, LookupError};

/// Frames without a way that are remembered at most: a bag can make up ever new ones.
const UNPLACED: usize = 20;

/// How often it is said that a frame has changed its parent: what is said again tells of two publishers.
const MOST_REPARENTINGS_SAID: u32 = 2;

/// Why scans are skipped that were given up before a transform was looked for.
const NOT_LOOKED_UP: Reason = Reason::new("tf_not_looked_up", "No transform was looked for before the end.");

/// The account so far. What counts something gives the line that is to be said of it, if there is one.
#[derive(Default)]
pub(super) struct Account {
    pub(super) tally: Tally,
    disorder: Disorder,
    /// Frames of which a scan was skipped because they had no way to the fixed one.
    unplaced: BTreeSet<String>,
    /// Scans were skipped for want of a transform at their time, or of one that has jumped back with them.
    lacks_transforms: bool,
    /// What is to be said of clouds whose frame is no sensor's.
    without_viewpoint: Option<String>,
    /// What is to be said of a fixed frame that takes the sensor with it.
    riding: Option<String>,
    /// What is to be said of cameras.
    cameras: BTreeSet<String>,
    /// Why scans of which frame were skipped.
    skips_said: Said,
    /// What transforms have done or were refused for.
    transforms_said: Said,
}

impl Account {
    /// A message comes that was recorded at this time.
    pub(super) fn note_recorded(&mut self, at: Duration) {
        self.disorder.note(at);
    }

    /// There is something to be said of a camera.
    pub(super) fn doubt(&mut self, line: String) {
        self.cameras.insert(line);
    }

    pub(super) fn undecodable(&mut self, topic: &str, text: &str) -> Option<String> {
        let is_first = self.tally.undecodable(topic);
        is_first.then(|| format!("a message on {topic} was skipped: {text}"))
    }

    /// Counts a scan that cannot be used.
    pub(super) fn refuse(&mut self, error: &CloudError) -> Option<String> {
        self.tally.skip(error.reason()).then(|| format!("a scan was skipped: {error}"))
    }

    /// Counts a cloud of which hardly a point is used.
    pub(super) fn look_at(&mut self, cloud: &Cloud) -> Option<String> {
        let line = cloud.hardly_used()?;
        self.tally.note_hardly_used().then_some(line)
    }

    /// Looks whether clouds in this frame do not say where their sensor stood.
    pub(super) fn look_for_viewpoint(&mut self, frame: &str, fixed_frame: &str, join: &Join) {
        if self.without_viewpoint.is_none() {
            self.without_viewpoint = join.without_viewpoint(frame, fixed_frame);
        }
    }

    /// Looks whether the fixed frame moves, and the sensor with it.
    pub(super) fn look_for_riding(&mut self, fixed_frame: &str, join: &mut Join) {
        if self.riding.is_none() {
            self.riding = join.riding(fixed_frame);
        }
    }

    /// What is to be said of a transform that was taken in or refused, which is counted.
    pub(super) fn transform(
        &mut self,
        transform: &TransformStamped,
        inserted: &Result<Inserted, FrameError>,
    ) -> Option<String> {
        let said = &mut self.transforms_said;
        match inserted {
            Ok(inserted) => {
                let (parent, child) = (&transform.header.frame_id, &transform.child_frame_id);
                let kind = format!("{} {child} {parent}", inserted.kind());
                inserted.about(transform).filter(|_| said.is_due(&kind, MOST_REPARENTINGS_SAID))
            }
            Err(error) => {
                let reason = error.reason();
                self.tally.refuse_transform(reason);
                let is_due = said.is_due(&format!("{} {}", reason.key, transform.child_frame_id), 1);
                is_due.then(|| format!("a transform was refused: {error}"))
            }
        }
    }

    /// The stamps of the scans have jumped back, and so many that still waited were given up.
    pub(super) fn jumped_back(&mut self, given_up: usize) {
        self.disorder.jumped();
        self.tally.skip_all(SESSION_ENDED, given_up);
    }

    /// Counts a scan that got no transform.
    pub(super) fn skip(
        &mut self,
        waited: &Waited,
        given_up: GivenUp,
        join: &Join,
        topics: &TransformTopics,
    ) -> Option<String> {
        let Waited { cloud: Cloud { frame_id, .. }, lacks, .. } = waited;
        let lacks = lacks.as_ref();
        let reason = lacks.map_or(NOT_LOOKED_UP, LookupError::reason);
        self.tally.skip(reason);
        self.lacks_transforms |= lacks.is_some_and(LookupError::is_of_time);
        if lacks.is_some_and(LookupError::is_unconnected) && self.unplaced.len() < UNPLACED {
            self.unplaced.insert(frame_id.clone());
        }
        self.skips_said.is_due(&format!("{} {frame_id}", reason.key), 1).then(|| {
            let TransformTopics { changing, lasting } = topics;
            let why_none = || format!("the bag has none that can be read on {changing} and {lasting}");
            let hint = join.hint(lacks, given_up, TransformsFrom::Bag, why_none);
            let words: Vec<_> = lacks.map(ToString::to_string).into_iter().chain(hint).collect();
            format!("a scan was skipped: {}", words.join("; "))
        })
    }

    /// All that was counted, and the warnings of the end; `reaches` says whether a way from a frame has come after all.
    pub(super) fn end(self, reaches: impl Fn(&str) -> bool) -> (Tally, Vec<Remark>) {
        let Self { tally, disorder, unplaced, lacks_transforms, without_viewpoint, riding, cameras, .. } =
            self;
        let came_later = unplaced.iter().any(|frame| reaches(frame));
        let disorder = disorder.about(came_later || lacks_transforms);
        let empty = (tally.scans > 0 && tally.points_valid == 0 && tally.hardly_used == 0)
            .then(|| format!("no scan has a point, of {}", count_of(tally.scans, "scan")));
        let said = empty.into_iter().chain(disorder).chain(without_viewpoint).chain(riding).chain(cameras);
        (tally, said.map(Remark::warning).collect())
    }
}
