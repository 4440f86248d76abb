//! Pixels with a depth: where parallelograms are drawn, the nearest wins, and edges between near and far are darkened.

use nalgebra::{Point3, Vector3};

/// What is seen in one pixel.
#[derive(Clone, Copy, Debug)]
struct Pixel {
    /// sRGB, 0 to 255.
    colour: [f32; 3],
    /// Towards the viewer (px); -infinity where nothing was drawn.
    nearness: f64,
}

/// A canvas in pixels: x to the right, y down, z towards the viewer.
#[derive(Clone, Debug)]
pub(super) struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<Pixel>,
}

/// A flat piece with a border.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parallelogram {
    /// One of its corners (px).
    pub(super) corner: Point3<f64>,
    /// The edges that begin at the corner (px).
    pub(super) edges: [Vector3<f64>; 2],
    /// sRGB, 0 to 255.
    pub(super) colour: [f32; 3],
    /// sRGB along the border, 0 to 255.
    pub(super) border_colour: [f32; 3],
}

/// Width of a border, of the edge across it.
const BORDER: f64 = 0.07;

impl Canvas {
    pub(super) fn new(width: usize, height: usize, background: [u8; 3]) -> Self {
        let pixel = Pixel { colour: background.map(f32::from), nearness: f64::NEG_INFINITY };
        Self { width, height, pixels: vec![pixel; width * height] }
    }

    /// Draws the pixels whose centres lie in the parallelogram and that nothing nearer covers.
    pub(super) fn draw(&mut self, piece: &Parallelogram) {
        let [u, v] = piece.edges;
        let area = u.x * v.y - u.y * v.x;
        if area == 0.0 {
            return;
        }
        let extent = |axis: usize, count: usize| {
            let ends = [0.0, u[axis], v[axis], u[axis] + v[axis]].map(|end| piece.corner[axis] + end);
            let smallest = ends.into_iter().fold(f64::INFINITY, f64::min);
            let largest = ends.into_iter().fold(f64::NEG_INFINITY, f64::max);
            (smallest.floor() as usize).min(count)..(largest.ceil() as usize).min(count)
        };
        for row in extent(1, self.height) {
            for column in extent(0, self.width) {
                let (x, y) = (column as f64 + 0.5 - piece.corner.x, row as f64 + 0.5 - piece.corner.y);
                let (a, b) = ((x * v.y - y * v.x) / area, (y * u.x - x * u.y) / area);
                if !(0.0..=1.0).contains(&a) || !(0.0..=1.0).contains(&b) {
                    continue;
                }
                let nearness = piece.corner.z + a * u.z + b * v.z;
                let pixel = &mut self.pixels[row * self.width + column];
                if nearness > pixel.nearness {
                    let to_border = a.min(1.0 - a).min(b).min(1.0 - b);
                    let colour = if to_border < BORDER { piece.border_colour } else { piece.colour };
                    *pixel = Pixel { colour, nearness };
                }
            }
        }
    }

    /// Darkens each pixel by how far its neighbours at `distance` px stand out in front of it.
    ///
    /// Eye-dome lighting (Boucheny 2009): it makes shapes stand out without a light to place. `reach` (px) is the
    /// nearness from which on a neighbour counts in full. The background is not darkened.
    pub(super) fn darken_behind_edges(&mut self, distance: usize, reach: f64) {
        let nearness: Vec<f64> = self.pixels.iter().map(|pixel| pixel.nearness).collect();
        let at = |row: usize, column: usize| nearness[row * self.width + column];
        for row in 0..self.height {
            for column in 0..self.width {
                let own = at(row, column);
                if own == f64::NEG_INFINITY {
                    continue;
                }
                let rows = [row.saturating_sub(distance), row, (row + distance).min(self.height - 1)];
                let columns =
                    [column.saturating_sub(distance), column, (column + distance).min(self.width - 1)];
                let around = rows.into_iter().flat_map(|row| columns.map(|column| at(row, column)));
                let covered: f64 = around.map(|other| ((other - own) / reach).clamp(0.0, 1.0)).sum();
                let light = (-0.16 * covered).exp() as f32;
                let pixel = &mut self.pixels[row * self.width + column];
                pixel.colour = pixel.colour.map(|channel| channel * light);
            }
        }
    }

    /// The mean of each block of `scale` x `scale` pixels, row-major.
    pub(super) fn scaled_down(&self, scale: usize) -> Vec<[u8; 3]> {
        let (width, height) = (self.width / scale, self.height / scale);
        let block = |row: usize, column: usize| {
            let rows = row * scale..(row + 1) * scale;
            rows.flat_map(move |row| &self.pixels[row * self.width + column * scale..][..scale])
        };
        let mean = |row, column| {
            let sum =
                block(row, column).fold([0.0; 3], |sum, pixel| [0, 1, 2].map(|i| sum[i] + pixel.colour[i]));
            sum.map(|channel| (channel / (scale * scale) as f32).round() as u8)
        };
        (0..height).flat_map(|row| (0..width).map(move |column| mean(row, column))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SKY: [u8; 3] = [10, 20, 30];

    /// A square of `size` px with its upper left corner at (x, y).
    fn square(x: f64, y: f64, nearness: f64, size: f64, colour: [f32; 3]) -> Parallelogram {
        let edges = [Vector3::new(size, 0.0, 0.0), Vector3::new(0.0, size, 0.0)];
        Parallelogram { corner: Point3::new(x, y, nearness), edges, colour, border_colour: colour }
    }

    #[test]
    fn a_square_covers_its_pixels_and_no_others_even_beyond_the_canvas() {
        let mut canvas = Canvas::new(4, 4, SKY);
        canvas.draw(&square(2.0, -1.0, 0.0, 9.0, [200.0; 3]));
        let row = [SKY, SKY, [200; 3], [200; 3]];
        assert_eq!(canvas.scaled_down(1), [row; 4].concat());
    }

    #[test]
    fn the_nearest_wins_in_whatever_order() {
        let (near, far) = (square(0.0, 0.0, 2.0, 3.0, [200.0; 3]), square(0.0, 0.0, 1.0, 3.0, [90.0; 3]));
        for order in [[&near, &far], [&far, &near]] {
            let mut canvas = Canvas::new(3, 3, SKY);
            for piece in order {
                canvas.draw(piece);
            }
            assert_eq!(canvas.scaled_down(1), [[200; 3]; 9]);
        }
    }

    #[test]
    fn only_what_lies_behind_an_edge_is_darkened() {
        let mut canvas = Canvas::new(8, 1, SKY);
        canvas.draw(&square(0.0, 0.0, 0.0, 6.0, [200.0; 3]));
        canvas.draw(&square(0.0, 0.0, 5.0, 3.0, [200.0; 3]));
        canvas.darken_behind_edges(1, 5.0);
        let reds = canvas.scaled_down(1).into_iter().map(|[red, ..]| red);
        assert_eq!(reds.collect::<Vec<_>>(), [200, 200, 200, 124, 200, 200, 10, 10]);
    }

    #[test]
    fn scaling_down_takes_the_mean() {
        let mut canvas = Canvas::new(2, 2, [0; 3]);
        canvas.draw(&square(0.0, 0.0, 0.0, 1.0, [200.0, 100.0, 0.0]));
        assert_eq!(canvas.scaled_down(2), [[50, 25, 0]]);
    }
}
