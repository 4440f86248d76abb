//! Rules that give names other names, as rcl reads them: of those that fit, the first counts.

use ros2args::{RemapRule, Ros2ArgsError};

/// What a name names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Topic,
    Service,
}

/// What rules for names of one kind begin with, but for the colon of `rostopic://`, at which the library would split.
const SCHEMES: [(&str, Kind); 2] = [("rostopic//", Kind::Topic), ("rosservice//", Kind::Service)];

/// A rule for topics or services.
#[derive(Clone, Debug)]
pub(super) struct Rule {
    /// `None`: for both.
    kind: Option<Kind>,
    pub(super) from: String,
    pub(super) to: String,
}

impl Rule {
    /// A rule of arguments that are [`readable`].
    pub(super) fn new(rule: &RemapRule) -> Self {
        let of_kind =
            SCHEMES.iter().find_map(|(scheme, kind)| Some((*kind, rule.from.strip_prefix(scheme)?)));
        let (kind, from) = of_kind.map_or((None, rule.from.as_str()), |(kind, from)| (Some(kind), from));
        Self { kind, from: from.to_owned(), to: rule.to.clone() }
    }

    pub(super) fn is_for(&self, kind: Kind) -> bool {
        !self.from.starts_with("__") && self.kind.is_none_or(|own| own == kind)
    }
}

/// The arguments as the library reads them: it takes the scheme of a rule for a node's name, and does not know
/// `--log-file-name`, which means nothing here.
///
/// # Errors
/// At a rule of another scheme, and where no name follows.
pub(super) fn readable(args: &[String]) -> Result<Vec<String>, Ros2ArgsError> {
    let mut readable = Vec::new();
    let (mut args, mut is_ros) = (args.iter(), false);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--ros-args" => is_ros = true,
            "--" => is_ros = false,
            "--log-file-name" if is_ros => {
                let name = args.next().filter(|name| !["--", "--ros-args"].contains(&name.as_str()));
                name.ok_or_else(|| Ros2ArgsError::MissingArgumentValue(arg.clone()))?;
                continue;
            }
            "-r" | "--remap" if is_ros => {
                readable.push(arg.clone());
                readable.extend(args.next().map(|rule| without_colon(rule)).transpose()?);
                continue;
            }
            _ => {}
        }
        readable.push(arg.clone());
    }
    Ok(readable)
}

/// A rule without the colon of its scheme.
fn without_colon(rule: &str) -> Result<String, Ros2ArgsError> {
    // Behind `:=` it is no scheme, and no name either, which is said where the name is looked up.
    let Some((before, name)) = rule.split_once("://").filter(|(before, _)| !before.contains(":=")) else {
        return Ok(rule.to_owned());
    };
    // The name of a node may stand before it.
    let scheme = format!("{}//", before.rsplit(':').next().unwrap_or_default());
    if name.starts_with(":=") || !SCHEMES.iter().any(|(known, _)| *known == scheme) {
        return Err(Ros2ArgsError::InvalidRemapRule(rule.to_owned()));
    }
    Ok(format!("{before}//{name}"))
}

#[cfg(test)]
mod tests {
    use crate::args::tests::parse;
    use crate::args::{Environment, Setup};

    #[test]
    fn a_rule_with_a_scheme_is_for_topics_or_for_services() {
        let table = [
            ("rostopic://~/save:=/a", "/a", "/cfodi/save"),
            ("rosservice://~/save:=/a", "/cfodi/save", "/a"),
            ("rosservice:///cfodi/save:=/a", "/cfodi/save", "/a"),
            ("cfodi:rostopic://~/save:=/a", "/a", "/cfodi/save"),
            ("other:rostopic://~/save:=/a", "/cfodi/save", "/cfodi/save"),
            ("~/save:=/a", "/a", "/a"),
        ];
        for (rule, topic, service) in table {
            let setup = parse(&format!("--ros-args -r {rule}")).unwrap();
            let resolved = [setup.resolve("~/save").unwrap(), setup.resolve_service("~/save").unwrap()];
            assert_eq!(resolved, [topic, service], "{rule}");
        }
    }

    #[test]
    fn a_rule_of_a_scheme_that_is_none_is_refused() {
        for rule in ["rosparam://a:=b", "://a:=b", "rostopic://:=b", "a:b:rostopic://c:=d"] {
            let error = parse(&format!("--ros-args --remap {rule}")).unwrap_err().to_string();
            assert!(error.starts_with("Invalid remapping rule '"), "{rule}: {error}");
        }
        assert!(parse("--ros-args -r points:=rostopic://a").unwrap().resolve("points").is_err());
    }

    #[test]
    fn the_name_of_a_log_file_means_nothing_and_costs_nothing() {
        let args =
            ["cfodi", "--log-file-name", "x", "--ros-args", "--log-file-name", "y", "-p", "depth:=3", "--"];
        let args: Vec<_> = args.iter().chain(&["--log-file-name", "z"]).map(|&arg| arg.to_owned()).collect();
        let (setup, rest) = Setup::parse(&args, &Environment::default(), "cfodi").unwrap();
        assert_eq!(setup.config().engine.depth(), 3);
        assert_eq!(rest, ["cfodi", "--log-file-name", "x", "--log-file-name", "z"]);
        for line in ["--ros-args --log-file-name", "--ros-args --log-file-name -- run"] {
            let error = parse(line).unwrap_err().to_string();
            assert_eq!(error, "Missing value for argument '--log-file-name'");
        }
    }
}
