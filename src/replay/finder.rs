//! Finds the frame in which a map lives: by the transforms as they come, and where these do not tell, by the whole bag.

use super::ahead::Ahead;
use super::body::body_of;
use super::fixed_frame::FixedFrame;
use super::said::Remark;
use super::tree::Tree;
use crate::cloud::z_is_not_up;
use crate::join::Join;
use crate::msg::ros::{TfMessage, TransformStamped};
use crate::tf::LookupError;

/// What is known so far.
pub(super) struct Finder {
    fixed_frame: FixedFrame,
    /// What all transforms so far say about names.
    tree: Tree,
    looked_ahead: bool,
    /// The transforms show that the guessed frame is not the root.
    is_wrong: bool,
}

impl Finder {
    pub(super) fn new(fixed_frame: FixedFrame) -> Self {
        Self { fixed_frame, tree: Tree::default(), looked_ahead: false, is_wrong: false }
    }

    /// The frame, once there is one.
    pub(super) fn name(&self) -> Option<&str> {
        self.fixed_frame.name()
    }

    /// The frame, or what it would have been.
    pub(super) fn into_name(self) -> String {
        match self.fixed_frame {
            FixedFrame::Open { default } => default,
            known => known.name().unwrap_or_default().to_owned(),
        }
    }

    /// Whether the frame that was guessed is not the root.
    pub(super) const fn is_wrong(&self) -> bool {
        self.is_wrong
    }

    /// Notes transforms, whatever becomes of them.
    pub(super) fn note(&mut self, message: &TfMessage, is_static: bool) {
        message.transforms.iter().for_each(|transform| self.tree.note(transform, is_static));
        self.fixed_frame.look_for_default(&self.tree);
        self.is_wrong = self.fixed_frame.is_wrong(&self.tree);
    }

    /// Guesses the frame. The whole bag is asked where there are transforms and none is about a sensor, or none yet moves it: poses may
    /// all lie behind the clouds. Gives the way to a camera's body frame, where there are none and the map is made there.
    pub(super) fn guess(&mut self, ahead: &Ahead<'_>, join: &Join) -> Option<TransformStamped> {
        let sensors: Vec<_> = join.sensors().collect();
        let was_open = self.name().is_none();
        self.fixed_frame.guess(&self.tree, &sensors);
        let is_open = self.name().is_none() && !sensors.is_empty();
        let is_early =
            || was_open && self.fixed_frame.is_where_all_stands(&self.tree) && ahead.has_transforms();
        if is_open || is_early() {
            self.ask_whole_bag(ahead, join);
        }
        if was_open && let FixedFrame::Still { name, .. } = &self.fixed_frame {
            let is_optical = join.sensor_in(name).is_some_and(|sensor| ahead.is_optical(sensor, name));
            let body = is_optical.then(|| body_of(name)).flatten()?;
            self.fixed_frame.level(&body);
            return Some(body);
        }
        self.is_wrong = self.fixed_frame.is_wrong(&self.tree);
        None
    }

    /// Takes the frame by the whole bag, if that tells one. After a signal there is none, so that no scan is taken in by a part of it.
    fn ask_whole_bag(&mut self, ahead: &Ahead<'_>, join: &Join) {
        match self.right(ahead, join) {
            Some(FixedFrame::Open { .. }) => {}
            Some(found) => self.fixed_frame = found,
            None => self.fixed_frame.reopen(),
        }
    }

    /// The frame by the whole bag; `None` where a signal came before all of it was read.
    pub(super) fn right(&self, ahead: &Ahead<'_>, join: &Join) -> Option<FixedFrame> {
        let found = self.found(ahead, join);
        (!ahead.is_stopped()).then_some(found)
    }

    /// The frame by the whole bag, up to a signal.
    fn found(&self, ahead: &Ahead<'_>, join: &Join) -> FixedFrame {
        let sensors: Vec<_> = join.sensors().collect();
        self.fixed_frame.clone().found(&Tree::of(ahead.transforms()), &sensors)
    }

    /// Takes the static transforms that are missing out of the whole bag, the first of each frame: a latched `/tf_static` may
    /// have been recorded late, and what it says holds for all time before. What is known stands until its turn comes to change.
    /// Once, and only where frames are not connected: a gap in time is not closed so. Says whether it has looked.
    pub(super) fn look_ahead(&mut self, ahead: &Ahead<'_>, join: &mut Join) -> bool {
        let lacks = join.oldest().and_then(|(_, lacks)| lacks);
        if !lacks.is_some_and(LookupError::is_unconnected) || std::mem::replace(&mut self.looked_ahead, true)
        {
            return false;
        }
        for (transform, is_static) in ahead.transforms() {
            if is_static && !join.frames().is_placed(&transform.child_frame_id) {
                // What is wrong with a transform is said when its turn comes.
                drop(join.transform(&transform, true));
            }
        }
        true
    }

    /// Whether some transforms so far, however late, lead from a sensor's frame to the fixed one.
    pub(super) fn reaches(&self, sensor: &str) -> bool {
        let Self { tree, .. } = self;
        let in_tree = |frame: &&str| tree.has(frame);
        let fixed = self.name().filter(in_tree).filter(|_| tree.has(sensor));
        fixed.is_some_and(|fixed| tree.top(fixed) == tree.top(sensor))
    }

    /// What is to be said of the frame at the end: how it was guessed, and whether its z may be another way than up.
    pub(super) fn about(&self, join: &Join) -> Vec<Remark> {
        let sensors: Vec<_> = join.sensors().collect();
        let guessed = self.fixed_frame.about(&self.tree, &sensors);
        let not_up = self.name().and_then(z_is_not_up).map(Remark::warning);
        guessed.into_iter().chain(not_up).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;
    use crate::bag::{Bag, Decoder, SensorBag, TransformTopics};
    use crate::cloud::CloudFilter;
    use crate::msg::ros::{Header, TransformStamped};

    fn link(parent: &str, child: &str) -> TfMessage {
        let header = Header { frame_id: parent.to_owned(), ..Header::default() };
        let child_frame_id = child.to_owned();
        TfMessage { transforms: vec![TransformStamped { header, child_frame_id, ..Default::default() }] }
    }

    #[test]
    fn a_frame_that_is_looked_for_while_a_signal_comes_is_not_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let mut bag = SensorBag::new(File::create(&path).unwrap(), "/points").unwrap();
        bag.transforms(&link("map", "camera"), true).unwrap();
        bag.finish().unwrap();
        let (bag, stop) = (Bag::open(&path).unwrap(), Arc::new(AtomicBool::new(false)));
        let decoder = Decoder::new(Vec::new(), CloudFilter::DEFAULT, TransformTopics::default());
        let ahead = Ahead::new(&bag, decoder, Arc::clone(&stop));
        let default = "odom".to_owned();
        let finder = Finder::new(FixedFrame::Still {
            name: "camera".to_owned(),
            optical: None,
            default: default.clone(),
        });
        let right = FixedFrame::Found { name: "map".to_owned(), sensor: None, default };
        assert_eq!(finder.right(&ahead, &Join::new(1)), Some(right));
        stop.store(true, Ordering::Relaxed);
        assert_eq!(finder.right(&ahead, &Join::new(1)), None);
        let mut finder = finder;
        finder.ask_whole_bag(&ahead, &Join::new(1));
        assert_eq!(finder.fixed_frame, FixedFrame::Open { default: "odom".to_owned() });
    }
}
