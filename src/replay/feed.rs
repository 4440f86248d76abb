//! From a bag to scans in the fixed frame, one after the other.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

use super::ahead::Ahead;
use super::disorder::Disorder;
use super::early::Early;
use super::error::FeedError;
use super::finder::Finder;
use super::fixed_frame::FixedFrame;
use super::reading::{Item, read};
use super::said::{Remark, Said};
use super::summary::{AFTER_JUMP, Tally};
use super::visitor::{Go, Visitor};
use crate::bag::{Bag, BagError, Decoder, Elsewhere, Recorded, TransformTopics};
use crate::cloud::{Cloud, CloudError};
use crate::join::{GivenUp, Join, Joined, Jump, with_stamp};
use crate::msg::ros::{TfMessage, TransformStamped};
use crate::reason::{Reason, SESSION_ENDED, SHUTDOWN};
use crate::tf::{LookupError, MAX_AGE, Waited};

/// Clouds that wait for a transform however long it takes: where there are few in a second, transforms may be few as well.
const FEW: usize = 8;
/// Clouds that wait for a transform at most, whatever the patience: a bound of memory.
const MOST: usize = 64;

/// How far behind the transforms a cloud may wait, by the stamps, until all is tried for it. What was known at its stamp is
/// forgotten after twice this.
const BEHIND: Duration = Duration::from_nanos(MAX_AGE.as_nanos() as u64 / 2);

/// Frames without a way that are remembered at most: a bag can make up ever new ones.
const UNPLACED: usize = 20;

/// How long a bag may hold nothing to be read until it is looked whether to stop.
const LOOK: Duration = Duration::from_millis(100);

/// How often it is said that a frame has changed its parent: what is said again tells of two publishers.
const MOST_REPARENTINGS_SAID: u32 = 2;

/// Messages between the two threads at most.
const BETWEEN: usize = 2;

/// Why scans are skipped that were given up before a transform was looked for.
const NOT_LOOKED_UP: Reason = Reason::new("tf_not_looked_up", "No transform was looked for before the end.");

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
    /// What was said at the end: of the order of the messages, and of how the frame was found.
    pub remarks: Vec<Remark>,
    /// What of the bag could not be read; `None` where all of it was.
    pub unread: Option<BagError>,
    /// Whether it was told to stop.
    pub stopped: bool,
}

impl Fed {
    /// Whether it was told to stop before anything had become of a scan.
    pub fn is_for_nothing(&self) -> bool {
        self.stopped && self.tally.scans == 0 && self.tally.skipped.keys().all(|reason| *reason == SHUTDOWN)
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
    find_transforms(bag, &mut decoder, &fixed_frame, &stop, visitor)?;
    let ahead = Ahead::new(bag, decoder, Arc::clone(&stop));
    let messages = bag.messages();
    let bytes = messages.bytes_read();
    let (sender, receiver) = sync_channel(BETWEEN);
    let quit = Arc::new(AtomicBool::new(false));
    let reading = std::thread::Builder::new()
        .name("cfodi-bag".to_owned())
        .spawn({
            let (quit, decoder) = (Arc::clone(&quit), ahead.decoder());
            move || read(messages, decoder, with_messages, &sender, &quit)
        })
        .map_err(FeedError::Start)?;
    let mut feeder = Feeder {
        ahead,
        visitor,
        stop,
        join: Join::new(FEW),
        patience,
        now: Duration::ZERO,
        disorder: Disorder::default(),
        early: Early::new(patience),
        finder: Finder::new(fixed_frame),
        enough: false,
        tally: Tally::default(),
        unplaced: BTreeSet::new(),
        lacks_transforms: false,
        without_viewpoint: None,
        distorted: BTreeSet::new(),
        skips_said: Said::default(),
        transforms_said: Said::default(),
    };
    let halt = feeder.take(&receiver, &bytes, progress);
    quit.store(true, Ordering::Relaxed);
    // A full channel would hold the reading thread back for ever.
    drop(receiver);
    let died = reading.join().is_err();
    let halt = halt.map_err(FeedError::Visitor)?;
    if died {
        return Err(FeedError::Died);
    }
    feeder.finish(halt)
}

/// Where the bag has no transforms on the topics that are read, takes the only others that there are. A sensor is not taken to stand
/// still while any might tell how it moved.
fn find_transforms<V: Visitor>(
    bag: &Bag,
    decoder: &mut Decoder,
    fixed_frame: &FixedFrame,
    stop: &AtomicBool,
    visitor: &mut V,
) -> Result<(), FeedError<V::Error>> {
    let TransformTopics { changing, lasting } = decoder.transform_topics();
    let survey = bag.survey(stop);
    if !survey.is_complete && stop.load(Ordering::Relaxed) {
        return Ok(());
    }
    match decoder.transform_topics().elsewhere(&survey.topics) {
        Some(Elsewhere::Pair(pair)) => {
            visitor.say(&format!(
                "no transforms are on {changing} and {lasting}: they are read from {} and {}",
                pair.changing, pair.lasting
            ));
            decoder.read_transforms_from(pair);
            Ok(())
        }
        Some(Elsewhere::Several(choices)) if !matches!(fixed_frame, FixedFrame::Settled(_)) => {
            let (changing, lasting) = (changing.clone(), lasting.clone());
            Err(FeedError::Elsewhere { changing, lasting, choices: Elsewhere::remappings(&choices) })
        }
        _ => Ok(()),
    }
}

struct Feeder<'a, V> {
    ahead: Ahead<'a>,
    visitor: &'a mut V,
    stop: Arc<AtomicBool>,
    join: Join,
    patience: Duration,
    /// When the last message was recorded.
    now: Duration,
    disorder: Disorder,
    early: Early,
    finder: Finder,
    /// The visitor wants no more.
    enough: bool,
    tally: Tally,
    /// Frames of which a scan was skipped because they had no way to the fixed one.
    unplaced: BTreeSet<String>,
    /// Scans were skipped for want of a transform at their time, or of one that has jumped back with them.
    lacks_transforms: bool,
    /// What is to be said of clouds in the fixed frame.
    without_viewpoint: Option<String>,
    /// What is to be said of cameras.
    distorted: BTreeSet<String>,
    /// Why scans of which frame were skipped.
    skips_said: Said,
    /// What transforms have done or were refused for.
    transforms_said: Said,
}

impl<V: Visitor> Feeder<'_, V> {
    fn take(
        &mut self,
        receiver: &Receiver<Item>,
        bytes: &Arc<AtomicU64>,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Halt, V::Error> {
        loop {
            match receiver.recv_timeout(LOOK) {
                Ok(Item::Message(message)) => self.visitor.message(&message)?,
                Ok(Item::Recorded { recorded, at, decoding }) => {
                    self.disorder.note(at);
                    self.now = at;
                    self.recorded(recorded, decoding)?;
                }
                Ok(Item::Unread(error)) => return Ok(Halt::End(Some(error))),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(Halt::End(None)),
            }
            progress(Progress { bytes: bytes.load(Ordering::Relaxed), scans: self.tally.scans });
            if self.stop.load(Ordering::Relaxed) {
                return Ok(Halt::Stop);
            }
            if self.finder.is_wrong() && !self.enough {
                return Ok(Halt::WrongFrame);
            }
        }
    }

    fn recorded(&mut self, recorded: Recorded, decoding: Duration) -> Result<(), V::Error> {
        if self.enough {
            // What is left out is counted to the end.
            let scans = usize::from(matches!(recorded, Recorded::Cloud { .. }));
            self.tally.skip_all(AFTER_JUMP, scans);
            return Ok(());
        }
        match recorded {
            Recorded::Cloud { sensor, cloud } => {
                match cloud.and_then(|cloud| with_stamp(cloud, || self.ahead.begins_at_zero())) {
                    Ok(cloud) => {
                        self.tally.decoded(cloud.total, decoding);
                        self.cloud(sensor, cloud)?;
                    }
                    Err(error) => self.refused(&error),
                }
            }
            Recorded::Transforms { message, is_static } => self.transforms(&message, is_static)?,
            Recorded::Distorted { topic } => {
                self.distorted.insert(format!(
                    "{topic} tells of lens distortion: depth images are taken as rectified, and are off by it where they are not"
                ));
            }
            Recorded::Undecodable { topic, text } => {
                if self.tally.undecodable(&topic) {
                    self.visitor.say(&format!("a message on {topic} was skipped: {text}"));
                }
            }
        }
        Ok(())
    }

    fn refused(&mut self, error: &CloudError) {
        if self.tally.skip(error.reason()) {
            self.visitor.say(&format!("a scan was skipped: {error}"));
        }
    }

    fn cloud(&mut self, sensor: usize, cloud: Cloud) -> Result<(), V::Error> {
        if let Some(line) = cloud.hardly_used()
            && self.tally.note_hardly_used()
        {
            self.visitor.say(&line);
        }
        if self.without_viewpoint.is_none()
            && let Some(fixed_frame) = self.finder.name()
        {
            self.without_viewpoint = self.join.without_viewpoint(&cloud.frame_id, fixed_frame);
        }
        self.make_room()?;
        self.join.set_places(self.places());
        if let Some(pushed_out) = self.join.cloud(sensor, cloud, self.now) {
            // While patience lasts, only the bound of memory takes a cloud's place from it.
            let is_over = pushed_out.waited >= self.patience;
            self.skip(&pushed_out, if is_over { GivenUp::TimedOut } else { GivenUp::PushedOut });
        }
        self.ready()
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
        let Some(body) = self.finder.guess(&self.ahead, &self.join) else { return };
        // It is well formed, and the first.
        drop(self.join.transform(&body, true));
        self.visitor.level(&body);
    }

    fn look_ahead(&mut self) -> Result<(), V::Error> {
        if self.finder.look_ahead(&self.ahead, &mut self.join) { self.ready() } else { Ok(()) }
    }

    /// The same, and what else lies ahead of the cloud that has waited longest.
    fn look_far_ahead(&mut self) -> Result<(), V::Error> {
        self.look_ahead()?;
        while let Some(transform) = self.early.next(&self.ahead, &self.join) {
            self.take_in(&transform, false);
            self.ready()?;
        }
        Ok(())
    }

    fn transforms(&mut self, message: &TfMessage, is_static: bool) -> Result<(), V::Error> {
        self.finder.note(message, is_static);
        // All is fed again, and nothing is to be said of what goes against a guess alone.
        if self.finder.is_wrong() {
            return Ok(());
        }
        if !is_static {
            self.hurry(message)?;
        }
        for transform in &message.transforms {
            if !self.early.turn(transform, is_static) {
                self.take_in(transform, is_static);
            }
        }
        self.ready()
    }

    fn take_in(&mut self, transform: &TransformStamped, is_static: bool) {
        if let Some(line) = self.transform(transform, is_static) {
            self.visitor.say(&line);
        }
    }

    /// Takes in a transform, and gives what is to be said of it.
    fn transform(&mut self, transform: &TransformStamped, is_static: bool) -> Option<String> {
        let said = &mut self.transforms_said;
        match self.join.transform(transform, is_static) {
            Ok(inserted) => {
                inserted.about(transform).filter(|line| said.is_due(line, MOST_REPARENTINGS_SAID))
            }
            Err(error) => {
                let reason = error.reason();
                self.tally.refuse_transform(reason);
                let is_due = said.is_due(&format!("{} {}", reason.key, transform.child_frame_id), 1);
                is_due.then(|| format!("a transform was refused: {error}"))
            }
        }
    }

    fn ready(&mut self) -> Result<(), V::Error> {
        let Some(fixed_frame) = self.finder.name() else { return Ok(()) };
        if self.enough {
            return Ok(());
        }
        let mut ready = self.join.ready(fixed_frame).into_iter();
        while let Some(Joined { scan, at, total, invalid, jumped_back }) = ready.next() {
            if let Some(Jump { seconds, given_up }) = jumped_back {
                self.disorder.jumped();
                self.tally.skip_all(SESSION_ENDED, given_up);
                if self.visitor.jumped_back(seconds)? == Go::Home {
                    self.enough = true;
                    self.tally.skip_all(AFTER_JUMP, 1 + ready.count());
                    return Ok(());
                }
            }
            self.tally.take(total, invalid, scan.points.len());
            self.visitor.scan(&scan, at.wall, fixed_frame, &self.tally)?;
        }
        Ok(())
    }

    fn skip(&mut self, waited: &Waited<Cloud>, given_up: GivenUp) {
        let lacks = waited.last_error.as_ref();
        let reason = lacks.map_or(NOT_LOOKED_UP, LookupError::reason);
        self.tally.skip(reason);
        self.lacks_transforms |= lacks.is_some_and(LookupError::is_of_time);
        if lacks.is_some_and(LookupError::is_unconnected) && self.unplaced.len() < UNPLACED {
            self.unplaced.insert(waited.frame_id.clone());
        }
        if self.skips_said.is_due(&format!("{} {}", reason.key, waited.frame_id), 1) {
            let hint = self.join.hint(lacks, given_up);
            let words: Vec<_> = lacks.map(ToString::to_string).into_iter().chain(hint).collect();
            self.visitor.say(&format!("a scan was skipped: {}", words.join("; ")));
        }
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
            if !stopped && self.finder.is_wrong() {
                return self.wrong_frame();
            }
        }
        for waited in self.join.give_up(self.now) {
            if self.enough {
                self.tally.skip_all(AFTER_JUMP, 1);
            } else if stopped {
                self.tally.skip_all(SHUTDOWN, 1);
            } else {
                self.skip(&waited, GivenUp::AtEnd);
            }
        }
        let came_later = self.unplaced.iter().any(|frame| self.finder.reaches(frame));
        let disorder = self.disorder.about(came_later || self.lacks_transforms);
        let warnings = disorder.into_iter().chain(self.without_viewpoint).chain(self.distorted);
        let warnings = warnings.map(Remark::warning);
        let remarks: Vec<_> =
            warnings.chain(self.early.about()).chain(self.finder.about(&self.join)).collect();
        remarks.iter().for_each(|remark| self.visitor.say(&remark.text));
        let fixed_frame = self.finder.into_name();
        Ok(Ended::Fed(Fed { tally: self.tally, fixed_frame, remarks, unread, stopped }))
    }

    /// Takes what is ready by all that can be known.
    fn use_all_known(&mut self) -> Result<(), V::Error> {
        self.guess();
        self.ready()?;
        self.look_ahead()
    }

    /// Finds the right frame in the whole bag, so that there is no third time.
    fn wrong_frame(&self) -> Result<Ended, FeedError<V::Error>> {
        let right = self.finder.right(&self.ahead, &self.join);
        right.map(Ended::WrongFrame).ok_or(FeedError::Stopped)
    }
}
