// Undo and redo of what is done on the page before it is saved.

import { forgetRefusal } from "../dom.js";
import { guardLeaving } from "../leaving.js";

export class History {
  /** changed: called after every step; isChanged: whether the steps together have changed anything. */
  constructor(changed, isChanged) {
    Object.assign(this, { changed, isChanged });
    this.clear();
  }

  clear() {
    this.done = [];
    this.undone = [];
    this.changed();
  }

  get isDirty() {
    return this.done.length > 0 && this.isChanged();
  }

  /** Whether nothing is unsaved, or a person agrees to lose it. */
  mayLose() {
    return !this.isDirty || confirm("Lose what you have changed and not saved?");
  }

  /** Asks before the view is left with unsaved changes; `signal` ends it. */
  guard(signal) {
    guardLeaving(() => this.isDirty, () => this.clear(), signal);
  }

  /** Notes a step that has been taken: {undo, redo}. */
  add(step) {
    forgetRefusal();
    this.done.push(step);
    this.undone = [];
    this.changed();
  }

  undo() {
    const step = this.done.pop();
    if (!step) return;
    step.undo();
    this.undone.push(step);
    this.changed();
  }

  redo() {
    const step = this.undone.pop();
    if (!step) return;
    step.redo();
    this.done.push(step);
    this.changed();
  }
}
