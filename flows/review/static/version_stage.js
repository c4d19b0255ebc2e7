// Two versions of a surface under one light, one over the other up to a line that a slider moves.

import { newest } from "./api.js";
import { element } from "./dom.js";
import { Dial } from "./viewer/dial.js";
import { choices, slider } from "./viewer/elements.js";
import { lens } from "./viewer/lenses.js";
import { unitVectors } from "./viewer/payload.js";
import { Relight } from "./viewer/relight.js";
import { Stage } from "./viewer/stage.js";
import { Viewport } from "./viewer/viewport.js";

const MATERIALS = [["matte", "Matte"], ["glossy", "Glossy"], ["relief", "Relief"], ["normals", "Normals"]];

export class VersionStage {
  constructor() {
    this.below = element("canvas", { class: "picture" });
    this.above = element("canvas", { class: "stage-b", "aria-hidden": "true" });
    this.views = [new Relight(this.below), new Relight(this.above)];
    this.dial = new Dial([], (light) => this.set({ light }));
    this.stage = new Stage(this.below, { dial: this.dial, viewport: () => this.viewport, profile: () => null });
    this.legend = element("div", { class: "legend-box" });
    this.names = ["a", "b"].map((side) => element("p", { class: `name-of ${side}` }));
    this.divider = element("div", { class: "divider" });
    this.below.after(this.above, this.divider, ...this.names, this.legend);
    this.viewport = new Viewport(this.below, ({ extent, corner, pixel }) => {
      this.set({ extent, corner, pixel });
    });
    this.set({ material: "glossy", light: this.dial.light });
    this.place = slider("Line between the versions", { value: 0.5 }, (value) => `${Math.round(100 * value)} %`, (value) => this.split(value));
    this.angles = element("input", { type: "checkbox", onchange: () => this.showAngles(this.angles.checked) });
    this.controls = element("div", { class: "under" }, this.dial.element, this.place,
      choices("Material", MATERIALS, "glossy", (material) => this.set({ material })),
      element("label", { class: "check" }, this.angles, element("span", {}, "Map of angles")));
    this.element = element("section", { class: "viewer" }, this.stage.element, this.controls);
    [this.beginPair, this.beginAngles] = [newest(), newest()];
    this.split(0.5);
  }

  set(changes) {
    for (const view of this.views) view.set(changes);
  }

  split(place) {
    this.above.style.clipPath = `inset(0 0 0 ${100 * place}%)`;
    this.divider.style.left = `${100 * place}%`;
  }

  /** Show a comparison (payload.js) of the versions of these names. */
  async setPair(capture, before, after) {
    const isNewest = this.beginPair(), { width, height } = capture;
    const names = ["before_normals", "before_mask", "after_normals", "after_mask"];
    const arrays = await Promise.all(names.map((name) => capture.array(name)));
    if (!isNewest()) return;
    this.capture = capture;
    this.views.forEach((view, i) => view.setNormals(unitVectors(arrays[2 * i]), arrays[2 * i + 1], width, height));
    this.names[0].textContent = before;
    this.names[1].textContent = after;
    this.viewport.setSize(width, height);
    await this.showAngles(this.angles.checked);
  }

  /** Lay the map of angles over both versions, or take it away; `setPair` calls this again for its own pair. */
  async showAngles(isOn) {
    const isNewest = this.beginAngles(), { capture } = this;
    if (!isOn || !capture) {
      this.legend.replaceChildren();
      this.set({ lensShare: 0 });
      return;
    }
    try {
      const { colours, legend } = await lens(capture, "difference");
      if (!isNewest()) return;
      for (const view of this.views) view.setPicture("lens", colours, capture.width, capture.height);
      this.legend.replaceChildren(legend);
      this.set({ lensShare: 0.85 });
    } catch (error) {
      if (!isNewest()) return;
      this.legend.replaceChildren(element("p", {}, error.message));
      this.set({ lensShare: 0 });
    }
  }

  dispose() {
    for (const view of this.views) view.dispose();
  }
}
