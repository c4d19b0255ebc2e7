// "Grow from here": a click adds to the mask what is connected with a pixel and looks alike, on the picture that is shown.

import { askPicture, newest } from "../api.js";
import { announceError, element } from "../dom.js";

const TOLERANCE = 32;
const REST_MS = 250;

export class Growth {
  constructor(view, mask) {
    // pending: resolves when what grows is in the mask, or has failed.
    Object.assign(this, { view, mask, last: null, pending: null, begin: newest() });
    this.tolerance = element("input", { type: "range", min: "0", max: "120", value: String(TOLERANCE), "aria-label": "Tolerance of growing, in levels of 255", oninput: () => this.adjust() });
    this.output = element("output", {}, String(TOLERANCE));
    this.root = element("label", { class: "line" }, "Tolerance", this.tolerance, this.output);
  }

  /** Grows from a pixel of the picture that is shown: into the mask, or out of it. */
  grow(point, cutsOut) {
    const [x, y] = [Math.round(point.x), Math.round(point.y)];
    this.last = null;
    this.pending = this.apply({ x, y, cutsOut, picture: this.view.shown });
  }

  /** Grows anew what was grown last, with the tolerance that was just set. */
  adjust() {
    this.output.textContent = this.tolerance.value;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      const { last } = this;
      const isLastStep = last && this.view.history.done.at(-1) === last.step;
      if (last && (isLastStep || !last.step)) this.pending = this.apply(last);
    }, REST_MS);
  }

  async apply({ x, y, cutsOut, picture, step }) {
    const isNewest = this.begin();
    try {
      const query = new URLSearchParams({ x, y, picture, tolerance: this.tolerance.value });
      const grown = await this.mask.decoded(await askPicture(`${this.view.capture.path}/growth?${query}`, this.view.signal));
      if (!isNewest()) return;
      const { history } = this.view;
      if (step && history.done.at(-1) === step) history.undo();
      const before = history.done.length;
      this.mask.combine((index) => grown[4 * index] > 0, cutsOut);
      this.last = { x, y, cutsOut, picture, step: history.done.length > before ? history.done.at(-1) : null };
    } catch (error) {
      announceError(error);
    }
  }
}
