//! For which node a parameter is, and which of several values counts.

use super::*;

fn parse(line: &str) -> Result<Setup, ArgsError> {
    let args: Vec<_> = line.split_whitespace().map(str::to_owned).collect();
    Setup::parse(&args, &Environment::default(), "cfodi").map(|(setup, _)| setup)
}

/// The `depth` of the node with these arguments and a file of this text; the default is 4.
fn depth(arguments: &str, text: &str) -> u8 {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("params.yaml");
    std::fs::write(&file, text).unwrap();
    let line = format!("--ros-args {arguments} --params-file {}", file.display());
    parse(&line).unwrap().config().engine.depth()
}

#[test]
fn a_file_is_for_the_nodes_that_its_names_match() {
    let table = [
        ("", "/**", 3),
        ("", "/*", 3),
        ("", "cfodi", 3),
        ("", "/cfodi", 3),
        ("", "/**/cfodi", 3),
        ("", "other", 4),
        ("", "/robot/cfodi", 4),
        ("", "/*/cfodi", 4),
        ("-r __ns:=/robot", "/**", 3),
        ("-r __ns:=/robot", "/*", 4),
        ("-r __ns:=/robot", "/robot/*", 3),
        ("-r __ns:=/robot", "/*/cfodi", 3),
        ("-r __ns:=/robot", "robot/cfodi", 3),
        ("-r __ns:=/robot", "cfodi", 4),
        ("-r __ns:=/a/b", "/a/*", 4),
        ("-r __ns:=/a/b", "/a/**", 3),
        ("-r __node:=eyes", "eyes", 3),
        ("-r __node:=eyes", "cfodi", 4),
    ];
    for (arguments, key, expected) in table {
        let found = depth(arguments, &format!("{key}: {{ros__parameters: {{depth: 3}}}}"));
        assert_eq!(found, expected, "{arguments} {key}");
    }
    assert_eq!(depth("-r __ns:=/robot", "robot: {cfodi: {ros__parameters: {depth: 3}}}"), 3);
    assert_eq!(depth("-r __ns:=/robot", "/**: {cfodi: {ros__parameters: {depth: 3}}}"), 3);
}

#[test]
fn later_values_count_and_those_for_another_node_do_not() {
    let file = "/**: {ros__parameters: {depth: 3}}\ncfodi: {ros__parameters: {depth: 5}}";
    assert_eq!(depth("", file), 5);
    for (arguments, expected) in [
        ("-p depth:=2", 2),
        ("-p depth:=2 -p depth:=6", 6),
        ("-p cfodi:depth:=2", 2),
        ("-p other:depth:=2", 5),
        ("-r __node:=eyes -p eyes:depth:=2", 2),
        ("-r __ns:=/robot -p cfodi:depth:=2", 3),
    ] {
        assert_eq!(depth(arguments, file), expected, "{arguments}");
    }
}

#[test]
fn sections_of_one_name_are_read_both_and_of_a_parameter_the_last_value_counts() {
    let table = [
        ("/**: {ros__parameters: {depth: 3}}\n/**: {ros__parameters: {depth: 5}}", 5),
        ("/**: {ros__parameters: {depth: 3}}\n/**: {ros__parameters: {min_points: 5}}", 3),
        ("/**:\n  ros__parameters:\n    depth: 3\n  ros__parameters:\n    min_points: 5\n", 3),
        ("/**: {ros__parameters: {depth: 3, min_points: 9, depth: 6}}", 6),
        ("/**: {cfodi: {ros__parameters: {depth: 3}}, cfodi: {ros__parameters: {depth: 2}}}", 2),
        ("/**: {ros__parameters: {depth: 3}}\nother: {ros__parameters: {depth: 5, depth: 6}}", 3),
    ];
    for (text, expected) in table {
        assert_eq!(depth("", text), expected, "{text}");
    }
}

#[test]
fn of_a_parameter_that_stands_twice_in_one_map_it_is_said_which_value_counts() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("robot.yaml");
    let said = |text: &str| {
        std::fs::write(&file, text).unwrap();
        let setup = parse(&format!("--ros-args --params-file {}", file.display())).unwrap();
        (setup.config().engine.depth(), setup.warnings().to_vec())
    };
    let line = format!("{} has depth twice in one map: the last value counts", file.display());
    assert_eq!(said("/**: {ros__parameters: {depth: 3, min_points: 9, depth: 6}}"), (6, vec![line]));
    let other = "/**: {ros__parameters: {depth: 3}}\nother: {ros__parameters: {depth: 5, depth: 6}}";
    assert_eq!(said(other), (3, Vec::new()));
}

#[test]
fn words_and_numbers_are_read_as_ros_reads_them() {
    let setup =
        parse("--ros-args -p clearing:=off -p use_sim_time:=Yes -p optical:=no -p keep_radius:=3").unwrap();
    assert!(!setup.config().engine.clearing() && setup.config().use_sim_time);
    assert_eq!(setup.config().filter.optical, crate::cloud::Optical::No);
    assert_eq!(setup.config().engine.keep_radius(), 3.0);
    for wrong in ["clearing:=1", "clearing:=oN", "depth:=3.0", "depth:=yes", "fixed_frame:=5", "mode:=true"] {
        assert!(parse(&format!("--ros-args -p {wrong}")).is_err(), "{wrong}");
    }
}

#[test]
fn what_every_node_of_ros_has_is_taken_and_named_and_what_no_one_knows_is_refused_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("robot.yaml");
    let of_all = |more: &str| {
        let all = "start_type_description_service: false, qos_overrides: {/tf: {publisher: {depth: 9}}}";
        let text = format!("/**: {{ros__parameters: {{{all}}}}}\ncfodi: {{ros__parameters: {{{more}}}}}");
        std::fs::write(&file, text).unwrap();
        parse(&format!("--ros-args --params-file {}", file.display()))
    };
    let setup = of_all("depth: 3").unwrap();
    assert_eq!(setup.config().engine.depth(), 3);
    assert!(setup.idle().eq(["qos_overrides", "start_type_description_service"]));
    assert!(!setup.is_given("start_type_description_service"));
    assert_eq!(parse("").unwrap().idle().count(), 0);
    let error = of_all("depht: 3").unwrap_err().to_string();
    let (begin, end) =
        ("unknown parameter `depht`", format!("it stands in {} under `cfodi`", file.display()));
    assert!(error.starts_with(begin) && error.ends_with(&end), "{error}");
    assert!(!parse("--ros-args -p depht:=3").unwrap_err().to_string().contains("stands in"));
    assert!(parse("--ros-args -p qos_override.depth:=3").is_err());
}

#[test]
fn of_two_ranges_that_contradict_each_other_the_file_is_named_that_counts_last() {
    let folder = tempfile::tempdir().unwrap();
    let line = |files: &[(&str, &str)]| {
        let files = files.iter().map(|(name, parameters)| {
            let file = folder.path().join(name);
            std::fs::write(&file, format!("/**: {{ros__parameters: {{{parameters}}}}}")).unwrap();
            format!(" --params-file {}", file.display())
        });
        parse(&format!("--ros-args{}", files.collect::<String>())).unwrap_err().to_string()
    };
    let (both, raised) = ("min_range: 0.4, max_range: 6.0", "min_range: 7.0");
    let refused = "min_range is 7.0; it must be at most max_range, which is 6 m; it stands in";
    let last = format!("{refused} {} under `/**`", folder.path().join("r2.yaml").display());
    assert_eq!(line(&[("r2.yaml", raised)]), last);
    assert_eq!(line(&[("r1.yaml", both), ("r2.yaml", raised)]), last);
    let swapped = line(&[("r2.yaml", raised), ("r1.yaml", "max_range: 6.0")]);
    assert!(swapped.starts_with("max_range is 6.0") && swapped.contains("r1.yaml"), "{swapped}");
}

#[test]
fn a_file_or_an_argument_that_has_nothing_for_the_node_is_told_with_the_nodes_that_it_is_for() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("params.yaml");
    let told = |arguments: &str, text: &str| -> Vec<String> {
        std::fs::write(&file, text).unwrap();
        let line = format!("--ros-args {arguments} --params-file {}", file.display());
        parse(&line).unwrap().warnings().to_vec()
    };
    let other = "/cfodi: {ros__parameters: {depth: 3}}";
    let name = file.display().to_string();
    let line = format!("{name} has nothing for /robot1/cfodi; it is for /cfodi");
    assert_eq!(told("-r __ns:=/robot1", other), [line.as_str()]);
    // Without that node the file is as before, and so is one that has something for both.
    assert!(told("", other).is_empty());
    assert!(told("-r __ns:=/robot1", &format!("{other}\n/**: {{ros__parameters: {{depth: 3}}}}")).is_empty());
    for nothing in ["", "/cfodi: {ros__parameters: {}}"] {
        assert!(told("-r __ns:=/robot1", nothing).is_empty(), "{nothing}");
    }
    let line = "a -p has nothing for /cfodi; it is for eyes";
    assert_eq!(told("-p eyes:depth:=3 -p depth:=2", other), [line]);
}

#[test]
fn parameters_for_a_misspelt_name_of_the_node_are_told_also_where_the_file_has_others_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("robot.yaml");
    let told = |arguments: &str, more: &str| -> Vec<String> {
        std::fs::write(&file, format!("/**: {{ros__parameters: {{depth: 3}}}}\n{more}")).unwrap();
        let line = format!("--ros-args {arguments} --params-file {}", file.display());
        parse(&line).unwrap().warnings().to_vec()
    };
    let line = |section: &str, node: &str| {
        let name = file.display();
        vec![format!("{name} has parameters for {section} that are not read: this node is {node}")]
    };
    assert_eq!(told("", "cfdi: {ros__parameters: {voxel_size: 0.05}}"), line("cfdi", "/cfodi"));
    let full = "robot: {cfoid: {ros__parameters: {use_sim_time: true, front: {kind: depth}, qos_overrides: {a: 1}}}}";
    assert_eq!(told("-r __ns:=/robot", full), line("robot/cfoid", "/robot/cfodi"));
    let eyes = "/eye: {ros__parameters: {depth: 3}}";
    assert_eq!(told("-r __node:=eyes", eyes), line("/eye", "/eyes"));
    // Another node, of a name like it, one of several, and the node itself, by a name that is not misspelt.
    for (arguments, other) in [
        ("", "cfdi: {ros__parameters: {frequency: 5, depth: 3}}"),
        ("", "cfdi: {ros__parameters: {depth: [1, 2]}}"),
        ("-r __node:=cfodi_1", "cfodi_2: {ros__parameters: {depth: 5}}"),
        ("-r __node:=eye_l", "eye_l: {ros__parameters: {depth: 2}}\neye_r: {ros__parameters: {depth: 5}}"),
        ("", "amcl: {ros__parameters: {use_sim_time: true}}\nrviz: {ros__parameters: {use_sim_time: true}}"),
        ("", "/*: {cfodi: {ros__parameters: {depth: 5}}}"),
        ("-r __node:=eye", "/robot/*: {ros__parameters: {depth: 5}}"),
    ] {
        assert_eq!(told(arguments, other), [""; 0], "{other}");
    }
}
