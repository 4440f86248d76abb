//! When compressed depth images are read: only where nothing else comes of a camera.
//!
//! `image_transport` offers images raw and compressed side by side, and where somebody reads the compressed ones it packs a PNG
//! of every image, within the driver's own call. So they are read where no raw ones are offered, or where those do not come or have
//! not for a minute, and no longer than that: a Kinect may be plugged in long after its driver has started. A driver on Fast DDS packs on, for it ignores how
//! RustDDS 0.15.1 tells that a reader has gone (a key alone, longer than 16 bytes); the node unpacks nothing more.

use std::borrow::Cow;
use std::fmt::Display;
use std::future::pending;
use std::time::Duration;

use tracing::{info, warn};

use super::inputs::is_offered;
use super::seeds::Scans;
use super::transport::{Form, SensorTopics, Source};

/// Time between two looks at who publishes.
const LOOK: Duration = Duration::from_millis(500);
/// Time between two looks while the camera comes in another form, which lasts as a rule.
const REST: Duration = Duration::from_secs(2);
/// Looks in a row that find compressed images alone: the topics of a driver are found one after the other.
const ALONE: u32 = 2;
/// Looks in a row that find them while no raw one has come: a Kinect takes some seconds to start, and raw images may be too
/// large for the network.
const MUTE: u32 = 20;

/// Reads the compressed images of a camera for as long as they are wanted, again and again; `read` opens a reader of them and reads until
/// the node ends, and `are_wanted` says whether they are already: where the network is joined anew, and they were read before.
pub(super) async fn read_while_wanted(
    sensor: &SensorTopics,
    heard: &Scans,
    mut are_wanted: bool,
    sources: impl Fn() -> Vec<Source>,
    read: impl AsyncFn() -> Cow<'static, str>,
) -> Cow<'static, str> {
    loop {
        if !are_wanted {
            wanted(sensor, &sources, |form| heard.comes(form)).await;
            heard.compressed.borrow_mut().begin_after_pause();
        }
        tokio::select! {
            ended = read() => return ended,
            () = unwanted(sensor, &sources, || heard.in_use()) => {}
        }
        let topic = sensor.topic(Form::CompressedDepth).unwrap_or_default();
        info!("{topic} is read no more: scans are made of what comes in another form");
        are_wanted = false;
    }
}

/// Resolves when the compressed images of a camera are to be read. `comes` says whether it comes in a form, as
/// [`Known::comes`](super::heard::Known::comes) has it: while that is offered too they are not.
async fn wanted(sensor: &SensorTopics, sources: impl Fn() -> Vec<Source>, comes: impl Fn(Form) -> bool) {
    let mut looks = Looks::default();
    let mut rest = LOOK;
    loop {
        tokio::time::sleep(rest).await;
        let sources = sources();
        let is_offered = |form| is_offered(sensor, form, &sources);
        rest = if [Form::Points, Form::Depth].into_iter().any(|form| comes(form) && is_offered(form)) {
            looks = Looks::default();
            REST
        } else if looks.are_enough([Form::Depth, Form::CompressedDepth].map(is_offered)) {
            return;
        } else {
            LOOK
        };
    }
}

/// Resolves when compressed images that are read are of no use: scans are made of what comes in another form, and that is offered.
/// `in_use` says which form it is.
async fn unwanted(
    sensor: &SensorTopics,
    sources: impl Fn() -> Vec<Source>,
    in_use: impl Fn() -> Option<Form>,
) {
    loop {
        tokio::time::sleep(REST).await;
        let other = in_use().filter(|form| *form != Form::CompressedDepth);
        if other.is_some_and(|form| is_offered(sensor, form, &sources())) {
            return;
        }
    }
}

/// The reader that was opened. Never resolves where there is none, as the network was left meanwhile, or where it could not be
/// opened, which it says: the node goes on without.
pub(super) async fn opened<T>(reader: Option<Result<T, impl Display>>) -> T {
    match reader {
        Some(Ok(reader)) => return reader,
        Some(Err(error)) => warn!("compressed depth images are not read: {error}"),
        None => {}
    }
    pending().await
}

/// What was found in a row.
#[derive(Debug, Default)]
struct Looks {
    alone: u32,
    in_all: u32,
}

impl Looks {
    /// Counts a look at what is offered.
    const fn are_enough(&mut self, [raw, compressed]: [bool; 2]) -> bool {
        self.in_all = if compressed { self.in_all + 1 } else { 0 };
        self.alone = if compressed && !raw { self.alone + 1 } else { 0 };
        self.alone >= ALONE || self.in_all >= MUTE
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::super::transport::{DepthTopics, TopicName};
    use super::*;
    use crate::msg::types::COMPRESSED_DEPTH;

    fn sensor() -> SensorTopics {
        let topic = |name: &str| TopicName { plain: name.to_owned(), resolved: name.to_owned() };
        SensorTopics {
            name: "points".to_owned(),
            points: Some(topic("/points")),
            depth: Some(DepthTopics {
                image: topic("/depth"),
                camera_info: topic("/info"),
                compressed: format!("/depth{COMPRESSED_DEPTH}"),
            }),
        }
    }

    /// A driver that has sent in this form and offered both offers the compressed images alone from the second look on.
    async fn wanted_after_looks(form: Form, topic: &str, kind: &str) -> u32 {
        let source = |topic: &str, kind: &str| Source {
            topic: topic.to_owned(),
            type_name: format!("sensor_msgs/msg/{kind}"),
        };
        let looks = Cell::new(0);
        let sources = || {
            looks.set(looks.get() + 1);
            let compressed = source(&format!("/depth{COMPRESSED_DEPTH}"), "CompressedImage");
            let other = (looks.get() < 2).then(|| source(topic, kind));
            other.into_iter().chain([compressed]).collect()
        };
        wanted(&sensor(), sources, |other| other == form).await;
        looks.get()
    }

    #[tokio::test]
    async fn where_the_form_that_came_is_offered_no_more_the_compressed_images_are_read_after_all() {
        let (raw, clouds) = tokio::join!(
            wanted_after_looks(Form::Depth, "/depth", "Image"),
            wanted_after_looks(Form::Points, "/points", "PointCloud2"),
        );
        assert_eq!((raw, clouds), (3, 3));
    }

    #[tokio::test]
    async fn compressed_images_that_are_read_are_given_up_for_the_raw_ones_that_scans_are_made_of_while_these_are_offered()
     {
        let source = |topic: &str, kind: &str| Source {
            topic: topic.to_owned(),
            type_name: format!("sensor_msgs/msg/{kind}"),
        };
        let compressed = source(&format!("/depth{COMPRESSED_DEPTH}"), "CompressedImage");
        let both = vec![source("/depth", "Image"), compressed.clone()];
        let table = [
            (Some(Form::Depth), both.clone(), true),
            (Some(Form::Depth), vec![compressed], false),
            (Some(Form::CompressedDepth), both.clone(), false),
            (None, both, false),
        ];
        let sensor = sensor();
        let given_up = table.iter().map(|(chosen, sources, _)| {
            let unwanted = unwanted(&sensor, || sources.clone(), || *chosen);
            tokio::time::timeout(3 * REST, unwanted)
        });
        let given_up = futures::future::join_all(given_up).await;
        for ((chosen, sources, are_given_up), given_up) in table.iter().zip(given_up) {
            assert_eq!(given_up.is_ok(), *are_given_up, "{chosen:?} of {sources:?}");
        }
    }

    /// After which of these looks it is enough.
    fn enough_after(looks: impl IntoIterator<Item = [bool; 2]>) -> Option<usize> {
        let mut so_far = Looks::default();
        looks.into_iter().position(|offered| so_far.are_enough(offered))
    }

    #[test]
    fn compressed_images_that_are_offered_alone_are_read_after_a_second() {
        assert_eq!(enough_after([[false, false], [false, true], [false, true]]), Some(2));
        // The raw ones were found a moment later.
        assert_eq!(enough_after([[false, true], [true, true], [false, true], [true, true]]), None);
        assert_eq!(enough_after([[true, false]; 100]), None);
    }

    #[test]
    fn where_raw_ones_are_offered_and_do_not_come_they_are_read_after_ten_seconds() {
        assert_eq!(enough_after([[true, true]; 100]), Some(19));
        assert_eq!(enough_after([vec![[true, true]; 19], vec![[true, false]; 50]].concat()), None);
    }
}
