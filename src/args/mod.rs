//! A ROS command line -> who the node is, what it listens to, and its checked configuration.

mod error;
mod params_file;
mod remap;
mod repeats;
mod rmw;
pub mod security;

use std::collections::BTreeSet;
use std::path::Path;

use ros2args::names::{build_node_fqn, expand_topic_name};
use ros2args::{ParamAssignment, Ros2Args, match_wildcard_pattern};

pub use self::error::ArgsError;
use self::params_file::{assignments, flatten};
use self::remap::{Kind, Rule, readable};
pub use self::rmw::{Rmw, RmwError, ZENOH_BUILT_IN};
use self::security::{Asked, BUILT_IN, Security, SecurityError};
use crate::config::{Config, Value, as_meant};
use crate::yaml::{self, YamlError};

/// What the environment says about the node.
#[derive(Clone, Debug, Default)]
pub struct Environment {
    /// `ROS_DOMAIN_ID`.
    pub domain: Option<String>,
    /// `RMW_IMPLEMENTATION`.
    pub rmw: Option<String>,
    /// The variables of DDS Security.
    pub security: Asked,
    /// The variables of discovery that ROS's own middlewares go by, where they are set to change it.
    pub discovery: Vec<(&'static str, String)>,
}

impl Environment {
    /// That of this process.
    pub fn of_process() -> Self {
        // What is no text is no number either, nor the name of a middleware, and is refused as such.
        let variable = |name| std::env::var_os(name).map(|value| value.to_string_lossy().into_owned());
        Self {
            domain: variable("ROS_DOMAIN_ID"),
            rmw: variable("RMW_IMPLEMENTATION"),
            security: Asked::of_process(),
            discovery: discovery(variable),
        }
    }
}

fn discovery(variable: impl Fn(&'static str) -> Option<String>) -> Vec<(&'static str, String)> {
    let as_ever: [(_, &[&str]); 3] = [
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", &["", "SUBNET", "SYSTEM_DEFAULT"]),
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
    /// The checked configuration.
    pub config: Config,
    /// Values of all parameters, as the parameter services show them.
    pub parameters: Vec<(String, Value)>,
    /// Level of the log, as `--log-level` gives it.
    pub log_level: Option<String>,
    /// Whether the lines of the log are sent to `/rosout`.
    pub rosout: bool,
    rmw: String,
    discovery: Vec<(&'static str, String)>,
    security: Asked,
    remaps: Vec<Rule>,
    /// Names of the parameters that were given a value.
    given: BTreeSet<String>,
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
        let given = given_parameters(&ros, &namespace, &name)?;
        let remaps = ros.remap_rules.iter().filter(|rule| rule.applies_to_node(&name));
        let setup = Self {
            given: given.iter().map(|(name, _)| name.clone()).collect(),
            config: Config::new(given.clone())?,
            parameters: Config::values(given)?,
            domain: parse_domain(environment.domain.as_deref())?,
            rmw: environment.rmw.clone().unwrap_or_default(),
            security: Asked { enclave: ros.enclave.clone(), ..environment.security.clone() },
            log_level: log_level(&ros, &namespace, &name),
            rosout: ros.logging_output.rosout != Some(false),
            discovery: environment.discovery.clone(),
            remaps: remaps.map(Rule::new).collect(),
            name,
            namespace,
        };
        Ok((setup, rest))
    }

    /// Variables of the environment that were set to change discovery, and do not.
    pub fn discovery(&self) -> &[(&'static str, String)] {
        &self.discovery
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
        Rmw::named(&self.rmw, ZENOH_BUILT_IN)
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

    /// As [`Self::resolve`], of a service.
    ///
    /// # Errors
    /// The same.
    pub fn resolve_service(&self, name: &str) -> Result<String, ArgsError> {
        self.resolve_as(Kind::Service, name)
    }

    fn resolve_as(&self, kind: Kind, name: &str) -> Result<String, ArgsError> {
        let expand = |name: &str| {
            expand_topic_name(&self.namespace, &self.name, name)
                .map_err(|error| ArgsError::Name(name.to_owned(), error))
        };
        let expanded = expand(name)?;
        let fits = |rule: &&Rule| rule.is_for(kind) && expand(&rule.from).is_ok_and(|from| from == expanded);
        let rule = self.remaps.iter().find(fits);
        rule.map_or(Ok(expanded), |rule| expand(&rule.to))
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
        let expanded = expand_topic_name(&self.namespace, &self.name, name).ok();
        self.resolve(name).is_ok_and(|resolved| Some(resolved) != expanded)
    }

    /// The same network and remappings for another node of this process, without parameters.
    #[must_use]
    pub fn for_node(&self, name: &str) -> Self {
        Self { name: name.to_owned(), parameters: Vec::new(), ..self.clone() }
    }

    /// Namespace and name, as in `/robot/cfodi`.
    pub fn fully_qualified_name(&self) -> String {
        build_node_fqn(&self.namespace, &self.name)
    }
}

fn absolute(namespace: String) -> String {
    if namespace.starts_with('/') { namespace } else { format!("/{namespace}") }
}

/// A value on the command line is YAML: what is more than is read never reaches the library.
fn check_value(arg: &str) -> Result<(), ArgsError> {
    let Some((name, value)) = arg.split_once(":=") else { return Ok(()) };
    match yaml::check(value) {
        // What is no YAML may be no parameter either; where it is one, it is said below.
        Ok(()) | Err(YamlError::Form(_)) => Ok(()),
        Err(bound) => Err(ArgsError::Value { name: name.to_owned(), bound }),
    }
}

/// The library says of a parameter without a value neither its name nor what to write.
fn check_given(option: &str, arg: &str) -> Result<(), ArgsError> {
    let empty = arg.strip_suffix(":=").filter(|_| ["-p", "--param"].contains(&option));
    empty.map_or(Ok(()), |name| Err(ArgsError::Empty { name: name.to_owned() }))
}

fn parse_domain(domain: Option<&str>) -> Result<u16, ArgsError> {
    let Some(text) = domain.filter(|text| !text.is_empty()) else { return Ok(0) };
    let number = text.parse().ok().filter(|number| *number <= 232);
    number.ok_or_else(|| ArgsError::Domain(text.to_owned()))
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

fn given_parameters(ros: &Ros2Args, namespace: &str, name: &str) -> Result<Vec<(String, Value)>, ArgsError> {
    let node = build_node_fqn(namespace, name);
    let is_for_node = |param: &ParamAssignment| {
        param.node_name.as_ref().is_none_or(|pattern| match_wildcard_pattern(pattern, &node))
    };
    let mut assigned: Vec<ParamAssignment> = Vec::new();
    for file in &ros.param_files {
        assigned.extend(assignments(file)?.into_iter().filter(is_for_node));
    }
    assigned.extend(ros.param_assignments.iter().filter(|param| is_for_node(param)).cloned());
    let mut values = Vec::new();
    for param in assigned {
        flatten(param.name, &param.value, &mut values)?;
    }
    let meant = |(name, value): (String, Value)| (as_meant(&name, value), name);
    Ok(values.into_iter().map(meant).map(|(value, name)| (name, value)).collect())
}

#[cfg(test)]
mod tests_on_files;

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn parse(line: &str) -> Result<Setup, ArgsError> {
        let args: Vec<_> = line.split_whitespace().map(str::to_owned).collect();
        Setup::parse(&args, &Environment::default(), "cfodi").map(|(setup, _)| setup)
    }

    #[test]
    fn names_are_expanded_and_then_remapped() {
        let setup =
            parse("run --ros-args -r __ns:=/robot -r points:=/camera/depth/points -r ~/clusters:=walls")
                .unwrap();
        assert_eq!(setup.fully_qualified_name(), "/robot/cfodi");
        assert_eq!(setup.resolve("points").unwrap(), "/camera/depth/points");
        assert_eq!(setup.resolve("~/clusters").unwrap(), "/robot/walls");
        assert_eq!(setup.resolve("~/markers").unwrap(), "/robot/cfodi/markers");
        assert_eq!(setup.resolve("/tf").unwrap(), "/tf");
    }

    #[test]
    fn what_was_given_beside_the_known_is_named() {
        let setup = parse("--ros-args -p mode:=paper -p depth:=3 -p clearing:=false").unwrap();
        assert_eq!(setup.given_beside(&["depth", "voxel_size"]), ["clearing", "mode"]);
        assert!(parse("").unwrap().given_beside(&[]).is_empty());
    }

    #[test]
    fn node_name_and_fully_qualified_rules_apply() {
        let setup = parse("--ros-args -r __node:=eyes -r /points:=/a").unwrap();
        assert_eq!((setup.name.as_str(), setup.resolve("points").unwrap().as_str()), ("eyes", "/a"));
    }

    #[test]
    fn of_several_names_the_first_counts_and_a_namespace_is_given_to_the_new_one() {
        let table = [
            ("-r __node:=a -r __node:=b", "/a"),
            ("-r __name:=a -r __node:=b", "/a"),
            ("-r __ns:=/a -r __ns:=/b", "/a/cfodi"),
            ("-r cfodi:__node:=eyes -r __node:=b", "/eyes"),
            ("-r other:__node:=eyes -r __node:=b", "/b"),
            ("-r __node:=eyes -r eyes:__ns:=/robot", "/robot/eyes"),
            ("-r eyes:__ns:=/robot -r __node:=eyes", "/robot/eyes"),
            ("-r __node:=eyes -r cfodi:__ns:=/robot", "/eyes"),
        ];
        for (rules, name) in table {
            assert_eq!(
                parse(&format!("--ros-args {rules}")).unwrap().fully_qualified_name(),
                name,
                "{rules}"
            );
        }
    }

    #[test]
    fn files_count_in_order_and_p_after_them() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("params.yaml");
        let text = "/**:\n  ros__parameters:\n    depth: 3\n    voxel_size: 1\n/other:\n  ros__parameters:\n    depth: 8\n";
        std::fs::write(&file, text).unwrap();
        let setup = parse(&format!("--ros-args -p depth:=2 --params-file {}", file.display())).unwrap();
        assert_eq!(setup.config.engine.depth(), 2);
        assert!((setup.config.engine.voxel_size() - 1.0).abs() < f64::EPSILON);
        assert!(setup.parameters.contains(&("voxel_size".to_owned(), Value::Double(1.0))));
    }

    #[test]
    fn what_cannot_be_is_refused_with_name_and_value() {
        assert!(
            parse("--ros-args -p depht:=3").unwrap_err().to_string().contains("nearest known one is `depth`")
        );
        assert!(
            parse("--ros-args --params-file /no/such.yaml")
                .unwrap_err()
                .to_string()
                .contains("/no/such.yaml")
        );
        let domain = in_domain("233").unwrap_err().to_string();
        assert_eq!(domain, "ROS_DOMAIN_ID is \"233\"; it must be from 0 to 232");
        assert_eq!(in_domain("7").unwrap(), 7);
    }

    fn in_domain(text: &str) -> Result<u16, ArgsError> {
        let environment = Environment { domain: Some(text.to_owned()), ..Environment::default() };
        Setup::parse(&[], &environment, "cfodi").map(|(setup, _)| setup.domain)
    }

    #[test]
    fn variables_that_change_discovery_are_known_where_they_are_set_to_do_so() {
        let set = |pairs: &'static [(&str, &str)]| {
            discovery(|name| pairs.iter().find(|pair| pair.0 == name).map(|pair| pair.1.to_owned()))
        };
        let range = "ROS_AUTOMATIC_DISCOVERY_RANGE";
        assert_eq!(set(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")]), [(range, "LOCALHOST".to_owned())]);
        assert_eq!(set(&[("ROS_LOCALHOST_ONLY", "1"), ("ROS_STATIC_PEERS", "10.0.0.1")]).len(), 2);
        let as_ever = [("ROS_AUTOMATIC_DISCOVERY_RANGE", "subnet"), ("ROS_LOCALHOST_ONLY", "0")];
        assert!(
            discovery(|name| as_ever.iter().find(|pair| pair.0 == name).map(|pair| pair.1.to_owned()))
                .is_empty()
        );
    }

    #[test]
    fn a_level_counts_that_is_given_to_all_or_to_this_node() {
        let level = |line: &str| parse(&format!("--ros-args -r __ns:=/robot {line}")).unwrap().log_level;
        assert_eq!(level("--log-level other:=fatal"), None);
        assert_eq!(level("--log-level debug --log-level other:=fatal").as_deref(), Some("debug"));
        assert_eq!(level("--log-level warn --log-level robot.cfodi:=error").as_deref(), Some("error"));
        assert_eq!(
            level("--log-level cfodi:=debug --log-level warn").as_deref(),
            Some("debug"),
            "its own counts"
        );
        assert_eq!(
            level("--log-level warn --log-level robot:=debug").as_deref(),
            Some("debug"),
            "it is a part of it"
        );
        assert_eq!(level("--log-level error --log-level warn").as_deref(), Some("warn"));
        assert_eq!(level("--log-level rob:=debug"), None);
        assert!(!parse("--ros-args --disable-rosout-logs").unwrap().rosout && parse("").unwrap().rosout);
    }

    #[test]
    fn the_enclave_is_that_of_the_command_line() {
        let environment = Environment {
            security: Asked { enable: Some("true".to_owned()), ..Asked::default() },
            ..Environment::default()
        };
        let args = ["run", "--ros-args", "--enclave", "robot"].map(str::to_owned);
        let (setup, rest) = Setup::parse(&args, &environment, "cfodi").unwrap();
        assert_eq!(rest, ["run"]);
        assert!(setup.security().unwrap_err().to_string().starts_with("--enclave is \"robot\""));
    }

    /// What is said of a parameter file of this text.
    fn of_file(text: &[u8]) -> Result<Setup, ArgsError> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("params.yaml");
        std::fs::write(&file, text).unwrap();
        parse(&format!("--ros-args --params-file {}", file.display()))
    }

    #[test]
    fn a_parameter_file_that_is_nested_without_end_is_refused() {
        let deep = format!("/**:\n  ros__parameters:\n    depth:\n      {}", "- ".repeat(100_000));
        let flow = format!("/**: {}", "{a: ".repeat(100));
        for text in [deep, flow] {
            let error = of_file(text.as_bytes()).unwrap_err().to_string();
            assert!(error.contains("nested deeper than 64"), "{error}");
        }
    }

    #[test]
    fn a_parameter_file_of_a_billion_laughs_is_refused() {
        let mut text = "a0: &a0 [ha, ha, ha, ha, ha, ha, ha, ha, ha]\n".to_owned();
        for i in 1..10 {
            let line = vec![format!("*a{}", i - 1); 9].join(", ");
            text.extend([format!("a{i}: &a{i} ["), line, "]\n".to_owned()]);
        }
        let error = of_file(text.as_bytes()).unwrap_err().to_string();
        assert!(error.contains("more than 1000000 nodes"), "{error}");
    }

    #[test]
    fn a_parameter_file_that_is_none_is_refused_with_its_name() {
        let long_name = format!("{}:\n  ros__parameters: {{depth: 3}}\n", "/**".repeat(10_000));
        let texts: [&[u8]; 8] = [
            b"\xff\xfe\x00",
            b"- 1\n- 2\n",
            b"7: {ros__parameters: {depth: 3}}",
            b"a: {b: 3}",
            b"a: {ros__parameters: 3}",
            b"a: {ros__parameters: {3: 4}}",
            b"a: b: c",
            long_name.as_bytes(),
        ];
        for text in texts {
            let error = of_file(text).unwrap_err().to_string();
            assert!(error.contains("params.yaml"), "{error}");
        }
        let endless = parse("--ros-args --params-file /dev/zero").unwrap_err().to_string();
        assert!(endless.contains("more than 8388608 bytes"), "{endless}");
        assert!(of_file(b"").is_ok());
    }

    #[test]
    fn a_value_on_the_command_line_is_bounded_like_one_in_a_file() {
        let value = |value: &str| {
            let args = ["--ros-args", "-p", value].map(str::to_owned);
            Setup::parse(&args, &Environment::default(), "cfodi").map(|(setup, _)| setup)
        };
        let error = value(&format!("depth:={}", "[".repeat(200))).unwrap_err().to_string();
        assert_eq!(error, "the value of depth is refused: YAML nested deeper than 64");
        let error = value("fixed_frame:=").unwrap_err().to_string();
        assert_eq!(error, "fixed_frame is given no value; an empty text is -p \"fixed_frame:=''\"");
        assert!(value("snapshot_path:=''").is_ok());
        let error = value("sensors:=[front, 3, 1.5, ~]").unwrap_err().to_string();
        let must = "it must be a boolean, a number, a text or a list of texts";
        assert_eq!(error, format!("sensors is [\"front\", 3, 1.5, null]; {must}"));
        for bad in [
            "depth:=",
            "depth:=*x",
            "depth:=[",
            ":=",
            "depth:=3:=4",
            "a:b:depth:=3",
            "depth:={a: 1}",
            "depth:=~",
        ] {
            assert!(value(bad).is_err(), "{bad}");
        }
        let nan = value("tf_timeout:=.nan").unwrap_err().to_string();
        assert_eq!(nan, "tf_timeout is NaN; it must be from 0 to 60 s");
    }

    #[test]
    fn names_that_cannot_be_are_refused() {
        for node in ["__node:=a/b", "__node:=", "__node:=7up", "__node:=\u{1b}[2J"] {
            let args = ["--ros-args", "-r", node].map(str::to_owned);
            assert!(Setup::parse(&args, &Environment::default(), "cfodi").is_err(), "{node}");
        }
        for namespace in ["__ns:=/a//b", "__ns:=bad//x", "__ns:=/a/", "__ns:=/1"] {
            let args = ["--ros-args", "-r", namespace].map(str::to_owned);
            let error = Setup::parse(&args, &Environment::default(), "cfodi").unwrap_err();
            assert!(matches!(error, ArgsError::Name(..) | ArgsError::Form(_)), "{namespace}: {error}");
        }
        for name in ["points:=/a//b", "points:=a b", "points:=/ä"] {
            let args = ["--ros-args", "-r", name].map(str::to_owned);
            let (setup, _) = Setup::parse(&args, &Environment::default(), "cfodi").unwrap();
            assert!(setup.resolve("points").is_err(), "{name}");
        }
    }

    #[test]
    fn a_domain_that_is_none_is_refused() {
        for domain in ["-1", "233", "1e2", "0x1", "99999999999999999999", " 1", "\u{fffd}"] {
            assert!(in_domain(domain).is_err(), "{domain}");
        }
        assert_eq!(in_domain("").unwrap(), 0);
    }

    #[test]
    fn every_file_under_config_is_possible() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("config");
        let files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        assert!(!files.is_empty());
        for file in files {
            parse(&format!("--ros-args --params-file {}", file.display())).unwrap();
        }
    }
}
