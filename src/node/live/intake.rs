//! What is heard of each sensor, and in which of its forms it is taken.

use std::time::Instant;

use tracing::info;

use super::report::AHEAD;
use super::{Live, QUIET, QUIET_AGAIN};
use crate::cloud::{Cloud, CloudError, Decoded};
use crate::count::{count_of, were};
use crate::engine::Stamp;
use crate::join::with_stamp;
use crate::node::counts::OTHER_INPUT;
use crate::node::heard::SILENT;
use crate::node::inputs;
use crate::node::transport::{Form, Input, Source, Transport};

/// One sensor, as far as it was heard.
#[derive(Clone, Debug)]
pub(super) struct Intake {
    /// The first form that a good scan with points came in: two of one sensor must not fill the map twice.
    pub(super) chosen: Option<Form>,
    /// When the newest scan came.
    pub(super) since: Instant,
    /// When the first scan was lost or could not be used since the last good one.
    pub(super) bad_since: Option<Instant>,
    /// When the first scan without a single point came since the last with any, or the last that could not be used.
    pub(super) empty_since: Option<Instant>,
    /// When it was said last that none comes.
    said_quiet: Option<Instant>,
    /// The stamp of the newest good scan, whether or not it is taken in.
    pub(super) newest: Option<Stamp>,
    pub(super) period: Period,
    /// What was given up since a report in whose time one was taken in.
    pub(super) left_out: Option<LeftOut>,
    /// It was said that its clouds come in a frame that is no sensor's.
    pub(super) is_known_without_viewpoint: bool,
    /// The frame of its intrinsics, and whether it was said that its images are in another.
    pub(super) camera_frame: String,
    pub(super) has_other_frame: bool,
}

/// What has come of a sensor since the last report.
#[derive(Clone, Debug, Default)]
pub(super) struct Period {
    /// Scans that came.
    pub(super) received: u64,
    /// Those of them that could not be used, and why the newest could not.
    pub(super) skipped: u64,
    pub(super) fault: Option<CloudError>,
    /// Scans that never arrived.
    pub(super) lost: u64,
    /// Good scans that show next to nothing, and what is to be said of the newest.
    pub(super) blind: u64,
    pub(super) blindness: Option<String>,
    /// Good scans that were given up, without a transform or for newer ones.
    pub(super) given_up: u64,
    /// What is to be said of the first of them that got no transform.
    pub(super) without_transform: Option<String>,
}

/// Scans that were good, and were given up all the same.
#[derive(Clone, Debug)]
pub(super) struct LeftOut {
    /// When the first was.
    pub(super) since: Instant,
    /// Why one of the newest was, and what helps.
    pub(super) why: String,
}

impl Intake {
    pub(super) fn new(start: Instant) -> Self {
        Self {
            chosen: None,
            since: start,
            bad_since: None,
            empty_since: None,
            said_quiet: None,
            newest: None,
            period: Period::default(),
            left_out: None,
            is_known_without_viewpoint: false,
            camera_frame: String::new(),
            has_other_frame: false,
        }
    }

    /// A report was made, in whose time scans of it were taken in or not.
    pub(super) fn begin_period(&mut self, were_taken_in: bool) {
        self.period = Period::default();
        self.left_out.take_if(|_| were_taken_in);
    }

    /// A good scan was given up without a transform. Why, and what helps, is asked once in a report, for the first: it must be of the
    /// moment itself, and thousands of frames take long to list.
    pub(super) fn give_up(&mut self, why: impl FnOnce() -> String) {
        self.period.given_up += 1;
        if self.period.without_transform.is_none() {
            let why = why();
            let since = self.left_out.take().map_or_else(Instant::now, |left_out| left_out.since);
            self.left_out = Some(LeftOut { since, why: why.clone() });
            self.period.without_transform = Some(why);
        }
    }

    fn note_good(&mut self, cloud: &Cloud) {
        self.newest = Some(cloud.stamp);
        self.bad_since = None;
        if cloud.total > 0 {
            self.empty_since = None;
        } else {
            self.empty_since.get_or_insert(self.since);
        }
        if let Some(blindness) = cloud.shows_nothing() {
            self.period.blind += 1;
            self.period.blindness = Some(blindness);
        }
    }

    /// Whether it has sent nothing of use for a while, though it sends.
    pub(super) fn is_useless(&self) -> bool {
        self.bad_since.is_some_and(|since| since.elapsed() >= QUIET)
    }

    pub(super) fn takes(&self, form: Form) -> bool {
        self.chosen.is_none_or(|chosen| chosen == form)
    }
}

impl<T: Transport> Live<T> {
    /// Takes in a cloud of a sensor, or counts it where the sensor is taken in another form.
    pub(super) fn cloud(&mut self, input: Input, cloud: Decoded) {
        let Input { sensor, form } = input;
        let clock = self.clocks.now();
        let intake = &mut self.intakes[sensor];
        if !intake.takes(form) {
            return self.skip_other(input);
        }
        intake.since = Instant::now();
        intake.period.received += 1;
        let cloud = cloud.and_then(|cloud| with_stamp(cloud, || self.clocks.is_simulated()));
        match &cloud {
            Ok(cloud) => {
                intake.note_good(cloud);
                if !cloud.points.is_empty() && intake.chosen.replace(form).is_none() {
                    self.transport.chosen(input);
                    self.say_chosen(input);
                }
                self.say_when_empty(input);
                self.say_when_ahead(sensor, cloud.stamp.seconds_since(clock));
            }
            Err(error) => {
                intake.period.skipped += 1;
                intake.empty_since = None;
                intake.bad_since.get_or_insert(intake.since);
                intake.period.fault = Some(error.clone());
            }
        }
        self.let_wait(input, cloud);
    }

    /// A scan from the future is taken in, where its transform is from there too: clocks of two machines may differ.
    fn say_when_ahead(&mut self, sensor: usize, ahead: f64) {
        if ahead > AHEAD {
            let name = self.transport.inputs()[sensor].name.clone();
            let line = format_args!("the stamps of the sensor {name} are {ahead:.1} s ahead of the clock");
            self.warn(format!("ahead {name}"), line);
        }
    }

    fn say_chosen(&self, input: Input) {
        let topic = self.topic(input);
        if self.intakes.len() == 1 {
            info!("scans are made of {topic}");
        } else {
            let name = &self.transport.inputs()[input.sensor].name;
            info!("scans of the sensor {name} are made of {topic}");
        }
    }

    /// Counts a scan of a form that another one forestalled.
    fn skip_other(&mut self, input: Input) {
        let Input { sensor, form } = input;
        self.counts.borrow_mut().received += 1;
        self.counts.borrow_mut().skip(OTHER_INPUT);
        let chosen = self.intakes[sensor].chosen.unwrap_or(form);
        let line = inputs::how_to_choose(&self.transport.inputs()[sensor], chosen, form);
        self.warn(format!("other_input {}", self.topic(input)), format_args!("{line}"));
    }

    pub(super) fn lost(&mut self, Input { sensor, form }: Input, number: u64) {
        self.counts.borrow_mut().lose(number);
        let intake = &mut self.intakes[sensor];
        if !intake.takes(form) {
            return;
        }
        intake.period.lost = intake.period.lost.saturating_add(number);
        intake.bad_since.get_or_insert_with(Instant::now);
        let total = self.counts.borrow().lost;
        let look = self.transport.losses();
        let clouds = count_of(total, "cloud");
        self.warn("lost", format_args!("{clouds} {} sent and never arrived: {look}", were(total)));
    }

    /// Takes a sensor in any form again where nobody sends the chosen one any more, for its driver may come back with another, or where
    /// that has been silent for long and another is offered.
    pub(super) fn forget_gone(&mut self, sources: &[Source]) {
        let knows_all = self.transport.knows_all_sources();
        for (intake, topics) in self.intakes.iter_mut().zip(self.transport.inputs()) {
            let Some(chosen) = intake.chosen else { continue };
            let (silence, topic) = (intake.since.elapsed(), topics.topic(chosen).unwrap_or_default());
            let is_offered = |form| inputs::is_offered(topics, form, sources);
            let is_other = |form: &Form| *form != chosen;
            let why = if silence >= QUIET && knows_all && !is_offered(chosen) {
                format!("nobody publishes on {topic} any more")
            } else if silence >= SILENT && Form::ALL.into_iter().filter(is_other).any(is_offered) {
                format!("nothing has come on {topic} for {} s", silence.as_secs())
            } else {
                continue;
            };
            intake.chosen = None;
            info!("{why}: whichever form of the sensor {} comes first is taken", topics.name);
        }
    }

    /// Says why no scan of a sensor comes, as far as it can be known.
    pub(super) fn say_when_quiet(&mut self, now: Instant) {
        for sensor in 0..self.intakes.len() {
            let intake = &mut self.intakes[sensor];
            let said = intake.said_quiet.is_some_and(|said| now.duration_since(said) < QUIET_AGAIN);
            if now.duration_since(intake.since) < QUIET || said {
                continue;
            }
            intake.said_quiet = Some(now);
            let sources = self.transport.sources();
            self.forget_gone(&sources);
            let (intake, inputs) = (&self.intakes[sensor], self.transport.inputs());
            let topics = &inputs[sensor];
            let line = inputs::why_quiet(
                topics,
                intake.chosen,
                &inputs::free(sensor, inputs, &sources),
                (now - intake.since, intake.newest.is_none().then(|| self.transport.silences())),
            );
            self.warn(format!("quiet {}", topics.name), format_args!("{line}"));
        }
    }
}
