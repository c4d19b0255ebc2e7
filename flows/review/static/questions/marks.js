// The marks of the capture: what is saved, by whom it was changed meanwhile, and the list of all.

import { ask } from "../api.js";
import { showConflict } from "../author.js";
import { announce, announceError, element } from "../dom.js";

const same = (first, second) => ["frame", "x", "y"].every((name) => first[name] === second[name]);

export class Marks {
  /** view: {capture, signal, name}; onchange: called when marks or their tracks have changed; ongo: with a mark to go to. */
  constructor(view, onchange, ongo) {
    Object.assign(this, { view, onchange, ongo, saved: [], tracks: [], problems: [], revision: 0, steps: [] });
    this.path = view.capture.path;
    this.conflict = element("div", { role: "alert" });
    this.list = element("ol", { class: "marks-list" });
    // Apart from the marks, whose numbers the problems name.
    this.doubts = element("ul", { class: "marks-problems", "aria-label": "Problems of marks" });
    this.root = element("section", {}, element("h2", {}, "Marks"), this.conflict, this.doubts, this.list);
  }

  /** Takes what the server has, and returns whether it does: answers may come in another order than their questions. */
  take({ marks, revision }) {
    if (revision < this.revision) return false;
    this.saved = marks.map(({ frame, x, y, kind }) => ({ frame, x, y, kind }));
    this.revision = revision;
    this.show();
    return true;
  }

  /** Asks for the paths of the marked highlights. */
  async follow() {
    const { marks, revision, problems } = await ask(`${this.path}/questions/tracks`, { signal: this.view.signal });
    if (revision < this.revision) return;
    this.tracks = marks;
    this.problems = problems;
    this.take({ marks, revision });
    this.onchange();
  }

  /** Waits until a button's change is saved, and shows what follows from it; announces why it is not. */
  async finish(request) {
    try {
      await request;
      this.onchange();
      await this.follow();
    } catch (error) {
      announceError(error);
    }
  }

  /** Adds marks and saves them; what somebody else has saved meanwhile is kept. Returns whether they are saved. */
  async add(marks) {
    return this.save((before) => [...before.filter((mark) => !marks.some((own) => same(own, mark))), ...marks], marks);
  }

  async remove(mark) {
    return this.save((before) => before.filter((other) => !(same(other, mark) && other.kind === mark.kind)), []);
  }

  /** Takes back what was saved last on this page, if need be out of what others have added since. */
  async undo() {
    const last = this.steps.at(-1), earlier = this.steps.slice(0, -1);
    const author = this.view.name;
    if (!last || !author) return false;
    try {
      const { revision } = await ask(`${this.path}/edits/undo`, { method: "POST", body: { revision: last.revision, author } });
      this.steps = earlier;
      this.take({ marks: last.before, revision: revision?.number ?? this.revision });
    } catch (error) {
      if (error.status !== 409) throw error;
      await this.refresh();
      const without = (all) => all.filter((mark) => !last.own.some((own) => same(own, mark) && own.kind === mark.kind));
      this.steps = earlier;
      if (!(await this.save(without, []))) return false;
      // What was saved is no step of its own: it cannot be undone in its turn.
      this.steps = earlier;
    }
    return true;
  }

  async refresh() {
    const { marks, revision } = await ask(`${this.path}/edits`, { signal: this.view.signal });
    // Null: nobody has edited them, what the catalogue says holds.
    if (marks) this.take({ marks, revision });
    else await this.follow();
  }

  async save(change, own) {
    const author = this.view.name;
    if (!author) return false;
    const before = this.saved;
    const marks = change(before);
    try {
      const { revision } = await this.send(marks, author);
      if (revision) this.steps.push({ revision: revision.number, own, before });
      this.take({ marks, revision: revision?.number ?? this.revision });
      // Only now: where nothing could be saved, the choice stays.
      this.conflict.replaceChildren();
      return true;
    } catch (error) {
      if (error.status !== 409) throw error;
      return this.merge(change, own, error.answer.conflicts[0]?.author ?? "somebody else");
    }
  }

  send(marks, author) {
    return ask(`${this.path}/edits`, { method: "POST", body: { changes: { marks }, author, base_revision: this.revision } });
  }

  /** Saves on top of what somebody else has saved, unless they say the opposite of the same highlight. */
  async merge(change, own, other) {
    const base = this.saved;
    await this.refresh();
    const opposite = this.saved.find((mark) => own.some((mine) => same(mine, mark) && mine.kind !== mark.kind));
    if (!opposite || base.some((mark) => same(mark, opposite))) {
      const isSaved = await this.save(change, own);
      if (isSaved) announce(`${other} has saved marks meanwhile: theirs and yours are both kept.`);
      return isSaved;
    }
    const details = element("p", {}, `${other} calls the highlight at x ${opposite.x}, y ${opposite.y} in frame ${opposite.frame.toLocaleString("en")} ${opposite.kind}.`);
    showConflict(this.conflict, "marked", details, { keep: () => this.overrule(change, own), take: () => this.conflict.replaceChildren() });
    return false;
  }

  /** Saves over what somebody else has said; the choice stays until it is saved. */
  async overrule(change, own) {
    if (this.isOverruling) return;
    this.isOverruling = true;
    await this.finish(this.save(change, own));
    this.isOverruling = false;
  }

  show() {
    const rows = this.saved.map((mark, number) => {
      const known = this.tracks.find((track) => same(track, mark) && track.kind === mark.kind);
      const length = known?.track.length;
      const by = known ? `${known.author ?? "catalogue"}: ` : "";
      const words = `${by}frame ${mark.frame.toLocaleString("en")}, x ${mark.x}, y ${mark.y}${length ? `, followed through ${length} ${length === 1 ? "frame" : "frames"}` : ""}`;
      return element("li", { class: mark.kind }, element("button", { type: "button", class: "quiet", title: "Show it", onclick: () => this.ongo(mark) }, `${number + 1}. `, element("b", {}, mark.kind), ` ${words}`),
        element("button", { type: "button", class: "quiet", "aria-label": `Remove mark ${number + 1}`, title: "Remove", onclick: () => this.finish(this.remove(mark)) }, "×"));
    });
    this.doubts.replaceChildren(...(rows.length ? this.problems : []).map((problem) => element("li", { class: "doubt" }, problem)));
    this.list.replaceChildren(...(rows.length ? rows : [element("li", { class: "faint" }, "None yet.")]));
  }
}
