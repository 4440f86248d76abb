//! Values of parameters, their declaration, and typed access to what was given.

use std::collections::BTreeMap;
use std::fmt;
use std::net::IpAddr;

use super::ConfigError;
use super::sensors::{self, Sensor};
use crate::engine::{Mode, NoiseModel};
use crate::msg::ros::MAX_FRAME_ID_BYTES;
use crate::msg::twins::Twins;

/// A parameter's value, of the ROS parameter types that are used here.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// `bool`.
    Boolean(bool),
    /// `integer`.
    Integer(i64),
    /// `double`.
    Double(f64),
    /// `string`.
    Text(String),
    /// `string_array`.
    TextList(Vec<String>),
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Boolean(value) => value.fmt(f),
            Self::Integer(value) => value.fmt(f),
            Self::Double(value) => value.fmt(f),
            Self::Text(value) => write!(f, "{value:?}"),
            Self::TextList(value) => write!(f, "{value:?}"),
        }
    }
}

/// Name, default, and meaning with unit and range.
pub(super) type Declared = (&'static str, fn() -> Value, &'static str);

pub(super) const TABLE: &[Declared] = &[
    ("fixed_frame", || Value::Text("odom".to_owned()), "frame in which the map lives"),
    (
        "mode",
        || Value::Text("consistent".to_owned()),
        "`consistent`: clusters as one definition has them, whatever the order of the scans; `paper`: CFODI to the letter",
    ),
    ("voxel_size", || Value::Double(0.08), "edge of a voxel, the paper's xi [m], above 0"),
    ("min_points", || Value::Integer(15), "points that make a voxel dense, the paper's tau, 1 or more"),
    ("depth", || Value::Integer(4), "steps that a neighbourhood reaches, in mode `paper`: its d, 1 to 8"),
    (
        "max_normal_angle",
        || Value::Double(0.53),
        "largest angle between similar normals, theta [rad], 0 to pi/2; mode `consistent` takes 0.17 at most, and 0.4 for \
         what is rough or badly known",
    ),
    (
        "min_vicinity",
        || Value::Integer(1),
        "least vicinity of an absorption, in mode `paper`: its minUnits [pairs], 1 or more",
    ),
    ("expansion_interval", || Value::Integer(10), "scans without growth until complete, delta; 0 = never"),
    (
        "noise_model",
        || Value::Text("kinect_v1".to_owned()),
        "what depths scatter by, in mode `consistent`: `kinect_v1`, `none`",
    ),
    (
        "clearing",
        || Value::Boolean(true),
        "whether what the sensor looks through is forgotten; always false in mode `paper`",
    ),
    ("max_voxels", || Value::Integer(0), "most voxels that hold points, in mode `consistent`; 0 = no bound"),
    (
        "keep_radius",
        || Value::Double(0.0),
        "how far from the sensor voxels are kept [m], in mode `consistent`; 0 = no bound",
    ),
    ("max_range", || Value::Double(6.0), "furthest point [m]: depth in an optical frame, else distance"),
    ("min_range", || Value::Double(0.4), "nearest point [m]: depth in an optical frame, else distance"),
    (
        "optical",
        || Value::Text("auto".to_owned()),
        "whether clouds have optical axes: `auto` (by frame id), `yes`, `no`",
    ),
    (
        "max_points",
        || Value::Integer(4_000_000),
        "most points of one scan, 1 to 2^24; a larger one is refused",
    ),
    (
        "network_interfaces",
        || Value::TextList(Vec::new()),
        "own IPv4 addresses to be found under; empty = all",
    ),
    (
        "receive_buffer",
        || Value::Integer(32 << 20),
        "receive buffer to ask of the system [bytes], 4096 to 2^30",
    ),
    ("tf_timeout", || Value::Double(0.2), "how long a cloud waits for its transform [s], 0 to 60"),
    ("publish_rate", || Value::Double(2.0), "snapshots, markers and labelled points [Hz], 0.01 to 100"),
    (
        "twins",
        || Value::TextList(Vec::new()),
        "what the clusters are published as beside: `detections`, `polygons`",
    ),
    (
        "snapshot_path",
        || Value::Text(String::new()),
        "file that `run` saves the map in, at its end too; empty = none",
    ),
    ("snapshot_period", || Value::Double(60.0), "time between two savings of the map [s], 0.1 to 86400"),
    (
        "sensors",
        || Value::TextList(vec!["points".to_owned()]),
        "what the map is made from, 1 to 16 names; `<name>.kind` is `cloud` (on the topic `<name>`) or `depth` (on \
         `<name>/image` and `<name>/camera_info`), and for `points` alone `auto`: clouds on `points` or depth images on \
         `depth/image`, whichever come first; `<name>.noise_model` is as `noise_model`, and the same for all",
    ),
    ("use_sim_time", || Value::Boolean(false), "whether /clock gives the time"),
];

/// The value of each parameter, given or default; names are known, types are not yet checked.
pub(super) struct Given {
    values: BTreeMap<&'static str, Value>,
    /// What was given of single sensors, by full name.
    of_sensors: BTreeMap<String, Value>,
}

impl Given {
    pub(super) fn new(values: impl IntoIterator<Item = (String, Value)>) -> Result<Self, ConfigError> {
        let mut given: BTreeMap<_, _> = TABLE.iter().map(|(name, default, _)| (*name, default())).collect();
        let mut of_sensors = BTreeMap::new();
        let mut cleared = false;
        for (name, value) in values {
            if sensors::of_sensor(&name).is_some() {
                of_sensors.insert(name, value);
                continue;
            }
            let known = given.get_key_value(name.as_str()).map(|(known, _)| *known);
            let Some(known) = known else {
                return Err(ConfigError::Unknown { nearest: nearest(&name, &[]), name, value });
            };
            cleared |= known == "clearing";
            given.insert(known, value);
        }
        if !cleared && given["mode"] == Value::Text("paper".to_owned()) {
            given.insert("clearing", Value::Boolean(false));
        }
        let given = Self { values: given, of_sensors };
        given.check_names_of_sensors()?;
        Ok(given)
    }

    /// That only sensors which are listed have parameters.
    fn check_names_of_sensors(&self) -> Result<(), ConfigError> {
        let Value::TextList(list) = self.get("sensors") else { return Ok(()) };
        let is_listed = |name: &str| {
            sensors::of_sensor(name).is_some_and(|(sensor, _)| list.iter().any(|listed| listed == sensor))
        };
        match self.of_sensors.iter().find(|(name, _)| !is_listed(name)) {
            None => Ok(()),
            Some((name, value)) => Err(ConfigError::Unknown {
                nearest: nearest(name, list),
                name: name.clone(),
                value: value.clone(),
            }),
        }
    }

    pub(super) fn into_values(self) -> Result<Vec<(String, Value)>, ConfigError> {
        let noise_model = self.get("noise_model").clone();
        let mut values = Vec::new();
        for Sensor { name, kind } in self.sensors()? {
            let of_sensor = |what: &str| self.of_sensors.get(&format!("{name}.{what}")).cloned();
            let kind = of_sensor("kind").unwrap_or_else(|| Value::Text(kind.as_str().to_owned()));
            let noise_model = of_sensor("noise_model").unwrap_or_else(|| noise_model.clone());
            values.extend([(format!("{name}.kind"), kind), (format!("{name}.noise_model"), noise_model)]);
        }
        let as_declared = |(name, value): (&'static str, Value)| match (declared(name), value) {
            (Some(Value::Double(_)), Value::Integer(value)) => (name.to_owned(), Value::Double(value as f64)),
            (_, value) => (name.to_owned(), value),
        };
        values.extend(self.values.into_iter().map(as_declared));
        Ok(values)
    }

    pub(super) fn sensors(&self) -> Result<Vec<Sensor>, ConfigError> {
        match self.get("sensors") {
            Value::TextList(list) => sensors::sensors(list, &self.of_sensors),
            _ => self.refuse("sensors", "a list of names, as [\"front\", \"rear\"]"),
        }
    }

    fn get(&self, name: &'static str) -> &Value {
        // Only names of the table are asked for.
        &self.values[name]
    }

    fn refuse<T>(&self, name: &'static str, must: impl Into<String>) -> Result<T, ConfigError> {
        Err(ConfigError::Impossible { name: name.into(), value: self.get(name).clone(), must: must.into() })
    }

    pub(super) fn boolean(&self, name: &'static str) -> Result<bool, ConfigError> {
        if let Value::Boolean(value) = self.get(name) {
            Ok(*value)
        } else {
            self.refuse(name, "true or false")
        }
    }

    pub(super) fn integer(&self, name: &'static str, least: i64, most: i64) -> Result<i64, ConfigError> {
        match *self.get(name) {
            Value::Integer(value) if (least..=most).contains(&value) => Ok(value),
            Value::Integer(_) => self.refuse(name, format!("from {least} to {most}")),
            _ => self.refuse(name, "an integer"),
        }
    }

    pub(super) fn double(&self, name: &'static str) -> Result<f64, ConfigError> {
        match *self.get(name) {
            Value::Double(value) => Ok(value),
            // A number without a point is an integer to YAML, and meant as a double here.
            Value::Integer(value) => Ok(value as f64),
            _ => self.refuse(name, "a number"),
        }
    }

    /// A double within bounds; `unit` stands in what is said when it is not.
    pub(super) fn within(
        &self,
        name: &'static str,
        (least, most): (f64, f64),
        unit: &str,
    ) -> Result<f64, ConfigError> {
        let value = self.double(name)?;
        if (least..=most).contains(&value) {
            Ok(value)
        } else {
            self.refuse(name, format!("from {least} to {most} {unit}"))
        }
    }

    pub(super) fn text(&self, name: &'static str) -> Result<&str, ConfigError> {
        if let Value::Text(value) = self.get(name) { Ok(value) } else { self.refuse(name, "a text") }
    }

    pub(super) fn frame(&self, name: &'static str) -> Result<String, ConfigError> {
        let frame = self.text(name)?.trim_start_matches('/');
        if frame.is_empty() || frame.len() > MAX_FRAME_ID_BYTES {
            return self.refuse(name, format!("the name of a frame, of at most {MAX_FRAME_ID_BYTES} bytes"));
        }
        Ok(frame.to_owned())
    }

    pub(super) fn addresses(&self, name: &'static str) -> Result<Vec<IpAddr>, ConfigError> {
        let addresses = match self.get(name) {
            Value::TextList(list) => list.iter().map(|text| text.parse()).collect::<Result<_, _>>().ok(),
            // What an empty list looks like where its type cannot be told.
            Value::Text(text) if text.is_empty() => Some(Vec::new()),
            _ => None,
        };
        addresses.map_or_else(|| self.refuse(name, "a list of IP addresses, as [\"192.168.1.5\"]"), Ok)
    }

    pub(super) fn twins(&self) -> Result<Twins, ConfigError> {
        let names = match self.get("twins") {
            Value::TextList(names) => names.as_slice(),
            // As with addresses.
            Value::Text(text) if text.is_empty() => &[],
            _ => return self.refuse("twins", "a list of texts, as [\"detections\"]"),
        };
        let mut twins = Twins::default();
        for name in names {
            match name.as_str() {
                "detections" => twins.detections = true,
                "polygons" => twins.polygons = true,
                _ => {
                    let nearest = nearest_of(["detections", "polygons"], name).unwrap_or_default();
                    return self.refuse(
                        "twins",
                        format!("out of `detections` and `polygons`; the nearest to {name:?} is `{nearest}`"),
                    );
                }
            }
        }
        if twins.polygons && self.mode()? == Mode::Paper {
            return self.refuse("twins", "without `polygons` where mode is `paper`: it knows no outlines");
        }
        Ok(twins)
    }

    pub(super) fn mode(&self) -> Result<Mode, ConfigError> {
        match self.text("mode")? {
            "consistent" => Ok(Mode::Consistent),
            "paper" => Ok(Mode::Paper),
            _ => self.refuse("mode", "`consistent` or `paper`"),
        }
    }

    /// That of all sensors: the map's weights mean one thing.
    pub(super) fn noise_model(&self) -> Result<NoiseModel, ConfigError> {
        let of_all = ("noise_model".to_owned(), self.get("noise_model"));
        let of_sensor = |sensor: Sensor| {
            let name = sensor.name + ".noise_model";
            self.of_sensors.get(&name).map_or_else(|| of_all.clone(), |value| (name, value))
        };
        let mut models = self.sensors()?.into_iter().map(of_sensor);
        let (first, value) = models.next().unwrap_or_else(|| of_all.clone());
        let model = one_noise_model(&first, value)?;
        for (name, other) in models {
            if one_noise_model(&name, other)? != model {
                let must =
                    format!("the same as {first}, which is {value}: one map weighs its points in one way");
                return Err(ConfigError::Impossible { name: name.into(), value: other.clone(), must });
            }
        }
        one_noise_model(&of_all.0, of_all.1).map(|_| model)
    }

    pub(super) fn clearing(&self) -> Result<bool, ConfigError> {
        let clearing = self.boolean("clearing")?;
        if clearing && self.mode()? == Mode::Paper {
            return self.refuse("clearing", "false where mode is `paper`: the letter forgets nothing");
        }
        Ok(clearing)
    }

    /// A bound that only the mode `consistent` has: 0 in the other.
    pub(super) fn check_no_bound(&self, name: &'static str) -> Result<(), ConfigError> {
        if self.mode()? == Mode::Paper && self.double(name)? > 0.0 {
            return self.refuse(name, "0 where mode is `paper`: the letter forgets nothing");
        }
        Ok(())
    }
}

fn one_noise_model(name: &str, value: &Value) -> Result<NoiseModel, ConfigError> {
    let must = match value {
        Value::Text(model) if model == "kinect_v1" => return Ok(NoiseModel::KinectV1),
        Value::Text(model) if model == "none" => return Ok(NoiseModel::None),
        Value::Text(_) => "`kinect_v1` or `none`",
        _ => "a text",
    };
    Err(ConfigError::Impossible { name: name.to_owned().into(), value: value.clone(), must: must.to_owned() })
}

fn declared(name: &str) -> Option<Value> {
    TABLE.iter().find(|declared| declared.0 == name).map(|declared| declared.1())
}

/// The known name that differs least; `list` are the sensors.
fn nearest(name: &str, list: &[String]) -> String {
    let of_sensors =
        list.iter().flat_map(|sensor| ["kind", "noise_model"].map(|what| format!("{sensor}.{what}")));
    nearest_of(TABLE.iter().map(|declared| declared.0.to_owned()).chain(of_sensors), name).unwrap_or_default()
}

fn nearest_of<T: AsRef<str>>(known: impl IntoIterator<Item = T>, name: &str) -> Option<T> {
    known.into_iter().min_by_key(|known| strsim::damerau_levenshtein(known.as_ref(), name))
}
