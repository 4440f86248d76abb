//! When compressed depth images are read: only where nothing else comes of a camera.
//!
//! `image_transport` offers images raw and compressed side by side, and where somebody reads the compressed ones it packs a PNG
//! of every image, within the driver's own call. So they are read where no raw ones are offered, or where those do not come.

use std::time::Duration;

use tracing::warn;

use super::inputs::offers;
use super::transport::{DepthTopics, Source};

/// Time between two looks at who publishes.
const LOOK: Duration = Duration::from_millis(500);
/// Looks in a row that find compressed images alone: the topics of a driver are found one after the other.
const ALONE: u32 = 2;
/// Looks in a row that find them while no raw one has come: a Kinect takes some seconds to start, and raw images may be too
/// large for the network.
const MUTE: u32 = 20;

/// Resolves when the compressed images of a camera are to be read. `comes` says whether it comes in another form, as
/// [`Known::comes`](super::heard::Known::comes) has it: then it never does.
pub(super) async fn wanted(
    topics: &DepthTopics,
    sources: impl Fn() -> Vec<Source>,
    comes: impl Fn() -> bool,
) {
    let mut looks = Looks::default();
    loop {
        tokio::time::sleep(LOOK).await;
        if comes() {
            return std::future::pending().await;
        }
        if looks.are_enough(offers(topics, &sources())) {
            return;
        }
    }
}

/// Says why they are not read; the node goes on without.
pub(super) async fn cannot_be_read<T>(error: &impl std::fmt::Display) -> T {
    warn!("compressed depth images are not read: {error}");
    std::future::pending().await
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
    use super::*;

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
