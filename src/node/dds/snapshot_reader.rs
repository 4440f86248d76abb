//! The other side: what a planner reads.

use ros2_client::Subscription;
use ros2_client::qos::Durability;

use super::opener::Kept;
use super::{Opener, reliable};
use crate::args::Setup;
use crate::msg::clusters::SurfaceClusterArray;
use crate::msg::sent;
use crate::msg::topic::Named;
use crate::node::middleware::OpenError;

/// Reads the snapshots that a node publishes.
pub struct SnapshotReader {
    snapshots: Subscription<SurfaceClusterArray>,
    _kept: Kept,
}

impl SnapshotReader {
    /// Opens the node of `setup`, without parameters, and reads `/cfodi/clusters`, which remappings give another name.
    ///
    /// # Errors
    /// When the middleware refuses something.
    pub fn open(setup: &Setup) -> Result<Self, OpenError> {
        let setup = setup.for_node(&setup.name);
        let security = setup.security()?;
        let mut opener = Opener::new(&setup, &security)?;
        let latched = (&reliable(1, Durability::TransientLocal)).into();
        let topic = setup.resolve("/cfodi/clusters")?;
        let snapshots = opener.subscribe(Named { name: &topic, ..sent::CLUSTERS.named() }, &latched)?;
        Ok(Self { snapshots, _kept: opener.into_kept() })
    }

    /// The next snapshot.
    ///
    /// # Errors
    /// When it cannot be read.
    pub async fn next(&self) -> Result<SurfaceClusterArray, OpenError> {
        let taken = self.snapshots.async_take().await;
        let (snapshot, _) = taken.map_err(|error| OpenError::Read { text: error.to_string() })?;
        Ok(snapshot)
    }
}
