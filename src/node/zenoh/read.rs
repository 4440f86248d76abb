//! The tasks that read topics: each hands events to one bounded channel.

use std::borrow::Cow;
use std::rc::Rc;

use serde::de::{DeserializeOwned, DeserializeSeed};

use super::graph::Graph;
use super::mailbox::Room;
use super::opener::{Call, Calls, Inbox, Opener, lost};
use super::{Events, Readers};
use crate::bag::TransformTopics;
use crate::cloud::{CloudError, CloudSeed, CompressedSeed, Decoded, DepthSeed};
use crate::msg::cdr;
use crate::msg::heard::{CLOCK, TF, TF_STATIC};
use crate::msg::ros::{Clock, TriggerRequest};
use crate::msg::topic::{Named, Qos};
use crate::msg::types;
use crate::node::compressed;
use crate::node::heard::{NextScan, Origin, Sample};
use crate::node::middleware::OpenError;
use crate::node::parameters::Parameters;
use crate::node::readers::{clock_event, tell_camera, tell_scan};
use crate::node::seeds::{CameraTopic, Publishers, Scans, Told, WithCamera, WithFilter};
use crate::node::transport::{DepthTopics, Event, Form, Input, SensorTopics, Service};
use crate::tf::MAX_FRAMES;

/// Scans that may wait: as many as wait for the engine; of bytes, two of the greatest clouds.
const SCANS: Room = Room { messages: 8, bytes: 1 << 29 };
const CAMERAS: Room = Room { messages: 2, bytes: 1 << 20 };
const TRANSFORMS: Room = Room { messages: 100, bytes: 16 << 20 };
/// What is latched comes from all publishers at once, and not again.
const LATCHED: Room = Room { messages: MAX_FRAMES, bytes: 16 << 20 };
/// The newest alone counts.
const CLOCKS: Room = Room { messages: 1, bytes: 1 << 16 };
const CALLS: Room = Room { messages: 10, bytes: 1 << 16 };

/// What sensors are read with.
const SENSOR: Qos = Qos::best_effort(2);

/// Starts the tasks that read topics and calls.
pub(super) fn listen(
    opener: &Rc<Opener>,
    graph: &Graph,
    parameters: &Rc<Parameters>,
    scans: &[Scans],
    events: &Events,
) -> Result<Readers, OpenError> {
    let mut readers = Readers::new();
    for (number, (sensor, heard)) in opener.setup.sensor_topics()?.into_iter().zip(scans).enumerate() {
        let (readers, heard) = (&mut readers, heard.clone());
        Listening { opener, graph, readers, parameters, events, number, heard }.to(sensor)?;
    }
    let TransformTopics { changing, lasting } = opener.setup.transform_topics()?;
    let both = [(TF, changing, false, TRANSFORMS), (TF_STATIC, lasting, true, LATCHED)];
    for (topic, resolved, is_static, room) in both {
        let transforms = opener.subscribe(Named { name: &resolved, ..topic.named() }, topic.qos, room)?;
        let event = move |message, origin: Option<Origin>| {
            let publisher = origin.map(|origin| origin.publisher);
            Event::Transforms { message, is_static, publisher }
        };
        readers.spawn_local(read(topic.name, transforms, events.clone(), event));
    }
    if opener.setup.config().use_sim_time {
        let resolved = opener.setup.resolve(CLOCK.name)?;
        let clocks = opener.subscribe(Named { name: &resolved, ..CLOCK.named() }, CLOCK.qos, CLOCKS)?;
        let parameters = Rc::clone(parameters);
        let event = move |clock: Clock| clock_event(clock, &parameters);
        readers.spawn_local(read_clock(clocks, events.clone(), event));
    }
    for service in [Service::Reset, Service::Save] {
        let calls = opener.serve(service.named(), CALLS)?;
        readers.spawn_local(serve(service, calls, events.clone()));
    }
    Ok(readers)
}

/// Begins to read one sensor.
struct Listening<'a> {
    opener: &'a Rc<Opener>,
    graph: &'a Graph,
    readers: &'a mut Readers,
    parameters: &'a Rc<Parameters>,
    events: &'a Events,
    number: usize,
    heard: Scans,
}

impl Listening<'_> {
    fn to(&mut self, sensor: SensorTopics) -> Result<(), OpenError> {
        if let Some(points) = &sensor.points {
            self.clouds(&points.resolved)?;
        }
        if let Some(depth) = sensor.depth.clone() {
            self.images(sensor, depth)?;
        }
        Ok(())
    }

    fn clouds(&mut self, topic: &str) -> Result<(), OpenError> {
        let seed = WithFilter::new(self.parameters, CloudSeed::new);
        let scans = self.opener.subscribe(Named { name: topic, type_name: types::CLOUD }, SENSOR, SCANS)?;
        self.read(Form::Points, scans, seed, Rc::clone(&self.heard.points));
        Ok(())
    }

    /// Depth images with their camera; compressed ones while they are wanted.
    fn images(&mut self, sensor: SensorTopics, topics: DepthTopics) -> Result<(), OpenError> {
        let camera = self.heard.camera.clone();
        let infos = Named { name: &topics.camera_info.resolved, type_name: types::CAMERA_INFO };
        let infos = self.opener.subscribe(infos, Qos { latched: true, ..SENSOR }, CAMERAS)?;
        let name = topics.camera_info.resolved.clone();
        let topic = CameraTopic { sensor: self.number, name, camera: camera.clone() };
        self.readers.spawn_local(read_cameras(topic, infos, self.events.clone()));
        let seed = WithCamera::new(&camera, self.parameters, DepthSeed::new);
        let images = Named { name: &topics.image.resolved, type_name: types::IMAGE };
        let images = self.opener.subscribe(images, SENSOR, SCANS)?;
        self.read(Form::Depth, images, seed, Rc::clone(&self.heard.images));
        let seed = WithCamera::new(&camera, self.parameters, CompressedSeed::new);
        let (opener, graph, heard) = (Rc::downgrade(self.opener), self.graph.clone(), self.heard.clone());
        let (input, events) = (Form::CompressedDepth.of(self.number), self.events.clone());
        self.readers.spawn_local(async move {
            let read = async || {
                let images = Named { name: &topics.compressed, type_name: types::COMPRESSED_IMAGE };
                let images = opener.upgrade().map(|opener| opener.subscribe(images, SENSOR, SCANS));
                let images = compressed::opened(images).await;
                read_scans(input, images, seed.clone(), Rc::clone(&heard.compressed), events.clone()).await
            };
            compressed::read_while_wanted(&sensor, &heard, false, || graph.sources(), read).await
        });
        Ok(())
    }

    fn read<S>(&mut self, form: Form, scans: Inbox, seed: S, known: Publishers)
    where
        S: for<'de> DeserializeSeed<'de, Value = Decoded> + Clone + 'static,
    {
        let input = form.of(self.number);
        self.readers.spawn_local(read_scans(input, scans, seed, known, self.events.clone()));
    }
}

/// Reads scans until the node ends.
async fn read_scans<S>(
    input: Input,
    scans: Inbox,
    seed: S,
    known: Publishers,
    events: Events,
) -> Cow<'static, str>
where
    S: for<'de> DeserializeSeed<'de, Value = Decoded> + Clone,
{
    loop {
        let received = scans.take().await;
        let decoded = cdr::read_with(&received.bytes(), Told(seed.clone()));
        let scan = decoded.unwrap_or_else(|text| Err(CloudError::Undecodable(text)));
        let (origin, dropped) = (received.origin(), received.dropped);
        // Nobody keeps a message while the node is busy.
        drop(received);
        // Where messages have numbers, what was dropped here is a gap in them.
        let takes = || {
            if let Some(origin) = origin {
                return known.borrow_mut().tell(Ok::<_, String>(Sample { scan, origin }), false);
            }
            known.borrow_mut().note(&scan);
            Some(NextScan { scan, lost_before: dropped })
        };
        if !tell_scan(&events, input, takes).await {
            break;
        }
    }
    scans.name.into()
}

/// Reads what a camera says of itself until the node ends.
async fn read_cameras(topic: CameraTopic, infos: Inbox, events: Events) -> Cow<'static, str> {
    loop {
        let info = cdr::read(&infos.take().await.bytes());
        if !tell_camera(&events, &topic, info).await {
            return topic.name.into();
        }
    }
}

async fn read<M: DeserializeOwned>(
    topic: &'static str,
    messages: Inbox,
    events: Events,
    event: impl Fn(M, Option<Origin>) -> Event<Call>,
) -> Cow<'static, str> {
    let garbled = |text| Event::Garbled { topic: topic.into(), text };
    loop {
        let received = messages.take().await;
        let read = cdr::read(&received.bytes());
        let message = read.map_or_else(garbled, |message| event(message, received.origin()));
        for event in lost(topic, received.dropped).into_iter().chain([message]) {
            if events.send(event).await.is_err() {
                return topic.into();
            }
        }
    }
}

/// Reads the simulated time, of which what found no room is not missed.
async fn read_clock(
    clocks: Inbox,
    events: Events,
    event: impl Fn(Clock) -> Event<Call>,
) -> Cow<'static, str> {
    let garbled = |text| Event::Garbled { topic: CLOCK.name.into(), text };
    loop {
        let clock = cdr::read(&clocks.take().await.bytes()).map_or_else(garbled, &event);
        if events.send(clock).await.is_err() {
            return CLOCK.name.into();
        }
    }
}

async fn serve(service: Service, calls: Calls, events: Events) -> Cow<'static, str> {
    while let Some((call, TriggerRequest { .. })) = calls.take(&events).await {
        if events.send(Event::Call(service, call)).await.is_err() {
            break;
        }
    }
    service.name().into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::zenoh::mailbox::Mailbox;

    #[test]
    fn latched_transforms_of_some_thousand_publishers_wait_together() {
        let mailbox = Mailbox::new(LATCHED);
        assert!((0..5000).all(|publisher| mailbox.put(publisher, 200).is_empty()));
    }
}
