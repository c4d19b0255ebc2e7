// Chrome spheres: circles with a handle; when one is let go, the server measures the contour near it.

import { ask } from "../api.js";
import { announceError, element } from "../dom.js";
import { hundredths } from "../rounding.js";
import { Konva } from "../vendor.js";
import { isSame } from "./edited_value.js";
import { LEAST_RADIUS_PX, SphereList } from "./sphere_list.js";

const COLOUR = "#7db7ff";
const CHOSEN = "#ffd27a";
const FIT = "#8fd6a5";
const NEW_RADIUS_SHARE = 0.08;
const NUDGE_PX = 0.5;
const REST_MS = 400;
/** Radius of a handle, and the width of the ring around a line in which it is taken, in pixels of the screen. */
const HANDLE_PX = 7;
const HIT_PX = 12;

export class SphereLayer {
  constructor(view) {
    this.view = view;
    this.chosen = 0;
    this.group = new Konva.Group();
    view.picture.shapes.add(this.group);
    this.root = element("section", {}, element("h2", {}, "Chrome spheres"));
    this.list = new SphereList(this);
    this.root.append(this.list.root);
    this.reset();
    view.picture.onzoom.push(() => this.rescale());
  }

  /** Takes the spheres of the edits, else of the catalogue, else those that were found. */
  reset() {
    const { edits, inputs } = this.view;
    const used = inputs.used?.spheres ?? [];
    const given = edits.spheres ?? inputs.given.spheres;
    this.origin = edits.spheres ? "set on the page" : given.length ? "from the catalogue" : used.length ? "found in the video" : "";
    this.saved = (given.length ? given : used).map(({ x, y, radius, diameter_mm }) => ({ x, y, radius, diameter_mm: diameter_mm ?? null }));
    this.spheres = this.saved.map((sphere) => ({ ...sphere }));
    this.fits = new Map();
    this.draw();
  }

  get isChanged() {
    return !isSame(this.spheres, this.saved);
  }

  changes() {
    if (!this.isChanged) return {};
    return {
      spheres: this.spheres.map(({ x, y, radius, diameter_mm }) => ({ x: hundredths(x), y: hundredths(y), radius: hundredths(radius), ...(diameter_mm ? { diameter_mm } : {}) })),
    };
  }

  toolChanged(tool) {
    this.group.listening(tool === "spheres");
    this.draw();
  }

  draw() {
    this.group.destroyChildren();
    this.spheres.forEach((sphere, number) => {
      this.drawFit(number);
      this.drawCircle(sphere, number);
    });
    this.list.show(this.isChanged ? "changed, not saved" : this.origin);
    this.rescale();
  }

  drawCircle(sphere, number) {
    const isChosen = number === this.chosen && this.view.tool === "spheres";
    const stroke = isChosen ? CHOSEN : COLOUR;
    const circle = new Konva.Circle({ x: sphere.x, y: sphere.y, radius: sphere.radius, stroke, strokeWidth: 2, strokeScaleEnabled: false, draggable: true, fill: "rgba(125,183,255,0.06)" });
    const cross = [[-1, 0, 1, 0], [0, -1, 0, 1]].map((points) => new Konva.Line({ x: sphere.x, y: sphere.y, points, stroke, strokeWidth: 1, strokeScaleEnabled: false, name: "cross", listening: false }));
    const handle = new Konva.Circle({ x: sphere.x + sphere.radius, y: sphere.y, radius: 1, fill: stroke, stroke: "#111", strokeWidth: 1, strokeScaleEnabled: false, draggable: true, name: "handle" });
    const before = { ...sphere };
    const follow = () => {
      circle.setAttrs({ x: sphere.x, y: sphere.y, radius: sphere.radius });
      handle.position({ x: sphere.x + sphere.radius, y: sphere.y });
      for (const line of cross) line.position({ x: sphere.x, y: sphere.y });
    };
    circle.on("dragstart", () => (this.chosen = number));
    circle.on("dragmove", () => { sphere.x = circle.x(); sphere.y = circle.y(); this.fits.delete(number); follow(); });
    handle.on("dragmove", () => {
      sphere.radius = Math.max(LEAST_RADIUS_PX, Math.hypot(handle.x() - sphere.x, handle.y() - sphere.y));
      circle.radius(sphere.radius);
      this.fits.delete(number);
    });
    for (const shape of [circle, handle]) shape.on("dragend", () => this.moved(number, before));
    circle.on("click tap", () => { this.chosen = number; if (this.view.tool === "spheres") this.draw(); });
    this.group.add(circle, ...cross, handle);
  }

  drawFit(number) {
    const fit = this.fits.get(number);
    if (!fit || !fit.is_clear) return;
    this.group.add(new Konva.Circle({ x: fit.x, y: fit.y, radius: fit.radius, stroke: FIT, strokeWidth: 2, dash: [6, 5], strokeScaleEnabled: false, listening: false }));
  }

  rescale() {
    const zoom = this.view.picture.zoom;
    for (const handle of this.group.find(".handle")) handle.radius(HANDLE_PX / zoom);
    for (const cross of this.group.find(".cross")) cross.scale({ x: 6 / zoom, y: 6 / zoom });
    for (const shape of this.group.find("Circle")) shape.hitStrokeWidth(HIT_PX);
    // A small circle is taken by its middle, which the handle must leave free.
    this.group.find(".handle").forEach((handle, number) => handle.hitStrokeWidth(Math.max(0, Math.min(HIT_PX, 2 * (this.spheres[number].radius * zoom - HANDLE_PX) - HIT_PX))));
  }

  moved(number, before) {
    const after = { ...this.spheres[number] };
    const put = (sphere) => { this.spheres[number] = { ...sphere }; this.fits.delete(number); this.draw(); };
    if (!isSame(before, after)) this.view.history.add({ undo: () => put(before), redo: () => put(after) });
    this.measure(number);
  }

  async measure(number) {
    const sphere = this.spheres[number];
    if (!sphere) return;
    this.fits.set(number, null);
    this.draw();
    try {
      const { x, y, radius } = sphere;
      const fit = await ask(`${this.view.capture.path}/sphere-fit`, { method: "POST", body: { x, y, radius }, signal: this.view.signal });
      if (this.spheres[number] !== sphere || sphere.x !== x || sphere.y !== y || sphere.radius !== radius) return;
      this.fits.set(number, fit);
    } catch (error) {
      this.fits.delete(number);
      announceError(error);
    }
    this.draw();
  }

  take(number) {
    const before = { ...this.spheres[number] };
    const fit = this.fits.get(number);
    this.spheres[number] = { ...before, x: fit.x, y: fit.y, radius: fit.radius };
    this.moved(number, before);
  }

  add(point) {
    const radius = NEW_RADIUS_SHARE * Math.max(this.view.picture.width, this.view.picture.height);
    this.replace([...this.spheres, { x: point.x, y: point.y, radius, diameter_mm: null }]);
    this.chosen = this.spheres.length - 1;
    this.view.use("spheres");
    this.measure(this.chosen);
  }

  removeChosen() {
    if (this.view.tool === "spheres" && this.spheres.length) this.remove(this.chosen);
  }

  remove(removed) {
    this.finish();
    this.replace(this.spheres.filter((_, number) => number !== removed));
    this.chosen = 0;
    this.draw();
  }

  replace(after) {
    this.finish();
    const before = this.spheres;
    // Copies: what is moved later is moved in place, and must not move what undo brings back.
    const put = (spheres) => { this.spheres = spheres.map((sphere) => ({ ...sphere })); this.fits.clear(); this.draw(); };
    put(after);
    this.view.history.add({ undo: () => put(before), redo: () => put(after) });
  }

  nudge(x, y) {
    const sphere = this.spheres[this.chosen];
    if (!sphere) return false;
    const before = { ...sphere };
    sphere.x += x * NUDGE_PX;
    sphere.y += y * NUDGE_PX;
    this.settle(before);
    return true;
  }

  grow(by) {
    const sphere = this.spheres[this.chosen];
    if (!sphere) return;
    const before = { ...sphere };
    sphere.radius = Math.max(LEAST_RADIUS_PX, sphere.radius + by * NUDGE_PX);
    this.settle(before);
  }

  /** Draws at once, and measures when the keys rest. */
  settle(before) {
    if (this.pending?.number !== this.chosen) this.finish();
    this.pending ??= { number: this.chosen, before };
    this.fits.delete(this.chosen);
    this.draw();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.finish(), REST_MS);
  }

  /** Notes what the keys have moved as one step. */
  finish() {
    clearTimeout(this.timer);
    const { pending } = this;
    this.pending = null;
    if (pending) this.moved(pending.number, pending.before);
  }

  fitChosen() {
    if (this.view.tool === "spheres" && this.spheres[this.chosen]) this.measure(this.chosen);
  }
}
