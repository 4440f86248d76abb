//! A ROS command line -> who the node is, what it listens to, and its checked configuration.

mod domain;
mod error;
mod expand;
mod given;
mod others;
mod params_file;
mod remap;
mod repeats;
mod rmw;
pub mod security;
mod topics;

use std::collections::BTreeSet;
use std::path::Path;

use ros2args::Ros2Args;
use ros2args::names::build_node_fqn;

pub use self::error::ArgsError;
use self::given::{given, idle, located};
use self::remap::{Kind, Rule, readable};
pub use self::rmw::{Rmw, RmwError};
use self::security::{Asked, BUILT_IN, Security, SecurityError};
pub use self::topics::{DepthTopics, SensorTopics, TopicName};
use crate::config::{Config, Current};
use crate::yaml::{self, YamlError};

/// The variable that is set where a process has put itself in its own place.
pub const BEGINS_ANEW: &str = "CFODI_BEGINS_ANEW";

/// What the environment says about the node.
#[derive(Clone, Debug, Default)]
pub struct Environment {
    /// `ROS_DOMAIN_ID`.
    pub domain: Option<String>,
    /// `RMW_IMPLEMENTATION`.
    pub rmw: Option<String>,
    /// The variables of DDS Security.
    pub security: Asked,
    /// The variables that ROS's own middlewares go by, of discovery and of settings, where they are set to change it.
    pub discovery: Vec<(&'static str, String)>,
    /// [`BEGINS_ANEW`] is set.
    pub begins_anew: bool,
}

impl Environment {
    /// That of this process.
    pub fn of_process() -> Self {
        Self {
            domain: variable("ROS_DOMAIN_ID"),
            rmw: variable("RMW_IMPLEMENTATION"),
            security: Asked::of_process(),
            discovery: discovery(variable),
            begins_anew: variable(BEGINS_ANEW).is_some(),
        }
    }
}

/// A variable of this process; what is no text is not left out, but comes as a text that is refused.
pub(crate) fn variable(name: &str) -> Option<String> {
    std::env::var_os(name).map(|value| value.to_string_lossy().into_owned())
}

fn discovery(variable: impl Fn(&'static str) -> Option<String>) -> Vec<(&'static str, String)> {
    let as_ever: [(_, &[&str]); 8] = [
        ("CYCLONEDDS_URI", &[""]),
        ("FASTDDS_BUILTIN_TRANSPORTS", &["", "DEFAULT", "UDPV4"]),
        ("FASTDDS_DEFAULT_PROFILES_FILE", &[""]),
        ("FASTRTPS_DEFAULT_PROFILES_FILE", &[""]),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", &["", "SUBNET", "SYSTEM_DEFAULT"]),
        ("ROS_DISCOVERY_SERVER", &[""]),
        ("ROS_LOCALHOST_ONLY", &["", "0"]),
        ("ROS_STATIC_PEERS", &[""]),
    ];
    let set = as_ever.into_iter().filter_map(|(name, as_ever)| Some((name, variable(name)?, as_ever)));
    let changes = set.filter(|(_, value, as_ever)| !as_ever.contains(&value.to_uppercase().as_str()));
    changes.map(|(name, value, _)| (name, value)).collect()
}

/// Everything that the command line and the environment say about the node.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Base name of the node.
    pub name: String,
    /// Its namespace, with a leading slash.
    pub namespace: String,
    /// Domain of DDS; over Zenoh what all its names begin with.
    pub domain: u16,
    /// Its parameters, and the configuration that they stand for.
    pub parameters: Current,
    /// Level of the log, as `--log-level` gives it.
    pub log_level: Option<String>,
    /// Whether the lines of the log are sent to `/rosout`.
    pub rosout: bool,
    /// Whether the node goes on in the place of one whose middleware has failed.
    pub begins_anew: bool,
    rmw: String,
    discovery: Vec<(&'static str, String)>,
    security: Asked,
    remaps: Vec<Rule>,
    /// Names of the parameters that were given a value.
    given: BTreeSet<String>,
    /// Parameters of every node of ROS that were given a value, and have no effect.
    idle: BTreeSet<&'static str>,
    warnings: Vec<String>,
}

impl Setup {
    /// Reads `--ros-args` sections out of `args`; returns the other arguments too. `default_name` is the node's name
    /// without `__node`.
    ///
    /// Parameter files count in their order, `-p` after them.
    ///
    /// # Errors
    /// At the first thing that cannot be, with its name and value.
    pub fn parse(
        args: &[String],
        environment: &Environment,
        default_name: &str,
    ) -> Result<(Self, Vec<String>), ArgsError> {
        args.iter().try_for_each(|arg| check_value(arg))?;
        args.windows(2).try_for_each(|pair| check_given(&pair[0], &pair[1]))?;
        let (ros, rest) = ros2args::parse_ros2_args(&readable(args)?)?;
        let renamed = |node: &str, special: &[&str]| {
            let mut rules = ros.remap_rules.iter().filter(|rule| rule.applies_to_node(node));
            rules.find(|rule| special.contains(&rule.from.as_str())).map(|rule| rule.to.clone())
        };
        let name = renamed(default_name, &["__node", "__name"]).unwrap_or_else(|| default_name.to_owned());
        let namespace = absolute(renamed(&name, &["__ns"]).unwrap_or_default());
        ros2args::names::validate_node_name(&name)?;
        ros2args::names::validate_namespace(&namespace)?;
        let (domain, in_octal) = domain::parse(environment.domain.as_deref().unwrap_or_default())?;
        let (given, mut warnings) = given(&ros, &namespace, &name)?;
        warnings.extend(in_octal);
        let (without_effect, given): (Vec<_>, Vec<_>) =
            given.into_iter().partition(|given| idle(&given.name).is_some());
        let values = given.iter().map(|given| (given.name.clone(), given.value.clone()));
        let remaps = ros.remap_rules.iter().filter(|rule| rule.applies_to_node(&name));
        let mut setup = Self {
            given: given.iter().map(|given| given.name.clone()).collect(),
            idle: without_effect.iter().filter_map(|given| idle(&given.name)).collect(),
            parameters: Current::new(values).map_err(|error| located(error, &given))?,
            domain,
            rmw: environment.rmw.clone().unwrap_or_default(),
            security: Asked { enclave: ros.enclave.clone(), ..environment.security.clone() },
            log_level: log_level(&ros, &namespace, &name),
            rosout: ros.logging_output.rosout != Some(false),
            begins_anew: environment.begins_anew,
            discovery: environment.discovery.clone(),
            remaps: remaps.map(Rule::new).collect(),
            warnings,
            name,
            namespace,
        };
        let shared = setup.parameters.shared_noise_model(|name| setup.is_given(name));
        let said = [shared, setup.config().too_coarse()];
        setup.warnings.extend(said.into_iter().flatten());
        Ok((setup, rest))
    }

    /// What the parameters stand for.
    pub const fn config(&self) -> &Config {
        self.parameters.config()
    }

    /// Variables of the environment that were set to change discovery or settings of the middleware, and do not.
    pub fn discovery(&self) -> &[(&'static str, String)] {
        &self.discovery
    }

    /// The parameters, or their families, that were given and that every node of ROS has, where they have no effect on this one.
    pub fn idle(&self) -> impl Iterator<Item = &'static str> {
        self.idle.iter().copied()
    }

    /// What is to be said of files and arguments that have parameters for other nodes alone, for a misspelt one, or one twice, and of
    /// values that are taken and hardly meant so, a line each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Whether a parameter or another name was given.
    pub fn is_adapted(&self) -> bool {
        !self.given.is_empty() || !self.remaps.is_empty()
    }

    /// The middleware that the node talks over.
    ///
    /// # Errors
    /// When it cannot be had.
    pub fn rmw(&self) -> Result<Rmw, RmwError> {
        Rmw::named(&self.rmw)
    }

    /// Whether who calls the node's services sends a header with each call, as [`Rmw::calls_by_header`] says.
    pub fn is_called_by_header(&self) -> bool {
        Rmw::calls_by_header(&self.rmw)
    }

    /// What the node does about security over Zenoh, which has none that `ros2 security` could set up.
    ///
    /// # Errors
    /// When the node must not open a socket.
    pub fn security_over_zenoh(&self) -> Result<Security, SecurityError> {
        self.security.decide_over_zenoh()
    }

    /// What the node does about DDS Security, by what is there now.
    ///
    /// # Errors
    /// When the node must not open a socket.
    pub fn security(&self) -> Result<Security, SecurityError> {
        self.security.decide(BUILT_IN, Path::try_exists)
    }

    /// The fully qualified name of a topic: expanded, then remapped.
    ///
    /// # Errors
    /// When the name, or what a rule makes of it, is none.
    pub fn resolve(&self, name: &str) -> Result<String, ArgsError> {
        self.resolve_as(Kind::Topic, name)
    }

    /// The fully qualified name of a service: expanded, then remapped.
    ///
    /// # Errors
    /// When the name, or what a rule makes of it, is none.
    pub fn resolve_service(&self, name: &str) -> Result<String, ArgsError> {
        self.resolve_as(Kind::Service, name)
    }

    fn resolve_as(&self, kind: Kind, name: &str) -> Result<String, ArgsError> {
        let expand = |name: &str| self.expand(kind, name);
        let expanded = expand(name)?;
        let fits = |rule: &&Rule| rule.is_for(kind) && expand(&rule.from).is_ok_and(|from| from == expanded);
        let rule = self.remaps.iter().find(fits);
        rule.map_or(Ok(expanded), |rule| expand(&rule.to))
    }

    fn expand(&self, kind: Kind, name: &str) -> Result<String, ArgsError> {
        let expanded = expand::expand(kind, &self.namespace, &self.name, name);
        expanded.map_err(|error| ArgsError::Name(name.to_owned(), error))
    }

    /// Whether a parameter was given a value, as opposed to having its default.
    pub fn is_given(&self, parameter: &str) -> bool {
        self.given.contains(parameter)
    }

    /// The parameters that were given a value and are none of these.
    pub fn given_beside(&self, used: &[&str]) -> Vec<&str> {
        self.given.iter().map(String::as_str).filter(|name| !used.contains(name)).collect()
    }

    /// Whether a rule gives this topic another name.
    pub fn is_remapped(&self, name: &str) -> bool {
        let expanded = self.expand(Kind::Topic, name).ok();
        self.resolve(name).is_ok_and(|resolved| Some(resolved) != expanded)
    }

    /// The same network, parameters and remappings for another node of this process.
    #[must_use]
    pub fn for_node(&self, name: &str) -> Self {
        Self { name: name.to_owned(), ..self.clone() }
    }

    /// Namespace and name, as in `/robot/cfodi`.
    pub fn fully_qualified_name(&self) -> String {
        build_node_fqn(&self.namespace, &self.name)
    }
}

fn absolute(namespace: String) -> String {
    if namespace.starts_with('/') { namespace } else { format!("/{namespace}") }
}

/// Letters that are said of a value that is no YAML.
const SHOWN: usize = 64;

/// A value on the command line is YAML: what is more than is read never reaches the library.
fn check_value(arg: &str) -> Result<(), ArgsError> {
    let Some((name, value)) = arg.split_once(":=") else { return Ok(()) };
    match yaml::check(value) {
        // What is no YAML may be no parameter either; where it is one, it is said below.
        Ok(()) | Err(YamlError::Form(_)) => Ok(()),
        Err(bound) => Err(ArgsError::Value { name: name.to_owned(), bound }),
    }
}

/// The library says of a parameter without a value, or with one that is no YAML, neither its name nor what to write.
fn check_given(option: &str, arg: &str) -> Result<(), ArgsError> {
    let given = arg.split_once(":=").filter(|_| ["-p", "--param"].contains(&option));
    let Some((name, value)) = given.map(|(name, value)| (name.to_owned(), value)) else { return Ok(()) };
    if value.is_empty() {
        return Err(ArgsError::Empty { name });
    }
    let Err(YamlError::Form(error)) = yaml::check(value) else { return Ok(()) };
    let begin = value.chars().take(SHOWN).collect();
    Err(if value.starts_with('[') && !value.ends_with(']') {
        ArgsError::Cut { name, begin }
    } else {
        ArgsError::NoYaml { name, begin, error }
    })
}

/// The level that counts for this node's logger, `namespace.name`: of those given to it by name the newest, or to what it is
/// part of; else the newest that is given to all.
fn log_level(ros: &Ros2Args, namespace: &str, name: &str) -> Option<String> {
    let own = format!("{namespace}/{name}").trim_start_matches('/').replace('/', ".");
    let closeness = |logger: Option<&str>| match logger {
        None => Some(0),
        Some(logger) if logger == name => Some(own.len()),
        Some(logger) => {
            let rest = own.strip_prefix(logger)?;
            (rest.is_empty() || rest.starts_with('.')).then_some(logger.len())
        }
    };
    let meant = ros
        .log_levels
        .iter()
        .filter_map(|given| Some((closeness(given.logger_name.as_deref())?, given.level)));
    let (_, level) = meant.max_by_key(|(closeness, _)| *closeness)?;
    Some(level.as_str().to_lowercase())
}

#[cfg(test)]
mod tests_on_files;

#[cfg(test)]
mod tests;
