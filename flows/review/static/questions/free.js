// Marks set freely: a click or a line on a frame, or on a picture of all frames, means the highlight that lies there.

import { ask, newest } from "../api.js";
import { element } from "../dom.js";
import { Picture } from "../inputs/picture.js";
import { pixelAt } from "../rounding.js";
import { Timeline } from "../timeline.js";
import { Konva } from "../vendor.js";
import { KIND_COLOURS, TINT } from "./loop.js";

const DRAWN_PX = 5;
const MAX_POINTS = 200;
const LOOKING = "Looking for the highlight …";
const HINT = "Click a highlight, or draw a line over several. Shift+drag moves the picture, the wheel zooms.";

export class FreeMarks {
  /** view: {capture, signal, marks, loop, say, mark}. */
  constructor(view, inputs) {
    Object.assign(this, { view, path: `${view.capture.path}/questions`, choices: [], chosen: 0, line: [], begin: newest() });
    this.stage = element("div", { class: "stage", role: "group", tabindex: "0", "aria-label": "Picture to mark highlights on" });
    this.timeline = new Timeline(inputs.frames, () => this.showPicture());
    this.root = element("div", { class: "free-stage" }, this.stage, this.timeline.root);
    this.picture = new Picture(this.stage, inputs.frame_size, view.signal);
    this.tint = new Konva.Image({ x: -0.5, y: -0.5, image: undefined, opacity: 0.55, listening: false });
    this.picture.overlay.add(this.tint);
    this.paths = new Konva.Group({ listening: false });
    this.preview = new Konva.Group({ listening: false });
    this.cursor = new Konva.Path({ data: "M-9 0H-3M3 0H9M0 -9V-3M0 3V9", stroke: "#fff", strokeWidth: 1.5, strokeScaleEnabled: false, visible: false, listening: false });
    this.picture.shapes.add(this.paths, this.preview, this.cursor);
    this.picture.onzoom.push(() => this.draw());
    this.picture.onclick = (point) => this.choose([point]);
    this.followLine();
    this.timeline.show("mean");
  }

  showPicture() {
    this.forget();
    return this.picture.show(`${this.view.capture.path}/${this.timeline.path}`);
  }

  /** What is being marked: one of the choices, or null. */
  get choice() {
    return this.choices[this.chosen] ?? null;
  }

  /** Chooses nothing, whatever is still being asked about; says so, or `text`. */
  forget(text = HINT, isRefused = false) {
    this.begin();
    this.choices = [];
    this.tint.image(undefined);
    this.view.showChoice(null, text, isRefused);
    this.draw();
  }

  followLine() {
    const { signal } = this.view;
    this.stage.addEventListener("pointerdown", (event) => {
      this.picture.pans = event.shiftKey;
      this.line = event.button === 0 && !event.shiftKey ? [this.picture.pointer(event)] : [];
    }, { signal, capture: true });
    this.stage.addEventListener("pointermove", (event) => {
      if (!this.line.length || !(event.buttons & 1)) return;
      this.line.push(this.picture.pointer(event));
      this.draw();
    }, { signal });
    this.stage.addEventListener("pointercancel", () => {
      this.line = [];
      this.draw();
    }, { signal });
    addEventListener("pointerup", () => {
      const line = this.line;
      this.line = [];
      const length = line.length > 1 ? Math.hypot(line.at(-1).x - line[0].x, line.at(-1).y - line[0].y) * this.picture.zoom : 0;
      if (length > DRAWN_PX || line.length > 12) this.choose(line);
    }, { signal });
  }

  /** Asks what a click or a line means. */
  async choose(points) {
    const dense = filled(points);
    const step = Math.ceil(dense.length / MAX_POINTS);
    const { width, height } = this.picture;
    const pixels = dense.filter((_, i) => i % step === 0).map(({ x, y }) => [Math.round(x), Math.round(y)])
      .filter(([x, y]) => x >= 0 && y >= 0 && x < width && y < height);
    if (!pixels.length) return;
    this.forget(LOOKING);
    const isNewest = this.begin();
    this.clicked = { x: pixels[0][0], y: pixels[0][1] };
    this.cursor.position(this.clicked);
    try {
      const { choices, revision } = await ask(`${this.path}/highlights`, { method: "POST", body: { frame: this.timeline.frame, points: pixels }, signal: this.view.signal });
      if (revision !== this.view.marks.revision) await this.view.marks.follow();
      if (!isNewest()) return;
      Object.assign(this, { choices, chosen: 0 });
      await this.showChoice();
    } catch (error) {
      if (error.name !== "AbortError" && isNewest()) this.forget(error.message, true);
    }
  }

  async next() {
    if (this.choices.length < 2) return;
    this.chosen = (this.chosen + 1) % this.choices.length;
    await this.showChoice();
  }

  async showChoice() {
    const { choice } = this;
    const { highlights, accepted } = choice;
    const canvas = element("canvas", { width: this.picture.width, height: this.picture.height });
    const context = canvas.getContext("2d");
    context.fillStyle = TINT;
    for (const [x, y] of choice.sheet) context.fillRect(x, y, 1, 1);
    this.tint.setAttrs({ image: canvas, width: this.picture.width, height: this.picture.height });
    this.draw();
    const [first] = highlights;
    const place = highlights.length > 1 ? `${highlights.length} highlights under the line` : `Highlight at x ${first.x}, y ${first.y} in frame ${first.frame.toLocaleString("en")}`;
    const through = highlights.length > 1 ? "" : `, followed through ${Math.max(first.track.length, 1)} ${first.track.length > 1 ? "frames" : "frame"}`;
    const now = accepted === null ? "it gave no candidate" : accepted ? "now taken for the outer surface" : "now not taken for it";
    const which = this.choices.length > 1 ? ` Candidate ${this.chosen + 1} of ${this.choices.length} here (key c).` : "";
    await this.view.showChoice(choice, `${place}${through}; ${now}.${which} Does the outer surface reflect it?`);
  }

  /** Returns the marks that label the choice, or null and says why not. */
  labelled(kind) {
    if (!this.choice) {
      this.view.showChoice(null, "Choose a highlight first: click it, or move the cross with the arrow keys and press Enter.", true);
      return null;
    }
    const reason = this.choice.refused[kind];
    if (reason) {
      this.view.say(`Refused: ${reason}.`, true);
      return null;
    }
    return this.choice.highlights.map(({ frame, x, y }) => ({ frame, x, y, kind }));
  }

  moveCursor(x, y) {
    const { cursor, picture } = this;
    if (!cursor.visible()) cursor.setAttrs({ ...pixelAt(picture.centre()), visible: true });
    else cursor.position({ x: Math.max(0, Math.min(picture.width - 1, cursor.x() + x)), y: Math.max(0, Math.min(picture.height - 1, cursor.y() + y)) });
    this.draw();
  }

  /** Shows a saved mark in its frame. */
  go({ frame, x, y }) {
    this.timeline.show(frame);
    this.cursor.position({ x, y });
    this.draw();
  }

  draw() {
    const { zoom } = this.picture;
    const unit = 1 / zoom;
    const frame = this.timeline.frame;
    this.cursor.scale({ x: unit, y: unit });
    this.paths.destroyChildren();
    for (const { kind, track, ...mark } of this.view.marks.tracks) this.paths.add(...trackShapes(mark, track, KIND_COLOURS[kind], kind, frame, unit));
    this.preview.destroyChildren();
    if (this.line.length > 1) this.preview.add(line(this.line.flatMap(({ x, y }) => [x, y]), TINT, 3));
    for (const { track, ...highlight } of this.choice?.highlights ?? []) {
      this.preview.add(...trackShapes(highlight, track, TINT, null, frame, unit));
      if (this.choice.highlights.length === 1) this.preview.add(line([this.clicked.x, this.clicked.y, highlight.x, highlight.y], "#fff", 1.5, [4, 4]));
    }
  }

  get keys() {
    const far = 10;
    return [
      ...this.timeline.keys,
      ["Enter", "choose the highlight at the cross", () => this.cursor.visible() && this.choose([this.cursor.position()])],
      ["c", "next candidate of this pixel", () => this.next()],
      ["ArrowRight", "move the cross; with Shift ten pixels", (event) => this.moveCursor(event.shiftKey ? far : 1, 0)],
      ["ArrowLeft", "to the left", (event) => this.moveCursor(event.shiftKey ? -far : -1, 0)],
      ["ArrowUp", "up", (event) => this.moveCursor(0, event.shiftKey ? -far : -1)],
      ["ArrowDown", "down", (event) => this.moveCursor(0, event.shiftKey ? far : 1)],
      [".", "next frame", () => this.timeline.step(1)],
      [",", "frame before", () => this.timeline.step(-1)],
      ["+ =", "zoom in", () => this.picture.zoomBy(1.25)],
      ["-", "zoom out", () => this.picture.zoomBy(0.8)],
      ["0", "whole picture", () => this.picture.fit()],
      ["Escape", "choose nothing", () => this.forget()],
    ];
  }
}

/** Returns the path of a highlight and its place: in the frame that is shown, else where it was marked. */
function trackShapes({ frame, x, y }, track, colour, kind, shown, unit) {
  const now = track.find(([number]) => number === shown) ?? [frame, x, y];
  const isNow = shown === null || now[0] === shown;
  const shapes = track.length > 1 ? [line(track.flatMap(([, px, py]) => [px, py]), colour, 2)] : [];
  const place = { x: now[1], y: now[2], stroke: colour, strokeWidth: 2, strokeScaleEnabled: false, opacity: isNow ? 1 : 0.5 };
  // A cross stands for false, a ring for true: colours alone do not tell them apart for everybody.
  shapes.push(kind === "false" ? new Konva.Path({ ...place, data: "M-6 -6L6 6M6 -6L-6 6", scaleX: unit, scaleY: unit }) : new Konva.Circle({ ...place, radius: 7 * unit }));
  return shapes;
}

function line(points, stroke, strokeWidth, dash = undefined) {
  return new Konva.Line({ points, stroke, strokeWidth, dash, strokeScaleEnabled: false, lineCap: "round", lineJoin: "round" });
}

/** Returns the points of a line with others between them, at most two pixels apart: a fast hand leaves gaps. */
function filled(points) {
  return points.flatMap((point, i) => {
    const next = points[i + 1] ?? point;
    const count = Math.max(1, Math.ceil(Math.hypot(next.x - point.x, next.y - point.y) / 2));
    return Array.from({ length: count }, (_, k) => ({ x: point.x + ((next.x - point.x) * k) / count, y: point.y + ((next.y - point.y) * k) / count }));
  });
}
