// The mask: painted by brush, eraser and polygon over the estimate, kept as one byte for each pixel of the full frame.

import { announce, element } from "../dom.js";
import { Konva } from "../vendor.js";
import { Growth } from "./grow.js";

const INSIDE = [112, 214, 150, 44];
const RIM = [140, 240, 175, 230];
const CURSOR_STEP_PX = 4;

export class MaskLayer {
  constructor(view) {
    this.view = view;
    const { width, height } = view.picture;
    Object.assign(this, { width, height, pixels: new Uint8Array(width * height), isChanged: false, corners: [] });
    this.radius = Math.max(2, Math.round(Math.max(width, height) / 60));
    this.canvas = Object.assign(document.createElement("canvas"), { width, height });
    this.context = this.canvas.getContext("2d");
    this.image = new Konva.Image({ x: -0.5, y: -0.5, width, height, image: this.canvas, listening: false });
    view.picture.overlay.add(this.image);
    this.cursor = new Konva.Circle({ radius: this.radius, stroke: "#fff", strokeWidth: 1.5, strokeScaleEnabled: false, visible: false, listening: false });
    this.path = new Konva.Line({ stroke: "#ffd27a", strokeWidth: 2, strokeScaleEnabled: false, visible: false, listening: false });
    view.picture.shapes.add(this.cursor, this.path);
    this.warning = element("p", { class: "doubt", role: "status", hidden: true }, "The mask touches the frame's edge: what lies beyond it is not seen, so the silhouette there is doubtful.");
    this.size = element("input", { type: "range", min: "1", max: String(Math.round(Math.max(width, height) / 8)), value: String(this.radius), "aria-label": "Size of the brush", oninput: () => this.resize(Number(this.size.value) - this.radius) });
    this.growth = new Growth(view, this);
    this.visible = element("input", { type: "checkbox", checked: true, onchange: () => this.image.visible(this.visible.checked) });
    this.state = element("p", { class: "faint" });
    this.root = element("section", {}, element("h2", {}, "Mask"), element("label", { class: "line" }, "Brush", this.size), this.growth.root, element("label", { class: "line" }, this.visible, "Show the mask"), this.warning, this.state);
    this.paintByPointer();
    this.reset();
  }

  async reset() {
    const answer = await fetch(`${this.view.capture.path}/mask`, { signal: this.view.signal }).catch(() => null);
    if (!answer?.ok) {
      if (answer) announce("the mask cannot be read", "error");
      return;
    }
    const data = await this.decoded(await answer.blob());
    for (let index = 0; index < this.pixels.length; index += 1) this.pixels[index] = data[4 * index] > 0 ? 1 : 0;
    this.isChanged = false;
    this.redraw(0, 0, this.width, this.height);
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
    if (tool !== "polygon") this.cancelPolygon();
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
      if (this.view.tool === "polygon") this.addCorner(point);
      if (!this.paints) return;
      container.setPointerCapture(event.pointerId);
      this.begin();
      this.last = point;
      this.stroke(point);
    }, { signal });
    container.addEventListener("pointermove", (event) => {
      if (this.view.tool === "polygon") this.drawPath(this.view.picture.pointer(event));
      if (!this.paints) return;
      const coalesced = event.getCoalescedEvents?.() ?? [];
      for (const step of coalesced.length ? coalesced : [event]) {
        const point = this.view.picture.pointer(step);
        this.cursor.position(point);
        if (this.before) this.stroke(point);
      }
    }, { signal });
    for (const name of ["pointerup", "pointercancel"]) container.addEventListener(name, () => this.end(), { signal });
  }

  get paints() {
    return this.view.tool === "brush" || this.view.tool === "eraser";
  }

  begin() {
    this.before = this.pixels.slice();
    this.box = [this.width, this.height, 0, 0];
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
    const { radius, width, height } = this;
    const [left, right] = [Math.max(0, Math.ceil(x - radius)), Math.min(width - 1, Math.floor(x + radius))];
    const [top, bottom] = [Math.max(0, Math.ceil(y - radius)), Math.min(height - 1, Math.floor(y + radius))];
    if (left > right || top > bottom) return;
    for (let row = top; row <= bottom; row += 1) {
      for (let column = left; column <= right; column += 1) {
        if ((row - y) ** 2 + (column - x) ** 2 <= radius * radius) this.pixels[row * width + column] = value;
      }
    }
    this.box = [Math.min(this.box[0], left), Math.min(this.box[1], top), Math.max(this.box[2], right), Math.max(this.box[3], bottom)];
    this.redraw(left - 1, top - 1, right - left + 3, bottom - top + 3);
  }

  /** Ends a stroke: notes what it changed, as a rectangle before and after. */
  end() {
    if (!this.before) return;
    const [left, top, right, bottom] = this.box;
    const earlier = this.before;
    this.before = null;
    if (right < left || bottom < top) return;
    const size = [left, top, right - left + 1, bottom - top + 1];
    const [old, now] = [cut(earlier, this.width, size), cut(this.pixels, this.width, size)];
    if (old.every((value, index) => value === now[index])) return;
    const wasChanged = this.isChanged;
    const put = (part, changed) => {
      paste(this.pixels, this.width, size, part);
      this.isChanged = changed;
      this.redraw(left - 1, top - 1, size[2] + 2, size[3] + 2);
      this.showState();
    };
    this.isChanged = true;
    this.showState();
    this.view.history.add({ undo: () => put(old, wasChanged), redo: () => put(now, true) });
  }

  moveCursor(x, y) {
    this.cursor.position({ x: this.cursor.x() + x * CURSOR_STEP_PX, y: this.cursor.y() + y * CURSOR_STEP_PX });
    return true;
  }

  paintAtCursor() {
    if (!this.paints) return false;
    this.begin();
    this.last = this.cursor.position();
    this.stroke(this.last);
    this.end();
    return true;
  }

  addCorner(point) {
    const first = this.corners[0];
    if (first && this.corners.length > 2 && Math.hypot(point.x - first.x, point.y - first.y) * this.view.picture.zoom < 10) {
      this.closePolygon(false);
      return;
    }
    this.corners.push(point);
    this.drawPath(point);
  }

  drawPath(point) {
    this.path.visible(this.corners.length > 0);
    this.path.points([...this.corners, point].flatMap(({ x, y }) => [x, y]));
  }

  /** Fills the polygon, or cuts it out. */
  closePolygon(cutsOut) {
    if (this.view.tool !== "polygon" || this.corners.length < 3) return false;
    const canvas = new OffscreenCanvas(this.width, this.height);
    const context = canvas.getContext("2d");
    context.beginPath();
    for (const { x, y } of this.corners) context.lineTo(x + 0.5, y + 0.5);
    context.closePath();
    context.fill();
    const data = context.getImageData(0, 0, this.width, this.height).data;
    this.combine((index) => data[4 * index + 3] >= 128, cutsOut);
    this.cancelPolygon();
    return true;
  }

  /** Adds the pixels that `isIn` names, or cuts them out, as one step. */
  combine(isIn, cutsOut) {
    this.begin();
    for (let index = 0; index < this.pixels.length; index += 1) if (isIn(index)) this.pixels[index] = cutsOut ? 0 : 1;
    this.box = [0, 0, this.width - 1, this.height - 1];
    this.redraw(0, 0, this.width, this.height);
    this.end();
  }

  cancelPolygon() {
    const had = this.corners.length > 0;
    this.corners = [];
    this.path.visible(false);
    return had;
  }

  redraw(left, top, width, height) {
    const x = Math.max(0, left);
    const y = Math.max(0, top);
    const right = Math.min(this.width, left + width);
    const bottom = Math.min(this.height, top + height);
    if (right <= x || bottom <= y) return;
    const part = this.context.createImageData(right - x, bottom - y);
    const { pixels } = this;
    for (let row = y; row < bottom; row += 1) {
      for (let column = x; column < right; column += 1) {
        const index = row * this.width + column;
        if (!pixels[index]) continue;
        const isRim = column === 0 || row === 0 || column === this.width - 1 || row === this.height - 1 || !pixels[index - 1] || !pixels[index + 1] || !pixels[index - this.width] || !pixels[index + this.width];
        part.data.set(isRim ? RIM : INSIDE, 4 * ((row - y) * part.width + column - x));
      }
    }
    this.context.putImageData(part, x, y);
    this.view.picture.overlay.batchDraw();
  }

  /** Shows how many pixels the mask has, where it comes from, and whether it touches the frame's edge. */
  showState() {
    const { pixels, width, height } = this;
    let count = 0;
    for (let index = 0; index < pixels.length; index += 1) count += pixels[index];
    let touches = false;
    for (let column = 0; column < width; column += 1) touches ||= Boolean(pixels[column] || pixels[(height - 1) * width + column]);
    for (let row = 0; row < height; row += 1) touches ||= Boolean(pixels[row * width] || pixels[row * width + width - 1]);
    this.warning.hidden = !touches;
    const origin = this.isChanged ? "changed, not saved" : this.view.edits.has_mask ? "set on the page" : this.view.inputs.given.mask ? "from the catalogue" : count ? "estimated" : "none yet";
    this.state.textContent = `${count.toLocaleString("en")} pixels · ${origin}`;
    this.root.dataset.pixels = String(count);
  }

  /** Returns the mask as the base64 of a PNG, if it was changed. */
  async changes() {
    if (!this.isChanged) return {};
    const canvas = new OffscreenCanvas(this.width, this.height);
    const context = canvas.getContext("2d");
    const image = context.createImageData(this.width, this.height);
    for (let index = 0; index < this.pixels.length; index += 1) image.data.fill(this.pixels[index] ? 255 : 0, 4 * index, 4 * index + 3);
    for (let index = 3; index < image.data.length; index += 4) image.data[index] = 255;
    context.putImageData(image, 0, 0);
    const bytes = new Uint8Array(await (await canvas.convertToBlob({ type: "image/png" })).arrayBuffer());
    let text = "";
    for (let start = 0; start < bytes.length; start += 32768) text += String.fromCharCode(...bytes.subarray(start, start + 32768));
    return { mask: btoa(text) };
  }
}

function cut(pixels, width, [left, top, columns, rows]) {
  const part = new Uint8Array(columns * rows);
  for (let row = 0; row < rows; row += 1) {
    const start = (top + row) * width + left;
    part.set(pixels.subarray(start, start + columns), row * columns);
  }
  return part;
}

function paste(pixels, width, [left, top, columns, rows], part) {
  for (let row = 0; row < rows; row += 1) pixels.set(part.subarray(row * columns, (row + 1) * columns), (top + row) * width + left);
}
