// The picture that the light falls on: canvas, overlay, and what pointer and keys do to light, zoom and place.

import { draw, make, button } from "./elements.js";

/** Distance of the pointer from the middle at which the light is at the horizon, in shorter sides of the stage. */
const SPREAD = 0.55;

export class Stage {
  /** dial takes the light; viewport the zoom; profile() gives what a drawn line goes to, or null. */
  constructor(canvas, parts) {
    this.canvas = canvas;
    Object.assign(this, parts);
    this.overlay = draw("svg", { class: "overlay" });
    this.caption = make("p", { className: "caption", role: "status" });
    const tools = make("div", { className: "zoom-tools" },
      button("−", () => this.viewport().zoomBy(1 / 1.4), { title: "Smaller", "aria-label": "Smaller" }),
      button("Fit", () => this.viewport().fit(), { title: "The whole picture" }),
      button("+", () => this.viewport().zoomBy(1.4), { title: "Larger", "aria-label": "Larger" }));
    this.element = make("div", { className: "light-stage" }, canvas, this.overlay, this.caption, tools);
    canvas.tabIndex = 0;
    canvas.setAttribute("aria-label", "Relit surface. Drag or use the arrow keys to move the light, + and - to zoom.");
    this.element.addEventListener("pointerdown", (event) => this.down(event));
    this.element.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.element.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("keydown", (event) => this.key(event));
    this.fingers = new Map();
  }

  down(event) {
    if (event.target !== this.canvas && event.target !== this.overlay) return;
    event.preventDefault();
    this.canvas.focus({ preventScroll: true });
    this.fingers.set(event.pointerId, [event.clientX, event.clientY]);
    const follow = this.action(event);
    const moved = (next) => next.pointerId === event.pointerId && follow(next);
    const ended = (last) => {
      if (last.pointerId !== event.pointerId) return;
      this.fingers.delete(event.pointerId);
      removeEventListener("pointermove", moved);
      removeEventListener("pointerup", ended);
      removeEventListener("pointercancel", ended);
    };
    addEventListener("pointermove", moved);
    addEventListener("pointerup", ended);
    addEventListener("pointercancel", ended);
  }

  /** What follows the pointer: two fingers zoom, the right button or Shift move, else the light or a line. */
  action(event) {
    const viewport = this.viewport();
    if (this.fingers.size > 1) return (next) => this.pinch(next);
    if (event.button !== 0 || event.shiftKey) {
      let last = [event.clientX, event.clientY];
      return (next) => {
        viewport.moveBy(next.clientX - last[0], next.clientY - last[1]);
        last = [next.clientX, next.clientY];
      };
    }
    const profile = this.profile();
    if (profile) return profile.begin(event);
    this.lightTo(event);
    return (next) => this.fingers.size === 1 && this.lightTo(next);
  }

  pinch(event) {
    const other = [...this.fingers].find(([id]) => id !== event.pointerId)?.[1], last = this.fingers.get(event.pointerId);
    if (!other || !last) return;
    const now = [event.clientX, event.clientY], apart = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]) || 1;
    this.viewport().zoomBy(apart(now, other) / apart(last, other), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
    this.fingers.set(event.pointerId, now);
  }

  lightTo(event) {
    const box = this.canvas.getBoundingClientRect(), unit = Math.min(box.width, box.height) * SPREAD;
    this.dial.move((event.clientX - box.x - box.width / 2) / unit, -(event.clientY - box.y - box.height / 2) / unit);
  }

  wheel(event) {
    event.preventDefault();
    this.viewport().zoomBy(Math.exp(-event.deltaY * 0.0015), event.clientX, event.clientY);
  }

  key(event) {
    if (event.key === "+" || event.key === "=") this.viewport().zoomBy(1.4);
    else if (event.key === "-") this.viewport().zoomBy(1 / 1.4);
    else if (event.key === "0") this.viewport().fit();
    else if (event.shiftKey && event.key.startsWith("Arrow")) {
      const steps = { ArrowLeft: [40, 0], ArrowRight: [-40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] };
      this.viewport().moveBy(...steps[event.key]);
      event.preventDefault();
    } else this.dial.key(event);
  }
}
