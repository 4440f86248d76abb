// The story as typed arrays, and the map at a chosen time.

/** Marks of a voxel's cluster where it is no number of a cluster. */
const GONE = -2;
const NONE = -1;

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

/** Reads integers of seven bits a byte. */
class Reader {
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
  }

  get isAtEnd() {
    return this.at >= this.bytes.length;
  }

  next() {
    let number = 0;
    let weight = 1;
    for (;;) {
      const byte = this.bytes[this.at++];
      number += (byte & 0x7f) * weight;
      if (byte < 0x80) return number;
      weight *= 128;
    }
  }

  signed() {
    const folded = this.next();
    return folded % 2 === 0 ? folded / 2 : -(folded + 1) / 2;
  }

  signedByte() {
    return (this.bytes[this.at++] << 24) >> 24;
  }
}

function readKeys(base64, count) {
  const reader = new Reader(bytesOf(base64));
  const keys = new Int32Array(3 * count);
  for (let i = 0; i < keys.length; i++) keys[i] = reader.signed() + (i < 3 ? 0 : keys[i - 3]);
  return keys;
}

/** The changes of a moment: numbers of voxels, their clusters, and their normals where these changed. */
function readChanges(base64) {
  const reader = new Reader(bytesOf(base64));
  const numbers = [];
  const clusters = [];
  const normals = [];
  let number = 0;
  while (!reader.isAtEnd) {
    const head = reader.next();
    number += Math.floor(head / 2);
    numbers.push(number);
    clusters.push(reader.next() - 2);
    if (head % 2 === 1) normals.push(number, reader.signedByte(), reader.signedByte(), reader.signedByte());
  }
  return { numbers: Uint32Array.from(numbers), clusters: Int32Array.from(clusters), normals: Int32Array.from(normals) };
}

function readStory(json) {
  const { story, moments } = json;
  const slots = new Map(story.ids.map((id, slot) => [id, slot]));
  return {
    voxelSize: story.voxel_size,
    count: story.voxel_count,
    keys: readKeys(story.keys, story.voxel_count),
    fields: story.fields,
    ids: story.ids,
    slots,
    colours: bytesOf(story.colours),
    merges: story.merges.map(([scan, into, from]) => ({ scan, into, from })),
    scans: story.scans,
    start: story.start,
    moments: moments.map((moment) => ({
      scan: moment.head[0],
      stamp: moment.head[1],
      unclustered: moment.head[2],
      voxels: readChanges(moment.voxels),
      gone: moment.gone,
      rows: moment.clusters,
    })),
  };
}

/** Seconds from the first scan to a stamp of [seconds, nanoseconds]. */
function secondsSinceStart(story, stamp) {
  return stamp[0] - story.start[0] + (stamp[1] - story.start[1]) * 1e-9;
}

/** The map as it was at one of the moments. */
class MapAtTime {
  constructor(story) {
    this.story = story;
    this.clusterOf = new Int32Array(story.count).fill(GONE);
    this.normals = new Int8Array(3 * story.count);
    this.rows = new Map();
    this.index = -1;
  }

  get moment() {
    return this.story.moments[this.index];
  }

  goTo(index) {
    if (index < this.index) {
      this.clusterOf.fill(GONE);
      this.rows.clear();
      this.index = -1;
      // The normals need no reset: each is told when its voxel comes.
    }
    while (this.index < index) this.apply(this.story.moments[++this.index]);
  }

  apply(moment) {
    const { numbers, clusters, normals } = moment.voxels;
    for (let i = 0; i < numbers.length; i++) this.clusterOf[numbers[i]] = clusters[i];
    for (let i = 0; i < normals.length; i += 4) {
      for (let axis = 0; axis < 3; axis++) this.normals[3 * normals[i] + axis] = normals[i + 1 + axis];
    }
    for (const slot of moment.gone) this.rows.delete(slot);
    for (const row of moment.rows) this.rows.set(this.story.slots.get(row[0]), row);
  }

  /** The fields of a cluster by their names, or null where it is not there. */
  cluster(slot) {
    const row = this.rows.get(slot);
    return row ? Object.fromEntries(this.story.fields.map((name, i) => [name, row[i]])) : null;
  }

  /** The clusters by descending number of voxels. */
  largestFirst() {
    const [id, voxels] = ["id", "voxel_count"].map((name) => this.story.fields.indexOf(name));
    const bySize = (a, b) => b[voxels] - a[voxels] || this.story.slots.get(a[id]) - this.story.slots.get(b[id]);
    return [...this.rows.values()].sort(bySize).map((row) => this.story.slots.get(row[id]));
  }
}

/** Finds voxels by their indices: open addressing over the keys. */
class VoxelIndex {
  constructor(keys) {
    this.keys = keys;
    const count = keys.length / 3;
    let size = 16;
    while (size < 2 * count) size *= 2;
    this.mask = size - 1;
    this.places = new Int32Array(size).fill(-1);
    for (let number = 0; number < count; number++) {
      let place = this.hash(keys[3 * number], keys[3 * number + 1], keys[3 * number + 2]);
      while (this.places[place] >= 0) place = (place + 1) & this.mask;
      this.places[place] = number;
    }
  }

  hash(ix, iy, iz) {
    return (Math.imul(ix, 73856093) ^ Math.imul(iy, 19349663) ^ Math.imul(iz, 83492791)) & this.mask;
  }

  /** The number of the voxel, or -1. */
  find(ix, iy, iz) {
    const { keys, places, mask } = this;
    for (let place = this.hash(ix, iy, iz); places[place] >= 0; place = (place + 1) & mask) {
      const at = 3 * places[place];
      if (keys[at] === ix && keys[at + 1] === iy && keys[at + 2] === iz) return places[place];
    }
    return -1;
  }
}
