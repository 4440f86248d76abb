//! The dense voxels as a table: `V.csv`.

use std::io::{self, Write};

use crate::engine::{ClusterId, Snapshot};

/// Writes one line a dense voxel, by ascending (ix, iy, iz), under the header
/// `ix,iy,iz,count,cx,cy,cz,nx,ny,nz,cluster_id`.
///
/// Centre: mean of the voxel's points, weighed as in [`DenseVoxel::centre`](crate::engine::DenseVoxel::centre), fixed frame (m). Normal: unit length, `0,0,0`
/// where the voxel has none. Cluster 0: none. Numbers have as many digits as it takes to tell them from their neighbours.
///
/// # Errors
///
/// Those of `out`.
pub fn write_voxels(out: &mut (impl Write + ?Sized), snapshot: &Snapshot) -> io::Result<()> {
    writeln!(out, "ix,iy,iz,count,cx,cy,cz,nx,ny,nz,cluster_id")?;
    for voxel in &snapshot.voxels {
        let ([ix, iy, iz], c) = (voxel.key.indices(), voxel.centre);
        let [nx, ny, nz]: [f64; 3] = voxel.normal.map_or([0.0; 3], |normal| normal.into_inner().into());
        let id = voxel.cluster.map_or(0, ClusterId::get);
        writeln!(out, "{ix},{iy},{iz},{},{},{},{},{nx},{ny},{nz},{id}", voxel.count, c.x, c.y, c.z)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::testing::corner_of_a_room;

    #[test]
    fn a_line_holds_what_the_header_says() {
        let mut bytes = Vec::new();
        write_voxels(&mut bytes, &corner_of_a_room()).unwrap();
        let text = String::from_utf8(bytes).unwrap();
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines.len(), 1 + 681);
        assert_eq!(lines[0], "ix,iy,iz,count,cx,cy,cz,nx,ny,nz,cluster_id");
        assert_eq!(lines[1], "-3,2,1,20,-0.25,0.25,0.15000000000000002,0,0,0,0");
        assert_eq!(lines[2], "0,0,0,20,0.05,0.05,0.05,0,0,1,1");
    }
}
