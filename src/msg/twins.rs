//! Twins of the clusters, for those who build no `cfodi_msgs`: the map in messages that other packages have.
//!
//! `vision_msgs/Detection3DArray` is what viewers and pickers read. `geometry_msgs/PolygonInstanceStamped` is what nav2's
//! collision monitor reads since Jazzy, as a source of the type `polygon`: it keeps one polygon an id, samples its edges as
//! seen from above, and forgets what has not come again within its `source_timeout`. ROS has no array of these, so each
//! cluster is a message of its own, and what is gone is not sent again. Where it has none at all it stops the robot, so each
//! map has one without points too, by the id 0, which no cluster has.

use nalgebra::SMatrix;
use serde::{Deserialize, Serialize};

use super::clusters::{Session, polygon, pose};
use super::ros::{Header, Polygon, Pose, Vector3};
use super::sent;
use super::topic::Topic;
use crate::engine::{Cluster, Snapshot, SurfaceClass};

/// Which twins are sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Twins {
    /// [`detections`].
    pub detections: bool,
    /// [`polygons`].
    pub polygons: bool,
}

impl Twins {
    /// Whether a topic is sent; all but those of twins always are.
    pub fn include(self, topic: &Topic) -> bool {
        match *topic {
            sent::DETECTIONS => self.detections,
            sent::POLYGONS => self.polygons,
            _ => true,
        }
    }
}

/// `geometry_msgs/PoseWithCovariance`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    /// The pose.
    pub pose: Pose,
    /// 6x6, row major: x, y, z (m), turns about x, y, z of the frame (rad); all 0 where it is not known.
    #[serde(with = "six_by_six")]
    pub covariance: [f64; 36],
}

/// `vision_msgs/ObjectHypothesis`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ObjectHypothesis {
    /// Name of the class: `unknown`, `floor`, `ceiling`, `wall`, `horizontal`, `slope`, `curved`, `door`.
    pub class_id: String,
    /// 0 to 1.
    pub score: f64,
}

/// `vision_msgs/ObjectHypothesisWithPose`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names say all")]
pub struct ObjectHypothesisWithPose {
    pub hypothesis: ObjectHypothesis,
    pub pose: PoseWithCovariance,
}

/// `vision_msgs/BoundingBox3D`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BoundingBox3D {
    /// Its middle and axes.
    pub center: Pose,
    /// Full extents along them (m).
    pub size: Vector3,
}

/// `vision_msgs/Detection3D`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Detection3D {
    /// That of the array.
    pub header: Header,
    /// One: the class of the cluster.
    pub results: Vec<ObjectHypothesisWithPose>,
    /// The cluster's box.
    pub bbox: BoundingBox3D,
    /// The cluster's id, in decimal.
    pub id: String,
}

/// `vision_msgs/Detection3DArray`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Detection3DArray {
    /// Stamp of the newest scan, and the fixed frame.
    pub header: Header,
    /// One a cluster.
    pub detections: Vec<Detection3D>,
}

/// `geometry_msgs/PolygonInstance`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PolygonInstance {
    /// The cluster's boundary; empty by the id 0.
    pub polygon: Polygon,
    /// The cluster's id; 0 of none.
    pub id: i64,
}

/// `geometry_msgs/PolygonInstanceStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PolygonInstanceStamped {
    /// Stamp of the newest scan, and the fixed frame.
    pub header: Header,
    /// One cluster's.
    pub polygon: PolygonInstance,
}

/// The map as detections, in the order of the clusters.
pub fn detections(session: &Session, snapshot: &Snapshot) -> Detection3DArray {
    let header = session.header(snapshot.stamp);
    let detections = snapshot.clusters.iter().map(|cluster| detection(&header, cluster)).collect();
    Detection3DArray { header, detections }
}

fn detection(header: &Header, cluster: &Cluster) -> Detection3D {
    let center = pose(cluster);
    let hypothesis = ObjectHypothesis {
        class_id: cluster.class.name().to_owned(),
        score: f64::from(cluster.class_confidence),
    };
    let pose = PoseWithCovariance { pose: center, covariance: pose_covariance(cluster) };
    Detection3D {
        header: header.clone(),
        results: vec![ObjectHypothesisWithPose { hypothesis, pose }],
        bbox: BoundingBox3D {
            center,
            size: Vector3 { x: cluster.size.x, y: cluster.size.y, z: cluster.size.z },
        },
        id: cluster.id.to_string(),
    }
}

/// The plane's covariance, about the axes of the frame. Along the plane it is 0: there the box's middle follows from what
/// has been seen of the surface so far, which no covariance says.
fn pose_covariance(cluster: &Cluster) -> [f64; 36] {
    let Some(plane) = &cluster.plane_covariance else { return [0.0; 36] };
    let axes = cluster.pose.rotation.to_rotation_matrix().into_inner();
    let mut frame_from_plane = SMatrix::<f64, 6, 3>::zeros();
    frame_from_plane.fixed_view_mut::<3, 1>(0, 2).copy_from(&axes.column(2));
    frame_from_plane.fixed_view_mut::<3, 2>(3, 0).copy_from(&axes.fixed_columns::<2>(0));
    let covariance = frame_from_plane * plane * frame_from_plane.transpose();
    std::array::from_fn(|i| covariance[(i / 6, i % 6)])
}

/// The outlines of what a robot does not drive on or under: all clusters that have one, but floor and ceiling, whose edges
/// are where nobody has looked and no obstacles. Before them goes one of no cluster, once a scan has been taken in.
pub fn polygons<'a>(
    session: &Session,
    snapshot: &'a Snapshot,
) -> impl Iterator<Item = PolygonInstanceStamped> + use<'a> {
    let header = session.header(snapshot.stamp);
    let map = PolygonInstanceStamped { header: header.clone(), polygon: PolygonInstance::default() };
    let stands = |class| !matches!(class, SurfaceClass::Floor | SurfaceClass::Ceiling);
    let outlined = snapshot.clusters.iter().filter(move |c| stands(c.class) && !c.boundary.is_empty());
    let outlines = outlined.map(move |cluster| PolygonInstanceStamped {
        header: header.clone(),
        polygon: PolygonInstance { polygon: polygon(&cluster.boundary), id: cluster.id.get().cast_signed() },
    });
    snapshot.stamp.map(|_| map).into_iter().chain(outlines)
}

/// serde has no arrays of 36; six rows of 6 are the same bytes in CDR, the only form that is read.
mod six_by_six {
    use serde::ser::SerializeTuple as _;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(array: &[f64; 36], out: S) -> Result<S::Ok, S::Error> {
        let mut tuple = out.serialize_tuple(array.len())?;
        array.iter().try_for_each(|number| tuple.serialize_element(number))?;
        tuple.end()
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 36], D::Error> {
        let rows = <[[f64; 6]; 6]>::deserialize(from)?;
        Ok(std::array::from_fn(|i| rows[i / 6][i % 6]))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};

    use super::*;
    use crate::engine::Stamp;
    use crate::msg::markers::tests::square;

    fn snapshot(clusters: Vec<Cluster>) -> Snapshot {
        let stamp = Some(Stamp::from_nanos(2_500_000_000));
        Snapshot { sequence: 1, stamp, voxel_size: 0.1, clusters, voxels: Vec::new(), unclustered_voxels: 0 }
    }

    /// 1 m to the right, upright, its normal along the frame's x.
    fn cluster(id: u64, class: SurfaceClass) -> Cluster {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
        let corner = |y, z| Point3::new(1.0, y, z);
        Cluster {
            class,
            class_confidence: 0.75,
            normal: Vector3::x_axis(),
            offset: -1.0,
            plane_covariance: Some(Matrix3::from_diagonal(&Vector3::new(0.01, 0.02, 0.03))),
            boundary: vec![corner(-1.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0)],
            pose: Isometry3::from_parts(Translation3::new(1.0, 0.0, 0.5), turn),
            size: Vector3::new(2.0, 1.0, 0.1),
            ..square(id)
        }
    }

    fn session() -> Session {
        Session { id: 7, frame_id: "odom".into() }
    }

    #[test]
    fn a_detection_is_the_clusters_class_box_and_id() {
        let map = detections(&session(), &snapshot(vec![cluster(1 << 40, SurfaceClass::Door)]));
        let [door] = &map.detections[..] else { panic!("{} detections", map.detections.len()) };
        assert_eq!((&map.header.frame_id[..], map.header.stamp.nanosec), ("odom", 500_000_000));
        assert_eq!((&door.header, &door.id[..]), (&map.header, "1099511627776"));
        assert_eq!(door.bbox.size, super::Vector3 { x: 2.0, y: 1.0, z: 0.1 });
        let [result] = &door.results[..] else { panic!("{} results", door.results.len()) };
        assert_eq!(result.hypothesis, ObjectHypothesis { class_id: "door".into(), score: 0.75 });
        assert_eq!((result.pose.pose, door.bbox.center.position.z), (door.bbox.center, 0.5));
    }

    #[test]
    fn the_covariance_is_that_of_the_plane_about_the_axes_of_the_frame() {
        // The pose's x, y and z lie along the frame's -z, y and x.
        let covariance = pose_covariance(&cluster(1, SurfaceClass::Wall));
        let mut expected = [0.0; 36];
        (expected[0], expected[6 * 4 + 4], expected[6 * 5 + 5]) = (0.03, 0.02, 0.01);
        let differ = covariance.iter().zip(expected).position(|(a, b)| (a - b).abs() > 1e-12);
        assert_eq!(differ, None, "{covariance:?}");
        let unknown = Cluster { plane_covariance: None, ..cluster(1, SurfaceClass::Unknown) };
        assert!(pose_covariance(&unknown).iter().all(|number| *number == 0.0));
    }

    #[test]
    fn floor_and_ceiling_and_what_has_no_outline_are_no_polygons() {
        let bare = Cluster { boundary: Vec::new(), ..cluster(4, SurfaceClass::Wall) };
        let others = [(1, SurfaceClass::Floor), (2, SurfaceClass::Ceiling), (3, SurfaceClass::Unknown)];
        let mut clusters: Vec<_> = others.map(|(id, class)| cluster(id, class)).into();
        clusters.extend([bare, cluster(5, SurfaceClass::Horizontal)]);
        let sent: Vec<_> = polygons(&session(), &snapshot(clusters)).collect();
        assert_eq!(sent.iter().map(|sent| sent.polygon.id).collect::<Vec<_>>(), [0, 3, 5]);
        assert_eq!(sent[1].header, session().header(Some(Stamp::from_nanos(2_500_000_000))));
        assert_eq!(sent[1].polygon.polygon.points.len(), 3);
    }

    #[test]
    fn a_map_without_obstacles_is_one_polygon_without_points_and_no_map_is_none() {
        let map = snapshot(vec![cluster(1, SurfaceClass::Floor)]);
        let sent: Vec<_> = polygons(&session(), &map).collect();
        let header = session().header(map.stamp);
        assert_eq!(sent, [PolygonInstanceStamped { header, polygon: PolygonInstance::default() }]);
        let nothing = Snapshot { stamp: None, ..snapshot(Vec::new()) };
        assert_eq!(polygons(&session(), &nothing).count(), 0);
    }

    #[test]
    fn a_covariance_is_36_numbers_in_a_row_on_the_wire() {
        let covariance = std::array::from_fn(|i| i as f64);
        let sent = PoseWithCovariance { pose: Pose::default(), covariance };
        let bytes = cdr_encoding::to_vec::<_, byteorder::LittleEndian>(&sent).unwrap();
        assert_eq!((bytes.len(), &bytes[8 * (7 + 35)..]), (8 * (7 + 36), &35.0f64.to_le_bytes()[..]));
        let (read, _) = cdr_encoding::from_bytes::<_, byteorder::LittleEndian>(&bytes).unwrap();
        assert_eq!(sent, read);
    }
}
