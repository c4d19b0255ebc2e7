// The region's rectangle, and the scale as a line of known length.

import { POSITIVE, announce, element, isEmptied, typedNumber, withdraw } from "../dom.js";
import { Konva } from "../vendor.js";

const COLOUR = "#e7b45a";
const REFUSED = "The region cannot have";
const FIELDS = [["x", "x"], ["y", "y"], ["width", "w"], ["height", "h"]];

export class RegionLayer {
  constructor(view) {
    this.view = view;
    this.rectangle = new Konva.Rect({ stroke: COLOUR, strokeWidth: 1.5, dash: [8, 6], strokeScaleEnabled: false, listening: false });
    this.handles = ["left top", "right top", "left bottom", "right bottom"].map((corner) => new Konva.Circle({ fill: COLOUR, stroke: "#111", strokeWidth: 1, strokeScaleEnabled: false, draggable: true, visible: false, name: corner }));
    view.picture.shapes.add(this.rectangle, ...this.handles);
    this.handles.forEach((handle) => {
      handle.on("dragstart", () => (this.before = { ...this.region }));
      handle.on("dragmove", () => this.dragged(handle));
      handle.on("dragend", () => this.noted(this.before));
    });
    this.inputs = FIELDS.map(([name]) => element("input", { type: "number", step: "1", min: "0", "aria-label": `Region: ${name}`, onchange: (event) => this.typed(name, typedNumber(event.target)) }));
    this.fields = element("div", { class: "fields" }, FIELDS.map(([, text], i) => element("label", {}, text, this.inputs[i])));
    this.state = element("p", { class: "faint" });
    this.root = element("section", {}, element("h2", {}, "Region"), this.fields, this.state);
    view.picture.onzoom.push(() => this.rescale());
    this.reset();
  }

  reset() {
    const { edits, inputs } = this.view;
    this.origin = edits.region ? "set on the page" : inputs.given.region ? "from the catalogue" : inputs.used ? "found around the object" : "found when it runs";
    this.saved = edits.region ?? inputs.given.region ?? inputs.used?.region ?? null;
    this.region = this.saved && { ...this.saved };
    this.draw();
  }

  get isChanged() {
    return JSON.stringify(this.region) !== JSON.stringify(this.saved);
  }

  changes() {
    return this.isChanged ? { region: this.region } : {};
  }

  toolChanged(tool) {
    const [width, height] = this.view.inputs.frame_size;
    // Something to drag; as long as nobody does, it is no change.
    if (tool === "region" && !this.region) [this.region, this.saved] = [0, 1].map(() => ({ x: 0, y: 0, width, height }));
    for (const handle of this.handles) handle.visible(tool === "region");
    this.draw();
  }

  dragged(handle) {
    const [width, height] = this.view.inputs.frame_size;
    const name = handle.name();
    const { region } = this;
    const right = region.x + region.width;
    const bottom = region.y + region.height;
    const x = Math.max(0, Math.min(width, Math.round(handle.x() + 0.5)));
    const y = Math.max(0, Math.min(height, Math.round(handle.y() + 0.5)));
    if (name.includes("left")) { region.x = Math.min(x, right - 1); region.width = right - region.x; } else region.width = Math.max(1, x - region.x);
    if (name.includes("top")) { region.y = Math.min(y, bottom - 1); region.height = bottom - region.y; } else region.height = Math.max(1, y - region.y);
    this.draw();
  }

  noted(before) {
    const after = { ...this.region };
    const put = (region) => { this.region = { ...region }; this.draw(); };
    this.view.history.add({ undo: () => put(before), redo: () => put(after) });
  }

  draw() {
    const { region } = this;
    this.rectangle.visible(Boolean(region));
    this.state.textContent = this.isChanged ? "changed, not saved" : this.origin;
    this.fields.hidden = !region;
    if (!region) return;
    this.rectangle.setAttrs({ x: region.x - 0.5, y: region.y - 0.5, width: region.width, height: region.height });
    for (const handle of this.handles) {
      const name = handle.name();
      handle.position({ x: region.x - 0.5 + (name.includes("right") ? region.width : 0), y: region.y - 0.5 + (name.includes("bottom") ? region.height : 0) });
    }
    FIELDS.forEach(([name], i) => (this.inputs[i].value = String(region[name])));
    this.rescale();
  }

  /** Takes a number that was typed into a field, null for none. */
  typed(name, value) {
    if (value === null) return this.draw();
    const [width, height] = this.view.inputs.frame_size;
    const next = { ...this.region, [name]: Math.round(value) };
    const fits = next.x >= 0 && next.y >= 0 && next.width > 0 && next.height > 0 && next.x + next.width <= width && next.y + next.height <= height;
    if (fits) {
      const before = { ...this.region };
      withdraw(REFUSED);
      this.region = next;
      this.noted(before);
    } else announce(`${REFUSED} ${name} ${value}: it must lie in the frame of ${width} x ${height} pixels.`, "error");
    this.draw();
  }

  rescale() {
    for (const handle of this.handles) handle.radius(6 / this.view.picture.zoom);
  }
}

export class ScaleLayer {
  constructor(view) {
    this.view = view;
    this.line = new Konva.Line({ stroke: "#ff9be1", strokeWidth: 2, strokeScaleEnabled: false, visible: false, listening: false });
    view.picture.shapes.add(this.line);
    this.length = element("input", { type: "number", min: "0", step: "0.1", placeholder: "mm", "aria-label": "Length of the line in millimetres", onchange: () => this.typed() });
    this.perPixel = element("input", { type: "number", min: "0", step: "any", placeholder: "mm", "aria-label": "Millimetres of a pixel", onchange: () => this.typedSize() });
    this.state = element("p", { class: "faint" });
    this.root = element("section", {}, element("h2", {}, "Scale"),
      element("label", { class: "line" }, "The line is", this.length, "mm long"),
      element("label", { class: "line" }, "A pixel is", this.perPixel, "mm"), this.state);
    this.drawByPointer();
    this.reset();
  }

  reset() {
    const { edits, inputs } = this.view;
    this.saved = edits.pixel_size ?? inputs.given.pixel_size ?? null;
    this.size = this.saved;
    this.found = inputs.used?.pixel_size ?? null;
    this.show();
  }

  changes() {
    return this.size !== this.saved ? { pixel_size: this.size } : {};
  }

  toolChanged(tool) {
    this.line.visible(tool === "scale" && this.pixels > 0);
  }

  get pixels() {
    const [x1, y1, x2, y2] = this.line.points();
    return this.line.points().length === 4 ? Math.hypot(x2 - x1, y2 - y1) : 0;
  }

  drawByPointer() {
    const { container } = this.view.picture;
    const { signal } = this.view;
    container.addEventListener("pointerdown", (event) => {
      if (this.view.tool !== "scale" || event.button !== 0) return;
      container.setPointerCapture(event.pointerId);
      this.start = this.view.picture.pointer(event);
    }, { signal });
    container.addEventListener("pointermove", (event) => {
      if (!this.start) return;
      this.isDrawn = true;
      const end = this.view.picture.pointer(event);
      this.line.setAttrs({ points: [this.start.x, this.start.y, end.x, end.y], visible: true });
      this.show();
    }, { signal });
    container.addEventListener("pointercancel", () => (this.start = this.isDrawn = null), { signal });
    container.addEventListener("pointerup", () => {
      if (this.isDrawn) this.length.focus();
      this.start = this.isDrawn = null;
    }, { signal });
  }

  typed() {
    if (isEmptied(this.length)) return;
    const length = typedNumber(this.length, ...POSITIVE);
    if (length === null) this.length.value = "";
    else if (!this.pixels) announce("Draw the line on the picture with Scale, or type the millimetres of a pixel.", "error");
    else this.set(Number((length / this.pixels).toPrecision(6)));
  }

  /** Takes the millimetres of a pixel; an empty field takes the edit back. */
  typedSize() {
    const isEmpty = isEmptied(this.perPixel);
    const size = isEmpty ? null : typedNumber(this.perPixel, ...POSITIVE);
    if (isEmpty || size !== null) this.set(size);
    else this.show();
  }

  set(after) {
    const before = this.size;
    if (after === before) return this.show();
    const put = (size) => { this.size = size; this.show(); };
    put(after);
    this.view.history.add({ undo: () => put(before), redo: () => put(after) });
  }

  show() {
    const drawn = this.pixels ? `${this.pixels.toFixed(1)} pixels drawn · ` : "";
    const size = this.size ?? this.found;
    this.perPixel.value = this.size ?? "";
    const origin = this.size !== this.saved ? "changed, not saved" : this.size ? "given" : "from a sphere's diameter";
    this.state.textContent = drawn + (size ? `${size.toPrecision(4)} mm per pixel, ${origin}` : "unknown: everything stays in pixels");
  }
}
