//! The topics that the node sends, in one table: they are the same over any middleware and in a result bag.

use super::topic::{Qos, Topic};
use super::types;

/// Whole maps.
pub const CLUSTERS: Topic = Topic::new("~/clusters", "cfodi_msgs/msg/SurfaceClusterArray", Qos::latched(1));
/// What each scan has changed.
pub const DELTA: Topic =
    Topic::new("~/clusters_delta", "cfodi_msgs/msg/SurfaceClusterArray", Qos::reliable(20));
/// The map to be looked at.
pub const MARKERS: Topic = Topic::new("~/markers", "visualization_msgs/msg/MarkerArray", Qos::latched(1));
/// Dense voxels; one of many megabytes, and an old one is of no use.
pub const LABELLED: Topic = Topic::new("~/points_labelled", types::CLOUD, Qos::best_effort(1));
/// The map as boxes around its clusters.
pub const DETECTIONS: Topic = Topic::new("~/detections", "vision_msgs/msg/Detection3DArray", Qos::latched(1));
/// The map with a message a cluster: none is to push out another of the same map. Not latched: only the last would be.
pub const POLYGONS: Topic =
    Topic::new("~/polygons", "geometry_msgs/msg/PolygonInstanceStamped", Qos::reliable(4096));
/// How the node is, once a second.
pub const DIAGNOSTICS: Topic =
    Topic::new("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", Qos::reliable(10));
/// The lines of the node's log.
pub const LOG: Topic = Topic::new("/rosout", "rcl_interfaces/msg/Log", Qos::latched(100));

/// The topics that the node sends, beside that of its parameters.
pub const TOPICS: [Topic; 8] = [CLUSTERS, DELTA, MARKERS, LABELLED, DETECTIONS, POLYGONS, DIAGNOSTICS, LOG];

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn each_topic_has_one_row_and_a_whole_type() {
        let names: BTreeSet<_> = TOPICS.iter().map(|topic| topic.name).collect();
        assert_eq!(names.len(), TOPICS.len());
        for Topic { name, type_name, qos } in TOPICS {
            assert_eq!(type_name.split('/').nth(1), Some("msg"), "{name}");
            assert!(qos.reliable || !qos.latched, "{name}");
        }
    }
}
