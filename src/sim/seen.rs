//! Which parts of each surface were to be seen: the part of the truth that a map can be asked for.
//!
//! Every surface is divided into cells of 2 cm in its own (u, v), and a cell is seen once a ray without noise has met it
//! within the range. Costs a byte a cell, and about 1 ms a scan. A ray for every second pixel is 16 mm from the next at 4 m
//! on a surface that faces the camera; on one that is met at a grazing angle a single scan leaves gaps, which the next
//! scans of a moving robot close.

use nalgebra::Point3;

use super::drive::Drive;
use super::scene::Scene;
use super::surface::{Shape, Surface};

/// Edge of a cell (m).
pub const CELL: f64 = 0.02;

/// Every how-manieth pixel of a row and of a column has a ray.
const STRIDE: usize = 2;

/// The seen cells of every surface of a scene.
#[derive(Clone, Debug)]
pub struct SeenCells {
    surfaces: Vec<Cells>,
    max_range: f64,
}

/// The cells of one surface.
#[derive(Clone, Debug)]
struct Cells {
    surface: Surface,
    /// Number of cells along u and v.
    counts: [usize; 2],
    /// Row by row, v after v.
    seen: Vec<bool>,
}

impl Cells {
    fn new(surface: &Surface) -> Self {
        let counts = surface.shape().half_ranges().map(|half| (2.0 * half / CELL).ceil().max(1.0) as usize);
        Self { surface: surface.clone(), counts, seen: vec![false; counts[0] * counts[1]] }
    }

    /// Marks the cell of a point on the surface.
    fn mark(&mut self, local: &Point3<f64>) {
        let shape = self.surface.shape();
        let (coordinates, half) = (shape.coordinates(local), shape.half_ranges());
        // Rounding at an edge belongs to the last cell; a cast from a negative number gives 0.
        let [u, v] = [0, 1].map(|i| (((coordinates[i] + half[i]) / CELL) as usize).min(self.counts[i] - 1));
        self.seen[v * self.counts[0] + u] = true;
    }

    /// Middle and area (m^2) of the part of each seen cell that lies on the surface.
    fn parts(&self) -> impl Iterator<Item = ([f64; 2], f64)> {
        let half = self.surface.shape().half_ranges();
        let seen = self.seen.iter().enumerate().filter(|(_, seen)| **seen);
        seen.map(move |(index, _)| {
            let cell = [index % self.counts[0], index / self.counts[0]];
            let low = [0, 1].map(|i| cell[i] as f64 * CELL - half[i]);
            let high = [0, 1].map(|i| (low[i] + CELL).min(half[i]));
            part_on_surface(self.surface.shape(), low, high)
        })
    }
}

/// Middle and area of the part of a cell that lies on the surface, where it has an edge by 4 x 4 samples.
fn part_on_surface(shape: &Shape, low: [f64; 2], high: [f64; 2]) -> ([f64; 2], f64) {
    const SAMPLES: usize = 4;
    let at = |i: usize, share: f64| low[i] + share * (high[i] - low[i]);
    let (middle, area) = ([at(0, 0.5), at(1, 0.5)], (high[0] - low[0]) * (high[1] - low[1]));
    let is_whole = matches!(shape, Shape::Cylinder { .. } | Shape::Sphere { .. });
    if is_whole || matches!(shape, Shape::Rectangle { holes, .. } if holes.is_empty()) {
        return (middle, area);
    }
    let share = |k: usize| (k as f64 + 0.5) / SAMPLES as f64;
    let samples = (0..SAMPLES * SAMPLES).map(|k| [at(0, share(k % SAMPLES)), at(1, share(k / SAMPLES))]);
    let on: Vec<_> = samples.filter(|&sample| shape.reaches(sample)).collect();
    let count = on.len() as f64;
    if on.is_empty() {
        // Less than a sample of the cell, of which a ray has met something.
        return (middle, 0.0);
    }
    // The mean of points on both sides of a hole would lie in it: the sample nearest to the mean does not.
    let mean = [0, 1].map(|i| on.iter().map(|sample| sample[i]).sum::<f64>() / count);
    let from_mean = |sample: &[f64; 2]| (sample[0] - mean[0]).hypot(sample[1] - mean[1]);
    let nearest = on.iter().min_by(|a, b| from_mean(a).total_cmp(&from_mean(b)));
    (nearest.copied().unwrap_or(middle), area * count / (SAMPLES * SAMPLES) as f64)
}

impl SeenCells {
    /// Nothing is seen yet; rays end at a depth of `max_range` (m) or at that of the drive's camera.
    pub fn new(scene: &Scene, max_range: f64) -> Self {
        Self { surfaces: scene.surfaces().iter().map(Cells::new).collect(), max_range }
    }

    /// Adds what a drive through the scene sees at a step.
    pub fn add(&mut self, drive: &Drive, index: u32) {
        let seconds = drive.seconds(index);
        let poses: Vec<_> = self.surfaces.iter().map(|cells| cells.surface.pose_at(seconds)).collect();
        let mut nearer = drive.clone();
        if drive.kinect().max_range > self.max_range {
            nearer = nearer.with_max_range(self.max_range);
        }
        for (label, point) in nearer.true_hits(index, STRIDE) {
            let surface = label as usize - 1;
            if let Some(pose) = poses[surface] {
                self.surfaces[surface].mark(&pose.inverse_transform_point(&point));
            }
        }
    }

    /// Area of a surface's seen cells (m^2); 0 for a label that no surface has.
    pub fn area(&self, label: u32) -> f64 {
        self.of(label).into_iter().flat_map(Cells::parts).fold(0.0, |sum, (_, area)| sum + area)
    }

    /// A point in the middle of each of a surface's seen cells, in the fixed frame; of one that moves: where it is at the
    /// start.
    pub fn cells(&self, label: u32) -> impl Iterator<Item = Point3<f64>> {
        self.of(label).into_iter().flat_map(|cells| {
            let (pose, shape) = (cells.surface.pose(), cells.surface.shape());
            let parts = cells.parts().filter(|(_, area)| *area > 0.0);
            parts.map(move |(middle, _)| pose * shape.point(middle))
        })
    }

    fn of(&self, label: u32) -> Option<&Cells> {
        self.surfaces.get((label as usize).checked_sub(1)?)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::engine::{Stamp, SurfaceClass};

    fn seen(name: &str, steps: &[u32]) -> (Scene, SeenCells) {
        let scene = Scene::named(name).unwrap();
        let drive = Drive::new(scene.clone(), 1, Stamp::from_nanos(0));
        let mut seen = SeenCells::new(&scene, 5.0);
        steps.iter().for_each(|&index| seen.add(&drive, index));
        (scene, seen)
    }

    #[test]
    fn cells_lie_on_their_surface_and_fill_it_where_it_is_near() {
        let (scene, seen) = seen("room", &(0..1600).step_by(10).collect::<Vec<_>>());
        let table = scene.surfaces().iter().find(|surface| surface.name() == "table/top").unwrap();
        let area = seen.area(table.label());
        assert!(area > 0.97 * 1.4 * 0.8 && area < 1.4 * 0.8 + 1e-9, "{area} m^2 of the table");
        for cell in seen.cells(table.label()) {
            assert!(table.distance(&cell, 0.0).unwrap() < 1e-9, "{cell}");
        }
    }

    #[test]
    fn nothing_is_seen_beyond_the_range_or_behind_the_camera() {
        let (scene, seen) = seen("room", &[0]);
        let labelled = |name: &str| scene.surfaces().iter().find(|s| s.name() == name).unwrap().label();
        assert_eq!(seen.area(labelled("west wall")), 0.0);
        assert_eq!(seen.area(labelled("east wall")), 0.0, "its depth is 6 m");
        assert!(seen.area(labelled("floor")) > 5.0);
        assert_eq!((seen.area(0), seen.area(10_000)), (0.0, 0.0));
        assert_eq!(seen.cells(10_000).count(), 0);
    }

    #[test]
    fn all_cells_together_have_the_area_of_the_surface() {
        use std::f64::consts::PI;
        let shapes = [
            (Shape::rectangle([0.031, 1.005]), 0.031 * 1.005, 1e-9),
            (Shape::Cylinder { radius: 0.213, height: 0.77 }, 2.0 * PI * 0.213 * 0.77, 1e-9),
            (Shape::Sphere { radius: 0.117 }, 4.0 * PI * 0.117 * 0.117, 1e-9),
            (Shape::Disc { radius: 0.2 }, PI * 0.2 * 0.2, 0.01 * PI * 0.2 * 0.2),
        ];
        for (shape, area, exact) in shapes {
            let mut cells =
                Cells::new(&Surface::new("", SurfaceClass::Unknown, Isometry3::identity(), shape));
            cells.seen.fill(true);
            let sum: f64 = cells.parts().map(|(_, area)| area).sum();
            assert!((sum - area).abs() < exact, "{sum} m^2 is not {area} m^2");
        }
    }

    #[test]
    fn the_cells_of_bent_surfaces_lie_on_them() {
        let (scene, seen) = seen("clutter", &[0, 100, 200, 300]);
        let mut found = 0;
        for surface in scene.surfaces() {
            for cell in seen.cells(surface.label()) {
                found += usize::from(surface.class() == SurfaceClass::Curved);
                assert!(surface.distance(&cell, 0.0).unwrap() < 1e-9, "{}: {cell}", surface.name());
            }
        }
        assert!(found > 1000, "{found} cells");
    }
}
