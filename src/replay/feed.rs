//! From a bag to scans in the fixed frame, one after the other.

mod account;
mod outlook;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

use self::account::Account;
use self::outlook::Outlook;
use super::ahead::Ahead;
use super::error::FeedError;
use super::fixed_frame::FixedFrame;
use super::reading::{Item, Reading};
use super::said::Remark;
use super::summary::{AFTER_JUMP, Tally};
use super::visitor::{Go, Origin, Visitor};
use crate::bag::{Bag, BagError, Decoder, Elsewhere, Recorded, TransformTopics};
use crate::cloud::Cloud;
use crate::join::{GivenUp, Join, Joined, Jump, Moment, Waited, with_stamp};
use crate::msg::ros::{TfMessage, TransformStamped};
use crate::reason::{Reason, SHUTDOWN};
use crate::tf::MAX_AGE;

/// Clouds that wait for a transform however long it takes: where there are few in a second, transforms may be few as well.
const FEW: usize = 8;
/// Clouds that wait for a transform at most, whatever the patience: a bound of memory.
const MOST: usize = 64;

/// How far behind the transforms a cloud may wait, by the stamps, until all is tried for it. What was known at its stamp is
/// forgotten after twice this.
const BEHIND: Duration = Duration::from_nanos(MAX_AGE.as_nanos() as u64 / 2);

/// How far a replay has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Bytes read of the bag, as they are on disk.
    pub bytes: u64,
    /// Scans taken in.
    pub scans: u64,
}

/// What to feed, and how.
pub struct Feed<'a> {
    /// The recording.
    pub bag: &'a Bag,
    /// What its messages are.
    pub decoder: Decoder,
    /// Where the map lives.
    pub fixed_frame: FixedFrame,
    /// How long clouds wait for their transforms at least, by the times at which messages were recorded.
    pub patience: Duration,
    /// Whether [`Visitor::message`] gets every message.
    pub with_messages: bool,
    /// Set from outside to end early.
    pub stop: Arc<AtomicBool>,
    /// Called now and then.
    pub progress: &'a mut dyn FnMut(Progress),
}

/// How feeding ended.
#[derive(Debug)]
pub enum Ended {
    /// With the last scan that could be had.
    Fed(Fed),
    /// The frame that was guessed is the wrong one, as a late transform shows: all has to be fed again, with this one.
    WrongFrame(FixedFrame),
}

/// All has been fed.
#[derive(Debug)]
pub struct Fed {
    /// Where every cloud went.
    pub tally: Tally,
    /// Where the map lives.
    pub fixed_frame: String,
    /// What was said at the end: of the order of the messages, of cameras and clouds, and of how the frame was found.
    pub remarks: Vec<Remark>,
    /// What of the bag could not be read; `None` where all of it was.
    pub unread: Option<BagError>,
    /// Whether it was told to stop.
    pub stopped: bool,
}

impl Fed {
    /// Whether it was told to stop before a scan was taken in.
    pub const fn is_for_nothing(&self) -> bool {
        self.stopped && self.tally.scans == 0
    }

    /// Whether no scan was taken in, some for want of transforms.
    fn lacked_transforms(&self) -> bool {
        !self.stopped && self.tally.scans == 0 && self.tally.skipped.keys().any(Reason::is_of_transforms)
    }
}

/// Why no more items are taken.
enum Halt {
    /// The bag has ended, or what is left of it cannot be read.
    End(Option<BagError>),
    /// From outside.
    Stop,
    /// See [`Ended::WrongFrame`].
    WrongFrame,
}

/// Feeds every scan of a bag to a visitor, in the order in which their transforms are known.
///
/// # Errors
/// When the visitor cannot go on, and where it is told to stop before the right frame is known. A bag that cannot be read to its end is no error: [`Fed::unread`] says so.
pub fn feed<V: Visitor>(feed: Feed<'_>, visitor: &mut V) -> Result<Ended, FeedError<V::Error>> {
    let Feed { bag, mut decoder, fixed_frame, patience, with_messages, stop, progress } = feed;
    let others = find_transforms(bag, &mut decoder, &stop, visitor);
    if !matches!(fixed_frame, FixedFrame::Settled(_))
        && let Some(others) = others
    {
        return Err(others);
    }
    let ahead = Ahead::new(bag, decoder, Arc::clone(&stop));
    let reading = Reading::start(bag.messages(), ahead.decoder(), with_messages).map_err(FeedError::Start)?;
    let mut feeder = Feeder {
        visitor,
        stop,
        join: Join::new(FEW),
        patience,
        now: Moment::default(),
        outlook: Outlook::new(ahead, fixed_frame, patience),
        account: Account::default(),
        enough: false,
    };
    let halt = feeder.take(&reading, progress);
    let died = reading.end();
    let halt = halt.map_err(FeedError::Visitor)?;
    if died {
        return Err(FeedError::Died);
    }
    match (feeder.finish(halt)?, others) {
        // The frame that was given is no sensor's own.
        (Ended::Fed(fed), Some(others)) if fed.lacked_transforms() => Err(others),
        (ended, _) => Ok(ended),
    }
}

/// Where the bag has no transforms on the topics that are read, takes the only others that there are. Where there are several, which
/// is returned, any might tell how a sensor moved.
fn find_transforms<V: Visitor>(
    bag: &Bag,
    decoder: &mut Decoder,
    stop: &AtomicBool,
    visitor: &mut V,
) -> Option<FeedError<V::Error>> {
    let TransformTopics { changing, lasting } = decoder.transform_topics();
    let survey = bag.survey(stop);
    if !survey.is_complete && stop.load(Ordering::Relaxed) {
        return None;
    }
    match decoder.transform_topics().elsewhere(&survey.topics) {
        Some(Elsewhere::Pair(pair)) => {
            visitor.say(&format!(
                "no transforms are on {changing} and {lasting}: they are read from {} and {}",
                pair.changing, pair.lasting
            ));
            decoder.read_transforms_from(pair);
            None
        }
        Some(Elsewhere::Several(choices)) => {
            let (changing, lasting) = (changing.clone(), lasting.clone());
            Some(FeedError::Elsewhere { changing, lasting, choices: Elsewhere::remappings(&choices) })
        }
        None => None,
    }
}

struct Feeder<'a, V> {
    visitor: &'a mut V,
    stop: Arc<AtomicBool>,
    join: Join,
    patience: Duration,
    /// When the last message was recorded.
    now: Moment,
    outlook: Outlook<'a>,
    account: Account,
    /// The visitor wants no more.
    enough: bool,
}

impl<V: Visitor> Feeder<'_, V> {
    fn take(&mut self, reading: &Reading, progress: &mut dyn FnMut(Progress)) -> Result<Halt, V::Error> {
        loop {
            match reading.item() {
                Ok(Item::Message(message)) => self.visitor.message(&message)?,
                Ok(Item::Recorded { recorded, at, decoding }) => {
                    self.account.note_recorded(at);
                    self.now = at.into();
                    self.recorded(recorded, decoding)?;
                }
                Ok(Item::Unread(error)) => return Ok(Halt::End(Some(error))),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(Halt::End(None)),
            }
            progress(Progress { bytes: reading.bytes(), scans: self.account.tally.scans });
            if self.stop.load(Ordering::Relaxed) {
                return Ok(Halt::Stop);
            }
            if self.outlook.is_wrong() && !self.enough {
                return Ok(Halt::WrongFrame);
            }
        }
    }

    fn recorded(&mut self, recorded: Recorded, decoding: Duration) -> Result<(), V::Error> {
        if self.enough {
            // What is left out is counted to the end.
            let scans = usize::from(matches!(recorded, Recorded::Cloud { .. }));
            self.account.tally.skip_all(AFTER_JUMP, scans);
            return Ok(());
        }
        match recorded {
            Recorded::Cloud { sensor, cloud } => {
                match cloud.and_then(|cloud| with_stamp(cloud, || self.outlook.begins_at_zero())) {
                    Ok(cloud) => {
                        self.account.tally.decoded(cloud.total, decoding);
                        self.cloud(sensor, cloud)?;
                    }
                    Err(error) => {
                        let line = self.account.refuse(&error);
                        self.say(line);
                    }
                }
            }
            Recorded::Transforms { message, is_static } => self.transforms(&message, is_static)?,
            Recorded::Doubt(line) => self.account.doubt(line),
            Recorded::Undecodable { topic, text } => {
                let line = self.account.undecodable(&topic, &text);
                self.say(line);
            }
        }
        Ok(())
    }

    /// Says what the account gives, if anything.
    fn say(&mut self, line: Option<String>) {
        if let Some(line) = line {
            self.visitor.say(&line);
        }
    }

    fn cloud(&mut self, sensor: usize, cloud: Cloud) -> Result<(), V::Error> {
        let line = self.account.look_at(&cloud);
        self.say(line);
        if let Some(fixed_frame) = self.outlook.fixed_frame() {
            self.account.look_for_viewpoint(&cloud.frame_id, fixed_frame, &self.join);
            self.account.look_for_riding(fixed_frame, &mut self.join);
        }
        self.make_room()?;
        self.join.set_places(self.places());
        if let Some(pushed_out) = self.join.cloud(sensor, cloud, self.now) {
            // While patience lasts, only the bound of memory takes a cloud's place from it.
            let is_over = pushed_out.waited >= self.patience;
            let for_room = GivenUp::PushedOut { longer_helps: false };
            self.skip(&pushed_out, if is_over { GivenUp::TimedOut } else { for_room });
        }
        self.ready()
    }

    fn skip(&mut self, waited: &Waited, given_up: GivenUp) {
        let line = self.account.skip(waited, given_up, &self.join, self.outlook.transform_topics());
        self.say(line);
    }

    /// Tries, before a cloud is given up for want of room, whatever else could show the way from its frame.
    fn make_room(&mut self) -> Result<(), V::Error> {
        if self.join.waiting() < self.places() {
            return Ok(());
        }
        self.guess();
        self.ready()?;
        if self.join.waiting() < self.places() { Ok(()) } else { self.look_far_ahead() }
    }

    /// Tries the same before the transforms are forgotten that a cloud needs. Where scans come seldom, or the times of recording
    /// stand still, it is long until one takes the place of another.
    fn hurry(&mut self, message: &TfMessage) -> Result<(), V::Error> {
        let stamps = message.transforms.iter().filter_map(|transform| transform.header.stamp.stamp());
        let is_late = stamps.max().is_some_and(|newest| self.join.is_behind(newest, BEHIND));
        if !is_late {
            return Ok(());
        }
        self.guess();
        self.ready()?;
        self.look_far_ahead()
    }

    /// How many clouds may wait: only a few once one has waited as long as patience lasts.
    fn places(&self) -> usize {
        if self.join.longest_wait(self.now) < self.patience { MOST } else { FEW }
    }

    fn guess(&mut self) {
        let Some(body) = self.outlook.guess(&self.join) else { return };
        // It is well formed, and the first.
        drop(self.join.transform(&body, true));
        self.visitor.level(&body);
    }

    fn look_ahead(&mut self) -> Result<(), V::Error> {
        if self.outlook.look_ahead(&mut self.join) { self.ready() } else { Ok(()) }
    }

    /// The same, and what else lies ahead of the cloud that has waited longest.
    fn look_far_ahead(&mut self) -> Result<(), V::Error> {
        self.look_ahead()?;
        while let Some(transform) = self.outlook.next_early(&self.join) {
            self.take_in(&transform, false);
            self.ready()?;
        }
        Ok(())
    }

    fn transforms(&mut self, message: &TfMessage, is_static: bool) -> Result<(), V::Error> {
        self.outlook.note(message, is_static);
        // All is fed again, and nothing is to be said of what goes against a guess alone.
        if self.outlook.is_wrong() {
            return Ok(());
        }
        if !is_static {
            self.hurry(message)?;
        }
        for transform in &message.transforms {
            if !self.outlook.turn(transform, is_static) {
                self.take_in(transform, is_static);
            }
        }
        self.ready()
    }

    fn take_in(&mut self, transform: &TransformStamped, is_static: bool) {
        let inserted = self.join.transform(transform, is_static);
        let line = self.account.transform(transform, &inserted);
        self.say(line);
    }

    fn ready(&mut self) -> Result<(), V::Error> {
        let Some(fixed_frame) = self.outlook.fixed_frame() else { return Ok(()) };
        if self.enough {
            return Ok(());
        }
        let mut ready = self.join.ready(fixed_frame).into_iter();
        while let Some(Joined { scan, sensor, at, total, invalid, jumped_back }) = ready.next() {
            if let Some(Jump { seconds, given_up }) = jumped_back {
                self.account.jumped_back(given_up);
                if self.visitor.jumped_back(seconds)? == Go::Home {
                    self.enough = true;
                    self.account.tally.skip_all(AFTER_JUMP, 1 + ready.count());
                    return Ok(());
                }
            }
            self.account.tally.take(total, invalid, scan.points.len());
            let origin = Origin { sensor, recorded: at.wall };
            self.visitor.scan(&scan, origin, fixed_frame, &self.account.tally)?;
        }
        Ok(())
    }

    /// What still waits at the end.
    fn finish(mut self, halt: Halt) -> Result<Ended, FeedError<V::Error>> {
        let (unread, mut stopped) = match halt {
            Halt::WrongFrame => return self.wrong_frame(),
            Halt::End(unread) => (unread, false),
            Halt::Stop => (None, true),
        };
        if !stopped && !self.enough {
            self.use_all_known().map_err(FeedError::Visitor)?;
            stopped = self.stop.load(Ordering::Relaxed);
            if !stopped && self.outlook.is_wrong() {
                return self.wrong_frame();
            }
        }
        for waited in self.join.give_up(self.now) {
            if self.enough {
                self.account.tally.skip_all(AFTER_JUMP, 1);
            } else if stopped {
                self.account.tally.skip_all(SHUTDOWN, 1);
            } else {
                self.skip(&waited, GivenUp::AtEnd);
            }
        }
        let Self { visitor, join, outlook, account, .. } = self;
        let (tally, warnings) = account.end(|frame| outlook.reaches(frame));
        let (fixed_frame, others) = outlook.end(&join);
        let remarks: Vec<_> = warnings.into_iter().chain(others).collect();
        remarks.iter().for_each(|remark| visitor.say(&remark.text));
        Ok(Ended::Fed(Fed { tally, fixed_frame, remarks, unread, stopped }))
    }

    /// Takes what is ready by all that can be known.
    fn use_all_known(&mut self) -> Result<(), V::Error> {
        self.guess();
        self.ready()?;
        self.look_ahead()
    }

    /// Finds the right frame in the whole bag, so that there is no third time.
    fn wrong_frame(&self) -> Result<Ended, FeedError<V::Error>> {
        let right = self.outlook.right(&self.join);
        right.map(Ended::WrongFrame).ok_or(FeedError::Stopped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_stopped_before_a_scan_was_taken_in_is_for_nothing_though_some_were_refused() {
        let fed = |stopped, scans| {
            let tally = Tally { scans, skipped: [(AFTER_JUMP, 3), (SHUTDOWN, 1)].into(), ..Tally::default() };
            Fed { tally, fixed_frame: String::new(), remarks: Vec::new(), unread: None, stopped }
        };
        assert!(fed(true, 0).is_for_nothing());
        assert!(!fed(true, 1).is_for_nothing() && !fed(false, 0).is_for_nothing());
    }
}
