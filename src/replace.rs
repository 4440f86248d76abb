//! A file that takes the place of another once all of it is there.
//!
//! **Kept true.** The other is whole under its name until the new one, on the disk, has the name. Nothing that has the temporary
//! name already is opened: it may be a link that somebody has put there.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// A file under a temporary name; dropping it before [`Partial::settle`] removes it.
#[derive(Debug)]
pub(crate) struct Partial {
    name: PathBuf,
    /// Whether dropping removes it.
    is_temporary: bool,
}

impl Partial {
    /// Makes the file, with the rights of any new one.
    ///
    /// # Errors
    /// Where there is something under this name, or the system refuses it.
    pub(crate) fn create(name: PathBuf) -> io::Result<(Self, File)> {
        let file = File::options().write(true).create_new(true).open(&name)?;
        Ok((Self { name, is_temporary: true }, file))
    }

    /// Brings the file to the disk and gives it the other name. That its folder is on the disk is the caller's to see to.
    ///
    /// # Errors
    /// Where the system refuses it; what has the other name is then as it was.
    pub(crate) fn settle(&mut self, file: &File, target: &Path) -> io::Result<()> {
        // Without this the name can reach the disk before the bytes do.
        file.sync_all()?;
        fs::rename(&self.name, target)?;
        self.is_temporary = false;
        Ok(())
    }

    /// Leaves the file under its temporary name, which is returned.
    pub(crate) fn leave(mut self) -> PathBuf {
        self.is_temporary = false;
        std::mem::take(&mut self.name)
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        if self.is_temporary {
            // Whoever dropped it has an error to tell already.
            let _ = fs::remove_file(&self.name);
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
            let (mut partial, mut file) = Partial::create(name.clone()).unwrap();
            file.write_all(b"after").unwrap();
            if settles {
                partial.settle(&file, &target).unwrap();
                // Another's, made since.
                fs::write(&name, "").unwrap();
            }
            drop(partial);
            assert_eq!(fs::read_to_string(&target).unwrap(), expected);
            assert_eq!(name.exists(), settles);
        }
    }

    #[test]
    fn what_is_left_stays_under_its_temporary_name() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("a.part");
        let (partial, _) = Partial::create(name.clone()).unwrap();
        assert_eq!(partial.leave(), name);
        assert!(name.exists());
    }

    #[cfg(unix)]
    #[test]
    fn what_has_the_name_already_is_not_opened_even_where_it_leads_nowhere() {
        let folder = tempfile::tempdir().unwrap();
        let [name, other, missing] = ["a.part", "other", "missing"].map(|name| folder.path().join(name));
        fs::write(&other, "somebody's").unwrap();
        for to in [&other, &missing] {
            std::os::unix::fs::symlink(to, &name).unwrap();
            let error = Partial::create(name.clone()).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
            assert!(name.is_symlink() && !missing.exists());
            fs::remove_file(&name).unwrap();
        }
        assert_eq!(fs::read_to_string(&other).unwrap(), "somebody's");
    }
}
