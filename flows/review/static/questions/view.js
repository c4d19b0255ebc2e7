// The questions view: is this highlight reflected by the outer surface? Answers are marks of the capture, saved at once.

import { ask } from "../api.js";
import { Author } from "../author.js";
import { ANSWERS } from "../connection.js";
import { addStyleSheets, announceError, element, percent } from "../dom.js";
import { bind } from "../keys.js";
import { RunPanel } from "../inputs/run.js";
import { Draft } from "./draft.js";
import { FreeMarks } from "./free.js";
import { Loop } from "./loop.js";
import { loopControls } from "./loop_controls.js";
import { Marks } from "./marks.js";

const LIGHT_PX = 96;
const LOOKING = "Looking for the questions that help most …";

export async function open(root, capture, signal) {
  root.classList.add("questions");
  addStyleSheets("/static/questions/questions.css");
  const wait = element("p", { class: "faint waiting", role: "status" }, LOOKING);
  root.append(wait);
  const inputs = await ask(`${capture.path}/inputs`, { signal });
  const view = new QuestionsView(capture, inputs, signal);
  await view.marks.follow();
  wait.replaceWith(...view.parts);
  await view.show("proposed");
  addEventListener(ANSWERS, () => view.resume(), { signal });
}

class QuestionsView {
  constructor(capture, inputs, signal) {
    Object.assign(this, { capture, inputs, signal, path: `${capture.path}/questions`, questions: null, index: 0, indices: [] });
    this.object = element("canvas", { class: "loop", role: "img", "aria-label": "Frames around the highlight, the sheet tinted" });
    this.sphere = element("canvas", { class: "sphere-loop", role: "img", "aria-label": "The chrome sphere in these frames" });
    this.light = element("canvas", { class: "light", width: LIGHT_PX, height: LIGHT_PX, role: "img", "aria-label": "Half vector of light and view" });
    this.loop = new Loop(this, signal);
    this.number = element("output", { class: "frame-number" });
    this.loop.onframe = (frame) => (this.number.textContent = `frame ${frame.toLocaleString("en")}`);
    this.controls = loopControls(this.loop, () => this.tint());
    this.text = element("p", { class: "question", "aria-live": "polite" });
    this.author = new Author("answer");
    this.marks = new Marks(this, () => this.marksChanged(), (mark) => this.go(mark));
    this.draft = new Draft(this.path, this.marks, signal);
    this.buttons = [
      ["True", "t", () => this.answer("true")],
      ["False", "f", () => this.answer("false")],
      ["Skip", "s", () => this.skip()],
      ["Undo", "u", () => this.undo()],
    ].map(([text, key, action]) => element("button", { type: "button", "data-answer": text.toLowerCase(), "aria-keyshortcuts": key, onclick: action }, `${text} `, element("kbd", {}, key)));
    this.modes = [["proposed", "Proposed questions", "q"], ["free", "Mark freely", "p"]].map(([mode, text, key]) =>
      element("button", { type: "button", "data-mode": mode, "aria-keyshortcuts": key, onclick: () => this.show(mode) }, `${text} `, element("kbd", {}, key)));
    this.more = element("button", { type: "button", onclick: () => this.ask() }, "More questions");
    // What the panel of the inputs view expects: answers are saved already.
    Object.assign(this, { history: { isDirty: false }, spheres: { finish() {} } });
    this.run = new RunPanel(this);
    this.place = element("div", { class: "question-place" });
    this.loopPlace = element("div", { class: "loop-place" });
    this.loopSection = element("section", {}, element("h2", {}, "Loop and light"), this.loopPlace, this.number, this.controls, element("div", { class: "line lights" }, this.sphere, this.light));
    this.parts = [
      element("div", { class: "question-stage" },
        element("div", { class: "line", role: "group", "aria-label": "What to mark" }, this.modes), this.text, this.place,
        element("div", { class: "line answers", role: "group", "aria-label": "Answer" }, this.buttons)),
      element("aside", { "aria-label": "Light and answers" },
        this.loopSection,
        element("section", {}, element("h2", {}, "Answers"), this.author.input, this.draft.state, this.draft.picture, this.more),
        this.marks.root, this.run.root),
    ];
  }

  /** Shows the questions that are proposed, or a picture to mark highlights on. */
  async show(mode) {
    this.mode = mode;
    const isFree = mode === "free";
    for (const button of this.modes) button.setAttribute("aria-pressed", String(button.dataset.mode === mode));
    this.leaving?.abort();
    this.leaving = new AbortController();
    bind(this.keys(isFree), AbortSignal.any([this.signal, this.leaving.signal]));
    this.buttons[2].hidden = this.more.hidden = isFree;
    this.loop.forget();
    if (isFree) {
      this.free ??= new FreeMarks(this, this.inputs);
      this.place.replaceChildren(this.free.root);
      this.loopPlace.replaceChildren(this.object);
      this.free.picture.resize();
      this.free.forget();
      return;
    }
    this.place.replaceChildren(this.object);
    if (this.questions) await this.showQuestion();
    else await this.ask();
  }

  keys(isFree) {
    const common = [
      ["t T", "true: the outer surface reflects this", () => this.answer("true")],
      ["f F", "false: the light came through the glass", () => this.answer("false")],
      ["u U", "undo the last answer", () => this.undo()],
      ["q", "the questions that are proposed", () => this.show("proposed")],
      ["p", "mark highlights freely", () => this.show("free")],
      ["Space", "stop or go on", () => this.loop.toggle()],
      ["h", "tint, or not", () => this.tint()],
      ["g", "run from here", () => this.run.start()],
    ];
    const proposed = [
      ["s S", "skip", () => this.skip()],
      ["ArrowRight .", "next frame", () => this.loop.step(1)],
      ["ArrowLeft ,", "frame before", () => this.loop.step(-1)],
    ];
    if (!isFree) return [...common, ...proposed];
    this.free ??= new FreeMarks(this, this.inputs);
    return [...common, ...this.free.keys];
  }

  get question() {
    return this.questions?.[this.index];
  }

  reload() {
    dispatchEvent(new HashChangeEvent("hashchange"));
  }

  tint() {
    this.loop.tinted = !this.loop.tinted;
    this.loop.ontint?.();
    if (this.loop.question) this.loop.draw();
  }

  say(text, isRefused = false) {
    this.text.textContent = text;
    this.text.classList.toggle("refused", isRefused);
  }

  /** Shows what is asked about now: its loop, and what can be answered. */
  async showAsked(question, text, refused = {}) {
    this.asked = question;
    const [isTrue, isFalse, skip, undo] = this.buttons;
    for (const button of [isTrue, isFalse, skip]) button.disabled = !question;
    for (const [button, kind] of [[isTrue, "true"], [isFalse, "false"]]) button.title = refused[kind] ? `Refused: ${refused[kind]}` : "";
    undo.disabled = !this.marks.steps.length;
    for (const part of [this.object, this.loopSection, this.light]) part.hidden = !question;
    if (!question) this.sphere.hidden = true;
    this.say(text);
    if (!question) return this.loop.forget();
    try {
      await this.loop.show(question, this.path, this.signal);
    } catch (error) {
      // The loop before is not that of this question.
      if (error.name !== "AbortError") for (const part of [this.object, this.sphere, this.light]) part.hidden = true;
      announceError(error);
    }
  }

  async showQuestion() {
    const { question } = this;
    if (!question) return this.showAsked(null, this.questions.length ? "All of these are answered or skipped." : "There is nothing to ask: no frame shows a sheet in doubt. Mark freely what you know.");
    const now = question.accepted ? "Glint takes it for the outer surface" : "Glint does not take it for the outer surface";
    await this.showAsked(question, `${this.index + 1} of ${this.questions.length}: does the outer surface reflect the tinted highlight? ${now}, and is wrong with a probability of ${question.wrong < 0.01 ? "less than 1%" : percent(question.wrong)}.`);
  }

  /** Shows a highlight that was chosen on the picture, or (null) why there is none. */
  async showChoice(choice, text, isRefused = false) {
    this.loop.tracks = this.marks.tracks.concat(choice ? choice.highlights.map(({ track }) => ({ kind: null, track })) : []);
    await this.showAsked(choice, text, choice?.refused);
    if (isRefused) this.say(text, true);
  }

  get name() {
    return this.author.name;
  }

  async answer(kind) {
    if (this.mode === "free") {
      const marks = this.name && this.free.labelled(kind);
      if (marks) await this.save(async () => (await this.marks.add(marks)) && this.free.forget());
      return;
    }
    const question = this.asked;
    if (!question || !this.name) return;
    await this.save(async () => {
      const { frame, x, y } = question;
      if (!(await this.marks.add([{ frame, x, y, kind }]))) return;
      this.indices[this.marks.steps.length] = this.index;
      this.index += 1;
    });
  }

  skip() {
    if (!this.asked || this.isBusy) return;
    this.index += 1;
    this.showQuestion();
  }

  async undo() {
    await this.save(async () => {
      const step = this.marks.steps.length;
      if ((await this.marks.undo()) && this.mode !== "free") this.index = this.indices[step] ?? this.index;
    });
  }

  /** Saves one thing at a time, and shows the question and the change that follow; tracks may come later. */
  async save(request) {
    if (this.isBusy) return;
    this.isBusy = true;
    try {
      await request().finally(() => (this.isBusy = false));
      if (this.mode !== "free") this.showQuestion();
      this.marksChanged();
      await this.marks.follow();
    } catch (error) {
      announceError(error);
    }
  }

  /** Shows what could not be shown while the server did not answer. */
  resume() {
    if (this.mode === "free") return;
    if (!this.questions) this.ask();
    else if (this.asked && !this.loop.question) this.showQuestion();
  }

  go(mark) {
    if (this.mode !== "free") this.show("free");
    this.free.go(mark);
  }

  marksChanged() {
    this.loop.tracks = this.marks.tracks;
    this.free?.draw();
    this.buttons[3].disabled = !this.marks.steps.length;
    this.draft.show();
  }

  /** Asks for the questions that help most after these answers. */
  async ask() {
    this.more.disabled = true;
    this.showAsked(null, LOOKING);
    try {
      const { questions, marks, revision } = await ask(this.path, { signal: this.signal });
      Object.assign(this, { questions, index: 0, indices: [] });
      this.marks.take({ marks, revision });
      if (this.mode !== "free") await this.showQuestion();
    } catch (error) {
      if (error.name !== "AbortError") this.say(error.message, true);
    } finally {
      this.more.disabled = false;
    }
  }
}
