// The depth along a line that is drawn on the picture: two handles, a chart, lengths in mm or pixels.

import { draw, make } from "./elements.js";

const WIDTH = 640, HEIGHT = 190, LEFT = 58, RIGHT = 14, TOP = 14, BOTTOM = 36;
const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** Depth at a place of the picture, linear between the four pixels around it; NaN beside the object. */
function depthAt(depth, width, height, x, y) {
  const left = Math.floor(x - 0.5), top = Math.floor(y - 0.5);
  if (left < 0 || top < 0 || left + 1 >= width || top + 1 >= height) return NaN;
  const right = x - 0.5 - left, down = y - 0.5 - top, at = top * width + left;
  return (1 - down) * ((1 - right) * depth[at] + right * depth[at + 1]) +
    down * ((1 - right) * depth[at + width] + right * depth[at + width + 1]);
}

/** Depths along the line from a to b, and the distance of each from a; unit is that of the distances. */
function depthsAlong(depth, width, height, a, b, pixelSize) {
  const length = Math.hypot(b[0] - a[0], b[1] - a[1]), count = Math.max(2, Math.min(1200, Math.ceil(length * 2)));
  const places = Array.from({ length: count }, (_, i) => i / (count - 1));
  const values = places.map((share) => depthAt(depth, width, height, a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])));
  return { distances: places.map((share) => share * length * pixelSize), values };
}

export class Profile {
  constructor(viewport, overlay) {
    this.viewport = viewport;
    this.overlay = overlay;
    this.line = draw("line", { class: "profile-line" });
    this.handles = [0, 1].map((end) => {
      const handle = draw("circle", { r: 8, class: "profile-handle", tabindex: 0, role: "button" });
      handle.setAttribute("aria-label", `${end ? "End" : "Start"} of the line; arrow keys move it`);
      handle.addEventListener("pointerdown", (event) => {
        event.stopPropagation();
        handle.setPointerCapture(event.pointerId);
      });
      handle.addEventListener("pointermove", (event) => event.buttons && this.moveTo(end, viewport.picture(event.clientX, event.clientY)));
      handle.addEventListener("keydown", (event) => this.key(event, end));
      return handle;
    });
    this.group = draw("g", {}, this.line, ...this.handles);
    this.chart = draw("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "profile-chart", role: "img" });
    this.words = make("p", { className: "profile-words" });
    this.note = make("p", { className: "profile-note" });
    this.element = make("section", { className: "profile", hidden: true }, make("h3", {}, "Depth profile"), this.words, this.chart, this.note);
    this.isOn = false;
  }

  /** Take another capture: its depth (floats), facts, and the mask that the first line is laid across. */
  setCapture(depth, facts, mask) {
    Object.assign(this, { depth, facts });
    const [width, height] = facts.size, span = extent(mask, width, height);
    this.ends = [[span.left, span.row], [span.right, span.row]];
    if (this.isOn) this.update();
  }

  show(isOn) {
    this.isOn = isOn;
    this.element.hidden = !isOn;
    if (isOn) this.overlay.append(this.group);
    else this.group.remove();
    if (!isOn) return;
    this.update();
    this.element.scrollIntoView({ block: "nearest" });
  }

  /** Begin a new line where the pointer went down; returns what follows the pointer. */
  begin(event) {
    const start = this.viewport.picture(event.clientX, event.clientY);
    return (moved) => {
      this.ends = [start, this.viewport.picture(moved.clientX, moved.clientY)];
      this.update();
    };
  }

  moveTo(end, place) {
    this.ends[end] = place;
    this.update();
  }

  key(event, end) {
    if (!(event.key in STEPS)) return;
    event.preventDefault();
    event.stopPropagation();
    const size = event.shiftKey ? 10 : 1, [x, y] = STEPS[event.key];
    this.moveTo(end, [this.ends[end][0] + x * size, this.ends[end][1] + y * size]);
  }

  place() {
    if (!this.isOn || !this.ends) return;
    const [a, b] = this.ends.map(([x, y]) => this.viewport.stage(x, y));
    for (const [name, value] of Object.entries({ x1: a[0], y1: a[1], x2: b[0], y2: b[1] })) this.line.setAttribute(name, value);
    this.handles.forEach((handle, i) => {
      handle.setAttribute("cx", [a, b][i][0]);
      handle.setAttribute("cy", [a, b][i][1]);
    });
  }

  update() {
    this.place();
    const { facts } = this, [width, height] = facts.size, unit = facts.depth.unit;
    const scale = facts.full_size[0] / width, step = unit === "mm" ? scale * facts.pixel_size : scale;
    const { distances, values } = depthsAlong(this.depth, width, height, ...this.ends, step);
    const known = values.filter(Number.isFinite), length = distances.at(-1);
    const range = known.length ? [Math.min(...known), Math.max(...known)] : [0, 1];
    const short = (value) => `${Number(value.toPrecision(3))} ${unit}`;
    this.words.textContent = known.length
      ? `${short(length)} long; depth varies by ${short(range[1] - range[0])} along it`
      : "The line does not touch the object";
    this.note.textContent = unit !== "mm"
      ? "In pixels: the scale of this capture is not known (a sphere's diameter in mm would give it)."
      : facts.is_perspective ? "Lengths are those at the object's distance from the camera." : "";
    this.drawChart(distances, values, range, unit);
  }

  drawChart(distances, values, [low, high], unit) {
    const margin = Math.max((high - low) * 0.08, 1e-6), length = distances.at(-1) || 1;
    const x = (value) => LEFT + (value / length) * (WIDTH - LEFT - RIGHT);
    const y = (value) => TOP + ((high + margin - value) / (high - low + 2 * margin)) * (HEIGHT - TOP - BOTTOM);
    let path = "", isDrawing = false;
    values.forEach((value, i) => {
      if (Number.isFinite(value)) path += `${isDrawing ? "L" : "M"}${x(distances[i]).toFixed(1)} ${y(value).toFixed(1)}`;
      isDrawing = Number.isFinite(value);
    });
    const axes = [];
    for (const value of ticks(low, high)) {
      axes.push(draw("line", { x1: LEFT, x2: WIDTH - RIGHT, y1: y(value), y2: y(value), class: "grid" }));
      axes.push(draw("text", { x: LEFT - 8, y: y(value) + 4, "text-anchor": "end" }, String(value)));
    }
    for (const value of ticks(0, length)) axes.push(draw("text", { x: x(value), y: HEIGHT - 18, "text-anchor": "middle" }, String(value)));
    axes.push(draw("text", { x: WIDTH - RIGHT, y: HEIGHT - 3, "text-anchor": "end", class: "axis" }, `along the line, ${unit}`));
    axes.push(draw("text", { x: LEFT, y: HEIGHT - 3, class: "axis" }, `depth towards the camera, ${unit}`));
    this.chart.replaceChildren(...axes, draw("path", { d: path, class: "curve" }));
    this.chart.setAttribute("aria-label", this.words.textContent);
  }
}

function ticks(low, high) {
  const span = Math.max(high - low, 1e-9), rough = span / 4, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((size) => size >= rough);
  const values = [];
  for (let k = Math.ceil(low / step); k * step <= high + 1e-9 * span; k++) values.push(Number((k * step).toPrecision(6)));
  return values;
}

/** The row through the middle of the mask, and where the object begins and ends in it. */
function extent(mask, width, height) {
  const rows = [...Array(height).keys()].filter((row) => mask.subarray(row * width, (row + 1) * width).some(Boolean));
  const row = rows[rows.length >> 1] ?? height >> 1, line = mask.subarray(row * width, (row + 1) * width);
  const left = line.findIndex(Boolean), right = line.findLastIndex(Boolean);
  return left < 0 ? { row: row + 0.5, left: width * 0.2, right: width * 0.8 } : { row: row + 0.5, left: left + 0.5, right: right + 0.5 };
}
