// Which picture is shown: three levels over time, or a frame that a slider chooses.

import { element } from "./dom.js";

const LEVELS = [["peak", "Maximum", "m"], ["background", "Median", "n"], ["mean", "Mean", "k", "The mean of frames spread over the video, brightened"]];

export class Timeline {
  /** frames: their number; onshow: called with a level or a frame's number, returns a promise of whether it is shown. */
  constructor(frames, onshow) {
    Object.assign(this, { frames, onshow, shown: null });
    this.slider = element("input", { type: "range", min: "0", max: String(frames - 1), value: "0", "aria-label": "Frame", oninput: () => this.show(Number(this.slider.value)) });
    this.number = element("output", { class: "frame-number" });
    this.levels = LEVELS.map(([level, text, key, title]) =>
      element("button", { type: "button", "data-kind": level, title, "aria-keyshortcuts": key, onclick: () => this.show(level) }, text, " ", element("kbd", {}, key)));
    this.root = element("div", { class: "timeline" }, this.levels, this.slider, this.number);
  }

  /** The frame's number, null while a level is shown. */
  get frame() {
    return typeof this.shown === "number" ? this.shown : null;
  }

  /** Where the picture that is shown comes from, after the capture's path. */
  get path() {
    return this.frame === null ? `level/${this.shown}` : `frame?number=${this.frame}`;
  }

  /** Shows something, or goes on saying what is shown where that fails. */
  async show(what) {
    this.mark(what);
    const isShown = await this.onshow(what);
    if (isShown) this.last = what;
    else if (isShown === false && this.last !== undefined && this.shown === what) this.mark(this.last);
  }

  /** Says what is shown. */
  mark(what) {
    this.shown = what;
    if (this.frame !== null) this.slider.value = String(what);
    this.number.textContent = this.frame === null ? "" : `frame ${what.toLocaleString("en")} of ${(this.frames - 1).toLocaleString("en")}`;
    for (const button of this.levels) button.setAttribute("aria-pressed", String(button.dataset.kind === what));
  }

  step(by) {
    const from = this.frame ?? Number(this.slider.value);
    this.show(Math.max(0, Math.min(this.frames - 1, from + by)));
  }

  /** What `bind` of keys.js takes. */
  get keys() {
    return [
      ["m", "maximum over time", () => this.show("peak")],
      ["n", "median over time", () => this.show("background")],
      ["k", "mean over time", () => this.show("mean")],
      ["PageDown", "a hundred frames on", () => this.step(100)],
      ["PageUp", "a hundred frames back", () => this.step(-100)],
    ];
  }
}
