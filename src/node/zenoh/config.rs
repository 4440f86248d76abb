//! The session's configuration, from where `rmw_zenoh` takes it: a file that `ZENOH_SESSION_CONFIG_URI` names, or what is below;
//! then what `ZENOH_CONFIG_OVERRIDE` says.

use serde_json::Value;
use zenoh::Config;

use crate::args::variable;
use crate::node::middleware::OpenError;
use crate::node::places::without_places;

const FILE: &str = "ZENOH_SESSION_CONFIG_URI";
const OVERRIDE: &str = "ZENOH_CONFIG_OVERRIDE";
const ATTEMPTS: &str = "ZENOH_ROUTER_CHECK_ATTEMPTS";

/// What `rmw_zenoh` has by default, where it is not Zenoh's own default; the last one is ours: a message that is larger is none
/// that the node could read, and each neighbour could make it hold one.
const DEFAULT: [(&str, &str); 15] = [
    ("mode", r#""peer""#),
    ("connect/endpoints", r#"["tcp/localhost:7447"]"#),
    ("connect/timeout_ms", "{router: -1, peer: -1, client: 0}"),
    ("connect/exit_on_failure", "{router: false, peer: false, client: true}"),
    ("listen/endpoints", r#"["tcp/localhost:0"]"#),
    ("scouting/multicast/enabled", "false"),
    ("scouting/gossip/target", r#"{router: ["router", "peer"], peer: ["router"]}"#),
    ("timestamping/enabled", "{router: true, peer: true, client: true}"),
    ("queries_default_timeout", "600000"),
    ("transport/unicast/open_timeout", "60000"),
    ("transport/unicast/accept_timeout", "60000"),
    ("transport/unicast/accept_pending", "10000"),
    ("transport/link/tx/lease", "60000"),
    ("transport/link/tx/keep_alive", "2"),
    ("transport/link/rx/max_message_size", "536870912"),
];

/// That of this process.
///
/// # Errors
/// When a variable cannot be, with its name and value.
pub(super) fn of_process() -> Result<Config, OpenError> {
    build(&trimmed(FILE), &trimmed(OVERRIDE))
}

/// How often to look for a router before the node goes on without; nothing where it does not look. As in ROS, 0 is for ever.
///
/// # Errors
/// When it is no number.
pub(super) fn router_checks() -> Result<Option<u64>, OpenError> {
    checks(&trimmed(ATTEMPTS))
}

/// A variable without the blanks around it; empty where it is not set.
fn trimmed(name: &str) -> String {
    variable(name).unwrap_or_default().trim().to_owned()
}

fn checks(text: &str) -> Result<Option<u64>, OpenError> {
    let number = if text.is_empty() { Ok(1) } else { text.parse::<i64>() };
    match number {
        Ok(0) => Ok(Some(u64::MAX)),
        Ok(number) => Ok(u64::try_from(number).ok()),
        Err(error) => Err(wrong(ATTEMPTS, text, &error)),
    }
}

fn build(file: &str, changes: &str) -> Result<Config, OpenError> {
    let mut config = if file.is_empty() {
        let mut config = Config::default();
        for (key, value) in DEFAULT {
            config
                .insert_json5(key, value)
                .map_err(|error| wrong("the default configuration", key, &error))?;
        }
        config
    } else {
        Config::from_file(file).map_err(|error| wrong(FILE, file, &error))?
    };
    for change in changes.split(';').map(str::trim).filter(|change| !change.is_empty()) {
        let (key, value) =
            change.split_once('=').ok_or_else(|| wrong(OVERRIDE, change, &"it must be key=value"))?;
        let inserted = config.insert_json5(key.trim(), value.trim());
        inserted.map_err(|error| wrong(OVERRIDE, change, &error))?;
    }
    match endpoints(&config).into_iter().find(|endpoint| !endpoint.starts_with(TCP)) {
        None => Ok(config),
        Some(other) if changes.contains(&other) => Err(wrong(OVERRIDE, &other, &NO_TCP)),
        Some(other) => Err(wrong(FILE, &other, &NO_TCP)),
    }
}

/// What the endpoints begin with that this program has.
const TCP: &str = "tcp/";
const NO_TCP: &str = "this program has TCP alone: tcp/HOST:PORT";

/// All that it connects to and listens at in its mode; those of other modes are not opened.
fn endpoints(config: &Config) -> Vec<String> {
    let value = |key| serde_json::from_str::<Value>(&config.get_json(key).ok()?).ok();
    let mode = value("mode").and_then(|mode| mode.as_str().map(str::to_owned));
    let of_mode = |list: Value| match list {
        Value::Object(mut by_mode) => by_mode.remove(mode.as_deref().unwrap_or("peer")),
        list => Some(list),
    };
    let lists = ["connect/endpoints", "listen/endpoints"].into_iter().filter_map(value).filter_map(of_mode);
    let lists = lists.filter_map(|list| serde_json::from_value::<Vec<String>>(list).ok());
    lists.flatten().collect()
}

fn wrong(name: &'static str, value: &str, text: &impl ToString) -> OpenError {
    OpenError::Variable { name, value: value.to_owned(), text: without_places(&text.to_string()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_variables_it_is_a_peer_of_the_router_on_this_machine() {
        let config = build("", "").unwrap();
        assert!(config.get_json("connect/endpoints").unwrap().contains("tcp/localhost:7447"));
        assert_eq!(config.get_json("scouting/multicast/enabled").unwrap(), "false");
    }

    #[test]
    fn endpoints_of_a_mode_that_it_is_not_in_may_be_of_any_transport() {
        let lists = r#"connect/endpoints={router: ["tls/r:7447"], client: ["tcp/r:7447"]}"#;
        assert!(build("", lists).is_ok());
        assert!(build("", &format!(r#"mode="client";{lists}"#)).is_ok());
        assert!(build("", &format!(r#"mode="router";{lists}"#)).is_err());
    }

    #[test]
    fn what_is_overridden_goes_before_the_file_and_the_default() {
        let config = build("", r#" mode="client" ; connect/endpoints=["tcp/10.0.0.1:7447"];"#).unwrap();
        assert_eq!(config.get_json("mode").unwrap(), r#""client""#);
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("session.json5");
        std::fs::write(&file, "{mode: 'router'}").unwrap();
        let file = file.to_str().unwrap();
        assert_eq!(build(file, "").unwrap().get_json("mode").unwrap(), r#""router""#);
        assert_eq!(build(file, "mode='peer'").unwrap().get_json("mode").unwrap(), r#""peer""#);
    }

    #[test]
    fn what_cannot_be_is_refused_with_name_and_value() {
        for (file, changes, words) in [
            ("/no/such.json5", "", "ZENOH_SESSION_CONFIG_URI is \"/no/such.json5\": "),
            ("", "mode", "ZENOH_CONFIG_OVERRIDE is \"mode\": it must be key=value"),
            ("", "mode=nothing", "ZENOH_CONFIG_OVERRIDE is \"mode=nothing\": "),
            ("", "no/such/key=1", "ZENOH_CONFIG_OVERRIDE is \"no/such/key=1\": "),
            (
                "",
                r#"connect/endpoints=["tls/r:7447"]"#,
                "ZENOH_CONFIG_OVERRIDE is \"tls/r:7447\": this program",
            ),
            (
                "",
                r#"listen/endpoints={peer: ["tcp/[::1]:0", "udp/[::1]:0"]}"#,
                "ZENOH_CONFIG_OVERRIDE is \"udp/[::1]:0\": this program has TCP alone",
            ),
        ] {
            let error = build(file, changes).err().map(|error| error.to_string()).unwrap_or_default();
            assert!(error.starts_with(words) && !error.contains(".rs:"), "{error}");
        }
        let checked = |text| checks(text).map_err(|error| error.to_string());
        assert_eq!([checked(""), checked("0"), checked("-1")], [Ok(Some(1)), Ok(Some(u64::MAX)), Ok(None)]);
        assert!(checked("one").unwrap_err().starts_with("ZENOH_ROUTER_CHECK_ATTEMPTS is \"one\": "));
    }
}
