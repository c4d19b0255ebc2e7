// The viewer of an object: its captures' surfaces and meshes, and its model.

import { choices, make } from "./elements.js";
import { MeshPanel } from "./mesh_controls.js";
import { SurfaceView } from "./surface_view.js";

export class Viewer {
  /** captures: as in payload.js; model: the same with a mesh alone, or null. */
  constructor(captures, model = null) {
    this.captures = captures;
    this.model = model;
    this.turn = 0;
    this.body = make("div", { className: "viewer-body" });
    this.select = make("select", { "aria-label": "View", onchange: () => this.show() },
      ...captures.map((capture, i) => make("option", { value: i }, capture.facts.name)));
    const modes = [];
    if (captures.length) modes.push(["surface", "Relight"]);
    if (captures.some((capture) => capture.facts.mesh)) modes.push(["mesh", captures.length > 1 ? "Mesh of this view" : "Mesh"]);
    if (model) modes.push(["model", "Model"]);
    this.mode = model ? "model" : "surface";
    this.tabs = choices("Show", modes, this.mode, (mode) => this.show(mode));
    this.tabs.classList.add("tabs");
    this.which = make("label", { className: "which" }, make("span", {}, "View"), this.select);
    this.failure = make("p", { className: "failure", role: "alert", hidden: true });
    this.element = make("section", { className: "viewer" }, make("div", { className: "viewer-bar" }, this.tabs, this.which), this.failure, this.body);
  }

  /** Show a mode: surface, mesh or model. Resolves when it is drawn. */
  async show(mode = this.mode) {
    const turn = ++this.turn;
    this.mode = mode;
    this.tabs.choose(mode);
    this.which.hidden = mode === "model" || this.captures.length < 2;
    this.failure.hidden = true;
    this.hasFailed = false;
    try {
      if (mode === "surface") await this.showSurface();
      else await this.showMesh(mode === "model" ? this.model : this.captures[this.select.selectedIndex]);
    } catch (error) {
      // What is shown since has not failed.
      if (turn !== this.turn) return;
      this.failure.textContent = `${error.message ?? error}`;
      this.failure.hidden = false;
      this.hasFailed = true;
    }
  }

  async showSurface() {
    this.surface ??= new SurfaceView();
    this.body.replaceChildren(this.surface.element, this.surface.profile.element);
    await this.surface.setCapture(this.captures[this.select.selectedIndex]);
  }

  async showMesh(capture) {
    this.meshes ??= new MeshPanel();
    this.body.replaceChildren(this.meshes.element);
    await this.meshes.setCapture(capture);
  }

  /** Give the graphics memory back; the viewer shows nothing afterwards. */
  dispose() {
    this.surface?.dispose();
    this.meshes?.view.dispose();
  }
}
