//! Values of parameters, and typed access to what was given.

use std::collections::BTreeMap;
use std::fmt;
use std::net::Ipv4Addr;

use super::ConfigError;
use super::sensors::{self, Kind, Sensor};
use super::table::{FORGETS_NOTHING, Row, TABLE};
use super::word::Word;
use crate::engine::{Mode, NoiseModel};
use crate::msg::ros::{MAX_FRAME_ID_BYTES, bare};
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
            // 15.0 is not 15, and 1e300 no 301 digits.
            Self::Double(value) => write!(f, "{value:?}"),
            Self::Text(value) => write!(f, "{value:?}"),
            Self::TextList(value) => write!(f, "{value:?}"),
        }
    }
}

/// What YAML 1.1 takes for booleans, as ROS reads it.
const TRUE: [&str; 11] = ["y", "Y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"];
const FALSE: [&str; 11] = ["n", "N", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"];

/// The value of a parameter as it stands in a file or on a command line: `on` is a boolean where the parameter is one, and
/// stays a text where it is not.
pub fn as_meant(name: &str, value: Value) -> Value {
    let is_boolean = TABLE.iter().any(|row| row.name == name && row.is_boolean());
    match value {
        Value::Text(text) if is_boolean && TRUE.contains(&text.as_str()) => Value::Boolean(true),
        Value::Text(text) if is_boolean && FALSE.contains(&text.as_str()) => Value::Boolean(false),
        value => value,
    }
}

/// The value of each parameter, given or default; names are known, types are not yet checked.
pub(super) struct Given {
    values: BTreeMap<String, (Value, &'static Row)>,
    /// Of each that was given a value, how many were given before it.
    told: BTreeMap<String, usize>,
}

impl Given {
    pub(super) fn new(values: impl IntoIterator<Item = (String, Value)>) -> Result<Self, ConfigError> {
        let values: Vec<_> = values.into_iter().collect();
        let declared = super::parameters(&listed(&values)).into_iter();
        let mut given: BTreeMap<_, _> =
            declared.map(|parameter| (parameter.name, (parameter.row.default(), parameter.row))).collect();
        let mut told = BTreeMap::new();
        let sensors = values.iter().rev().find(|(name, _)| name == "sensors").cloned();
        for (place, (name, value)) in values.into_iter().enumerate() {
            let Some((known, row)) = given.get_mut(&name) else {
                // Of sensors whose list cannot be no parameter is known.
                let sensors = sensors.filter(|(_, list)| names(list).is_empty());
                return Err(sensors.map_or_else(
                    || unknown(name, value, given.keys().cloned()),
                    |(name, value)| ConfigError::Impossible { must: given[&name].1.must(), name, value },
                ));
            };
            *known = row.as_declared(value);
            told.insert(name, place);
        }
        let mut given = Self { values: given, told };
        given.derive();
        Ok(given)
    }

    /// Gives those parameters a value that were not given one and follow from others.
    fn derive(&mut self) {
        let mut derived = Vec::new();
        if *self.get("mode") == Value::from(Mode::Paper) {
            derived.push(("clearing".to_owned(), Value::Boolean(false)));
        }
        let names = names(self.get("sensors"));
        // What is given for a sensor alone holds for the map.
        let mut of_sensors = names.iter().map(|name| format!("{name}.noise_model"));
        if let Some(of_sensor) =
            of_sensors.find(|name| self.told.contains_key(name) && self.checked(name).is_ok())
        {
            derived.push(("noise_model".to_owned(), self.get(&of_sensor).clone()));
        }
        let kind = if names == [sensors::DEFAULT] { Kind::Auto } else { Kind::Cloud };
        for name in &names {
            derived.push((format!("{name}.kind"), Value::from(kind)));
        }
        self.put(derived);
        let of_all = self.get("noise_model").clone();
        let of_sensors = names.iter().map(|name| (format!("{name}.noise_model"), of_all.clone())).collect();
        self.put(of_sensors);
    }

    /// Gives these values to the parameters that were not given one.
    fn put(&mut self, derived: Vec<(String, Value)>) {
        for (name, derived) in derived.into_iter().filter(|(name, _)| !self.told.contains_key(name)) {
            self.values.entry(name).and_modify(|(value, _)| *value = derived);
        }
    }

    pub(super) fn into_values(self) -> BTreeMap<String, Value> {
        self.values.into_iter().map(|(name, (value, _))| (name, value)).collect()
    }

    fn get(&self, name: &str) -> &Value {
        // Only declared names are asked for.
        &self.values[name].0
    }

    fn refuse<T>(&self, name: &str, must: impl Into<String>) -> Result<T, ConfigError> {
        let value = self.get(name).clone();
        Err(ConfigError::Impossible { name: name.to_owned(), value, must: must.into() })
    }

    /// The value, of the parameter's type and within its bounds.
    fn checked(&self, name: &str) -> Result<&Value, ConfigError> {
        let (value, row) = &self.values[name];
        row.refusal(Some(value)).map_or(Ok(value), |must| self.refuse(name, must))
    }

    /// What the bounds in words are about.
    pub(super) fn refuse_by_row<T>(&self, name: &str) -> Result<T, ConfigError> {
        self.refuse(name, self.values[name].1.must())
    }

    pub(super) fn refuse_beside<T>(&self, name: &str) -> Result<T, ConfigError> {
        self.refuse(name, self.values[name].1.also)
    }

    pub(super) fn boolean(&self, name: &str) -> Result<bool, ConfigError> {
        match self.checked(name)? {
            Value::Boolean(value) => Ok(*value),
            _ => self.refuse_by_row(name),
        }
    }

    pub(super) fn integer(&self, name: &str) -> Result<i64, ConfigError> {
        match self.checked(name)? {
            Value::Integer(value) => Ok(*value),
            _ => self.refuse_by_row(name),
        }
    }

    pub(super) fn number(&self, name: &str) -> Result<f64, ConfigError> {
        match self.checked(name)? {
            Value::Double(value) => Ok(*value),
            _ => self.refuse_by_row(name),
        }
    }

    pub(super) fn text(&self, name: &str) -> Result<&str, ConfigError> {
        match self.checked(name)? {
            Value::Text(value) => Ok(value),
            _ => self.refuse_by_row(name),
        }
    }

    /// The value that the text is the word of.
    pub(super) fn word<T: Word>(&self, name: &str) -> Result<T, ConfigError> {
        T::of_word(self.text(name)?).map_or_else(|| self.refuse_by_row(name), Ok)
    }

    pub(super) fn frame(&self, name: &str) -> Result<String, ConfigError> {
        let frame = bare(self.text(name)?);
        if frame.is_empty() || frame.len() > MAX_FRAME_ID_BYTES {
            return self.refuse_by_row(name);
        }
        Ok(frame.to_owned())
    }

    pub(super) fn addresses(&self, name: &str) -> Result<Vec<Ipv4Addr>, ConfigError> {
        let Value::TextList(list) = self.checked(name)? else { return self.refuse_by_row(name) };
        let addresses: Option<_> = list.iter().map(|text| own_address(text)).collect();
        addresses.map_or_else(|| self.refuse_by_row(name), Ok)
    }

    /// Whether the mode is `paper`, which refuses what only `consistent` has.
    fn is_paper(&self) -> Result<bool, ConfigError> {
        Ok(self.word::<Mode>("mode")? == Mode::Paper)
    }

    /// That of all sensors, which must be the same: one map weighs its points in one way.
    pub(super) fn noise_model(&self) -> Result<NoiseModel, ConfigError> {
        let model: NoiseModel = self.word("noise_model")?;
        for name in self.sensors()?.into_iter().map(|sensor| sensor.name + ".noise_model") {
            if self.word::<NoiseModel>(&name)? != model {
                return self.refuse_beside(&name);
            }
        }
        Ok(model)
    }

    pub(super) fn sensors(&self) -> Result<Vec<Sensor>, ConfigError> {
        let Value::TextList(list) = self.checked("sensors")? else { return self.refuse_by_row("sensors") };
        if !sensors::can_be(list) {
            return self.refuse_by_row("sensors");
        }
        let sensor = |name: &String| {
            let key = format!("{name}.kind");
            let kind: Kind = self.word(&key)?;
            if kind == Kind::Auto && list.len() > 1 {
                return self.refuse(&key, "`cloud` or `depth`; `auto` is for a sensor that is alone");
            }
            Ok(Sensor { name: name.clone(), kind })
        };
        list.iter().map(sensor).collect()
    }

    pub(super) fn twins(&self) -> Result<Twins, ConfigError> {
        let Value::TextList(names) = self.checked("twins")? else { return self.refuse_by_row("twins") };
        let mut twins = Twins::default();
        for name in names {
            match name.as_str() {
                "detections" => twins.detections = true,
                "polygons" => twins.polygons = true,
                _ => {
                    let nearest = nearest(name, ["detections", "polygons"].map(str::to_owned).into_iter());
                    let must = "out of `detections` and `polygons`; the nearest to";
                    return self.refuse("twins", format!("{must} {name:?} is `{nearest}`"));
                }
            }
        }
        if twins.polygons && self.is_paper()? {
            return self.refuse_beside("twins");
        }
        Ok(twins)
    }

    pub(super) fn clearing(&self) -> Result<bool, ConfigError> {
        let clearing = self.boolean("clearing")?;
        if clearing && self.is_paper()? {
            return self.refuse_beside("clearing");
        }
        Ok(clearing)
    }

    /// Poses that put surfaces off by more than a voxel leave nothing of what a voxel is to tell apart.
    pub(super) fn pose_sigma(&self) -> Result<f64, ConfigError> {
        let (sigma, size) = (self.number("pose_sigma")?, self.number("voxel_size")?);
        if sigma > size && !self.is_paper()? {
            let too_large = ("pose_sigma", format!("at most voxel_size, which is {size} m"));
            let too_small = ("voxel_size", format!("at least pose_sigma, which is {sigma} m"));
            return self.refuse_last(too_large, too_small);
        }
        Ok(sigma)
    }

    /// Bounds that only the mode `consistent` has: 0 in the other.
    pub(super) fn check_no_bounds(&self) -> Result<(), ConfigError> {
        if self.is_paper()? {
            if self.integer("max_voxels")? > 0 {
                return self.refuse_beside("max_voxels");
            }
            if self.number("keep_radius")? > 0.0 {
                return self.refuse("keep_radius", FORGETS_NOTHING);
            }
        }
        Ok(())
    }

    pub(super) fn check_ranges(&self) -> Result<(), ConfigError> {
        let (least, most) = (self.number("min_range")?, self.number("max_range")?);
        if most < least {
            let too_near = ("max_range", format!("at least min_range, which is {least} m"));
            let too_far = ("min_range", format!("at most max_range, which is {most} m"));
            return self.refuse_last(too_near, too_far);
        }
        // What is nearer is not taken in, and what is farther not kept.
        let kept = self.number("keep_radius")?;
        if kept > 0.0 && kept < least {
            let too_near = ("keep_radius", format!("0 (no bound) or at least min_range, which is {least} m"));
            let too_far = ("min_range", format!("at most keep_radius, which is {kept} m"));
            return self.refuse_last(too_near, too_far);
        }
        Ok(())
    }

    /// Of two that contradict each other, each with what it must be, refuses the one that was given last, or the first: the other may
    /// be a default, or right.
    fn refuse_last<T>(
        &self,
        (a, a_must): (&str, String),
        (b, b_must): (&str, String),
    ) -> Result<T, ConfigError> {
        if self.told.get(a) >= self.told.get(b) { self.refuse(a, a_must) } else { self.refuse(b, b_must) }
    }
}

/// An address that a machine can have: a node that tells others of one that stands for none or for many is not found.
fn own_address(text: &str) -> Option<Ipv4Addr> {
    let address: Ipv4Addr = text.parse().ok()?;
    let is_none = address.is_unspecified() || address.is_broadcast() || address.is_multicast();
    (!is_none).then_some(address)
}

/// The sensors that are named by what is given, as far as they can be; the last list counts.
fn listed(values: &[(String, Value)]) -> Vec<String> {
    let last = values.iter().rev().find(|(name, _)| name == "sensors");
    last.map_or_else(|| vec![sensors::DEFAULT.to_owned()], |(_, list)| names(list))
}

fn names(list: &Value) -> Vec<String> {
    match list {
        Value::TextList(list) if sensors::can_be(list) => list.clone(),
        _ => Vec::new(),
    }
}

/// Letters of a name that are compared with those of known ones.
const MAX_COMPARED: usize = 256;

/// What is said of a value whose name is none of the `known` parameters'.
pub(super) fn unknown(
    name: String,
    value: Value,
    known: impl Iterator<Item = String> + Clone,
) -> ConfigError {
    if sensors::have_topic(known.clone(), &name) {
        return ConfigError::Topic { name };
    }
    if let Some(sensor) = sensors::of_parameter(&name).map(str::to_owned) {
        let sensors = sensors::of_parameters(known);
        let mut with_it = if sensors == [sensors::DEFAULT] { Vec::new() } else { sensors.clone() };
        with_it.push(sensor.clone());
        return ConfigError::Sensor { name, sensor, sensors, with_it };
    }
    let nearest = nearest(&name, known);
    if is_like(&name, &nearest) {
        ConfigError::Misspelt { nearest, name, value }
    } else {
        ConfigError::Unknown { name, value }
    }
}

/// Whether a name can be meant as this known one: not where more than a third of its letters differ.
fn is_like(name: &str, known: &str) -> bool {
    3 * distance(name, known) <= name.chars().take(MAX_COMPARED).count()
}

/// How many letters differ.
fn distance(name: &str, known: &str) -> usize {
    // A name of a megabyte is near to none, and takes long to compare.
    let begin: String = name.chars().take(MAX_COMPARED).collect();
    strsim::damerau_levenshtein(known, &begin)
}

/// The known name that differs least.
fn nearest(name: &str, known: impl Iterator<Item = String>) -> String {
    known.min_by_key(|known| distance(name, known)).unwrap_or_default()
}
