//! What to say about inputs, always with the exact words that choose another one.

use std::time::Duration;

use super::transport::{DepthTopics, Form, SensorTopics, Source, TopicName};
use crate::bag::{Elsewhere, TransformTopics};
use crate::cloud::CloudError;
use crate::msg::form::{folder, is_of_depth};
use crate::msg::types::{CAMERA_INFO, COMPRESSED_DEPTH, TRANSFORMS};

/// Topics of one type that are named at most: somebody may publish thousands.
const NAMED: usize = 20;

/// The topics that a sensor is read from, for a person.
pub(super) fn reads(sensor: &SensorTopics) -> String {
    let depth = sensor.depth.as_ref().map(|depth| {
        let DepthTopics { image, camera_info, compressed } = depth;
        format!("{} or {compressed} with {}", image.resolved, camera_info.resolved)
    });
    let points = sensor.points.as_ref().map(|points| points.resolved.clone());
    points.into_iter().chain(depth).collect::<Vec<_>>().join(", or ")
}

/// Why scans of `other` are skipped, and how to have them instead of those of `chosen`.
pub(super) fn how_to_choose(sensor: &SensorTopics, chosen: Form, other: Form) -> String {
    let plain = |topic: Option<&TopicName>| topic.map(|topic| topic.plain.clone()).unwrap_or_default();
    let points = plain(sensor.points.as_ref());
    let image = plain(sensor.depth.as_ref().map(|depth| &depth.image));
    let compressed = sensor.topic(Form::CompressedDepth).unwrap_or_default();
    let words = match (chosen, other) {
        (Form::Points, _) => format!("-r {points}:=/unused"),
        (Form::CompressedDepth, Form::Depth) => format!("-r {compressed}:=/unused"),
        (Form::Depth, Form::CompressedDepth) => {
            format!("-r {image}:=/unused -r /unused{COMPRESSED_DEPTH}:={compressed}")
        }
        (Form::Depth | Form::CompressedDepth, _) => format!("-r {image}:=/unused"),
    };
    let (chosen, other) = (sensor.topic(chosen).unwrap_or_default(), sensor.topic(other).unwrap_or_default());
    format!(
        "{other} is skipped, for {chosen} was first and one sensor must not fill the map twice (to take {other} \
         instead: {words})"
    )
}

/// Whether somebody publishes what a sensor is read from in this form.
pub(super) fn is_offered(sensor: &SensorTopics, form: Form, sources: &[Source]) -> bool {
    let publishes = |topic: &str| {
        sources.iter().any(|source| source.topic == topic && source.type_name == form.type_name())
    };
    sensor.topic(form).is_some_and(publishes)
}

/// The sources that none but this sensor is read from: two must not be read from one.
pub(super) fn free(sensor: usize, all: &[SensorTopics], sources: &[Source]) -> Vec<Source> {
    let others = || all.iter().enumerate().filter(|(other, _)| *other != sensor);
    let reads =
        |other: &SensorTopics, topic: &str| Form::ALL.iter().any(|form| other.topic(*form) == Some(topic));
    let is_free = |source: &&Source| !others().any(|(_, other)| reads(other, &source.topic));
    sources.iter().filter(is_free).cloned().collect()
}

/// Why no scan of a sensor has come for `quiet`, as far as it can be known; after `chosen` only that form counts. `silences` is what the
/// middleware may do to scans none of which has ever come; `None` where some have.
pub(super) fn why_quiet(
    sensor: &SensorTopics,
    chosen: Option<Form>,
    sources: &[Source],
    (quiet, silences): (Duration, Option<&str>),
) -> String {
    let is_wanted = |form: &Form| chosen.is_none_or(|chosen| chosen == *form);
    let wanted: Vec<_> = Form::ALL
        .into_iter()
        .filter(is_wanted)
        .filter_map(|form| Some((form, sensor.topic(form)?)))
        .collect();
    let carries = |source: &Source, form: Form| source.type_name == form.type_name();
    let on = |form, topic: &str| sources.iter().find(|source| source.topic == topic && carries(source, form));
    if let Some((form, silent)) = wanted.iter().find(|(form, topic)| on(*form, topic).is_some()) {
        let (scan, quiet) = (scan_of(*form), quiet.as_secs());
        // What has come before neither is too large nor goes another way.
        return match silences {
            None => format!(
                "{silent} has a publisher, but no {scan} has come for {quiet} s, and some came before: it has gone silent, or is no \
                 longer heard"
            ),
            Some(silences) => format!(
                "{silent} has a publisher, but no {scan} has come for {quiet} s: either it is silent, {silences}"
            ),
        };
    }
    let other = |topic: &str| sources.iter().find(|source| source.topic == topic);
    if let Some((form, source)) = wanted.iter().find_map(|(form, topic)| Some((form, other(topic)?))) {
        let Source { topic, type_name } = source;
        return format!(
            "{topic} carries {type_name}, not {}; {}",
            form.type_name(),
            choices(sensor, sources)
        );
    }
    let topics: Vec<_> = wanted.into_iter().map(|(_, topic)| topic).collect();
    format!("nobody publishes on {}; {}", topics.join(" or "), choices(sensor, sources))
}

/// What a message of this form is to its user.
const fn scan_of(form: Form) -> &'static str {
    match form {
        Form::Points => "cloud",
        Form::Depth | Form::CompressedDepth => "depth image",
    }
}

/// What a sensor could be read from instead.
fn choices(sensor: &SensorTopics, sources: &[Source]) -> String {
    let topics = |form: Form| {
        let of_form = sources.iter().filter(move |source| source.type_name == form.type_name());
        of_form.map(|source| source.topic.as_str())
    };
    let clouds = topics(Form::Points).filter(|topic| Form::Points.is_of_sensor(topic)).take(NAMED);
    let as_points =
        |points: &TopicName| clouds.map(|topic| format!("-r {}:={topic}", points.plain)).collect();
    let clouds: Vec<_> = sensor.points.as_ref().map(as_points).unwrap_or_default();
    let raw = topics(Form::Depth).take(NAMED);
    // `image_transport` offers images of colours so too, and sends none: the plain name says whether they are of depth. In a bag
    // such a topic has no message.
    let compressed = topics(Form::CompressedDepth).take(NAMED);
    let compressed = compressed.filter_map(|topic| topic.strip_suffix(COMPRESSED_DEPTH));
    let images = raw.chain(compressed);
    let (mut depth, other): (Vec<_>, Vec<_>) = images.partition(|topic| Form::Depth.is_of_sensor(topic));
    depth.sort_unstable();
    depth.dedup();
    let as_depth = |names: &DepthTopics| depth.iter().map(|image| image_words(names, image)).collect();
    let images: Vec<_> = sensor.depth.as_ref().map(as_depth).unwrap_or_default();
    let mut parts = Vec::new();
    if clouds.is_empty() && images.is_empty() {
        let of_use = match (&sensor.points, &sensor.depth) {
            (Some(_), None) => "no PointCloud2",
            (None, Some(_)) => "no depth image",
            _ => "no PointCloud2 and no depth image",
        };
        parts.push(format!("there is {of_use} on the network"));
    }
    if !clouds.is_empty() {
        parts.push(format!("PointCloud2 topics: use {}", clouds.join(" or ")));
    }
    if !images.is_empty() {
        parts.push(format!("depth images: use {}", images.join(" or ")));
    }
    if !other.is_empty() {
        parts.push(format!("other Image topics: {}", other.join(", ")));
    }
    parts.join("; ")
}

/// Why scans of a sensor cannot be used, and where its camera infos may be if that is what they lack.
pub(super) fn why_unusable(
    error: &CloudError,
    (sensor, all): (usize, &[SensorTopics]),
    sources: impl FnOnce() -> Vec<Source>,
) -> String {
    match &all[sensor].depth {
        Some(depth) if *error == CloudError::NoCameraInfo => {
            let is_read = |topic: &str| {
                let mut cameras = all.iter().filter_map(|sensor| sensor.depth.as_ref());
                cameras.any(|camera| camera.camera_info.resolved == topic)
            };
            format!("{error}; {}", camera_infos(depth, &sources(), is_read))
        }
        _ => error.to_string(),
    }
}

/// Why no transform has come at all, as far as it can be known, and where there are others.
pub(super) fn why_no_transforms(read: &TransformTopics, sources: &[Source]) -> String {
    let transforms = sources.iter().filter(|source| source.type_name == TRANSFORMS);
    let topics = transforms.map(|source| source.topic.as_str());
    let (silent, others): (Vec<_>, Vec<_>) = topics.partition(|topic| read.has(topic));
    let TransformTopics { changing, lasting } = read;
    let why = match silent.first() {
        Some(silent) => format!("{silent} has a publisher, and nothing has come of it"),
        None => format!("nobody publishes on {changing} and {lasting}"),
    };
    let mut pairs = TransformTopics::pairs(others);
    pairs.truncate(NAMED);
    if pairs.is_empty() {
        return why;
    }
    format!("{why}; transforms are on others: use {}", Elsewhere::remappings(&pairs))
}

/// Where camera infos are waited for, and which of these there are.
fn camera_infos(
    DepthTopics { image, camera_info, .. }: &DepthTopics,
    sources: &[Source],
    is_read: impl Fn(&str) -> bool,
) -> String {
    let TopicName { plain, resolved } = camera_info;
    let infos = sources.iter().filter(|source| source.type_name == CAMERA_INFO);
    let mut topics: Vec<_> = infos.map(|source| source.topic.as_str()).collect();
    if topics.contains(&resolved.as_str()) {
        return format!("{resolved} has a publisher, and nothing has come of it");
    }
    // The one beside the image first, then those of other depth cameras; last those that sensors are read with, which may be
    // shared: raw and registered images have one camera.
    topics
        .sort_by_key(|topic| (folder(topic) != folder(&image.resolved), is_read(topic), !is_of_depth(topic)));
    let words: Vec<_> = topics.into_iter().take(NAMED).map(|topic| format!("-r {plain}:={topic}")).collect();
    let choice = if words.is_empty() {
        "there is none on the network".to_owned()
    } else {
        format!("use {}", words.join(" or "))
    };
    format!("nobody publishes a CameraInfo on {resolved}: {choice}")
}

/// A camera's info stands beside its image.
fn image_words(names: &DepthTopics, image: &str) -> String {
    let [info, _] = Form::Depth.camera_infos_beside(image);
    let DepthTopics { image: as_image, camera_info, .. } = names;
    format!("-r {}:={image} -r {}:={info}", as_image.plain, camera_info.plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUIET: Duration = Duration::from_secs(3);

    fn source(topic: &str, kind: &str) -> Source {
        Source { topic: topic.to_owned(), type_name: format!("sensor_msgs/msg/{kind}") }
    }

    /// A sensor that clouds or depth images come from, whichever are first.
    fn sensor(points: &str, image: &str) -> SensorTopics {
        let topic = |plain: &str, resolved: &str| TopicName {
            plain: plain.to_owned(),
            resolved: resolved.to_owned(),
        };
        SensorTopics {
            name: "points".to_owned(),
            points: Some(topic("points", points)),
            depth: Some(DepthTopics {
                image: topic("depth/image", image),
                camera_info: topic("depth/camera_info", "/info"),
                compressed: format!("{image}{COMPRESSED_DEPTH}"),
            }),
        }
    }

    #[test]
    fn where_no_transform_comes_the_topics_that_have_some_are_named_as_they_are_had() {
        let usual = TransformTopics::default();
        let why = |read, topics: &[&str]| {
            let transforms = topics
                .iter()
                .map(|topic| Source { topic: (*topic).to_owned(), type_name: TRANSFORMS.to_owned() });
            why_no_transforms(read, &transforms.chain([source("/tf", "Image")]).collect::<Vec<_>>())
        };
        let nobody = "nobody publishes on /tf and /tf_static";
        assert_eq!(why(&usual, &[]), nobody);
        let robot = "-r /tf:=/robot1/tf -r /tf_static:=/robot1/tf_static";
        let others = "transforms are on others: use";
        assert_eq!(why(&usual, &["/robot1/tf", "/robot1/tf_static"]), format!("{nobody}; {others} {robot}"));
        let mine = TransformTopics { changing: "/mine/tf".to_owned(), lasting: "/mine/tf_static".to_owned() };
        let both = format!("{robot}, or -r /tf:=/tf -r /tf_static:=/tf_static");
        assert_eq!(
            why(&mine, &["/tf", "/robot1/tf"]),
            format!("nobody publishes on /mine/tf and /mine/tf_static; {others} {both}")
        );
        let silent = "/tf_static has a publisher, and nothing has come of it";
        assert_eq!(why(&usual, &["/tf_static"]), silent);
        assert_eq!(why(&usual, &["/tf_static", "/robot1/tf"]), format!("{silent}; {others} {robot}"));
        let many: Vec<_> = (0..1000).map(|i| format!("/r{i}/tf")).collect();
        let many: Vec<_> = many.iter().map(String::as_str).collect();
        assert_eq!(why(&usual, &many).matches("-r /tf:=").count(), NAMED);
    }

    #[test]
    fn the_list_of_topics_has_the_exact_remapping() {
        let sources = [
            source("/a/points", "PointCloud2"),
            source("/b", "Image"),
            source("/other/cfodi/points_labelled", "PointCloud2"),
            source("/c", "CameraInfo"),
            source("/cam/depth/image_raw", "Image"),
            source("/cam/depth/image_raw/compressedDepth", "CompressedImage"),
            source("/other/Depth/compressedDepth", "CompressedImage"),
            source("/rgb/image/compressed", "CompressedImage"),
        ];
        let both = sensor("/x", "/y");
        assert_eq!(
            choices(&both, &sources),
            "PointCloud2 topics: use -r points:=/a/points; depth images: use -r depth/image:=/cam/depth/image_raw \
             -r depth/camera_info:=/cam/depth/camera_info or -r depth/image:=/other/Depth \
             -r depth/camera_info:=/other/camera_info; other Image topics: /b"
        );
        assert!(choices(&both, &[]).contains("no PointCloud2 and no depth image"));
        let clouds = SensorTopics { depth: None, ..both.clone() };
        assert_eq!(
            choices(&clouds, &sources[..3]),
            "PointCloud2 topics: use -r points:=/a/points; other Image topics: /b"
        );
        assert_eq!(
            choices(&SensorTopics { points: None, ..both }, &sources[..1]),
            "there is no depth image on the network"
        );
    }

    #[test]
    fn silence_is_explained_for_each_form_and_after_the_choice_for_the_chosen_one() {
        let sources = [source("/a/points", "PointCloud2"), source("/b", "Image")];
        let why = |points, image, chosen| {
            why_quiet(&sensor(points, image), chosen, &sources, (QUIET, Some("or deaf")))
        };
        assert!(why("/x", "/y", None).contains("nobody publishes on /x or /y or /y/compressedDepth; "));
        assert!(
            why("/b", "/y", None)
                .contains("/b carries sensor_msgs/msg/Image, not sensor_msgs/msg/PointCloud2")
        );
        assert!(
            why("/a/points", "/y", None).contains("/a/points has a publisher, but no cloud has come for 3 s")
        );
        assert!(why("/x", "/b", None).contains("/b has a publisher, but no depth image has come for 3 s"));
        assert!(why("/a/points", "/y", None).ends_with("either it is silent, or deaf"));
        let came_before = why_quiet(&sensor("/a/points", "/y"), None, &sources, (QUIET, None));
        assert!(came_before.contains("no cloud has come for 3 s, and some came before"), "{came_before}");
        assert!(!came_before.contains("deaf"), "{came_before}");
        assert!(why("/a/points", "/y", Some(Form::Depth)).contains("nobody publishes on /y; "));
    }

    #[test]
    fn where_camera_infos_are_is_said_of_images_that_lack_one_and_of_nothing_else() {
        let sensors = ["/cam/depth/image", "/y"].map(|image| sensor("/x", image));
        let mut other = sensors[1].clone();
        other.depth.as_mut().unwrap().camera_info.resolved = "/other/depth/camera_info".to_owned();
        let all = [sensors[0].clone(), other];
        let why = |infos: &[&str]| {
            let mut sources: Vec<_> = infos.iter().map(|topic| source(topic, "CameraInfo")).collect();
            sources.push(source("/cam/depth/image", "Image"));
            why_unusable(&CloudError::NoCameraInfo, (0, &all), || sources)
        };
        let start =
            "a depth image, and no camera_info has come yet; nobody publishes a CameraInfo on /info: ";
        assert_eq!(why(&[]), format!("{start}there is none on the network"));
        // Another sensor is read with the second, as one that sends registered images may be.
        let topics = [
            "/cam/colour/info",
            "/other/depth/camera_info",
            "/cam/depth/camera_info",
            "/third/depth/camera_info",
        ];
        assert_eq!(
            why(&topics),
            format!(
                "{start}use -r depth/camera_info:=/cam/depth/camera_info or \
                 -r depth/camera_info:=/third/depth/camera_info or -r depth/camera_info:=/cam/colour/info or \
                 -r depth/camera_info:=/other/depth/camera_info"
            )
        );
        assert_eq!(why(&topics[1..2]), format!("{start}use -r depth/camera_info:=/other/depth/camera_info"));
        assert_eq!(
            why(&["/a/camera_info", "/info"]),
            "a depth image, and no camera_info has come yet; /info has a publisher, and nothing has come of it"
        );
        let many: Vec<_> = (0..1000).map(|number| format!("/camera{number}/info")).collect();
        let many: Vec<_> = many.iter().map(String::as_str).collect();
        assert_eq!(why(&many).matches("-r ").count(), NAMED);
        let asked = || unreachable!("who publishes is of no use");
        assert_eq!(why_unusable(&CloudError::EmptyFrameId, (0, &all), asked), "header frame_id is empty");
    }

    #[test]
    fn what_another_sensor_is_read_from_is_not_offered() {
        let sensors = [sensor("/a/points", "/a/depth"), sensor("/x", "/y")];
        let sources = [source("/a/points", "PointCloud2"), source("/c/points", "PointCloud2")];
        let offered = |sensor: usize| {
            let free = free(sensor, &sensors, &sources);
            free.into_iter().map(|source| source.topic).collect::<Vec<_>>()
        };
        assert_eq!(
            (offered(0), offered(1)),
            (vec!["/a/points".into(), "/c/points".into()], vec!["/c/points".into()])
        );
    }

    #[test]
    fn another_form_is_offered_in_exact_words() {
        let sensor = sensor("/p", "/d");
        let words = |chosen, other| how_to_choose(&sensor, chosen, other);
        let lines = [
            (Form::Points, Form::Depth, "(to take /d instead: -r points:=/unused)"),
            (Form::Depth, Form::Points, "(to take /p instead: -r depth/image:=/unused)"),
            (Form::CompressedDepth, Form::Points, "(to take /p instead: -r depth/image:=/unused)"),
            (Form::CompressedDepth, Form::Depth, "(to take /d instead: -r /d/compressedDepth:=/unused)"),
            (
                Form::Depth,
                Form::CompressedDepth,
                "(to take /d/compressedDepth instead: -r depth/image:=/unused -r \
                 /unused/compressedDepth:=/d/compressedDepth)",
            ),
        ];
        for (chosen, other, expected) in lines {
            assert!(words(chosen, other).ends_with(expected), "{}", words(chosen, other));
        }
    }

    #[test]
    fn what_a_sensor_is_read_from_is_said() {
        let both = sensor("/p", "/d");
        assert_eq!(reads(&both), "/p, or /d or /d/compressedDepth with /info");
        assert_eq!(reads(&SensorTopics { depth: None, ..both }), "/p");
    }
}
