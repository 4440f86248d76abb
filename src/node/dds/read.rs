//! The tasks that read topics: each hands events to one bounded channel.

use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::rc::Rc;

use futures::{StreamExt, pin_mut};
use ros2_client::qos::{Durability, History};
use ros2_client::{MessageInfo, QosProfile, Subscription};
use rustdds::policy::{self, ResourceLimits};
use rustdds::{QosPolicyBuilder, TopicDescription as _};
use serde::de::{DeserializeOwned, DeserializeSeed};

use super::namesakes::Namesakes;
use super::network::{Sources, Triggers};
use super::{Caller, Events, Opener, Readers, latched, parameters, reliable};
use crate::args::security::Security;
use crate::bag::TransformTopics;
use crate::cloud::{CloudSeed, CompressedSeed, Decoded, DepthSeed};
use crate::msg::heard::{CLOCK, TF, TF_STATIC};
use crate::msg::ros::{CameraInfo, Clock};
use crate::msg::topic::Named;
use crate::msg::types;
use crate::node::compressed;
use crate::node::heard::{Order, Origin, Sample, Taken};
use crate::node::middleware::OpenError;
use crate::node::parameters::Parameters;
use crate::node::readers::{clock_event, tell_camera, tell_scan};
use crate::node::seeds::{CameraTopic, Publishers, Scans, Told, WithCamera, WithFilter};
use crate::node::transport::{DepthTopics, Event, Form, Input, SensorTopics, Service};

/// What was heard, for readers that come after: a publisher's numbers go on when the network is joined anew.
#[derive(Clone, Default)]
pub(super) struct Memory {
    /// By sensor.
    scans: Rc<RefCell<BTreeMap<usize, Scans>>>,
    transforms: Rc<RefCell<Taken>>,
    pub(super) latched: Rc<RefCell<Taken>>,
    pub(super) namesakes: Rc<Namesakes>,
    joined: Rc<Cell<u32>>,
}

impl Memory {
    /// Counts the networks that are joined.
    pub(super) fn next_number(&self) -> u32 {
        self.joined.update(|number| number + 1);
        self.joined.get()
    }

    /// Notes the form that scans of a sensor are made of.
    pub(super) fn choose(&self, Input { sensor, form }: Input) {
        self.scans.borrow_mut().entry(sensor).or_default().chosen.set(Some(form));
    }
}

/// Starts the tasks that read topics.
pub(super) fn listen(
    opener: &mut Opener<'_>,
    sources: &Sources,
    memory: &Memory,
    parameters: &Rc<Parameters>,
    events: &Events,
) -> Result<Readers, OpenError> {
    let mut readers = Readers::new();
    for (number, sensor) in opener.setup.sensor_topics()?.into_iter().enumerate() {
        let heard = memory.scans.borrow_mut().entry(number).or_default().anew();
        let readers = &mut readers;
        Listening { opener, sources, readers, parameters, events, number, heard }.to(sensor)?;
    }
    // The reliable reader takes nothing of a publisher before its heartbeat, up to 3 s; the other one at once.
    let at_once = (!has_keys(opener.security)).then(|| best_effort(TF.qos.depth));
    let repaired = (&reliable(TF.qos.depth, Durability::Volatile)).into();
    let TransformTopics { changing, lasting } = opener.setup.transform_topics()?;
    for qos in at_once.into_iter().chain([repaired]) {
        let dynamic = opener.subscribe(Named { name: &changing, ..TF.named() }, &qos)?;
        let taken = Rc::clone(&memory.transforms);
        let transforms = move |message, info: &MessageInfo| {
            let publisher = info.publisher_gid().to_bytes16();
            match taken.borrow_mut().note(publisher, info.sequence_number()) {
                Order::New => {
                    Some(Event::Transforms { message, is_static: false, publisher: Some(publisher) })
                }
                Order::Late => Some(Event::LateTransforms(message)),
                Order::Known => None,
            }
        };
        readers.spawn_local(read(TF.name, dynamic, events.clone(), transforms));
    }
    let taken = Rc::clone(&memory.latched);
    let transforms = move |message, info: &MessageInfo| latched::event(&taken, message, info);
    let latched = opener.subscribe(Named { name: &lasting, ..TF_STATIC.named() }, &latched_qos())?;
    readers.spawn_local(read(TF_STATIC.name, latched, events.clone(), transforms));
    if opener.setup.config().use_sim_time {
        let topic = opener.setup.resolve(CLOCK.name)?;
        let named = Named { name: &topic, ..CLOCK.named() };
        let times = opener.subscribe(named, &best_effort(CLOCK.qos.depth))?;
        let parameters = Rc::clone(parameters);
        let time = move |clock: Clock, _: &MessageInfo| Some(clock_event(clock, &parameters));
        readers.spawn_local(read(CLOCK.name, times, events.clone(), time));
    }
    parameters::serve(opener, &mut readers, parameters, events)?;
    let spinner = opener.node.borrow_mut().spinner().map_err(OpenError::opening("the graph"))?;
    readers.spawn_local(async {
        drop(spinner.spin().await);
        "the graph".into()
    });
    Ok(readers)
}

/// Of the readers of latched transforms.
pub(super) fn latched_qos() -> rustdds::QosPolicies {
    (&reliable(TF_STATIC.qos.depth, Durability::TransientLocal)).into()
}

/// Of readers to which nothing that was lost comes again.
fn best_effort(depth: usize) -> rustdds::QosPolicies {
    (&QosProfile::subscription_default().history(History::KeepLast { depth })).into()
}

/// Whether messages come by DDS Security. Then there is one reader a topic: with two of `/tf`, transforms did not always come.
pub(super) const fn has_keys(security: &Security) -> bool {
    matches!(security, Security::Keys(_))
}

/// Begins to read one sensor.
struct Listening<'a, 'b> {
    opener: &'a mut Opener<'b>,
    sources: &'a Sources,
    readers: &'a mut Readers,
    parameters: &'a Rc<Parameters>,
    events: &'a Events,
    number: usize,
    heard: Scans,
}

impl Listening<'_, '_> {
    fn to(&mut self, sensor: SensorTopics) -> Result<(), OpenError> {
        if let Some(points) = &sensor.points {
            self.clouds(points.resolved.clone())?;
        }
        if let Some(depth) = sensor.depth.clone() {
            self.images(&depth)?;
            self.compressed(sensor, depth.compressed)?;
        }
        Ok(())
    }

    fn clouds(&mut self, topic: String) -> Result<(), OpenError> {
        let qos = scan_qos(policy::Reliability::BestEffort);
        let clouds = self.opener.subscribe(Named { name: &topic, type_name: types::CLOUD }, &qos)?;
        let seed = WithFilter::new(self.parameters, CloudSeed::new);
        let known = Rc::clone(&self.heard.points);
        self.read(
            Reading { input: Form::Points.of(self.number), topic, known, reliably: false },
            clouds,
            seed,
        );
        Ok(())
    }

    /// What the camera of all images says of itself. One that said it once, before the node began, keeps it for readers that ask for
    /// it; drivers that say it again and again keep nothing, and fit no such reader.
    fn cameras(&mut self, name: &str) -> Result<(), OpenError> {
        let latched = (!has_keys(self.opener.security)).then(latched_qos);
        let taken = Rc::default();
        for qos in [scan_qos(policy::Reliability::BestEffort)].into_iter().chain(latched) {
            let infos = self.opener.subscribe(Named { name, type_name: types::CAMERA_INFO }, &qos)?;
            let (sensor, camera) = (self.number, self.heard.camera.clone());
            let topic = CameraTopic { sensor, name: name.to_owned(), camera };
            self.readers.spawn_local(read_cameras(topic, infos, Rc::clone(&taken), self.events.clone()));
        }
        Ok(())
    }

    /// Raw depth images, and the camera of all.
    fn images(&mut self, DepthTopics { image, camera_info, .. }: &DepthTopics) -> Result<(), OpenError> {
        let best_effort = policy::Reliability::BestEffort;
        let camera = self.heard.camera.clone();
        self.cameras(&camera_info.resolved)?;
        let repaired =
            policy::Reliability::Reliable { max_blocking_time: rustdds::Duration::from_millis(100) };
        let repaired = (!has_keys(self.opener.security)).then_some((repaired, true));
        for (reliability, reliably) in [(best_effort, false)].into_iter().chain(repaired) {
            let qos = scan_qos(reliability);
            let images =
                self.opener.subscribe(Named { name: &image.resolved, type_name: types::IMAGE }, &qos)?;
            let seed = WithCamera::new(&camera, self.parameters, DepthSeed::new);
            let (input, known) = (Form::Depth.of(self.number), Rc::clone(&self.heard.images));
            self.read(Reading { input, topic: image.resolved.clone(), known, reliably }, images, seed);
        }
        Ok(())
    }

    /// Compressed depth images, while they are wanted.
    fn compressed(&mut self, sensor: SensorTopics, name: String) -> Result<(), OpenError> {
        let qos = scan_qos(policy::Reliability::BestEffort);
        let named = Named { name: &name, type_name: types::COMPRESSED_IMAGE };
        let topic = self.opener.resolved_topic(named, &qos)?;
        self.opener.ends.reads(topic.name(), qos);
        let node = Rc::downgrade(&self.opener.node);
        let (sources, heard, events) = (self.sources.clone(), self.heard.clone(), self.events.clone());
        let seed = WithCamera::new(&heard.camera, self.parameters, CompressedSeed::new);
        let input = Form::CompressedDepth.of(self.number);
        self.readers.spawn_local(async move {
            let are_wanted = heard.reads_compressed();
            let read = async || {
                sources.answer().await;
                let images = node.upgrade().map(|node| node.borrow_mut().create_subscription(&topic, None));
                let images = compressed::opened(images).await;
                let known = Rc::clone(&heard.compressed);
                let reading = Reading { input, topic: name.clone(), known, reliably: false };
                read_scans(reading, images, seed.clone(), events.clone()).await
            };
            compressed::read_while_wanted(&sensor, &heard, are_wanted, || sources.list(), read).await
        });
        Ok(())
    }

    fn read<S>(&mut self, reading: Reading, subscription: Subscription<Decoded>, seed: S)
    where
        S: for<'de> DeserializeSeed<'de, Value = Decoded> + Clone + 'static,
    {
        self.readers.spawn_local(read_scans(reading, subscription, seed, self.events.clone()));
    }
}

/// Volatile, and few samples kept: a cloud is megabytes, and an old one is of no use.
fn scan_qos(reliability: policy::Reliability) -> rustdds::QosPolicies {
    QosPolicyBuilder::new()
        .reliability(reliability)
        .durability(policy::Durability::Volatile)
        .history(policy::History::KeepLast { depth: 2 })
        .resource_limits(ResourceLimits { max_samples: 2, max_instances: 1, max_samples_per_instance: 2 })
        .build()
}

/// A reader of scans.
struct Reading {
    input: Input,
    /// Fully qualified.
    topic: String,
    /// Shared with the topic's other readers.
    known: Publishers,
    /// Whether this one is reliable.
    reliably: bool,
}

/// Reads scans until the node ends; `seed` decodes.
async fn read_scans<S>(
    Reading { input, topic, known, reliably }: Reading,
    subscription: Subscription<Decoded>,
    seed: S,
    events: Events,
) -> Cow<'static, str>
where
    S: for<'de> DeserializeSeed<'de, Value = Decoded> + Clone,
{
    let scans = subscription.async_stream_seed(Told(seed));
    pin_mut!(scans);
    while let Some(sample) = scans.next().await {
        let takes = || known.borrow_mut().tell(sample.map(of_publisher), reliably);
        if !tell_scan(&events, input, takes).await {
            break;
        }
    }
    topic.into()
}

/// A scan with its publisher and number.
fn of_publisher((scan, info): (Decoded, MessageInfo)) -> Sample {
    let origin = Origin { publisher: info.publisher_gid().to_bytes16(), number: info.sequence_number() };
    Sample { scan, origin }
}

/// Reads what a camera says of itself until the node ends; `taken` is what this reader and the topic's other one have had.
async fn read_cameras(
    topic: CameraTopic,
    infos: Subscription<CameraInfo>,
    taken: Rc<RefCell<Taken>>,
    events: Events,
) -> Cow<'static, str> {
    let infos = infos.async_stream();
    pin_mut!(infos);
    while let Some(info) = infos.next().await {
        let info = match info {
            Ok((info, about)) => {
                let (publisher, number) = (about.publisher_gid().to_bytes16(), about.sequence_number());
                // What was overtaken by the other reader is not what the camera is now.
                if taken.borrow_mut().note(publisher, number) != Order::New {
                    continue;
                }
                Ok(info)
            }
            Err(error) => Err(error.to_string()),
        };
        if !tell_camera(&events, &topic, info).await {
            break;
        }
    }
    topic.name.into()
}

async fn read<M: DeserializeOwned + 'static>(
    topic: &'static str,
    subscription: Subscription<M>,
    events: Events,
    event: impl Fn(M, &MessageInfo) -> Option<Event<Caller>>,
) -> Cow<'static, str> {
    let messages = subscription.async_stream();
    pin_mut!(messages);
    while let Some(message) = messages.next().await {
        // A place first: another reader of the topic must not come between the decision and the sending.
        let Ok(place) = events.reserve().await else { break };
        let event = match message {
            Ok((message, info)) => event(message, &info),
            Err(error) => Some(Event::Garbled { topic: topic.into(), text: error.to_string() }),
        };
        if let Some(event) = event {
            place.send(event);
        }
    }
    topic.into()
}

/// Hands on the calls of a service that are heard on the network of this number.
pub(super) async fn serve(
    service: Service,
    triggers: Rc<Triggers>,
    network: u32,
    events: Events,
) -> Cow<'static, str> {
    // A place first: a call that was taken must not go with this task, which ends where the network is joined anew.
    while let Ok(place) = events.reserve().await {
        place.send(match triggers.server.async_receive_request().await {
            Ok((id, _)) => Event::Call(service, Caller { id, network }),
            Err(error) => Event::Garbled { topic: service.name().into(), text: error.to_string() },
        });
    }
    service.name().into()
}
