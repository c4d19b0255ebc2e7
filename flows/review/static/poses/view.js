// The poses view: from where each view of an object was taken, all of them together.

import { ask, capturePath, objectPath } from "../api.js";
import { Author, showConflict } from "../author.js";
import { addStyleSheets, announceError, announceNothingChanged, announceSaved, element, shownRefusal } from "../dom.js";
import { History } from "../inputs/history.js";
import { RunPanel } from "../inputs/run.js";
import { bind } from "../keys.js";
import { hundredths } from "../rounding.js";
import { Plan, direction, legend, turnOf } from "./plan.js";
import { poseOf } from "./pose.js";
import { PoseRow } from "./row.js";

const FULL_TURN = 360;

export async function open(root, capture, signal) {
  root.classList.add("poses");
  addStyleSheets("/static/poses/poses.css");
  const path = objectPath(capture.object);
  const known = await ask(`${path}/poses`, { signal });
  new PosesView(root, capture, known, signal);
}

class PosesView {
  constructor(root, { object }, known, signal) {
    Object.assign(this, { root, object, signal, path: objectPath(object), capture: { path: objectPath(object), row: capturePath(object, known.views[0].capture) }, spheres: { finish() {} } });
    this.history = new History(() => this.show(), () => this.views.some(({ isChanged }) => isChanged));
    this.views = [];
    this.take(known);
    this.plan = new Plan(this.views, (name) => capturePath(object, name), (number, angle) => this.put(number, { turntable: angle }), (number, before) => this.noted([[number, before]]));
    this.author = new Author("change");
    this.button = element("button", { type: "button", onclick: () => this.save.save() }, "Save ", element("kbd", {}, "Ctrl+S"));
    this.undoButton = element("button", { type: "button", onclick: () => this.history.undo() }, "Undo");
    this.conflict = element("div", { role: "alert" });
    this.rows = this.views.map(({ capture }, number) =>
      new PoseRow(object, capture, (kind) => this.chosen(number, kind), (turn) => this.change([[number, { turntable: turn }]])));
    // What the panel of a run expects.
    this.save = { save: () => this.saveAll() };
    this.run = new RunPanel(this);
    const tools = [["Evenly, as they are listed", () => this.spread(1)], ["Evenly, the other way round", () => this.spread(-1)], ["Turn all the other way", () => this.turnOver()]];
    const head = element("thead", {}, element("tr", {}, ["View", "Pose", "Degrees", "Last model"].map((text) => element("th", { scope: "col" }, text))));
    root.append(
      element("div", { class: "plan-column" }, this.plan.root, legend()),
      element("aside", { "aria-label": "Poses" },
        element("section", {}, element("h2", {}, `${this.views.length} ${this.views.length === 1 ? "view" : "views"}`),
          this.views.length === 1 ? element("p", { class: "faint" }, "Only objects with several views need poses: a model is merged from them.") : null,
          element("table", {}, head, element("tbody", {}, this.rows.map((row) => row.root)))),
        element("section", {}, element("h2", {}, "All at once"), element("div", { class: "chips" }, tools.map(([text, action]) => element("button", { type: "button", onclick: action }, text)))),
        element("section", { class: "save" }, element("h2", {}, "Changes"), this.author.input, element("div", { class: "line" }, this.button, this.undoButton), this.conflict),
        this.run.root));
    bind([
      ["Ctrl+z", "undo", () => this.history.undo()],
      ["Ctrl+y Ctrl+Z", "redo", () => this.history.redo()],
      ["Ctrl+s", "save", () => this.saveAll()],
      ["g", "run all views from here", () => this.run.start()],
    ].map(([key, text, action]) => [key, text, () => this.root.inert || action()]), signal);
    this.history.guard(signal);
    this.show();
  }

  take({ views, revision }) {
    this.revision = revision;
    this.views.splice(0, this.views.length, ...views.map((view) => ({ ...view, saved: JSON.stringify(view.pose), isChanged: false })));
  }

  reload() {
    dispatchEvent(new HashChangeEvent("hashchange"));
  }

  put(number, pose) {
    const view = this.views[number];
    view.pose = pose;
    view.isChanged = JSON.stringify(pose) !== view.saved;
    this.show();
  }

  /** Notes poses that have changed, [number, pose before], as one step. */
  noted(befores) {
    const afters = befores.map(([number]) => [number, this.views[number].pose]);
    if (befores.every(([, before], i) => JSON.stringify(before) === JSON.stringify(afters[i][1]))) return;
    const putAll = (poses) => poses.forEach(([number, pose]) => this.put(number, pose));
    this.history.add({ undo: () => putAll(befores), redo: () => putAll(afters) });
  }

  change(poses) {
    const befores = poses.map(([number]) => [number, this.views[number].pose]);
    for (const [number, pose] of poses) this.put(number, pose);
    this.noted(befores);
  }

  spread(way) {
    const turned = (number) => ({ turntable: hundredths((way * number * FULL_TURN) / this.views.length) });
    this.change(this.views.flatMap(({ damage }, number) => (damage ? [] : [[number, turned(number)]])));
  }

  turnOver() {
    this.change(this.views.flatMap(({ pose }, number) => (pose?.turntable ? [[number, { turntable: -pose.turntable }]] : [])));
  }

  chosen(number, kind) {
    const place = direction(this.views[number].pose);
    this.change([[number, poseOf(kind, place ? Math.round(turnOf(place)) : 0)]]);
  }

  show() {
    if (!this.plan) return;
    this.plan.show();
    this.views.forEach((view, number) => this.rows[number].show(view));
    // A number is taken as typed when Save is pressed, which a disabled button would not notice.
    this.button.ariaDisabled = String(!this.history.isDirty);
    this.undoButton.disabled = !this.history.done.length;
  }

  async saveAll() {
    if (!this.history.isDirty) {
      announceNothingChanged();
      return true;
    }
    const author = this.author.name;
    if (!author) return false;
    const refusal = shownRefusal();
    const conflicts = [], focused = document.activeElement;
    // What is turned meanwhile would be neither saved nor kept.
    this.root.inert = true;
    try {
      for (const { capture, pose } of this.views.filter(({ isChanged }) => isChanged)) {
        await ask(`${capturePath(this.object, capture)}/edits`, { method: "POST", body: { changes: { pose }, author, base_revision: this.revision } })
          .catch((error) => { if (error.status === 409) conflicts.push({ capture, pose, ...error.answer.conflicts[0] }); else throw error; });
      }
      this.take(await ask(`${this.path}/poses`, { signal: this.signal }));
      this.history.clear();
      if (!conflicts.length) announceSaved(refusal);
    } catch (error) {
      announceError(error);
      return false;
    } finally {
      this.root.inert = false;
      focused?.focus({ preventScroll: true });
    }
    this.showConflicts(conflicts);
    return !conflicts.length;
  }

  /** Says who has turned the same views meanwhile; both stay in the history. */
  showConflicts(conflicts) {
    this.conflict.replaceChildren();
    if (!conflicts.length) return;
    const lines = conflicts.map(({ capture, author, time }) => element("li", {}, `${capture}: ${author} changed its pose at ${new Date(time).toLocaleTimeString("sv-SE")}`));
    const keep = () => {
      this.change(conflicts.map(({ capture, pose }) => [this.views.findIndex((view) => view.capture === capture), pose]));
      this.saveAll();
    };
    showConflict(this.conflict, "changed", element("ul", {}, lines), { keep, take: () => this.conflict.replaceChildren() });
  }
}
