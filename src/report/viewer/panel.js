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

/** Writes only what is another text: who listens to the page is told of every writing. */
function say(to, text) {
  if (to.textContent !== text) to.textContent = text;
}

/** Names of fields and their texts. What is made for a field stays, and its text changes. */
class FieldList {
  constructor() {
    this.list = element("dl", { className: "fields" });
    this.fields = new Map();
  }

  show(texts) {
    for (const [name, text, isMatrix] of texts) {
      const [title, value] = this.field(name);
      const wide = isMatrix && text !== null;
      title.className = wide ? "above" : "";
      value.className = text === null ? "unknown" : wide ? "matrix below" : "";
      say(value, text ?? UNKNOWN);
    }
  }

  field(name) {
    if (!this.fields.has(name)) {
      const [title, value] = [element("dt", { textContent: name }), element("dd")];
      value.dataset.field = name;
      this.list.append(title, value);
      this.fields.set(name, [title, value]);
    }
    return this.fields.get(name);
  }
}

/** A line of the list. It stays while its cluster changes: what goes between press and release cannot be clicked. */
class Entry {
  /** `clicked` is called with the number of the cluster. */
  constructor(clicked) {
    this.swatch = element("span", { className: "swatch" });
    this.id = element("span");
    this.size = element("span", { className: "size" });
    this.voxels = element("span", { className: "voxels" });
    const parts = [this.swatch, this.id, this.size, this.voxels];
    const onpointerdown = () => (this.pressed = this.slot);
    // It may be another's by the time of the release. A key is pressed without a pointer.
    const onclick = ({ detail }) => clicked(detail > 0 ? this.pressed ?? this.slot : this.slot);
    this.button = element("button", { type: "button", onpointerdown, onclick }, ...parts);
    this.item = element("li", {}, this.button);
  }

  show(slot, cluster, colour, isChosen) {
    const { id, voxel_count: voxels, size, state } = cluster;
    this.slot = slot;
    this.swatch.style.background = colour;
    this.button.setAttribute("aria-pressed", String(isChosen));
    this.button.setAttribute("aria-label", `Cluster ${id}, ${counted(voxels, "voxel")}, ${STATES[state] ?? state}`);
    say(this.id, id);
    say(this.size, size ? `${plain(size[0], 2)} × ${plain(size[1], 2)} m` : "");
    say(this.voxels, grouped(voxels));
  }
}

class Panel {
  /** `choose` is called with the number of a cluster, or -1. */
  constructor(story, map, choose) {
    this.story = story;
    this.map = map;
    this.choose = choose;
    this.chosen = -1;
    this.chosenBox = document.getElementById("chosen");
    this.list = document.getElementById("largest");
    this.entries = [];
    this.makeChosen();
  }

  /** All that is said of a chosen cluster, once: what goes takes the focus with it. */
  makeChosen() {
    this.swatch = element("span", { className: "swatch" });
    this.title = element("h2");
    this.title.setAttribute("aria-live", "polite");
    const button = (textContent, onclick) => element("button", { type: "button", textContent, onclick });
    this.deselect = button("Deselect", ({ detail }) => this.letGo(detail > 0));
    this.words = element("span");
    this.showIt = button("Show it", () => this.chooseInto());
    this.note = element("p", { className: "quiet" }, this.words, " ", this.showIt);
    [this.main, this.more] = [new FieldList(), new FieldList()];
    const summary = element("summary", { textContent: "Plane, pose, boundary, covariances" });
    this.details = element("details", {}, summary, this.more.list);
    const header = element("header", {}, this.swatch, this.title, this.deselect);
    this.chosenBox.append(header, this.note, this.main.list, this.details);
  }

  colour(slot) {
    return `rgb(${this.story.colours.slice(3 * slot, 3 * slot + 3).join(",")})`;
  }

  showChosen(slot) {
    const cluster = slot >= 0 ? this.map.cluster(slot) : null;
    this.chosen = slot;
    this.chosenBox.dataset.id = cluster ? cluster.id : "";
    this.swatch.hidden = this.deselect.hidden = slot < 0;
    if (slot >= 0) this.swatch.style.background = this.colour(slot);
    say(this.title, slot < 0 ? "No cluster chosen" : `Cluster ${this.story.ids[slot]}`);
    this.showNote(cluster);
    this.main.list.hidden = this.details.hidden = cluster === null;
    if (cluster === null) return;
    const { main, more } = fieldTexts(cluster, this.story, this.takenIn(cluster.id));
    this.main.show(main);
    this.more.show(more);
  }

  /** What to do where no cluster is chosen, and why the chosen one is not there at this time. */
  showNote(cluster) {
    const merge = cluster === null && this.chosen >= 0 ? this.mergeOf(this.story.ids[this.chosen]) : undefined;
    const hint = "Click a surface in the picture, or choose one below.";
    const absence = merge ? `Taken in by cluster ${merge.into} at scan ${merge.scan}.` : "Not there at this time.";
    this.note.hidden = cluster !== null;
    this.into = merge && this.story.slots.get(merge.into);
    this.showIt.hidden = this.into === undefined;
    say(this.words, this.chosen < 0 ? hint : absence);
  }

  /** The button that was pressed may be hidden then: the focus goes to the one that is not. */
  chooseInto() {
    this.choose(this.into);
    this.deselect.focus({ preventScroll: true });
  }

  /** The focus goes to the line of the cluster that was chosen; nothing is scrolled there under a mouse. */
  letGo(byMouse) {
    const { chosen } = this;
    this.choose(-1);
    const entry = this.entries.find(({ slot, item }) => slot === chosen && item.isConnected) ?? this.entries[0];
    entry?.button.focus({ preventScroll: byMouse });
  }

  /** The clusters that this one has taken in so far. */
  takenIn(id) {
    const until = this.map.moment.scan;
    const merges = this.story.merges.filter((merge) => merge.into === id && merge.scan <= until);
    const all = merges.flatMap((merge) => merge.from);
    if (all.length === 0) return "none so far";
    return all.length > 8 ? `${all.slice(0, 8).join(", ")} and ${all.length - 8} more` : all.join(", ");
  }

  /** The merge in which a cluster has gone into another, if it has. */
  mergeOf(id) {
    return this.story.merges.find(({ scan, from }) => scan <= this.map.moment.scan && from.includes(id));
  }

  showList(chosen) {
    const slots = this.map.largestFirst();
    document.getElementById("largest-title").textContent = `Largest of ${counted(slots.length, "cluster")}`;
    const listed = slots.slice(0, LISTED);
    listed.forEach((slot, i) => {
      this.entry(i).show(slot, this.map.cluster(slot), this.colour(slot), slot === chosen);
    });
    while (this.list.childElementCount > listed.length) this.list.lastElementChild.remove();
    const rest = slots.length - LISTED;
    const smaller = rest > 0 ? `and ${counted(rest, "smaller one")}; ` : "";
    const unclustered = counted(this.map.moment.unclustered, "voxel");
    document.getElementById("smaller").textContent = `${smaller}${unclustered} in no cluster`;
  }

  /** A line of the list, made and put at its end where it is not there yet. */
  entry(i) {
    this.entries[i] ??= new Entry((slot) => this.choose(slot === this.chosen ? -1 : slot));
    if (!this.entries[i].item.isConnected) this.list.append(this.entries[i].item);
    return this.entries[i];
  }
}
