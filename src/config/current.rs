//! The parameters of a running node: what they are now, and what may change them.

use std::collections::BTreeMap;

use super::table::{Change, Row};
use super::value::{Given, unknown};
use super::{Config, ConfigError, Parameter, Sensor, Value, parameters};
use crate::engine::{Mode, NoiseModel};

/// The parameters as they are now; every state of it is a possible configuration.
#[derive(Clone, Debug)]
pub struct Current {
    declared: BTreeMap<String, Parameter>,
    values: BTreeMap<String, Value>,
    config: Config,
}

/// A parameter that has another value than before.
#[derive(Clone, Debug, PartialEq)]
pub struct Changed {
    /// Its name.
    pub name: String,
    /// Its value before.
    pub before: Value,
    /// Its value now.
    pub now: Value,
}

impl Current {
    /// The parameters that a node starts with.
    ///
    /// # Errors
    /// As [`Config::new`].
    pub fn new(given: impl IntoIterator<Item = (String, Value)>) -> Result<Self, ConfigError> {
        let given = Given::new(given)?;
        let config = Config::of(&given)?;
        let sensors: Vec<_> = config.sensors.iter().map(|sensor| sensor.name.clone()).collect();
        let declared = parameters(&sensors).into_iter().map(|parameter| (parameter.name.clone(), parameter));
        Ok(Self { declared: declared.collect(), values: given.into_values(), config })
    }

    /// What the values stand for.
    pub const fn config(&self) -> &Config {
        &self.config
    }

    /// All names, ascending.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.values.keys().map(String::as_str)
    }

    /// All names and values, by ascending name.
    pub fn values(&self) -> impl Iterator<Item = (&String, &Value)> {
        self.values.iter()
    }

    /// A parameter and its value; `None` where none has this name.
    pub fn get(&self, name: &str) -> Option<(&Parameter, &Value)> {
        self.declared.get(name).zip(self.values.get(name))
    }

    /// What is to be said where the noise model that was given for a sensor alone is another one than the default, and that of others
    /// too: one holds for the whole map.
    pub fn shared_noise_model(&self, is_given: impl Fn(&str) -> bool) -> Option<String> {
        let key = |sensor: &Sensor| format!("{}.noise_model", sensor.name);
        let (given, others): (Vec<_>, Vec<_>) =
            self.config.sensors.iter().partition(|sensor| is_given(&key(sensor)));
        let model = self.config.engine.noise_model();
        if is_given("noise_model") || model == NoiseModel::default() || others.is_empty() {
            return None;
        }
        let others: Vec<_> = others.into_iter().map(|sensor| sensor.name.as_str()).collect();
        let verb = if others.len() == 1 { "is" } else { "are" };
        Some(format!(
            "{} is {}: {} {verb} weighed by it too",
            key(given.first()?),
            model.as_str(),
            others.join(", ")
        ))
    }

    /// Why a parameter keeps its value while the node runs; `None` where it can change.
    pub fn why_fixed(&self, parameter: &Parameter) -> Option<&'static str> {
        match parameter.row.change {
            Change::Live => None,
            Change::LiveInConsistent if self.config.engine.mode() == Mode::Consistent => None,
            Change::LiveInConsistent => Some("where mode is `paper`"),
            Change::AtStart(because) => Some(because),
        }
    }

    /// Gives parameters other values, all of them or none; returns those that are other ones now. What a value can be is
    /// checked as at the start.
    ///
    /// # Errors
    /// At the first that is unknown, cannot be, or cannot change.
    pub fn change(&mut self, wanted: Vec<(String, Value)>) -> Result<Vec<Changed>, ConfigError> {
        let mut checked = Vec::new();
        for (name, value) in wanted {
            let Some((parameter, now)) = self.get(&name) else {
                return Err(unknown(name, value, self.values.keys().cloned()));
            };
            let value = parameter.row.as_declared(value);
            if let Some(must) = parameter.row.refusal(Some(&value)) {
                return Err(ConfigError::Impossible { name, value, must });
            }
            if let Some(because) = self.why_fixed(parameter).filter(|_| value != *now) {
                // What could not be at a start either is told so: with what it is judged by.
                let beside = ["mode", "sensors", "voxel_size", "pose_sigma"]
                    .into_iter()
                    .filter(|beside| *beside != name);
                let beside = beside.filter_map(|beside| self.values.get_key_value(beside));
                let beside = beside.map(|(name, value)| (name.clone(), value.clone()));
                Config::new(beside.chain([(name.clone(), value)]))?;
                return Err(ConfigError::Fixed { name, value: now.clone(), because });
            }
            checked.push((name, value));
        }
        // Behind the others: what is refused is what is given now.
        self.config = Config::new(self.values.clone().into_iter().chain(checked.clone()))?;
        let mut values = self.values.clone();
        values.extend(checked);
        let before = std::mem::replace(&mut self.values, values);
        let pairs = before.into_iter().zip(self.values.values());
        let changed = pairs.filter(|((_, before), now)| before != *now);
        Ok(changed.map(|((name, before), now)| Changed { name, before, now: now.clone() }).collect())
    }

    /// What is said of a value of a type that no parameter has, `kind`.
    pub fn refuse_type(&self, name: &str, kind: &'static str) -> ConfigError {
        let must = |row: &Row| row.refusal(None).unwrap_or_default();
        match self.get(name) {
            Some((parameter, _)) => {
                ConfigError::Type { name: name.to_owned(), kind, must: must(parameter.row) }
            }
            None => unknown(name.to_owned(), Value::Text(kind.to_owned()), self.values.keys().cloned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(current: &mut Current, values: &[(&str, Value)]) -> Result<Vec<String>, String> {
        let wanted = values.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect();
        let changed = current.change(wanted).map_err(|error| error.to_string())?;
        let line = |Changed { name, before, now }| format!("{name}: {before} -> {now}");
        Ok(changed.into_iter().map(line).collect())
    }

    fn begin() -> Current {
        Current::new(Vec::new()).unwrap()
    }

    #[test]
    fn a_change_shows_in_the_values_and_in_what_they_stand_for() {
        let mut current = begin();
        let changed = change(&mut current, &[("max_range", Value::Integer(5)), ("depth", Value::Integer(4))]);
        assert_eq!(changed.unwrap(), ["max_range: 6.0 -> 5.0"]);
        assert_eq!(current.config().filter.max_range, 5.0);
        assert_eq!(current.get("max_range").unwrap().1, &Value::Double(5.0));
    }

    #[test]
    fn a_boolean_is_yes_or_no_where_a_text_can_be_either_and_nowhere_else() {
        let mut current = begin();
        for (value, expected) in
            [(true, "optical: \"auto\" -> \"yes\""), (false, "optical: \"yes\" -> \"no\"")]
        {
            assert_eq!(change(&mut current, &[("optical", Value::Boolean(value))]).unwrap(), [expected]);
        }
        let given = vec![("optical".to_owned(), Value::Boolean(true))];
        assert_eq!(Current::new(given).unwrap().get("optical").unwrap().1, &Value::Text("yes".into()));
        for name in ["noise_model", "fixed_frame"] {
            let error = change(&mut current, &[(name, Value::Boolean(true))]).unwrap_err();
            assert!(error.starts_with(&format!("{name} is true; it must be ")), "{error}");
        }
    }

    #[test]
    fn of_several_values_all_are_taken_or_none() {
        let mut current = begin();
        let wanted = [("min_range", Value::Double(1.0)), ("publish_rate", Value::Double(0.0))];
        let error = change(&mut current, &wanted).unwrap_err();
        assert_eq!(error, "publish_rate is 0.0; it must be from 0.01 to 100 Hz");
        assert_eq!(current.config(), begin().config());
        let both = [("min_range", Value::Double(7.0)), ("max_range", Value::Double(9.0))];
        assert_eq!(change(&mut current, &both).unwrap().len(), 2);
    }

    #[test]
    fn what_contradicts_another_parameter_is_refused_in_the_words_of_the_start() {
        let mut current = begin();
        let error = change(&mut current, &[("max_range", Value::Double(0.1))]).unwrap_err();
        assert_eq!(error, "max_range is 0.1; it must be at least min_range, which is 0.4 m");
        let given = vec![("max_range".to_owned(), Value::Double(0.1))];
        assert_eq!(Config::new(given).unwrap_err().to_string(), error);
        let error = change(&mut current, &[("min_range", Value::Integer(7))]).unwrap_err();
        assert_eq!(error, "min_range is 7.0; it must be at most max_range, which is 6 m");
        change(&mut current, &[("keep_radius", Value::Double(3.0))]).unwrap();
        let error = change(&mut current, &[("min_range", Value::Integer(4))]).unwrap_err();
        assert_eq!(error, "min_range is 4.0; it must be at most keep_radius, which is 3 m");
        let error = change(&mut current, &[("keep_radius", Value::Double(0.3))]).unwrap_err();
        assert_eq!(
            error,
            "keep_radius is 0.3; it must be 0 (no bound) or at least min_range, which is 0.4 m"
        );
        let both = [("max_range", Value::Double(0.2)), ("min_range", Value::Double(0.3))];
        assert!(change(&mut current, &both).unwrap_err().starts_with("min_range is 0.3"));
    }

    #[test]
    fn what_could_not_be_at_a_start_is_told_so_by_what_the_node_has() {
        let given = |size, sigma| {
            let given = [("voxel_size", size), ("pose_sigma", sigma)];
            given.map(|(name, value)| (name.to_owned(), Value::Double(value))).to_vec()
        };
        let mut current = Current::new(given(0.16, 0.04)).unwrap();
        let error = change(&mut current, &[("pose_sigma", Value::Double(0.1))]).unwrap_err();
        assert!(error.starts_with("pose_sigma is 0.04 while the node runs"), "{error}");
        let error = change(&mut current, &[("pose_sigma", Value::Double(0.2))]).unwrap_err();
        assert_eq!(error, "pose_sigma is 0.2; it must be at most voxel_size, which is 0.16 m");
        let error = change(&mut current, &[("voxel_size", Value::Double(0.03))]).unwrap_err();
        assert_eq!(error, "voxel_size is 0.03; it must be at least pose_sigma, which is 0.04 m");
    }

    #[test]
    fn what_is_read_at_the_start_stays_and_its_reason_says_what_to_do() {
        let mut current = begin();
        let error = change(&mut current, &[("voxel_size", Value::Double(0.05))]).unwrap_err();
        assert_eq!(
            error,
            "voxel_size is 0.08 while the node runs, the map is made with it: start it again with -p voxel_size:=..."
        );
        assert!(change(&mut current, &[("voxel_size", Value::Double(0.08))]).unwrap().is_empty());
        let error = change(&mut current, &[("voxel_size", Value::Double(-1.0))]).unwrap_err();
        assert!(error.contains("must be finite and above 0 m"), "{error}");
        let error = change(&mut current, &[("fixed_frame", Value::Text("/".into()))]).unwrap_err();
        assert!(error.contains("must be the name of a frame"), "{error}");
        let error = change(&mut current, &[("mode", Value::Text("paper".into()))]).unwrap_err();
        assert!(error.starts_with("mode is \"consistent\" while the node runs"), "{error}");
    }

    #[test]
    fn what_belongs_to_a_sensor_is_known_by_its_name_and_stays() {
        let sensors = ("sensors".to_owned(), Value::TextList(vec!["front".to_owned()]));
        let mut current = Current::new(vec![sensors]).unwrap();
        let mut line =
            |name, value: &str| change(&mut current, &[(name, Value::Text(value.into()))]).unwrap_err();
        assert!(line("front.kind", "depth").starts_with("front.kind is \"cloud\" while the node runs"));
        assert!(line("front.noise_model", "none").starts_with("front.noise_model is \"kinect_v1\" while"));
        assert!(line("noise_model", "none").starts_with("noise_model is \"kinect_v1\" while"));
        assert!(line("front.kind", "lidar").contains("must be `cloud`, `depth` or `auto`"));
        assert!(
            line("points.kind", "depth").starts_with("there is no sensor `points` among sensors (front)")
        );
    }

    #[test]
    fn the_letter_lets_nothing_change_that_its_clusters_hang_on() {
        let mut current = Current::new(vec![("mode".to_owned(), Value::Text("paper".into()))]).unwrap();
        for (name, value) in [("expansion_interval", Value::Integer(9)), ("clearing", Value::Boolean(true))] {
            let error = change(&mut current, &[(name, value)]).unwrap_err();
            assert!(error.contains("where mode is `paper`"), "{error}");
        }
        // No start in this mode would take it either.
        let error = change(&mut current, &[("max_voxels", Value::Integer(5000))]).unwrap_err();
        assert!(error.contains("must be 0 where mode is `paper`") && !error.contains("start"), "{error}");
        assert_eq!(change(&mut current, &[("publish_rate", Value::Double(1.0))]).unwrap().len(), 1);
        assert_eq!(change(&mut begin(), &[("clearing", Value::Boolean(false))]).unwrap().len(), 1);
    }

    #[test]
    fn unknown_names_get_the_nearest_and_foreign_types_what_they_must_be() {
        let mut current = begin();
        let error = change(&mut current, &[("max_rage", Value::Double(1.0))]).unwrap_err();
        assert!(error.contains("the nearest known one is `max_range`"), "{error}");
        let error = current.refuse_type("max_range", "a list of numbers").to_string();
        assert_eq!(error, "max_range cannot be a list of numbers; it must be a number");
    }
}
