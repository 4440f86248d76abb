//! The sensors that one map is made from: `sensors`, and of each its `<name>.kind` and `<name>.noise_model`.

use std::collections::BTreeMap;

use super::{ConfigError, Value};

/// Sensors of one node at most.
const MOST: usize = 16;

/// Bytes of a sensor's name at most.
const MAX_NAME_BYTES: usize = 64;

/// Name of the sensor that there is when none is named.
const DEFAULT: &str = "points";

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
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Cloud => "cloud",
            Self::Depth => "depth",
        }
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

/// Splits what belongs to a sensor off: `front.kind` is the `kind` of `front`.
pub(super) fn of_sensor(parameter: &str) -> Option<(&str, &str)> {
    parameter.rsplit_once('.').filter(|(_, what)| ["kind", "noise_model"].contains(what))
}

/// The sensors of this list; `given` holds the values of `<name>.kind`.
pub(super) fn sensors(list: &[String], given: &BTreeMap<String, Value>) -> Result<Vec<Sensor>, ConfigError> {
    let refused = |must: String| ConfigError::Impossible {
        name: "sensors".into(),
        value: Value::TextList(list.to_vec()),
        must,
    };
    if list.is_empty() || list.len() > MOST {
        return Err(refused(format!("a list of 1 to {MOST} names")));
    }
    for (index, name) in list.iter().enumerate() {
        if !is_name(name) {
            let must = "of names that begin with a letter and have letters, digits and underscores";
            return Err(refused(format!("{must}, {MAX_NAME_BYTES} bytes at most: `{name}` is none")));
        }
        if list[..index].contains(name) {
            return Err(refused(format!("of names that differ: `{name}` stands there twice")));
        }
    }
    let kind = |name: &String| kind(name, list.len() == 1, given.get(&format!("{name}.kind")));
    list.iter().map(|name| Ok(Sensor { name: name.clone(), kind: kind(name)? })).collect()
}

fn is_name(name: &str) -> bool {
    name.len() <= MAX_NAME_BYTES
        && name.starts_with(|first: char| first.is_ascii_alphabetic())
        && name.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_')
}

fn kind(name: &str, is_alone: bool, given: Option<&Value>) -> Result<Kind, ConfigError> {
    let Some(value) = given else {
        return Ok(if is_alone && name == DEFAULT { Kind::Auto } else { Kind::Cloud });
    };
    match value {
        Value::Text(kind) if kind == "cloud" => Ok(Kind::Cloud),
        Value::Text(kind) if kind == "depth" => Ok(Kind::Depth),
        Value::Text(kind) if kind == "auto" && is_alone => Ok(Kind::Auto),
        value => Err(ConfigError::Impossible {
            name: format!("{name}.kind").into(),
            value: value.clone(),
            must: "`cloud` or `depth`, or `auto` where it is the only sensor".to_owned(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
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
    fn sensors_that_cannot_be_are_refused_with_what_they_must_be() {
        let line = |list: &[&str], more: &[(&str, &str)]| config(list, more).unwrap_err();
        assert_eq!(line(&[], &[]), "sensors is []; it must be a list of 1 to 16 names");
        assert!(line(&["a/b"], &[]).contains("`a/b` is none"));
        assert!(line(&[""], &[]).contains("`` is none"));
        assert!(line(&["a", "b", "a"], &[]).contains("`a` stands there twice"));
        assert!(line(&["x"; 17], &[]).contains("1 to 16"));
        assert_eq!(
            line(&["a", "b"], &[("a.kind", "auto")]),
            "a.kind is \"auto\"; it must be `cloud` or `depth`, or `auto` where it is the only sensor"
        );
        assert_eq!(
            line(&["front"], &[("fornt.kind", "depth")]),
            "unknown parameter `fornt.kind` (given as \"depth\"); the nearest known one is `front.kind`"
        );
        assert!(line(&["a"], &[("a.knd", "depth")]).contains("unknown parameter `a.knd`"));
    }

    #[test]
    fn one_map_has_one_noise_model() {
        let model =
            |more: &[(&str, &str)]| config(&["a", "b"], more).map(|config| config.engine.noise_model());
        assert_eq!(model(&[("noise_model", "none")]), Ok(NoiseModel::None));
        let both = [("a.noise_model", "none"), ("b.noise_model", "none")];
        assert_eq!(model(&both), Ok(NoiseModel::None));
        assert_eq!(
            model(&both[1..]).unwrap_err(),
            "b.noise_model is \"none\"; it must be the same as noise_model, which is \"kinect_v1\": one map weighs its \
             points in one way"
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
            let values = Config::values(given.clone()).unwrap();
            assert_eq!(Config::new(values).unwrap(), Config::new(given).unwrap());
        }
    }
}
