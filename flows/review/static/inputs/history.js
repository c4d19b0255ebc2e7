// Undo and redo of what is done on the page before it is saved.

export class History {
  constructor(changed) {
    this.changed = changed;
    this.clear();
  }

  clear() {
    this.done = [];
    this.undone = [];
    this.changed();
  }

  get isDirty() {
    return this.done.length > 0;
  }

  /** Notes a step that has been taken: {undo, redo}. */
  add(step) {
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
