// The mask: painted by brush, eraser and polygon over the estimate.

import { askPicture } from "../api.js";
import { announce, element } from "../dom.js";
import { Konva } from "../vendor.js";
import { Growth } from "./grow.js";
import { PixelMask, union } from "./pixel_mask.js";
import { Polygon } from "./polygon.js";

const CURSOR_STEP_PX = 4;
const READING = "The mask is being read: paint when it is shown.";
const UNREAD = "The mask could not be read: open this view again.";

export class MaskLayer {
  constructor(view) {
    this.view = view;
    const { width, height } = view.picture;
    Object.assign(this, { width, height, mask: new PixelMask(width, height), isChanged: false });
    this.radius = Math.max(2, Math.round(Math.max(width, height) / 60));
    this.canvas = Object.assign(document.createElement("canvas"), { width, height });
    this.context = this.canvas.getContext("2d");
    this.image = new Konva.Image({ x: -0.5, y: -0.5, width, height, image: this.canvas, listening: false });
    view.picture.overlay.add(this.image);
    this.cursor = new Konva.Circle({ radius: this.radius, stroke: "#fff", strokeWidth: 1.5, strokeScaleEnabled: false, visible: false, listening: false });
    view.picture.shapes.add(this.cursor);
    this.polygon = new Polygon(view, (corners, cutsOut) => this.combine(this.mask.inPolygon(corners), cutsOut));
    this.warning = element("p", { class: "doubt", role: "status", hidden: true }, "The mask touches the frame's edge: what lies beyond it is not seen, so the silhouette there is doubtful.");
    this.size = element("input", { type: "range", min: "1", max: String(Math.round(Math.max(width, height) / 8)), value: String(this.radius), "aria-label": "Size of the brush", oninput: () => this.resize(Number(this.size.value) - this.radius) });
    this.growth = new Growth(view, this);
    this.visible = element("input", { type: "checkbox", checked: true, onchange: () => this.image.visible(this.visible.checked) });
    this.state = element("p", { class: "faint" });
    this.root = element("section", {}, element("h2", {}, "Mask"), element("label", { class: "line" }, "Brush", this.size), this.growth.root, element("label", { class: "line" }, this.visible, "Show the mask"), this.warning, this.state);
    this.paintByPointer();
    this.reset();
  }

  /** Takes the mask that is in use, which would replace what was painted before it has come. */
  async reset() {
    this.obstacle = READING;
    try {
      const data = await this.decoded(await askPicture(`${this.view.capture.path}/mask`, this.view.signal));
      this.mask.take((index) => data[4 * index] > 0);
    } catch (error) {
      if (error.name === "AbortError") return;
      announce(`The mask cannot be read: ${error.message}`, "error");
      // A mask may be painted in place of a file that cannot be read, not of an answer that was lost.
      this.obstacle = error.status ? "" : UNREAD;
      return;
    }
    this.obstacle = "";
    this.isChanged = false;
    this.redraw(this.mask.whole);
    this.showState();
  }

  /** Returns four bytes for each pixel of a picture of the full frame's size. */
  async decoded(blob) {
    const bitmap = await createImageBitmap(blob);
    const context = new OffscreenCanvas(this.width, this.height).getContext("2d");
    context.drawImage(bitmap, 0, 0);
    return context.getImageData(0, 0, this.width, this.height).data;
  }

  toolChanged(tool) {
    const paints = tool === "brush" || tool === "eraser";
    this.cursor.visible(paints);
    if (paints && !this.cursor.x()) this.cursor.position(this.view.picture.centre());
    this.polygon.toolChanged();
  }

  resize(by) {
    this.radius = Math.max(1, Math.min(Number(this.size.max), this.radius + by));
    this.size.value = String(this.radius);
    this.cursor.radius(this.radius);
  }

  paintByPointer() {
    const { container } = this.view.picture;
    const { signal } = this.view;
    container.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      const point = this.view.picture.pointer(event);
      if (this.polygon.isChosen) this.polygon.add(point);
      if (!this.paints || !this.mayPaint()) return;
      container.setPointerCapture(event.pointerId);
      this.begin();
      this.last = point;
      this.stroke(point);
    }, { signal });
    container.addEventListener("pointermove", (event) => {
      if (this.polygon.isChosen) this.polygon.follow(this.view.picture.pointer(event));
      if (!this.paints) return;
      const coalesced = event.getCoalescedEvents?.() ?? [];
      for (const step of coalesced.length ? coalesced : [event]) {
        const point = this.view.picture.pointer(step);
        this.cursor.position(point);
        if (this.before) this.stroke(point);
      }
    }, { signal });
    container.addEventListener("pointerup", () => this.end(), { signal });
    container.addEventListener("pointercancel", () => this.cancel(), { signal });
  }

  get paints() {
    return this.view.tool === "brush" || this.view.tool === "eraser";
  }

  /** Whether the mask is there; says so where it is not. */
  mayPaint() {
    if (this.obstacle) announce(this.obstacle, "error");
    return !this.obstacle;
  }

  /** Begins a step, which changes pixels in a box alone. */
  begin() {
    this.before = this.mask.copy();
    this.box = null;
  }

  /** Paints discs from the last point to this one. */
  stroke(point) {
    const value = this.view.tool === "brush" ? 1 : 0;
    const length = Math.hypot(point.x - this.last.x, point.y - this.last.y);
    const steps = Math.max(1, Math.ceil(length / Math.max(1, this.radius / 3)));
    for (let step = 1; step <= steps; step += 1) {
      const share = step / steps;
      this.disc(this.last.x + (point.x - this.last.x) * share, this.last.y + (point.y - this.last.y) * share, value);
    }
    this.last = point;
  }

  disc(x, y, value) {
    const box = this.mask.fillDisc(x, y, this.radius, value);
    if (!box) return;
    this.box = this.box ? union(this.box, box) : box;
    this.redraw(box);
  }

  /** Takes back what the step that has begun has changed, and the corner that it has set. */
  cancel() {
    if (this.polygon.isChosen) this.polygon.corners.pop();
    const { before, box } = this;
    this.before = null;
    if (!before || !box) return;
    this.mask.paste(box, before.cut(box));
    this.redraw(box);
  }

  /** Ends a step: notes what it changed, as a box before and after. */
  end() {
    const { before, box } = this;
    this.before = null;
    if (!before || !box) return;
    const [earlier, now] = [before.cut(box), this.mask.cut(box)];
    if (earlier.every((value, index) => value === now[index])) return;
    const wasChanged = this.isChanged;
    const put = (part, changed) => {
      this.mask.paste(box, part);
      this.isChanged = changed;
      this.redraw(box);
      this.showState();
    };
    this.isChanged = true;
    this.showState();
    this.view.history.add({ undo: () => put(earlier, wasChanged), redo: () => put(now, true) });
  }

  moveCursor(x, y) {
    const [stepX, stepY] = [x * CURSOR_STEP_PX, y * CURSOR_STEP_PX];
    if (this.polygon.isChosen) return this.polygon.move(stepX, stepY);
    this.cursor.position({ x: this.cursor.x() + stepX, y: this.cursor.y() + stepY });
    this.view.picture.reveal(this.cursor.position());
    return true;
  }

  paintAtCursor() {
    if (!this.paints) return this.polygon.addAtCursor();
    if (!this.mayPaint()) return true;
    this.begin();
    this.last = this.cursor.position();
    this.stroke(this.last);
    this.end();
    return true;
  }

  /** Adds the pixels that `isIn` names, or cuts them out, as one step; returns whether it may. */
  combine(isIn, cutsOut) {
    if (!this.mayPaint()) return false;
    this.begin();
    this.mask.fill(isIn, cutsOut ? 0 : 1);
    this.box = this.mask.whole;
    this.redraw(this.box);
    this.end();
    return true;
  }

  redraw(box) {
    this.mask.draw(this.context, box);
    this.view.picture.overlay.batchDraw();
  }

  /** Shows how many pixels the mask has, where it comes from, and whether it touches the frame's edge. */
  showState() {
    const count = this.mask.count();
    this.warning.hidden = !this.mask.touchesEdge;
    const origin = this.isChanged ? "changed, not saved" : this.view.edits.has_mask ? "set on the page" : this.view.inputs.given.mask ? "from the catalogue" : count ? "estimated" : "none yet";
    this.state.textContent = `${count.toLocaleString("en")} pixels · ${origin}`;
    this.root.dataset.pixels = String(count);
  }

  /** Returns the mask as the base64 of a PNG, if it was changed. */
  async changes() {
    return this.isChanged ? { mask: await this.mask.encoded() } : {};
  }
}
