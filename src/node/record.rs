//! What the node sends, as a result bag too.
//!
//! The bag is compressed and written by the thread `cfodi-recorder`. A few messages may wait for it; who has one more waits
//! as well, for the bag is to hold all of them. A slow disk so holds up what is sent of the map, and then the engine, where newer
//! scans replace older ones, but never what is heard.

use std::io;
use std::path::{Path, PathBuf};
use std::thread::{Builder, JoinHandle};

use tokio::sync::mpsc::{Receiver, Sender, WeakSender, channel};

use crate::bag::{OutputTopics, ResultBag};
use crate::export::{WholeFile, WriteError};
use crate::msg::outgoing::Outgoing;
use crate::msg::ros::{TfMessage, Time};

/// Messages that may wait for the disk: the largest, all voxels of a map, has megabytes.
const WAITING: usize = 32;

type ToFile = ResultBag<WholeFile>;

#[derive(Debug)]
enum Entry {
    Outgoing(Outgoing),
    Transforms { message: TfMessage, is_static: bool },
}

impl Entry {
    fn write(&self, bag: &mut ToFile) -> io::Result<()> {
        match self {
            Self::Transforms { message, is_static } => bag.transforms(message, *is_static),
            Self::Outgoing(message) => bag.put(message),
        }
    }
}

/// A result bag under way. The first failure ends the recording; the node goes on, and [`Record::finish`] tells. Dropped
/// before, it leaves no file.
#[derive(Debug)]
pub struct Record {
    path: PathBuf,
    /// Until it is let go, more may come.
    open: Option<Sender<Entry>>,
    thread: Option<JoinHandle<io::Result<ToFile>>>,
}

impl Record {
    /// Begins a bag, and gives what is to be handed to those who have something for it.
    ///
    /// # Errors
    /// When it cannot be made, or the system gives no thread.
    pub fn create(path: &Path, topics: &OutputTopics) -> Result<(Self, Recorder), WriteError> {
        let failed = |source| WriteError { path: path.to_owned(), source };
        let bag = ResultBag::new(WholeFile::create(path)?, topics, false).map_err(failed)?;
        let (open, waiting) = channel(WAITING);
        let recorder = Recorder(open.downgrade());
        let thread = Builder::new().name("cfodi-recorder".to_owned());
        let thread = thread.spawn(move || write(bag, waiting)).map_err(failed)?;
        Ok((Self { path: path.to_owned(), open: Some(open), thread: Some(thread) }, recorder))
    }

    /// Completes the bag, which then appears; whatever comes later is not in it.
    ///
    /// # Errors
    /// The first failure since the start.
    pub fn finish(mut self) -> Result<(), WriteError> {
        let bag = self.end().and_then(ResultBag::finish);
        bag.map_err(|source| WriteError { path: self.path.clone(), source })?.commit()
    }

    /// Waits until all that has come is written.
    fn end(&mut self) -> io::Result<ToFile> {
        self.open = None;
        let ended = self.thread.take().and_then(|thread| thread.join().ok());
        ended.unwrap_or_else(|| Err(io::Error::other("the thread that writes it has died")))
    }
}

impl Drop for Record {
    /// Where the process ended before the thread, its temporary file would stay.
    fn drop(&mut self) {
        drop(self.end());
    }
}

/// Has something for a bag, which takes it for as long as it is under way and has not failed.
#[derive(Clone, Debug)]
pub struct Recorder(WeakSender<Entry>);

/// Whether a message has a time that it can stand under in a bag: a map without a scan has none.
fn has_stamp(message: &Outgoing) -> bool {
    message.header().is_some_and(|header| header.stamp != Time::default())
}

impl Recorder {
    /// Adds what the node sends of itself and of the map, once there is a scan in it.
    pub(super) async fn outgoing(&self, message: &Outgoing) {
        if let Some(open) = self.0.upgrade().filter(|_| has_stamp(message)) {
            drop(open.send(Entry::Outgoing(message.clone())).await);
        }
    }

    /// Adds transforms of `/tf`, or of `/tf_static`, from a thread of its own.
    pub fn transforms(&self, message: &TfMessage, is_static: bool) {
        if let Some(open) = self.0.upgrade() {
            drop(open.blocking_send(Entry::Transforms { message: message.clone(), is_static }));
        }
    }
}

/// Writes until no more can come; the first failure ends it at once.
fn write(mut bag: ToFile, mut waiting: Receiver<Entry>) -> io::Result<ToFile> {
    while let Some(entry) = waiting.blocking_recv() {
        entry.write(&mut bag)?;
    }
    Ok(bag)
}

#[cfg(test)]
pub(super) mod tests {
    use std::convert::Infallible;

    use tokio::runtime::Runtime;

    use super::*;
    use crate::bag::Bag;
    use crate::msg::clusters::SurfaceClusterArray;
    use crate::msg::ros::{Header, Marker, MarkerArray, PointCloud2, TransformStamped};
    use crate::msg::twins::Twins;

    /// A bag that begins.
    pub(in crate::node) fn begun(path: &Path) -> (Record, Recorder) {
        let resolved = |name: &str| Ok::<_, Infallible>(name.replace('~', "/cfodi"));
        let topics = OutputTopics::new(Twins::default(), resolved).unwrap();
        Record::create(path, &topics).unwrap()
    }

    /// The topics of a bag's messages, in its order.
    pub(in crate::node) fn recorded(path: &Path) -> Vec<String> {
        let messages = Bag::open(path).unwrap().messages();
        messages.map(|message| message.unwrap().topic().to_owned()).collect()
    }

    fn runtime() -> Runtime {
        tokio::runtime::Builder::new_current_thread().build().unwrap()
    }

    fn header() -> Header {
        Header { stamp: Time { sec: 5, nanosec: 0 }, ..Header::default() }
    }

    fn transforms() -> TfMessage {
        TfMessage { transforms: vec![TransformStamped::default()] }
    }

    #[test]
    fn a_bag_holds_all_that_came_before_its_end_however_much_that_is() {
        let folder = tempfile::tempdir().unwrap();
        let (path, runtime) = (folder.path().join("result.mcap"), runtime());
        let (record, recorder) = begun(&path);
        let delta =
            || Outgoing::Delta(SurfaceClusterArray { header: header(), ..SurfaceClusterArray::default() });
        recorder.transforms(&transforms(), true);
        // It would make the bag begin in 1970.
        let empty = [
            Outgoing::Clusters(SurfaceClusterArray::default()),
            Outgoing::Labelled(PointCloud2::default()),
            Outgoing::Markers(MarkerArray { markers: vec![Marker::default()] }),
        ];
        empty.iter().for_each(|message| runtime.block_on(recorder.outgoing(message)));
        (0..3 * WAITING).for_each(|_| runtime.block_on(recorder.outgoing(&delta())));
        recorder.transforms(&transforms(), false);
        record.finish().unwrap();
        runtime.block_on(recorder.outgoing(&delta()));
        recorder.transforms(&transforms(), false);
        let mut expected = vec!["/cfodi/clusters_delta"; 3 * WAITING];
        expected.insert(0, "/tf_static");
        expected.push("/tf");
        assert_eq!(recorded(&path), expected);
    }

    #[test]
    fn a_bag_that_is_given_up_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let (record, recorder) = begun(&folder.path().join("result.mcap"));
        recorder.transforms(&transforms(), true);
        drop(record);
        assert_eq!(folder.path().read_dir().unwrap().count(), 0);
    }

    /// More than waits for the disk in memory, and does not shrink.
    #[test]
    fn a_full_disk_ends_the_recording_and_holds_up_nobody_and_the_end_tells() {
        let ((record, recorder), runtime) = (begun(Path::new("/dev/full")), runtime());
        let noise = |i: u32| {
            let mixed = (i ^ (i >> 15)).wrapping_mul(0x2c1b_3c6d);
            ((mixed ^ (mixed >> 12)).wrapping_mul(0x297a_2d39) >> 24) as u8
        };
        let cloud = PointCloud2 {
            data: (0..1 << 20).map(noise).collect(),
            header: header(),
            ..PointCloud2::default()
        };
        let cloud = Outgoing::Labelled(cloud);
        (0..2 * WAITING).for_each(|_| runtime.block_on(recorder.outgoing(&cloud)));
        let error = record.finish().unwrap_err();
        assert_eq!(error.path, Path::new("/dev/full"));
        assert!(format!("{:?}", error.source).contains("No space left on device"), "{error:?}");
    }
}
