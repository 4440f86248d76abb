//! What is reported of a sensor whose scans come and are taken in or not.

use super::lines::two;
use super::reports::{by_hand, driven, part, value};
use super::*;
use crate::msg::clusters::MapVersion;
use crate::reach::Points;

const AGE: &str = "age of the newest taken in [s]";
const NONE: &str = "none of its scans is taken into the map; why one is not: ";

/// The static transform of the rear sensor is missing.
#[test]
fn a_sensor_none_of_whose_scans_is_taken_in_is_a_warning_with_the_reason_though_others_fill_the_map() {
    let now = new_session(0) as f64 / 1e9;
    let Event::Cloud(_, rear) = cloud(at(now), "rear") else { unreachable!() };
    let rear = Event::Cloud(Form::Points.of(1), rear);
    let events = vec![transform(at(0.0), true), cloud(at(now), "camera"), rear];
    let transport = Rc::new(two());
    // The first report that has a figure of 1.
    let first = |transport: &Fake, of: &str, key: &str| {
        let reports = transport.reports.borrow();
        reports.iter().map(|report| part(report, of)).find(|sensor| value(sensor, key) == "1")
    };
    let found = move |transport: &Fake| {
        first(transport, "sensor points", "taken in").zip(first(transport, "sensor rear", "given up"))
    };
    let seen = Rc::clone(&transport);
    let stop = async move |_, _| {
        until("the report", || found(&seen).is_some()).await;
    };
    node_until(&Config::new([]).unwrap(), Rc::clone(&transport), events, stop).0.unwrap();
    let (front, rear) = found(&transport).unwrap();
    assert_eq!((front.level, value(&front, "given up").as_str()), (0, "0"), "{front:?}");
    assert_eq!((rear.level, value(&rear, "taken in").as_str()), (1, "0"), "{rear:?}");
    assert!(rear.message.starts_with(NONE) && rear.message.contains("from `rear` to `odom`"), "{rear:?}");
    assert!(value(&front, AGE).parse::<f64>().unwrap() < 60.0, "{front:?}");
    assert!(rear.values.iter().all(|value| value.key != AGE), "{rear:?}");
}

/// The engine takes in a scan of the only sensor.
fn take_in(live: &Live<Fake>, seconds: f64) {
    let newest = MapVersion { session: live.session, sequence: 1 };
    let mut vitals = live.diagnosis.vitals.borrow_mut();
    vitals.note_scan(newest, (0, at(seconds)), Duration::ZERO, Points::default());
}

#[test]
fn a_sensor_is_an_error_where_its_scans_have_been_given_up_for_long_and_none_was_taken_in() {
    for (is_taken_in, long, level) in [(false, Duration::ZERO, 1), (false, QUIET, 2), (true, QUIET, 0)] {
        let (report, _) = driven(Fake::default(), async |live| {
            live.intakes[0].give_up(|| "no way".to_owned());
            let left_out = live.intakes[0].left_out.as_mut().unwrap();
            left_out.since = left_out.since.checked_sub(long).unwrap();
            live.intakes[0].give_up(|| unreachable!("it was asked in this report"));
            if is_taken_in {
                take_in(live, 10.0);
            }
        });
        let sensor = part(&report, "sensor points");
        assert_eq!((sensor.level, value(&sensor, "given up").as_str()), (level, "2"));
        assert_eq!(sensor.message == format!("{NONE}no way"), level > 0, "{sensor:?}");
    }
}

/// A sensor that sends a scan every other second.
#[test]
fn where_none_of_a_sensor_was_given_up_or_taken_in_a_report_says_what_the_one_before_it_did() {
    let run = async {
        let (mut live, mut reported) = by_hand(&Config::new([]).unwrap(), Fake::default());
        live.intakes[0].give_up(|| "no way".to_owned());
        [false, false, true, false].map(|is_taken_in| {
            if is_taken_in {
                take_in(&live, 10.0);
            }
            live.report();
            let sensor = part(&reported.try_recv().unwrap(), "sensor points");
            let figures = ["taken in", "given up"].map(|key| value(&sensor, key).parse::<u64>().unwrap());
            (sensor.level, figures)
        })
    };
    let runtime = Builder::new_current_thread().enable_time().build().unwrap();
    // The first is about the scan that was given up.
    assert_eq!(runtime.block_on(run), [(1, [0, 1]), (1, [0, 0]), (0, [1, 0]), (0, [0, 0])]);
}

/// That others of it are on their way is no fault of the sensor's.
#[test]
fn a_scan_that_the_engine_is_too_slow_for_is_given_up_of_its_own_sensor() {
    let (report, _) = driven(two(), async |live| {
        live.note_replaced(0);
    });
    let [front, rear] = ["points", "rear"].map(|name| part(&report, &format!("sensor {name}")));
    assert_eq!([&front, &rear].map(|sensor| value(sensor, "given up")), ["1", "0"]);
    assert_eq!([front.level, rear.level], [0, 0]);
}

#[test]
fn in_a_new_session_nothing_of_a_sensor_is_in_the_map_until_a_scan_of_it_is_taken_in() {
    let ages = |is_reset: bool| {
        let (report, _) = driven(Fake::default(), async |live| {
            take_in(live, 10.0);
            if is_reset {
                live.event(Event::Call(Service::Reset, ())).await;
            }
        });
        part(&report, "sensor points").values.iter().filter(|value| value.key == AGE).count()
    };
    assert_eq!([false, true].map(ages), [1, 0]);
}
