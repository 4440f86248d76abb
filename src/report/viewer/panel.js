// What is known of the chosen cluster, and the list of the largest.

const STATES = ["tentative", "active", "complete"];
const CLASSES = ["unknown", "floor", "ceiling", "wall", "horizontal", "slope", "curved", "door"];
const LISTED = 100;
const UNKNOWN = "not known";

function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

/** 1234567 with narrow spaces. */
const grouped = (number) => String(number).replace(/\B(?=(\d{3})+$)/g, "\u202f");

/** With a true minus, and none before nothing. */
function plain(number, digits = 3) {
  if (number === null) return "?";
  const text = number.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "\u2212");
}

const isUnknown = (value) => value === null || (Array.isArray(value) && value.length === 0);
const triple = (v, digits) => v.map((x) => plain(x, digits)).join(", ");

function planeText([a, b, c, d]) {
  const term = (value, name) => `${value < 0 ? "\u2212" : "+"} ${Math.abs(value).toFixed(3)}${name}`;
  return `${plain(a)} x ${term(b, " y")} ${term(c, " z")} ${term(d, "")} = 0`;
}

const small = (x) => (x === null ? "?" : x === 0 ? "0" : x.toExponential(2).replace(/-/g, "\u2212"));

function matrixText(values) {
  const cells = values.map((x) => small(x).padStart(10));
  return [0, 3, 6].map((i) => cells.slice(i, i + 3).join("")).join("\n");
}

const counted = (number, one, several = `${one}s`) => `${grouped(number)} ${number === 1 ? one : several}`;

/** How each field is shown: [name of the field, its text, whether it takes a line of its own]. */
function fieldTexts(cluster, story, takenIn) {
  const known = (name, text) => [name, isUnknown(cluster[name]) ? null : text(cluster[name])];
  const time = (stamp) => `${secondsSinceStart(story, stamp).toFixed(3)} s`;
  const isClassed = cluster.surface_class !== 0 || cluster.class_confidence > 0;
  const confidence = Math.round(100 * (cluster.class_confidence ?? 0));
  const className = CLASSES[cluster.surface_class] ?? cluster.surface_class;
  const main = [
    ["state", STATES[cluster.state] ?? String(cluster.state)],
    ["surface_class", isClassed ? `${className} (${confidence} %)` : null],
    known("voxel_count", grouped),
    known("point_count", grouped),
    known("size", (v) => `${v.map((x) => plain(x, 2)).join(" × ")} m`),
    known("area", (v) => `${plain(v, 2)} m²`),
    ["normal", isUnknown(cluster.plane) ? null : triple(cluster.plane.slice(0, 3), 3)],
    known("centroid", (v) => `${triple(v, 3)} m`),
    known("rms_error", (v) => `${plain(v * 1000, 1)} mm`),
    known("first_seen", time),
    known("last_seen", time),
    known("revision", String),
    ["merged_from", takenIn],
  ];
  const more = [
    known("plane", planeText),
    ["pose.position", isUnknown(cluster.position) ? null : `${triple(cluster.position, 3)} m`],
    ["pose.orientation", isUnknown(cluster.orientation) ? null : triple(cluster.orientation, 3)],
    known("boundary", (v) => counted(v.length, "vertex", "vertices")),
    known("holes", (v) => String(v.length)),
    [...known("point_covariance", matrixText), true],
    [...known("plane_covariance", matrixText), true],
  ];
  return { main, more };
}

function fieldList(texts) {
  const list = element("dl", { className: "fields" });
  for (const [name, text, isMatrix] of texts) {
    const wide = isMatrix && text !== null;
    const className = text === null ? "unknown" : wide ? "matrix below" : "";
    const value = element("dd", { textContent: text ?? UNKNOWN, className });
    value.dataset.field = name;
    list.append(element("dt", { textContent: name, className: wide ? "above" : "" }), value);
  }
  return list;
}

class Panel {
  /** `choose` is called with the number of a cluster, or -1. */
  constructor(story, map, choose) {
    this.story = story;
    this.map = map;
    this.choose = choose;
    this.chosenBox = document.getElementById("chosen");
    this.list = document.getElementById("largest");
    this.isOpen = false;
  }

  colour(slot) {
    return `rgb(${this.story.colours.slice(3 * slot, 3 * slot + 3).join(",")})`;
  }

  swatch(slot) {
    const swatch = element("span", { className: "swatch" });
    swatch.style.background = this.colour(slot);
    return swatch;
  }

  showChosen(slot) {
    const cluster = slot >= 0 ? this.map.cluster(slot) : null;
    this.chosenBox.dataset.id = cluster ? cluster.id : "";
    if (slot < 0) {
      const textContent = "Click a surface in the picture, or choose one below.";
      const hint = element("p", { className: "quiet", textContent });
      this.chosenBox.replaceChildren(element("h2", { textContent: "No cluster chosen" }), hint);
      return;
    }
    const close = element("button", { type: "button", textContent: "Deselect", onclick: () => this.choose(-1) });
    const title = element("h2", { textContent: `Cluster ${this.story.ids[slot]}` });
    this.chosenBox.replaceChildren(element("header", {}, this.swatch(slot), title, close));
    this.chosenBox.append(...(cluster ? this.fields(cluster) : [this.absence(this.story.ids[slot])]));
  }

  fields(cluster) {
    const { main, more } = fieldTexts(cluster, this.story, this.takenIn(cluster.id));
    const summary = element("summary", { textContent: "Plane, pose, boundary, covariances" });
    const details = element("details", { open: this.isOpen }, summary, fieldList(more));
    details.addEventListener("toggle", () => (this.isOpen = details.open));
    return [fieldList(main), details];
  }

  /** The clusters that this one has taken in so far. */
  takenIn(id) {
    const until = this.map.moment.scan;
    const merges = this.story.merges.filter((merge) => merge.into === id && merge.scan <= until);
    const all = merges.flatMap((merge) => merge.from);
    if (all.length === 0) return "none so far";
    return all.length > 8 ? `${all.slice(0, 8).join(", ")} and ${all.length - 8} more` : all.join(", ");
  }

  /** Why a chosen cluster is not there at this time. */
  absence(id) {
    const merge = this.story.merges.find(({ scan, from }) => scan <= this.map.moment.scan && from.includes(id));
    if (!merge) return element("p", { className: "quiet", textContent: "Not there at this time." });
    const into = this.story.slots.get(merge.into);
    const text = `Taken in by cluster ${merge.into} at scan ${merge.scan}.`;
    const line = element("p", { className: "quiet", textContent: `${text} ` });
    const onclick = () => this.choose(into);
    if (into !== undefined) line.append(element("button", { type: "button", textContent: "Show it", onclick }));
    return line;
  }

  showList(chosen) {
    const slots = this.map.largestFirst();
    document.getElementById("largest-title").textContent = `Largest of ${counted(slots.length, "cluster")}`;
    // Replacing a button takes the focus from it.
    const focused = document.activeElement?.dataset?.slot;
    this.list.replaceChildren(...slots.slice(0, LISTED).map((slot) => this.entry(slot, chosen)));
    if (focused !== undefined) this.list.querySelector(`[data-slot="${focused}"]`)?.focus({ preventScroll: true });
    const rest = slots.length - LISTED;
    const smaller = rest > 0 ? `and ${counted(rest, "smaller one")}; ` : "";
    const unclustered = counted(this.map.moment.unclustered, "voxel");
    document.getElementById("smaller").textContent = `${smaller}${unclustered} in no cluster`;
  }

  entry(slot, chosen) {
    const { id, voxel_count: voxels, size, state } = this.map.cluster(slot);
    const button = element("button", { type: "button", onclick: () => this.choose(slot === chosen ? -1 : slot) });
    button.dataset.slot = slot;
    button.setAttribute("aria-pressed", String(slot === chosen));
    button.setAttribute("aria-label", `Cluster ${id}, ${counted(voxels, "voxel")}, ${STATES[state] ?? state}`);
    button.append(
      this.swatch(slot),
      element("span", { textContent: id }),
      element("span", { className: "size", textContent: size ? `${plain(size[0], 2)} × ${plain(size[1], 2)} m` : "" }),
      element("span", { className: "voxels", textContent: grouped(voxels) }),
    );
    return element("li", {}, button);
  }
}
