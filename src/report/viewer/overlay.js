// Lines over the picture: the box of the chosen cluster, the way of the sensor, a scale and the axes.

/** Turns a vector by a quaternion [x, y, z, w]. */
function rotated([x, y, z, w], v) {
  const u = [x, y, z];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const twice = scaled(cross(u, v), 2);
  return sum(v, sum(scaled(twice, w), cross(u, twice)));
}

class Overlay {
  constructor(context, camera, look) {
    this.context = context;
    this.camera = camera;
    this.look = look;
  }

  /** Place in the canvas, CSS px. */
  at(place) {
    const [x, y] = this.camera.project(place);
    return [x + this.look.width / 2, y + this.look.height / 2];
  }

  line(places, isClosed = false) {
    const { context } = this;
    context.beginPath();
    places.forEach((place) => context.lineTo(...this.at(place)));
    if (isClosed) context.closePath();
    context.stroke();
  }

  /** The box around a cluster and its normal. */
  box({ position, orientation, size }) {
    const [lx, ly, lz] = size.map((length) => length / 2);
    const corner = (x, y, z) => sum(position, rotated(orientation, [x * lx, y * ly, z * lz]));
    const { context } = this;
    context.strokeStyle = this.look.inkText;
    context.lineWidth = 1.25;
    context.globalAlpha = 0.6;
    for (const z of [-1, 1]) this.line([corner(-1, -1, z), corner(1, -1, z), corner(1, 1, z), corner(-1, 1, z)], true);
    for (const [x, y] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) this.line([corner(x, y, -1), corner(x, y, 1)]);
    this.arrow(position, sum(position, scaled(rotated(orientation, [0, 0, 1]), 42 / this.camera.scale)));
    context.globalAlpha = 1;
  }

  arrow(from, to) {
    const { context } = this;
    const [[x0, y0], [x1, y1]] = [this.at(from), this.at(to)];
    const direction = Math.atan2(y1 - y0, x1 - x0);
    const head = Math.min(9, Math.hypot(x1 - x0, y1 - y0));
    context.lineWidth = 2;
    this.line([from, to]);
    context.fillStyle = context.strokeStyle;
    context.beginPath();
    context.moveTo(x1, y1);
    for (const angle of [direction - 0.42, direction + 0.42]) {
      context.lineTo(x1 - head * Math.cos(angle), y1 - head * Math.sin(angle));
    }
    context.fill();
  }

  /** Where the sensor was up to now, and where it is. */
  way(places) {
    if (places.length === 0) return;
    const { context } = this;
    context.strokeStyle = this.look.inkText;
    context.lineWidth = 1.5;
    context.globalAlpha = 0.45;
    context.lineJoin = "round";
    this.line(places);
    context.globalAlpha = 1;
    const [x, y] = this.at(places[places.length - 1]);
    context.beginPath();
    context.arc(x, y, 4.5, 0, 2 * Math.PI);
    context.fillStyle = this.look.stage;
    context.fill();
    context.lineWidth = 2;
    context.stroke();
  }

  /** Draws lines with a rim in the colour of what is empty, so that they are read over every cluster. */
  rimmed(path) {
    const { context, look } = this;
    context.beginPath();
    path();
    for (const [width, colour] of [[4.5, look.stage], [1.5, look.inkText]]) {
      context.lineWidth = width;
      context.strokeStyle = colour;
      context.stroke();
    }
  }

  text(text, x, y, align) {
    const { context, look } = this;
    context.font = look.font;
    context.textAlign = align;
    context.lineJoin = "round";
    context.lineWidth = 3.5;
    context.strokeStyle = look.stage;
    context.strokeText(text, x, y);
    context.fillStyle = look.inkText;
    context.fillText(text, x, y);
  }

  /** A round length of at most 150 px. */
  scaleBar() {
    const { context, camera, look } = this;
    const power = 10 ** Math.floor(Math.log10(150 / camera.scale));
    const length = [5, 2, 1].map((m) => m * power).find((metres) => metres * camera.scale <= 150) ?? power;
    const [x, y, span] = [16, look.height - 18, length * camera.scale];
    this.rimmed(() => [[0, -5], [0, 0], [span, 0], [span, -5]].forEach(([px, py]) => context.lineTo(x + px, y + py)));
    this.text(length >= 1 ? `${length} m` : `${Number((length * 100).toPrecision(2))} cm`, x + 6, y - 6, "left");
  }

  /** The fixed frame's axes, in the lower right corner. */
  axes() {
    const { context, camera, look } = this;
    const { right, down } = camera.axes();
    const [x0, y0] = [look.width - 46, look.height - 42];
    const end = (axis, length) => [x0 + length * right[axis], y0 + length * down[axis]];
    this.rimmed(() => [0, 1, 2].forEach((axis) => {
      context.moveTo(x0, y0);
      context.lineTo(...end(axis, 24));
    }));
    ["x", "y", "z"].forEach((name, axis) => {
      const [x, y] = end(axis, 33);
      this.text(name, x, y + 4, "center");
    });
  }
}
