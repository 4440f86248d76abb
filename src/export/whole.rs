//! A file is written whole or not at all.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::os::fd::AsFd as _;
use std::path::{Path, PathBuf};

use crate::link::{descriptor, file_name, folder, target};
use crate::replace::Partial;

/// A file could not be written; the cause is its `source`.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}", path.display())]
pub struct WriteError {
    /// The file that was asked for.
    pub path: PathBuf,
    /// What went wrong.
    pub source: io::Error,
}

/// Writes a file by way of a temporary file in the same folder, which takes its place when it is complete.
///
/// # Errors
///
/// As [`WholeFile`]; the file is then as it was before, and no temporary file is left.
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), WriteError> {
    WholeFile::create(path)?.complete(|file| write(file))
}

/// A file under a temporary name in the folder of the one it is to be; dropping it before [`WholeFile::commit`] leaves
/// nothing behind. It has the permissions of the one that it replaces.
///
/// A symbolic link stays, and its target is replaced or made. What is no regular file, such as a pipe, cannot be replaced and is
/// written to directly; so is an open descriptor such as `/dev/stdout`, whatever is behind it, after what is there. What is written
/// later by way of a descriptor above 2 comes after that only where its file was opened for appending. A single file that is
/// mounted keeps its name, and gets the bytes once they are complete.
#[derive(Debug)]
pub struct WholeFile {
    /// As asked for.
    path: PathBuf,
    /// The temporary file and what it replaces; `None` where the output is written to directly.
    replaces: Option<(Partial, PathBuf)>,
    out: BufWriter<File>,
}

impl WholeFile {
    /// Makes the temporary file.
    ///
    /// # Errors
    ///
    /// Where it cannot be made: no such folder, no right to write there, no name of a file.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let (file, replaces) = open(path).map_err(|source| WriteError { path: path.to_owned(), source })?;
        Ok(Self { path: path.to_owned(), replaces, out: BufWriter::new(file) })
    }

    /// Writes all of the file and lets it take its place.
    ///
    /// # Errors
    ///
    /// As [`Self::commit`].
    pub fn complete(mut self, write: impl FnOnce(&mut Self) -> io::Result<()>) -> Result<(), WriteError> {
        write(&mut self).map_err(|source| WriteError { path: self.path.clone(), source })?;
        self.commit()
    }

    /// Lets the file take its place.
    ///
    /// # Errors
    ///
    /// Where the bytes cannot be written; the file is then as it was before. Only where that is a mounted one it may not be, and
    /// the temporary file stays, as the error says.
    pub fn commit(mut self) -> Result<(), WriteError> {
        self.settle().map_err(|source| WriteError { path: self.path.clone(), source })
    }

    /// Whether the output is written to directly, so that nothing of it can be taken back.
    pub const fn is_direct(&self) -> bool {
        self.replaces.is_none()
    }

    /// The file that was asked for.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn settle(&mut self) -> io::Result<()> {
        self.out.flush()?;
        let Some((partial, target)) = &mut self.replaces else { return Ok(()) };
        match partial.settle(self.out.get_ref(), target) {
            Err(error) if error.kind() == io::ErrorKind::ResourceBusy => self.write_over(),
            settled => settled,
        }
    }

    /// Copies the complete bytes into the file.
    fn write_over(&mut self) -> io::Result<()> {
        let Some((partial, target)) = self.replaces.take() else { return Ok(()) };
        let partial = partial.leave();
        let copied = copy(&partial, &target);
        copied.map_err(|error| within(&error, format_args!("all of it is in {}", partial.display())))?;
        fs::remove_file(partial)
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// What to write to, and where it is temporary what it replaces.
type Opened = (File, Option<(Partial, PathBuf)>);

fn open(path: &Path) -> io::Result<Opened> {
    if let Some(number) = descriptor(path) {
        return Ok((behind(number, path)?, None));
    }
    match fs::metadata(path) {
        Ok(metadata) if !metadata.is_file() => Ok((File::options().write(true).open(path)?, None)),
        Ok(_) => temporary(&fs::canonicalize(path)?),
        Err(_) => temporary(&target(path)?),
    }
}

/// What is behind an open descriptor, at the place where it stands: opened anew, a file would be written over from its beginning.
fn behind(number: u32, path: &Path) -> io::Result<File> {
    let duplicate = match number {
        0 => io::stdin().as_fd().try_clone_to_owned(),
        1 => io::stdout().as_fd().try_clone_to_owned(),
        2 => io::stderr().as_fd().try_clone_to_owned(),
        // No other can be duplicated without `unsafe`: its own place stays where it is.
        _ => return File::options().append(true).open(path),
    };
    duplicate.map(File::from)
}

fn copy(from: &Path, to: &Path) -> io::Result<()> {
    let (mut from, mut to) = (File::open(from)?, File::options().write(true).truncate(true).open(to)?);
    io::copy(&mut from, &mut to)?;
    to.sync_all()
}

/// An error of the same kind with words before its own.
fn within(error: &io::Error, words: impl std::fmt::Display) -> io::Error {
    io::Error::new(error.kind(), format!("{words}: {error}"))
}

fn temporary(target: &Path) -> io::Result<Opened> {
    let name =
        file_name(target).ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "not a file name"))?;
    let (partial, file) = partial(target, &name.to_string_lossy()).map_err(|error| {
        // The file itself may well be one that can be written.
        within(&error, format_args!("no new file can be made in {}", folder(target).display()))
    })?;
    Ok((file, Some((partial, target.to_owned()))))
}

/// Temporary files that processes which are gone have left of this file, ascending. They are not removed: a process in another
/// container may be writing one.
pub fn left_behind(path: &Path) -> Vec<PathBuf> {
    let place = fs::canonicalize(path).or_else(|_| target(path));
    let Some((place, name)) =
        place.ok().and_then(|place| Some((place.clone(), place.file_name()?.to_owned())))
    else {
        return Vec::new();
    };
    let name = name.to_string_lossy();
    left_in(folder(&place), |of| of == name)
}

/// As [`left_behind`], of any file of a folder.
pub fn left_behind_in(folder: &Path) -> Vec<PathBuf> {
    left_in(&fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned()), |_| true)
}

/// Those of the files of a folder that are meant, by name.
fn left_in(folder: &Path, is_meant: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let is_left = |name: &str| writer(name).is_some_and(|(of, process)| is_meant(of) && !is_running(process));
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let left = entries.filter(|entry| is_left(&entry.file_name().to_string_lossy()));
    let mut left: Vec<_> = left.map(|entry| entry.path()).collect();
    left.sort();
    left
}

/// The file that a temporary file of this name is to become, and the process that writes it.
fn writer(name: &str) -> Option<(&str, u32)> {
    let (of, writer) = name.strip_prefix('.')?.strip_suffix(".part")?.rsplit_once('.')?;
    let (process, number) = writer.split_once('-')?;
    number.parse::<u32>().ok()?;
    Some((of, process.parse().ok()?))
}

/// Whether a process is there, or nobody can say.
fn is_running(id: u32) -> bool {
    let processes = Path::new("/proc");
    !processes.join("self").exists() || processes.join(id.to_string()).exists()
}

/// Names that are tried: one that is taken is left alone, for it may be that of a process in another container, with the same id.
const MOST_NAMES: u32 = 100;

fn partial(target: &Path, name: &str) -> io::Result<(Partial, File)> {
    let id = std::process::id();
    let create =
        |number| Partial::create(target.with_file_name(format!(".{name}.{id}-{number}.part")), target);
    let is_taken = |error: &io::Error| error.kind() == io::ErrorKind::AlreadyExists;
    let mut tried = (1..MOST_NAMES).map(create);
    let found = tried.find(|made| !made.as_ref().is_err_and(is_taken));
    found.unwrap_or_else(|| create(MOST_NAMES))
}

#[cfg(test)]
mod tests {
    use tempfile::TempDir;

    use super::*;

    /// A folder of the test's own, removed at its end.
    struct Folder(TempDir);

    impl Folder {
        fn new() -> Self {
            Self(tempfile::tempdir().unwrap())
        }

        fn names(&self) -> Vec<String> {
            let entries = fs::read_dir(self.0.path()).unwrap();
            let mut names: Vec<_> =
                entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
            names.sort();
            names
        }
    }

    #[test]
    fn a_file_is_made_and_replaced() {
        let folder = Folder::new();
        let path = folder.0.path().join("a.ply");
        for text in ["a longer text", "short"] {
            write_whole(&path, |out| out.write_all(text.as_bytes())).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(folder.names(), ["a.ply"]);
    }

    #[test]
    fn after_an_error_the_file_is_as_it_was_and_nothing_else_is_left() {
        let folder = Folder::new();
        let path = folder.0.path().join("a.ply");
        fs::write(&path, "before").unwrap();
        let error = write_whole(&path, |out| {
            out.write_all(&vec![0; 100_000])?;
            Err(io::Error::other("disk full"))
        });
        let error = error.unwrap_err();
        assert_eq!(error.to_string(), format!("cannot write {}", path.display()));
        assert_eq!(error.source.to_string(), "disk full");
        assert_eq!(fs::read_to_string(&path).unwrap(), "before");
        assert_eq!(folder.names(), ["a.ply"]);
    }

    #[test]
    fn an_error_names_the_file_whose_folder_is_missing() {
        let path = Path::new("/nowhere/at/all.ply");
        let error = write_whole(path, |_| Ok(())).unwrap_err();
        assert_eq!(error.path, path);
        assert_eq!(error.source.kind(), io::ErrorKind::NotFound);
        let source = error.source.to_string();
        assert!(source.starts_with("no new file can be made in /nowhere/at: "), "{source}");
    }

    #[test]
    fn a_file_that_keeps_its_name_gets_all_the_bytes_and_no_others() {
        let folder = Folder::new();
        let path = folder.0.path().join("a.ply");
        let other_name = folder.0.path().join("b.ply");
        fs::write(&path, "a longer text").unwrap();
        fs::hard_link(&path, &other_name).unwrap();
        let mut file = WholeFile::create(&path).unwrap();
        file.write_all(b"short").unwrap();
        file.flush().unwrap();
        file.write_over().unwrap();
        drop(file);
        assert_eq!(fs::read_to_string(&other_name).unwrap(), "short");
        assert_eq!(folder.names(), ["a.ply", "b.ply"]);
    }

    #[test]
    fn bytes_that_cannot_be_copied_stay_and_the_error_says_where() {
        let folder = Folder::new();
        let path = folder.0.path().join("a.ply");
        let mut file = WholeFile::create(&path).unwrap();
        file.write_all(b"all").unwrap();
        file.flush().unwrap();
        fs::create_dir(&path).unwrap();
        let error = file.write_over().unwrap_err().to_string();
        drop(file);
        let partial = format!(".a.ply.{}-1.part", std::process::id());
        assert!(error.starts_with("all of it is in /") && error.contains(&partial), "{error}");
        assert_eq!(folder.names(), [partial.as_str(), "a.ply"]);
        assert_eq!(fs::read_to_string(folder.0.path().join(partial)).unwrap(), "all");
    }

    #[test]
    fn what_has_the_temporary_name_already_is_neither_followed_nor_written_nor_removed() {
        let folder = Folder::new();
        let path = folder.0.path().join("a.ply");
        let id = std::process::id();
        let [planted, of_another] =
            [1, 2].map(|number| folder.0.path().join(format!(".a.ply.{id}-{number}.part")));
        let other = folder.0.path().join("other");
        fs::write(&other, "somebody's").unwrap();
        fs::write(&of_another, "half of").unwrap();
        std::os::unix::fs::symlink(&other, &planted).unwrap();
        write_whole(&path, |out| out.write_all(b"all")).unwrap();
        assert!(planted.is_symlink() && fs::symlink_metadata(&path).unwrap().is_file());
        let texts = [&path, &other, &of_another].map(|path| fs::read_to_string(path).unwrap());
        assert_eq!(texts, ["all", "somebody's", "half of"]);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn what_a_process_that_is_gone_has_left_is_named_and_stays() {
        let folder = Folder::new();
        let own = std::process::id();
        // No process has an id above 2^22 (proc(5), pid_max).
        let gone = 1 << 23;
        let left = [1, 2].map(|number| format!(".a.ply.{gone}-{number}.part"));
        let others =
            [format!(".a.ply.{own}-1.part"), format!(".b.ply.{gone}-1.part"), ".a.ply.x.part".to_owned()];
        left.iter().chain(&others).for_each(|name| fs::write(folder.0.path().join(name), "").unwrap());
        let named = left_behind(&folder.0.path().join("a.ply"));
        let place = folder.0.path().canonicalize().unwrap();
        assert_eq!(named, left.clone().map(|name| place.join(name)));
        assert!(named.iter().all(|path| path.exists()));
        assert!(left_behind(Path::new("/nowhere/at/all.ply")).is_empty());
        let of_any: Vec<_> = left.iter().chain(&others[1..2]).map(|name| place.join(name)).collect();
        assert_eq!(left_behind_in(folder.0.path()), of_any);
    }

    #[test]
    fn where_all_temporary_names_are_taken_nothing_is_written() {
        let folder = Folder::new();
        let path = folder.0.path().join("a.ply");
        for number in 1..=MOST_NAMES {
            let taken = format!(".a.ply.{}-{number}.part", std::process::id());
            fs::write(folder.0.path().join(taken), "").unwrap();
        }
        let error = WholeFile::create(&path).unwrap_err();
        assert_eq!(error.source.kind(), io::ErrorKind::AlreadyExists);
        assert!(!path.exists());
    }

    #[test]
    fn a_link_stays_a_link_and_its_target_is_replaced() {
        let folder = Folder::new();
        let (target, link) = (folder.0.path().join("target"), folder.0.path().join("link"));
        fs::write(&target, "before").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        write_whole(&link, |out| out.write_all(b"after")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read_to_string(&target).unwrap(), "after");
    }

    #[test]
    fn a_link_to_what_is_not_there_yet_stays_and_leads_to_the_file() {
        let folder = Folder::new();
        fs::create_dir(folder.0.path().join("disk")).unwrap();
        let [link, target, circle] = ["link", "disk/target", "circle"].map(|name| folder.0.path().join(name));
        std::os::unix::fs::symlink("disk/target", &link).unwrap();
        write_whole(&link, |out| out.write_all(b"new")).unwrap();
        assert!(link.is_symlink() && fs::symlink_metadata(&target).unwrap().is_file());
        assert_eq!(fs::read_to_string(&target).unwrap(), "new");
        std::os::unix::fs::symlink("circle", &circle).unwrap();
        assert!(write_whole(&circle, |_| Ok(())).is_err() && circle.is_symlink());
    }

    #[test]
    fn a_device_is_written_to_and_not_replaced() {
        use std::os::unix::fs::FileTypeExt;

        let device = Path::new("/dev/null");
        write_whole(device, |out| out.write_all(b"gone")).unwrap();
        assert!(fs::metadata(device).unwrap().file_type().is_char_device());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn an_open_descriptor_is_written_to_after_what_is_in_its_file() {
        use std::os::fd::AsRawFd as _;

        let folder = Folder::new();
        let [path, link] = ["all.json", "link"].map(|name| folder.0.path().join(name));
        fs::write(&path, "earlier\n").unwrap();
        let open = File::options().append(true).open(&path).unwrap();
        let number = open.as_raw_fd();
        let by_number = PathBuf::from(format!("/dev/fd/{number}"));
        std::os::unix::fs::symlink(&by_number, &link).unwrap();
        for name in [&by_number, &PathBuf::from(format!("/proc/self/fd/{number}")), &link] {
            let file = WholeFile::create(name).unwrap();
            assert!(file.is_direct(), "{}", name.display());
            file.complete(|out| out.write_all(b"more\n")).unwrap();
        }
        (&open).write_all(b"later\n").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "earlier\nmore\nmore\nmore\nlater\n");
        assert_eq!(folder.names(), ["all.json", "link"]);
    }

    #[test]
    fn a_name_that_only_a_folder_can_have_is_refused_before_anything_is_written() {
        let folder = Folder::new();
        fs::write(folder.0.path().join("a.ply"), "before").unwrap();
        for name in ["nd/", "nd/.", "a.ply/", "a.ply/."] {
            let error = WholeFile::create(&folder.0.path().join(name)).unwrap_err();
            assert_eq!(error.source.to_string(), "not a file name", "{name}");
        }
        assert_eq!(folder.names(), ["a.ply"]);
    }

    #[test]
    fn a_folder_is_not_written_to() {
        let folder = Folder::new();
        assert!(write_whole(folder.0.path(), |_| Ok(())).is_err());
        assert_eq!(folder.names(), [""; 0]);
    }
}
