//! The node's parameters: what was given, by name -> what is checked.
//!
//! [`parameters`] declares each with its default, unit and range; [`Config::new`] turns given values into a [`Config`]
//! or says which one cannot be, with its value and what it must be. Nothing is repaired in silence.

mod current;
mod sensors;
mod table;
#[cfg(test)]
mod tests;
mod value;
mod word;

use std::net::Ipv4Addr;
use std::path::PathBuf;
use std::time::Duration;

use thiserror::Error;

pub use self::current::{Changed, Current};
pub use self::sensors::{Kind, Sensor};
pub use self::table::{Bounds, Parameter};
use self::value::Given;
pub use self::value::{Value, as_meant};
use crate::cloud::CloudFilter;
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
    pub network_interfaces: Vec<Ipv4Addr>,
    /// Bytes to ask for as the socket's receive buffer.
    pub receive_buffer: usize,
    /// Whether `/clock` gives the time.
    pub use_sim_time: bool,
    /// The file that the map is saved in; `None` where it is not.
    pub snapshot_path: Option<PathBuf>,
    /// Time between two savings.
    pub snapshot_period: Duration,
    /// In which other messages the clusters go out.
    pub twins: Twins,
}

/// A parameter that is unknown, or whose value cannot be.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ConfigError {
    /// No parameter has this name, or one that is like it.
    #[error("unknown parameter `{name}` (given as {value})")]
    Unknown {
        /// As given.
        name: String,
        /// As given.
        value: Value,
    },
    /// No parameter has this name, and one is like it.
    #[error("unknown parameter `{name}` (given as {value}); the nearest known one is `{nearest}`")]
    Misspelt {
        /// As given.
        name: String,
        /// As given.
        value: Value,
        /// The known name that differs least.
        nearest: String,
    },
    /// A parameter of a sensor that there is not.
    #[error("there is no sensor `{sensor}` among sensors ({}); -p 'sensors:={with_it:?}' names it", .sensors.join(", "))]
    Sensor {
        /// The parameter, as given.
        name: String,
        /// The sensor, by that name.
        sensor: String,
        /// Names of those that there are.
        sensors: Vec<String>,
        /// Names of them and of this one; of this one alone where there are only the default ones.
        with_it: Vec<String>,
    },
    /// A topic that was given as if it were a parameter.
    #[error("{name} is a topic and no parameter: have it read another one with -r {name}:=...")]
    Topic {
        /// Its name.
        name: String,
    },
    /// A value that the parameter cannot have.
    #[error("{name} is {value}; it must be {must}")]
    Impossible {
        /// The parameter.
        name: String,
        /// As given.
        value: Value,
        /// The values it can have.
        must: String,
    },
    /// A value of a type that no parameter has.
    #[error("{name} cannot be {kind}; it must be {must}")]
    Type {
        /// The parameter.
        name: String,
        /// The type of what was given.
        kind: &'static str,
        /// The values it can have.
        must: String,
    },
    /// A value that the engine cannot have.
    #[error(transparent)]
    Engine(#[from] ParamsError),
    /// A change of a parameter that is read when the node starts.
    #[error("{name} is {value} while the node runs, {because}: start it again with -p {name}:=...")]
    Fixed {
        /// The parameter.
        name: String,
        /// Its value, which stays.
        value: Value,
        /// Why it stays.
        because: &'static str,
    },
}

impl ConfigError {
    /// The parameter that was given and is refused; `None` where it is none by itself.
    #[cfg(feature = "node")]
    pub(crate) fn parameter(&self) -> Option<&str> {
        match self {
            Self::Unknown { name, .. }
            | Self::Misspelt { name, .. }
            | Self::Sensor { name, .. }
            | Self::Topic { name }
            | Self::Impossible { name, .. }
            | Self::Type { name, .. }
            | Self::Fixed { name, .. } => Some(name),
            Self::Engine(_) => None,
        }
    }
}

/// What the value of the parameter of this name must be, its type first; `None` of a name that is none of the node's own.
#[cfg(feature = "node")]
pub(crate) fn must_be(name: &str) -> Option<String> {
    table::TABLE.iter().find(|row| row.name == name)?.refusal(None)
}

/// Whether a node can have a parameter of this name, whatever its sensors are called.
#[cfg(feature = "node")]
pub(crate) fn is_of_node(name: &str) -> bool {
    table::TABLE.iter().any(|row| row.name == name) || sensors::of_parameter(name).is_some()
}

/// All parameters of a node with these sensors, in the order of the documentation.
pub fn parameters(sensors: &[String]) -> Vec<Parameter> {
    let of_node = table::TABLE.iter().map(|row| Parameter { name: row.name.to_owned(), row });
    let of_sensor = |sensor: &String| {
        let rows = table::OF_SENSOR.iter();
        rows.map(|row| Parameter { name: format!("{sensor}.{}", row.name), row }).collect::<Vec<_>>()
    };
    of_node.chain(sensors.iter().flat_map(of_sensor)).collect()
}

impl Config {
    /// Checks the given values, later ones over earlier ones of the same name; the rest have their defaults.
    ///
    /// # Errors
    /// At the first parameter that is unknown or whose value cannot be.
    pub fn new(values: impl IntoIterator<Item = (String, Value)>) -> Result<Self, ConfigError> {
        Self::of(&Given::new(values)?)
    }

    /// What is to be said of voxels that are large beside the range: who gives centimetres or millimetres gets no cluster.
    pub fn too_coarse(&self) -> Option<String> {
        let (voxel_size, max_range) = (self.engine.voxel_size(), self.filter.max_range);
        (voxel_size > max_range / 4.0).then(|| {
            format!(
                "voxel_size is {voxel_size} m and max_range {max_range} m: less than four voxels, and both are in metres"
            )
        })
    }

    fn of(given: &Given) -> Result<Self, ConfigError> {
        let seconds = |name| given.number(name).map(Duration::from_secs_f64);
        Ok(Self {
            fixed_frame: given.frame("fixed_frame")?,
            sensors: given.sensors()?,
            engine: engine(given)?,
            filter: filter(given)?,
            tf_timeout: seconds("tf_timeout")?,
            publish_period: Duration::from_secs_f64(1.0 / given.number("publish_rate")?),
            network_interfaces: given.addresses("network_interfaces")?,
            receive_buffer: given.integer("receive_buffer")? as usize,
            use_sim_time: given.boolean("use_sim_time")?,
            snapshot_path: Some(given.text("snapshot_path")?)
                .filter(|path| !path.is_empty())
                .map(PathBuf::from),
            snapshot_period: seconds("snapshot_period")?,
            twins: given.twins()?,
        })
    }
}

fn engine(given: &Given) -> Result<Params, ConfigError> {
    given.check_no_bounds()?;
    // The table's bounds are the engine's: what is beyond them is refused in the table's words, before the engine is asked.
    Ok(Params::DEFAULT
        .with_mode(given.word("mode")?)
        .with_noise_model(given.noise_model()?)
        .with_pose_sigma(given.pose_sigma()?)?
        .with_clearing(given.clearing()?)
        .with_max_voxels(given.integer("max_voxels")?)?
        .with_keep_radius(given.number("keep_radius")?)?
        .with_voxel_size(given.number("voxel_size")?)?
        .with_min_points(given.integer("min_points")?)?
        .with_depth(given.integer("depth")?)?
        .with_max_normal_angle(given.number("max_normal_angle")?)?
        .with_min_vicinity(given.integer("min_vicinity")?)?
        .with_expansion_interval(given.integer("expansion_interval")?)?)
}

fn filter(given: &Given) -> Result<CloudFilter, ConfigError> {
    given.check_ranges()?;
    Ok(CloudFilter {
        min_range: given.number("min_range")?,
        max_range: given.number("max_range")?,
        optical: given.word("optical")?,
        max_points: given.integer("max_points")? as u32,
    })
}
