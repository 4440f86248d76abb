//! What to say about inputs, always with the exact words that choose another one.

use std::time::Duration;

use super::transport::{Input, Inputs, Source};

const CLOUD: &str = "sensor_msgs/msg/PointCloud2";
const IMAGE: &str = "sensor_msgs/msg/Image";
const COMPRESSED: &str = "sensor_msgs/msg/CompressedImage";

/// What `image_transport` appends to the name of an image.
pub(super) const COMPRESSED_DEPTH: &str = "/compressedDepth";

impl Input {
    const ALL: [Self; 3] = [Self::Points, Self::Depth, Self::CompressedDepth];

    const fn type_name(self) -> &'static str {
        match self {
            Self::Points => CLOUD,
            Self::Depth => IMAGE,
            Self::CompressedDepth => COMPRESSED,
        }
    }
}

/// Why scans of `other` are skipped, and how to have them instead of those of `chosen`.
pub(super) fn how_to_choose(inputs: &Inputs, chosen: Input, other: Input) -> String {
    let words = match (chosen, other) {
        (Input::Points, _) => "-r points:=/unused".to_owned(),
        (Input::CompressedDepth, Input::Depth) => format!("-r {}:=/unused", inputs.compressed),
        (Input::Depth, Input::CompressedDepth) => {
            format!("-r depth/image:=/unused -r /unused{COMPRESSED_DEPTH}:={}", inputs.compressed)
        }
        (Input::Depth | Input::CompressedDepth, _) => "-r depth/image:=/unused".to_owned(),
    };
    let (chosen, other) = (inputs.topic(chosen), inputs.topic(other));
    format!(
        "{other} is skipped, for {chosen} was first and one sensor must not fill the map twice (to take {other} \
         instead: {words})"
    )
}

/// Why no scan has come for `quiet`, as far as it can be known; after `chosen` only that input counts.
pub(super) fn why_quiet(
    inputs: &Inputs,
    chosen: Option<Input>,
    sources: &[Source],
    quiet: Duration,
) -> String {
    let wanted = || Input::ALL.into_iter().filter(|input| chosen.is_none_or(|chosen| chosen == *input));
    let on = |input: Input| sources.iter().filter(move |source| source.topic == inputs.topic(input));
    let is_right = |input: Input| on(input).any(|source| source.type_name == input.type_name());
    if let Some(silent) = wanted().find(|input| is_right(*input)) {
        return format!(
            "{} has a publisher, but no cloud has come for {} s: either it is silent, or its messages are too large \
             for the socket receive buffer (see above), or it sends by shared memory only",
            inputs.topic(silent),
            quiet.as_secs()
        );
    }
    if let Some((input, source)) = wanted().find_map(|input| Some((input, on(input).next()?))) {
        let Source { topic, type_name } = source;
        return format!("{topic} carries {type_name}, not {}; {}", input.type_name(), choices(sources));
    }
    let topics: Vec<_> = wanted().map(|input| inputs.topic(input)).collect();
    format!("nobody publishes on {}; {}", topics.join(" or "), choices(sources))
}

/// What could be listened to.
fn choices(sources: &[Source]) -> String {
    let of_type = |kind: &'static str| sources.iter().filter(move |source| source.type_name == kind);
    let topics = |kind| of_type(kind).map(|source| source.topic.as_str());
    let clouds: Vec<_> = topics(CLOUD).map(|topic| format!("-r points:={topic}")).collect();
    let raw = topics(IMAGE);
    let compressed = topics(COMPRESSED).filter_map(|topic| topic.strip_suffix(COMPRESSED_DEPTH));
    let (mut depth, other): (Vec<_>, Vec<_>) =
        raw.chain(compressed).partition(|topic| topic.to_lowercase().contains("depth"));
    depth.sort_unstable();
    depth.dedup();
    let images: Vec<_> = depth.iter().map(|image| image_words(image)).collect();
    let mut parts = Vec::new();
    if clouds.is_empty() && images.is_empty() {
        parts.push("there is no PointCloud2 and no depth image on the network".to_owned());
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

/// A camera's info stands beside its image.
fn image_words(image: &str) -> String {
    let folder = image.rsplit_once('/').map_or("", |(folder, _)| folder);
    format!("-r depth/image:={image} -r depth/camera_info:={folder}/camera_info")
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUIET: Duration = Duration::from_secs(3);

    fn source(topic: &str, kind: &str) -> Source {
        Source { topic: topic.to_owned(), type_name: format!("sensor_msgs/msg/{kind}") }
    }

    fn inputs(points: &str, image: &str) -> Inputs {
        Inputs {
            points: points.to_owned(),
            image: image.to_owned(),
            camera_info: "/info".to_owned(),
            compressed: format!("{image}{COMPRESSED_DEPTH}"),
        }
    }

    #[test]
    fn the_list_of_topics_has_the_exact_remapping() {
        let sources = [
            source("/a/points", "PointCloud2"),
            source("/b", "Image"),
            source("/c", "CameraInfo"),
            source("/cam/depth/image_raw", "Image"),
            source("/cam/depth/image_raw/compressedDepth", "CompressedImage"),
            source("/other/Depth/compressedDepth", "CompressedImage"),
            source("/rgb/image/compressed", "CompressedImage"),
        ];
        assert_eq!(
            choices(&sources),
            "PointCloud2 topics: use -r points:=/a/points; depth images: use -r depth/image:=/cam/depth/image_raw \
             -r depth/camera_info:=/cam/depth/camera_info or -r depth/image:=/other/Depth \
             -r depth/camera_info:=/other/camera_info; other Image topics: /b"
        );
        assert!(choices(&[]).contains("no PointCloud2 and no depth image"));
    }

    #[test]
    fn silence_is_explained_for_each_input_and_after_the_choice_for_the_chosen_one() {
        let sources = [source("/a/points", "PointCloud2"), source("/b", "Image")];
        let why = |points, image, chosen| why_quiet(&inputs(points, image), chosen, &sources, QUIET);
        assert!(why("/x", "/y", None).contains("nobody publishes on /x or /y or /y/compressedDepth; "));
        assert!(
            why("/b", "/y", None)
                .contains("/b carries sensor_msgs/msg/Image, not sensor_msgs/msg/PointCloud2")
        );
        assert!(
            why("/a/points", "/y", None).contains("/a/points has a publisher, but no cloud has come for 3 s")
        );
        assert!(why("/x", "/b", None).contains("/b has a publisher"));
        assert!(why("/a/points", "/y", Some(Input::Depth)).contains("nobody publishes on /y; "));
    }

    #[test]
    fn another_input_is_offered_in_exact_words() {
        let inputs = inputs("/p", "/d");
        let words = |chosen, other| how_to_choose(&inputs, chosen, other);
        let lines = [
            (Input::Points, Input::Depth, "(to take /d instead: -r points:=/unused)"),
            (Input::Depth, Input::Points, "(to take /p instead: -r depth/image:=/unused)"),
            (Input::CompressedDepth, Input::Points, "(to take /p instead: -r depth/image:=/unused)"),
            (Input::CompressedDepth, Input::Depth, "(to take /d instead: -r /d/compressedDepth:=/unused)"),
            (
                Input::Depth,
                Input::CompressedDepth,
                "(to take /d/compressedDepth instead: -r depth/image:=/unused -r \
                 /unused/compressedDepth:=/d/compressedDepth)",
            ),
        ];
        for (chosen, other, expected) in lines {
            assert!(words(chosen, other).ends_with(expected), "{}", words(chosen, other));
        }
    }
}
