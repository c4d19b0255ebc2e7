// One capture's surface: relit, beside its photograph, under lenses, with a depth profile.

import { Dial, lightWords } from "./dial.js";
import { choices, make, slider } from "./elements.js";
import { lens, lensesOf } from "./lenses.js";
import { unitVectors } from "./payload.js";
import { Profile } from "./profile.js";
import { Relight } from "./relight.js";
import { Stage } from "./stage.js";
import { Viewport } from "./viewport.js";

const MATERIALS = [
  ["matte", "Matte"], ["glossy", "Glossy"], ["glass", "Glass"], ["relief", "Relief"], ["normals", "Normals"], ["curvature", "Curvature"],
];
/** Photographs that are kept decoded: one is as large as the surface, and a sweep has hundreds. */
const KEPT_PICTURES = 8;
/** Exponent of a photograph's levels that shows its shadows. */
const BRIGHT_GAMMA = 0.45;
const percent = (value) => `${Math.round(100 * value)} %`;

export class SurfaceView {
  constructor() {
    const canvas = make("canvas", { className: "picture" });
    this.relight = new Relight(canvas);
    this.dial = new Dial([], (light) => this.lightMoved(light));
    this.stage = new Stage(canvas, {
      dial: this.dial, viewport: () => this.viewport, profile: () => (this.profile.isOn ? this.profile : null),
    });
    this.viewport = new Viewport(canvas, ({ extent, corner, pixel }) => {
      this.relight.set({ extent, corner, pixel });
      this.profile?.place();
    });
    this.profile = new Profile(this.viewport, this.stage.overlay);
    this.makeControls();
    this.relight.set({ material: "glossy" });
    this.element = make("div", { className: "surface-view" }, this.stage.element, this.controls);
    this.pictures = new Map();
    this.drawn = 0;
  }

  makeControls() {
    this.material = choices("Material", MATERIALS, "glossy", (name) => this.setMaterial(name));
    this.field = make("select", { "aria-label": "Normals", onchange: () => this.setField(this.field.value) });
    this.fieldBox = make("fieldset", { hidden: true }, make("legend", {}, "Normals"), this.field);
    this.strength = slider("Strength of the relief", { min: 0.5, max: 8, step: 0.1, value: 3 }, (value) => value.toFixed(1), (relief) => this.relight.set({ relief }));
    this.strength.hidden = true;
    this.lensBox = make("div");
    this.legend = make("div", { className: "legend-box", role: "status" });
    this.share = slider("Opacity", { value: 0.8 }, percent, (value) => this.relight.set({ lensShare: this.lensName === "none" ? 0 : value }));
    this.wipe = slider("Photograph beside it", { value: 0 }, percent, (value) => this.setWipe(value));
    this.which = make("select", { "aria-label": "Which photograph", onchange: () => this.photograph() });
    const isBright = make("input", { type: "checkbox", onchange: () => this.relight.set({ gamma: isBright.checked ? BRIGHT_GAMMA : 1 }) });
    this.photographBox = make("fieldset", { className: "photographs" }, make("legend", {}, "Photograph"), this.which, this.wipe,
      make("label", { className: "check" }, isBright, make("span", {}, "Brighten its shadows")));
    this.isProfiled = make("input", { type: "checkbox", onchange: () => this.setProfile(this.isProfiled.checked) });
    this.profileBox = make("label", { className: "check" }, this.isProfiled, make("span", {}, "Measure depth along a line"));
    this.words = make("p", { className: "light-words" });
    this.controls = make("aside", { className: "controls" },
      make("fieldset", { className: "light" }, make("legend", {}, "Light"), this.dial.element, this.words),
      this.material, this.strength, this.fieldBox, make("div", { className: "lenses" }, this.lensBox, this.share, this.legend),
      this.photographBox, this.profileBox);
    this.share.hidden = true;
  }

  /** Show a capture (payload.js). */
  async setCapture(capture) {
    const number = ++this.drawn, [normals, mask] = await Promise.all([capture.normals(), capture.array("mask")]);
    if (number !== this.drawn) return;
    const isResized = this.capture?.width !== capture.width || this.capture?.height !== capture.height;
    this.capture = capture;
    this.forgetPictures();
    this.relight.setNormals(normals, mask, capture.width, capture.height);
    if (isResized) this.viewport.setSize(capture.width, capture.height);
    this.dial.setDots(capture.facts.lights ?? []);
    const lenses = lensesOf(capture), chosen = lenses.some(([name]) => name === this.lensName) ? this.lensName : "none";
    this.lensBox.replaceChildren(this.lensChoice = choices("Lens", lenses, chosen, (name) => this.setLens(name)));
    this.offerFields(capture.facts.fields ?? []);
    this.offerPhotographs(capture.facts.photographs ?? []);
    this.profileBox.hidden = !capture.has("depth");
    if (capture.has("depth")) {
      const depth = await capture.depth();
      if (number !== this.drawn) return;
      this.profile.setCapture(depth, capture.facts, mask);
    } else this.setProfile(false);
    await this.setLens(chosen);
    this.lightMoved(this.dial.light);
  }

  offerFields(fields) {
    const options = [{ part: "", name: "The result" }, ...fields];
    this.field.replaceChildren(...options.map(({ part, name }) => make("option", { value: part }, name)));
    this.fieldBox.hidden = !fields.length;
  }

  /** Relight other normals of the capture: candidates, winner takes all, those of the silhouette; "" the result. */
  async setField(part) {
    const capture = this.capture, { width, height } = capture;
    this.caption("Loading these normals …");
    const isWanted = () => this.capture === capture && this.field.value === part;
    try {
      const normals = part ? unitVectors(await capture.array(`${part}_normals`)) : await capture.normals();
      const mask = await capture.array(part ? `${part}_mask` : "mask");
      if (!isWanted()) return;
      this.relight.setNormals(normals, mask, width, height);
      this.caption(part ? `Normals: ${this.field.selectedOptions[0].textContent}` : "");
    } catch (error) {
      if (isWanted()) this.caption(error.message);
    }
  }

  setMaterial(name) {
    this.strength.hidden = name !== "relief";
    this.relight.set({ material: name });
    this.material.choose(name);
  }

  /** Lay a lens over the surface; one that cannot be read leaves none, and says why. */
  async setLens(name) {
    this.lensName = name;
    this.share.hidden = name === "none";
    this.lensChoice.choose(name);
    if (name === "none") {
      this.legend.replaceChildren();
      this.relight.set({ lensShare: 0 });
      return;
    }
    const { capture } = this, isWanted = () => this.lensName === name && this.capture === capture;
    try {
      const { colours, isSmooth, legend } = await lens(capture, name);
      if (!isWanted()) return;
      this.relight.setPicture("lens", colours, capture.width, capture.height, isSmooth);
      this.legend.replaceChildren(legend);
      this.relight.set({ lensShare: Number(this.share.querySelector("input").value) });
    } catch (error) {
      if (!isWanted()) return;
      await this.setLens("none");
      this.legend.replaceChildren(make("p", {}, error.message));
    }
  }

  lightMoved(light) {
    this.relight.set({ light });
    this.words.textContent = lightWords(light);
    if (this.relight.state.wipe > 0) this.photograph();
    else this.caption();
  }

  offerPhotographs(photographs) {
    this.frames = photographs.filter(({ frame, light }) => frame !== null && light);
    const options = this.frames.length ? [["nearest", "frame of the nearest light"]] : [];
    const names = { maximum: "the brightest of all frames", median: "the median of all frames" };
    for (const { label, part } of photographs) if (label in names) options.push([part, names[label]]);
    this.which.replaceChildren(...options.map(([value, text]) => make("option", { value }, text)));
    this.photographBox.hidden = !options.length;
    this.setWipe(options.length ? this.relight.state.wipe : 0);
  }

  setWipe(value) {
    this.relight.set({ wipe: value });
    this.wipe.set(value);
    if (value > 0) this.photograph();
    else this.caption();
  }

  /** Show the chosen photograph: the frame whose light is nearest, or one of all frames. */
  async photograph() {
    const capture = this.capture, light = this.dial.light;
    let part = this.which.value, words = this.which.selectedOptions[0]?.textContent ?? "";
    if (part === "nearest") {
      const cosine = ({ light: other }) => other[0] * light[0] + other[1] * light[1] + other[2] * light[2];
      const nearest = this.frames.reduce((best, next) => (cosine(next) > cosine(best) ? next : best));
      const angle = (Math.acos(Math.min(1, cosine(nearest))) * 180) / Math.PI;
      part = nearest.part;
      words = `frame ${nearest.frame}, its light ${angle.toFixed(0)}° from this one`;
    }
    this.caption(`Photograph: ${words}`);
    if (!part || part === this.shown) return;
    this.shown = part;
    const isWanted = () => this.shown === part && this.capture === capture;
    try {
      const picture = this.pictures.get(part) ?? (await capture.picture(part));
      if (!isWanted()) return picture.close();
      this.keepPicture(part, picture);
      this.relight.setPhotograph(picture);
    } catch (error) {
      if (!isWanted()) return;
      this.shown = null;
      this.caption(error.message);
    }
  }

  /** Keep a picture as the newest of KEPT_PICTURES. */
  keepPicture(part, picture) {
    this.pictures.delete(part);
    this.pictures.set(part, picture);
    if (this.pictures.size <= KEPT_PICTURES) return;
    const [[oldest, dropped]] = this.pictures;
    this.pictures.delete(oldest);
    dropped.close();
  }

  forgetPictures() {
    for (const picture of this.pictures.values()) picture.close();
    this.pictures.clear();
    this.shown = null;
  }

  caption(text = "") {
    const { facts } = this.capture, scale = facts.full_size[0] / facts.size[0];
    const reduced = scale > 1.01 ? `Shown at ${Math.round(100 / scale)} % of its size` : "";
    this.stage.caption.textContent = [text, reduced].filter(Boolean).join(". ");
  }

  /** Give the graphics memory back; a capture that is still being read is not shown. */
  dispose() {
    this.drawn += 1;
    this.forgetPictures();
    this.relight.dispose();
  }

  setProfile(isWanted) {
    // A key may ask for it before the depth is there, or where there is none.
    const isOn = isWanted && Boolean(this.profile.ends && this.capture.has("depth"));
    this.isProfiled.checked = isOn;
    this.profile.show(isOn);
    this.stage.element.classList.toggle("is-measuring", isOn);
  }
}
