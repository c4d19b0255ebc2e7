// The questions view: is this highlight reflected by the outer surface? Answers are marks of the capture, saved at once.

import { ask } from "../api.js";
import { announce, element } from "../dom.js";
import { bind } from "../keys.js";
import { RunPanel } from "../inputs/run.js";
import { Loop } from "./loop.js";

const LIGHT_PX = 96;

export async function open(root, capture, signal) {
  root.classList.add("questions");
  if (!document.querySelector('link[href="/static/questions/questions.css"]')) {
    document.head.append(element("link", { rel: "stylesheet", href: "/static/questions/questions.css" }));
  }
  const wait = element("p", { class: "faint waiting", role: "status" }, "Looking for the questions that help most …");
  root.append(wait);
  const proposed = await ask(`${capture.path}/questions`, { signal });
  wait.remove();
  new QuestionsView(root, capture, proposed, signal);
}

class QuestionsView {
  constructor(root, capture, proposed, signal) {
    Object.assign(this, { root, capture, signal, path: `${capture.path}/questions`, answered: [] });
    this.take(proposed);
    this.object = element("canvas", { class: "loop", role: "img", "aria-label": "Frames around the highlight, the sheet tinted" });
    this.sphere = element("canvas", { class: "sphere-loop", role: "img", "aria-label": "The chrome sphere in these frames" });
    this.light = element("canvas", { class: "light", width: LIGHT_PX, height: LIGHT_PX, role: "img", "aria-label": "Half vector of light and view" });
    this.loop = new Loop(this, signal);
    this.number = element("output", { class: "frame-number" });
    this.loop.onframe = (frame) => (this.number.textContent = `frame ${frame.toLocaleString("en")}`);
    this.text = element("p", { class: "question", "aria-live": "polite" });
    this.change = element("p", { class: "faint", role: "status" });
    this.picture = element("img", { class: "normals", alt: "Normals with the answers", hidden: true });
    this.author = element("input", { type: "text", maxlength: "80", placeholder: "Your name", "aria-label": "Your name, saved with every answer", autocomplete: "name", onchange: () => localStorage.setItem("author", this.author.value) });
    this.author.value = localStorage.getItem("author") ?? "";
    this.buttons = [
      ["True", "t", () => this.answer("true")],
      ["False", "f", () => this.answer("false")],
      ["Skip", "s", () => this.skip()],
      ["Undo", "u", () => this.undo()],
    ].map(([text, key, action]) => element("button", { type: "button", "data-answer": text.toLowerCase(), "aria-keyshortcuts": key, onclick: action }, `${text} `, element("kbd", {}, key)));
    this.more = element("button", { type: "button", onclick: () => this.ask() }, "More questions");
    // What the panel of the inputs view expects: answers are saved already.
    Object.assign(this, { history: { isDirty: false }, spheres: { finish() {} } });
    this.run = new RunPanel(this);
    root.append(
      element("div", { class: "question-stage" }, this.text, this.object,
        element("div", { class: "line answers", role: "group", "aria-label": "Answer" }, this.buttons), this.number),
      element("aside", { "aria-label": "Light and answers" },
        element("section", {}, element("h2", {}, "Light"), element("div", { class: "line lights" }, this.sphere, this.light)),
        element("section", {}, element("h2", {}, "Answers"), this.author, this.change, this.picture, this.more),
        this.run.root));
    bind([
      ["t T", "true: the outer surface reflects this", () => this.answer("true")],
      ["f F", "false: the light came through the glass", () => this.answer("false")],
      ["s S", "skip", () => this.skip()],
      ["u U", "undo the last answer", () => this.undo()],
      ["Space", "stop or go on", () => this.loop.toggle()],
      ["ArrowRight .", "next frame", () => this.loop.step(1)],
      ["ArrowLeft ,", "frame before", () => this.loop.step(-1)],
      ["h", "tint, or not", () => this.tint()],
      ["g", "run from here", () => this.run.start()],
    ], signal);
    this.showQuestion();
    this.showChange();
  }

  take({ questions, marks, revision }) {
    Object.assign(this, { questions, marks, revision, index: 0 });
  }

  get question() {
    return this.questions[this.index];
  }

  reload() {
    dispatchEvent(new HashChangeEvent("hashchange"));
  }

  tint() {
    this.loop.tinted = !this.loop.tinted;
    if (this.loop.question) this.loop.draw();
  }

  async showQuestion() {
    const { question } = this;
    const [isTrue, isFalse, skip, undo] = this.buttons;
    for (const button of [isTrue, isFalse, skip]) button.disabled = !question;
    undo.disabled = !this.answered.length;
    this.object.hidden = !question;
    if (!question) {
      this.text.textContent = this.questions.length ? "All of these are answered or skipped." : "There is nothing to ask: no frame shows a sheet in doubt.";
      return;
    }
    const now = question.accepted ? "it is taken for the outer surface" : "it is not taken for it";
    this.text.textContent = `${this.index + 1} of ${this.questions.length}: does the outer surface reflect the tinted highlight? Now ${now}; wrong with a probability of ${Math.round(question.wrong * 100)}%.`;
    try {
      await this.loop.show(question, this.path, this.signal);
    } catch (error) {
      if (error.name !== "AbortError") announce(error.message, "error");
    }
  }

  get name() {
    const name = this.author.value.trim();
    if (!name) {
      announce("Write your name: it is saved with every answer.", "error");
      this.author.focus();
    }
    return name;
  }

  /** Saves an answer; a conflict keeps what somebody else saved, and asks anew. */
  async answer(kind) {
    const { question } = this;
    const author = this.name;
    if (!question || !author) return;
    await this.save(async () => {
      const { frame, x, y } = question;
      const marks = [...this.marks, { frame, x, y, kind }];
      const { revision } = await ask(`${this.capture.path}/edits`, { method: "POST", body: { changes: { marks }, author, base_revision: this.revision } });
      this.marks = marks;
      if (revision) {
        this.revision = revision.number;
        this.answered.push({ revision: revision.number, index: this.index });
      }
      this.index += 1;
    });
  }

  skip() {
    if (!this.question || this.isBusy) return;
    this.index += 1;
    this.showQuestion();
  }

  async undo() {
    const last = this.answered.at(-1);
    const author = this.name;
    if (!last || !author) return;
    await this.save(async () => {
      const { revision } = await ask(`${this.capture.path}/edits/undo`, { method: "POST", body: { revision: last.revision, author } });
      this.answered.pop();
      this.marks = this.marks.slice(0, -1);
      this.revision = revision.number;
      this.index = last.index;
    });
  }

  /** Saves one thing at a time, and shows the question and the change that follow. */
  async save(request) {
    if (this.isBusy) return;
    this.isBusy = true;
    try {
      await request();
      this.showQuestion();
      this.showChange();
    } catch (error) {
      await this.refused(error);
    } finally {
      this.isBusy = false;
    }
  }

  async refused(error) {
    if (error.name === "AbortError") return;
    announce(error.status === 409 ? "Not saved: somebody else has changed the marks. These are the questions now." : error.message, "error");
    if (error.status === 409) await this.ask();
  }

  /** Asks for the questions that help most after these answers. */
  async ask() {
    this.more.disabled = true;
    this.text.textContent = "Looking for the questions that help most …";
    try {
      this.take(await ask(this.path, { signal: this.signal }));
      this.answered = [];
      this.showQuestion();
    } catch (error) {
      if (error.name !== "AbortError") announce(error.message, "error");
    } finally {
      this.more.disabled = false;
    }
  }

  /** Shows what the answers change, labelled anew at once. */
  async showChange() {
    const marks = this.marks.length;
    this.change.textContent = marks ? `${marks} marks, labelling anew …` : "No marks yet.";
    if (!marks) {
      this.picture.hidden = true;
      return;
    }
    try {
      const made = await ask(`${this.path}/labelling`, { signal: this.signal });
      if (made.revision !== this.revision) return;
      const what = made.changed_pixels ? `${made.changed_pixels.toLocaleString("en")} normals change, by ${made.changed_deg}° on average` : "no normals change";
      this.change.textContent = `${marks} ${marks === 1 ? "mark" : "marks"}: ${what} (draft, ${made.seconds} s). Run from here for the final labels.`;
      this.picture.src = `${this.path}/normals?revision=${made.revision}`;
      this.picture.hidden = false;
    } catch (error) {
      if (error.name !== "AbortError") this.change.textContent = error.message;
    }
  }
}
