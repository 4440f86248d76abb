//! What makes a scan of a message, by what holds when it comes: the filter that parameters may change, the newest camera; and what
//! was heard of a sensor.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use serde::de::{DeserializeSeed, Deserializer};

use super::heard::Known;
use super::parameters::Parameters;
use super::transport::{Event, Form};
use crate::cloud::{Camera, CloudError, CloudFilter, Decoded};
use crate::msg::ros::CameraInfo;

/// The camera of the newest `CameraInfo`, or why there is none.
#[derive(Clone)]
pub(super) struct LatestCamera(Rc<RefCell<Result<Camera, CloudError>>>);

impl Default for LatestCamera {
    fn default() -> Self {
        Self(Rc::new(RefCell::new(Err(CloudError::NoCameraInfo))))
    }
}

/// A topic on which the camera of a sensor says what it is.
pub(super) struct CameraTopic {
    /// Number of the sensor.
    pub(super) sensor: usize,
    /// Fully qualified.
    pub(super) name: String,
    /// Shared with the seeds of the sensor's images.
    pub(super) camera: LatestCamera,
}

impl CameraTopic {
    /// Keeps the camera of a message, or what is wrong with it; what to tell the node, where it differs from the one before.
    pub(super) fn event<R>(&self, info: Result<CameraInfo, String>) -> Option<Event<R>> {
        let LatestCamera(known) = &self.camera;
        match info.map(|info| (Camera::from_info(&info), info.header.frame_id)) {
            Ok((newest, _)) if *known.borrow() == newest => None,
            Ok((newest, frame)) => {
                known.borrow_mut().clone_from(&newest);
                Some(Event::Camera(self.sensor, newest, frame))
            }
            Err(text) => Some(Event::Garbled { topic: self.name.clone().into(), text }),
        }
    }
}

/// The publishers of one topic.
pub(super) type Publishers = Rc<RefCell<Known>>;

/// What was heard of a sensor.
#[derive(Clone, Default)]
pub(super) struct Scans {
    pub(super) camera: LatestCamera,
    pub(super) points: Publishers,
    pub(super) images: Publishers,
    pub(super) compressed: Publishers,
    /// The form that scans are made of, or were made of last.
    pub(super) chosen: Rc<Cell<Option<Form>>>,
}

impl Scans {
    /// The same where the network is joined anew.
    pub(super) fn anew(&self) -> Self {
        for known in [&self.points, &self.images, &self.compressed] {
            known.borrow_mut().begin_anew();
        }
        self.clone()
    }

    /// Whether compressed images are what is read: where the network is joined anew they go on.
    pub(super) fn reads_compressed(&self) -> bool {
        let form = self.chosen.get();
        form.map_or_else(|| self.comes(Form::CompressedDepth), |form| form == Form::CompressedDepth)
    }

    /// The form that scans are made of, where it still comes.
    pub(super) fn in_use(&self) -> Option<Form> {
        self.chosen.get().filter(|form| self.comes(*form))
    }

    /// Whether scans come in this form, or images that lack their camera info alone.
    pub(super) fn comes(&self, form: Form) -> bool {
        match form {
            Form::Points => self.points.borrow().comes(),
            Form::Depth => self.images.borrow().comes(),
            Form::CompressedDepth => self.compressed.borrow().comes(),
        }
    }
}

/// A seed made for the filter that holds when a cloud comes.
#[derive(Clone)]
pub(super) struct WithFilter<S> {
    parameters: Rc<Parameters>,
    seed: fn(CloudFilter) -> S,
}

impl<S> WithFilter<S> {
    pub(super) fn new(parameters: &Rc<Parameters>, seed: fn(CloudFilter) -> S) -> Self {
        Self { parameters: Rc::clone(parameters), seed }
    }
}

impl<'de, S: DeserializeSeed<'de, Value = Decoded>> DeserializeSeed<'de> for WithFilter<S> {
    type Value = Decoded;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Decoded, D::Error> {
        (self.seed)(self.parameters.filter()).deserialize(deserializer)
    }
}

/// A seed made for the camera that is known and the filter that holds when an image comes.
#[derive(Clone)]
pub(super) struct WithCamera<S> {
    camera: LatestCamera,
    parameters: Rc<Parameters>,
    seed: fn(Camera, CloudFilter) -> S,
}

impl<S> WithCamera<S> {
    pub(super) fn new(
        camera: &LatestCamera,
        parameters: &Rc<Parameters>,
        seed: fn(Camera, CloudFilter) -> S,
    ) -> Self {
        Self { camera: camera.clone(), parameters: Rc::clone(parameters), seed }
    }
}

impl<'de, S: DeserializeSeed<'de, Value = Decoded>> DeserializeSeed<'de> for WithCamera<S> {
    type Value = Decoded;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Decoded, D::Error> {
        let camera = self.camera.0.borrow().clone();
        match camera {
            Ok(camera) => (self.seed)(camera, self.parameters.filter()).deserialize(deserializer),
            Err(error) => Ok(Err(error)),
        }
    }
}

/// A seed that makes an error of what cannot be decoded: so its publisher and number stay known.
#[derive(Clone)]
pub(super) struct Told<S>(pub(super) S);

impl<'de, S: DeserializeSeed<'de, Value = Decoded>> DeserializeSeed<'de> for Told<S> {
    type Value = Decoded;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Decoded, D::Error> {
        let decoded = self.0.deserialize(deserializer);
        Ok(decoded.unwrap_or_else(|error| Err(CloudError::Undecodable(error.to_string()))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::heard::{SILENT, tests::came_before};

    #[test]
    fn a_form_that_has_been_silent_for_a_minute_comes_and_is_in_use_no_more_until_a_scan_does() {
        let (scans, depth) = (Scans::default(), Form::Depth);
        scans.chosen.set(Some(depth));
        for (silence, comes) in [(SILENT / 2, true), (SILENT, false)] {
            scans.images.replace(came_before(silence));
            assert_eq!((scans.comes(depth), scans.in_use().is_some()), (comes, comes), "{silence:?}");
        }
        scans.images.borrow_mut().note(&Err(CloudError::NoCameraInfo));
        assert_eq!((scans.comes(depth), scans.in_use()), (true, Some(depth)));
    }
}
