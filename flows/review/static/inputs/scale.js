// The scale, as a line of known length or as the millimetres of a pixel.

import { POSITIVE, element, isEmptied, refuse, typedNumber } from "../dom.js";
import { Konva } from "../vendor.js";
import { EditedValue } from "./edited_value.js";

const LEAST_LINE_PX = 4;

export class ScaleLayer extends EditedValue {
  constructor(view) {
    super(view);
    this.line = new Konva.Line({ stroke: "#ff9be1", strokeWidth: 2, strokeScaleEnabled: false, visible: false, listening: false });
    view.picture.shapes.add(this.line);
    this.length = element("input", { type: "number", min: "0", step: "0.1", placeholder: "mm", "aria-label": "Length of the line in millimetres", onchange: () => this.typedLength() });
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
    this.found = inputs.used?.pixel_size ?? null;
    this.put(this.saved);
  }

  get size() {
    return this.value;
  }

  changes() {
    return this.isChanged ? { pixel_size: this.size } : {};
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
      this.earlier = this.line.points();
    }, { signal });
    container.addEventListener("pointermove", (event) => {
      if (!this.start) return;
      const end = this.view.picture.pointer(event);
      this.drawn([this.start.x, this.start.y, end.x, end.y]);
    }, { signal });
    container.addEventListener("pointercancel", () => this.ended(false), { signal });
    container.addEventListener("pointerup", () => this.ended(this.pixels * this.view.picture.zoom > LEAST_LINE_PX), { signal });
  }

  drawn(points) {
    this.line.points(points);
    this.toolChanged(this.view.tool);
    this.show();
  }

  /** Ends a line; one that is not taken gives way to the line before it. */
  ended(isTaken) {
    if (!this.start) return;
    this.start = null;
    if (isTaken) this.length.select();
    else this.drawn(this.earlier);
  }

  /** Takes the length of the line that is drawn. */
  typedLength() {
    const length = isEmptied(this.length) ? null : typedNumber(this.length, ...POSITIVE);
    if (length === null) this.show();
    else if (!this.pixels) refuse("Draw the line on the picture with Scale, or type the millimetres of a pixel.");
    else this.typed(Number((length / this.pixels).toPrecision(6)));
  }

  /** Takes the millimetres of a pixel; an empty field takes the edit back. */
  typedSize() {
    const isEmpty = isEmptied(this.perPixel);
    const size = isEmpty ? null : typedNumber(this.perPixel, ...POSITIVE);
    if (isEmpty || size !== null) this.typed(size);
    else this.show();
  }

  show() {
    const drawn = this.pixels ? `${this.pixels.toFixed(1)} pixels drawn · ` : "";
    const size = this.size ?? this.found;
    this.perPixel.value = this.size ?? "";
    this.length.value = this.pixels && size ? (this.pixels * size).toFixed(2) : "";
    const origin = this.isChanged ? "changed, not saved" : this.size ? "given" : "from a sphere's diameter";
    this.state.textContent = drawn + (size ? `${size.toPrecision(4)} mm per pixel, ${origin}` : "unknown: everything stays in pixels");
  }
}
