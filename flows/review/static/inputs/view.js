// The inputs view: what went into a capture, seen and corrected on its picture.

import { ask } from "../api.js";
import { element } from "../dom.js";
import { bind } from "../keys.js";
import { guardLeaving } from "../leaving.js";
import { CameraLayer } from "./camera.js";
import { History } from "./history.js";
import { LightDome } from "./lights.js";
import { MaskLayer } from "./mask.js";
import { Picture } from "./picture.js";
import { PixelPanel } from "./pixel.js";
import { PoseLayer } from "./pose.js";
import { RegionLayer } from "./region.js";
import { RunPanel } from "./run.js";
import { SavePanel } from "./save.js";
import { ScaleLayer } from "./scale.js";
import { SphereLayer } from "./spheres.js";
import { Timeline } from "../timeline.js";

const TOOLS = [
  ["look", "Look", "v", "drag to move, wheel or two fingers to zoom, click a pixel for its highlights"],
  ["spheres", "Spheres", "s", "drag a circle or its handle; double-click adds one, Delete removes it"],
  ["brush", "Brush", "b", "paint the object; [ and ] change the size"],
  ["eraser", "Eraser", "e", "take away what is not the object"],
  ["grow", "Grow", "w", "click what belongs to the object and looks alike; Shift+click takes it away; the slider Tolerance adjusts it"],
  ["polygon", "Polygon", "p", "click corners, or move the cursor by arrow keys and set them by Enter; Enter on the last or first corner fills, Shift+Enter cuts out, Backspace takes a corner back, Escape cancels"],
  ["region", "Region", "r", "drag the rectangle's corners"],
  ["scale", "Scale", "l", "draw a line of known length"],
  ["camera", "Camera", "c", "drag the cross, where the camera looks straight ahead; the mark on the circle turns the object"],
];

const TOOL_BY_CAUSE = { sphere: "spheres", mask: "brush", camera: "camera", scale: "scale" };

export async function open(root, capture, signal) {
  root.classList.add("inputs");
  const [inputs, edits] = await Promise.all([
    ask(`${capture.path}/inputs`, { signal }),
    ask(`${capture.path}/edits`, { signal }),
  ]);
  new InputsView(root, capture, inputs, edits, signal);
}

class InputsView {
  constructor(root, capture, inputs, edits, signal) {
    Object.assign(this, { capture, inputs, edits, signal });
    this.history = new History(() => this.changed(), () => this.isChanged);
    this.stage = element("div", { class: "stage", role: "group", tabindex: "0", "aria-label": "Picture of the capture" });
    this.tools = element("div", { class: "tools", role: "toolbar", "aria-label": "Tools" });
    this.hint = element("p", { class: "hint", "aria-live": "polite" });
    this.timeline = new Timeline(inputs.frames, () => this.showPicture());
    this.side = element("aside", { "aria-label": "Inputs" });
    root.append(this.tools, element("div", { class: "stage-column" }, this.stage, this.hint, this.timeline.root), this.side);

    this.picture = new Picture(this.stage, inputs.frame_size, signal);
    this.mask = new MaskLayer(this);
    this.region = new RegionLayer(this);
    this.spheres = new SphereLayer(this);
    this.scale = new ScaleLayer(this);
    this.camera = new CameraLayer(this);
    this.pose = new PoseLayer(this);
    this.lights = new LightDome(this);
    this.pixel = new PixelPanel(this);
    this.run = new RunPanel(this);
    this.save = new SavePanel(this);
    this.side.append(
      this.verdict(), this.save.root, this.save.past, this.run.root, this.lights.root, this.pixel.root, this.spheres.root, this.mask.root,
      this.region.root, this.scale.root, this.camera.root, this.pose.root,
    );
    for (const [name, text, key] of TOOLS) {
      this.tools.append(element("button", { type: "button", "data-tool": name, "aria-keyshortcuts": key, onclick: (event) => this.choose(name, event.detail === 0) }, text, " ", element("kbd", {}, key)));
    }
    this.bindKeys();
    this.side.addEventListener("keydown", (event) => {
      // A number is entered: keys go to the picture again.
      if (event.target.matches("input[type=number]") && ["Enter", "Escape"].includes(event.key)) this.stage.focus({ preventScroll: true });
    });
    this.picture.onclick = (point, event) => this.clicked(point, event);
    this.use("look");
    this.show("background");
  }

  verdict() {
    const warnings = this.inputs.warnings.map((warning) =>
      element("li", { class: `cause-${warning.cause}` }, element("b", {}, warning.cause), " ", warning.message, " ", this.toolFor(warning.cause)));
    const { verdict } = this.inputs;
    const [word, ...reason] = verdict?.split(": ") ?? [];
    // Its reason is mostly the first warning's.
    const isSaid = this.inputs.warnings.some(({ message }) => message.startsWith(reason.join(": ")));
    return element("section", {}, element("h2", {}, verdict ? `Verdict: ${isSaid ? word : verdict}` : "No results yet"), warnings.length ? element("ul", { class: "warnings-list" }, warnings) : null);
  }

  /** Returns the button of the tool that corrects what a warning is about, null where none does. */
  toolFor(cause) {
    const tool = TOOL_BY_CAUSE[cause];
    if (!tool) return null;
    const text = TOOLS.find(([name]) => name === tool)[1];
    return element("button", { type: "button", "aria-label": `${text}: correct the ${cause}`, onclick: () => this.use(tool) }, text);
  }

  get shown() {
    return this.timeline.shown;
  }

  /** Shows `peak`, `background`, `mean` or a frame's number. */
  show(what) {
    this.timeline.show(what);
  }

  step(by) {
    this.timeline.step(by);
  }

  showPicture() {
    this.lights.mark(this.timeline.frame);
    return this.picture.show(`${this.capture.path}/${this.timeline.path}`);
  }

  use(tool) {
    this.tool = tool;
    for (const button of this.tools.children) button.setAttribute("aria-pressed", String(button.dataset.tool === tool));
    this.hint.textContent = TOOLS.find(([name]) => name === tool)[3];
    this.stage.dataset.tool = tool;
    this.picture.pans = ["look", "grow", "spheres", "region", "camera"].includes(tool);
    for (const layer of [this.mask, ...this.layers]) layer.toolChanged(tool);
    if (tool === "grow") this.show("peak");
    const panel = { spheres: this.spheres, brush: this.mask, eraser: this.mask, grow: this.mask, polygon: this.mask, region: this.region, scale: this.scale, camera: this.camera }[tool];
    panel?.root.scrollIntoView({ block: "nearest" });
  }

  /** Uses a tool that was chosen in the toolbar or by its key; keys then go to the picture, not to a button. */
  choose(tool, byKey) {
    this.use(tool);
    if (byKey) this.stage.focus({ preventScroll: true });
  }

  /** Opens the view anew, with what the last run has left. */
  reload() {
    dispatchEvent(new HashChangeEvent("hashchange"));
  }

  clicked(point, event) {
    if (this.tool === "look") this.pixel.ask(Math.round(point.x), Math.round(point.y));
    else if (this.tool === "grow") this.mask.growth.grow(point, event.shiftKey);
    else if (this.tool === "spheres" && event.detail > 1) this.spheres.add(point);
  }

  /** What lies over the picture besides the mask. */
  get layers() {
    return [this.spheres, this.region, this.scale, this.camera, this.pose];
  }

  undo() {
    this.spheres.finish();
    this.history.undo();
  }

  redo() {
    this.spheres.finish();
    this.history.redo();
  }

  /** Whether anything differs from what is saved. */
  get isChanged() {
    return [this.mask, ...this.layers].some((layer) => layer.isChanged);
  }

  /** Whether anything would be lost: changes that are not saved, or corners of a polygon that is not filled. */
  get isUnsaved() {
    return this.history.isDirty || this.mask.polygon.corners.length > 0;
  }

  forget() {
    this.mask.polygon.cancel();
    this.history.clear();
  }

  changed() {
    this.save?.show();
  }

  /** Returns what differs from the saved edits, by field, ready to be sent. */
  async changes() {
    const parts = await Promise.all([this.mask, ...this.layers].map((layer) => layer.changes()));
    return Object.assign({}, ...parts);
  }

  bindKeys() {
    bind([
      ...TOOLS.map(([name, text, key]) => [key, text.toLowerCase(), () => this.choose(name, true)]),
      ...this.timeline.keys,
      ["ArrowRight .", "next frame; sphere, brush or corner to the right", () => this.nudge(1, 0) || this.step(1)],
      ["ArrowLeft ,", "frame before; or to the left", () => this.nudge(-1, 0) || this.step(-1)],
      ["ArrowUp", "sphere, brush, corner or picture up", () => this.nudge(0, -1) || this.picture.move(0, 60)],
      ["ArrowDown", "and down", () => this.nudge(0, 1) || this.picture.move(0, -60)],
      ["+ =", "zoom in", () => this.picture.zoomBy(1.25)],
      ["-", "zoom out", () => this.picture.zoomBy(0.8)],
      ["0", "whole picture", () => this.picture.fit()],
      ["[", "smaller brush or sphere", () => this.resize(-1)],
      ["]", "larger brush or sphere", () => this.resize(1)],
      ["Space", "paint, or set a corner, at the cursor of the keyboard; choose or grow from the middle of what is shown", (event) => this.mask.paintAtCursor() || this.choosePixel(event)],
      ["a", "add a sphere in the middle", () => this.spheres.add(this.picture.centre())],
      ["Delete Backspace", "remove the last corner, or the chosen sphere", () => this.mask.polygon.removeLast() || this.spheres.removeChosen()],
      ["Enter Shift+Enter", "set a corner; on the last or first one fill the polygon, with Shift cut it out; fit the sphere", (event) => this.mask.polygon.enter(event.shiftKey) || this.spheres.fitChosen()],
      ["Escape", "cancel", () => (this.tool === "polygon" && this.mask.polygon.cancel()) || this.use("look")],
      ["Ctrl+z", "undo", () => this.undo()],
      ["Ctrl+y Ctrl+Z", "redo", () => this.redo()],
      ["Ctrl+s", "save", () => this.save.save()],
      ["g", "run from here", () => this.run.start()],
    ].map(([key, text, action]) => [key, text, (event) => this.isLocked || action(event)]), this.signal);
    guardLeaving(() => this.isUnsaved, () => this.forget(), this.signal);
  }

  /** Lets nobody change anything, neither by mouse nor by keys, until it is unlocked. */
  lock(isLocked) {
    this.isLocked = isLocked;
    // What is inert loses the focus.
    if (isLocked) this.focused = document.activeElement;
    for (const part of [this.tools, this.stage, this.side]) part.inert = isLocked;
    if (!isLocked) this.focused?.focus({ preventScroll: true });
  }

  nudge(x, y) {
    if (this.tool === "spheres") return this.spheres.nudge(x, y);
    if (["brush", "eraser", "polygon"].includes(this.tool)) return this.mask.moveCursor(x, y);
    return false;
  }

  resize(by) {
    if (this.tool === "spheres") this.spheres.grow(by);
    else this.mask.resize(by);
  }

  choosePixel(event) {
    const point = this.picture.centre();
    if (this.tool === "grow") this.mask.growth.grow(point, event.shiftKey);
    else this.pixel.ask(Math.round(point.x), Math.round(point.y));
  }
}
