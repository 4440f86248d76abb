//! A file that takes the place of another once all of it is there.
//!
//! **Kept true.** The other is whole under its name until the new one, on the disk, has the name. Nothing that has the temporary
//! name already is opened: it may be a link that somebody has put there.

use std::collections::BTreeSet;
use std::fs::{self, File, Metadata, Permissions};
use std::io;
use std::os::unix::fs::{OpenOptionsExt as _, PermissionsExt as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The names of those that dropping removes, for an end of the process at which nothing is dropped. It is not held while the system
/// is asked for anything: a disk that does not answer must hold up none of another disk.
static TEMPORARY: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn temporary() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    TEMPORARY.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the temporary files of this process, which is about to end: none of them takes the place of another after this.
#[cfg(feature = "node")]
pub(crate) fn remove_temporary() {
    let names = std::mem::take(&mut *temporary());
    for name in names {
        // Whoever ends the process at once asks for no reasons.
        let _ = fs::remove_file(name);
    }
}

/// A file under a temporary name; dropping it before [`Partial::settle`] removes it.
#[derive(Debug)]
pub(crate) struct Partial {
    name: PathBuf,
    /// Whether dropping removes it.
    is_temporary: bool,
}

impl Partial {
    /// Makes the file, with the permissions of the one that it is to replace; where there is none, with those of any new one.
    ///
    /// # Errors
    /// Where there is something under this name, or the system refuses it.
    pub(crate) fn create(name: PathBuf, target: &Path) -> io::Result<(Self, File)> {
        let permissions =
            fs::metadata(target).ok().filter(Metadata::is_file).map(|about| about.permissions());
        let file = create_new(&name, permissions.as_ref())?;
        temporary().insert(name.clone());
        let partial = Self { name, is_temporary: true };
        // The mask of the process has taken some of them away.
        if let Some(permissions) = permissions.filter(|it| is_other(&file, it)) {
            file.set_permissions(permissions)?;
        }
        Ok((partial, file))
    }

    /// Brings the file to the disk and gives it the other name. That its folder is on the disk is the caller's to see to.
    ///
    /// # Errors
    /// Where the system refuses it; what has the other name is then as it was.
    pub(crate) fn settle(&mut self, file: &File, target: &Path) -> io::Result<()> {
        // Without this the name can reach the disk before the bytes do.
        file.sync_all()?;
        fs::rename(&self.name, target)?;
        self.stays();
        Ok(())
    }

    /// Leaves the file under its temporary name, which is returned.
    pub(crate) fn leave(mut self) -> PathBuf {
        self.stays();
        std::mem::take(&mut self.name)
    }

    fn stays(&mut self) {
        self.is_temporary = false;
        temporary().remove(&self.name);
    }
}

/// Nobody can read it for a moment who could not read the other.
fn create_new(name: &Path, permissions: Option<&Permissions>) -> io::Result<File> {
    let mut options = File::options();
    if let Some(permissions) = permissions {
        options.mode(permissions.mode() & 0o777);
    }
    options.write(true).create_new(true).open(name)
}

fn is_other(file: &File, permissions: &Permissions) -> bool {
    file.metadata().is_ok_and(|about| about.permissions() != *permissions)
}

impl Drop for Partial {
    fn drop(&mut self) {
        if self.is_temporary {
            // Whoever dropped it has an error to tell already.
            let _ = fs::remove_file(&self.name);
            temporary().remove(&self.name);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    #[test]
    fn a_file_takes_the_place_of_another_or_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let [name, target] = ["a.part", "a"].map(|name| folder.path().join(name));
        for (settles, expected) in [(false, "before"), (true, "after")] {
            fs::write(&target, "before").unwrap();
            let (mut partial, mut file) = Partial::create(name.clone(), &target).unwrap();
            file.write_all(b"after").unwrap();
            assert!(temporary().contains(&name));
            if settles {
                partial.settle(&file, &target).unwrap();
                // Another's, made since.
                fs::write(&name, "").unwrap();
            }
            drop(partial);
            assert!(!temporary().contains(&name));
            assert_eq!(fs::read_to_string(&target).unwrap(), expected);
            assert_eq!(name.exists(), settles);
        }
    }

    #[test]
    fn what_is_left_stays_under_its_temporary_name() {
        let folder = tempfile::tempdir().unwrap();
        let [name, target] = ["a.part", "a"].map(|name| folder.path().join(name));
        let (partial, _) = Partial::create(name.clone(), &target).unwrap();
        assert_eq!(partial.leave(), name);
        assert!(name.exists() && !temporary().contains(&name));
    }

    #[test]
    fn what_replaces_a_file_has_its_permissions_from_the_start_whatever_the_mask() {
        let folder = tempfile::tempdir().unwrap();
        let [name, target] = ["a.part", "a"].map(|name| folder.path().join(name));
        fs::write(&target, "before").unwrap();
        for mode in [0o640, 0o600, 0o666] {
            fs::set_permissions(&target, Permissions::from_mode(mode)).unwrap();
            let (mut partial, file) = Partial::create(name.clone(), &target).unwrap();
            let of = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
            assert_eq!(of(&name), mode, "{mode:o}");
            partial.settle(&file, &target).unwrap();
            assert_eq!(of(&target), mode, "{mode:o}");
        }
    }

    #[test]
    fn what_has_the_name_already_is_not_opened_even_where_it_leads_nowhere() {
        let folder = tempfile::tempdir().unwrap();
        let [name, other, missing] = ["a.part", "other", "missing"].map(|name| folder.path().join(name));
        fs::write(&other, "somebody's").unwrap();
        for to in [&other, &missing] {
            std::os::unix::fs::symlink(to, &name).unwrap();
            let error = Partial::create(name.clone(), to).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
            assert!(name.is_symlink() && !missing.exists());
            fs::remove_file(&name).unwrap();
        }
        assert_eq!(fs::read_to_string(&other).unwrap(), "somebody's");
    }
}
