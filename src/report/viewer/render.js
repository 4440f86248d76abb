// Draws voxels as shaded cubes into buffers of depth and of what is seen; no graphics card is asked.
//
// In a parallel projection every cube covers the same pixels about its place: they are found once a view (the stamp)
// and then compared with the depth buffer for each voxel. Colours come last, once a pixel.

/** Width of a cube's border, of its edge, and the edge from which on it is drawn (px). */
const BORDER = 0.06;
const BORDER_FROM = 9;
/** Cosine up to which a surface beyond a right angle still counts as facing the viewer: normals are noisy. */
const FACING = -0.1;
/** Voxels, along each axis, up to which a voxel in no cluster goes with the nearest one of a cluster. */
const AROUND = 2;
/** Eye-dome lighting: the least distance (CSS px) from which on a neighbour in front counts in full. */
const REACH = 14;
/** How dark it makes, by 16ths of a neighbour in front. */
const DARKER = Float32Array.from({ length: 65 }, (_, i) => Math.exp(-0.32 * (i / 16)));

const NEIGHBOURS = (() => {
  const steps = Array.from({ length: 2 * AROUND + 1 }, (_, i) => i - AROUND);
  const all = steps.flatMap((x) => steps.flatMap((y) => steps.map((z) => [x, y, z])));
  return all.filter((step) => dot(step, step) > 0).sort((a, b) => dot(a, a) - dot(b, b));
})();

/** The pixels that a cube covers: offsets from its corner's pixel, nearness, and 2 * face + border. */
class Stamp {
  constructor(edges, towards) {
    this.dx = [];
    this.dy = [];
    this.nearness = [];
    this.side = [];
    const corner = [0, 1, 2].map((axis) => (towards[axis] > 0 ? edges[axis] : [0, 0, 0]));
    const side = (axis) => ({ corner: corner[axis], u: edges[(axis + 1) % 3], v: edges[(axis + 2) % 3] });
    const sides = [0, 1, 2].map(side);
    const reach = (bound, i) => edges.reduce((total, edge) => total + bound(edge[i], 0), 0);
    this.left = Math.floor(reach(Math.min, 0)) - 1;
    this.right = Math.ceil(reach(Math.max, 0)) + 1;
    this.top = Math.floor(reach(Math.min, 1)) - 1;
    this.bottom = Math.ceil(reach(Math.max, 1)) + 1;
    for (let y = this.top; y <= this.bottom; y++) {
      for (let x = this.left; x <= this.right; x++) this.cover(x, y, sides);
    }
  }

  cover(x, y, sides) {
    let best = -Infinity;
    let seen = 0;
    sides.forEach(({ corner, u, v }, side) => {
      const area = u[0] * v[1] - u[1] * v[0];
      // Seen edge-on.
      if (Math.abs(area) < 1e-3 * dot(u, u)) return;
      const [px, py] = [x - corner[0], y - corner[1]];
      const [a, b] = [(px * v[1] - py * v[0]) / area, (py * u[0] - px * u[1]) / area];
      // Half a pixel more on each side, so that rounded places leave no gaps between neighbours.
      const slackA = (0.5 * Math.hypot(v[0], v[1])) / Math.abs(area);
      const slackB = (0.5 * Math.hypot(u[0], u[1])) / Math.abs(area);
      if (!(a >= -slackA && a <= 1 + slackA && b >= -slackB && b <= 1 + slackB)) return;
      const nearness = corner[2] + clamp(a, 0, 1) * u[2] + clamp(b, 0, 1) * v[2];
      if (nearness <= best) return;
      best = nearness;
      seen = 2 * side + (Math.min(a, 1 - a, b, 1 - b) < BORDER ? 1 : 0);
    });
    if (best === -Infinity) return;
    this.dx.push(x);
    this.dy.push(y);
    this.nearness.push(best);
    this.side.push(seen);
  }

  /** As steps in a buffer of this width. */
  forWidth(width) {
    return {
      steps: Int32Array.from(this.dx, (dx, i) => this.dy[i] * width + dx),
      dx: Int32Array.from(this.dx),
      dy: Int32Array.from(this.dy),
      nearness: Float32Array.from(this.nearness),
      sides: Int32Array.from(this.side),
    };
  }
}

class Renderer {
  constructor(map) {
    this.map = map;
    this.story = map.story;
    this.index = new VoxelIndex(map.story.keys);
    /** Mean of the normals of each voxel and of its cluster, which counts twice: by it the voxel is cut away or not. */
    this.facing = new Float32Array(3 * map.story.count);
    this.light = new Float32Array(3 * map.story.count);
    this.hidden = new Uint8Array(map.story.count);
    this.width = 0;
    this.height = 0;
  }

  resize(width, height) {
    if (this.width === width && this.height === height) return;
    this.width = width;
    this.height = height;
    this.image = new ImageData(width, height);
    this.pixels = new Uint32Array(this.image.data.buffer);
    this.nearness = new Float32Array(width * height);
    /** 0 = nothing, else 1 + 8 * voxel + 2 * side + border. */
    this.seen = new Int32Array(width * height);
  }

  /** What depends on the time alone; to be called when the map has changed. */
  prepare(hideTentative) {
    const { story, map, facing } = this;
    const plane = story.fields.indexOf("plane");
    const state = story.fields.indexOf("state");
    for (let number = 0; number < story.count; number++) {
      const row = map.rows.get(map.clusterOf[number]);
      const ofCluster = row?.[plane] ?? null;
      const own = map.normals.subarray(3 * number, 3 * number + 3);
      const hasOwn = own[0] !== 0 || own[1] !== 0 || own[2] !== 0;
      // A voxel in no cluster is an obstacle, however small.
      const isTentative = row !== undefined && !(row[state] > 0);
      this.hidden[number] = map.clusterOf[number] === GONE || (hideTentative && isTentative) ? 1 : 0;
      for (let axis = 0; axis < 3; axis++) {
        const first = ofCluster ? ofCluster[axis] : own[axis] / 127;
        facing[3 * number + axis] = (2 * first + (hasOwn ? own[axis] / 127 : first)) / 3;
      }
    }
    this.guideUnclustered();
  }

  /** Voxels in no cluster, mostly rims, go with the nearest one of a cluster. */
  guideUnclustered() {
    const { map, story: { keys, count }, facing } = this;
    for (let number = 0; number < count; number++) {
      if (map.clusterOf[number] !== NONE) continue;
      const [ix, iy, iz] = keys.subarray(3 * number, 3 * number + 3);
      for (const [dx, dy, dz] of NEIGHBOURS) {
        const near = this.index.find(ix + dx, iy + dy, iz + dz);
        if (near < 0 || map.clusterOf[near] < 0) continue;
        facing.copyWithin(3 * number, 3 * near, 3 * near + 3);
        break;
      }
    }
  }

  /** Draws with `ratio` pixels a CSS pixel; `look` tells what to cut away, what is chosen, and the colours around. */
  draw(camera, ratio, look) {
    const axes = camera.axes();
    const edge = camera.scale * camera.voxelSize * ratio;
    const edges = [0, 1, 2].map((i) => [axes.right[i] * edge, axes.down[i] * edge, axes.towards[i] * edge]);
    this.nearness.fill(-Infinity);
    this.seen.fill(0);
    this.shade(axes);
    const stamp = new Stamp(edges, axes.towards);
    this.blit(camera, edges, stamp, axes.towards, look);
    this.colour(edge, Math.max(1, Math.round(ratio)), look);
  }

  isShown(number, towards, look) {
    if (this.hidden[number]) return false;
    if (!look.cutAway || (look.chosen >= 0 && this.map.clusterOf[number] === look.chosen)) return true;
    const at = 3 * number;
    const { facing } = this;
    return facing[at] * towards[0] + facing[at + 1] * towards[1] + facing[at + 2] * towards[2] >= FACING;
  }

  /** Light on each voxel's three sides, from over the viewer's left shoulder. */
  shade({ right, down, towards }) {
    const raw = sum(towards, sum(scaled(right, -0.9), scaled(down, -0.8)));
    const source = scaled(raw, 1 / Math.hypot(...raw));
    const { map: { normals }, light, story: { count } } = this;
    const sign = towards.map((x) => (x > 0 ? 1 : -1));
    for (let at = 0; at < 3 * count; at += 3) {
      // The voxel's normal counts more than the side's: a slanted wall is of one brightness, though made of steps.
      let [x, y, z] = [normals[at] / 127, normals[at + 1] / 127, normals[at + 2] / 127];
      const weight = x * towards[0] + y * towards[1] + z * towards[2] > 0 ? 0.7 : 0;
      for (let side = 0; side < 3; side++) {
        const along = sign[side] * (1 - weight);
        const n = weight * (side === 0 ? x : side === 1 ? y : z);
        const length = Math.sqrt(weight * weight + along * along + 2 * along * n);
        const towardsLight = weight * (x * source[0] + y * source[1] + z * source[2]) + along * source[side];
        light[at + side] = 0.88 + (0.27 * towardsLight) / (length || 1);
      }
    }
  }

  blit(camera, edges, stamp, towards, look) {
    const { width, height, nearness, seen, story: { keys, count } } = this;
    const { steps, dx, dy, nearness: rise, sides } = stamp.forWidth(width);
    const target = scaled(camera.target, 1 / camera.voxelSize);
    for (let number = 0; number < count; number++) {
      if (!this.isShown(number, towards, look)) continue;
      const kx = keys[3 * number] - target[0];
      const ky = keys[3 * number + 1] - target[1];
      const kz = keys[3 * number + 2] - target[2];
      const x = Math.round(0.5 * width + kx * edges[0][0] + ky * edges[1][0] + kz * edges[2][0]);
      const y = Math.round(0.5 * height + kx * edges[0][1] + ky * edges[1][1] + kz * edges[2][1]);
      const [left, right, top, bottom] = [x + stamp.left, x + stamp.right, y + stamp.top, y + stamp.bottom];
      if (right < 0 || left >= width || bottom < 0 || top >= height) continue;
      const inside = left >= 0 && right < width && top >= 0 && bottom < height;
      const near = kx * edges[0][2] + ky * edges[1][2] + kz * edges[2][2];
      const base = y * width + x;
      const code = 1 + 8 * number;
      for (let i = 0; i < steps.length; i++) {
        if (!inside && (x + dx[i] < 0 || x + dx[i] >= width || y + dy[i] < 0 || y + dy[i] >= height)) continue;
        const at = base + steps[i];
        if (near + rise[i] > nearness[at]) {
          nearness[at] = near + rise[i];
          seen[at] = code + sides[i];
        }
      }
    }
  }

  /** The colour of every pixel: the cluster's in its light, darker behind edges, faint where another one is chosen. */
  colour(edge, distance, look) {
    const { width, height, pixels, seen, light, map: { clusterOf } } = this;
    const { background, ink, chosen } = look;
    const empty = packed(background[0], background[1], background[2]);
    // Not below some pixels: a slanted plane of small voxels has no edges.
    const reach = Math.max(2 * edge, REACH * distance);
    const border = edge >= BORDER_FROM ? 0.92 : 1;
    for (let y = 0, at = 0; y < height; y++) {
      for (let x = 0; x < width; x++, at++) {
        const code = seen[at] - 1;
        const isChosen = chosen >= 0 && code >= 0 && clusterOf[code >> 3] === chosen;
        if (chosen >= 0 && !isChosen && this.touches(x, y, distance, chosen)) {
          pixels[at] = packed(ink[0], ink[1], ink[2]);
        } else if (code < 0) {
          pixels[at] = empty;
        } else {
          const lit = light[3 * (code >> 3) + ((code & 7) >> 1)] * (code & 1 ? border : 1);
          const shade = lit * DARKER[this.covered(x, y, distance, reach)];
          pixels[at] = this.tinted(clusterOf[code >> 3], shade, chosen >= 0 && !isChosen ? background : null);
        }
      }
    }
  }

  tinted(cluster, shade, faintOn) {
    const { colours } = this.story;
    let red = (cluster < 0 ? 150 : colours[3 * cluster]) * shade;
    let green = (cluster < 0 ? 150 : colours[3 * cluster + 1]) * shade;
    let blue = (cluster < 0 ? 150 : colours[3 * cluster + 2]) * shade;
    if (faintOn !== null) {
      const grey = 0.3 * red + 0.59 * green + 0.11 * blue;
      red = 0.62 * faintOn[0] + 0.12 * red + 0.26 * grey;
      green = 0.62 * faintOn[1] + 0.12 * green + 0.26 * grey;
      blue = 0.62 * faintOn[2] + 0.12 * blue + 0.26 * grey;
    }
    return packed(Math.min(red, 255), Math.min(green, 255), Math.min(blue, 255));
  }

  /** How far the four neighbours stand out in front, in 16ths of `reach`. */
  covered(x, y, distance, reach) {
    const { width, height, nearness } = this;
    const at = y * width + x;
    const own = nearness[at];
    const scale = 16 / reach;
    let covered = 0;
    if (x >= distance) covered += clamp((nearness[at - distance] - own) * scale, 0, 16);
    if (x + distance < width) covered += clamp((nearness[at + distance] - own) * scale, 0, 16);
    if (y >= distance) covered += clamp((nearness[at - distance * width] - own) * scale, 0, 16);
    if (y + distance < height) covered += clamp((nearness[at + distance * width] - own) * scale, 0, 16);
    return covered | 0;
  }

  /** Whether a neighbour belongs to the chosen cluster: its outline. */
  touches(x, y, distance, chosen) {
    const { width, height } = this;
    const at = y * width + x;
    return (
      (x >= distance && this.clusterAt(at - distance) === chosen) ||
      (x + distance < width && this.clusterAt(at + distance) === chosen) ||
      (y >= distance && this.clusterAt(at - distance * width) === chosen) ||
      (y + distance < height && this.clusterAt(at + distance * width) === chosen)
    );
  }

  /** The cluster seen in a pixel; GONE where nothing is. */
  clusterAt(at) {
    return this.seen[at] === 0 ? GONE : this.map.clusterOf[(this.seen[at] - 1) >> 3];
  }

  drawnPixels() {
    return this.seen.reduce((count, code) => count + (code === 0 ? 0 : 1), 0);
  }
}

/** A pixel of ImageData on a little-endian processor, as all that run a browser are. */
function packed(red, green, blue) {
  return (0xff000000 | (blue << 16) | (green << 8) | red) >>> 0;
}
