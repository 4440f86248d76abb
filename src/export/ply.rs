//! The dense voxels as a point cloud in a PLY file, which `CloudCompare` and `MeshLab` open.

use std::io::{self, Write};

use crate::colour::cluster_colour;
use crate::engine::{ClusterId, DenseVoxel, Snapshot};

/// Name and type of each property, in the order of [`write_vertex`].
const PROPERTIES: [(&str, &str); 10] = [
    ("float", "x"),
    ("float", "y"),
    ("float", "z"),
    ("float", "nx"),
    ("float", "ny"),
    ("float", "nz"),
    ("uchar", "red"),
    ("uchar", "green"),
    ("uchar", "blue"),
    ("uint", "label"),
];

/// Writes the dense voxels as binary little-endian PLY, one vertex each, in the order of the snapshot.
///
/// Position: mean of the voxel's points, weighed as in [`DenseVoxel::centre`], fixed frame (m). Normal: unit length, `0 0 0`
/// where the voxel has none. Colour: that of the cluster. Label: the lower 32 bits of the cluster id, 0 for none.
///
/// # Errors
///
/// Those of `out`.
pub fn write_ply(out: &mut (impl Write + ?Sized), snapshot: &Snapshot) -> io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0")?;
    writeln!(out, "comment dense voxels of cfodi, metres; edge of a voxel {}", snapshot.voxel_size)?;
    writeln!(out, "element vertex {}", snapshot.voxels.len())?;
    for (kind, name) in PROPERTIES {
        writeln!(out, "property {kind} {name}")?;
    }
    writeln!(out, "end_header")?;
    snapshot.voxels.iter().try_for_each(|voxel| write_vertex(out, voxel))
}

fn write_vertex(out: &mut (impl Write + ?Sized), voxel: &DenseVoxel) -> io::Result<()> {
    let normal = voxel.normal.map_or([0.0; 3], |normal| normal.into_inner().into());
    let centre: [f64; 3] = voxel.centre.coords.into();
    for value in centre.into_iter().chain(normal) {
        out.write_all(&(value as f32).to_le_bytes())?;
    }
    out.write_all(&cluster_colour(voxel.cluster))?;
    let label = voxel.cluster.map_or(0, ClusterId::get) as u32;
    out.write_all(&label.to_le_bytes())
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitVector3, Vector3};

    use super::*;
    use crate::export::testing::corner_of_a_room;

    /// Position, normal, colour and label.
    type Vertex = ([f32; 3], [f32; 3], [u8; 3], u32);

    /// Reads what [`write_ply`] promises, and nothing else of PLY.
    fn read(bytes: &[u8]) -> (Vec<String>, Vec<Vertex>) {
        let end = b"end_header\n";
        let body = bytes.windows(end.len()).position(|window| window == end).unwrap() + end.len();
        let header = std::str::from_utf8(&bytes[..body]).unwrap().lines().map(str::to_owned).collect();
        let float = |bytes: &[u8], i: usize| f32::from_le_bytes(bytes[4 * i..][..4].try_into().unwrap());
        let vertices = bytes[body..].chunks(31).map(|vertex| {
            let position = [0, 1, 2].map(|i| float(vertex, i));
            let normal = [3, 4, 5].map(|i| float(vertex, i));
            let colour = vertex[24..27].try_into().unwrap();
            (position, normal, colour, u32::from_le_bytes(vertex[27..31].try_into().unwrap()))
        });
        (header, vertices.collect())
    }

    fn bits(vector: &Vector3<f64>) -> [u32; 3] {
        [0, 1, 2].map(|i| (vector[i] as f32).to_bits())
    }

    fn written(snapshot: &Snapshot) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_ply(&mut bytes, snapshot).unwrap();
        bytes
    }

    #[test]
    fn the_header_names_format_count_and_properties() {
        let (header, vertices) = read(&written(&corner_of_a_room()));
        let expected = "ply|format binary_little_endian 1.0|comment dense voxels of cfodi, metres; edge of a voxel 0.1|\
            element vertex 681|property float x|property float y|property float z|property float nx|\
            property float ny|property float nz|property uchar red|property uchar green|property uchar blue|\
            property uint label|end_header";
        assert_eq!(header, expected.split('|').collect::<Vec<_>>());
        assert_eq!(vertices.len(), 681);
    }

    #[test]
    fn every_voxel_is_read_back_in_its_order() {
        let snapshot = corner_of_a_room();
        let (_, vertices) = read(&written(&snapshot));
        for (voxel, (position, normal, colour, label)) in snapshot.voxels.iter().zip(vertices) {
            let expected_normal = voxel.normal.map_or(Vector3::zeros(), UnitVector3::into_inner);
            assert_eq!(position.map(f32::to_bits), bits(&voxel.centre.coords));
            assert_eq!(normal.map(f32::to_bits), bits(&expected_normal));
            assert_eq!(colour, cluster_colour(voxel.cluster));
            assert_eq!(u64::from(label), voxel.cluster.map_or(0, ClusterId::get));
        }
    }

    #[test]
    fn an_id_beyond_32_bits_keeps_its_lower_ones() {
        let mut snapshot = corner_of_a_room();
        snapshot.voxels.truncate(1);
        snapshot.voxels[0].cluster = ClusterId::new((7 << 32) + 5);
        assert_eq!(read(&written(&snapshot)).1[0].3, 5);
    }

    #[test]
    fn an_empty_map_is_a_file_without_vertices() {
        let mut snapshot = corner_of_a_room();
        snapshot.voxels.clear();
        let (header, vertices) = read(&written(&snapshot));
        assert!(header.contains(&"element vertex 0".to_owned()));
        assert!(vertices.is_empty());
    }
}
