//! Transforms that lie far behind the clouds they place, taken before their turn.
//!
//! Poses that were found after the drive and merged into its bag may all lie behind the last cloud. To wait for them would be to
//! keep every cloud. So a second reader of the bag goes ahead for each frame of which one lacks, and takes of that frame what the
//! cloud that has waited longest needs, and no more: what is known at its stamp would be forgotten. When the turn of
//! what was taken so comes, it is passed by. Where none of that frame reaches the cloud's stamp nothing is taken: a sensor whose
//! clock is an hour ahead would have all of them taken, and what the other sensors need forgotten.

use std::collections::BTreeMap;
use std::iter::Peekable;
use std::time::Duration;

use super::ahead::Ahead;
use super::said::Remark;
use crate::engine::Stamp;
use crate::join::Join;
use crate::msg::ros::TransformStamped;
use crate::tf::Lack;

/// Frames of which transforms are taken before their turn at most: each has a reader of the bag.
const FRAMES: usize = 8;

/// Transforms of a bag, each with its index among all of them.
type Transforms = Peekable<Box<dyn Iterator<Item = (usize, TransformStamped)>>>;

/// What was taken before its turn.
pub(super) struct Early {
    /// The longest time (s) between two stamps over which a cloud is placed so: a longer one is a gap, over which clouds next to
    /// their transforms would not have waited either.
    gap: f64,
    /// How many transforms, of all, have had their turn.
    passed: usize,
    /// By frame.
    readers: BTreeMap<String, Reader>,
}

/// Reads one frame's transforms of `/tf`, from the first whose turn had not come.
struct Reader {
    transforms: Transforms,
    /// The stamps of the same transforms, read until one reaches the clouds; [`Self::newest`] is the newest so far.
    stamps: Box<dyn Iterator<Item = Stamp>>,
    newest: Option<Stamp>,
    /// Transforms before this index have been taken, or have had their turn.
    taken: usize,
    count: u64,
}

impl Early {
    pub(super) fn new(patience: Duration) -> Self {
        Self { gap: patience.as_secs_f64(), passed: 0, readers: BTreeMap::new() }
    }

    /// Notes that the turn of a transform has come; says whether it was taken before.
    pub(super) fn turn(&mut self, transform: &TransformStamped, is_static: bool) -> bool {
        let before = self.passed;
        self.passed += 1;
        let reader = (!is_static).then(|| self.readers.get(&transform.child_frame_id)).flatten();
        reader.is_some_and(|reader| before < reader.taken)
    }

    /// A transform that helps the cloud that has waited longest; `None` where there is none, or where time has jumped back: what
    /// lies ahead may be of another lap then.
    pub(super) fn next(&mut self, ahead: &Ahead<'_>, join: &Join) -> Option<TransformStamped> {
        if join.frames().jumps() > 0 {
            return None;
        }
        let (sensor, error) = join.oldest()?;
        let error = error?;
        let (at, gap, passed) = (error.at, self.gap, self.passed);
        let mut first = |root: &str| self.reader(ahead, root)?.take(passed, |_, stamp| stamp <= at);
        match &error.lack {
            Lack::TooLate { frame, covered } => {
                let reader = self.reader(ahead, frame)?;
                let is_near = |stamp: Stamp| stamp <= at || stamp.seconds_since(covered.until) <= gap;
                let helps = |transform: &_, stamp| is_near(stamp) && join.is_of_use(transform);
                if reader.reaches(at) { reader.take(passed, helps) } else { None }
            }
            // What puts a frame below another that is not static.
            Lack::NotConnected { sensor_root, fixed_root } => {
                [sensor_root, fixed_root].into_iter().find_map(|root| first(root))
            }
            Lack::UnknownFrame { .. } => first(join.frames().root_of(sensor).unwrap_or(sensor)),
            _ => None,
        }
    }

    /// That of a frame; `None` where there are too many.
    fn reader(&mut self, ahead: &Ahead<'_>, frame: &str) -> Option<&mut Reader> {
        if !self.readers.contains_key(frame) && self.readers.len() >= FRAMES {
            return None;
        }
        let passed = self.passed;
        Some(self.readers.entry(frame.to_owned()).or_insert_with(|| Reader::new(ahead, frame, passed)))
    }

    /// What is to be said at the end.
    pub(super) fn about(&self) -> impl Iterator<Item = Remark> {
        let early = self.readers.iter().filter(|(_, reader)| reader.count > 0);
        early.map(|(frame, Reader { count, .. })| Remark {
            text: format!(
                "transforms of `{frame}` lie far behind the clouds in the bag: {count} were taken before their turn"
            ),
            is_warning: false,
        })
    }
}

impl Reader {
    fn new(ahead: &Ahead<'_>, frame: &str, passed: usize) -> Self {
        let of_frame = || {
            let frame = frame.to_owned();
            ahead.transforms().enumerate().skip(passed).filter_map(move |(before, (transform, is_static))| {
                (!is_static && transform.child_frame_id == frame).then_some((before, transform))
            })
        };
        let transforms: Box<dyn Iterator<Item = _>> = Box::new(of_frame());
        let stamps = Box::new(of_frame().filter_map(|(_, transform)| transform.header.stamp.stamp()));
        Self { transforms: transforms.peekable(), stamps, newest: None, taken: 0, count: 0 }
    }

    /// Whether some transform, from where this reader began on, is as new as this.
    fn reaches(&mut self, at: Stamp) -> bool {
        while self.newest.is_none_or(|newest| newest < at) {
            let Some(stamp) = self.stamps.next() else { return false };
            self.newest = self.newest.max(Some(stamp));
        }
        true
    }

    /// The next transform whose turn has not come, `passed` being those whose turn has, where `helps` says so of it and its stamp.
    fn take(
        &mut self,
        passed: usize,
        helps: impl Fn(&TransformStamped, Stamp) -> bool,
    ) -> Option<TransformStamped> {
        while self.transforms.next_if(|(before, _)| *before < passed).is_some() {}
        let (before, transform) = self.transforms.next_if(|(_, transform)| {
            transform.header.stamp.stamp().is_some_and(|stamp| helps(transform, stamp))
        })?;
        self.taken = before + 1;
        self.count += 1;
        Some(transform)
    }
}
