//! What helps where a cloud has got no transform: another thing for each reason.

use super::Join;
use crate::tf::{Lack, LookupError};

/// Names of frames that a message shows at most.
const NAMES: usize = 20;

const ONE_CLOCK: &str = "see whether one clock stamps both clouds and transforms";

/// How a cloud was given up that got no transform.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GivenUp {
    /// It has waited as long as a cloud may.
    TimedOut,
    /// It made place for a newer one.
    PushedOut {
        /// A longer `tf_timeout` lets more wait.
        longer_helps: bool,
    },
    /// It still waited at the end.
    AtEnd,
}

/// Where transforms come from, and so what can add one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransformsFrom {
    /// A robot's network.
    Network,
    /// A recorded bag, which nothing is added to while it is read.
    Bag,
}

impl TransformsFrom {
    /// What tells where this frame is, which nobody has told.
    fn who_tells(self, frame: &str) -> String {
        match self {
            Self::Network => format!(
                "nobody says where `{frame}` is: a robot description does, or ros2 run tf2_ros static_transform_publisher"
            ),
            Self::Bag => format!(
                "the bag does not say where `{frame}` is: record /tf_static too, or play it beside a live node and who says so"
            ),
        }
    }

    /// What helps where nothing connects two trees.
    const fn connects(self) -> &'static str {
        match self {
            Self::Network => {
                "(choose with -p fixed_frame:=..., or connect the two by ros2 run tf2_ros static_transform_publisher)"
            }
            Self::Bag => {
                "(choose with -p fixed_frame:=..., or record /tf_static too, or play the bag beside a live node and who connects the two)"
            }
        }
    }
}

impl GivenUp {
    /// Whether a longer `tf_timeout` would have let it wait for a transform that comes later.
    const fn is_cured_by_tf_timeout(self) -> bool {
        matches!(self, Self::TimedOut | Self::PushedOut { longer_helps: true })
    }
}

impl Join {
    /// What the user can do about a cloud that was given up, `why` being what its last lookup lacked; `None` where that says all.
    /// Where no lookup was made, or a frame is not known or not connected, the frames that have been seen are listed. `tf_timeout`
    /// is mentioned only where a longer one lets such a cloud wait longer, and `why_none` asked only where no transform has come at all;
    /// `from` says what can add one.
    pub fn hint(
        &self,
        why: Option<&LookupError>,
        given_up: GivenUp,
        from: TransformsFrom,
        why_none: impl FnOnce() -> String,
    ) -> Option<String> {
        let sensor = why.map(|why| why.sensor.as_str());
        let seen = || self.frames_seen(sensor, why_none);
        let Some(LookupError { fixed, lack, .. }) = why else { return Some(seen()) };
        match lack {
            Lack::UnknownFrame { .. } if self.frames.frame_names().is_empty() => Some(seen()),
            Lack::UnknownFrame { frame } if frame == fixed => {
                Some(format!("{} (choose with -p fixed_frame:=...)", seen()))
            }
            Lack::UnknownFrame { frame } => Some(format!("{}; {}", seen(), from.who_tells(frame))),
            Lack::NotConnected { .. } => Some(format!("{} {}", seen(), from.connects())),
            Lack::TooLate { frame, covered } => {
                let timing = if given_up.is_cured_by_tf_timeout() {
                    "see tf_timeout, and whether one clock stamps both clouds and transforms"
                } else {
                    ONE_CLOCK
                };
                let once = (covered.from == covered.until).then(|| {
                    format!("; {frame} was told once so far: what does not change belongs on /tf_static")
                });
                Some(format!("{timing}{}", once.unwrap_or_default()))
            }
            Lack::TooEarly { .. } => Some(ONE_CLOCK.to_owned()),
            Lack::NotJumpedBack { .. } | Lack::TooDeep { .. } | Lack::Numeric { .. } => None,
        }
    }

    /// The frames that have been seen, or why there are none. Those that move, and take this sensor with them, are of no use as the
    /// fixed one, and are counted alone.
    fn frames_seen(&self, sensor: Option<&str>, why_none: impl FnOnce() -> String) -> String {
        let known = self.frames.frame_names();
        if known.is_empty() {
            return format!("no transform has come at all: {}", why_none());
        }
        let is_carried =
            |frame: &String| sensor.is_some_and(|sensor| self.frames.is_carried_with(frame, sensor));
        let (carried, known): (Vec<_>, Vec<_>) = known.into_iter().partition(is_carried);
        let (shown, more) = (&known[..known.len().min(NAMES)], known.len().saturating_sub(NAMES));
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let carried = match carried.len() {
            0 => String::new(),
            1 => ", and 1 that moves with the sensor".to_owned(),
            number => format!(", and {number} that move with the sensor"),
        };
        format!("frames seen: {}{more}{carried}", shown.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Stamp;
    use crate::msg::ros::{Header, Transform, TransformStamped};

    fn transform(parent: &str, child: &str, seconds: i64) -> TransformStamped {
        let stamp = Stamp::from_nanos(seconds * 1_000_000_000).into();
        let header = Header { stamp, frame_id: parent.to_owned() };
        TransformStamped { header, child_frame_id: child.to_owned(), transform: Transform::default() }
    }

    /// Of a join that has had transforms.
    fn never() -> String {
        panic!("asked why there are none")
    }

    /// What helps a scan that was taken at this time.
    fn hint(join: &Join, fixed: &str, sensor: &str, seconds: i64) -> Option<String> {
        let at = Stamp::from_nanos(seconds * 1_000_000_000);
        join.hint(
            Some(&join.frames().lookup(fixed, sensor, at).unwrap_err()),
            GivenUp::TimedOut,
            TransformsFrom::Network,
            never,
        )
    }

    #[test]
    fn each_reason_for_which_there_is_no_transform_has_the_words_that_help_against_it() {
        let mut join = Join::new(1);
        let at_start = join.frames().lookup("odom", "camera", Stamp::default()).unwrap_err();
        for why in [None, Some(&at_start)] {
            let none =
                join.hint(why, GivenUp::TimedOut, TransformsFrom::Network, || "nobody is there".to_owned());
            assert_eq!(none.as_deref(), Some("no transform has come at all: nobody is there"));
        }
        for second in [10, 11] {
            join.transform(&transform("odom", "base", second), false).unwrap();
        }
        join.transform(&transform("head", "camera", 0), true).unwrap();
        let seen = "frames seen: base, camera, head, odom";
        assert_eq!(join.hint(None, GivenUp::TimedOut, TransformsFrom::Network, never).as_deref(), Some(seen));
        let expected = |more: &str| Some(format!("{seen}{more}"));
        let choose = " (choose with -p fixed_frame:=...)";
        assert_eq!(hint(&join, "map", "nowhere", 10), expected(choose));
        let publisher = "ros2 run tf2_ros static_transform_publisher";
        let nobody =
            format!("; nobody says where `kinect_depth` is: a robot description does, or {publisher}");
        assert_eq!(hint(&join, "odom", "kinect_depth", 10), expected(&nobody));
        let connect = format!(" (choose with -p fixed_frame:=..., or connect the two by {publisher})");
        assert_eq!(hint(&join, "odom", "camera", 10), expected(&connect));
        let clock = "whether one clock stamps both clouds and transforms";
        assert_eq!(hint(&join, "odom", "base", 12), Some(format!("see tf_timeout, and {clock}")));
        assert_eq!(hint(&join, "odom", "base", 9), Some(format!("see {clock}")));
        let late = join.frames().lookup("odom", "base", Stamp::from_nanos(12_000_000_000)).unwrap_err();
        let pushed_out = |longer_helps| {
            join.hint(Some(&late), GivenUp::PushedOut { longer_helps }, TransformsFrom::Network, never)
        };
        assert_eq!(pushed_out(true), Some(format!("see tf_timeout, and {clock}")));
        assert_eq!(
            [pushed_out(false), join.hint(Some(&late), GivenUp::AtEnd, TransformsFrom::Network, never)],
            [(); 2].map(|()| Some(format!("see {clock}")))
        );
        let (fixed, sensor, at) = ("odom".to_owned(), "base".to_owned(), Stamp::default());
        let back = LookupError { fixed, sensor, at, lack: Lack::NotJumpedBack { newest: at } };
        assert_eq!(join.hint(Some(&back), GivenUp::TimedOut, TransformsFrom::Network, never), None);
    }

    /// Nobody adds a transform to a bag while it is read.
    #[test]
    fn what_a_bag_lacks_is_to_be_recorded() {
        let mut join = Join::new(1);
        join.transform(&transform("odom", "base", 10), false).unwrap();
        join.transform(&transform("head", "camera", 0), true).unwrap();
        for sensor in ["kinect_depth", "camera"] {
            let why = join.frames().lookup("odom", sensor, Stamp::from_nanos(10_000_000_000)).unwrap_err();
            let hint = join.hint(Some(&why), GivenUp::AtEnd, TransformsFrom::Bag, never).unwrap();
            assert!(hint.contains("record /tf_static too") && !hint.contains("ros2 run"), "{hint}");
        }
    }

    /// A mounting that was sent once, on `/tf`: the clocks are right, and it would never be covered.
    #[test]
    fn a_transform_that_was_told_once_belongs_on_the_topic_of_those_that_last() {
        let mut join = Join::new(1);
        join.transform(&transform("odom", "base", 10), false).unwrap();
        let said_once = |join: &Join| {
            let once = "; base was told once so far: what does not change belongs on /tf_static";
            hint(join, "odom", "base", 12).unwrap().ends_with(once)
        };
        assert!(said_once(&join));
        join.transform(&transform("odom", "base", 11), false).unwrap();
        assert!(!said_once(&join));
    }

    #[test]
    fn frames_that_move_with_the_sensor_are_not_offered_as_the_fixed_one() {
        let mut join = Join::new(1);
        for (parent, child, is_static) in [
            ("map", "odom", false),
            ("odom", "base", false),
            ("base", "link", true),
            ("link", "camera", true),
            ("base", "wheel", false),
            ("map", "hall", true),
            ("hall", "on_a_wall", true),
        ] {
            join.transform(&transform(parent, child, 10), is_static).unwrap();
        }
        let offered = |sensor| hint(&join, "world", sensor, 10).unwrap();
        let words = "frames seen: hall, map, odom, on_a_wall, wheel, and 3 that move with the sensor (choose";
        assert!(offered("camera").starts_with(words), "{}", offered("camera"));
        let words = "frames seen: base, camera, hall, link, map, odom, on_a_wall, wheel (choose";
        assert!(offered("on_a_wall").starts_with(words), "{}", offered("on_a_wall"));
    }

    #[test]
    fn of_very_many_frames_only_some_are_listed() {
        let mut join = Join::new(1);
        for i in 0..30 {
            join.transform(&transform("odom", &format!("frame_{i:02}"), 0), true).unwrap();
        }
        let seen = join.hint(None, GivenUp::AtEnd, TransformsFrom::Network, never).unwrap();
        assert!(seen.ends_with("frame_18, frame_19 and 11 more"), "{seen}");
    }
}
