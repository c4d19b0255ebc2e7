// The light's direction on a disc, as the camera sees the hemisphere above the object.

import { draw, make } from "./elements.js";

const STEP_DEG = 5;
const RADIUS = 46;
/** Longest distance from the dial's middle: a light at the horizon lights nothing that faces the viewer. */
const RIM = 0.985;

export class Dial {
  /** dots: x and y of the lights of accepted frames; onchange: called with the light, a unit vector. */
  constructor(dots, onchange) {
    this.onchange = onchange;
    this.knob = draw("circle", { r: 6, class: "knob" });
    this.ray = draw("line", { x1: 0, y1: 0, class: "ray" });
    this.dots = draw("g", { class: "dots" });
    const rings = [30, 60].map((degrees) => draw("circle", { r: RADIUS * Math.sin((degrees * Math.PI) / 180), class: "ring" }));
    const disc = draw("svg", { viewBox: "-52 -52 104 104", class: "dial", tabindex: 0, role: "slider" },
      draw("circle", { r: RADIUS, class: "disc" }), ...rings, this.dots, this.ray, this.knob);
    disc.setAttribute("aria-label", "Direction of the light");
    disc.addEventListener("pointerdown", (event) => {
      disc.setPointerCapture(event.pointerId);
      this.follow(event);
    });
    disc.addEventListener("pointermove", (event) => event.buttons && this.follow(event));
    disc.addEventListener("keydown", (event) => this.key(event));
    this.element = make("div", { className: "dial-box" }, disc);
    this.disc = disc;
    this.setDots(dots);
    this.set([-0.45, 0.5, 0.74]);
  }

  setDots(dots) {
    this.dots.replaceChildren(...dots.map(([x, y]) => draw("circle", { cx: x * RADIUS, cy: -y * RADIUS, r: 0.9 })));
  }

  /** Show a light without telling anybody. */
  set(light) {
    const length = Math.hypot(...light);
    this.light = light.map((part) => part / length);
    const [x, y] = [this.light[0] * RADIUS, -this.light[1] * RADIUS];
    this.knob.setAttribute("cx", x);
    this.knob.setAttribute("cy", y);
    this.ray.setAttribute("x2", x);
    this.ray.setAttribute("y2", y);
    this.disc.setAttribute("aria-valuetext", lightWords(this.light));
    this.disc.setAttribute("aria-valuenow", Math.round(fromViewer(this.light)));
    this.disc.setAttribute("aria-valuemin", 0);
    this.disc.setAttribute("aria-valuemax", 90);
  }

  /** Move the light to a place on the disc, -1 to 1, y up. */
  move(x, y) {
    const distance = Math.hypot(x, y), share = distance > RIM ? RIM / distance : 1;
    const [across, up] = [x * share, y * share];
    this.set([across, up, Math.sqrt(1 - across * across - up * up)]);
    this.onchange(this.light);
  }

  follow(event) {
    const box = this.disc.getBoundingClientRect(), unit = (box.width / 104) * RADIUS;
    this.move((event.clientX - box.x - box.width / 2) / unit, -(event.clientY - box.y - box.height / 2) / unit);
  }

  key(event) {
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (!(event.key in moves)) return;
    event.preventDefault();
    const step = Math.sin((STEP_DEG * Math.PI) / 180), [x, y] = moves[event.key];
    this.move(this.light[0] + x * step, this.light[1] + y * step);
  }
}

function fromViewer(light) {
  return (Math.acos(Math.min(1, light[2])) * 180) / Math.PI;
}

/** The direction in words, such as "from the upper left, 42° from the camera". */
export function lightWords(light) {
  const angle = fromViewer(light);
  if (angle < 8) return "from the camera";
  const names = ["the right", "the upper right", "above", "the upper left", "the left", "the lower left", "below", "the lower right"];
  const sector = (Math.round(Math.atan2(light[1], light[0]) / (Math.PI / 4)) + 8) % 8;
  return `from ${names[sector]}, ${angle.toFixed(0)}° from the camera`;
}
