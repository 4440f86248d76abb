//! In which frame a replayed map lives.

use super::said::Remark;
use super::tree::Tree;
use crate::msg::ros::TransformStamped;

/// The fixed frame: as given, or found out from the bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FixedFrame {
    /// It stands.
    Settled(String),
    /// Nobody has named one: the default if the bag has it, else the root of the sensor's tree.
    Open {
        /// The default.
        default: String,
    },
    /// The frame of a sensor that is taken to stand still, for no transform has been seen, not even a refused one. The first
    /// that comes shows that this is wrong.
    Still {
        /// That frame; of a camera the body frame, whose z is up.
        name: String,
        /// The camera's optical frame, where the map is made in its body frame.
        optical: Option<String>,
        /// The default.
        default: String,
    },
    /// The root of the sensor's tree as far as it has been seen. A later transform may show that it was none.
    Guessed {
        /// That root.
        name: String,
        /// The sensor's frame.
        sensor: String,
        /// The default.
        default: String,
    },
    /// The root of the sensor's tree in the whole bag, which does not have the default.
    Found {
        /// That root.
        name: String,
        /// The sensor's frame; `None` where the bag has transforms, and none names a sensor's frame.
        sensor: Option<String>,
        /// The default.
        default: String,
    },
}

impl FixedFrame {
    /// Its name, once there is one.
    pub fn name(&self) -> Option<&str> {
        match self {
            Self::Settled(name)
            | Self::Still { name, .. }
            | Self::Guessed { name, .. }
            | Self::Found { name, .. } => Some(name),
            Self::Open { .. } => None,
        }
    }

    /// Settles on the default where it is seen before anything was guessed.
    pub(super) fn look_for_default(&mut self, tree: &Tree) {
        if let Self::Open { default } = self
            && tree.has(default)
        {
            *self = Self::Settled(std::mem::take(default));
        }
    }

    /// Guesses the root of the first of these sensors that a transform is about; where there are no transforms, that the first
    /// stands still. It stays open where there are transforms and none is about a sensor: see [`Self::found`].
    pub(super) fn guess(&mut self, tree: &Tree, sensors: &[&str]) {
        let Self::Open { default } = self else { return };
        let default = std::mem::take(default);
        *self = match (first_root(tree, sensors), sensors.first()) {
            (Some((sensor, root)), _) => {
                Self::Guessed { name: root.to_owned(), sensor: sensor.to_owned(), default }
            }
            (None, Some(first)) if tree.is_empty() => {
                Self::Still { name: (*first).to_owned(), optical: None, default }
            }
            _ => Self::Open { default },
        };
    }

    /// Whether the sensor does not move in this frame by what is known so far: if the bag has more to tell, the guess is hardly right.
    pub(super) fn is_where_all_stands(&self, tree: &Tree) -> bool {
        match self {
            Self::Still { .. } => true,
            Self::Guessed { sensor, .. } => !tree.moves(sensor),
            Self::Settled(_) | Self::Open { .. } | Self::Found { .. } => false,
        }
    }

    /// Takes a guess back.
    pub(super) fn reopen(&mut self) {
        if let Self::Still { default, .. } | Self::Guessed { default, .. } = self {
            *self = Self::Open { default: std::mem::take(default) };
        }
    }

    /// Takes a camera that stands still to look straight ahead: the map is made in the frame that this transform puts above its
    /// own.
    pub(super) fn level(&mut self, body: &TransformStamped) {
        if let Self::Still { name, optical, .. } = self {
            *optical = Some(std::mem::replace(name, body.header.frame_id.clone()));
        }
    }

    /// Whether the guess was wrong: the default has turned up, the root has got a parent or ought to have one, or there are
    /// transforms after all.
    pub(super) fn is_wrong(&self, tree: &Tree) -> bool {
        match self {
            Self::Still { .. } => !tree.is_empty(),
            Self::Guessed { name, sensor, default } => {
                let has_grown = tree.top(name) != name;
                has_grown || tree.has(default) || tree.beyond(sensor).is_some_and(|beyond| beyond != name)
            }
            Self::Settled(_) | Self::Open { .. } | Self::Found { .. } => false,
        }
    }

    /// What stands once all transforms of the bag are known, so that no further guess is needed.
    pub(super) fn found(self, tree: &Tree, sensors: &[&str]) -> Self {
        let (sensor, default) = match self {
            Self::Settled(_) | Self::Found { .. } => return self,
            Self::Guessed { sensor, default, .. } => (Some(sensor), default),
            Self::Still { default, .. } | Self::Open { default } => (None, default),
        };
        if tree.has(&default) {
            return Self::Settled(default);
        }
        let sensors: Vec<_> = sensor.iter().map(String::as_str).chain(sensors.iter().copied()).collect();
        match (first_root(tree, &sensors), tree.any_root()) {
            (Some((sensor, root)), _) => {
                Self::Found { name: root.to_owned(), sensor: Some(sensor.to_owned()), default }
            }
            // No scan has a way to that root; each is refused with the name of its frame, which no transform mentions.
            (None, Some(root)) => Self::Found { name: root.to_owned(), sensor: None, default },
            (None, None) => Self::Open { default },
        }
    }

    /// What is to be said of a guess at the end, when these sensors have sent clouds: a warning where the sensor may have moved in
    /// another way than is known.
    pub(super) fn about(&self, tree: &Tree, sensors: &[&str]) -> Option<Remark> {
        let (name, sensor, default) = match self {
            Self::Settled(_) | Self::Open { .. } => return None,
            Self::Still { name, default, .. } => (name, None, default),
            Self::Guessed { name, sensor, default } => (name, Some(sensor), default),
            Self::Found { name, sensor, default } => (name, sensor.as_ref(), default),
        };
        let in_tree = sensors.iter().find(|sensor| tree.root_of(sensor) == Some(name.as_str()));
        let still = self.why_still();
        let (why, is_warning) = match sensor.map(String::as_str).or(in_tree.copied()) {
            Some(sensor) if tree.moves(sensor) => ("the root of the sensor's frames", false),
            Some(_) => ("the root of the sensor's frames, in which no transform moves it", true),
            None if tree.is_empty() => (still.as_str(), true),
            None => ("a root of the frames that there are, and the sensor's frame is not among them", true),
        };
        let text = format!(
            "the bag has no frame `{default}`: the map is made in `{name}`, {why} (choose with -p fixed_frame:=...)"
        );
        Some(Remark { text, is_warning })
    }

    fn why_still(&self) -> String {
        if let Self::Still { optical: Some(optical), .. } = self {
            format!(
                "the body frame (x ahead, z up) of the camera's `{optical}`: no transform tells how it was mounted and moved, so it \
                 is taken to look straight ahead, level, and to stand still"
            )
        } else {
            "the sensor's own frame, whose z is taken to be up (where it looks ahead, as a camera's: -p optical:=yes): no transform tells \
             how it moved, so it is taken to stand still"
                .to_owned()
        }
    }
}

/// The first of these sensors that a transform is about, and the root of its tree.
fn first_root<'a>(tree: &'a Tree, sensors: &[&'a str]) -> Option<(&'a str, &'a str)> {
    sensors.iter().find_map(|sensor| Some((*sensor, tree.root_of(sensor)?)))
}

#[cfg(test)]
mod tests {
    use super::super::body::body_of;
    use super::super::tree::tests::tree;
    use super::*;

    fn open() -> FixedFrame {
        FixedFrame::Open { default: "odom".to_owned() }
    }

    fn found(tree: &Tree, sensors: &[&str]) -> FixedFrame {
        open().found(tree, sensors)
    }

    fn root(name: &str, sensor: Option<&str>) -> FixedFrame {
        let (name, sensor) = (name.to_owned(), sensor.map(str::to_owned));
        FixedFrame::Found { name, sensor, default: "odom".to_owned() }
    }

    #[test]
    fn the_root_of_all_transforms_is_found_and_the_default_before_it() {
        let some = Some("a");
        assert_eq!(found(&tree(&["b a", "c b", "x y"], &[], &[]), &["a"]), root("c", some));
        assert_eq!(
            found(&tree(&["b a", "odom x"], &[], &[]), &["a"]),
            FixedFrame::Settled("odom".to_owned())
        );
        assert_eq!(found(&tree(&["b a"], &[], &["odom b"]), &["a"]), FixedFrame::Settled("odom".to_owned()));
        assert_eq!(found(&tree(&[], &[], &[]), &["a"]), open());
    }

    #[test]
    fn frames_in_a_circle_end_somewhere() {
        assert!(matches!(found(&tree(&["b a", "a b"], &[], &[]), &["a"]), FixedFrame::Found { .. }));
    }

    #[test]
    fn the_sensor_that_has_transforms_is_the_one_that_counts() {
        let tree = tree(&["map base"], &["base camera"], &[]);
        let mut guess = open();
        guess.guess(&tree, &["lonely", "camera"]);
        assert_eq!((guess.name(), guess.is_wrong(&tree)), (Some("map"), false));
        assert_eq!(found(&tree, &["lonely", "camera"]), root("map", Some("camera")));
        // All scans of the others can be refused alone where the map is made elsewhere.
        let mut guess = open();
        guess.guess(&tree, &["lonely"]);
        assert_eq!((&guess, found(&tree, &["lonely"])), (&open(), root("map", None)));
    }

    #[test]
    fn a_sensor_stands_still_until_the_first_transform_even_a_refused_one() {
        let mut still = open();
        still.guess(&tree(&[], &[], &[]), &["camera", "other"]);
        assert_eq!((still.name(), still.is_wrong(&tree(&[], &[], &[]))), (Some("camera"), false));
        for tree in [tree(&["x y"], &[], &[]), tree(&[], &[], &["map camera"])] {
            assert!(still.is_wrong(&tree));
        }
        let refused = tree(&[], &[], &["map camera"]);
        assert_eq!(still.found(&refused, &["camera"]), root("map", Some("camera")));
    }

    #[test]
    fn a_camera_that_stands_still_has_its_map_in_its_body_frame_until_the_first_transform() {
        let none = tree(&[], &[], &[]);
        let mut still = open();
        still.guess(&none, &["a_optical_frame"]);
        still.level(&body_of("a_optical_frame").unwrap());
        assert_eq!(still.name(), Some("a_frame"));
        let about = still.about(&none, &["a_optical_frame"]).unwrap();
        let said = "made in `a_frame`, the body frame (x ahead, z up) of the camera's `a_optical_frame`";
        assert!(about.is_warning && about.text.contains(said), "{about:?}");
        assert!(still.is_wrong(&tree(&["map a_optical_frame"], &[], &[])));
        // Whatever else is known stands.
        for mut known in [open(), FixedFrame::Settled("a_optical_frame".to_owned())] {
            let before = known.clone();
            known.level(&body_of("a_optical_frame").unwrap());
            assert_eq!(known, before);
        }
    }

    #[test]
    fn a_frame_below_which_the_sensor_moves_is_no_warning_and_any_other_is() {
        let none = &[][..];
        for (moving, fixed, sensors, is_warning) in [
            (&["map camera"][..], none, &["camera"][..], false),
            (none, &["map camera"][..], &["camera"], true),
            (&["map base"], none, &["camera"], true),
        ] {
            let tree = tree(moving, fixed, &[]);
            let about = found(&tree, sensors).about(&tree, sensors).unwrap();
            assert_eq!(about.is_warning, is_warning, "{about:?}");
        }
    }

    #[test]
    fn a_link_above_the_guessed_root_that_is_refused_shows_that_it_was_none_where_nothing_moves_below() {
        for (moving, is_wrong) in [(&[][..], true), (&["base camera"][..], false)] {
            let below = tree(moving, &["base camera"][..1 - moving.len()], &[]);
            let mut guess = open();
            guess.guess(&below, &["camera"]);
            let above = tree(moving, &["base camera"][..1 - moving.len()], &["map base"]);
            assert_eq!((guess.name(), guess.is_wrong(&above)), (Some("base"), is_wrong));
        }
    }
}
