//! DDS Security as SROS 2 sets it up: what environment and `--enclave` ask for -> what the node does, before it opens a
//! socket.
//!
//! The meaning is that of ROS's client library, with one difference: there a misspelt value of `ROS_SECURITY_ENABLE` or
//! `ROS_SECURITY_STRATEGY` switches security off without a word; here it is an error. Keys lie in
//! `KEYSTORE/enclaves/ENCLAVE`; whether they are good is for the middleware to say.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::variable;

/// Whether DDS Security was built in.
pub const BUILT_IN: bool = cfg!(feature = "security");

/// What an enclave's folder holds.
pub const FILES: [&str; 6] = [
    "identity_ca.cert.pem",
    "cert.pem",
    "key.pem",
    "permissions_ca.cert.pem",
    "governance.p7s",
    "permissions.p7s",
];

/// What environment and command line ask for, in their words; an empty text counts as none.
#[derive(Clone, Debug, Default)]
pub struct Asked {
    /// `ROS_SECURITY_ENABLE`.
    pub enable: Option<String>,
    /// `ROS_SECURITY_STRATEGY`.
    pub strategy: Option<String>,
    /// `ROS_SECURITY_KEYSTORE`.
    pub keystore: Option<String>,
    /// `ROS_SECURITY_ENCLAVE_OVERRIDE`.
    pub enclave_override: Option<String>,
    /// `--enclave`.
    pub enclave: Option<String>,
}

/// What the node does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Security {
    /// Nobody asked for it.
    Off,
    /// It was asked for and cannot be had, and the strategy lets the node go on without.
    Unsecured(SecurityError),
    /// It talks to nobody without keys.
    Keys(Enclave),
}

/// An enclave whose files are all there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Enclave {
    /// Fully qualified name.
    pub name: String,
    /// Where its [`FILES`] are.
    pub folder: PathBuf,
}

/// Security that was asked for and cannot be had.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum SecurityError {
    /// A variable with a value that it cannot have.
    #[error("{name} is {value:?}; it must be {must}")]
    Value {
        /// The variable.
        name: &'static str,
        /// As given.
        value: String,
        /// The values it can have.
        must: &'static str,
    },
    /// The cargo feature `security` is absent.
    #[error(
        "ROS_SECURITY_ENABLE asks for DDS Security, which was not built in: build with `cargo install --path . \
         --features security`"
    )]
    NotBuiltIn,
    /// It was asked for where the middleware is Zenoh.
    #[error(
        "ROS_SECURITY_ENABLE asks for security, which `ros2 security` gives to DDS alone, and RMW_IMPLEMENTATION is \
         rmw_zenoh_cpp"
    )]
    OverZenoh,
    /// No keystore.
    #[error(
        "ROS_SECURITY_ENABLE asks for DDS Security, and ROS_SECURITY_KEYSTORE is not set; it must be a keystore's folder"
    )]
    NoKeystore,
    /// The enclave's folder is not there.
    #[error(
        "there is no folder {} of enclave {}: make it with `ros2 security create_enclave`, or name another enclave with \
         --ros-args --enclave", .0.folder.display(), .0.name
    )]
    NoFolder(Enclave),
    /// The enclave's folder is incomplete.
    #[error("the folder {} of enclave {} lacks {}", .enclave.folder.display(), .enclave.name, .files.join(", "))]
    NoFiles {
        /// The enclave.
        enclave: Enclave,
        /// What it lacks.
        files: Vec<&'static str>,
    },
    /// The keys are no good.
    #[error("the keys in {} of enclave {} were refused: {text}", .enclave.folder.display(), .enclave.name)]
    Refused {
        /// The enclave.
        enclave: Enclave,
        /// Why.
        text: String,
    },
}

impl Asked {
    /// What the variables of this process ask for.
    pub fn of_process() -> Self {
        // One that is no text must not switch security off.
        Self {
            enable: variable("ROS_SECURITY_ENABLE"),
            strategy: variable("ROS_SECURITY_STRATEGY"),
            keystore: variable("ROS_SECURITY_KEYSTORE"),
            enclave_override: variable("ROS_SECURITY_ENCLAVE_OVERRIDE"),
            enclave: None,
        }
    }

    /// What the node does about it: `built_in` says whether it can secure anything, `is_there` whether a file or folder
    /// is there.
    ///
    /// # Errors
    /// When a value cannot be, or keys may be there and cannot be looked at; with the strategy `Enforce` also when security
    /// cannot be had.
    pub fn decide(
        &self,
        built_in: bool,
        is_there: impl Fn(&Path) -> io::Result<bool>,
    ) -> Result<Security, SecurityError> {
        let Some(enforce) = self.enforces()? else { return Ok(Security::Off) };
        let (source, name) = self.enclave_name();
        if !is_enclave(name) {
            return Err(wrong(
                source,
                name,
                "a fully qualified name of letters, digits and `_`, as in /robot/cfodi",
            ));
        }
        match self.look_up(name, built_in, is_there) {
            Ok(enclave) => Ok(Security::Keys(enclave)),
            Err(why @ SecurityError::Refused { .. }) => Err(why),
            Err(why) if enforce => Err(why),
            Err(why) => Ok(Security::Unsecured(why)),
        }
    }

    /// What the node does about it over Zenoh, for which there are no keys.
    ///
    /// # Errors
    /// When a value cannot be, and with the strategy `Enforce`: nothing is said in clear that was to be secured.
    pub fn decide_over_zenoh(&self) -> Result<Security, SecurityError> {
        match self.enforces()? {
            None => Ok(Security::Off),
            Some(true) => Err(SecurityError::OverZenoh),
            Some(false) => Ok(Security::Unsecured(SecurityError::OverZenoh)),
        }
    }

    /// Whether there must be security; nothing where nobody asked for it.
    fn enforces(&self) -> Result<Option<bool>, SecurityError> {
        match text(self.enable.as_ref()) {
            "true" => {}
            "" | "false" => return Ok(None),
            other => return Err(wrong("ROS_SECURITY_ENABLE", other, "`true` or `false`")),
        }
        match text(self.strategy.as_ref()) {
            "Enforce" => Ok(Some(true)),
            "" | "Permissive" => Ok(Some(false)),
            other => Err(wrong("ROS_SECURITY_STRATEGY", other, "`Enforce` or `Permissive`")),
        }
    }

    /// The enclave's name, after where it comes from.
    fn enclave_name(&self) -> (&'static str, &str) {
        match (text(self.enclave_override.as_ref()), text(self.enclave.as_ref())) {
            ("", "") => ("--enclave", "/"),
            ("", enclave) => ("--enclave", enclave),
            (instead, _) => ("ROS_SECURITY_ENCLAVE_OVERRIDE", instead),
        }
    }

    fn look_up(
        &self,
        name: &str,
        built_in: bool,
        is_there: impl Fn(&Path) -> io::Result<bool>,
    ) -> Result<Enclave, SecurityError> {
        if !built_in {
            return Err(SecurityError::NotBuiltIn);
        }
        let keystore = text(self.keystore.as_ref());
        if keystore.is_empty() {
            return Err(SecurityError::NoKeystore);
        }
        let mut folder = Path::new(keystore).join("enclaves");
        folder.extend(name.split('/').filter(|part| !part.is_empty()));
        let enclave = Enclave { name: name.to_owned(), folder };
        // What cannot be looked at may be there.
        let look = |path: &Path| {
            is_there(path).map_err(|error| {
                let (enclave, text) = (enclave.clone(), format!("{}: {error}", path.display()));
                SecurityError::Refused { enclave, text }
            })
        };
        if !look(&enclave.folder)? {
            return Err(SecurityError::NoFolder(enclave));
        }
        let mut files = Vec::new();
        for file in FILES {
            if !look(&enclave.folder.join(file))? {
                files.push(file);
            }
        }
        if files.is_empty() { Ok(enclave) } else { Err(SecurityError::NoFiles { enclave, files }) }
    }
}

/// For which topics a governance document protects data by itself, beside the messages that carry it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DataProtection {
    /// For none.
    OfNothing,
    /// For those of some rules.
    OfSome,
    /// For all.
    OfAll,
}

/// Reads it from a governance document, signed or not.
pub fn data_protection(governance: &str) -> DataProtection {
    let kinds = governance.split("<data_protection_kind>").skip(1);
    let protected: Vec<_> =
        kinds.map(|rest| rest.split('<').next().unwrap_or_default().trim() != "NONE").collect();
    match (protected.contains(&true), protected.contains(&false)) {
        (false, _) => DataProtection::OfNothing,
        (true, true) => DataProtection::OfSome,
        (true, false) => DataProtection::OfAll,
    }
}

fn wrong(name: &'static str, value: &str, must: &'static str) -> SecurityError {
    SecurityError::Value { name, value: value.to_owned(), must }
}

fn text(value: Option<&String>) -> &str {
    value.map_or("", String::as_str)
}

/// As ROS has it, which keeps it inside the keystore.
fn is_enclave(name: &str) -> bool {
    let is_part = |part: &str| {
        part.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
            && part.chars().all(|char| char.is_ascii_alphanumeric() || char == '_')
    };
    name == "/" || name.strip_prefix('/').is_some_and(|parts| parts.split('/').all(is_part))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `ENABLE STRATEGY KEYSTORE OVERRIDE ENCLAVE`, `-` where one is not set.
    fn asked(line: &str) -> Asked {
        let mut words = line.split_whitespace().map(|word| (word != "-").then(|| word.replace('"', "")));
        let mut word = || words.next().unwrap();
        Asked {
            enable: word(),
            strategy: word(),
            keystore: word(),
            enclave_override: word(),
            enclave: word(),
        }
    }

    /// With a keystore `/k` that holds the enclaves `/` and `/robot/cfodi`, and `/half` without its keys.
    fn decide(line: &str, built_in: bool) -> String {
        let is_there = |path: &Path| {
            if path.ends_with("locked") {
                return Err(io::ErrorKind::PermissionDenied.into());
            }
            let Ok(inside) = path.strip_prefix("/k/enclaves") else { return Ok(false) };
            let folder = if inside.extension().is_some() { inside.parent().unwrap() } else { inside };
            let is_key = path.ends_with("key.pem") || path.ends_with("cert.pem");
            Ok(match folder.to_str().unwrap() {
                "" | "robot/cfodi" => true,
                "half" => !is_key,
                _ => false,
            })
        };
        match asked(line).decide(built_in, is_there) {
            Ok(Security::Off) => "off".to_owned(),
            Ok(Security::Unsecured(why)) => format!("unsecured: {why}"),
            Ok(Security::Keys(enclave)) => format!("{} in {}", enclave.name, enclave.folder.display()),
            Err(why) => format!("refused: {why}"),
        }
    }

    #[test]
    fn who_does_not_ask_gets_none_whatever_else_is_set() {
        for line in
            ["- - - - -", "\"\" Enforce /k - /robot/cfodi", "false Enforce - - -", "false enforce - - x"]
        {
            assert_eq!(
                (decide(line, true), decide(line, false)),
                ("off".to_owned(), "off".to_owned()),
                "{line}"
            );
        }
    }

    #[test]
    fn keys_are_those_of_the_enclave() {
        for (line, keys) in [
            ("true Enforce /k - -", "/ in /k/enclaves"),
            ("true Enforce /k \"\" /", "/ in /k/enclaves"),
            ("true Enforce /k - /robot/cfodi", "/robot/cfodi in /k/enclaves/robot/cfodi"),
            ("true Permissive /k - /robot/cfodi", "/robot/cfodi in /k/enclaves/robot/cfodi"),
            ("true - /k/ /robot/cfodi /other", "/robot/cfodi in /k/enclaves/robot/cfodi"),
        ] {
            assert_eq!(decide(line, true), keys, "{line}");
        }
    }

    #[test]
    fn without_keys_enforce_refuses_and_permissive_says_why_it_goes_on() {
        for (rest, built_in, why) in [
            ("/k - -", false, "not built in"),
            ("- - -", true, "ROS_SECURITY_KEYSTORE is not set"),
            ("\"\" - -", true, "ROS_SECURITY_KEYSTORE is not set"),
            ("/k - /robot", true, "no folder /k/enclaves/robot of enclave /robot"),
            ("/other - -", true, "no folder /other/enclaves of enclave /"),
            ("/k /missing /robot/cfodi", true, "no folder /k/enclaves/missing of enclave /missing"),
            ("/k - /half", true, "/k/enclaves/half of enclave /half lacks cert.pem, key.pem"),
        ] {
            let enforced = decide(&format!("true Enforce {rest}"), built_in);
            assert!(enforced.starts_with("refused: ") && enforced.contains(why), "{rest}: {enforced}");
            for strategy in ["Permissive", "-"] {
                let permitted = decide(&format!("true {strategy} {rest}"), built_in);
                assert!(
                    permitted.starts_with("unsecured: ") && permitted.contains(why),
                    "{rest}: {permitted}"
                );
            }
        }
    }

    #[test]
    fn keys_that_cannot_be_looked_at_are_refused_whatever_the_strategy() {
        for strategy in ["Enforce", "Permissive", "-"] {
            let refused = decide(&format!("true {strategy} /k - /locked"), true);
            let why = "refused: the keys in /k/enclaves/locked of enclave /locked were refused: /k/enclaves/locked: ";
            assert!(refused.starts_with(why), "{refused}");
        }
    }

    #[test]
    fn a_value_that_cannot_be_is_refused_with_its_name() {
        for (line, why) in [
            ("True Enforce /k - -", "ROS_SECURITY_ENABLE is \"True\""),
            ("1 - - - -", "ROS_SECURITY_ENABLE is \"1\""),
            ("true enforce /k - -", "ROS_SECURITY_STRATEGY is \"enforce\""),
            ("true Permissive /k - robot", "--enclave is \"robot\""),
            ("true Permissive /k - /robot/", "--enclave is \"/robot/\""),
            ("true Permissive /k - /robot//cfodi", "--enclave is \"/robot//cfodi\""),
            ("true Enforce /k - /../../keys", "--enclave is \"/../../keys\""),
            ("true Enforce /k - /1st", "--enclave is \"/1st\""),
            ("true Enforce /k robot /robot/cfodi", "ROS_SECURITY_ENCLAVE_OVERRIDE is \"robot\""),
        ] {
            let refused = decide(line, true);
            assert!(refused.starts_with("refused: ") && refused.contains(why), "{line}: {refused}");
        }
    }

    #[test]
    fn data_is_protected_where_a_rule_says_so() {
        let of = |kinds: &[&str]| {
            let rule = |kind: &&str| format!("<data_protection_kind>{kind}\n</data_protection_kind>\n");
            data_protection(&kinds.iter().map(rule).collect::<String>())
        };
        assert_eq!((of(&[]), of(&["NONE", "NONE"])), (DataProtection::OfNothing, DataProtection::OfNothing));
        assert_eq!(of(&["ENCRYPT", "NONE"]), DataProtection::OfSome);
        assert_eq!(
            (of(&["ENCRYPT"]), of(&["SIGN", "ENCRYPT"])),
            (DataProtection::OfAll, DataProtection::OfAll)
        );
    }
}
