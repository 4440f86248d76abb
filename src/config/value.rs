//! Values of parameters, and typed access to what was given.

use std::collections::BTreeMap;
use std::fmt;
use std::net::IpAddr;

use super::ConfigError;
use super::table::{Row, TABLE};
use crate::engine::{Mode, NoiseModel};
use crate::msg::ros::MAX_FRAME_ID_BYTES;

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
pub(super) struct Given(BTreeMap<String, (Value, &'static Row)>);

impl Given {
    pub(super) fn new(values: impl IntoIterator<Item = (String, Value)>) -> Result<Self, ConfigError> {
        let declared = super::parameters().into_iter();
        let mut given: BTreeMap<_, _> =
            declared.map(|parameter| (parameter.name, (parameter.row.default(), parameter.row))).collect();
        let mut cleared = false;
        for (name, value) in values {
            let Some((known, row)) = given.get_mut(&name) else {
                let nearest = nearest(&name, given.into_keys());
                return Err(ConfigError::Unknown { nearest, name, value });
            };
            cleared |= name == "clearing";
            *known = row.as_declared(value);
        }
        let mut given = Self(given);
        if !cleared && *given.get("mode") == Value::Text("paper".to_owned()) {
            given.0.entry("clearing".to_owned()).and_modify(|(value, _)| *value = Value::Boolean(false));
        }
        Ok(given)
    }

    pub(super) fn into_values(self) -> Vec<(String, Value)> {
        self.0.into_iter().map(|(name, (value, _))| (name, value)).collect()
    }

    fn get(&self, name: &str) -> &Value {
        // Only declared names are asked for.
        &self.0[name].0
    }

    fn refuse<T>(&self, name: &str, must: impl Into<String>) -> Result<T, ConfigError> {
        let value = self.get(name).clone();
        Err(ConfigError::Impossible { name: name.to_owned(), value, must: must.into() })
    }

    /// The value, of the parameter's type and within its bounds.
    fn checked(&self, name: &str) -> Result<&Value, ConfigError> {
        let (value, row) = &self.0[name];
        row.refusal(Some(value)).map_or(Ok(value), |must| self.refuse(name, must))
    }

    /// What the bounds in words are about.
    fn refuse_by_row<T>(&self, name: &str) -> Result<T, ConfigError> {
        self.refuse(name, self.0[name].1.must())
    }

    pub(super) fn refuse_beside<T>(&self, name: &str) -> Result<T, ConfigError> {
        self.refuse(name, self.0[name].1.also)
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

    pub(super) fn frame(&self, name: &str) -> Result<String, ConfigError> {
        let frame = self.text(name)?.trim_start_matches('/');
        if frame.is_empty() || frame.len() > MAX_FRAME_ID_BYTES {
            return self.refuse_by_row(name);
        }
        Ok(frame.to_owned())
    }

    pub(super) fn addresses(&self, name: &str) -> Result<Vec<IpAddr>, ConfigError> {
        let Value::TextList(list) = self.checked(name)? else { return self.refuse_by_row(name) };
        let addresses: Result<_, _> = list.iter().map(|text| text.parse()).collect();
        addresses.or_else(|_| self.refuse_by_row(name))
    }

    pub(super) fn mode(&self) -> Result<Mode, ConfigError> {
        match self.text("mode")? {
            "paper" => Ok(Mode::Paper),
            _ => Ok(Mode::Consistent),
        }
    }

    pub(super) fn noise_model(&self) -> Result<NoiseModel, ConfigError> {
        match self.text("noise_model")? {
            "none" => Ok(NoiseModel::None),
            _ => Ok(NoiseModel::KinectV1),
        }
    }

    pub(super) fn clearing(&self) -> Result<bool, ConfigError> {
        let clearing = self.boolean("clearing")?;
        if clearing && self.mode()? == Mode::Paper {
            return self.refuse_beside("clearing");
        }
        Ok(clearing)
    }

    /// Bounds that only the mode `consistent` has: 0 in the other.
    pub(super) fn check_no_bounds(&self) -> Result<(), ConfigError> {
        if self.mode()? == Mode::Paper {
            if self.integer("max_voxels")? > 0 {
                return self.refuse_beside("max_voxels");
            }
            if self.number("keep_radius")? > 0.0 {
                return self.refuse_beside("keep_radius");
            }
        }
        Ok(())
    }

    pub(super) fn check_ranges(&self) -> Result<(), ConfigError> {
        let (least, most) = (self.number("min_range")?, self.number("max_range")?);
        if most < least {
            return self.refuse("max_range", format!("{}, which is {least} m", self.0["max_range"].1.also));
        }
        Ok(())
    }
}

/// The known name that differs least.
pub(super) fn nearest(name: &str, known: impl Iterator<Item = String>) -> String {
    known.min_by_key(|known| strsim::damerau_levenshtein(known, name)).unwrap_or_default()
}
