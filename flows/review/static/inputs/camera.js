// The camera's perspective, with its principal point on the picture, and the pose of the view, with a turntable's angle.

import { addressOf } from "../api.js";
import { element } from "../dom.js";
import { POSE_KINDS, kindOf, poseOf, turnBetween } from "../poses/pose.js";
import { Konva } from "../vendor.js";
import { EditedValue } from "./edited_value.js";

const COLOUR = "#b79bff";
const DIAGONAL_35MM = 43.27;
const MAX_TURN_DEG = 36000;

export class CameraLayer extends EditedValue {
  constructor(view) {
    super(view);
    this.cross = new Konva.Path({ data: "M-9 0H9M0 -9V9", stroke: COLOUR, strokeWidth: 2, strokeScaleEnabled: false, visible: false, draggable: true, hitStrokeWidth: 16 });
    view.picture.shapes.add(this.cross);
    this.cross.on("dragstart", () => (this.before = this.matrix));
    this.cross.on("dragmove", () => this.put(this.centred(this.cross.x(), this.cross.y())));
    this.cross.on("dragend", () => this.noted(this.before));
    this.fields = element("div", { class: "fields" });
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
    const length = Number(this.equivalent.value);
    const diagonal = Math.hypot(...this.view.inputs.frame_size);
    if (length > 0) this.typed(this.focused(rounded((length * diagonal) / DIAGONAL_35MM)));
  }

  show() {
    const { matrix } = this;
    const entries = [["f", "Focal length in pixels", matrix?.[0][0], (value) => value > 0 && this.focused(value)]];
    if (matrix) {
      entries.push(["cx", "Principal point: x", matrix[0][2], (value) => this.centred(value, matrix[1][2])]);
      entries.push(["cy", "Principal point: y", matrix[1][2], (value) => this.centred(matrix[0][2], value)]);
      this.cross.position({ x: matrix[0][2], y: matrix[1][2] });
    }
    this.cross.visible(this.view.tool === "camera" && matrix !== null);
    this.fields.replaceChildren(...entries.map(([text, name, value, changed]) => element("label", {}, text, element("input", {
      type: "number", step: "any", value: value === undefined ? "" : String(rounded(value)), placeholder: "px", "aria-label": name,
      onchange: (event) => {
        const next = event.target.value !== "" && Number.isFinite(Number(event.target.value)) && changed(Number(event.target.value));
        if (next) this.typed(next);
        else this.show();
      },
    }))));
    this.equivalent.value = "";
    const angle = matrix && (2 * Math.atan(this.view.inputs.frame_size[0] / 2 / matrix[0][0]) * 180) / Math.PI;
    const origin = this.isChanged ? "changed, not saved" : this.origin;
    this.state.textContent = matrix ? `perspective, ${angle.toFixed(1)}° wide, ${origin}` : "not known: taken as orthographic, as from far away";
  }
}

export class PoseLayer extends EditedValue {
  constructor(view) {
    super(view);
    this.kind = element("select", { "aria-label": "How the pose is given", onchange: () => this.chosen() }, POSE_KINDS.map(([value, text]) => element("option", { value }, text)));
    this.field = element("div", {});
    this.state = element("p", { class: "faint" });
    this.root = element("section", {}, element("h2", {}, "Pose of the view"), element("label", { class: "line" }, "Pose", this.kind), this.field, this.state,
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
      this.field.replaceChildren(element("label", { class: "line" }, "Turned by", element("input", {
        type: "number", step: "any", value: String(turn), "aria-label": "Degrees by which the object is turned, counter-clockwise from above",
        onchange: (event) => this.typed({ turntable: Math.max(-MAX_TURN_DEG, Math.min(MAX_TURN_DEG, Number(event.target.value) || 0)) }),
      }), "degrees"));
    } else if (this.pose) {
      this.field.replaceChildren(element("textarea", {
        rows: "4", "aria-label": "Matrix from camera to world, four rows of four numbers", spellcheck: "false",
        onchange: (event) => this.typedMatrix(event.target.value),
      }, this.pose.camera_to_world.map((row) => row.join(" ")).join("\n")));
    } else this.field.replaceChildren();
    this.toolChanged(this.view.tool);
    this.state.textContent = this.isChanged ? "changed, not saved" : this.pose ? this.origin : "only objects with several views need it";
  }

  typedMatrix(text) {
    const rows = text.trim().split("\n").map((row) => row.trim().split(/[\s,]+/).map(Number));
    const isMatrix = rows.length === 4 && rows.every((row) => row.length === 4 && row.every(Number.isFinite));
    if (isMatrix) this.typed({ camera_to_world: rows });
    else this.state.textContent = "The matrix has four rows of four numbers.";
  }
}

function rounded(value) {
  return Math.round(value * 100) / 100;
}

function trimmed(pose) {
  if (!pose) return null;
  return pose.camera_to_world ? { camera_to_world: pose.camera_to_world } : { turntable: pose.turntable };
}
