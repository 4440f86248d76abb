//! The node's parameters: what was given, by name -> what is checked.
//!
//! [`parameters`] declares each with its default, unit and range; [`Config::new`] turns given values into a [`Config`]
//! or says which one cannot be, with its value and what it must be. Nothing is repaired in silence.

mod sensors;
mod value;

use std::borrow::Cow;
use std::net::IpAddr;
use std::path::PathBuf;
use std::time::Duration;

use thiserror::Error;

pub use self::sensors::{Kind, Sensor};
pub use self::value::Value;
use self::value::{Declared, Given};
use crate::cloud::{CloudFilter, Optical};
use crate::engine::{Params, ParamsError};
use crate::msg::twins::Twins;

/// Everything the node can be told, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// The frame in which the map lives.
    pub fixed_frame: String,
    /// What the map is made from; one at least.
    pub sensors: Vec<Sensor>,
    /// Parameters of the engine.
    pub engine: Params,
    /// Which points of a cloud are taken in.
    pub filter: CloudFilter,
    /// How long a cloud waits for its transform.
    pub tf_timeout: Duration,
    /// Time between two snapshots.
    pub publish_period: Duration,
    /// Addresses of the network interfaces to use; empty = all.
    pub network_interfaces: Vec<IpAddr>,
    /// Bytes to ask for as the socket's receive buffer.
    pub receive_buffer: usize,
    /// Whether `/clock` gives the time.
    pub use_sim_time: bool,
    /// The file that the map is saved in; `None` where it is not.
    pub snapshot_path: Option<PathBuf>,
    /// Time between two savings.
    pub snapshot_period: Duration,
    /// What the clusters are published as, beside our own messages.
    pub twins: Twins,
}

/// A parameter that is unknown, or whose value cannot be.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ConfigError {
    /// No parameter has this name.
    #[error("unknown parameter `{name}` (given as {value}); the nearest known one is `{nearest}`")]
    Unknown {
        /// As given.
        name: String,
        /// As given.
        value: Value,
        /// The known name that differs least.
        nearest: String,
    },
    /// A value of another type than the parameter's.
    #[error("{name} is {value}; it must be {must}")]
    Impossible {
        /// The parameter.
        name: Cow<'static, str>,
        /// As given.
        value: Value,
        /// The values it can have.
        must: String,
    },
    /// A value that the engine cannot work with.
    #[error(transparent)]
    Engine(#[from] ParamsError),
}

/// A declared parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub name: &'static str,
    /// Its value when none is given.
    pub default: Value,
    /// Meaning, unit and range.
    pub about: &'static str,
}

/// All parameters, in the order of the documentation.
pub fn parameters() -> Vec<Parameter> {
    let declare = |(name, default, about): Declared| Parameter { name, default: default(), about };
    value::TABLE.iter().copied().map(declare).collect()
}

impl Config {
    /// Checks the given values, later ones over earlier ones of the same name; the rest have their defaults.
    ///
    /// # Errors
    /// At the first parameter that is unknown or whose value cannot be.
    pub fn new(values: impl IntoIterator<Item = (String, Value)>) -> Result<Self, ConfigError> {
        let given = Given::new(values)?;
        Ok(Self {
            fixed_frame: given.frame("fixed_frame")?,
            sensors: given.sensors()?,
            engine: engine(&given)?,
            filter: filter(&given)?,
            tf_timeout: Duration::from_secs_f64(given.within("tf_timeout", (0.0, 60.0), "s")?),
            publish_period: Duration::from_secs_f64(1.0 / given.within("publish_rate", (0.01, 100.0), "Hz")?),
            network_interfaces: given.addresses("network_interfaces")?,
            receive_buffer: given.integer("receive_buffer", 4096, 1 << 30)? as usize,
            use_sim_time: given.boolean("use_sim_time")?,
            snapshot_path: Some(given.text("snapshot_path")?)
                .filter(|path| !path.is_empty())
                .map(PathBuf::from),
            snapshot_period: Duration::from_secs_f64(given.within(
                "snapshot_period",
                (0.1, 86_400.0),
                "s",
            )?),
            twins: given.twins()?,
        })
    }

    /// The values that this configuration stands for, under their names: what the parameter services show.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn values(
        given: impl IntoIterator<Item = (String, Value)>,
    ) -> Result<Vec<(String, Value)>, ConfigError> {
        Given::new(given)?.into_values()
    }
}

fn engine(given: &Given) -> Result<Params, ConfigError> {
    let whole = |name| given.integer(name, i64::MIN, i64::MAX);
    let real = |name| given.double(name);
    for bound in ["max_voxels", "keep_radius"] {
        given.check_no_bound(bound)?;
    }
    Ok(Params::default()
        .with_mode(given.mode()?)
        .with_noise_model(given.noise_model()?)
        .with_clearing(given.clearing()?)
        .with_max_voxels(whole("max_voxels")?)?
        .with_keep_radius(real("keep_radius")?)?
        .with_voxel_size(real("voxel_size")?)?
        .with_min_points(whole("min_points")?)?
        .with_depth(whole("depth")?)?
        .with_max_normal_angle(real("max_normal_angle")?)?
        .with_min_vicinity(whole("min_vicinity")?)?
        .with_expansion_interval(whole("expansion_interval")?)?)
}

/// No depth sensor sends more, and the sums of a voxel hold as many points of one scan (`engine::consistent`).
const MAX_SCAN_POINTS: i64 = 1 << 24;

/// No depth sensor sees further [m].
const FARTHEST: f64 = 1e6;

fn filter(given: &Given) -> Result<CloudFilter, ConfigError> {
    let min_range = given.within("min_range", (0.0, FARTHEST), "m")?;
    let max_range = given.within("max_range", (0.0, FARTHEST), "m")?;
    if max_range < min_range {
        let must = format!("at least min_range, which is {min_range} m");
        return Err(ConfigError::Impossible {
            name: "max_range".into(),
            value: Value::Double(max_range),
            must,
        });
    }
    let optical = match given.text("optical")? {
        "auto" => Optical::Auto,
        "yes" => Optical::Yes,
        "no" => Optical::No,
        other => {
            let (value, must) = (Value::Text(other.to_owned()), "`auto`, `yes` or `no`".to_owned());
            return Err(ConfigError::Impossible { name: "optical".into(), value, must });
        }
    };
    let max_points = given.integer("max_points", 1, MAX_SCAN_POINTS)? as u32;
    Ok(CloudFilter { min_range, max_range, optical, max_points })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::{Mode, NoiseModel};

    fn with(name: &str, value: Value) -> Result<Config, ConfigError> {
        Config::new([(name.to_owned(), value)])
    }

    fn line(name: &str, value: Value) -> String {
        with(name, value).unwrap_err().to_string()
    }

    #[test]
    fn the_defaults_are_possible_and_those_of_the_engine() {
        let config = Config::new([]).unwrap();
        assert_eq!(config.engine, Params::default());
        assert_eq!(config.fixed_frame, "odom");
        assert_eq!(config.publish_period, Duration::from_millis(500));
        assert_eq!((config.filter.min_range, config.filter.max_range), (0.4, 6.0));
        assert_eq!(config.receive_buffer, 32 << 20);
    }

    #[test]
    fn the_letter_forgets_nothing_and_is_not_told_to() {
        let paper = ("mode", Value::Text("paper".into()));
        let with = |more: &[(&str, Value)]| {
            let given = [std::slice::from_ref(&paper), more].concat();
            Config::new(given.into_iter().map(|(name, value)| (name.to_owned(), value)))
        };
        let values = Config::values([("mode".to_owned(), Value::Text("paper".into()))]).unwrap();
        assert!(values.contains(&("clearing".to_owned(), Value::Boolean(false))));
        assert_eq!(with(&[]).unwrap().engine, Params::paper());
        assert!(with(&[("clearing", Value::Boolean(false))]).is_ok());
        let refused = |more: (&str, Value)| with(&[more]).unwrap_err().to_string();
        assert_eq!(
            refused(("clearing", Value::Boolean(true))),
            "clearing is true; it must be false where mode is `paper`: the letter forgets nothing"
        );
        assert_eq!(
            refused(("max_voxels", Value::Integer(9))),
            "max_voxels is 9; it must be 0 where mode is `paper`: the letter forgets nothing"
        );
        assert_eq!(
            refused(("keep_radius", Value::Double(2.5))),
            "keep_radius is 2.5; it must be 0 where mode is `paper`: the letter forgets nothing"
        );
    }

    #[test]
    fn what_is_given_for_the_consistent_mode_reaches_the_engine() {
        let given = [
            ("noise_model", Value::Text("none".into())),
            ("clearing", Value::Boolean(false)),
            ("max_voxels", Value::Integer(5000)),
            ("keep_radius", Value::Integer(3)),
        ];
        let engine = Config::new(given.map(|(name, value)| (name.to_owned(), value))).unwrap().engine;
        assert_eq!((engine.mode(), engine.noise_model()), (Mode::Consistent, NoiseModel::None));
        assert_eq!((engine.clearing(), engine.max_voxels(), engine.keep_radius()), (false, 5000, 3.0));
    }

    #[test]
    fn an_unknown_name_gets_the_nearest_known_one() {
        let text = line("voxelsize", Value::Double(0.05));
        assert_eq!(
            text,
            "unknown parameter `voxelsize` (given as 0.05); the nearest known one is `voxel_size`"
        );
    }

    #[test]
    fn an_impossible_value_is_named_with_what_it_must_be() {
        assert_eq!(line("depth", Value::Integer(9)), "depth is 9; it must be from 1 to 8");
        assert_eq!(
            line("voxel_size", Value::Double(-1.0)),
            "voxel_size is -1 m; it must be finite and above 0"
        );
        assert_eq!(line("depth", Value::Text("deep".into())), "depth is \"deep\"; it must be an integer");
        assert_eq!(line("use_sim_time", Value::Integer(1)), "use_sim_time is 1; it must be true or false");
        assert_eq!(
            line("optical", Value::Text("no!".into())),
            "optical is \"no!\"; it must be `auto`, `yes` or `no`"
        );
        assert_eq!(
            line("max_range", Value::Double(0.1)),
            "max_range is 0.1; it must be at least min_range, which is 0.4 m"
        );
        assert_eq!(
            line("publish_rate", Value::Double(0.0)),
            "publish_rate is 0; it must be from 0.01 to 100 Hz"
        );
        assert_eq!(
            line("tf_timeout", Value::Double(f64::NAN)),
            "tf_timeout is NaN; it must be from 0 to 60 s"
        );
        assert_eq!(
            line("fixed_frame", Value::Text("/".into())),
            "fixed_frame is \"/\"; it must be the name of a frame, of at most 256 bytes"
        );
        assert_eq!(
            line("mode", Value::Text("fast".into())),
            "mode is \"fast\"; it must be `consistent` or `paper`"
        );
        assert_eq!(
            line("noise_model", Value::Text("kinect_v2".into())),
            "noise_model is \"kinect_v2\"; it must be `kinect_v1` or `none`"
        );
        assert_eq!(
            line("max_voxels", Value::Integer(-1)),
            "max_voxels is -1; it must be 0 (no bound) or more"
        );
        assert_eq!(
            line("keep_radius", Value::Integer(-1)),
            "keep_radius is -1 m; it must be finite and 0 (no bound) or more"
        );
        let addresses = Value::TextList(vec!["127.0.0.1".into(), "eth0".into()]);
        assert!(line("network_interfaces", addresses).contains("IP addresses"));
    }

    #[test]
    fn twins_are_sent_where_asked_and_a_misspelt_one_gets_the_nearest() {
        let twins = |names: &[&str]| Value::TextList(names.iter().copied().map(str::to_owned).collect());
        assert_eq!(Config::new([]).unwrap().twins, Twins::default());
        assert_eq!(with("twins", Value::Text(String::new())).unwrap().twins, Twins::default());
        let both = with("twins", twins(&["polygons", "detections"])).unwrap().twins;
        assert_eq!(both, Twins { detections: true, polygons: true });
        assert_eq!(
            line("twins", twins(&["detection"])),
            "twins is [\"detection\"]; it must be out of `detections` and `polygons`; the nearest to \"detection\" is \
             `detections`"
        );
        assert_eq!(
            line("twins", Value::Text("polygons".into())),
            "twins is \"polygons\"; it must be a list of texts, as [\"detections\"]"
        );
        let paper = |names| {
            let given = [("mode", Value::Text("paper".into())), ("twins", twins(names))];
            Config::new(given.map(|(name, value)| (name.to_owned(), value)))
        };
        assert!(paper(&["detections"]).unwrap().twins.detections);
        let refused = paper(&["polygons"]).unwrap_err().to_string();
        assert!(
            refused.ends_with("without `polygons` where mode is `paper`: it knows no outlines"),
            "{refused}"
        );
    }

    #[test]
    fn every_parameter_takes_values_of_every_type_and_size_without_a_panic() {
        let text = |text: &str| Value::Text(text.to_owned());
        let mut values =
            vec![Value::Boolean(true), Value::TextList(Vec::new()), text(""), text("\0\u{1b}[31m")];
        values.extend([text(&"x".repeat(1 << 20)), Value::TextList(vec![String::new(); 1000])]);
        values.extend([i64::MIN, -1, 0, 1, 1 << 31, 1 << 32, i64::MAX].map(Value::Integer));
        let ends = [0.0, -0.0, f64::MIN_POSITIVE / 2.0, 1e-9, 1.0, 1e300, f64::MAX, f64::INFINITY, f64::NAN];
        values.extend(ends.into_iter().flat_map(|x| [x, -x]).map(Value::Double));
        for parameter in parameters() {
            let taken = values.iter().filter(|value| with(parameter.name, (*value).clone()).is_ok());
            for value in taken {
                let refused = matches!(value, Value::Double(x) if !x.is_finite());
                assert!(!refused, "{} takes {value}", parameter.name);
            }
        }
    }

    #[test]
    fn bounds_of_memory_cannot_be_given_away() {
        assert_eq!(
            line("max_points", Value::Integer(1 << 25)),
            "max_points is 33554432; it must be from 1 to 16777216"
        );
        let long = line("fixed_frame", Value::Text("x".repeat(257)));
        assert!(long.ends_with("it must be the name of a frame, of at most 256 bytes"), "{long}");
        assert!(line("receive_buffer", Value::Integer((1 << 30) + 1)).contains("from 4096 to 1073741824"));
        assert!(line("tf_timeout", Value::Double(1e9)).contains("from 0 to 60 s"));
    }

    #[test]
    fn an_integer_is_taken_for_a_double_and_the_last_value_counts() {
        let values = [("voxel_size", Value::Double(0.3)), ("voxel_size", Value::Integer(1))];
        let config = Config::new(values.map(|(name, value)| (name.to_owned(), value))).unwrap();
        assert!((config.engine.voxel_size() - 1.0).abs() < f64::EPSILON);
    }

    #[test]
    fn a_leading_slash_of_a_frame_is_dropped() {
        assert_eq!(with("fixed_frame", Value::Text("/map".into())).unwrap().fixed_frame, "map");
    }
}
