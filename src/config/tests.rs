//! What can be given, and what is said of what cannot.

use super::*;
use crate::engine::{Mode, NoiseModel};

fn with(name: &str, value: Value) -> Result<Config, ConfigError> {
    Config::new([(name.to_owned(), value)])
}

fn line(name: &str, value: Value) -> String {
    with(name, value).unwrap_err().to_string()
}

#[test]
fn the_defaults_are_possible_and_those_of_the_engine() {
    let config = Config::new([]).unwrap();
    assert_eq!(config.engine, Params::default());
    assert_eq!((config.engine.voxel_size(), config.engine.min_points()), (0.08, 15));
    assert_eq!(config.fixed_frame, "odom");
    assert_eq!(config.publish_period, Duration::from_millis(500));
    assert_eq!(config.filter, CloudFilter::default());
    assert_eq!((config.filter.min_range, config.filter.max_range), (0.4, 6.0));
    assert_eq!(config.receive_buffer, 32 << 20);
}

#[test]
fn the_letter_forgets_nothing_and_is_not_told_to() {
    let paper = ("mode", Value::Text("paper".into()));
    let with = |more: &[(&str, Value)]| {
        let given = [std::slice::from_ref(&paper), more].concat();
        Config::new(given.into_iter().map(|(name, value)| (name.to_owned(), value)))
    };
    let current = Current::new([("mode".to_owned(), Value::Text("paper".into()))]).unwrap();
    assert_eq!(current.get("clearing").unwrap().1, &Value::Boolean(false));
    assert_eq!(with(&[]).unwrap().engine, Params::paper().with_clearing(false));
    assert!(with(&[("clearing", Value::Boolean(false))]).is_ok());
    let refused = |more: (&str, Value)| with(&[more]).unwrap_err().to_string();
    assert_eq!(
        refused(("clearing", Value::Boolean(true))),
        "clearing is true; it must be false where mode is `paper`, which forgets nothing"
    );
    assert_eq!(
        refused(("max_voxels", Value::Integer(9))),
        "max_voxels is 9; it must be 0 where mode is `paper`, which forgets nothing"
    );
    assert_eq!(
        refused(("keep_radius", Value::Double(2.5))),
        "keep_radius is 2.5; it must be 0 where mode is `paper`, which forgets nothing"
    );
}

#[test]
fn what_is_given_for_the_consistent_mode_reaches_the_engine() {
    let given = [
        ("noise_model", Value::Text("none".into())),
        ("clearing", Value::Boolean(false)),
        ("max_voxels", Value::Integer(5000)),
        ("keep_radius", Value::Integer(3)),
    ];
    let engine = Config::new(given.map(|(name, value)| (name.to_owned(), value))).unwrap().engine;
    assert_eq!((engine.mode(), engine.noise_model()), (Mode::Consistent, NoiseModel::None));
    assert_eq!((engine.clearing(), engine.max_voxels(), engine.keep_radius()), (false, 5000, 3.0));
}

#[test]
fn voxels_that_are_large_beside_the_range_are_told_of_and_taken() {
    let told = |name: &str, value| with(name, Value::Double(value)).unwrap().too_coarse();
    let line = "voxel_size is 8 m and max_range 6 m: less than four voxels, and both are in metres";
    assert_eq!(told("voxel_size", 8.0).as_deref(), Some(line));
    assert!(told("voxel_size", 80.0).is_some() && told("voxel_size", 1.6).is_some());
    for (name, usual) in [("voxel_size", 0.08), ("voxel_size", 1.5), ("max_range", 0.5)] {
        assert_eq!(told(name, usual), None, "{name} {usual}");
    }
}

#[test]
fn an_unknown_name_gets_the_nearest_known_one() {
    let text = line("voxelsize", Value::Double(0.05));
    assert_eq!(text, "unknown parameter `voxelsize` (given as 0.05); the nearest known one is `voxel_size`");
    for (name, nearest) in [("max_rage", "max_range"), ("mdoe", "mode"), ("minpoints", "min_points")] {
        assert!(line(name, Value::Integer(1)).ends_with(&format!("one is `{nearest}`")), "{name}");
    }
}

#[test]
fn a_name_that_is_like_no_known_one_gets_none() {
    for (name, value) in [("log_level", "debug"), ("dp", "x"), ("", "x"), ("a.b", "x")] {
        let text = format!("unknown parameter `{name}` (given as {value:?})");
        assert_eq!(line(name, Value::Text(value.into())), text);
    }
    let long = line(&"max_range".repeat(1 << 17), Value::Integer(1));
    assert!(long.ends_with("(given as 1)"));
}

#[test]
fn an_impossible_value_is_named_with_what_it_must_be() {
    assert_eq!(line("depth", Value::Integer(9)), "depth is 9; it must be from 1 to 8");
    assert_eq!(
        line("voxel_size", Value::Double(-1.0)),
        "voxel_size is -1.0; it must be finite and above 0 m"
    );
    assert_eq!(line("depth", Value::Text("deep".into())), "depth is \"deep\"; it must be an integer");
    assert_eq!(line("depth", Value::Double(2.5)), "depth is 2.5; it must be an integer");
    assert_eq!(line("depth", Value::Double(1e20)), "depth is 1e20; it must be from 1 to 8");
    assert_eq!(line("use_sim_time", Value::Integer(1)), "use_sim_time is 1; it must be true or false");
    assert_eq!(
        line("optical", Value::Text("no!".into())),
        "optical is \"no!\"; it must be `auto`, `yes` or `no`"
    );
    assert_eq!(
        line("max_range", Value::Double(0.1)),
        "max_range is 0.1; it must be at least min_range, which is 0.4 m"
    );
    assert_eq!(
        line("publish_rate", Value::Double(0.0)),
        "publish_rate is 0.0; it must be from 0.01 to 100 Hz"
    );
    assert_eq!(line("tf_timeout", Value::Double(f64::NAN)), "tf_timeout is NaN; it must be from 0 to 60 s");
    assert_eq!(
        line("fixed_frame", Value::Text("/".into())),
        "fixed_frame is \"/\"; it must be the name of a frame, of at most 256 bytes"
    );
    assert_eq!(
        line("mode", Value::Text("fast".into())),
        "mode is \"fast\"; it must be `consistent` or `paper`"
    );
    assert_eq!(
        line("noise_model", Value::Text("kinect_v2".into())),
        "noise_model is \"kinect_v2\"; it must be `kinect_v1` or `none`"
    );
    assert_eq!(line("pose_sigma", Value::Double(-0.1)), "pose_sigma is -0.1; it must be from 0 to 1 m");
    assert_eq!(line("max_voxels", Value::Integer(-1)), "max_voxels is -1; it must be 0 (no bound) or more");
    assert_eq!(
        line("keep_radius", Value::Integer(-1)),
        "keep_radius is -1.0; it must be finite and 0 m (no bound) or more"
    );
    for other in ["eth0", "::1", "0.0.0.0", "255.255.255.255", "224.0.0.1"] {
        let addresses = Value::TextList(vec!["127.0.0.1".into(), other.into()]);
        let line = line("network_interfaces", addresses);
        assert!(
            line.contains(other)
                && line.contains("it must be a list of IPv4 addresses that a machine can have"),
            "{line}"
        );
    }
}

#[test]
fn of_two_lengths_that_contradict_each_other_the_one_is_refused_that_was_given_last() {
    let line = |given: &[(&str, f64)]| {
        let given = given.iter().map(|(name, value)| ((*name).to_owned(), Value::Double(*value)));
        Config::new(given).unwrap_err().to_string()
    };
    let [least, most, kept] = ["min_range", "max_range", "keep_radius"];
    let too_far = "min_range is 7.0; it must be at most max_range, which is 6 m";
    assert_eq!(line(&[(least, 7.0)]), too_far);
    assert_eq!(line(&[(least, 0.4), (most, 6.0), (least, 7.0)]), too_far, "its last value counts");
    let too_near = "max_range is 6.0; it must be at least min_range, which is 7 m";
    assert_eq!(line(&[(least, 7.0), (most, 6.0)]), too_near);
    let too_far = "min_range is 4.0; it must be at most keep_radius, which is 3 m";
    assert_eq!(line(&[(kept, 3.0), (least, 4.0)]), too_far);
    let too_near = "keep_radius is 3.0; it must be 0 (no bound) or at least min_range, which is 4 m";
    assert_eq!(line(&[(least, 4.0), (kept, 3.0)]), too_near);
    let too_near = "keep_radius is 0.3; it must be 0 (no bound) or at least min_range, which is 0.4 m";
    assert_eq!(line(&[(kept, 0.3)]), too_near);
    let [size, sigma] = ["voxel_size", "pose_sigma"];
    let too_much = "pose_sigma is 0.06; it must be at most voxel_size, which is 0.05 m";
    assert_eq!(line(&[(size, 0.05), (sigma, 0.06)]), too_much);
    let too_small = "voxel_size is 0.05; it must be at least pose_sigma, which is 0.06 m";
    assert_eq!(line(&[(sigma, 0.06), (size, 0.05)]), too_small);
    let to_the_letter = [("mode", Value::Text("paper".into())), (sigma, Value::Double(0.1))];
    let config = Config::new(to_the_letter.map(|(name, value)| (name.to_owned(), value)));
    assert_eq!(config.unwrap().engine.pose_sigma(), 0.1, "`paper` does not ask for it");
}

#[test]
fn every_parameter_takes_values_of_every_type_and_size_without_a_panic() {
    let text = |text: &str| Value::Text(text.to_owned());
    let mut values = vec![Value::Boolean(true), Value::TextList(Vec::new()), text(""), text("\0\u{1b}[31m")];
    values.extend([text(&"x".repeat(1 << 20)), Value::TextList(vec![String::new(); 1000])]);
    values.extend([i64::MIN, -1, 0, 1, 1 << 31, 1 << 32, i64::MAX].map(Value::Integer));
    let ends = [0.0, -0.0, f64::MIN_POSITIVE / 2.0, 1e-9, 1.0, 1e300, f64::MAX, f64::INFINITY, f64::NAN];
    values.extend(ends.into_iter().flat_map(|x| [x, -x]).map(Value::Double));
    for parameter in parameters(&["points".to_owned()]) {
        let taken = values.iter().filter(|value| with(&parameter.name, (*value).clone()).is_ok());
        for value in taken {
            let refused = matches!(value, Value::Double(x) if !x.is_finite());
            assert!(!refused, "{} takes {value}", parameter.name);
        }
    }
}

#[test]
fn bounds_of_memory_cannot_be_given_away() {
    assert_eq!(
        line("max_points", Value::Integer(1 << 25)),
        "max_points is 33554432; it must be from 1 to 16777216"
    );
    let long = line("fixed_frame", Value::Text("x".repeat(257)));
    assert!(long.ends_with("it must be the name of a frame, of at most 256 bytes"), "{long}");
    assert!(line("receive_buffer", Value::Integer((1 << 30) + 1)).contains("from 4096 to 1073741824"));
    assert!(line("tf_timeout", Value::Double(1e9)).contains("from 0 to 60 s"));
}

#[test]
fn an_integer_is_taken_for_a_double_and_the_last_value_counts() {
    let values = [("voxel_size", Value::Double(0.3)), ("voxel_size", Value::Integer(1))];
    let config = Config::new(values.map(|(name, value)| (name.to_owned(), value))).unwrap();
    assert!((config.engine.voxel_size() - 1.0).abs() < f64::EPSILON);
}

#[test]
fn a_leading_slash_of_a_frame_is_dropped() {
    assert_eq!(with("fixed_frame", Value::Text("/map".into())).unwrap().fixed_frame, "map");
}

#[test]
fn every_parameter_is_described_and_its_default_is_within_its_bounds() {
    for parameter in parameters(&["points".to_owned()]) {
        let name = &parameter.name;
        assert!(parameter.description().len() > 10, "{name}");
        assert!(with(name, parameter.default()).is_ok(), "{name}");
        let numeric = matches!(parameter.default(), Value::Integer(_) | Value::Double(_));
        assert_eq!(
            numeric,
            !matches!(parameter.bounds(), Bounds::Any | Bounds::OneOf(_) | Bounds::Words(_)),
            "{name}"
        );
    }
}

#[test]
fn both_ends_of_a_parameter_are_possible_and_what_is_beyond_is_refused_in_the_words_of_the_table() {
    for parameter in parameters(&["points".to_owned()]) {
        let (ends, beyond): (_, Vec<_>) = match parameter.bounds() {
            Bounds::Integers(least, most) => {
                let beyond = [least.checked_sub(1), most.checked_add(1)].into_iter().flatten();
                ([least, most].map(Value::Integer), beyond.map(Value::Integer).collect())
            }
            Bounds::Numbers(least, most) => {
                let beyond = [least.next_down(), most.next_up()];
                ([least, most].map(Value::Double), beyond.map(Value::Double).to_vec())
            }
            Bounds::Any | Bounds::OneOf(_) | Bounds::Words(_) => continue,
        };
        let name = parameter.name;
        for value in beyond {
            let refused = line(&name, value.clone());
            assert!(refused.starts_with(&format!("{name} is {value}; it must be ")), "{refused}");
        }
        for value in ends {
            // An end may contradict the default of another parameter, in words that name that one.
            if let Err(error) = with(&name, value.clone()) {
                let named = ["_range, which is", "at most voxel_size, which is"];
                assert!(
                    named.iter().any(|other| error.to_string().contains(other)),
                    "{name} is {value}: {error}"
                );
            }
        }
    }
}

#[test]
fn a_radius_within_which_the_sensor_sees_nothing_is_refused_with_both_numbers() {
    let with = |radius: f64, more: &[(&str, f64)]| {
        let given = [more, &[("keep_radius", radius)]].concat();
        let given = given.into_iter().map(|(name, value)| (name.to_owned(), Value::Double(value)));
        Config::new(given).map(drop).map_err(|error| error.to_string())
    };
    let words = "keep_radius is 0.3; it must be 0 (no bound) or at least min_range, which is 0.4 m";
    assert_eq!(with(0.3, &[]), Err(words.to_owned()));
    assert_eq!(with(0.3, &[("min_range", 0.2)]), Ok(()));
    assert_eq!((with(0.4, &[]), with(0.0, &[])), (Ok(()), Ok(())));
    let words = "keep_radius is 2.5; it must be 0 (no bound) or at least min_range, which is 3 m";
    assert_eq!(with(2.5, &[("min_range", 3.0)]), Err(words.to_owned()));
}

#[test]
fn words_of_yaml_are_booleans_where_the_parameter_is_one() {
    let meant = |name, text: &str| as_meant(name, Value::Text(text.to_owned()));
    for text in ["y", "Yes", "on", "TRUE"] {
        assert_eq!(meant("clearing", text), Value::Boolean(true), "{text}");
    }
    for text in ["n", "NO", "Off", "false"] {
        assert_eq!(meant("use_sim_time", text), Value::Boolean(false), "{text}");
    }
    for (name, text) in [("clearing", "oN"), ("clearing", "1"), ("optical", "no"), ("nothing", "on")] {
        assert_eq!(meant(name, text), Value::Text(text.to_owned()));
    }
}

#[test]
fn twins_are_sent_where_asked_and_a_misspelt_one_gets_the_nearest() {
    let twins = |names: &[&str]| Value::TextList(names.iter().copied().map(str::to_owned).collect());
    assert_eq!(Config::new([]).unwrap().twins, Twins::default());
    assert_eq!(with("twins", Value::Text(String::new())).unwrap().twins, Twins::default());
    let both = with("twins", twins(&["polygons", "detections"])).unwrap().twins;
    assert_eq!(both, Twins { detections: true, polygons: true });
    assert_eq!(
        line("twins", twins(&["detection"])),
        "twins is [\"detection\"]; it must be out of `detections` and `polygons`; the nearest to \"detection\" is \
         `detections`"
    );
    assert_eq!(
        line("twins", Value::Text("polygons".into())),
        "twins is \"polygons\"; it must be a list of texts, as [\"detections\"]"
    );
    let paper = |names| {
        let given = [("mode", Value::Text("paper".into())), ("twins", twins(names))];
        Config::new(given.map(|(name, value)| (name.to_owned(), value)))
    };
    assert!(paper(&["detections"]).unwrap().twins.detections);
    let refused = paper(&["polygons"]).unwrap_err().to_string();
    assert!(refused.ends_with("without `polygons` where mode is `paper`: it knows no outlines"), "{refused}");
}
