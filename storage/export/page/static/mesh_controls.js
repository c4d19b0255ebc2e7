// A mesh with its controls: colour, confidence, section, measuring.

import { viewList } from "./cameras.js";
import { button, choices, make, slider } from "./elements.js";
import { MeshView } from "./mesh.js";
import { meshArrays } from "./payload.js";

const MEASURING = "Click two points; or turn one into the middle with the arrow keys and press Enter, then the other";

export class MeshPanel {
  constructor() {
    const canvas = make("canvas", { className: "picture", tabIndex: 0 });
    canvas.setAttribute("aria-label", "The mesh. Drag or use the arrow keys to turn it, the wheel or + and - to zoom.");
    this.caption = make("p", { className: "caption", role: "status" });
    this.stage = make("div", { className: "light-stage" }, canvas, make("div", { className: "aim" }), this.caption);
    this.view = new MeshView(canvas, (distance) => this.measured(distance));
    this.colour = make("div", {});
    this.views = make("div", {});
    this.hasCameras = make("input", { type: "checkbox", checked: true, onchange: () => this.view.showCameras(this.hasCameras.checked) });
    this.cameras = make("label", { className: "check" }, this.hasCameras, make("span", {}, "Show the cameras"));
    this.hasOutlines = make("input", { type: "checkbox", onchange: () => this.showOutlines() });
    this.outlines = make("label", { className: "check" }, this.hasOutlines, make("span", {}, "Show the outlines of the views"));
    this.cut = slider("Hide below confidence", { value: 0 }, (value) => value.toFixed(2), (value) => this.view.cutBelow(value));
    this.place = slider("Place of the cut", { min: -1, max: 1, value: 0.2 }, (value) => value.toFixed(2), () => this.section());
    this.axis = choices("Section", [["none", "None"], ["x", "Upright"], ["y", "Level"], ["z", "Facing"]], "none", (axis) => this.section(axis));
    this.isMeasuring = make("input", { type: "checkbox", onchange: () => this.measure() });
    this.size = make("p", { className: "mesh-size" });
    this.controls = make("aside", { className: "controls" }, this.colour, this.views, this.cameras, this.outlines, this.cut, this.axis, this.place,
      make("label", { className: "check" }, this.isMeasuring, make("span", {}, "Measure between two points")),
      button("View from the front", () => this.view.home()), this.size);
    this.place.hidden = this.cameras.hidden = this.outlines.hidden = true;
    this.chosen = "none";
    this.element = make("div", { className: "surface-view" }, this.stage, this.controls);
  }

  /** Show the mesh of a capture (payload.js), unless it is shown already. */
  async setCapture(capture) {
    this.wanted = capture;
    if (this.capture === capture) return;
    const arrays = await meshArrays(capture);
    if (this.wanted !== capture) return;
    this.capture = capture;
    this.view.setMesh(arrays);
    this.cut.hidden = !arrays.confidence;
    const views = capture.facts.views ?? [], colours = [["plain", "Plain"]];
    if (arrays.confidence) colours.push(["confidence", "Confidence"]);
    if (arrays.source) colours.push(["source", "What each view saw"]);
    this.colour.replaceChildren(...(colours.length > 1 ? [choices("Colour", colours, "plain", (name) => this.view.colourBy(name))] : []));
    this.views.replaceChildren(...(views.length ? [viewList(views, capture.facts.unseen, (view) => this.view.lookFrom(view))] : []));
    this.cameras.hidden = this.outlines.hidden = !views.length;
    this.view.setCameras(views);
    this.view.showCameras(this.hasCameras.checked);
    this.showOutlines();
    this.view.colourBy("plain");
    this.cut.set(0);
    const { triangles, shown_triangles: shown } = capture.facts.mesh, number = (value) => value.toLocaleString("en");
    this.size.textContent = shown < triangles ? `${number(shown)} of ${number(triangles)} triangles shown` : `${number(triangles)} triangles`;
  }

  showOutlines() {
    this.view.showOutlines(this.capture.facts.views ?? [], this.hasOutlines.checked);
  }

  section(axis = this.chosen) {
    this.chosen = axis;
    this.place.hidden = axis === "none";
    this.view.cutAcross(axis, Number(this.place.querySelector("input").value));
  }

  measure() {
    this.stage.classList.toggle("is-measuring", this.isMeasuring.checked);
    this.view.measure(this.isMeasuring.checked);
    this.measured(null);
  }

  measured(distance) {
    const unit = this.capture?.facts.mesh.unit, hint = this.isMeasuring.checked ? MEASURING : "";
    this.caption.textContent = distance === null ? hint : `${Number(distance.toPrecision(4))} ${unit} between the points`;
  }
}
