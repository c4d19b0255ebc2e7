// The camera's perspective, with its principal point on the picture, and the pose of the view, with a turntable's angle.

import { addressOf } from "../api.js";
import { POSITIVE, element, isEmptied, refuse, typedNumber, withdraw } from "../dom.js";
import { POSE_KINDS, TURN, kindOf, poseOf, turnBetween } from "../poses/pose.js";
import { Konva } from "../vendor.js";
import { EditedValue } from "./edited_value.js";

const COLOUR = "#b79bff";
const DIAGONAL_35MM = 43.27;
const MATRIX_RULE = "The matrix of a pose has four rows of four numbers: this one is not taken.";

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
    return [[fx, skew, rounded(x)], [0, fy, rounded(y)], [0, 0, 1]];
  }

  typedEquivalent() {
    if (isEmptied(this.equivalent)) return;
    const diagonal = Math.hypot(...this.view.inputs.frame_size);
    this.take(typedNumber(this.equivalent, ...POSITIVE), (length) => this.focused(rounded((length * diagonal) / DIAGONAL_35MM)));
    this.equivalent.value = "";
  }

  /** Takes the matrix that follows from a number, null for none. */
  take(value, matrixOf) {
    if (value === null) this.show();
    else this.typed(matrixOf(value));
  }

  show() {
    const { matrix } = this;
    this.focal.input.value = matrix ? String(rounded(matrix[0][0])) : "";
    this.centre.forEach(({ root, input }, number) => {
      root.hidden = !matrix;
      input.value = matrix ? String(rounded(matrix[number][2])) : "";
    });
    if (matrix) this.cross.position({ x: matrix[0][2], y: matrix[1][2] });
    this.cross.visible(this.view.tool === "camera" && matrix !== null);
    const angle = matrix && (2 * Math.atan(this.view.inputs.frame_size[0] / 2 / matrix[0][0]) * 180) / Math.PI;
    const origin = this.isChanged ? "changed, not saved" : this.origin;
    this.state.textContent = matrix ? `perspective, ${angle.toFixed(1)}° wide, ${origin}` : "not known: taken as orthographic, as from far away";
  }
}

export class PoseLayer extends EditedValue {
  constructor(view) {
    super(view);
    this.kind = element("select", { "aria-label": "How the pose is given", onchange: () => this.chosen() }, POSE_KINDS.map(([value, text]) => element("option", { value }, text)));
    this.angle = element("input", { type: "number", step: "any", "aria-label": "Degrees by which the object is turned, counter-clockwise from above", onchange: () => this.typedAngle() });
    this.turned = element("label", { class: "line" }, "Turned by", this.angle, "degrees");
    this.matrix = element("textarea", { rows: "4", "aria-label": "Matrix from camera to world, four rows of four numbers", spellcheck: "false", onchange: () => this.typedMatrix() });
    this.state = element("p", { class: "faint" });
    this.root = element("section", {}, element("h2", {}, "Pose of the view"), element("label", { class: "line" }, "Pose", this.kind), this.turned, this.matrix, this.state,
      element("a", { href: addressOf(view.capture.object, view.capture.capture, "poses") }, "All views of this object together"));
    const { width, height } = view.picture;
    this.radius = Math.min(width, height) / 5;
    this.table = new Konva.Ellipse({ x: width / 2, y: height / 2, radiusX: this.radius, radiusY: this.radius / 3, stroke: COLOUR, dash: [6, 5], strokeWidth: 1.5, strokeScaleEnabled: false, listening: false });
    this.axis = new Konva.Line({ points: [width / 2, height / 2 - this.radius, width / 2, height / 2 + this.radius], stroke: COLOUR, dash: [2, 5], strokeWidth: 1.5, strokeScaleEnabled: false, listening: false });
    this.handle = new Konva.Circle({ fill: COLOUR, stroke: "#111", strokeWidth: 1, strokeScaleEnabled: false, draggable: true });
    this.shapes = [this.table, this.axis, this.handle];
    view.picture.shapes.add(...this.shapes);
    this.handle.on("dragstart", () => (this.before = this.pose));
    this.handle.on("dragmove", () => this.dragged());
    this.handle.on("dragend", () => this.noted(this.before));
    view.picture.onzoom.push((zoom) => this.handle.radius(7 / zoom));
    this.reset();
  }

  reset() {
    const { edits, inputs } = this.view;
    this.origin = edits.pose ? "set on the page" : inputs.given.pose ? "from the catalogue" : "";
    this.saved = trimmed(edits.pose ?? inputs.given.pose ?? null);
    this.put(this.saved);
  }

  get pose() {
    return this.value;
  }

  changes() {
    return this.isChanged ? { pose: this.pose } : {};
  }

  toolChanged(tool) {
    for (const shape of this.shapes) shape.visible(tool === "camera" && this.pose?.turntable !== undefined);
  }

  chosen() {
    this.typed(poseOf(this.kind.value));
  }

  /** The mark goes round as the object's front does: counter-clockwise from above, 0 towards the camera. */
  dragged() {
    const x = (this.handle.x() - this.table.x()) / this.radius;
    const y = (this.handle.y() - this.table.y()) / (this.radius / 3);
    const turn = this.pose.turntable;
    const angle = (Math.atan2(x, y) * 180) / Math.PI;
    this.put({ turntable: rounded(turn + turnBetween(turn, angle)) });
  }

  show() {
    const turn = this.pose?.turntable;
    this.kind.value = kindOf(this.pose);
    if (turn !== undefined) {
      const angle = (turn * Math.PI) / 180;
      this.handle.position({ x: this.table.x() + this.radius * Math.sin(angle), y: this.table.y() + (this.radius / 3) * Math.cos(angle) });
      this.angle.value = String(turn);
    }
    const rows = this.pose?.camera_to_world;
    this.matrix.value = rows ? rows.map((row) => row.join(" ")).join("\n") : "";
    this.turned.hidden = turn === undefined;
    this.matrix.hidden = !rows;
    this.toolChanged(this.view.tool);
    this.state.textContent = this.isChanged ? "changed, not saved" : this.pose ? this.origin : "only objects with several views need it";
  }

  typedAngle() {
    const angle = typedNumber(this.angle, ...TURN);
    if (angle === null) this.show();
    else this.typed({ turntable: angle });
  }

  typedMatrix() {
    const rows = this.matrix.value.trim().split("\n").map((row) => row.trim().split(/[\s,]+/).map(Number));
    const isMatrix = rows.length === 4 && rows.every((row) => row.length === 4 && row.every(Number.isFinite));
    if (isMatrix) {
      withdraw(MATRIX_RULE);
      this.typed({ camera_to_world: rows });
    } else refuse(MATRIX_RULE);
  }
}

function rounded(value) {
  return Math.round(value * 100) / 100;
}

function trimmed(pose) {
  if (!pose) return null;
  return pose.camera_to_world ? { camera_to_world: pose.camera_to_world } : { turntable: pose.turntable };
}
