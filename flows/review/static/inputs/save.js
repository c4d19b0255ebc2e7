// Saving: who saves, what was saved before, and what to do where somebody else has changed the same.

import { ask } from "../api.js";
import { Author, showConflict } from "../author.js";
import { announce, announceError, announceNothingChanged, announceSaved, element, guarded, moment, shownRefusal } from "../dom.js";

export class SavePanel {
  constructor(view) {
    this.view = view;
    this.author = new Author("change");
    this.button = element("button", { type: "button", onclick: () => this.save() }, "Save ", element("kbd", {}, "Ctrl+S"));
    this.undoButton = element("button", { type: "button", title: "Ctrl+Z", onclick: () => view.undo() }, "Undo");
    this.redoButton = element("button", { type: "button", title: "Ctrl+Y", onclick: () => view.redo() }, "Redo");
    this.conflict = element("div", { role: "alert" });
    this.revisions = element("ol", { class: "revisions" });
    this.root = element("section", { class: "save" }, element("h2", {}, "Changes"), this.author.input, element("div", { class: "line" }, this.button, this.undoButton, this.redoButton), this.conflict);
    this.past = element("section", { class: "save past" }, this.revisions);
    this.show();
  }

  show() {
    const { history, edits } = this.view;
    // A number is taken as typed when Save is pressed, which a disabled button would not notice.
    this.button.ariaDisabled = String(!history.isDirty);
    this.undoButton.disabled = !history.done.length;
    this.redoButton.disabled = !history.undone.length;
    if (this.shown === edits) return;
    this.shown = edits;
    this.past.hidden = !edits.history.length;
    this.revisions.replaceChildren(...edits.history.slice(0, 8).map((revision) =>
      element("li", {}, element("span", {}, revision.sentence), element("span", { class: "faint" }, ` ${revision.author}, ${moment(revision.time)}`),
        revision.number === edits.undoable ? element("button", { type: "button", class: "quiet", onclick: () => this.takeBack(revision.number) }, "take back") : null)));
  }

  /** Saves what was changed; returns whether nothing is left to be saved. */
  async save(base = this.view.edits.revision) {
    this.view.spheres.finish();
    this.view.mask.end();
    if (!this.view.history.isDirty) {
      announceNothingChanged();
      return true;
    }
    const author = this.author.name;
    if (!author) return false;
    const refusal = shownRefusal();
    return this.finish(() => announceSaved(refusal), async () => {
      await this.view.mask.growth.pending;
      const changes = await this.view.changes();
      if (Object.keys(changes).length) await ask(`${this.view.capture.path}/edits`, { method: "POST", body: { changes, author, base_revision: base } });
    });
  }

  /** Sends something, shows what is saved then, and says so by `confirmed`; returns whether it is saved. */
  async finish(confirmed, send) {
    // What is painted meanwhile would be neither saved nor kept.
    this.view.lock(true);
    let failure = null;
    try {
      await send();
      await this.refresh();
      confirmed();
    } catch (error) {
      failure = error;
    } finally {
      this.view.lock(false);
      this.show();
    }
    if (failure) await this.refused(failure);
    return !failure;
  }

  async refresh() {
    this.conflict.replaceChildren();
    this.view.edits = await ask(`${this.view.capture.path}/edits`);
    for (const layer of this.view.layers) layer.reset();
    await this.view.mask.reset();
    this.view.history.clear();
  }

  /** Says why something was not saved, and lets a person choose where somebody else has changed the same. */
  async refused(error) {
    if (error.status === 409) await guarded(() => this.showConflict(error.answer.conflicts))();
    else announceError(error);
  }

  async showConflict(conflicts) {
    const newest = await ask(`${this.view.capture.path}/edits`);
    const lines = conflicts.map(({ field, author, time }) => element("li", {}, `${author} changed ${field} at ${new Date(time).toLocaleTimeString("sv-SE")}`));
    showConflict(this.conflict, "changed", element("ul", {}, lines), { keep: () => this.save(newest.revision), take: guarded(() => this.view.history.mayLose() && this.refresh()) });
  }

  async takeBack(revision) {
    const author = this.author.name;
    if (!author || !this.view.history.mayLose()) return;
    await this.finish(() => announce("Taken back."), () => ask(`${this.view.capture.path}/edits/undo`, { method: "POST", body: { revision, author } }));
  }
}
