//! What is reported of a node on a middleware made of channels.

use super::lines::two;
use super::*;
use crate::join::Waited;
use crate::msg::reports::DiagnosticStatus;

/// What a report says of a part.
pub(super) fn part(report: &DiagnosticArray, part: &str) -> DiagnosticStatus {
    let name = format!("robot/cfodi: {part}");
    let status = report.status.iter().find(|status| status.name == name);
    status.unwrap_or_else(|| panic!("no {name} in {report:?}")).clone()
}

/// What the last report says of a part.
fn last(transport: &Fake, of: &str) -> DiagnosticStatus {
    part(transport.reports.borrow().last().unwrap(), of)
}

/// The worst that the reports say of a part: the first is about the events, where a second comes it is about none.
fn worst(transport: &Fake, of: &str) -> DiagnosticStatus {
    let reports = transport.reports.borrow();
    reports.iter().map(|report| part(report, of)).rev().max_by_key(|said| said.level).unwrap()
}

/// A node that is driven by hand, so that no time goes by, and its reports.
pub(super) fn by_hand(config: &Config, transport: Fake) -> (Live<Fake>, mpsc::Receiver<DiagnosticArray>) {
    let (reports, reported) = mpsc::channel(1);
    let worker = Worker::start(Engine::new(config.engine), 1, 1, |_| {}).unwrap();
    (Live::new(config, Rc::new(transport), worker, 1, Seen::default(), reports), reported)
}

/// The report of a node that was driven so, and what its log says meanwhile.
pub(super) fn driven(
    transport: Fake,
    drive: impl AsyncFnOnce(&mut Live<Fake>),
) -> (DiagnosticArray, Vec<(u8, String)>) {
    let runtime = Builder::new_current_thread().enable_time().build().unwrap();
    let run = async {
        let (mut live, mut reported) = by_hand(&Config::new([]).unwrap(), transport);
        drive(&mut live).await;
        live.report();
        reported.try_recv().unwrap()
    };
    heard(|| runtime.block_on(run))
}

pub(super) fn value(status: &DiagnosticStatus, key: &str) -> String {
    status.values.iter().find(|value| value.key == key).unwrap().value.clone()
}

#[test]
fn a_report_has_the_figures_of_each_part() {
    let stamp = new_session(0) as f64 / 1e9;
    let events =
        vec![transform(at(stamp), true), cloud(at(stamp), "camera"), Event::Lost(Form::Points.of(0), 9)];
    let transport = reported(Fake::default(), events);
    let sensor = worst(&transport, "sensor points");
    assert_eq!(value(&sensor, "lost"), "9");
    assert_eq!((sensor.level, sensor.message.as_str()), (1, "9 of 10 scans were lost or cannot be used"));
    assert_eq!(value(&last(&transport, "engine"), "taken in in all"), "1");
    assert_eq!(value(&last(&transport, "map"), "sequence"), "1");
    assert_eq!(worst(&transport, "transforms").level, 0);
}

/// The stamp of the map is that of whichever was taken in last.
#[test]
fn each_sensor_has_an_age_of_its_own() {
    let now = new_session(0) as f64 / 1e9;
    let (report, _) = driven(two(), async |live| {
        live.event(cloud(at(now - 5.0), "camera")).await;
        let Event::Cloud(_, recent) = cloud(at(now), "camera") else { unreachable!() };
        live.event(Event::Cloud(Form::Points.of(1), recent)).await;
    });
    let age =
        |sensor: &str| -> f64 { value(&part(&report, sensor), "age of the newest [s]").parse().unwrap() };
    assert!(age("sensor points") > 4.9 && age("sensor rear") < 4.0, "{report:?}");
}

/// What is said of a sensor, and by the log, after these events, where it has sent nothing of use for so long before.
fn of_sensor(bad_for: Option<Duration>, events: Vec<Event<()>>) -> (DiagnosticStatus, Vec<(u8, String)>) {
    let info = Source {
        topic: "/camera/depth/camera_info".to_owned(),
        type_name: "sensor_msgs/msg/CameraInfo".to_owned(),
    };
    let (report, said) = driven(Fake { sources: vec![info], ..Fake::default() }, async |live| {
        live.intakes[0].bad_since = bad_for.and_then(|before| Instant::now().checked_sub(before));
        for event in events {
            live.event(event).await;
        }
        assert!(live.intakes[0].bad_since.is_some(), "the last scan was a bad one");
    });
    (part(&report, "sensor points"), said)
}

/// A driver whose camera info has another name, and one whose camera info comes a moment after its images.
#[test]
fn a_sensor_whose_every_scan_cannot_be_used_is_an_error_with_the_reason_and_what_to_do() {
    let plain = "a depth image, and no camera_info has come yet";
    let long = format!(
        "{plain}; nobody publishes a CameraInfo on /depth/camera_info: use -r \
         depth/camera_info:=/camera/depth/camera_info"
    );
    for (bad_for, level, why) in [(None, 1, plain), (Some(QUIET), 2, long.as_str())] {
        let image = || Event::Cloud(Form::Depth.of(0), Err(CloudError::NoCameraInfo));
        let (sensor, said) = of_sensor(bad_for, vec![image(), image(), image()]);
        let start = "3 of 3 scans were lost or cannot be used; why the last cannot: ";
        assert_eq!((sensor.level, sensor.message), (level, format!("{start}{why}")));
        let line = (30, format!("a scan of /depth/image was skipped: {why}"));
        assert_eq!(said.iter().filter(|said| **said == line).count(), 1, "{said:?}");
    }
}

/// One that sends something bad now and then, and one that sends once a second.
#[test]
fn a_bad_scan_among_good_ones_or_a_lost_one_is_a_warning() {
    let bad = || Event::Cloud(Form::Points.of(0), Err(CloudError::EmptyFrameId));
    let why = "; why the last cannot: header frame_id is empty";
    for (events, start) in [
        (vec![cloud(at(10.0), "camera"), bad()], format!("1 of 2 scans was lost or cannot be used{why}")),
        (
            vec![cloud(at(10.0), "camera"), bad(), bad()],
            format!("2 of 3 scans were lost or cannot be used{why}"),
        ),
        (vec![cloud(at(10.0), "camera"), Event::Lost(Form::Points.of(0), 1)], "1 of 2 scans".to_owned()),
    ] {
        let (sensor, _) = of_sensor(Some(QUIET), events);
        assert!(sensor.level == 1 && sensor.message.starts_with(&start), "{sensor:?}");
    }
    for event in [bad(), Event::Lost(Form::Points.of(0), 1)] {
        let (sensor, _) = of_sensor(None, vec![event]);
        let start = "1 of 1 scan was lost or cannot be used";
        assert!(sensor.level == 1 && sensor.message.starts_with(start), "{sensor:?}");
    }
}

/// A camera that is covered, whose driver leaves out what it does not see or not, and one that is covered now and then.
#[test]
fn a_sensor_that_shows_next_to_nothing_in_most_scans_is_a_warning_with_the_reason() {
    let stamp = at(new_session(0) as f64 / 1e9);
    let scan = |used: usize, invalid| {
        let (frame_id, points) = ("camera".to_owned(), Points::F32(vec![[0.0, 0.0, 1.0]; used]));
        let total = used as u32 + invalid;
        Event::Cloud(
            Form::Points.of(0),
            Ok(Cloud { stamp, frame_id, points, total, invalid, out_of_range: 0 }),
        )
    };
    let said = |scans: Vec<Event<()>>| {
        let (report, _) = driven(Fake::default(), async |live| {
            for scan in scans {
                live.event(scan).await;
            }
        });
        let sensor = part(&report, "sensor points");
        (sensor.level, sensor.message)
    };
    let (level, empty) = said(vec![scan(0, 0), scan(0, 0)]);
    let words = "next to nothing is seen in 2 of 2 scans; the last: it has no points";
    assert_eq!((level, empty.as_str()), (1, words));
    let (level, invalid) = said(vec![scan(0, 0), scan(20, 0), scan(20, 980)]);
    let words = "next to nothing is seen in 2 of 3 scans; the last: of 1000 points only 20 can be used: ";
    assert!(level == 1 && invalid.starts_with(words), "{invalid}");
    assert_eq!(said(vec![scan(0, 0), scan(20, 0)]).0, 0);
}

/// Two publishers on one topic; somebody who calls again and again.
#[test]
fn sessions_that_alternate_are_said_once_and_are_a_warning_and_those_that_were_asked_for_are_none() {
    let begin = |events: Vec<Event<()>>| {
        let (report, said) = driven(Fake::default(), async |live| {
            for event in events {
                live.event(event).await;
            }
        });
        let begun = said.into_iter().filter(|(_, line)| line.ends_with("begins with an empty map"));
        (part(&report, "map"), begun.collect::<Vec<_>>())
    };
    let old_and_new = |number| [20.0, 10.0].map(|seconds| cloud(at(seconds + f64::from(number)), "camera"));
    let scans = (0..9).flat_map(old_and_new);
    let (map, begun) = begin([transform(at(0.0), true)].into_iter().chain(scans).collect());
    let words = "the stamps of the scans have jumped back by 10.000 s: session ";
    assert_eq!((map.level, value(&map, "sessions begun by a jump").as_str()), (1, "9"), "{map:?}");
    assert!(map.message.starts_with(words), "{map:?}");
    assert!(begun.len() == 1 && begun[0].0 == 30 && begun[0].1.starts_with(words), "{begun:?}");
    let clocks = [20.0, 10.0].into_iter().cycle().take(20).map(|seconds| Event::Clock(at(seconds)));
    let (map, begun) = begin(clocks.collect());
    assert_eq!((map.level, value(&map, "sessions begun by a jump").as_str()), (1, "10"), "{map:?}");
    assert!(begun.len() == 1 && begun[0].1.starts_with("/clock has jumped back by 10.000 s: "), "{begun:?}");
    let (map, begun) = begin((0..9).map(|_| Event::Call(Service::Reset, ())).collect());
    assert_eq!((map.level, value(&map, "sessions begun by a jump").as_str()), (0, "0"), "{map:?}");
    assert!(begun.len() == 1 && begun[0].0 == 20, "{begun:?}");
}

/// A bag in a loop that is played with `--clock`.
#[test]
fn a_lap_begins_one_session_whether_its_first_scan_or_its_clock_comes_first() {
    let (scan, clock) = (|seconds| cloud(at(seconds), "camera"), |seconds| Event::Clock(at(seconds)));
    for lap in [[scan(1.0), clock(1.1)], [clock(1.0), scan(1.0)]] {
        let (report, _) = driven(Fake::default(), async |live| {
            let before = [transform(at(0.0), true), clock(20.0), scan(20.0)];
            for event in before.into_iter().chain(lap).chain([clock(1.2), scan(1.2)]) {
                live.event(event).await;
            }
        });
        assert_eq!(value(&part(&report, "map"), "sessions begun by a jump"), "1");
    }
}

#[test]
fn with_a_clock_that_jumps_back_no_sensor_is_ahead_of_it_and_the_first_scan_of_the_lap_is_not_given_up() {
    let (report, _) = driven(Fake::default(), async |live| {
        let before = [transform(at(20.0), false), cloud(at(20.0), "camera"), Event::Clock(at(20.0))];
        for event in before.into_iter().chain([cloud(at(1.0), "camera"), Event::Clock(at(1.0))]) {
            live.event(event).await;
        }
        assert_eq!(live.join.waiting(), 1);
        live.event(transform(at(1.0), false)).await;
        assert_eq!(live.join.waiting(), 0);
        live.intakes[0].newest = Some(at(20.0));
        live.event(Event::Clock(at(2.0))).await;
        live.event(Event::Clock(at(0.5))).await;
    });
    let sensor = part(&report, "sensor points");
    assert!(sensor.values.iter().all(|value| !value.key.starts_with("age")), "{sensor:?}");
}

#[test]
fn a_jump_does_not_hide_that_the_map_is_not_saved() {
    let (report, _) = driven(Fake::default(), async |live| {
        live.diagnosis.saving.note(&Err(StoreError::InUse { path: "map".into() }), false, Instant::now());
        for seconds in [20.0, 10.0] {
            live.event(Event::Clock(at(seconds))).await;
        }
    });
    let map = part(&report, "map");
    let (jump, fault) = map.message.split_once("; ").unwrap();
    assert!(map.level == 1 && jump.starts_with("/clock has jumped back by 10.000 s: session "), "{map:?}");
    assert_eq!(fault, "the map was not saved: map is in use by another process");
}

#[test]
fn a_scan_without_a_transform_is_an_error_while_none_is_taken_in() {
    let transport = reported(Fake::default(), vec![cloud(at(10.0), "nowhere")]);
    let transforms = worst(&transport, "transforms");
    assert_eq!((transforms.level, value(&transforms, "given up").as_str()), (2, "1"));
    assert!(transforms.message.contains("`nowhere`") && transforms.message.contains("`odom`"));
}

#[test]
fn who_does_not_fit_and_a_buffer_cut_short_are_warnings() {
    let network = |receive_buffer| NetworkState {
        receive_buffer: Some(receive_buffer),
        mismatches: vec![("/tf_static".to_owned(), "a publisher offers less".to_owned())],
        namesakes: 0,
        without_router: false,
    };
    let transport = reported(Fake { network: network(32 << 20), ..Fake::default() }, Vec::new());
    let said = last(&transport, "network");
    assert_eq!((said.level, said.message.as_str()), (1, "/tf_static: a publisher offers less"));
    let transport = reported(
        Fake { network: NetworkState { mismatches: vec![], ..network(212_992) }, ..Fake::default() },
        Vec::new(),
    );
    let said = last(&transport, "network");
    assert!(
        said.level == 1 && said.message.ends_with("sudo sysctl -w net.core.rmem_max=33554432"),
        "{said:?}"
    );
}

#[test]
fn other_nodes_of_its_name_are_a_warning_with_their_number() {
    for namesakes in [1, 2] {
        let network = NetworkState { namesakes, ..NetworkState::default() };
        let transport = reported(Fake { network, ..Fake::default() }, Vec::new());
        let said = last(&transport, "network");
        let words = format!("nodes of the name /robot/cfodi beside this one: {namesakes}; who calls");
        assert!(said.level == 1 && said.message.starts_with(&words), "{said:?}");
        assert_eq!(value(&said, "other nodes of its name"), namesakes.to_string());
    }
}

/// A robot whose fixed frame is that of a national grid.
#[test]
fn points_beyond_the_grid_are_a_warning_with_their_number_and_what_to_do() {
    let far = |metres: f64| {
        let Event::Transforms { mut message, .. } = transform(at(0.0), true) else { unreachable!() };
        message.transforms[0].transform.translation.x = metres;
        Event::Transforms { message, is_static: true, publisher: None }
    };
    for (metres, beyond) in [(500_000.0, 20), (83_000.0, 0)] {
        let transport = reported(Fake::default(), vec![far(metres), cloud(at(10.0), "camera")]);
        let reports = transport.reports.borrow();
        let maps: Vec<_> = reports.iter().map(|report| &report.status[3]).collect();
        let figures: u64 =
            maps.iter().map(|map| value(map, "points beyond the grid").parse::<u64>().unwrap()).sum();
        let said = maps.into_iter().max_by_key(|map| map.level).unwrap();
        assert_eq!((u64::from(said.level), figures), (u64::from(beyond > 0), beyond), "{said:?}");
        let words = "points beyond the grid, which reaches 83886 m from the origin of `odom`, are left out, 20 of 20: ";
        assert_eq!(said.message.starts_with(words), beyond > 0, "{said:?}");
    }
}

#[test]
fn a_map_that_is_not_saved_is_a_warning_with_the_reason_and_one_that_is_has_an_age() {
    let folder = tempfile::tempdir().unwrap();
    let config = saving_in(folder.path());
    let run = || {
        let events = vec![transform(at(0.0), true), cloud(at(10.0), "camera")];
        let (_, _, transport) = node_that_reports(&config, Fake::default(), events);
        last(&transport, "map")
    };
    let in_the_way = folder.path().join("map.part");
    std::fs::create_dir(&in_the_way).unwrap();
    let said = run();
    let words = format!("the map was not saved: {}: ", folder.path().join("map").display());
    assert!(said.level == 1 && said.message.starts_with(&words), "{said:?}");
    assert!(!said.values.iter().any(|value| value.key.starts_with("age")), "{said:?}");
    std::fs::remove_dir(in_the_way).unwrap();
    let said = run();
    assert_eq!((said.level, said.message.as_str()), (0, "clusters: 0; dense voxels: 1"));
    assert!(value(&said, "age of the saved map [s]").parse::<f64>().unwrap() < 1.0, "{said:?}");
}

/// A simulator that is started late and paused.
#[test]
fn a_simulated_clock_that_does_not_come_is_told_of_and_said_once_and_so_is_that_it_comes() {
    let config = Config::new([("use_sim_time".to_owned(), Value::Boolean(true))]).unwrap();
    let long_ago = Instant::now().checked_sub(QUIET).unwrap();
    let run = async {
        let (mut live, mut reported) = by_hand(&config, Fake::default());
        let mut transforms = Vec::new();
        live.clocks = Clocks::new(long_ago, true);
        for rests in [true, false, true] {
            if !rests {
                live.event(Event::Clock(at(10.0))).await;
            } else if live.clocks.moment().simulated.is_some() {
                live.clocks.hear(at(10.1), long_ago);
            }
            live.tick();
            live.tick();
            live.report();
            let status = part(&reported.try_recv().unwrap(), "transforms");
            transforms.push((status.level, status.message));
        }
        live.event(cloud(at(0.0), "camera")).await;
        live.report();
        (transforms, part(&reported.try_recv().unwrap(), "sensor points").message)
    };
    let runtime = Builder::new_current_thread().enable_time().build().unwrap();
    let ((transforms, sensor), said) = heard(|| runtime.block_on(run));
    let never = "no /clock has come, which use_sim_time asks for: ";
    let halted = "no /clock has come for 3 s: the simulated time stands still";
    assert!(transforms[0].0 == 1 && transforms[0].1.starts_with(never), "{transforms:?}");
    assert_eq!(transforms[1].0, 0, "{transforms:?}");
    assert_eq!(transforms[2], (1, halted.to_owned()));
    let said: Vec<_> = said.into_iter().filter(|(_, line)| line.contains("/clock")).collect();
    assert!(said.len() == 3 && said[0].0 == 30 && said[0].1.starts_with(never), "{said:?}");
    assert_eq!(said[1..], [(20, "/clock comes now".to_owned()), (30, halted.to_owned())]);
    assert_eq!(sensor, format!("its stamps are 10.1 s behind the clock; {halted}"));
}

#[test]
fn a_scan_that_was_given_up_has_waited_too() {
    let (report, _) = driven(Fake::default(), async |live| {
        live.event(cloud(at(10.0), "camera")).await;
        let waited = live.join.give_up(Duration::from_secs(9).into()).remove(0);
        live.skip(&Waited { waited: Duration::from_millis(250), ..waited }, GivenUp::TimedOut);
    });
    let transforms = part(&report, "transforms");
    assert_eq!(["given up", "longest wait [s]"].map(|key| value(&transforms, key)), ["1", "0.250"]);
}

#[test]
fn what_one_sensor_lacks_does_not_hide_what_another_does_nor_that_the_queue_is_full() {
    let run = async |live: &mut Live<Fake>| {
        for (sensor, frame) in ["front", "rear", "front"].into_iter().enumerate() {
            let Event::Cloud(_, scan) = cloud(at(10.0), frame) else { unreachable!() };
            live.event(Event::Cloud(Form::Points.of(sensor % 2), scan)).await;
        }
        for (number, waited) in live.join.give_up(Duration::from_secs(9).into()).into_iter().enumerate() {
            let pushed_out = GivenUp::PushedOut { longer_helps: true };
            live.skip(&waited, [GivenUp::TimedOut, pushed_out][number / 2]);
        }
    };
    let (report, said) = driven(two(), run);
    let said: Vec<_> = said.into_iter().filter(|(_, line)| line.contains("without a transform")).collect();
    let of = |number: usize, frame: &str| {
        said[number].0 == 30 && said[number].1.contains(&format!("from `{frame}`"))
    };
    assert!(said.len() == 3 && of(0, "front") && of(1, "rear") && of(2, "front"), "{said:?}");
    assert!(said[2].1.contains("it made place for a newer one"), "{said:?}");
    let message = part(&report, "transforms").message;
    assert!(["front", "rear"].iter().all(|frame| message.contains(&format!("from `{frame}`"))), "{message}");
}
