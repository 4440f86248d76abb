//! Clouds and transforms to scans: the path that the live node and a replay have in common.
//!
//! A cloud waits for the transform at its stamp; a scan whose stamp jumps back begins a new session. No clock inside:
//! time is an argument.

use std::time::Duration;

use crate::cloud::Cloud;
use crate::engine::{Scan, Stamp};
use crate::msg::ros::TransformStamped;
use crate::tf::{FrameError, Frames, Inserted, JUMP_BACK, LookupError, Waited, WaitingQueue};

/// Joins clouds with their transforms.
#[derive(Debug)]
pub struct Join {
    frames: Frames,
    waiting: WaitingQueue<Cloud>,
    /// Newest stamp of a scan in this session.
    newest: Option<Stamp>,
}

/// A cloud whose transform is known.
#[derive(Clone, Debug)]
pub struct Joined {
    /// For the engine.
    pub scan: Scan,
    /// Points in the message, valid or not.
    pub total: u32,
    /// How far its stamp lies before the newest one (s), where that is a jump: a new session begins with it.
    pub jumped_back: Option<f64>,
}

impl Join {
    /// Lets at most `places` clouds wait.
    pub fn new(places: usize) -> Self {
        Self { frames: Frames::new(), waiting: WaitingQueue::new(places), newest: None }
    }

    /// The tree of frames.
    pub const fn frames(&self) -> &Frames {
        &self.frames
    }

    /// The number of clouds that wait.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// The frame of the cloud that has waited longest, and what its transform lacks.
    pub fn oldest(&self) -> Option<(&str, Option<&LookupError>)> {
        self.waiting.oldest()
    }

    /// Takes in a transform.
    ///
    /// # Errors
    /// As [`Frames::insert`].
    pub fn transform(
        &mut self,
        transform: &TransformStamped,
        is_static: bool,
    ) -> Result<Inserted, FrameError> {
        self.frames.insert(transform, is_static)
    }

    /// Lets a cloud wait for its transform; gives the one that has waited longest where there was no place.
    pub fn cloud(&mut self, cloud: Cloud, now: Duration) -> Option<Waited<Cloud>> {
        let (stamp, frame) = (cloud.stamp, cloud.frame_id.clone());
        self.waiting.push(cloud, stamp, frame, now)
    }

    /// Takes the clouds whose way to `fixed_frame` is known now, by ascending stamp.
    pub fn ready(&mut self, fixed_frame: &str) -> Vec<Joined> {
        let Self { frames, waiting, .. } = self;
        let ready = waiting.take_ready(|sensor, stamp| frames.lookup(fixed_frame, sensor, stamp));
        let joined = ready.into_iter().map(|(cloud, fixed_from_sensor)| {
            // Only a scan with a transform tells the time: a stray stamp has none.
            let jumped_back = self.jumped_back(cloud.stamp);
            let scan = Scan { stamp: cloud.stamp, fixed_from_sensor, points: cloud.points };
            Joined { scan, total: cloud.total, jumped_back }
        });
        joined.collect()
    }

    fn jumped_back(&mut self, stamp: Stamp) -> Option<f64> {
        let back = self.newest.map(|newest| newest.seconds_since(stamp)).filter(|back| *back > JUMP_BACK);
        if back.is_some() {
            self.frames.forget_after(stamp);
            self.newest = None;
        }
        self.newest = self.newest.max(Some(stamp));
        back
    }

    /// Takes the clouds that have waited for `timeout` or longer.
    pub fn expired(&mut self, now: Duration, timeout: Duration) -> Vec<Waited<Cloud>> {
        self.waiting.take_expired(now, timeout)
    }

    /// Takes all clouds that wait: at the end, and for a new session.
    pub fn give_up(&mut self, now: Duration) -> Vec<Waited<Cloud>> {
        self.waiting.take_all(now)
    }

    /// Begins a session: stamps may be any again. Transforms after `stamp` are forgotten where one is given.
    pub fn begin_session(&mut self, stamp: Option<Stamp>) {
        self.newest = None;
        if let Some(stamp) = stamp {
            self.frames.forget_after(stamp);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Points;
    use crate::msg::ros::{Header, Transform};

    fn at(seconds: f64) -> Stamp {
        Stamp::from_nanos((seconds * 1e9) as i64)
    }

    fn cloud(seconds: f64) -> Cloud {
        let (stamp, points) = (at(seconds), Points::F32(vec![[0.0, 0.0, 1.0]]));
        Cloud { stamp, frame_id: "camera".into(), points, total: 2, invalid: 1, out_of_range: 0 }
    }

    fn joined_with_static_camera() -> Join {
        let mut join = Join::new(4);
        let header = Header { stamp: at(0.0).into(), frame_id: "map".into() };
        let child_frame_id = "camera".to_owned();
        let transform = TransformStamped { header, child_frame_id, transform: Transform::default() };
        join.transform(&transform, true).unwrap();
        join
    }

    fn back(join: &mut Join, seconds: f64) -> Vec<Option<f64>> {
        assert!(join.cloud(cloud(seconds), Duration::ZERO).is_none());
        join.ready("map").into_iter().map(|joined| joined.jumped_back).collect()
    }

    #[test]
    fn a_step_back_of_a_second_is_a_jump_and_less_is_not() {
        let mut join = joined_with_static_camera();
        assert_eq!(back(&mut join, 10.0), [None]);
        assert_eq!(back(&mut join, 9.1), [None]);
        assert_eq!(back(&mut join, 8.75), [Some(1.25)]);
        assert_eq!(back(&mut join, 9.0), [None]);
        join.begin_session(None);
        assert_eq!(back(&mut join, 1.0), [None]);
    }

    #[test]
    fn a_cloud_waits_for_its_transform_and_knows_what_it_lacks() {
        let mut join = Join::new(1);
        assert!(join.cloud(cloud(1.0), Duration::ZERO).is_none());
        assert!(join.ready("map").is_empty());
        let (frame, lacks) = join.oldest().unwrap();
        assert!(frame == "camera" && matches!(lacks, Some(LookupError::UnknownFrame { .. })));
        let pushed_out = join.cloud(cloud(2.0), Duration::ZERO).unwrap();
        assert_eq!((pushed_out.stamp, join.waiting()), (at(1.0), 1));
        let joined = join.ready("camera");
        assert_eq!((joined.len(), joined[0].total, joined[0].scan.stamp), (1, 2, at(2.0)));
    }
}
