//! A bag: any bytes as a file, plain or compressed as a whole, or as the `metadata.yaml` beside one.

use std::cell::OnceCell;
use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use cfodi::bag::{Bag, Decoder, Recorded, TransformTopics, Wanted, choose};
use cfodi::cloud::CloudFilter;
use cfodi::join::{GivenUp, Join, Moment, TransformsFrom};
use tempfile::TempDir;

use super::bytes::Bytes;
use super::cloud::check;

const FILTER: CloudFilter = CloudFilter { max_points: 1 << 16, ..CloudFilter::DEFAULT };

thread_local! {
    static FOLDER: OnceCell<TempDir> = const { OnceCell::new() };
}

/// Runs with a folder of this thread's own, in memory where the system has such a place.
pub fn with_folder(run: impl FnOnce(&Path)) {
    FOLDER.with(|cell| {
        let memory = Path::new("/dev/shm");
        let make = || if memory.is_dir() { TempDir::new_in(memory) } else { TempDir::new() };
        run(cell.get_or_init(|| make().expect("a folder")).path());
    });
}

/// The first byte says what the others are.
pub fn run(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    let what = bytes.below(8);
    with_folder(|folder| {
        let (bag, metadata) = (folder.join("a.mcap"), folder.join("metadata.yaml"));
        if what == 0 {
            let rest = bytes.rest();
            let split = rest.iter().position(|byte| *byte == 0).unwrap_or(rest.len());
            fs::write(&metadata, &rest[..split]).expect("written");
            fs::write(&bag, &rest[split..]).expect("written");
            read(folder);
        } else {
            fs::write(&bag, bytes.rest()).expect("written");
            read(&bag);
        }
    });
}

fn read(path: &Path) {
    let bag = match Bag::open(path) {
        Ok(bag) => bag,
        Err(error) => return assert!(error.to_string().len() < 10_000),
    };
    let survey = bag.survey(&AtomicBool::new(false));
    let first = survey.topics.first().map(|topic| Wanted { topic: topic.name.clone(), info: None });
    let first: Vec<_> = first.into_iter().collect();
    let choices = [choose(&survey.topics, &[], &[], None), choose(&survey.topics, &first, &[], None)];
    let sensors = choices.into_iter().flatten().next().map_or_else(Vec::new, |choice| choice.sensors);
    let mut decoder = Decoder::new(sensors, FILTER, TransformTopics::default());
    decoder.look_for_cameras(bag.messages().take(10_000).map_while(Result::ok));
    let mut join = Join::new(4);
    for message in bag.messages().take(10_000) {
        let Ok(message) = message else { break };
        for recorded in decoder.decode(&message) {
            take(recorded, &mut join);
        }
    }
    let hint =
        join.hint(join.oldest().and_then(|(_, why)| why), GivenUp::AtEnd, TransformsFrom::Bag, String::new);
    assert!(join.waiting() <= 4 && hint.is_none_or(|hint| hint.len() < 10_000));
}

fn take(recorded: Recorded, join: &mut Join) {
    match recorded {
        Recorded::Cloud { sensor, cloud } => {
            check(cloud.clone(), &FILTER, 1 << 16);
            if let Ok(cloud) = cloud {
                drop(join.cloud(sensor, cloud, Moment::default()));
                for joined in join.ready("map") {
                    assert!(joined.scan.sensor_origin().iter().all(|value| value.is_finite()));
                }
            }
        }
        Recorded::Transforms { message, is_static } => {
            for transform in &message.transforms {
                drop(join.transform(transform, is_static));
            }
        }
        Recorded::Doubt(_) | Recorded::Undecodable { .. } => {}
    }
}
