//! The map as a picture: the dense voxels as shaded cubes in the colours of their clusters.
//!
//! A parallel projection from above, so that all voxels are of one size and one shape: a cube is at most three
//! parallelograms, the same for every voxel. The same map and view give the same pixels.

use std::io::{self, Write};

use nalgebra::{Matrix3, Point3, Vector3};

use super::canvas::{Canvas, Parallelogram};
use super::cut::shown;
use crate::colour::cluster_colour;
use crate::engine::{DenseVoxel, Snapshot};

/// Canvas pixels along one edge of a pixel.
const SUPERSAMPLING: usize = 2;
/// Free border, of the picture's size.
const MARGIN: f64 = 0.04;

/// How a map is looked at.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Columns (px).
    pub width: usize,
    /// Rows (px).
    pub height: usize,
    /// Where the viewer stands, counter-clockwise from +x of the fixed frame (rad).
    pub azimuth: f64,
    /// How far the viewer stands above the horizon (rad).
    pub elevation: f64,
    /// Whether surfaces that show the viewer their back are left out, so that one looks over the near walls and through
    /// the ceiling into a room.
    pub cut_away: bool,
    /// sRGB of what is empty.
    pub background: [u8; 3],
}

impl Default for View {
    /// From behind the origin and to its right, 40 degrees above the horizon.
    fn default() -> Self {
        Self {
            width: 1200,
            height: 800,
            azimuth: -120_f64.to_radians(),
            elevation: 40_f64.to_radians(),
            cut_away: true,
            background: [255, 255, 255],
        }
    }
}

/// Pixels in sRGB, row-major.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green and blue of each pixel.
    pub pixels: Vec<[u8; 3]>,
}

impl Picture {
    /// Writes the picture as PNG.
    ///
    /// # Errors
    ///
    /// Those of `out`, and for a picture without a pixel.
    pub fn write_png(&self, out: impl Write) -> io::Result<()> {
        let mut encoder = png::Encoder::new(out, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(self.pixels.as_flattened())?;
        Ok(writer.finish()?)
    }
}

/// Draws the dense voxels, as large as the picture allows.
pub fn draw(snapshot: &Snapshot, view: &View) -> Picture {
    let axes = Axes::new(view);
    let voxels = shown(snapshot, view, &axes.towards_viewer);
    let window = Window::around([(voxels.as_slice(), snapshot.voxel_size)], &axes, view);
    draw_in(&window, &voxels, snapshot.voxel_size, &axes, view)
}

/// Draws several maps of one fixed frame through one window that holds them all, so that the same place has the same
/// pixel in each picture.
pub fn draw_alike(snapshots: &[&Snapshot], view: &View) -> Vec<Picture> {
    let axes = Axes::new(view);
    let maps: Vec<_> = snapshots
        .iter()
        .map(|snapshot| (shown(snapshot, view, &axes.towards_viewer), snapshot.voxel_size))
        .collect();
    let window = Window::around(maps.iter().map(|(voxels, size)| (voxels.as_slice(), *size)), &axes, view);
    maps.iter().map(|(voxels, size)| draw_in(&window, voxels, *size, &axes, view)).collect()
}

fn draw_in(window: &Window, voxels: &[&DenseVoxel], voxel_size: f64, axes: &Axes, view: &View) -> Picture {
    let [width, height] = canvas_size(view);
    let mut canvas = Canvas::new(width, height, view.background);
    let camera = Camera::new(axes, window, voxel_size);
    for voxel in voxels {
        camera.faces(voxel).for_each(|face| canvas.draw(&face));
    }
    canvas.darken_behind_edges(SUPERSAMPLING, 2.0 * camera.voxel_edge);
    let pixels = canvas.scaled_down(SUPERSAMPLING);
    Picture { width: view.width, height: view.height, pixels }
}

const fn canvas_size(view: &View) -> [usize; 2] {
    [view.width * SUPERSAMPLING, view.height * SUPERSAMPLING]
}

/// The viewer's axes in the fixed frame.
struct Axes {
    right: Vector3<f64>,
    down: Vector3<f64>,
    towards_viewer: Vector3<f64>,
    towards_light: Vector3<f64>,
}

impl Axes {
    fn new(view: &View) -> Self {
        let ((sin_az, cos_az), (sin_el, cos_el)) = (view.azimuth.sin_cos(), view.elevation.sin_cos());
        let towards_viewer = Vector3::new(cos_el * cos_az, cos_el * sin_az, sin_el);
        let right = Vector3::new(-sin_az, cos_az, 0.0);
        let down = right.cross(&towards_viewer);
        // Over the viewer's left shoulder: floor, left and right walls then differ in brightness.
        let towards_light = (towards_viewer - 0.9 * right - 0.8 * down).normalize();
        Self { right, down, towards_viewer, towards_light }
    }

    fn viewer_from_fixed(&self) -> Matrix3<f64> {
        let rows = [self.right, self.down, self.towards_viewer];
        Matrix3::from_rows(&rows.map(|row| row.transpose()))
    }

    /// The colour of a voxel's face in this light.
    ///
    /// The voxel's normal counts more than the face's: a slanted wall is then of one brightness, though made of steps.
    /// A voxel whose back is shown has no normal to go by.
    fn shade(&self, voxel: &DenseVoxel, face: &Vector3<f64>) -> [f32; 3] {
        let to_front = voxel.normal.filter(|normal| normal.dot(&self.towards_viewer) > 0.0);
        let normal = to_front.map_or(*face, |normal| (0.7 * normal.into_inner() + 0.3 * face).normalize());
        let light = 0.88 + 0.27 * normal.dot(&self.towards_light);
        cluster_colour(voxel.cluster).map(|channel| (f64::from(channel) * light).clamp(0.0, 255.0) as f32)
    }
}

/// Maps the fixed frame onto the canvas.
struct Window {
    canvas_from_fixed: Matrix3<f64>,
    offset: Vector3<f64>,
    /// Pixels of the canvas to a metre.
    scale: f64,
}

impl Window {
    /// The window that these voxels fill; with each list comes the edge of its voxels (m).
    fn around<'a>(
        maps: impl IntoIterator<Item = (&'a [&'a DenseVoxel], f64)>,
        axes: &Axes,
        view: &View,
    ) -> Self {
        let turn = axes.viewer_from_fixed();
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        let mut largest_voxel: f64 = 0.0;
        for (voxels, voxel_size) in maps {
            largest_voxel = largest_voxel.max(voxel_size);
            for voxel in voxels {
                let middle = turn * (lowest_corner(voxel) + Vector3::repeat(0.5)) * voxel_size;
                (low, high) = (low.inf(&middle), high.sup(&middle));
            }
        }
        if low.x > high.x {
            (low, high) = (Vector3::zeros(), Vector3::zeros());
        }
        // A cube reaches at most half its diagonal beyond its middle, and a map without extent is not magnified.
        let extent = (high - low).map(|extent| extent + 3_f64.sqrt() * largest_voxel);
        let canvas_size = canvas_size(view).map(|size| size as f64);
        let free = canvas_size.map(|size| size * (1.0 - 2.0 * MARGIN));
        let scale = (free[0] / extent.x).min(free[1] / extent.y);
        let canvas_middle = Vector3::new(0.5 * canvas_size[0], 0.5 * canvas_size[1], 0.0);
        let offset = canvas_middle - 0.5 * (low + high) * scale;
        Self { canvas_from_fixed: turn * scale, offset, scale }
    }
}

/// A window with the three sides of a voxel that the viewer sees.
struct Camera<'a> {
    axes: &'a Axes,
    window: &'a Window,
    voxel_size: f64,
    /// Edge of a voxel (px).
    voxel_edge: f64,
    sides: Vec<Side>,
}

/// One side of a cube of edge 1.
struct Side {
    normal: Vector3<f64>,
    /// From the voxel's lowest corner to a corner of the side.
    corner: Vector3<f64>,
    edges: [Vector3<f64>; 2],
}

impl<'a> Camera<'a> {
    fn new(axes: &'a Axes, window: &'a Window, voxel_size: f64) -> Self {
        let sides = sides_towards(&axes.towards_viewer);
        Self { axes, window, voxel_size, voxel_edge: window.scale * voxel_size, sides }
    }

    /// The sides of a voxel that the viewer sees, on the canvas.
    fn faces(&self, voxel: &'a DenseVoxel) -> impl Iterator<Item = Parallelogram> {
        let voxel_corner = lowest_corner(voxel);
        let canvas_from_grid = self.window.canvas_from_fixed * self.voxel_size;
        self.sides.iter().map(move |side| {
            let colour = self.axes.shade(voxel, &side.normal);
            Parallelogram {
                corner: Point3::from(canvas_from_grid * (voxel_corner + side.corner) + self.window.offset),
                edges: side.edges.map(|edge| canvas_from_grid * edge),
                colour,
                border_colour: colour.map(|channel| channel * 0.9),
            }
        })
    }
}

/// The voxel's indices: its lowest corner in voxels.
fn lowest_corner(voxel: &DenseVoxel) -> Vector3<f64> {
    Vector3::from(voxel.key.indices().map(f64::from))
}

/// The sides of a cube that are seen from a direction.
fn sides_towards(viewer: &Vector3<f64>) -> Vec<Side> {
    let unit = [Vector3::x(), Vector3::y(), Vector3::z()];
    let seen = (0..3).filter(|&axis| viewer[axis] != 0.0);
    seen.map(|axis| {
        let normal = unit[axis] * viewer[axis].signum();
        let corner = normal.sup(&Vector3::zeros());
        Side { normal, corner, edges: [unit[(axis + 1) % 3], unit[(axis + 2) % 3]] }
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::testing::corner_of_a_room;

    fn small() -> View {
        View { width: 160, height: 120, ..View::default() }
    }

    /// The share of the pixels whose hue is near that of a colour: each channel in the same proportion to the largest.
    fn share_of(picture: &Picture, colour: [u8; 3]) -> f64 {
        let proportions = |[red, green, blue]: [u8; 3]| {
            let largest = f64::from(red.max(green).max(blue).max(1));
            [red, green, blue].map(|channel| f64::from(channel) / largest)
        };
        let wanted = proportions(colour);
        let near = |pixel: &&[u8; 3]| {
            let own = proportions(**pixel);
            (0..3).all(|i| (own[i] - wanted[i]).abs() < 0.03)
        };
        picture.pixels.iter().filter(near).count() as f64 / picture.pixels.len() as f64
    }

    fn colour(cluster: u64) -> [u8; 3] {
        cluster_colour(crate::engine::ClusterId::new(cluster))
    }

    #[test]
    fn every_cluster_is_drawn_in_its_colour() {
        let picture = draw(&corner_of_a_room(), &small());
        assert_eq!(picture.pixels.len(), 160 * 120);
        for cluster in [1, 2] {
            assert!(share_of(&picture, colour(cluster)) > 0.1, "cluster {cluster}");
        }
    }

    #[test]
    fn the_map_fills_the_picture_up_to_its_margin() {
        for view in [small(), View { width: 90, height: 200, ..small() }] {
            let picture = draw(&corner_of_a_room(), &view);
            let drawn = |i: &usize| picture.pixels[*i] != view.background;
            let drawn: Vec<usize> = (0..picture.pixels.len()).filter(drawn).collect();
            let columns = drawn.iter().map(|i| i % view.width);
            let rows = drawn.iter().map(|i| i / view.width);
            let (left, right) = (columns.clone().min().unwrap(), columns.max().unwrap());
            let (top, bottom) = (rows.clone().min().unwrap(), rows.max().unwrap());
            assert!(left > 0 && top > 0 && right + 1 < view.width && bottom + 1 < view.height);
            let (wide, high) = ((right - left) as f64, (bottom - top) as f64);
            assert!(wide > 0.8 * view.width as f64 || high > 0.8 * view.height as f64);
        }
    }

    #[test]
    fn what_is_nearer_hides_what_is_behind_it() {
        // From behind the wall, which hides all of the floor but its front edge.
        let (azimuth, elevation) = (90_f64.to_radians(), 30_f64.to_radians());
        let view = View { azimuth, elevation, cut_away: false, ..small() };
        let picture = draw(&corner_of_a_room(), &view);
        let [floor, wall] = [1, 2].map(|cluster| share_of(&picture, colour(cluster)));
        assert!(wall > 0.3 && floor < 0.1 * wall, "floor {floor}, wall {wall}");
    }

    #[test]
    fn surfaces_of_one_colour_differ_in_brightness() {
        let mut map = corner_of_a_room();
        map.voxels.retain(|voxel| voxel.cluster.is_some());
        map.voxels.iter_mut().for_each(|voxel| voxel.cluster = None);
        let brightest = |is_floor: bool| {
            let mut part = map.clone();
            part.voxels.retain(|voxel| (voxel.key.indices()[2] == 0) == is_floor);
            let picture = draw(&part, &small());
            picture.pixels.into_iter().filter(|pixel| *pixel != small().background).max().unwrap()
        };
        let [floor, wall] = [brightest(true), brightest(false)].map(|[red, ..]| i32::from(red));
        assert!((floor - wall).abs() > 5, "floor {floor}, wall {wall}");
    }

    #[test]
    fn the_same_map_gives_the_same_picture() {
        let map = corner_of_a_room();
        assert!(draw(&map, &small()) == draw(&map, &small()));
    }

    #[test]
    fn drawn_alike_what_has_not_changed_stays_where_it_was() {
        let map = corner_of_a_room();
        let mut before = map.clone();
        before.voxels.retain(|voxel| voxel.key.indices()[0] < 5);
        let pictures = draw_alike(&[&before, &map], &small());
        assert!(pictures[1] == draw(&map, &small()));
        let drawn = |&i: &usize| pictures[0].pixels[i] != small().background;
        let drawn: Vec<usize> = (0..pictures[0].pixels.len()).filter(drawn).collect();
        let kept = drawn.iter().filter(|&&i| pictures[0].pixels[i] == pictures[1].pixels[i]).count();
        assert!(drawn.len() > 500 && kept > drawn.len() * 9 / 10, "{kept} of {}", drawn.len());
        assert!(draw_alike(&[], &small()).is_empty());
    }

    #[test]
    fn an_empty_map_and_one_of_a_single_voxel_can_be_drawn() {
        let mut map = corner_of_a_room();
        map.voxels.truncate(1);
        let single = draw(&map, &small());
        assert!(single.pixels.iter().any(|pixel| *pixel != small().background));
        map.voxels.clear();
        assert!(draw(&map, &small()).pixels.iter().all(|pixel| *pixel == small().background));
    }

    #[test]
    fn a_png_holds_the_picture() {
        let picture = draw(&corner_of_a_room(), &small());
        let mut bytes = Vec::new();
        picture.write_png(&mut bytes).unwrap();
        let mut reader = png::Decoder::new(io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height), (160, 120));
        assert!(pixels == picture.pixels.as_flattened());
    }
}
