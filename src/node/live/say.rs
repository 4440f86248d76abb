//! What the log says of what comes and of what does not.

use std::borrow::Cow;
use std::time::Instant;

use tracing::{Level, debug};

use super::rivals::Apart;
use super::{Live, MOST_PLACES, QUIET};
use crate::cloud::{Camera, Cloud, CloudError, distortion, is_rectified_by_name, other_frame};
use crate::join::{GivenUp, TransformsFrom, Waited};
use crate::msg::ros::TransformStamped;
use crate::node::counts::{TRANSFORM_TIMEOUT, WAITING_QUEUE_FULL};
use crate::node::heard::PublisherId;
use crate::node::inputs;
use crate::node::throttle::log;
use crate::node::transport::{Form, Input, Transport};
use crate::reason::{Reason, SHUTDOWN};
use crate::tf::{FrameError, Inserted, Lack};

impl<T: Transport> Live<T> {
    /// Says when next to nothing of a cloud is of use, for its unit, frame or range may be others than assumed, and when it does not
    /// say where its sensor stood.
    pub(super) fn look_at(&mut self, input: Input, cloud: &Cloud) {
        if let Some(line) = cloud.hardly_used() {
            let topic = self.topic(input);
            self.warn(format!("hardly_used {topic}"), format_args!("{topic}: {line}"));
        }
        self.look_at_frames(input, cloud);
        if self.intakes[input.sensor].is_known_without_viewpoint {
            return;
        }
        if let Some(line) = self.join.without_viewpoint(&cloud.frame_id, &self.fixed_frame) {
            self.intakes[input.sensor].is_known_without_viewpoint = true;
            let topic = self.topic(input);
            self.warn(format!("viewpoint {topic}"), format_args!("{topic}: {line}"));
        }
    }

    /// Says it once where images are in another frame than their intrinsics.
    fn look_at_frames(&mut self, input: Input, image: &Cloud) {
        let (intake, inputs) = (&self.intakes[input.sensor], self.transport.inputs());
        // Nothing is made of what nearly every image has.
        if input.form == Form::Points || intake.has_other_frame || intake.camera_frame == image.frame_id {
            return;
        }
        let Some(depth) = &inputs[input.sensor].depth else { return };
        let topics = [&self.topic(input), &*depth.camera_info.resolved];
        if let Some(line) = other_frame(topics, [&image.frame_id, &intake.camera_frame]) {
            self.intakes[input.sensor].has_other_frame = true;
            log(Level::WARN, &line);
        }
    }

    /// The topic of an input, as it is read.
    pub(super) fn topic(&self, Input { sensor, form }: Input) -> String {
        self.transport.inputs()[sensor].topic(form).unwrap_or_default().to_owned()
    }

    /// Counts a scan that cannot be used, and says why.
    pub(super) fn refuse(&mut self, input: Input, error: &CloudError) {
        self.counts.borrow_mut().skip(error.reason());
        let topic = self.topic(input);
        // To ask who publishes takes longer than to skip a scan.
        let level = self.throttle.level_now(format!("{} {topic}", error.reason().key), Level::WARN);
        let is_due = level == Level::WARN;
        let why = if is_due { self.why_unusable(input.sensor, error) } else { error.to_string() };
        log(level, &format!("a scan of {topic} was skipped: {why}"));
    }

    /// Counts a transform that cannot be used, and says why.
    pub(super) fn refuse_transform(&mut self, error: &FrameError) {
        self.diagnosis.refused(error.to_string());
        self.warn(error.reason().key, format_args!("a transform was refused: {error}"));
    }

    /// Says what a transform did beside being stored.
    pub(super) fn say_inserted(&mut self, inserted: &Inserted, transform: &TransformStamped) {
        let Some(line) = inserted.about(transform) else { return };
        // Before the first scan any may matter.
        let matters = self.join.sensors().next().is_none() || self.places_scans(&transform.child_frame_id);
        if matches!(inserted, Inserted::StaticMoved { .. }) && matters {
            self.diagnosis.doubt(inserted.kind(), line.clone());
        }
        self.warn(inserted.kind(), format_args!("{line}"));
    }

    /// Whether scans are placed by the transforms of this frame.
    fn places_scans(&self, child: &str) -> bool {
        let frames = self.join.frames();
        self.join.sensors().any(|sensor| frames.is_on_way(child, &self.fixed_frame, sensor))
    }

    /// Says where a publisher's transform is contradicted by another's, and scans are placed by both.
    pub(super) fn look_for_rivals(
        &mut self,
        publisher: PublisherId,
        transform: &TransformStamped,
        at: Instant,
    ) {
        let Some(Apart { by, turned }) = self.rivals.note(publisher, transform, at) else { return };
        let (child, parent) = (&transform.child_frame_id, &transform.header.frame_id);
        if !self.places_scans(child) {
            return;
        }
        let line = format!(
            "two publishers place {child} below {parent} by turns, {by:.2} m and {turned:.2} rad apart: scans are placed by both, and \
             surfaces come out double"
        );
        if self.rivals.is_news(child) {
            log(Level::WARN, &line);
        }
        self.diagnosis.doubt("tf_rivals", line);
    }

    /// Why clouds of a sensor cannot be used, with the words that help where none could for a while: images may come before their
    /// camera info does, or is found.
    pub(super) fn why_unusable(&self, sensor: usize, error: &CloudError) -> String {
        if !self.intakes[sensor].is_useless() {
            return error.to_string();
        }
        let sources = || self.transport.sources();
        inputs::why_unusable(error, (sensor, self.transport.inputs()), sources)
    }

    pub(super) fn camera(&mut self, sensor: usize, camera: &Result<Camera, CloudError>) {
        let Some(depth) = &self.transport.inputs()[sensor].depth else { return };
        let (image, topic) = (depth.image.resolved.clone(), depth.camera_info.resolved.clone());
        match camera {
            // Of a rectified image the coefficients are those of the one that it was made from.
            Ok(camera) if camera.is_distorted() && !is_rectified_by_name(&image) => {
                self.warn(format!("distorted {topic}"), format_args!("{}", distortion(&topic, &image)));
            }
            Ok(camera) => debug!("{topic}: {}x{} pixels", camera.width(), camera.height()),
            Err(error) => {
                self.warn(format!("{} {topic}", error.reason().key), format_args!("{topic}: {error}"));
            }
        }
    }

    /// Counts a cloud that got no transform, and says what helps.
    pub(super) fn skip(&mut self, waited: &Waited, given_up: GivenUp) {
        let &Waited { sensor, cloud: Cloud { ref frame_id, .. }, waited, ref lacks } = waited;
        let reason = reason_of(given_up);
        self.counts.borrow_mut().skip(reason);
        let why = lacks.as_ref().map_or_else(String::new, ToString::to_string);
        let (seconds, fixed_frame) = (waited.as_secs_f64(), &self.fixed_frame);
        let mut line = format!(
            "a cloud was skipped after {seconds:.2} s without a transform from `{frame_id}` to `{fixed_frame}`: {why}"
        );
        if let Some(fault) = self.clocks.fault(Instant::now()) {
            line = format!("{line}; {fault}");
        }
        if let GivenUp::PushedOut { longer_helps } = given_up {
            let is_late = lacks.as_ref().is_some_and(|why| matches!(why.lack, Lack::TooLate { .. }));
            let places = self.about_places(longer_helps, is_late);
            line = format!("{line}; it made place for a newer one: {places}");
        }
        self.diagnosis.waited(waited);
        let level = self.throttle.level_now(kind_of(reason.key, sensor), Level::WARN);
        let why_none = || why_no_transforms(&*self.transport);
        let why = || {
            with_hint(
                line.clone(),
                self.join.hint(lacks.as_ref(), given_up, TransformsFrom::Network, why_none),
            )
        };
        // Thousands of frames take longer to list than a cloud to skip.
        if level == Level::WARN {
            log(level, &why());
        } else {
            log(level, &line);
        }
        self.intakes[sensor].give_up(why);
    }

    /// How many clouds may wait, and, where a transform `is_late` and nothing else is lacking, whether a longer `tf_timeout` lets more wait.
    fn about_places(&self, longer_helps: bool, is_late: bool) -> String {
        let places = self.join.places();
        match (longer_helps, is_late) {
            (true, true) => format!(
                "{places} clouds may wait, of all sensors together, and up to {MOST_PLACES} with a larger tf_timeout"
            ),
            (true, false) => format!("{places} clouds may wait, of all sensors together"),
            (false, _) => {
                format!("{places} clouds may wait, of all sensors together, whatever tf_timeout is")
            }
        }
    }

    /// Says of a sensor that its driver sends, and nothing.
    pub(super) fn say_when_empty(&mut self, input: Input) {
        let Some(since) = self.intakes[input.sensor].empty_since else { return };
        let elapsed = since.elapsed();
        if elapsed >= QUIET {
            let topic = self.topic(input);
            let line = format_args!("{topic}: no cloud has had a point for {} s", elapsed.as_secs());
            self.warn(format!("empty {topic}"), line);
        }
    }

    pub(super) fn warn(&mut self, kind: impl Into<Cow<'static, str>>, line: std::fmt::Arguments<'_>) {
        log(self.throttle.level_now(kind, Level::WARN), &line.to_string());
    }
}

/// Why no transform at all has come, as far as it can be known.
pub(super) fn why_no_transforms(transport: &impl Transport) -> String {
    inputs::why_no_transforms(transport.transform_topics(), &transport.sources())
}

/// What is to be said of a cloud without a transform, with what helps where that does not say all.
pub(super) fn with_hint(line: String, hint: Option<String>) -> String {
    [line].into_iter().chain(hint).collect::<Vec<_>>().join("; ")
}

/// What a cloud without a transform is counted by.
const fn reason_of(given_up: GivenUp) -> Reason {
    match given_up {
        GivenUp::TimedOut => TRANSFORM_TIMEOUT,
        GivenUp::PushedOut { .. } => WAITING_QUEUE_FULL,
        GivenUp::AtEnd => SHUTDOWN,
    }
}

/// The kind of line that says why clouds of a sensor are skipped: what one lacks must not hide what another does.
fn kind_of(reason: &str, sensor: usize) -> String {
    format!("{reason} {sensor}")
}
