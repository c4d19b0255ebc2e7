// What the marks change: the capture labelled anew with them, as a draft.

import { ask } from "../api.js";
import { element } from "../dom.js";

export class Draft {
  /** marks: whose `saved` and `revision` are labelled. */
  constructor(path, marks, signal) {
    Object.assign(this, { path, marks, signal });
    this.state = element("p", { class: "faint", role: "status" });
    this.picture = element("img", { class: "normals", alt: "Normals with the answers", hidden: true });
  }

  /** Labels the capture with the marks, unless that is shown already. */
  async show() {
    const { saved, revision } = this.marks;
    if (this.shown === revision) return;
    this.shown = revision;
    if (!saved.length) {
      this.state.textContent = "No marks yet.";
      this.picture.hidden = true;
      return;
    }
    const marks = `${saved.length} ${saved.length === 1 ? "mark" : "marks"}`;
    this.state.textContent = `${marks}, labelling anew …`;
    try {
      const made = await ask(`${this.path}/labelling`, { signal: this.signal });
      if (made.revision !== this.marks.revision) return;
      const what = made.changed_pixels ? `${made.changed_pixels.toLocaleString("en")} normals change, by ${made.changed_deg}° on average` : "no normals change";
      this.state.textContent = `${marks}: ${what} (draft, ${made.seconds} s). Run from here for the final labels.`;
      this.picture.src = `${this.path}/normals?revision=${made.revision}`;
      this.picture.hidden = false;
    } catch (error) {
      if (error.name === "AbortError" || this.shown !== revision) return;
      this.shown = null;
      this.state.textContent = error.message;
    }
  }
}
