// The picture: a Konva stage in pixels of the full frame, zoomed around the pointer and moved by dragging, or by two
// fingers.
//
// The centre of the top-left pixel is (0, 0), so the picture itself begins at (-0.5, -0.5).

import { askPicture, newest, NO_ANSWER } from "../api.js";
import { ANSWERS } from "../connection.js";
import { announceError } from "../dom.js";
import { Konva } from "../vendor.js";
import { followFingers } from "./fingers.js";

const MAX_ZOOM = 8;
const CLICK_PX = 4;

export class Picture {
  constructor(container, [width, height], signal) {
    Object.assign(this, { container, width, height, pans: true, onclick: null, onzoom: [], signal, begin: newest() });
    this.stage = new Konva.Stage({ container, width: 10, height: 10 });
    this.ground = new Konva.Layer({ listening: false, imageSmoothingEnabled: false });
    this.overlay = new Konva.Layer({ listening: false, imageSmoothingEnabled: false });
    this.shapes = new Konva.Layer();
    this.stage.add(this.ground, this.overlay, this.shapes);
    this.image = new Konva.Image({ x: -0.5, y: -0.5, width, height, image: undefined });
    this.ground.add(this.image);
    this.followPointer(signal);
    const observer = new ResizeObserver(() => this.resize());
    observer.observe(container);
    signal.addEventListener("abort", () => {
      observer.disconnect();
      this.stage.destroy();
    });
    addEventListener(ANSWERS, () => this.missed && this.show(this.missed), { signal });
    this.resize();
    this.fit();
  }

  get zoom() {
    return this.stage.scaleX();
  }

  /** Loads a picture and shows it, or announces why it cannot, unless another one was asked for meanwhile.
   *
   *  Returns whether it is shown; undefined where that is open: another one was asked for, or the server is looked for. */
  async show(address) {
    const isNewest = this.begin();
    this.missed = null;
    try {
      const bitmap = await createImageBitmap(await askPicture(address, this.signal));
      if (!isNewest()) {
        bitmap.close();
        return undefined;
      }
      this.image.image()?.close();
      this.image.image(bitmap);
      this.container.dataset.shown = address;
      return true;
    } catch (error) {
      if (!isNewest()) return undefined;
      announceError(error);
      if (error.status !== NO_ANSWER) return false;
      this.missed = address;
      return undefined;
    }
  }

  resize() {
    const { clientWidth, clientHeight } = this.container;
    if (!clientWidth || !clientHeight) return;
    const isFitted = this.isFitted;
    this.stage.size({ width: clientWidth, height: clientHeight });
    if (isFitted) this.fit();
  }

  /** Shows the whole picture. */
  fit() {
    const scale = Math.min(this.stage.width() / this.width, this.stage.height() / this.height, MAX_ZOOM) * 0.98;
    this.smallest = Math.min(scale, 1);
    this.place(scale, (this.stage.width() - this.width * scale) / 2 + 0.5 * scale, (this.stage.height() - this.height * scale) / 2 + 0.5 * scale);
    this.isFitted = true;
  }

  zoomBy(factor, at = { x: this.stage.width() / 2, y: this.stage.height() / 2 }) {
    const scale = Math.max(this.smallest / 2, Math.min(MAX_ZOOM, this.zoom * factor));
    const ratio = scale / this.zoom;
    this.place(scale, at.x - (at.x - this.stage.x()) * ratio, at.y - (at.y - this.stage.y()) * ratio);
  }

  move(x, y) {
    this.place(this.zoom, this.stage.x() + x, this.stage.y() + y);
  }

  /** Moves the picture if a pixel of the full frame lies outside what is shown, so that it is in the middle. */
  reveal({ x, y }) {
    const [left, top] = [this.stage.x() + x * this.zoom, this.stage.y() + y * this.zoom];
    if (left >= 0 && top >= 0 && left <= this.stage.width() && top <= this.stage.height()) return;
    this.move(this.stage.width() / 2 - left, this.stage.height() / 2 - top);
  }

  place(scale, x, y) {
    this.isFitted = false;
    this.stage.setAttrs({ scaleX: scale, scaleY: scale, x, y });
    for (const listener of this.onzoom) listener(scale);
  }

  /** Returns the pixel of the full frame in the middle of what is shown. */
  centre() {
    return this.at(this.stage.width() / 2, this.stage.height() / 2);
  }

  at(x, y) {
    return { x: (x - this.stage.x()) / this.zoom, y: (y - this.stage.y()) / this.zoom };
  }

  /** Returns the pixel of the full frame under the pointer. */
  pointer(event) {
    const box = this.container.getBoundingClientRect();
    return this.at(event.clientX - box.left, event.clientY - box.top);
  }

  followPointer(signal) {
    this.container.addEventListener("wheel", (event) => {
      event.preventDefault();
      const box = this.container.getBoundingClientRect();
      this.zoomBy(Math.exp(-event.deltaY * 0.0015), { x: event.clientX - box.left, y: event.clientY - box.top });
    }, { signal, passive: false });
    followFingers(this, signal);
    let start = null;
    this.container.addEventListener("pointercancel", () => (start = null), { signal });
    this.container.addEventListener("pointerdown", (event) => {
      // Konva prevents what would take the keys away from a field that was filled in before.
      this.container.focus({ preventScroll: true });
      const isShape = this.stage.getIntersection(this.offset(event)) !== null;
      const pans = event.button === 1 || (event.button === 0 && this.pans && !isShape);
      start = { x: event.clientX, y: event.clientY, stageX: this.stage.x(), stageY: this.stage.y(), pans, moved: false };
    }, { signal });
    addEventListener("pointermove", (event) => {
      if (!start) return;
      const x = event.clientX - start.x;
      const y = event.clientY - start.y;
      if (Math.hypot(x, y) > CLICK_PX) start.moved = true;
      if (start.pans && start.moved) this.place(this.zoom, start.stageX + x, start.stageY + y);
    }, { signal });
    addEventListener("pointerup", () => (start = start && { ...start, pans: false }), { signal });
    this.container.addEventListener("click", (event) => {
      if (start && !start.moved && this.onclick) this.onclick(this.pointer(event), event);
      start = null;
    }, { signal });
  }

  offset(event) {
    const box = this.container.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  }
}
