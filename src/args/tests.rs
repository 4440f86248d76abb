//! What arguments give.

use super::*;
use crate::config::Value;

pub(super) fn parse(line: &str) -> Result<Setup, ArgsError> {
    let args: Vec<_> = line.split_whitespace().map(str::to_owned).collect();
    Setup::parse(&args, &Environment::default(), "cfodi").map(|(setup, _)| setup)
}

#[test]
fn names_are_expanded_and_then_remapped() {
    let setup =
        parse("run --ros-args -r __ns:=/robot -r points:=/camera/depth/points -r ~/clusters:=walls").unwrap();
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
fn a_noise_model_that_one_sensor_gives_to_others_is_said() {
    let said = |parameters: &str| {
        let setup = parse(&format!("--ros-args -p sensors:=[front,rear,left] {parameters}")).unwrap();
        setup.warnings().to_vec()
    };
    assert_eq!(
        said("-p rear.noise_model:=none"),
        ["rear.noise_model is none: front, left are weighed by it too"]
    );
    let two = "-p rear.noise_model:=none -p left.noise_model:=none";
    assert_eq!(said(two), ["rear.noise_model is none: front is weighed by it too"]);
    for as_meant in [
        "",
        "-p rear.noise_model:=kinect_v1",
        "-p noise_model:=none -p rear.noise_model:=none",
        &format!("{two} -p front.noise_model:=none"),
    ] {
        assert!(said(as_meant).is_empty(), "{as_meant}");
    }
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
        assert_eq!(parse(&format!("--ros-args {rules}")).unwrap().fully_qualified_name(), name, "{rules}");
    }
}

#[test]
fn files_count_in_order_and_p_after_them() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("params.yaml");
    let text = "/**:\n  ros__parameters:\n    depth: 3\n    voxel_size: 1\n/other:\n  ros__parameters:\n    depth: 8\n";
    std::fs::write(&file, text).unwrap();
    let setup = parse(&format!("--ros-args -p depth:=2 --params-file {}", file.display())).unwrap();
    assert_eq!(setup.config().engine.depth(), 2);
    assert!((setup.config().engine.voxel_size() - 1.0).abs() < f64::EPSILON);
    assert_eq!(setup.parameters.get("voxel_size").unwrap().1, &Value::Double(1.0));
}

#[test]
fn what_cannot_be_is_refused_with_name_and_value() {
    assert!(
        parse("--ros-args -p depht:=3").unwrap_err().to_string().contains("nearest known one is `depth`")
    );
    assert!(
        parse("--ros-args --params-file /no/such.yaml").unwrap_err().to_string().contains("/no/such.yaml")
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
    let server = "ROS_DISCOVERY_SERVER";
    assert_eq!(set(&[("ROS_DISCOVERY_SERVER", "10.0.0.1:11811")]), [(server, "10.0.0.1:11811".to_owned())]);
    assert!(set(&[("ROS_DISCOVERY_SERVER", "")]).is_empty());
    assert_eq!(set(&[("ROS_LOCALHOST_ONLY", "1"), ("ROS_STATIC_PEERS", "10.0.0.1")]).len(), 2);
    let settings: &[_] = &[
        ("CYCLONEDDS_URI", "file:///cyclonedds.xml"),
        ("FASTDDS_BUILTIN_TRANSPORTS", "LARGE_DATA"),
        ("FASTDDS_DEFAULT_PROFILES_FILE", "profiles.xml"),
        ("FASTRTPS_DEFAULT_PROFILES_FILE", "profiles.xml"),
    ];
    assert_eq!(set(settings).len(), 4);
    let as_ever = [
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "subnet"),
        ("ROS_LOCALHOST_ONLY", "0"),
        ("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4"),
        ("CYCLONEDDS_URI", ""),
    ];
    assert!(
        discovery(|name| as_ever.iter().find(|pair| pair.0 == name).map(|pair| pair.1.to_owned())).is_empty()
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
fn what_a_file_has_for_another_node_is_not_refused_whatever_its_names_look_like() {
    let text = b"/**: {ros__parameters: {depth: 3}}\nmotors: {ros__parameters: {1: {kp: 3.0}, true: 2}}\n";
    assert_eq!(of_file(text).unwrap().config().engine.depth(), 3);
    let error = of_file(b"/**: {ros__parameters: {1: {kp: 3.0}}}").unwrap_err().to_string();
    assert!(error.contains("unknown parameter `1.kp`"), "{error}");
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
    let error = of_file(yaml::billion_laughs().as_bytes()).unwrap_err().to_string();
    assert!(error.contains("more than 1000000 nodes"), "{error}");
}

#[test]
fn a_parameter_file_that_is_none_is_refused_with_its_name() {
    let long_name = format!("{}:\n  ros__parameters: {{depth: 3}}\n", "/**".repeat(10_000));
    let texts: [&[u8]; 7] = [
        b"\xff\xfe\x00",
        b"- 1\n- 2\n",
        b"7: {ros__parameters: {depth: 3}}",
        b"a: {b: 3}",
        b"a: {ros__parameters: 3}",
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
    assert!(
        error.starts_with("sensors is [\"front\", 3, 1.5, null]; it must be a list of 1 to 16 names"),
        "{error}"
    );
    let error = value("voxel_size:=[0.05]").unwrap_err().to_string();
    assert_eq!(error, "voxel_size is [0.05]; it must be a number");
    let error = value("size:=[0.05]").unwrap_err().to_string();
    assert_eq!(error, "size is [0.05]; it must be a boolean, a number, a text or a list of texts");
    // What the shell makes of -p sensors:=["front", "rear"].
    let error = value("sensors:=[front,").unwrap_err().to_string();
    let words =
        "sensors is `[front,`, which is cut short: quote the whole of it for the shell: -p 'sensors:=[...]'";
    assert_eq!(error, words);
    for (value_of, words) in [
        ("sensors:=*x", "sensors is `*x`, which is no YAML: "),
        ("sensors:=[front]]", "sensors is `[front]]`, which is no YAML: "),
        (&format!("sensors:=[{}", "front, ".repeat(1000)), "sensors is `[front, front, "),
    ] {
        let error = value(value_of).unwrap_err().to_string();
        assert!(error.starts_with(words) && error.len() < 200, "{error}");
    }
    let error = value("sensors:=front").unwrap_err().to_string();
    assert!(error.ends_with("64 at most, as [\"front\", \"rear\"]"), "{error}");
    for bad in
        ["depth:=", "depth:=*x", "depth:=[", ":=", "depth:=3:=4", "a:b:depth:=3", "depth:={a: 1}", "depth:=~"]
    {
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
    let table = [
        "-1",
        "233",
        "0351",
        "0xe9",
        "1e2",
        "7 ",
        "7x",
        "08",
        "0x",
        "x10",
        "+-1",
        "--1",
        "0x-1",
        "0x+1",
        " ",
        "+",
        "0b1",
        "0o7",
        "99999999999999999999",
        "18446744073709551616",
        "\u{a0}1",
        "\u{fffd}",
    ];
    for domain in table {
        assert!(in_domain(domain).is_err(), "{domain}");
    }
}

#[test]
fn a_domain_is_read_as_ros_reads_it_and_both_readings_are_said_where_they_differ() {
    let table = [
        ("", 0),
        ("0", 0),
        ("-0", 0),
        ("7", 7),
        ("+7", 7),
        ("232", 232),
        ("042", 34),
        ("007", 7),
        ("00", 0),
        (" 42", 42),
        ("\t\n\x0b\x0c\r 42", 42),
        ("0x10", 16),
        ("0Xe8", 232),
        (" +0x2a", 42),
        ("-18446744073709551615", 1),
    ];
    for (text, domain) in table {
        assert_eq!(in_domain(text).unwrap(), domain, "{text:?}");
    }
    let said = |text: &str| {
        let environment = Environment { domain: Some(text.to_owned()), ..Environment::default() };
        Setup::parse(&[], &environment, "cfodi").unwrap().0.warnings().to_vec()
    };
    let line = "ROS_DOMAIN_ID is \"042\", which is domain 34 and not 42: as in C a number that begins with 0 is octal";
    assert_eq!(said("042"), [line]);
    for alike in ["", "0", "00", "007", "42", " 42", "0x10"] {
        assert!(said(alike).is_empty(), "{alike}");
    }
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

/// The node as a script of `launch_scripts` starts it, and its other arguments: instead of the program, its command line is said.
fn started(script: &str, arguments: &str) -> (Setup, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let said = folder.path().join("said");
    std::fs::write(&said, "cfodi() { :; }\nexec() { printf '%s\\n' \"$@\"; }\n").unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("launch_scripts").join(script);
    let mut bash = std::process::Command::new("bash");
    bash.arg(script).args(arguments.split_whitespace()).env("BASH_ENV", &said);
    let done = bash.output().unwrap();
    let line = String::from_utf8(done.stdout).unwrap();
    let args: Vec<_> = line.lines().skip(1).map(str::to_owned).collect();
    Setup::parse(&args, &Environment::default(), "cfodi").unwrap()
}

#[test]
fn what_a_script_is_given_counts_before_what_it_says_itself() {
    let table = [
        ("kinect.sh", "", "points", "/camera/depth/points"),
        ("kinect.sh", "/a", "points", "/a"),
        ("kinect.sh", "-r points:=/x", "points", "/x"),
        ("kinect.sh", "/a -r points:=/x", "points", "/x"),
        ("kinect.sh", "-r __ns:=/robot -p depth:=3", "points", "/camera/depth/points"),
        ("kinect.sh", "-r points:=/x -- --resume", "points", "/x"),
        ("kinect.sh", "-- --resume", "points", "/camera/depth/points"),
        ("depth.sh", "/a/image", "depth/image", "/a/image"),
        ("depth.sh", "/a/image", "depth/camera_info", "/a/camera_info"),
        ("depth.sh", "-r depth/image:=/x", "depth/image", "/x"),
        ("depth.sh", "/a/image -r depth/camera_info:=/x", "depth/camera_info", "/x"),
        ("depth.sh", "/a/image -r depth/camera_info:=/x", "depth/image", "/a/image"),
    ];
    for (script, arguments, name, expected) in table {
        let (setup, rest) = started(script, arguments);
        assert_eq!(setup.resolve(name).unwrap(), expected, "{script} {arguments}");
        let resume = arguments.ends_with("--resume").then_some("--resume");
        assert!(rest.iter().map(String::as_str).eq(["run"].into_iter().chain(resume)), "{rest:?}");
    }
    for script in ["kinect.sh", "depth.sh"] {
        let voxel_size = |arguments| started(script, arguments).0.config().engine.voxel_size();
        assert_eq!((voxel_size(""), voxel_size("-p voxel_size:=0.05")), (0.08, 0.05));
    }
}

#[test]
fn a_script_is_itself_behind_a_link_and_tells_how_it_is_used() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let bin = tempfile::tempdir().unwrap();
    for name in ["kinect.sh", "depth.sh"] {
        let link = bin.path().join(name);
        std::os::unix::fs::symlink(root.join("launch_scripts").join(name), &link).unwrap();
        let (setup, _) = started(link.to_str().unwrap(), "");
        assert_eq!(setup.parameters.get("noise_model").unwrap().1, &Value::Text("kinect_v1".to_owned()));
        let told = std::process::Command::new("bash").arg(&link).arg("-h").output().unwrap();
        let words = format!("usage: launch_scripts/{name} [");
        assert!(told.status.success() && String::from_utf8(told.stdout).unwrap().starts_with(&words));
    }
    for script in ["docs/make.sh", "docs/tune/make.sh"] {
        let ended = std::process::Command::new("bash").arg(root.join(script)).output().unwrap();
        let said = String::from_utf8(ended.stderr).unwrap();
        assert!(!ended.status.success() && said.contains(&format!("usage: bash {script} CFODI")), "{said}");
    }
}
