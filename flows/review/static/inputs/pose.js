// The pose of the view, with a turntable's angle on the picture.

import { addressOf } from "../api.js";
import { element, refuse, typedNumber, withdraw } from "../dom.js";
import { POSE_KINDS, TURN, kindOf, poseOf, turnBetween } from "../poses/pose.js";
import { hundredths } from "../rounding.js";
import { Konva } from "../vendor.js";
import { EditedValue } from "./edited_value.js";

const COLOUR = "#b79bff";
const MATRIX_RULE = "The matrix of a pose has four rows of four numbers: this one is not taken.";

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
    this.put({ turntable: hundredths(turn + turnBetween(turn, angle)) });
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

function trimmed(pose) {
  if (!pose) return null;
  return pose.camera_to_world ? { camera_to_world: pose.camera_to_world } : { turntable: pose.turntable };
}
