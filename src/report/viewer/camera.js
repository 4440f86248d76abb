// A parallel projection: all voxels are of one size and one shape, and lengths in one direction compare.

const START = { azimuth: (-120 * Math.PI) / 180, elevation: (40 * Math.PI) / 180 };
/** Free border, of the picture's size. */
const MARGIN = 0.05;
/** Largest edge of a voxel (CSS px). */
const LARGEST_EDGE = 160;

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const sum = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

class Camera {
  constructor(voxelSize) {
    this.voxelSize = voxelSize;
    this.azimuth = START.azimuth;
    this.elevation = START.elevation;
    /** In the middle of the picture (m). */
    this.target = [0, 0, 0];
    /** CSS px a metre. */
    this.scale = 100;
    /** Of what was fitted last, to the picture's right and down (m). */
    this.extents = [1, 1];
    /** Of the picture (CSS px). */
    this.size = [0, 0];
    /** How many times as large as where all fits. */
    this.zoomed = 1;
  }

  /** Unit vectors in the fixed frame: to the picture's right, down in it, and towards the viewer. */
  axes() {
    const [sinA, cosA] = [Math.sin(this.azimuth), Math.cos(this.azimuth)];
    const [sinE, cosE] = [Math.sin(this.elevation), Math.cos(this.elevation)];
    return {
      right: [-sinA, cosA, 0],
      down: [cosA * sinE, sinA * sinE, -cosE],
      towards: [cosE * cosA, cosE * sinA, sinE],
    };
  }

  turn(dx, dy) {
    this.azimuth -= dx * 0.008;
    this.elevation = clamp(this.elevation + dy * 0.008, -Math.PI / 2, Math.PI / 2);
  }

  /** Moves the map by (dx, dy) CSS px. */
  move(dx, dy) {
    const { right, down } = this.axes();
    this.target = sum(this.target, sum(scaled(right, -dx / this.scale), scaled(down, -dy / this.scale)));
  }

  /** Zooms; the place at (x, y) CSS px from the middle stays where it is. */
  zoom(factor, x = 0, y = 0) {
    const before = this.scale;
    this.scale = this.possible(before * factor);
    this.zoomed = this.scale / this.fitting();
    const kept = 1 - this.scale / before;
    this.move(x * kept, y * kept);
  }

  /** The map grows and shrinks with the picture: what was in it stays in it. */
  resize(width, height) {
    this.size = [width, height];
    this.scale = this.possible(this.zoomed * this.fitting());
  }

  possible(scale) {
    return clamp(scale, 1e-3, LARGEST_EDGE / this.voxelSize);
  }

  /** Where a place of the fixed frame is, in CSS px from the middle. */
  project(place) {
    const { right, down } = this.axes();
    const from = sum(place, scaled(this.target, -1));
    return [dot(right, from) * this.scale, dot(down, from) * this.scale];
  }

  /** Shows all of the given voxels, less a few outliers, in a picture of `width` by `height` CSS px. */
  fit(keys, isShown, width, height) {
    [this.size, this.zoomed] = [[width, height], 1];
    const { right, down, towards } = this.axes();
    const spans = [right, down, towards].map((axis) => this.span(keys, isShown, axis));
    if (spans.some((span) => span === null)) return;
    const middle = spans.map(([low, high]) => (low + high) / 2);
    this.target = sum(sum(scaled(right, middle[0]), scaled(down, middle[1])), scaled(towards, middle[2]));
    this.extents = spans.slice(0, 2).map(([low, high]) => high - low + 2 * this.voxelSize);
    this.scale = this.fitting();
  }

  /** The scale at which what was fitted last fills the picture. */
  fitting() {
    const free = 1 - 2 * MARGIN;
    const [width, height] = this.size;
    const [right, down] = this.extents;
    return Math.min((width * free) / right, (height * free) / down, LARGEST_EDGE / this.voxelSize);
  }

  /** From where to where the voxels reach along an axis (m). */
  span(keys, isShown, axis) {
    const places = [];
    const half = 0.5 * (axis[0] + axis[1] + axis[2]);
    for (let i = 0; i < keys.length; i += 3) {
      if (isShown(i / 3)) places.push(keys[i] * axis[0] + keys[i + 1] * axis[1] + keys[i + 2] * axis[2] + half);
    }
    if (places.length === 0) return null;
    const sorted = Float64Array.from(places).sort();
    const outliers = Math.floor(0.002 * sorted.length);
    return [sorted[outliers] * this.voxelSize, sorted[sorted.length - 1 - outliers] * this.voxelSize];
  }
}
