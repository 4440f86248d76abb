//! Maps that are set aside, where anything is lost with them, and of which not too many are to be kept.

use std::fs;
use std::path::{Path, PathBuf};

use crate::store::{self, Kept};

/// A map of no scan has some numbers and the name of its frame: what is larger need not be read.
const MOST_WITHOUT_SCAN: u64 = 4096;

/// Whether nothing is lost with the map there, as that of a start whose driver never sent, or of a session between two jumps of a
/// clock: many of those would push out maps that were set aside.
pub(super) fn has_no_scan(path: &Path) -> bool {
    let is_small = path.metadata().is_ok_and(|about| about.len() <= MOST_WITHOUT_SCAN);
    is_small && store::read(path).is_ok_and(|stored| stored.map.sequence() == 0)
}

/// Removes the oldest files that were set aside where there are too many, and gives what there is to say of it. One that cannot
/// be removed stays.
pub(super) fn remove_oldest(path: &Path, kind: Kept) -> Vec<String> {
    let oldest = match store::too_many_aside(path, kind) {
        Ok(oldest) => oldest,
        Err(error) => return vec![format!("what is kept beside {} is not known: {error}", path.display())],
    };
    let most = store::MOST_ASIDE;
    let remove = |name: PathBuf| match fs::remove_file(&name) {
        Ok(()) => {
            format!("{} is removed: of its kind the newest {most} and the largest are kept", name.display())
        }
        Err(error) => {
            let name = name.display();
            format!(
                "{name} stays, though of its kind the newest {most} and the largest are to be kept: {error}"
            )
        }
    };
    oldest.into_iter().map(remove).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_file_that_is_removed_for_another_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map");
        for number in 1..=10 {
            fs::write(folder.path().join(format!("map.refused-{number}")), "x".repeat(number)).unwrap();
        }
        let line = |number| {
            format!(
                "{}.refused-{number} is removed: of its kind the newest 8 and the largest are kept",
                path.display()
            )
        };
        assert_eq!(remove_oldest(&path, Kept::Refused), [line(1), line(2)]);
        assert_eq!(folder.path().read_dir().unwrap().count(), 8);
        assert!(remove_oldest(&path, Kept::Refused).is_empty());
        let said = remove_oldest(&folder.path().join("none/map"), Kept::Refused);
        assert!(said.len() == 1 && said[0].contains("none/map is not known: "), "{said:?}");
    }
}
