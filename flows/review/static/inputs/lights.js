// The hemisphere of lights, seen from the camera: one point for each frame; a click goes to that frame.

import { element } from "../dom.js";

const SIZE = 236;
const REACH = 104;

export class LightDome {
  constructor(view) {
    this.view = view;
    this.lights = view.inputs.lights;
    this.lit = new Set();
    this.canvas = element("canvas", { width: SIZE * 2, height: SIZE * 2, role: "img", onclick: (event) => this.clicked(event) });
    const accepted = this.lights.filter(Boolean).length;
    const text = this.lights.length ? `${accepted.toLocaleString("en")} of ${this.lights.length.toLocaleString("en")} frames have a light` : "Lights are known after the first run.";
    this.canvas.setAttribute("aria-label", `Hemisphere of lights: ${text}. The keys . and , step through the frames.`);
    this.root = element("section", {}, element("h2", {}, "Lights"), this.canvas, element("p", { class: "faint" }, text));
    this.draw();
  }

  place([x, y]) {
    return [SIZE / 2 + x * REACH, SIZE / 2 - y * REACH];
  }

  mark(frame) {
    this.frame = frame;
    this.draw();
  }

  showLit(frames) {
    this.lit = new Set(frames);
    this.draw();
  }

  draw() {
    const context = this.canvas.getContext("2d");
    context.setTransform(2, 0, 0, 2, 0, 0);
    context.clearRect(0, 0, SIZE, SIZE);
    context.strokeStyle = "#4a4f56";
    context.fillStyle = "#a9a69e";
    context.font = "9px sans-serif";
    context.textAlign = "center";
    for (const angle of [30, 60, 90]) {
      const radius = REACH * Math.sin((angle * Math.PI) / 180);
      context.beginPath();
      context.arc(SIZE / 2, SIZE / 2, radius, 0, 2 * Math.PI);
      context.stroke();
      context.fillText(`${angle}°`, SIZE / 2, SIZE / 2 - radius - 3);
    }
    const dot = (light, radius, colour) => {
      const [x, y] = this.place(light);
      context.fillStyle = colour;
      context.beginPath();
      context.arc(x, y, radius, 0, 2 * Math.PI);
      context.fill();
    };
    const dim = this.lit.size ? "#b3b1ab55" : "#cfcac0aa";
    for (const light of this.lights) if (light) dot(light, 1.3, dim);
    for (const frame of this.lit) if (this.lights[frame]) dot(this.lights[frame], 2.4, "#e0b96f");
    const now = this.frame === null || this.frame === undefined ? null : this.lights[this.frame];
    if (now) {
      dot(now, 6, "#9cc8ff");
      dot(now, 2, "#10202e");
    }
  }

  clicked(event) {
    const box = this.canvas.getBoundingClientRect();
    const x = ((event.clientX - box.left) * SIZE) / box.width;
    const y = ((event.clientY - box.top) * SIZE) / box.height;
    let nearest = null;
    let least = Infinity;
    this.lights.forEach((light, frame) => {
      if (!light) return;
      const [px, py] = this.place(light);
      const distance = Math.hypot(px - x, py - y) - (this.lit.has(frame) ? 3 : 0);
      if (distance < least) [least, nearest] = [distance, frame];
    });
    if (nearest !== null) this.view.show(nearest);
  }
}
