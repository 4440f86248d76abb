//! Organized clouds of a pinhole camera: each x and y says nothing that its depth and its pixel do not.
//!
//! The rays are found from some of the points and every point is held against them; where all x and y are what the rays
//! give, to a millionth of the depth (rounding in single precision makes a third of that), the depths are all that is kept.
//! Any other cloud stays a list of points.

use std::sync::Arc;

use pulp::{Simd, WithSimd};

use super::convert::{Converted, Gate, front, judged};
use super::layout::Layout;
use crate::engine::arch::arch;
use crate::engine::{Depths, Points, Rays};

/// Least number of columns and rows; smaller clouds are lists.
const LEAST_SIDE: usize = SAMPLED;
/// Least number of points that the rays are found from.
const LEAST_SAMPLES: f64 = 100.0;
/// Columns and rows that they are taken from, about.
const SAMPLED: usize = 32;
/// How far x and y may be off the ray, in depths.
const TOLERANCE: f32 = 1e-6;

/// The depths of an organized cloud in an optical frame; `None` where it is no pinhole camera's.
pub(super) fn depths(layout: &Layout, data: &[u8], gate: &Gate) -> Option<Converted> {
    let [width, height] = layout.size();
    if !gate.is_optical() || !layout.is_at_front() || width < LEAST_SIDE || height < LEAST_SIDE {
        return None;
    }
    match layout.point_step {
        12 => depths_of::<12>(layout, data, gate),
        16 => depths_of::<16>(layout, data, gate),
        20 => depths_of::<20>(layout, data, gate),
        32 => depths_of::<32>(layout, data, gate),
        _ => None,
    }
}

/// The depths of a cloud whose points have N bytes, x, y and z first.
fn depths_of<const N: usize>(layout: &Layout, data: &[u8], gate: &Gate) -> Option<Converted> {
    let rays = find_rays::<N>(layout, data)?;
    let mut depths = Vec::with_capacity(rays.x.len() * rays.y.len());
    let judge = Judge { rays: &rays, range: gate.depths() };
    let reading = Reading::<N> { layout, data, judge: &judge, depths: &mut depths };
    let tally = arch().dispatch(reading)?;
    let invalid = depths.len() as u32 - tally.measured;
    let points = Points::Depths(Depths::counted(Arc::new(rays), depths, tally.kept as usize)?);
    Some(Converted { points, invalid, out_of_range: tally.measured - tally.kept })
}

/// What the points of a row, or of several, are.
#[derive(Clone, Copy, Default)]
struct Tally {
    measured: u32,
    kept: u32,
    off_ray: u32,
}

/// Which depths are kept.
struct Judge<'a> {
    rays: &'a Rays,
    range: [f32; 2],
}

impl Judge<'_> {
    /// Replaces the depths of a row that are not kept.
    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "a lazy operator is a branch")]
    fn row(&self, [xs, ys]: [&[f32]; 2], depths: &mut [f32], row_ray: f32) -> Tally {
        let mut tally = Tally::default();
        for (((z, x), y), ray) in depths.iter_mut().zip(xs).zip(ys).zip(&self.rays.x) {
            let (depth, is_measured, is_kept) = judged(*z, self.range);
            let most = TOLERANCE * *z;
            let is_on_ray = ((*x - ray * *z).abs() <= most) & ((*y - row_ray * *z).abs() <= most);
            tally.off_ray += u32::from(is_measured & !is_on_ray);
            tally.measured += u32::from(is_measured);
            tally.kept += u32::from(is_kept);
            *z = depth;
        }
        tally
    }
}

/// All rows of a cloud, in code for the processor at hand.
struct Reading<'a, const N: usize> {
    layout: &'a Layout,
    data: &'a [u8],
    judge: &'a Judge<'a>,
    depths: &'a mut Vec<f32>,
}

impl<const N: usize> WithSimd for Reading<'_, N> {
    /// `None` where a point is off its ray.
    type Output = Option<Tally>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Option<Tally> {
        let width = self.judge.rays.x.len();
        let [mut xs, mut ys] = [vec![0.0_f32; width], vec![0.0_f32; width]];
        let mut all = Tally::default();
        for (row, &row_ray) in self.layout.rows(self.data).zip(&self.judge.rays.y) {
            let points = row.as_chunks::<N>().0;
            let begin = self.depths.len();
            self.depths.extend(points.iter().zip(&mut xs).zip(&mut ys).map(|((point, x), y)| {
                let z;
                [*x, *y, z] = front(point);
                z
            }));
            let tally = self.judge.row([&xs, &ys], &mut self.depths[begin..], row_ray);
            if tally.off_ray > 0 {
                return None;
            }
            all.measured += tally.measured;
            all.kept += tally.kept;
        }
        Some(all)
    }
}

/// The line x / z over the column and the line y / z over the row that some of the points lie on.
fn find_rays<const N: usize>(layout: &Layout, data: &[u8]) -> Option<Rays> {
    let (mut xs, mut ys) = (Line::default(), Line::default());
    let [width, height] = layout.size();
    for (v, row) in layout.rows(data).enumerate().step_by(height / SAMPLED) {
        for (u, point) in row.as_chunks::<N>().0.iter().enumerate().step_by(width / SAMPLED) {
            let [x, y, z] = front(point).map(f64::from);
            if x.is_finite() && y.is_finite() && z.is_finite() && z > 0.0 {
                xs.add(u as f64, x / z);
                ys.add(v as f64, y / z);
            }
        }
    }
    Some(Rays { x: xs.values(width)?, y: ys.values(height)? })
}

/// A line through points, by least squares.
#[derive(Default)]
struct Line {
    count: f64,
    at: f64,
    value: f64,
    at_at: f64,
    at_value: f64,
}

impl Line {
    fn add(&mut self, at: f64, value: f64) {
        self.count += 1.0;
        self.at += at;
        self.value += value;
        self.at_at += at * at;
        self.at_value += at * value;
    }

    /// Its values at 0, 1, ...; `None` where the points are few or lie at one place.
    fn values(&self, count: usize) -> Option<Vec<f32>> {
        let spread = self.at_at - self.at * self.at / self.count;
        if self.count < LEAST_SAMPLES || spread <= 0.0 {
            return None;
        }
        let slope = (self.at_value - self.at * self.value / self.count) / spread;
        let first = (self.value - slope * self.at) / self.count;
        Some((0..count).map(|at| (first + slope * at as f64) as f32).collect())
    }
}
