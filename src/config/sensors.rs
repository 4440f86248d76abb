//! The sensors that one map is made from: `sensors`, and of each its `<name>.kind` and `<name>.noise_model`.

use super::table::{OF_SENSOR, TABLE};
use super::word::Word as _;

/// Sensors of one node at most.
pub(super) const MOST_SENSORS: usize = 16;

/// Bytes of a sensor's name at most.
pub(super) const MAX_SENSOR_NAME_BYTES: usize = 64;

/// Name of the sensor that there is when none is named.
pub(super) const DEFAULT: &str = "points";

/// What a sensor sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Clouds or depth images, whichever come first; only of a sensor that is alone.
    Auto,
    /// `sensor_msgs/PointCloud2`.
    Cloud,
    /// `sensor_msgs/Image` or `sensor_msgs/CompressedImage`, with `sensor_msgs/CameraInfo`.
    Depth,
}

impl Kind {
    /// As in the parameter.
    pub fn as_str(self) -> &'static str {
        self.word()
    }
}

/// A sensor that the map is made from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sensor {
    /// Its name, unique among the sensors.
    pub name: String,
    /// What it sends.
    pub kind: Kind,
}

/// Whether this is a topic, before remapping, of a sensor of which there are such `parameters`.
pub(super) fn have_topic(parameters: impl Iterator<Item = String>, name: &str) -> bool {
    let of = |sensor: Sensor| {
        let points = sensor.points() == Some(name);
        points || [sensor.image(), sensor.camera_info()].iter().flatten().any(|topic| topic == name)
    };
    of_parameters(parameters)
        .iter()
        .any(|sensor| Kind::ALL.iter().map(|&kind| Sensor { name: sensor.clone(), kind }).any(of))
}

/// Names of the sensors of which there are such `parameters`.
pub(super) fn of_parameters(parameters: impl Iterator<Item = String>) -> Vec<String> {
    parameters.filter_map(|parameter| parameter.strip_suffix(".kind").map(str::to_owned)).collect()
}

/// The sensor that a parameter of this name would be of, `rear` of `rear.kind`; `None` where it would be of none.
pub(super) fn of_parameter(name: &str) -> Option<&str> {
    let (sensor, parameter) = name.split_once('.')?;
    let is_of_sensor = OF_SENSOR.iter().any(|row| row.name == parameter) && is_name(sensor);
    is_of_sensor.then_some(sensor)
}

impl Sensor {
    /// The topic of its clouds, before remapping: `<name>`.
    pub fn points(&self) -> Option<&str> {
        (self.kind != Kind::Depth).then_some(self.name.as_str())
    }

    /// The topic of its depth images, before remapping: `<name>/image`.
    pub fn image(&self) -> Option<String> {
        Some(format!("{}/image", self.depth()?))
    }

    /// The topic of its camera's intrinsics, before remapping: `<name>/camera_info`.
    pub fn camera_info(&self) -> Option<String> {
        Some(format!("{}/camera_info", self.depth()?))
    }

    fn depth(&self) -> Option<&str> {
        match self.kind {
            Kind::Auto => Some("depth"),
            Kind::Cloud => None,
            Kind::Depth => Some(&self.name),
        }
    }
}

/// Whether these can be the names of the sensors.
pub(super) fn can_be(list: &[String]) -> bool {
    // Their number first: whoever asks may name a million.
    let differ = || (1..list.len()).all(|index| !list[..index].contains(&list[index]));
    (1..=MOST_SENSORS).contains(&list.len()) && list.iter().all(|name| is_name(name)) && differ()
}

fn is_name(name: &str) -> bool {
    name.len() <= MAX_SENSOR_NAME_BYTES
        && TABLE.iter().all(|row| row.name != name)
        && name.starts_with(|first: char| first.is_ascii_alphabetic())
        && name.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_')
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Config, Current, Value};
    use crate::engine::NoiseModel;

    fn text(text: &str) -> Value {
        Value::Text(text.to_owned())
    }

    fn config(list: &[&str], more: &[(&str, &str)]) -> Result<Config, String> {
        let list = Value::TextList(list.iter().map(|name| (*name).to_owned()).collect());
        let more = more.iter().map(|(name, value)| ((*name).to_owned(), text(value)));
        Config::new([("sensors".to_owned(), list)].into_iter().chain(more)).map_err(|error| error.to_string())
    }

    fn topics(config: &Config) -> Vec<Vec<String>> {
        let of = |sensor: &Sensor| {
            let points = sensor.points().map(str::to_owned);
            points.into_iter().chain(sensor.image()).chain(sensor.camera_info()).collect()
        };
        config.sensors.iter().map(of).collect()
    }

    #[test]
    fn a_sensor_has_the_topics_of_its_kind_below_its_name() {
        let both = [["points", "depth/image", "depth/camera_info"].as_slice()];
        assert_eq!(topics(&Config::new([]).unwrap()), both);
        assert_eq!(topics(&config(&["points"], &[]).unwrap()), both);
        assert_eq!(topics(&config(&["points"], &[("points.kind", "cloud")]).unwrap()), [["points"]]);
        let mixed = config(&["front", "rear"], &[("rear.kind", "depth")]).unwrap();
        assert_eq!(topics(&mixed), [["front"].as_slice(), &["rear/image", "rear/camera_info"]]);
    }

    #[test]
    fn a_list_that_cannot_be_is_what_is_refused_whatever_is_given_for_its_sensors() {
        let kind = ("front.kind".to_owned(), text("depth"));
        for list in [text("front"), Value::TextList(vec!["front".to_owned(); 2])] {
            let error =
                Config::new([("sensors".to_owned(), list.clone()), kind.clone()]).unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("sensors is {list}; it must be a list of 1 to 16")),
                "{error}"
            );
        }
    }

    #[test]
    fn a_topic_that_is_given_as_a_parameter_is_told_so() {
        let line = |list: &[&str], name| config(list, &[(name, "/camera")]).unwrap_err();
        for (list, name) in [
            (&["points"][..], "points"),
            (&["points"], "depth/image"),
            (&["points"], "depth/camera_info"),
            (&["front", "rear"], "rear"),
            (&["front", "rear"], "rear/image"),
        ] {
            let expected =
                format!("{name} is a topic and no parameter: have it read another one with -r {name}:=...");
            assert_eq!(line(list, name), expected);
        }
        assert!(line(&["front", "rear"], "points").starts_with("unknown parameter `points`"));
    }

    #[test]
    fn sensors_that_cannot_be_are_refused_with_what_they_must_be() {
        let line = |list: &[&str], more: &[(&str, &str)]| config(list, more).unwrap_err();
        let long = "x".repeat(MAX_SENSOR_NAME_BYTES + 1);
        for list in
            [&[][..], &["a/b"], &[""], &["1a"], &["depth"], &["ä"], &[&long], &["a", "b", "a"], &["x"; 17]]
        {
            let said = line(list, &[]);
            assert!(said.contains("it must be a list of 1 to 16 names that differ"), "{said}");
        }
        assert_eq!(
            line(&["a", "b"], &[("a.kind", "auto")]),
            "a.kind is \"auto\"; it must be `cloud` or `depth`; `auto` is for a sensor that is alone"
        );
        assert_eq!(
            line(&["a"], &[("a.kind", "lidar")]),
            "a.kind is \"lidar\"; it must be `cloud`, `depth` or `auto`"
        );
        assert_eq!(
            line(&["front"], &[("front.knid", "depth")]),
            "unknown parameter `front.knid` (given as \"depth\"); the nearest known one is `front.kind`"
        );
        assert!(line(&["a"], &[("a.knd", "depth")]).contains("unknown parameter `a.knd`"));
    }

    #[test]
    fn a_parameter_of_a_sensor_that_there_is_not_is_told_with_those_that_there_are() {
        let alone = Config::new([("rear.kind".to_owned(), text("depth"))]).unwrap_err().to_string();
        let expected = "there is no sensor `rear` among sensors (points); -p 'sensors:=[\"rear\"]' names it";
        assert_eq!(alone, expected);
        assert_eq!(
            config(&["front", "left"], &[("fornt.noise_model", "none")]).unwrap_err(),
            "there is no sensor `fornt` among sensors (front, left); \
             -p 'sensors:=[\"front\", \"left\", \"fornt\"]' names it"
        );
        for none in ["depth.kind", "a/b.kind", ".kind", "rear.knid", "a.b.kind", &"x".repeat(1 << 20)] {
            let error = Config::new([(none.to_owned(), text("depth"))]).unwrap_err().to_string();
            assert!(error.starts_with("unknown parameter"), "{none}: {error}");
        }
    }

    #[test]
    fn a_million_names_are_refused_before_they_are_compared() {
        let list: Vec<_> = (0..1_000_000).map(|number| format!("a{number}")).collect();
        assert!(!can_be(&list));
    }

    #[test]
    fn one_map_has_one_noise_model() {
        let model =
            |more: &[(&str, &str)]| config(&["a", "b"], more).map(|config| config.engine.noise_model());
        assert_eq!(model(&[("noise_model", "none")]), Ok(NoiseModel::None));
        let both = [("a.noise_model", "none"), ("b.noise_model", "none")];
        assert_eq!(model(&both), Ok(NoiseModel::None));
        assert_eq!(model(&both[..1]), Ok(NoiseModel::None));
        assert_eq!(
            model(&[("noise_model", "kinect_v1"), ("b.noise_model", "none")]).unwrap_err(),
            "b.noise_model is \"none\"; it must be as `noise_model` and the same for all sensors: one map weighs its points in one way"
        );
        assert!(model(&[("a.noise_model", "lidar")]).unwrap_err().starts_with("a.noise_model is \"lidar\""));
    }

    #[test]
    fn the_values_of_a_configuration_make_the_same_one_again() {
        let given = [
            ("sensors", Value::TextList(vec!["front".to_owned(), "rear".to_owned()])),
            ("rear.kind", text("depth")),
        ];
        let given = given.map(|(name, value)| (name.to_owned(), value));
        for given in [Vec::new(), given.to_vec()] {
            let current = Current::new(given).unwrap();
            let values = current.values().map(|(name, value)| (name.clone(), value.clone()));
            assert_eq!(Config::new(values).unwrap(), *current.config());
        }
    }
}
