// A value that is edited on the page, with its steps in the history; a layer that has one extends this.

export class EditedValue {
  constructor(view) {
    this.view = view;
  }

  get isChanged() {
    return !isSame(this.value, this.saved);
  }

  /** Takes a value without a step in the history. */
  put(value) {
    this.value = value;
    this.show();
  }

  /** Notes the change from the value before as one step. */
  noted(before) {
    const after = this.value;
    if (isSame(before, after)) return;
    this.view.history.add({ undo: () => this.put(before), redo: () => this.put(after) });
  }

  /** Takes a value as one step. */
  typed(value) {
    const before = this.value;
    this.put(value);
    this.noted(before);
  }
}

/** Whether two values that JSON can hold are equal. */
export function isSame(first, second) {
  return JSON.stringify(first) === JSON.stringify(second);
}
