// The camera's perspective, with its principal point on the picture.

import { POSITIVE, element, isEmptied, typedNumber } from "../dom.js";
import { hundredths } from "../rounding.js";
import { Konva } from "../vendor.js";
import { EditedValue } from "./edited_value.js";

const COLOUR = "#b79bff";
const DIAGONAL_35MM = 43.27;

export class CameraLayer extends EditedValue {
  constructor(view) {
    super(view);
    this.cross = new Konva.Path({ data: "M-9 0H9M0 -9V9", stroke: COLOUR, strokeWidth: 2, strokeScaleEnabled: false, visible: false, draggable: true, hitStrokeWidth: 16 });
    view.picture.shapes.add(this.cross);
    this.cross.on("dragstart", () => (this.before = this.matrix));
    this.cross.on("dragmove", () => this.put(this.centred(this.cross.x(), this.cross.y())));
    this.cross.on("dragend", () => this.noted(this.before));
    const field = (text, name, taken) => {
      const input = element("input", { type: "number", step: "any", placeholder: "px", "aria-label": name, onchange: () => taken(input) });
      return { input, root: element("label", {}, text, input) };
    };
    this.focal = field("f", "Focal length in pixels", (input) => this.take(typedNumber(input, ...POSITIVE), (value) => this.focused(value)));
    const centred = (number, value) => this.centred(...[this.matrix[0][2], this.matrix[1][2]].with(number, value));
    this.centre = ["x", "y"].map((axis, number) => field(`c${axis}`, `Principal point: ${axis}`, (input) => this.take(typedNumber(input), (value) => centred(number, value))));
    this.fields = element("div", { class: "fields" }, this.focal.root, this.centre.map(({ root }) => root));
    this.equivalent = element("input", { type: "number", min: "1", step: "0.5", placeholder: "mm", "aria-label": "Focal length as of a 35 mm camera, in millimetres", onchange: () => this.typedEquivalent() });
    this.state = element("p", { class: "faint" });
    this.root = element("section", {}, element("h2", {}, "Camera"), this.fields, element("label", { class: "line" }, "As of a 35 mm camera", this.equivalent), this.state);
    view.picture.onzoom.push(() => this.cross.scale({ x: 1 / view.picture.zoom, y: 1 / view.picture.zoom }));
    this.reset();
  }

  reset() {
    const { edits, inputs } = this.view;
    this.origin = edits.camera ? "set on the page" : "from the catalogue";
    this.saved = (edits.camera ?? inputs.given.camera)?.matrix ?? null;
    this.put(this.saved);
  }

  get matrix() {
    return this.value;
  }

  changes() {
    return this.isChanged ? { camera: this.matrix && { matrix: this.matrix } } : {};
  }

  toolChanged(tool) {
    this.cross.visible(tool === "camera" && this.matrix !== null);
  }

  /** Returns the matrix of a focal length in pixels: pixels stay as wide and high as they are known to be. */
  focused(focal) {
    const [width, height] = this.view.inputs.frame_size;
    const [[fx, skew, cx], [, fy, cy]] = this.matrix ?? [[1, 0, (width - 1) / 2], [0, 1, (height - 1) / 2]];
    return [[focal, (skew * focal) / fx, cx], [0, (fy * focal) / fx, cy], [0, 0, 1]];
  }

  centred(x, y) {
    const [[fx, skew], [, fy]] = this.matrix;
    return [[fx, skew, hundredths(x)], [0, fy, hundredths(y)], [0, 0, 1]];
  }

  typedEquivalent() {
    if (isEmptied(this.equivalent)) return;
    const diagonal = Math.hypot(...this.view.inputs.frame_size);
    this.take(typedNumber(this.equivalent, ...POSITIVE), (length) => this.focused(hundredths((length * diagonal) / DIAGONAL_35MM)));
    this.equivalent.value = "";
  }

  /** Takes the matrix that follows from a number, null for none. */
  take(value, matrixOf) {
    if (value === null) this.show();
    else this.typed(matrixOf(value));
  }

  show() {
    const { matrix } = this;
    this.focal.input.value = matrix ? String(hundredths(matrix[0][0])) : "";
    this.centre.forEach(({ root, input }, number) => {
      root.hidden = !matrix;
      input.value = matrix ? String(hundredths(matrix[number][2])) : "";
    });
    if (matrix) this.cross.position({ x: matrix[0][2], y: matrix[1][2] });
    this.cross.visible(this.view.tool === "camera" && matrix !== null);
    const angle = matrix && (2 * Math.atan(this.view.inputs.frame_size[0] / 2 / matrix[0][0]) * 180) / Math.PI;
    const origin = this.isChanged ? "changed, not saved" : this.origin;
    this.state.textContent = matrix ? `perspective, ${angle.toFixed(1)}° wide, ${origin}` : "not known: taken as orthographic, as from far away";
  }
}
