//! The one table of parameters: default, bounds, unit, meaning, and whether a value can change while the node runs.
//!
//! What is checked, what is said of a wrong value and what the parameter services describe all come from here.

use std::f64::consts::FRAC_PI_2;
use std::ops::RangeInclusive;

use super::Value;
use super::sensors::{Kind, MAX_SENSOR_NAME_BYTES, MOST_SENSORS};
use super::word::Word;
use crate::cloud::{CloudFilter, Optical};
use crate::engine::{self, Mode, NoiseModel, Params};
use crate::msg::ros::MAX_FRAME_ID_BYTES;

/// What a value can be beside its type; both ends are possible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bounds {
    /// Whatever the type holds.
    Any,
    /// Integers from ... to ...
    Integers(i64, i64),
    /// Numbers from ... to ...
    Numbers(f64, f64),
    /// One of these texts.
    OneOf(&'static [&'static str]),
    /// What these words say; checked where the value is read.
    Words(&'static str),
}

/// When a parameter takes a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Change {
    /// At any time.
    Live,
    /// At any time in mode `consistent`.
    LiveInConsistent,
    /// When the node starts; why not later.
    AtStart(&'static str),
}

/// Default values, in a form that a constant can have.
#[derive(Clone, Copy, Debug)]
enum Default {
    Boolean(bool),
    Integer(i64),
    Double(f64),
    Text(&'static str),
    Texts(&'static [&'static str]),
}

/// A line of the table.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub(super) name: &'static str,
    default: Default,
    pub(super) bounds: Bounds,
    unit: &'static str,
    /// What 0 stands for.
    zero: &'static str,
    about: &'static str,
    /// What its value must be beside that of another parameter.
    pub(super) also: &'static str,
    pub(super) change: Change,
}

/// A declared parameter.
#[derive(Clone, Debug)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    pub(super) row: &'static Row,
}

impl Parameter {
    /// Its value when none is given, which tells its type.
    pub fn default(&self) -> Value {
        self.row.default()
    }

    /// Meaning and unit.
    pub fn description(&self) -> String {
        match self.row.unit {
            "" => self.row.about.to_owned(),
            unit => format!("{} [{unit}]", self.row.about),
        }
    }

    /// What its value can be.
    pub const fn bounds(&self) -> Bounds {
        self.row.bounds
    }

    /// What [`Self::bounds`] cannot say of its value by two numbers; may be empty.
    pub fn constraints(&self) -> String {
        let Row { bounds, zero, also, .. } = self.row;
        let zero = if zero.is_empty() { String::new() } else { format!("0 = {zero}") };
        let words = match bounds {
            Bounds::OneOf(_) | Bounds::Words(_) => self.row.must(),
            Bounds::Any | Bounds::Integers(..) | Bounds::Numbers(..) => zero,
        };
        [words.as_str(), also].into_iter().filter(|words| !words.is_empty()).collect::<Vec<_>>().join("; ")
    }
}

impl Row {
    const fn new(name: &'static str, default: Default, bounds: Bounds) -> Self {
        let change = Change::AtStart("");
        Self { name, default, bounds, unit: "", zero: "", about: "", also: "", change }
    }

    const fn integer(name: &'static str, default: i64, bounds: &RangeInclusive<i64>) -> Self {
        Self::new(name, Default::Integer(default), Bounds::Integers(*bounds.start(), *bounds.end()))
    }

    const fn number(name: &'static str, default: f64, bounds: &RangeInclusive<f64>) -> Self {
        Self::new(name, Default::Double(default), Bounds::Numbers(*bounds.start(), *bounds.end()))
    }

    const fn boolean(name: &'static str, default: bool) -> Self {
        Self::new(name, Default::Boolean(default), Bounds::Any)
    }

    const fn text(name: &'static str, default: &'static str, bounds: Bounds) -> Self {
        Self::new(name, Default::Text(default), bounds)
    }

    /// One of the words of a type.
    const fn word<T: Word>(name: &'static str) -> Self {
        Self::text(name, T::DEFAULT, Bounds::OneOf(T::WORDS))
    }

    const fn unit(self, unit: &'static str) -> Self {
        Self { unit, ..self }
    }

    const fn zero(self, zero: &'static str) -> Self {
        Self { zero, ..self }
    }

    const fn also(self, also: &'static str) -> Self {
        Self { also, ..self }
    }

    /// What it means; the last word of a line of the table.
    const fn means(self, about: &'static str, change: Change) -> Self {
        Self { about, change, ..self }
    }

    pub(super) fn default(&self) -> Value {
        match self.default {
            Default::Boolean(value) => Value::Boolean(value),
            Default::Integer(value) => Value::Integer(value),
            Default::Double(value) => Value::Double(value),
            Default::Text(value) => Value::Text(value.to_owned()),
            Default::Texts(texts) => Value::TextList(texts.iter().map(|text| (*text).to_owned()).collect()),
        }
    }

    /// The value as one of the parameter's type, where it is meant as one: a number without a point is an integer to YAML,
    /// `yes` is a boolean, as which `ros2 param set` sends it, and an empty list is told by nothing but its type.
    pub(super) fn as_declared(&self, value: Value) -> Value {
        match (self.default, value) {
            (Default::Double(_), Value::Integer(value)) => Value::Double(value as f64),
            (Default::Text(_), Value::Boolean(value)) => match self.bounds {
                Bounds::OneOf(texts) if texts.contains(&yes_or_no(value)) => {
                    Value::Text(yes_or_no(value).to_owned())
                }
                _ => Value::Boolean(value),
            },
            (Default::Texts(_), Value::Text(text)) if text.is_empty() => Value::TextList(Vec::new()),
            (_, value) => value,
        }
    }

    pub(super) const fn is_boolean(&self) -> bool {
        matches!(self.default, Default::Boolean(_))
    }

    /// What the value must be, where `value` is not: its type first. `None` is a value of a type that no parameter has.
    pub(super) fn refusal(&self, value: Option<&Value>) -> Option<String> {
        let type_must = |words: &str| Some(words.to_owned());
        match (self.default, value) {
            (Default::Boolean(_), Some(Value::Boolean(_)))
            | (Default::Texts(_), Some(Value::TextList(_))) => None,
            (Default::Integer(_), Some(Value::Integer(value))) => {
                let Bounds::Integers(least, most) = self.bounds else { return None };
                (!(least..=most).contains(value)).then(|| self.must())
            }
            (Default::Double(_), Some(Value::Double(value))) => {
                let possible = match self.bounds {
                    Bounds::Numbers(least, most) => (least..=most).contains(value),
                    _ => true,
                };
                (!possible).then(|| self.must())
            }
            (Default::Text(_), Some(Value::Text(value))) => {
                let Bounds::OneOf(texts) = self.bounds else { return None };
                (!texts.contains(&value.as_str())).then(|| self.must())
            }
            (Default::Boolean(_), _) => type_must("true or false"),
            // YAML reads an integer that fits in no 64 bits as a number.
            (Default::Integer(_), Some(Value::Double(value))) if value.abs() >= i64::MAX as f64 => {
                Some(self.must())
            }
            (Default::Integer(_), _) => type_must("an integer"),
            (Default::Double(_), _) => type_must("a number"),
            (Default::Text(_), _) if self.bounds == Bounds::Any => type_must("a text"),
            (Default::Text(_) | Default::Texts(_), _) => Some(self.must()),
        }
    }

    /// The bounds in words.
    pub(super) fn must(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        let zero = if self.zero.is_empty() { String::new() } else { format!(" ({})", self.zero) };
        match self.bounds {
            Bounds::Any => String::new(),
            Bounds::Integers(least, i64::MAX) => format!("{least}{unit}{zero} or more"),
            Bounds::Integers(least, most) => format!("from {least}{zero} to {most}{unit}"),
            Bounds::Numbers(LEAST, f64::MAX) => format!("finite and above 0{unit}"),
            Bounds::Numbers(least, f64::MAX) => format!("finite and {least}{unit}{zero} or more"),
            Bounds::Numbers(least, FRAC_PI_2) => format!("from {least}{zero} to pi/2{unit}"),
            Bounds::Numbers(least, most) => format!("from {least}{zero} to {most}{unit}"),
            Bounds::OneOf(texts) => match texts {
                [rest @ .., last] if !rest.is_empty() => format!("`{}` or `{last}`", rest.join("`, `")),
                _ => format!("`{}`", texts.join("`")),
            },
            Bounds::Words(words) => words.to_owned(),
        }
    }
}

const fn yes_or_no(value: bool) -> &'static str {
    if value { "yes" } else { "no" }
}

/// No depth sensor sends more, and the sums of a voxel hold as many points of one scan (`engine::consistent`).
const MAX_SCAN_POINTS: i64 = 1 << 24;

/// The least number above 0.
const LEAST: f64 = f64::from_bits(1);

/// No depth sensor sees further [m].
const FARTHEST: f64 = 1e6;

/// Defaults.
const ENGINE: Params = Params::DEFAULT;
const FILTER: CloudFilter = CloudFilter::DEFAULT;

const MAP: Change = Change::AtStart("the map is made with it");
const NETWORK: Change = Change::AtStart("the network is joined with it");

pub(super) const FORGETS_NOTHING: &str = "0 where mode is `paper`, which forgets nothing";

const FRAME: Bounds = {
    assert!(MAX_FRAME_ID_BYTES == 256, "the words below say so");
    Bounds::Words("the name of a frame, of at most 256 bytes")
};

const SENSORS: Bounds = {
    assert!(MOST_SENSORS == 16 && MAX_SENSOR_NAME_BYTES == 64, "the words below say so");
    Bounds::Words(
        "a list of 1 to 16 names that differ, from each other and from those of parameters, each a letter and then letters, \
         digits and underscores, 64 at most, as [\"front\", \"rear\"]",
    )
};

/// Of each sensor, below its name; what is not given follows from the others.
pub(super) const OF_SENSOR: &[Row] = &[
    Row::word::<Kind>("kind")
        .also("`auto` only for a sensor that is alone")
        .means(
            "what it sends: `cloud` on `<name>`, `depth` on `<name>/image` with `<name>/camera_info`, `auto` either of \
             clouds on `<name>` and depth images on `depth/image`, whichever come first",
            NETWORK,
        ),
    Row::word::<NoiseModel>("noise_model")
        .also("as `noise_model` and the same for all sensors: one map weighs its points in one way")
        .means("what its depths scatter by, in mode `consistent`; as `noise_model`, which follows it where not given", MAP),
];

/// In the order of the documentation.
pub(super) const TABLE: &[Row] = &[
    Row::text("fixed_frame", "odom", FRAME).means("frame in which the map lives, its z up", MAP),
    Row::word::<Mode>("mode").means(
        "`consistent`: clusters as one definition has them, whatever the order of the scans; `paper`: CFODI to the letter",
        MAP,
    ),
    Row::number("voxel_size", ENGINE.voxel_size(), &engine::VOXEL_SIZE)
        .unit("m")
        .means("edge of a voxel, the paper's xi", MAP),
    Row::integer("min_points", ENGINE.min_points() as i64, &engine::MIN_POINTS)
        .means("points that make a voxel dense, the paper's tau", MAP),
    Row::integer("depth", ENGINE.depth() as i64, &engine::DEPTH)
        .means("steps that a neighbourhood reaches, in mode `paper`: its d", MAP),
    Row::number("max_normal_angle", ENGINE.max_normal_angle(), &engine::MAX_NORMAL_ANGLE).unit("rad").means(
        "largest angle between similar normals, theta; mode `consistent` takes 0.17 at most, and 0.4 for what is rough or \
         badly known",
        MAP,
    ),
    Row::integer("min_vicinity", ENGINE.min_vicinity() as i64, &engine::MIN_VICINITY)
        .unit("pairs")
        .means("least vicinity of an absorption, in mode `paper`: its minUnits", MAP),
    Row::integer("expansion_interval", ENGINE.expansion_interval() as i64, &engine::EXPANSION_INTERVAL)
        .unit("scans")
        .zero("never complete")
        .means("time without growth until a cluster is complete, delta", Change::LiveInConsistent),
    Row::word::<NoiseModel>("noise_model").means("what depths scatter by, in mode `consistent`", MAP),
    Row::number("pose_sigma", ENGINE.pose_sigma(), &engine::POSE_SIGMA)
        .unit("m")
        .also("at most voxel_size")
        .means(
            "by how much the poses on `/tf` put a surface off its place, as a standard deviation, in mode `consistent`",
            MAP,
        ),
    Row::boolean("clearing", ENGINE.clearing())
        .also("false where mode is `paper`, which forgets nothing")
        .means("whether what the sensor looks through is forgotten", Change::LiveInConsistent),
    Row::integer("max_voxels", ENGINE.max_voxels() as i64, &engine::MAX_VOXELS)
        .zero("no bound")
        .also(FORGETS_NOTHING)
        .means("most voxels that hold points, in mode `consistent`", Change::LiveInConsistent),
    Row::number("keep_radius", ENGINE.keep_radius(), &engine::KEEP_RADIUS)
        .unit("m")
        .zero("no bound")
        .also("at least min_range where it is not 0; 0 where mode is `paper`, which forgets nothing")
        .means("how far from the sensor voxels are kept, in mode `consistent`", Change::LiveInConsistent),
    Row::number("max_range", FILTER.max_range, &(0.0..=FARTHEST))
        .unit("m")
        .also("at least min_range")
        .means("furthest point: depth in an optical frame, else distance", Change::Live),
    Row::number("min_range", FILTER.min_range, &(0.0..=FARTHEST))
        .unit("m")
        .also("at most max_range, and keep_radius where that is not 0")
        .means("nearest point: depth in an optical frame, else distance", Change::Live),
    Row::word::<Optical>("optical")
        .means("whether clouds have optical axes; `auto`: their frame's name tells", Change::Live),
    Row::integer("max_points", FILTER.max_points as i64, &(1..=MAX_SCAN_POINTS))
        .means("most points of one scan; a larger one is refused", Change::Live),
    Row::new(
        "network_interfaces",
        Default::Texts(&[]),
        Bounds::Words(
            "a list of IPv4 addresses that a machine can have, as [\"192.168.1.5\"]",
        ),
    )
    .means("own IPv4 addresses to be found under; empty = all", NETWORK),
    Row::integer("receive_buffer", 32 << 20, &(4096..=1 << 30))
        .unit("bytes")
        .means("receive buffer to ask of the system", NETWORK),
    Row::number("tf_timeout", 0.2, &(0.0..=60.0))
        .unit("s")
        .means("how long a cloud waits for its transform", Change::Live),
    Row::number("publish_rate", 2.0, &(0.01..=100.0))
        .unit("Hz")
        .means("how often snapshots, markers and labelled points are sent", Change::Live),
    Row::new("twins", Default::Texts(&[]), Bounds::Words("a list of texts, as [\"detections\"]"))
        .also("without `polygons` where mode is `paper`: it knows no outlines")
        .means("what the clusters are published as beside: `detections`, `polygons`; empty = none", NETWORK),
    Row::text("snapshot_path", "", Bounds::Any).means(
        "file that `run` saves the map in, at its end too; empty = none",
        Change::AtStart("the file is locked with it"),
    ),
    Row::number("snapshot_period", 60.0, &(0.1..=86_400.0))
        .unit("s")
        .means("time between two savings of the map", Change::Live),
    Row::new("sensors", Default::Texts(&["points"]), SENSORS)
        .means("names of what the map is made from; each has `<name>.kind` and `<name>.noise_model`", NETWORK),
    Row::boolean("use_sim_time", false)
        .means("whether /clock gives the time", Change::AtStart("/clock is subscribed with it")),
];
