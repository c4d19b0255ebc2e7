// The chrome spheres as a list beside the picture: their numbers, to be typed, and how far each is off the contour.

import { POSITIVE, element, isEmptied, typedNumber } from "../dom.js";

export const LEAST_RADIUS_PX = 3;

const RULES = { radius: [(radius) => radius >= LEAST_RADIUS_PX, `it must be at least ${LEAST_RADIUS_PX} pixels`], diameter_mm: POSITIVE };

export class SphereList {
  /** layer: the circles on the picture. */
  constructor(layer) {
    this.layer = layer;
    this.root = element("div", { class: "sphere-list" });
    this.origin = element("p", { class: "faint" });
    this.none = element("p", { class: "faint" }, "None. Double-click the picture with the tool Spheres, or press a.");
    this.entries = [];
  }

  /** Shows the layer's spheres; fields stay the same elements, so that the keyboard's place among them is kept. */
  show(origin) {
    const { spheres } = this.layer;
    if (this.entries.length !== spheres.length || !spheres.length) {
      this.entries = spheres.map((_, number) => this.entry(number));
      this.root.replaceChildren(...(spheres.length ? this.entries.map(({ root }) => root) : [this.none]), this.origin);
    }
    this.entries.forEach((entry, number) => this.fill(entry, number));
    this.origin.textContent = origin;
    this.origin.hidden = !origin;
  }

  entry(number) {
    const { layer } = this;
    const field = (name, label, attributes) => element("input", {
      type: "number", "aria-label": label, ...attributes,
      oninput: (event) => (this.typing = event.target),
      onblur: () => (this.typing = null),
      onchange: (event) => this.typed(number, name, event.target),
    });
    const numbers = [["x", "x"], ["y", "y"], ["radius", "r"]].map(([name, text]) => [name, text, field(name, `${text} of sphere ${number + 1}`, { step: "0.5" })]);
    const diameter = field("diameter_mm", `Diameter of sphere ${number + 1} in millimetres`, { step: "0.1", min: "0", placeholder: "?", title: "Diameter in millimetres: gives the scale" });
    const choose = element("button", { type: "button", class: "quiet", onclick: () => { layer.chosen = number; layer.view.use("spheres"); } }, `${number + 1}`);
    const remove = element("button", { type: "button", class: "quiet", "aria-label": `Remove sphere ${number + 1}`, onclick: () => layer.remove(number) }, "Remove");
    const state = element("span", { role: "status" });
    const take = element("button", { type: "button", onclick: () => this.take(number) }, "Take the fit");
    const fit = element("p", {}, state, " ", take);
    const root = element("div", { class: "sphere" },
      element("div", { class: "fields" }, choose, numbers.map(([, text, input]) => element("label", {}, text, input))),
      element("div", { class: "fields" }, element("label", {}, "diameter in mm", diameter), remove), fit);
    return { root, choose, fit, state, take, inputs: { ...Object.fromEntries(numbers.map(([name, , input]) => [name, input])), diameter_mm: diameter } };
  }

  fill({ choose, fit, state, take, inputs }, number) {
    const sphere = this.layer.spheres[number];
    choose.setAttribute("aria-pressed", String(number === this.layer.chosen));
    for (const [name, input] of Object.entries(inputs)) {
      const value = name === "diameter_mm" ? sphere[name] : Math.round(sphere[name] * 10) / 10;
      if (input !== this.typing) input.value = value === null ? "" : String(value);
    }
    const known = this.layer.fits.get(number);
    const [text, kind] = fitText(known);
    if (state.textContent !== text) state.textContent = text;
    state.className = kind;
    fit.hidden = !text;
    // While a contour is measured the button stays, and with it the keyboard's place.
    const isFocused = document.activeElement === take;
    take.hidden = !(known?.is_clear || (known === null && isFocused));
    take.ariaDisabled = String(!known || !isOff(known));
    if (isFocused && (take.hidden || fit.hidden)) choose.focus({ preventScroll: true });
  }

  take(number) {
    const fit = this.layer.fits.get(number);
    if (fit && isOff(fit)) this.layer.take(number);
  }

  /** Takes a number that was typed; the field of the diameter may be empty. */
  typed(number, name, field) {
    this.typing = null;
    const { layer } = this, before = { ...layer.spheres[number] };
    const isUnknown = name === "diameter_mm" && isEmptied(field);
    const value = isUnknown ? null : typedNumber(field, ...(RULES[name] ?? []));
    if (value === null && !isUnknown) return layer.draw();
    layer.spheres[number][name] = value;
    layer.moved(number, before);
  }
}

/** Whether a circle differs from the contour by what its figures show. */
function isOff(fit) {
  return Math.max(fit.misfit_px, fit.misfit_radius_px) >= 0.05;
}

/** Returns what is said about a fit, and its class; fit: undefined if there is none, null while it is measured. */
function fitText(fit) {
  if (fit === undefined) return ["", ""];
  if (fit === null) return ["measuring the contour …", "faint"];
  if (!fit.is_clear) return ["No contour is seen near here: the circle would be used as drawn.", "doubt"];
  const misfit = `centre ${fit.misfit_px.toFixed(1)} px, radius ${fit.misfit_radius_px.toFixed(1)} px off the contour`;
  return [misfit + (fit.is_corrected ? ": a run would use the contour." : "."), fit.is_corrected ? "doubt" : "good"];
}
