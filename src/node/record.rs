//! What the node sends, as a result bag too.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::transport::Outgoing;
use crate::bag::{OutputTopics, ResultBag};
use crate::export::{WholeFile, WriteError};
use crate::msg::ros::TfMessage;

/// A result bag under way, shared by those who have something for it. The first failure ends the recording; the node goes
/// on, and [`Record::finish`] tells.
#[derive(Clone)]
pub struct Record {
    path: PathBuf,
    bag: Arc<Mutex<io::Result<ResultBag<WholeFile>>>>,
}

impl Record {
    /// Begins a bag.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn create(path: &Path, topics: &OutputTopics) -> Result<Self, WriteError> {
        let failed = |source| WriteError { path: path.to_owned(), source };
        let bag = ResultBag::new(WholeFile::create(path)?, topics, false).map_err(failed)?;
        Ok(Self { path: path.to_owned(), bag: Arc::new(Mutex::new(Ok(bag))) })
    }

    /// Adds what the node sends of the map.
    pub fn outgoing(&self, message: &Outgoing) {
        self.put(|bag| match message {
            Outgoing::Clusters(array) => bag.clusters(array),
            Outgoing::Delta(array) => bag.clusters_delta(array),
            Outgoing::Labelled(cloud) => bag.points_labelled(cloud),
            Outgoing::Detections(array) => bag.detections(array),
            Outgoing::Polygon(polygon) => bag.polygon(polygon),
            Outgoing::Markers(markers) => {
                markers.markers.first().map_or(Ok(()), |first| bag.markers(&first.header, markers))
            }
            Outgoing::Diagnostics(_) | Outgoing::Log(_) => Ok(()),
        });
    }

    /// Adds transforms of `/tf`, or of `/tf_static`.
    pub fn transforms(&self, message: &TfMessage, is_static: bool) {
        self.put(|bag| bag.transforms(message, is_static));
    }

    fn put(&self, write: impl FnOnce(&mut ResultBag<WholeFile>) -> io::Result<()>) {
        let mut bag = self.bag.lock().unwrap_or_else(PoisonError::into_inner);
        if let Ok(open) = &mut *bag
            && let Err(error) = write(open)
        {
            *bag = Err(error);
        }
    }

    /// Completes the bag, which then appears; whatever comes later is not in it.
    ///
    /// # Errors
    /// The first failure since the begin.
    pub fn finish(self) -> Result<(), WriteError> {
        let failed = |source| WriteError { path: self.path.clone(), source };
        let done = io::Error::other("the recording is complete");
        let bag = std::mem::replace(&mut *self.bag.lock().unwrap_or_else(PoisonError::into_inner), Err(done));
        bag.and_then(ResultBag::finish).map_err(failed)?.commit()
    }
}
