// The region's rectangle.

import { element, refuse, typedNumber, withdraw } from "../dom.js";
import { Konva } from "../vendor.js";
import { EditedValue } from "./edited_value.js";

const COLOUR = "#e7b45a";
const REFUSED = "The region cannot have";
const FIELDS = [["x", "x"], ["y", "y"], ["width", "w"], ["height", "h"]];

export class RegionLayer extends EditedValue {
  constructor(view) {
    super(view);
    this.rectangle = new Konva.Rect({ stroke: COLOUR, strokeWidth: 1.5, dash: [8, 6], strokeScaleEnabled: false, listening: false });
    this.handles = ["left top", "right top", "left bottom", "right bottom"].map((corner) => new Konva.Circle({ fill: COLOUR, stroke: "#111", strokeWidth: 1, strokeScaleEnabled: false, draggable: true, visible: false, name: corner }));
    view.picture.shapes.add(this.rectangle, ...this.handles);
    this.handles.forEach((handle) => {
      handle.on("dragstart", () => (this.before = this.region));
      handle.on("dragmove", () => this.dragged(handle));
      handle.on("dragend", () => this.noted(this.before));
    });
    this.inputs = FIELDS.map(([name]) => element("input", { type: "number", step: "1", min: "0", "aria-label": `Region: ${name}`, onchange: (event) => this.typedSide(name, typedNumber(event.target)) }));
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
    this.put(this.saved);
  }

  get region() {
    return this.value;
  }

  changes() {
    return this.isChanged ? { region: this.region } : {};
  }

  toolChanged(tool) {
    const [width, height] = this.view.inputs.frame_size;
    // Something to drag; as long as nobody does, it is no change.
    if (tool === "region" && !this.region) this.value = this.saved = { x: 0, y: 0, width, height };
    for (const handle of this.handles) handle.visible(tool === "region");
    this.show();
  }

  dragged(handle) {
    const [width, height] = this.view.inputs.frame_size;
    const name = handle.name();
    const { x: left, y: top, width: across, height: down } = this.region;
    const right = left + across;
    const bottom = top + down;
    const x = Math.max(0, Math.min(width, Math.round(handle.x() + 0.5)));
    const y = Math.max(0, Math.min(height, Math.round(handle.y() + 0.5)));
    const [x0, x1] = name.includes("left") ? [Math.min(x, right - 1), right] : [left, Math.max(left + 1, x)];
    const [y0, y1] = name.includes("top") ? [Math.min(y, bottom - 1), bottom] : [top, Math.max(top + 1, y)];
    this.put({ x: x0, y: y0, width: x1 - x0, height: y1 - y0 });
  }

  show() {
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
  typedSide(name, value) {
    if (value === null) return this.show();
    const [width, height] = this.view.inputs.frame_size;
    const next = { ...this.region, [name]: Math.round(value) };
    const fits = next.x >= 0 && next.y >= 0 && next.width > 0 && next.height > 0 && next.x + next.width <= width && next.y + next.height <= height;
    if (fits) {
      withdraw(REFUSED);
      this.typed(next);
      return;
    }
    refuse(`${REFUSED} ${name} ${value}: it must lie in the frame of ${width} x ${height} pixels.`);
    this.show();
  }

  rescale() {
    for (const handle of this.handles) handle.radius(6 / this.view.picture.zoom);
  }
}
