// Mouse, touch and keys on the picture.

/** Further than this (CSS px) a press is a drag. */
const CLICK = 4;
const KEY_STEP = 24;

class Pointer {
  /** `on` has turned(), picked(x, y), hovered(x, y), left(), reset(). */
  constructor(canvas, camera, on) {
    this.canvas = canvas;
    this.camera = camera;
    this.on = on;
    this.held = new Map();
    this.travelled = 0;
    const listen = (name, method) =>
      canvas.addEventListener(name, (event) => method.call(this, event), { passive: false });
    listen("pointerdown", this.down);
    listen("pointermove", this.moved);
    listen("pointerup", this.up);
    listen("pointercancel", this.cancel);
    listen("pointerleave", () => on.left());
    listen("wheel", this.wheel);
    listen("keydown", this.key);
    listen("contextmenu", (event) => event.preventDefault());
  }

  place(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  fromMiddle([x, y]) {
    return [x - this.canvas.clientWidth / 2, y - this.canvas.clientHeight / 2];
  }

  down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.held.set(event.pointerId, this.place(event));
    if (this.held.size === 1) this.travelled = 0;
    // Two fingers are never a click.
    else this.travelled = Infinity;
  }

  moved(event) {
    const now = this.place(event);
    const before = this.held.get(event.pointerId);
    if (before === undefined) return this.on.hovered(...now);
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    this.travelled += Math.hypot(dx, dy);
    if (this.travelled <= CLICK) return undefined;
    if (this.held.size > 1) this.pinch(event.pointerId, before, now);
    else if (event.shiftKey || event.buttons & 6) this.camera.move(dx, dy);
    else this.camera.turn(dx, dy);
    this.held.set(event.pointerId, now);
    return this.on.turned();
  }

  /** One of two fingers moved: the map goes with their middle and grows with their distance. */
  pinch(id, before, now) {
    const [, other] = [...this.held].find(([otherId]) => otherId !== id);
    const apart = (a) => Math.hypot(a[0] - other[0], a[1] - other[1]) || 1;
    this.camera.move((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
    const middle = this.fromMiddle([(now[0] + other[0]) / 2, (now[1] + other[1]) / 2]);
    this.camera.zoom(apart(now) / apart(before), ...middle);
  }

  up(event) {
    const place = this.held.get(event.pointerId);
    this.held.delete(event.pointerId);
    if (place !== undefined && this.held.size === 0 && this.travelled <= CLICK && event.button === 0) {
      this.on.picked(...this.place(event));
    }
  }

  cancel(event) {
    this.held.delete(event.pointerId);
  }

  wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 30 : 1;
    const factor = Math.exp(clamp(-event.deltaY * lines, -240, 240) * 0.0016);
    this.camera.zoom(factor, ...this.fromMiddle(this.place(event)));
    this.on.turned();
  }

  key(event) {
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const step = steps[event.key]?.map((s) => s * KEY_STEP);
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (step && event.shiftKey) this.camera.move(-step[0], -step[1]);
    else if (step) this.camera.turn(...step);
    else if (event.key === "+" || event.key === "=") this.camera.zoom(1.2);
    else if (event.key === "-") this.camera.zoom(1 / 1.2);
    else if (event.key === "Home") this.on.reset();
    else if (event.key === "Escape") this.on.picked(-1, -1);
    else return;
    event.preventDefault();
    this.on.turned();
  }
}
