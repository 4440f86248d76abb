// Puts the parts together: one map, one camera, one chosen cluster, one time.

/** Pixels a CSS pixel: at rest, and the choices while something moves. */
const AT_REST = 2;
const MOVING = [0.4, 0.5, 0.67, 1];
/** Most pixels of a picture at rest. */
const MOST_PIXELS = 7e6;
/** The picture is at rest when nothing has changed for so long (ms). */
const REST = 140;
/** Playing from start to end takes about this long (ms). */
const PLAYING = 9000;

class Viewer {
  constructor(story) {
    this.story = story;
    this.map = new MapAtTime(story);
    this.camera = new Camera(story.voxelSize ?? 1);
    this.renderer = new Renderer(this.map);
    this.canvas = document.getElementById("view");
    this.context = this.canvas.getContext("2d");
    this.buffer = document.createElement("canvas");
    this.chosen = -1;
    this.speed = MOVING.length - 1;
    this.panel = new Panel(story, this.map, (slot) => this.choose(slot));
    this.charts = makeCharts(story, (scan) => this.goToScan(scan));
    this.sensor = columnEnds(story.scans).map((scan, i) => ({ scan, place: story.scans.sensor[i] }));
    this.readColours();
    this.listen();
  }

  get look() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    // Nothing is faint for a cluster that is not there at this time.
    const chosen = this.map.rows.has(this.chosen) ? this.chosen : -1;
    return { ...this.colours, width, height, chosen, cutAway: document.getElementById("cut").checked };
  }

  readColours() {
    const style = getComputedStyle(document.documentElement);
    const value = (name) => style.getPropertyValue(name).trim();
    const channels = (name) => [1, 3, 5].map((i) => parseInt(value(name).slice(i, i + 2), 16));
    this.colours = {
      background: channels("--stage"),
      ink: channels("--ink"),
      stage: value("--stage"),
      inkText: value("--ink"),
      font: `12px ${getComputedStyle(document.body).fontFamily}`,
    };
  }

  listen() {
    const byId = (id) => document.getElementById(id);
    byId("time").addEventListener("input", (event) => {
      this.pause();
      this.setTime(Number(event.target.value));
    });
    byId("play").addEventListener("click", () => (this.timer ? this.pause() : this.play()));
    byId("cut").addEventListener("change", () => this.drawSoon());
    byId("small").addEventListener("change", () => this.mapChanged());
    byId("reset").addEventListener("click", () => this.reset());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.readColours();
      this.drawSoon();
    });
    new ResizeObserver(() => this.resized()).observe(this.canvas);
    this.pointer = new Pointer(this.canvas, this.camera, {
      turned: () => this.drawSoon(),
      picked: (x, y) => this.choose(this.clusterAt(x, y)),
      hovered: (x, y) => this.hover(this.clusterAt(x, y)),
      left: () => this.hover(-1),
      reset: () => this.reset(),
    });
  }

  start() {
    const last = this.story.moments.length - 1;
    const slider = document.getElementById("time");
    slider.max = String(Math.max(last, 0));
    document.getElementById("play").disabled = slider.disabled = last < 1;
    this.panel.showChosen(-1);
    if (last < 0 || this.story.count === 0) {
      const text = last < 0 ? "No scan was taken in." : "No voxel became dense.";
      Object.assign(document.getElementById("nothing"), { hidden: false, textContent: text });
    }
    if (last >= 0) this.setTime(last);
    this.reset();
  }

  setTime(index) {
    this.map.goTo(clamp(index, 0, this.story.moments.length - 1));
    const slider = document.getElementById("time");
    slider.value = String(this.map.index);
    const { scan, stamp } = this.map.moment;
    const scans = this.story.moments[this.story.moments.length - 1].scan;
    const text = `scan ${scan} of ${scans} · ${secondsSinceStart(this.story, stamp).toFixed(2)} s`;
    document.getElementById("shown").textContent = text;
    slider.setAttribute("aria-valuetext", text);
    this.charts.forEach((chart) => chart.goTo(scan));
    this.mapChanged();
  }

  /** The moment nearest to a scan. */
  goToScan(scan) {
    const away = this.story.moments.map((moment) => Math.abs(moment.scan - scan));
    this.pause();
    if (away.length > 0) this.setTime(away.indexOf(Math.min(...away)));
  }

  mapChanged() {
    this.renderer.prepare(document.getElementById("small").checked);
    if (this.map.index >= 0) {
      this.panel.showChosen(this.chosen);
      this.panel.showList(this.chosen);
    }
    this.drawSoon();
  }

  choose(slot) {
    this.chosen = slot;
    this.panel.showChosen(slot);
    if (this.map.index >= 0) this.panel.showList(slot);
    this.drawSoon();
  }

  hover(slot) {
    const row = slot >= 0 ? this.map.cluster(slot) : null;
    const label = document.getElementById("hover");
    label.hidden = row === null;
    if (row !== null) label.textContent = `Cluster ${row.id} · ${counted(row.voxel_count, "voxel")}`;
  }

  play() {
    const last = this.story.moments.length - 1;
    if (this.map.index >= last) this.setTime(0);
    const step = () => {
      if (this.map.index >= last) return this.pause();
      return this.setTime(this.map.index + 1);
    };
    this.timer = setInterval(step, clamp(PLAYING / (last + 1), 60, 500));
    this.showPlaying();
  }

  pause() {
    clearInterval(this.timer);
    this.timer = undefined;
    this.showPlaying();
  }

  showPlaying() {
    const button = document.getElementById("play");
    button.classList.toggle("playing", this.timer !== undefined);
    button.setAttribute("aria-label", this.timer === undefined ? "Play" : "Pause");
  }

  /** All of the last moment, whatever the time, from above and behind. */
  reset() {
    Object.assign(this.camera, START);
    const { width, height, ...look } = this.look;
    const towards = this.camera.axes().towards;
    const isShown = (number) => this.renderer.isShown(number, towards, { ...look, chosen: -1 });
    const { index } = this.map;
    this.prepareFor(this.story.moments.length - 1);
    this.camera.fit(this.story.keys, isShown, width, height);
    this.prepareFor(index);
    this.drawSoon();
  }

  /** Costs O(map) where that is another moment. */
  prepareFor(index) {
    if (index === this.map.index) return;
    this.map.goTo(index);
    this.renderer.prepare(document.getElementById("small").checked);
  }

  resized() {
    const { width, height } = this.look;
    if (width > 0 && height > 0) {
      if (this.camera.size.includes(0)) return this.reset();
      this.camera.resize(width, height);
    }
    return this.drawSoon();
  }

  /** Draws at the next frame, coarsely where that is faster, and finely when nothing changes any more. */
  drawSoon() {
    clearTimeout(this.resting);
    this.resting = setTimeout(() => this.draw(this.fineRatio()), REST);
    if (this.isWaiting) return;
    this.isWaiting = true;
    requestAnimationFrame(() => {
      this.isWaiting = false;
      const begin = performance.now();
      this.draw(MOVING[this.speed]);
      const took = performance.now() - begin;
      if (took > 40 && this.speed > 0) this.speed--;
      else if (took < 12 && this.speed < MOVING.length - 1) this.speed++;
    });
  }

  fineRatio() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return Math.min(AT_REST, Math.sqrt(MOST_PIXELS / Math.max(1, width * height)));
  }

  draw(ratio) {
    const look = this.look;
    if (look.width === 0 || look.height === 0) return;
    this.ratio = ratio;
    this.renderer.resize(Math.max(1, Math.round(look.width * ratio)), Math.max(1, Math.round(look.height * ratio)));
    this.renderer.draw(this.camera, ratio, look);
    this.show(look);
    document.body.dataset.ready = "true";
  }

  /** From the renderer's buffer onto the canvas, with the lines above it. */
  show(look) {
    const { buffer, canvas, context, renderer } = this;
    const perCss = Math.min(window.devicePixelRatio || 1, 2);
    if (buffer.width !== renderer.width || buffer.height !== renderer.height) {
      [buffer.width, buffer.height] = [renderer.width, renderer.height];
    }
    buffer.getContext("2d").putImageData(renderer.image, 0, 0);
    const [width, height] = [Math.round(look.width * perCss), Math.round(look.height * perCss)];
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    context.setTransform(perCss, 0, 0, perCss, 0, 0);
    context.imageSmoothingQuality = "high";
    context.drawImage(buffer, 0, 0, look.width, look.height);
    this.drawLines(look);
  }

  drawLines(look) {
    if (this.map.index < 0) return;
    const overlay = new Overlay(this.context, this.camera, look);
    const { scan } = this.map.moment;
    overlay.way(this.sensor.filter((step) => step.scan <= scan).map((step) => step.place));
    const cluster = this.chosen >= 0 ? this.map.cluster(this.chosen) : null;
    if (cluster && !isUnknown(cluster.size)) overlay.box(cluster);
    overlay.scaleBar();
    overlay.axes();
  }

  /** The cluster in the picture at (x, y) CSS px, or -1. */
  clusterAt(x, y) {
    const { renderer, ratio } = this;
    const [column, row] = [Math.floor(x * ratio), Math.floor(y * ratio)];
    if (!(column >= 0 && column < renderer.width && row >= 0 && row < renderer.height)) return -1;
    return Math.max(-1, renderer.clusterAt(row * renderer.width + column));
  }
}

const viewer = new Viewer(readStory(JSON.parse(document.getElementById("story").textContent)));
viewer.start();

/** For tests and for the curious: places are CSS px in the picture, ids are texts. */
window.cfodi = {
  moments: viewer.story.moments.length,
  setTime: (index) => viewer.setTime(index),
  pick: (x, y) => viewer.story.ids[viewer.clusterAt(x, y)] ?? null,
  choose: (id) => viewer.choose(viewer.story.slots.get(id) ?? -1),
  drawnPixels: () => viewer.renderer.drawnPixels(),
  /** Draws finely and says how long that took (ms). */
  drawNow: (ratio = viewer.fineRatio()) => {
    const begin = performance.now();
    viewer.draw(ratio);
    return performance.now() - begin;
  },
  camera: viewer.camera,
};
