// Numbers of every scan as small charts that share the time of the picture.

const SPACE = { width: 600, height: 150, left: 46, right: 8, top: 8, bottom: 20 };

function svg(name, attributes, text = "") {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.textContent = text;
  return made;
}

/** A round step that divides `span` into about `parts`. */
function roundStep(span, parts) {
  const power = 10 ** Math.floor(Math.log10(span / parts || 1));
  return [1, 2, 5, 10].map((m) => m * power).find((step) => span / step <= parts) ?? power;
}

/** In the unit of an axis that ends at `highest`. */
function short(number, highest) {
  const [unit, sign] = highest >= 1e6 ? [1e6, " M"] : highest >= 1e4 ? [1e3, " k"] : [1, ""];
  return number === 0 ? "0" : `${+(number / unit).toPrecision(3)}${sign}`;
}

class Chart {
  /** `lines` are [values, class]; the first is the one that is read out. */
  constructor(title, unit, lines, ends, goToScan) {
    this.unit = unit;
    this.lines = lines;
    this.ends = ends;
    const highest = Math.max(...lines.flatMap(([values]) => values.filter(Number.isFinite)), 0);
    // Of nothing but zeros the axis has 0 and 1.
    this.highest = highest > 0 ? highest * 1.06 : 1;
    this.step = highest > 0 ? roundStep(this.highest, 4) : 1;
    this.read = element("output");
    this.box = element("div", { className: "chart" }, element("h3", {}, title, this.read));
    this.drawing = svg("svg", { role: "img", "aria-label": title });
    this.box.append(this.drawing);
    this.drawing.addEventListener("pointermove", (event) => this.show(this.nearest(event)));
    this.drawing.addEventListener("pointerleave", () => this.show(this.current));
    this.drawing.addEventListener("click", (event) => goToScan(this.ends[this.nearest(event)]));
    // Drawn in CSS pixels, so that text and lines are of one size at every width.
    new ResizeObserver(() => this.draw()).observe(this.box);
    this.current = ends.length - 1;
  }

  x(scan) {
    const last = this.ends[this.ends.length - 1];
    const share = last > this.ends[0] ? (scan - this.ends[0]) / (last - this.ends[0]) : 0.5;
    return SPACE.left + share * (this.width - SPACE.left - SPACE.right);
  }

  y(value) {
    return SPACE.height - SPACE.bottom - (value / this.highest) * (SPACE.height - SPACE.top - SPACE.bottom);
  }

  draw() {
    this.width = Math.max(this.drawing.clientWidth, 120);
    this.drawing.setAttribute("viewBox", `0 0 ${this.width} ${SPACE.height}`);
    const lines = this.lines.map(([values, name]) => {
      const place = (value, i) => `${this.x(this.ends[i]).toFixed(1)},${this.y(value).toFixed(1)}`;
      const points = values.map((value, i) => (Number.isFinite(value) ? place(value, i) : ""));
      return svg("polyline", { class: name, points: points.filter(Boolean).join(" ") });
    });
    this.cursor = svg("line", { class: "cursor", y1: SPACE.top, y2: SPACE.height - SPACE.bottom });
    this.dot = svg("circle", { class: "dot", r: 3.5 });
    this.drawing.replaceChildren(...this.grid(), ...lines.reverse(), this.cursor, this.dot);
    this.show(this.current);
  }

  grid() {
    const made = [];
    for (let value = 0; value <= this.highest; value += this.step) {
      const y = this.y(value);
      made.push(svg("line", { class: "grid", x1: SPACE.left, x2: this.width - SPACE.right, y1: y, y2: y }));
      made.push(svg("text", { x: SPACE.left - 6, y: y + 4, "text-anchor": "end" }, short(value, this.highest)));
    }
    const [first, last] = [this.ends[0], this.ends[this.ends.length - 1]];
    const scans = Math.max(1, Math.round(roundStep(last - first, Math.max(3, this.width / 55))));
    for (let scan = Math.ceil(first / scans) * scans; scan <= last; scan += scans) {
      made.push(svg("text", { x: this.x(scan), y: SPACE.height - 5, "text-anchor": "middle" }, String(scan)));
    }
    return made;
  }

  nearest(event) {
    const box = this.drawing.getBoundingClientRect();
    const away = this.ends.map((scan) => Math.abs(this.x(scan) - (event.clientX - box.left)));
    return away.indexOf(Math.min(...away));
  }

  /** Marks a column and says its value. */
  show(i) {
    if (i < 0 || !this.cursor) return;
    const value = this.lines[0][0][i];
    const x = this.x(this.ends[i]);
    this.cursor.setAttribute("x1", x);
    this.cursor.setAttribute("x2", x);
    this.dot.setAttribute("cx", x);
    this.dot.setAttribute("cy", this.y(value ?? 0));
    const number = Number.isInteger(value) ? grouped(value) : value?.toFixed(2);
    this.read.textContent = `scan ${this.ends[i]}: ${Number.isFinite(value) ? number + this.unit : "unknown"}`;
  }

  goTo(scan) {
    const after = this.ends.findIndex((end) => end >= scan);
    this.current = after < 0 ? this.ends.length - 1 : after;
    this.show(this.current);
  }
}

/** Number of the last scan of each column. */
function columnEnds(scans) {
  let end = 0;
  return scans.count.map((count) => (end += count));
}

function makeCharts(story, goToScan) {
  const { scans } = story;
  const ends = columnEnds(scans);
  if (ends.length === 0) return [];
  const isBinned = scans.count.some((count) => count > 1);
  const engine = [[scans.engine_ms, "line"]];
  if (isBinned) engine.push([scans.slowest_ms, "faint"]);
  const charts = [
    new Chart("Clusters", "", [[scans.clusters, "line"]], ends, goToScan),
    new Chart("Dense voxels", "", [[scans.dense, "line"]], ends, goToScan),
    new Chart(isBinned ? "Engine, a scan: mean and slowest" : "Engine, a scan", " ms", engine, ends, goToScan),
    new Chart("Valid points, a scan", "", [[scans.points, "line"]], ends, goToScan),
  ];
  document.getElementById("charts").append(...charts.map((chart) => chart.box));
  return charts;
}
