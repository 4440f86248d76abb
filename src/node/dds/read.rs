//! The tasks that read topics: each hands events to one bounded channel.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use futures::{StreamExt, pin_mut};
use ros2_client::qos::Durability;
use ros2_client::{Gid, ParameterValue, QosProfile, RmwRequestId, Server, Subscription};
use rustdds::QosPolicyBuilder;
use rustdds::policy::{self, ResourceLimits};
use serde::de::{DeserializeOwned, DeserializeSeed, Deserializer};

use super::heard::Heard;
use super::{DdsError, Events, Opener, Readers, opening, reliable};
use crate::cloud::{Camera, Cloud, CloudError, CloudFilter, CloudSeed, CompressedSeed, DepthSeed};
use crate::msg::ros::{CameraInfo, Clock, TriggerRequest, TriggerResponse};
use crate::node::args::{ArgsError, Setup};
use crate::node::inputs::COMPRESSED_DEPTH;
use crate::node::transport::{Event, Input, Inputs, Service};

/// What a seed makes of a message.
type Decoded = Result<Cloud, CloudError>;

/// Starts the tasks that read topics.
pub(super) fn listen(opener: &mut Opener<'_>, events: &Events) -> Result<Readers, DdsError> {
    let mut readers = Readers::new();
    let tf = |durability| (&reliable(100, durability)).into();
    listen_to_scans(opener, &mut readers, events)?;
    let dynamic = opener.subscribe(("/tf", "tf2_msgs", "TFMessage"), &tf(Durability::Volatile))?;
    let transforms = |is_static| move |message| Event::Transforms { message, is_static };
    readers.spawn_local(read("/tf", dynamic, events.clone(), transforms(false)));
    let latched =
        opener.subscribe(("/tf_static", "tf2_msgs", "TFMessage"), &tf(Durability::TransientLocal))?;
    readers.spawn_local(read("/tf_static", latched, events.clone(), transforms(true)));
    if opener.setup.config.use_sim_time {
        let qos = (&QosProfile::subscription_default()).into();
        let clock = opener.subscribe(("/clock", "rosgraph_msgs", "Clock"), &qos)?;
        let time = |clock: Clock| match clock.clock.stamp() {
            Some(stamp) => Event::Clock(stamp),
            None => {
                Event::Garbled { topic: "/clock", text: format!("{} ns in a second", clock.clock.nanosec) }
            }
        };
        readers.spawn_local(read("/clock", clock, events.clone(), time));
    }
    let use_sim_time = ParameterValue::Boolean(opener.setup.config.use_sim_time);
    opener.node.set_parameter("use_sim_time", use_sim_time).map_err(opening("use_sim_time"))?;
    let spinner = opener.node.spinner().map_err(opening("the parameter services"))?;
    readers.spawn_local(async {
        drop(spinner.spin().await);
        "the parameter services"
    });
    Ok(readers)
}

/// Clouds, and depth images with their camera.
fn listen_to_scans(opener: &mut Opener<'_>, readers: &mut Readers, events: &Events) -> Result<(), DdsError> {
    let best_effort = policy::Reliability::BestEffort;
    let (qos, filter) = (scan_qos(best_effort), opener.setup.config.filter);
    let points = opener.subscribe(("points", "sensor_msgs", "PointCloud2"), &qos)?;
    let seed = CloudSeed::new(filter);
    readers.spawn_local(read_scans((Input::Points, "points"), points, seed, alone(), events.clone()));
    let camera = LatestCamera::new(RefCell::new(Err(CloudError::NoCameraInfo)));
    let infos = opener.subscribe(("depth/camera_info", "sensor_msgs", "CameraInfo"), &qos)?;
    readers.spawn_local(read_cameras(infos, Rc::clone(&camera), events.clone()));
    let heard = Rc::new(RefCell::new(Heard::default()));
    let repaired = policy::Reliability::Reliable { max_blocking_time: rustdds::Duration::from_millis(100) };
    for (reliability, reliably) in [(best_effort, false), (repaired, true)] {
        let qos = scan_qos(reliability);
        let images = opener.subscribe(("depth/image", "sensor_msgs", "Image"), &qos)?;
        let seed = WithCamera { camera: Rc::clone(&camera), filter, seed: DepthSeed::new };
        let heard = (Rc::clone(&heard), reliably);
        readers.spawn_local(read_scans((Input::Depth, "depth/image"), images, seed, heard, events.clone()));
    }
    let name = compressed_name(opener.setup)?;
    let images = opener.subscribe((&name, "sensor_msgs", "CompressedImage"), &qos)?;
    let seed = WithCamera { camera, filter, seed: CompressedSeed::new };
    let which = (Input::CompressedDepth, "compressedDepth");
    readers.spawn_local(read_scans(which, images, seed, alone(), events.clone()));
    Ok(())
}

/// A reader that shares its topic with no other.
fn alone() -> (Rc<RefCell<Heard>>, bool) {
    (Rc::default(), false)
}

/// The topics that [`listen`] reads scans from.
pub(super) fn inputs(setup: &Setup) -> Result<Inputs, ArgsError> {
    Ok(Inputs {
        points: setup.resolve("points")?,
        image: setup.resolve("depth/image")?,
        camera_info: setup.resolve("depth/camera_info")?,
        compressed: setup.resolve(&compressed_name(setup)?)?,
    })
}

/// `image_transport` puts it below the image, whatever that is remapped to; it can be remapped again.
fn compressed_name(setup: &Setup) -> Result<String, ArgsError> {
    Ok(setup.resolve("depth/image")? + COMPRESSED_DEPTH)
}

/// The camera of the newest `CameraInfo`, or why there is none.
type LatestCamera = Rc<RefCell<Result<Camera, CloudError>>>;

/// A seed made for the camera that is known when an image comes.
#[derive(Clone)]
struct WithCamera<S> {
    camera: LatestCamera,
    filter: CloudFilter,
    seed: fn(Camera, CloudFilter) -> S,
}

impl<'de, S: DeserializeSeed<'de, Value = Decoded>> DeserializeSeed<'de> for WithCamera<S> {
    type Value = Decoded;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Decoded, D::Error> {
        let camera = self.camera.borrow().clone();
        match camera {
            Ok(camera) => (self.seed)(camera, self.filter).deserialize(deserializer),
            Err(error) => Ok(Err(error)),
        }
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

/// What a publisher's sequence numbers tell about clouds that never arrived.
#[derive(Default)]
struct Gaps {
    newest: BTreeMap<Gid, i64>,
    /// Samples that arrived since the last good one and could not be decoded: their numbers look like a gap.
    undecodable: u64,
}

impl Gaps {
    /// Publishers to remember; a driver that restarts is a new one each time.
    const PUBLISHERS: usize = 1000;

    fn lost_before(&mut self, publisher: Gid, number: i64) -> u64 {
        if self.newest.len() >= Self::PUBLISHERS {
            self.newest.clear();
        }
        let newest = self.newest.entry(publisher).or_insert(number);
        let gap = number.saturating_sub(*newest).saturating_sub(1).max(0);
        *newest = number.max(*newest);
        gap.unsigned_abs().saturating_sub(std::mem::take(&mut self.undecodable))
    }
}

/// Reads scans until the node ends; `name` is the topic's, `seed` decodes; `heard` is shared with the topic's other reader,
/// with whether this one is reliable.
async fn read_scans<S>(
    (input, name): (Input, &'static str),
    subscription: Subscription<Decoded>,
    seed: S,
    (heard, reliably): (Rc<RefCell<Heard>>, bool),
    events: Events,
) -> &'static str
where
    S: for<'de> DeserializeSeed<'de, Value = Decoded> + Clone,
{
    let scans = subscription.async_stream_seed(seed);
    pin_mut!(scans);
    let mut gaps = Gaps::default();
    while let Some(sample) = scans.next().await {
        let (scan, lost) = match sample {
            Ok((scan, info)) => {
                let (publisher, number) = (info.publisher_gid(), info.sequence_number());
                if !heard.borrow_mut().takes(publisher, number, reliably) {
                    continue;
                }
                (scan, gaps.lost_before(publisher, number))
            }
            Err(_) if !heard.borrow_mut().tells_garbled(reliably) => continue,
            Err(error) => {
                gaps.undecodable += 1;
                (Err(CloudError::Undecodable(error.to_string())), 0)
            }
        };
        if lost > 0 && events.send(Event::Lost(input, lost)).await.is_err() {
            break;
        }
        if events.send(Event::Cloud(input, scan)).await.is_err() {
            break;
        }
    }
    name
}

/// Keeps the newest camera for the seeds; tells the node of one that differs from the one before.
async fn read_cameras(infos: Subscription<CameraInfo>, camera: LatestCamera, events: Events) -> &'static str {
    let name = "depth/camera_info";
    let infos = infos.async_stream();
    pin_mut!(infos);
    while let Some(info) = infos.next().await {
        let event = match info.map(|(info, _)| Camera::from_info(&info)) {
            Ok(newest) if *camera.borrow() == newest => continue,
            Ok(newest) => {
                camera.borrow_mut().clone_from(&newest);
                Event::Camera(newest)
            }
            Err(error) => Event::Garbled { topic: name, text: error.to_string() },
        };
        if events.send(event).await.is_err() {
            break;
        }
    }
    name
}

async fn read<M: DeserializeOwned + 'static>(
    topic: &'static str,
    subscription: Subscription<M>,
    events: Events,
    event: impl Fn(M) -> Event<RmwRequestId>,
) -> &'static str {
    let messages = subscription.async_stream();
    pin_mut!(messages);
    while let Some(message) = messages.next().await {
        let event = match message {
            Ok((message, _)) => event(message),
            Err(error) => Event::Garbled { topic, text: error.to_string() },
        };
        if events.send(event).await.is_err() {
            break;
        }
    }
    topic
}

pub(super) async fn serve(
    service: Service,
    server: Rc<Server<TriggerRequest, TriggerResponse>>,
    events: Events,
) -> &'static str {
    loop {
        let event = match server.async_receive_request().await {
            Ok((request, _)) => Event::Call(service, request),
            Err(error) => Event::Garbled { topic: service.name(), text: error.to_string() },
        };
        if events.send(event).await.is_err() {
            return service.name();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Publishers of different names.
    fn publisher(number: u32) -> Gid {
        let mut name = [0; 16];
        name[..4].copy_from_slice(&number.to_le_bytes());
        cdr_encoding::from_bytes::<Gid, byteorder::LittleEndian>(&name).unwrap().0
    }

    #[test]
    fn made_up_numbers_and_ever_new_publishers_neither_overflow_nor_grow() {
        let mut gaps = Gaps::default();
        for number in [i64::MIN, i64::MAX, 0, -1, i64::MAX, i64::MIN] {
            assert!(i64::try_from(gaps.lost_before(publisher(0), number)).is_ok());
        }
        for number in 0..10_000 {
            assert_eq!(gaps.lost_before(publisher(number), i64::from(number)), 0);
            assert!(gaps.newest.len() <= Gaps::PUBLISHERS);
        }
    }

    #[test]
    fn a_gap_in_the_numbers_is_a_loss_unless_garbled_samples_explain_it() {
        let (mut gaps, publisher) = (Gaps::default(), Gid::default());
        assert_eq!(gaps.lost_before(publisher, 7), 0);
        assert_eq!(gaps.lost_before(publisher, 8), 0);
        assert_eq!(gaps.lost_before(publisher, 11), 2);
        gaps.undecodable = 1;
        assert_eq!(gaps.lost_before(publisher, 14), 1);
        assert_eq!(gaps.lost_before(publisher, 13), 0);
        assert_eq!(gaps.lost_before(publisher, 15), 0);
        gaps.undecodable = 1;
        assert_eq!(gaps.lost_before(publisher, 16), 0);
        assert_eq!(gaps.lost_before(publisher, 18), 1);
    }
}
