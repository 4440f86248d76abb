//! What a session begins with: an empty map, or the one that was saved.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;
use tracing::{info, warn};

use super::kept::{has_no_scan, remove_oldest};
use crate::config::Config;
use crate::count::count_of;
use crate::engine::{Engine, RestoreError};
use crate::link::{file_name, folder};
use crate::store::{self, Kept, Lock, StoreError, Stored};

/// The engine that a session begins with: with the map of `snapshot_path` where it is to be resumed and there is one. What
/// cannot be used is set aside, never written over: a damaged file, one of another version, and one that is not to be resumed; only a
/// map that has taken in no scan is left to be written over. Of what was set aside the newest [`store::MOST_ASIDE`] of each kind are
/// kept, and the largest. The lock is the right to save there, to be kept as long as the node runs.
///
/// # Errors
/// When there is no path, another process saves there, the map was made with other parameters, or a file cannot be read or
/// set aside.
pub fn begin(config: &Config, resume: bool) -> Result<(Engine, Option<Lock>), BeginError> {
    let Some(path) = config.snapshot_path.as_deref() else {
        return if resume { Err(BeginError::NoPath) } else { Ok((Engine::new(config.engine), None)) };
    };
    let Ok(target) = store::target(path) else { return Err(BeginError::NoFolder(path.to_owned())) };
    if !can_be_file(&target) {
        return Err(BeginError::NoFolder(path.to_owned()));
    }
    let lock = store::lock(path).map_err(BeginError::Locked)?;
    if resume {
        return Ok((resumed(config, path)?, Some(lock)));
    }
    if path.exists() && !has_no_scan(path) {
        let kept = kept_aside(path, Kept::Before)?;
        info!("not resumed: what was in {} is kept as {}", path.display(), kept.display());
    }
    Ok((Engine::new(config.engine), Some(lock)))
}

/// Whether this is a regular file, or could become one. What else has a name there (a device, a pipe) is not to be set aside.
fn can_be_file(target: &Path) -> bool {
    let has_place = file_name(target).is_some() && folder(target).is_dir();
    has_place && target.metadata().map_or(true, |data| data.is_file())
}

fn resumed(config: &Config, path: &Path) -> Result<Engine, BeginError> {
    let params = config.engine;
    match read(config, path) {
        Ok((engine, scans)) => {
            say_resumed(path, engine.voxel_count(), scans);
            Ok(engine)
        }
        Err(error) if error.is_missing() => {
            say_nothing_to_resume(path);
            Ok(Engine::new(params))
        }
        Err(StoreError::Map { error: error @ RestoreError::Parameter { .. }, .. }) => {
            Err(BeginError::Parameter { path: path.to_owned(), error })
        }
        // The file may be whole, and such a disk is not to be trusted with another name for it.
        Err(error @ StoreError::Io { .. }) => Err(BeginError::Unreadable(error)),
        Err(error) => {
            let kept = kept_aside(path, Kept::Refused)?;
            warn!("not resumed: {error}; it is kept as {}", kept.display());
            Ok(Engine::new(params))
        }
    }
}

/// Says what is resumed; of a map of no scan also whether a better one was there: it may have been set aside by a start that then
/// took in nothing.
fn say_resumed(path: &Path, voxels: usize, scans: u64) {
    let line = format!(
        "resumed: {} of {} from {}",
        count_of(voxels, "voxel"),
        count_of(scans, "scan"),
        path.display()
    );
    // Of those that were set aside another may be as empty.
    let size = path.metadata().map_or(0, |about| about.len());
    let kept = if scans == 0 { kept_larger(path, size) } else { Ok(None) };
    match kept {
        Ok(None) => info!("{line}"),
        Ok(Some(names)) => warn!("{line}; what was there is kept as {names} (rename it to go on with it)"),
        Err(error) => warn!("{line}; what is kept beside it is not known: {error}"),
    }
}

/// The newest file of each kind, of more than so many bytes, that was set aside; `None` where there is none.
fn kept_larger(path: &Path, size: u64) -> io::Result<Option<String>> {
    let newest = |kind| store::newest_aside(path, kind, size).transpose();
    let kept: io::Result<Vec<_>> = Kept::ALL.into_iter().filter_map(newest).collect();
    let names: Vec<_> = kept?.iter().map(|name| name.display().to_string()).collect();
    Ok((!names.is_empty()).then(|| names.join(" and ")))
}

/// Says that there is no map, and whether one was there: it may have been set aside by a start that then saved none.
fn say_nothing_to_resume(path: &Path) {
    let kept = kept_larger(path, 0);
    let path = path.display();
    match kept {
        Ok(None) => info!("nothing to resume: there is no {path} yet"),
        Ok(Some(names)) => {
            warn!(
                "nothing to resume: there is no {path}; what was there is kept as {names} (rename it to go on with it)"
            );
        }
        Err(error) => {
            warn!("nothing to resume: there is no {path}; what is kept beside it is not known: {error}");
        }
    }
}

/// The engine of a file, and how many scans it has taken in.
fn read(config: &Config, path: &Path) -> Result<(Engine, u64), StoreError> {
    let Stored { frame_id, map } = store::read(path)?;
    let refused = |error| StoreError::Map { path: path.to_owned(), error };
    if frame_id != config.fixed_frame {
        let (name, now) = ("fixed_frame", config.fixed_frame.clone());
        return Err(refused(RestoreError::Parameter { name, saved: frame_id, now }));
    }
    let scans = map.sequence();
    Ok((Engine::restore(config.engine, map).map_err(refused)?, scans))
}

/// Gives the file of a map another name beside its own.
fn kept_aside(path: &Path, kind: Kept) -> Result<PathBuf, BeginError> {
    let kept =
        store::set_aside(path, kind).map_err(|error| BeginError::Kept { path: path.to_owned(), error })?;
    for line in remove_oldest(path, kind) {
        warn!("{line}");
    }
    Ok(kept)
}

/// A session cannot begin with what is in `snapshot_path`.
#[derive(Debug, Error)]
pub enum BeginError {
    /// There is nothing to resume from.
    #[error("--resume needs the parameter snapshot_path: the file of the map")]
    NoPath,
    /// It cannot be written later.
    #[error(
        "snapshot_path is {}; it must be a file in a folder that exists{}",
        .0.display(),
        if .0.starts_with("~") { ", and `~` is not expanded here" } else { "" }
    )]
    NoFolder(PathBuf),
    /// It is another map.
    #[error("{path}: {error}; start with that, or without --resume")]
    Parameter {
        /// The file.
        path: PathBuf,
        /// What is other.
        error: RestoreError,
    },
    /// Another process saves there, or it cannot be known.
    #[error(transparent)]
    Locked(StoreError),
    /// It is there and cannot be read.
    #[error("cannot resume: {0}")]
    Unreadable(StoreError),
    /// The file would be written over.
    #[error("{path} cannot be set aside: {error}")]
    Kept {
        /// The file.
        path: PathBuf,
        /// The system's words.
        error: io::Error,
    },
}

impl BeginError {
    /// Whether starting the node in the same way will fail again.
    pub const fn is_configuration(&self) -> bool {
        matches!(self, Self::NoPath | Self::NoFolder(_) | Self::Parameter { .. })
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use nalgebra::Isometry3;
    use tracing_subscriber::layer::SubscriberExt as _;

    use super::*;
    use crate::config::Value;
    use crate::engine::{Points, Scan, Stamp};
    use crate::node::rosout::listen;

    fn names(folder: &Path) -> Vec<String> {
        let names = folder.read_dir().unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<_> = names.collect();
        names.sort();
        names
    }

    #[test]
    fn starts_again_and_again_keep_the_newest_eight_files_of_each_kind_and_the_largest_and_touch_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let [path, other] = ["map", "map.before-1.mine"].map(|name| folder.path().join(name));
        let config = saving_in(&path);
        fs::write(&other, "mine").unwrap();
        for number in 1..=20 {
            for resume in [false, true] {
                // Without `--resume` it is not looked at, with it refused.
                fs::write(&path, if number == 3 { "a larger map".to_owned() } else { number.to_string() })
                    .unwrap();
                begin(&config, resume).unwrap();
            }
        }
        let kinds = Kept::ALL.map(Kept::as_str);
        let kept = kinds
            .into_iter()
            .flat_map(|kind| [3].into_iter().chain(13..=20).map(move |n| format!("map.{kind}-{n}")));
        let others = ["map.before-1.mine", "map.lock"].map(str::to_owned);
        let mut expected: Vec<_> = kept.chain(others).collect();
        expected.sort();
        assert_eq!(names(folder.path()), expected);
        for kind in kinds {
            for number in 13..=20 {
                let kept = fs::read_to_string(folder.path().join(format!("map.{kind}-{number}"))).unwrap();
                assert_eq!(kept, number.to_string());
            }
        }
        assert_eq!(fs::read_to_string(other).unwrap(), "mine");
    }

    #[test]
    fn what_is_no_regular_file_or_names_a_folder_is_refused_and_left_where_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("map");
        std::os::unix::fs::symlink("/dev/null", &link).unwrap();
        let new = folder.path().join("new/");
        for path in [Path::new("/dev/null"), &link, &new, folder.path()] {
            let config = saving_in(path);
            for resume in [false, true] {
                let refused = begin(&config, resume).err();
                assert!(matches!(refused, Some(BeginError::NoFolder(_))), "{}: {refused:?}", path.display());
            }
        }
        assert_eq!(names(folder.path()), ["map"]);
        assert!(!Path::new("/dev/null").metadata().unwrap().is_file());
    }

    /// Saves a map of so many scans where the configuration says.
    fn save(config: &Config, scans: u16) {
        let mut engine = Engine::new(config.engine);
        let (stamp, points) = (Stamp::default(), Points::F32(Vec::new()));
        let scan = Scan { stamp, fixed_from_sensor: Isometry3::identity(), points };
        (0..scans).for_each(|_| drop(engine.insert(&scan)));
        store::write(config.snapshot_path.as_deref().unwrap(), &config.fixed_frame, engine.freeze()).unwrap();
    }

    /// A driver that does not start.
    #[test]
    fn starts_that_take_in_no_scan_are_not_kept_and_push_out_no_map_that_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map");
        let config = saving_in(&path);
        for scans in [1, 2] {
            save(&config, scans);
            begin(&config, false).unwrap();
        }
        for _ in 0..=store::MOST_ASIDE {
            save(&config, 0);
            begin(&config, false).unwrap();
        }
        assert_eq!(names(folder.path()), ["map", "map.before-1", "map.before-2", "map.lock"]);
        for scans in [1, 2] {
            let kept = store::read(&folder.path().join(format!("map.before-{scans}"))).unwrap();
            assert_eq!(kept.map.sequence(), scans);
        }
    }

    #[test]
    fn of_a_start_that_took_in_no_scan_nothing_is_named_where_there_is_no_map() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map");
        let config = saving_in(&path);
        save(&config, 0);
        begin(&config, false).unwrap();
        fs::remove_file(&path).unwrap();
        assert_eq!(said(&config), (20, format!("nothing to resume: there is no {} yet", path.display())));
    }

    fn saving_in(path: &Path) -> Config {
        Config::new([("snapshot_path".to_owned(), Value::Text(path.display().to_string()))]).unwrap()
    }

    /// The first line that is said when a session is to be resumed, and its level.
    fn said(config: &Config) -> (u8, String) {
        let (listener, mut lines) = listen();
        let log = tracing_subscriber::registry().with(listener);
        tracing::subscriber::with_default(log, || drop(begin(config, true).unwrap()));
        lines.0.try_recv().map(|line| (line.level, line.msg)).unwrap()
    }

    #[test]
    fn where_there_is_no_map_those_that_were_set_aside_last_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map");
        let config = saving_in(&path);
        let none = format!("nothing to resume: there is no {}", path.display());
        assert_eq!(said(&config), (20, format!("{none} yet")));
        fs::create_dir(folder.path().join("map.before-3")).unwrap();
        for name in ["map.before-1", "map.before-2", "map.refused-1"] {
            fs::write(folder.path().join(name), name).unwrap();
        }
        let (level, line) = said(&config);
        assert_eq!(level, 30);
        let kept = format!("{0}.before-2 and {0}.refused-1 (", path.display());
        assert!(line.starts_with(&format!("{none}; what was there is kept as {kept}")), "{line}");
    }

    #[test]
    fn where_the_map_has_no_scan_the_newest_of_those_set_aside_that_has_more_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map");
        let config = saving_in(&path);
        let empty = Engine::new(config.engine);
        store::write(&path, &config.fixed_frame, empty.freeze()).unwrap();
        let resumed = format!("resumed: 0 voxels of 0 scans from {}", path.display());
        fs::copy(&path, folder.path().join("map.before-3")).unwrap();
        assert_eq!(said(&config), (20, resumed.clone()), "what is kept is as empty");
        let size = path.metadata().unwrap().len();
        fs::write(folder.path().join("map.before-2"), vec![0; size as usize + 1]).unwrap();
        let kept =
            format!("what was there is kept as {}.before-2 (rename it to go on with it)", path.display());
        assert_eq!(said(&config), (30, format!("{resumed}; {kept}")));
    }

    #[test]
    fn a_map_of_an_older_version_is_said_to_be_one_and_not_to_be_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map");
        let config = saving_in(&path);
        store::write(&path, &config.fixed_frame, Engine::new(config.engine).freeze()).unwrap();
        let mut older = fs::read(&path).unwrap();
        older[8] = store::VERSION as u8 - 1;
        fs::write(&path, older).unwrap();
        let [older, now] = [store::VERSION - 1, store::VERSION];
        let line = format!("is of version {older}; this program reads version {now}; it is kept as");
        let path = path.display();
        assert_eq!(said(&config), (30, format!("not resumed: {path} {line} {path}.refused-1")));
    }
}
