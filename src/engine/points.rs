//! The points of one sensor message, in the sensor's frame (m).

use std::sync::Arc;

/// Points as the sensor sent them, in the precision they came in.
#[derive(Clone, Debug, PartialEq)]
pub enum Points {
    /// Single precision.
    F32(Vec<[f32; 3]>),
    /// Single precision, with what was measured too far away to be a point: up to there, the rays have met nothing.
    Ended {
        /// The points.
        points: Vec<[f32; 3]>,
        /// Where the other rays end.
        ends: Vec<[f32; 3]>,
    },
    /// Double precision: clouds that somebody has already put into a far-away frame.
    F64(Vec<[f64; 3]>),
    /// The depths of a camera's pixels: what a Kinect measures, whether it comes as a depth image or as a cloud. x and y
    /// follow from the depth, to a millionth of it.
    Depths(Depths),
}

impl Points {
    /// The number of points.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(points) | Self::Ended { points, .. } => points.len(),
            Self::F64(points) => points.len(),
            Self::Depths(depths) => depths.len(),
        }
    }

    /// Whether there is no point at all; such a scan is taken in like any other.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// One depth for each pixel of a pinhole camera, in its optical frame (z forward, x right, y down; REP 103).
#[derive(Clone, Debug, PartialEq)]
pub struct Depths {
    rays: Arc<Rays>,
    pixels: Vec<f32>,
    measured: usize,
}

impl Depths {
    /// Row by row the depths (m) along these rays; [`f32::INFINITY`] where nothing was measured. `None` where there is not one
    /// for each pixel.
    ///
    /// What was measured too far away to be a point has its depth negated: up to there, the ray has met nothing. 0 is no
    /// measurement.
    pub fn new(rays: Arc<Rays>, depths: Vec<f32>) -> Option<Self> {
        let measured = depths.iter().filter(|depth| is_point(**depth)).count();
        Self::counted(rays, depths, measured)
    }

    /// Depths as [`Self::new`] takes them, asked for by the number of the pixel, row by row.
    pub fn by_pixel(rays: Arc<Rays>, depth: impl FnMut(usize) -> f32) -> Self {
        let pixels: Vec<_> = (0..rays.x.len() * rays.y.len()).map(depth).collect();
        let measured = pixels.iter().filter(|depth| is_point(**depth)).count();
        Self { rays, pixels, measured }
    }

    /// Depths as [`Self::new`] takes them, of which `measured` are points.
    pub(crate) fn counted(rays: Arc<Rays>, depths: Vec<f32>, measured: usize) -> Option<Self> {
        debug_assert_eq!(measured, depths.iter().filter(|depth| is_point(**depth)).count());
        (depths.len() == rays.x.len() * rays.y.len()).then_some(Self { rays, pixels: depths, measured })
    }

    /// The number of pixels with a point.
    pub const fn len(&self) -> usize {
        self.measured
    }

    /// Whether no pixel has a point.
    pub const fn is_empty(&self) -> bool {
        self.measured == 0
    }

    /// Where its pixels look.
    pub fn rays(&self) -> &Rays {
        &self.rays
    }

    /// The depths of each row (m), as [`Self::new`] has them.
    pub fn rows(&self) -> impl Iterator<Item = &[f32]> {
        self.pixels.chunks_exact(self.rays.x.len().max(1))
    }

    /// The points, row by row.
    pub fn list(&self) -> Vec<[f32; 3]> {
        self.list_of(|depth| depth)
    }

    /// Where those rays end that were measured too far away to be points, row by row.
    pub(crate) fn ends(&self) -> Vec<[f32; 3]> {
        self.list_of(|depth| -depth)
    }

    /// Tells the points of each row.
    pub(crate) fn each_row(&self, tell: impl FnMut(&[[f32; 3]])) {
        self.each_row_of(|depth| depth, tell);
    }

    fn list_of(&self, depth: impl Fn(f32) -> f32) -> Vec<[f32; 3]> {
        let mut list = Vec::with_capacity(self.measured);
        self.each_row_of(depth, |row| list.extend_from_slice(row));
        list
    }

    fn each_row_of(&self, depth: impl Fn(f32) -> f32, mut tell: impl FnMut(&[[f32; 3]])) {
        let mut points = vec![[0.0; 3]; self.rays.x.len()];
        for (row, y) in self.rows().zip(&self.rays.y) {
            let mut measured = 0;
            for (&z, x) in row.iter().zip(&self.rays.x) {
                // Written without asking, and overwritten where nothing was measured: a branch costs more.
                let z = depth(z);
                points[measured] = [z * x, z * y, z];
                measured += usize::from(is_point(z));
            }
            tell(&points[..measured]);
        }
    }
}

/// Whether a depth is that of a point: measured, and in range.
fn is_point(depth: f32) -> bool {
    0.0 < depth && depth < f32::INFINITY
}

/// Where the pixels of a pinhole camera look: x / z of each column and y / z of each row.
#[derive(Clone, Debug, PartialEq)]
pub struct Rays {
    /// x / z, by column.
    pub x: Vec<f32>,
    /// y / z, by row.
    pub y: Vec<f32>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_holds_what_was_measured_row_by_row() {
        let rays = Arc::new(Rays { x: vec![-0.5, 0.0, 0.5], y: vec![0.25, -0.25] });
        let none = f32::INFINITY;
        let depths = Depths::new(Arc::clone(&rays), vec![none, 2.0, 4.0, 1.0, -8.0, none]).unwrap();
        let (points, far) = ([[0.0, 0.5, 2.0], [2.0, 1.0, 4.0], [-0.5, -0.25, 1.0]], [0.0, -2.0, 8.0]);
        assert_eq!(depths.list(), points);
        assert_eq!(depths.ends(), [far]);
        assert_eq!((depths.len(), depths.is_empty()), (3, false));
        assert_eq!(Depths::new(rays, vec![1.0; 5]), None, "five depths of six pixels");
    }

    #[test]
    fn a_camera_without_pixels_has_no_rows() {
        let depths = Depths::new(Arc::new(Rays { x: vec![], y: vec![0.0; 3] }), vec![]).unwrap();
        assert_eq!((depths.rows().count(), depths.list().len()), (0, 0));
    }
}
