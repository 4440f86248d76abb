//! What the node sends: over any middleware, and into a result bag.

use super::cdr;
use super::clusters::{Session, SurfaceClusterArray};
use super::labelled::labelled_points;
use super::markers::Markers;
use super::reports::{DiagnosticArray, Log};
use super::ros::{Header, MarkerArray, PointCloud2};
use super::sent;
use super::topic::Topic;
use super::twins::{Detection3DArray, PolygonInstanceStamped, Twins, detections, polygons};
use crate::engine::Snapshot;

/// A message, on its topic.
#[derive(Clone, Debug)]
pub enum Outgoing {
    /// On `~/clusters`.
    Clusters(SurfaceClusterArray),
    /// On `~/clusters_delta`.
    Delta(SurfaceClusterArray),
    /// On `~/markers`.
    Markers(MarkerArray),
    /// On `~/points_labelled`.
    Labelled(PointCloud2),
    /// On `/diagnostics`.
    Diagnostics(DiagnosticArray),
    /// On `/rosout`.
    Log(Log),
    /// On `~/detections`.
    Detections(Detection3DArray),
    /// On `~/polygons`.
    Polygon(PolygonInstanceStamped),
}

impl Outgoing {
    /// Its topic.
    pub const fn topic(&self) -> Topic {
        match self {
            Self::Clusters(_) => sent::CLUSTERS,
            Self::Delta(_) => sent::DELTA,
            Self::Markers(_) => sent::MARKERS,
            Self::Labelled(_) => sent::LABELLED,
            Self::Diagnostics(_) => sent::DIAGNOSTICS,
            Self::Log(_) => sent::LOG,
            Self::Detections(_) => sent::DETECTIONS,
            Self::Polygon(_) => sent::POLYGONS,
        }
    }

    /// Its header: of markers the first one's. `None` where it has none.
    pub fn header(&self) -> Option<&Header> {
        match self {
            Self::Clusters(array) | Self::Delta(array) => Some(&array.header),
            Self::Markers(markers) => markers.markers.first().map(|first| &first.header),
            Self::Labelled(cloud) => Some(&cloud.header),
            Self::Diagnostics(report) => Some(&report.header),
            Self::Log(_) => None,
            Self::Detections(array) => Some(&array.header),
            Self::Polygon(polygon) => Some(&polygon.header),
        }
    }

    /// Puts it behind what `out` holds, in CDR.
    ///
    /// # Errors
    /// Where it has a list of more entries than CDR counts.
    pub fn write(&self, out: &mut Vec<u8>) -> Result<(), cdr_encoding::Error> {
        match self {
            Self::Clusters(array) | Self::Delta(array) => cdr::write(out, array),
            Self::Markers(markers) => cdr::write(out, markers),
            Self::Labelled(cloud) => cdr::write(out, cloud),
            Self::Diagnostics(report) => cdr::write(out, report),
            Self::Log(line) => cdr::write(out, line),
            Self::Detections(array) => cdr::write(out, array),
            Self::Polygon(polygon) => cdr::write(out, polygon),
        }
    }
}

/// The messages of a map but for its polygons, in the order in which they go out: the points last, for they are a burst of
/// datagrams that fills a reader's socket, and what came right behind it would be lost there.
pub fn of_map(session: &Session, snapshot: &Snapshot, markers: &mut Markers, twins: Twins) -> Vec<Outgoing> {
    let mut messages = vec![
        Outgoing::Clusters(SurfaceClusterArray::snapshot(session, snapshot)),
        Outgoing::Markers(markers.update(session, snapshot)),
    ];
    messages.extend(twins.detections.then(|| Outgoing::Detections(detections(session, snapshot))));
    messages.push(Outgoing::Labelled(labelled_points(session, snapshot)));
    messages
}

/// The polygons of a map, where they are wanted: they come after its other messages.
pub fn polygons_of(session: &Session, snapshot: &Snapshot, twins: Twins) -> Vec<Outgoing> {
    let polygons = twins.polygons.then(|| polygons(session, snapshot));
    polygons.into_iter().flatten().map(Outgoing::Polygon).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_points_of_a_map_go_out_last_for_what_follows_them_is_lost_where_they_fill_the_reader_s_socket() {
        let session = Session { id: 1, frame_id: "odom".into() };
        let snapshot = Snapshot {
            sequence: 1,
            stamp: None,
            voxel_size: 0.1,
            clusters: Vec::new(),
            voxels: Vec::new(),
            unclustered_voxels: 0,
        };
        let twins = Twins { detections: true, polygons: true };
        let map = of_map(&session, &snapshot, &mut Markers::default(), twins);
        let topics: Vec<_> = map.iter().map(Outgoing::topic).collect();
        assert_eq!(topics, [sent::CLUSTERS, sent::MARKERS, sent::DETECTIONS, sent::LABELLED]);
    }
}
