// The views of an object from above: the camera of each on a circle around the object, to be dragged and turned by keys.

import { element } from "../dom.js";
import { draw } from "../viewer/elements.js";
import { turnBetween } from "./pose.js";

const HALF = 150;
const CIRCLE = 96;
const CAMERA = 27;
const INNER = 74;
const FAR = 10;
/** Letters of a capture's name that have room beside its camera. */
const LONGEST_NAME = 16;

/** Where the camera of a pose stands: x to the right, z to the bottom, as far as the plan shows it; null: not known. */
export function direction(pose) {
  if (!pose) return null;
  if (pose.turntable !== undefined) {
    const angle = (pose.turntable * Math.PI) / 180;
    return [-Math.sin(angle), Math.cos(angle)];
  }
  const [across, , depth] = pose.camera_to_world.map((row) => row[2]);
  return [across, depth];
}

/** The turntable's angle of a camera that stands there, -180 to 180 degrees. */
export function turnOf([x, z]) {
  return (Math.atan2(-x, z) * 180) / Math.PI;
}

export class Plan {
  /** onturn: called with a view's number and its angle while it moves; onend: when it has moved. */
  constructor(views, path, onturn, onend) {
    Object.assign(this, { views, onturn, onend });
    this.root = draw("svg", { class: "plan", viewBox: `${-HALF} ${-HALF} ${2 * HALF} ${2 * HALF}`, role: "group", "aria-label": "The object from above, and the cameras of its views" });
    this.found = draw("g", { class: "found" });
    this.cameras = views.map(({ capture }, number) => this.camera(capture, number, path(capture)));
    this.root.append(
      draw("circle", { class: "table", r: String(CIRCLE) }),
      draw("path", { class: "turning", d: "M -22 12 A 26 26 0 0 0 22 12 M 22 12 l -9 1 M 22 12 l -2 9" }),
      draw("text", { class: "axis", y: "2" }, "object"), draw("text", { class: "axis", y: "50" }, "turned by + degrees"),
      draw("text", { class: "axis", y: String(HALF - 4) }, "front: 0°"), this.found, ...this.cameras);
  }

  camera(capture, number, path) {
    const group = draw("g", { class: "camera", tabindex: "0", role: "slider", "aria-label": `Angle of ${capture}, degrees`, "aria-valuemin": "-36000", "aria-valuemax": "36000" },
      draw("line", { class: "sight" }),
      draw("rect", { x: String(-CAMERA / 2), y: String(-CAMERA / 2), width: String(CAMERA), height: String(CAMERA), rx: "3" }),
      draw("image", { href: `${path}/thumbnail`, x: String(-CAMERA / 2 + 1), y: String(-CAMERA / 2 + 1), width: String(CAMERA - 2), height: String(CAMERA - 2) }),
      draw("title", {}, capture), draw("text", { y: String(CAMERA / 2 + 8) }, capture.length > LONGEST_NAME ? `${capture.slice(0, LONGEST_NAME)}…` : capture));
    group.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || this.views[number].pose?.turntable === undefined) return;
      event.preventDefault();
      group.setPointerCapture(event.pointerId);
      group.focus();
      this.moving = number;
      this.before = this.views[number].pose;
    });
    group.addEventListener("pointermove", (event) => this.moving === number && this.onturn(number, this.angle(event)));
    // Also where the browser takes the pointer away.
    group.addEventListener("lostpointercapture", () => {
      if (this.moving !== number) return;
      this.moving = null;
      this.onend(number, this.before);
    });
    group.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
      const { pose } = this.views[number];
      if (!step || pose?.turntable === undefined) return;
      event.preventDefault();
      event.stopPropagation();
      this.onturn(number, pose.turntable + step * (event.shiftKey ? FAR : 1));
      this.onend(number, pose);
    });
    return group;
  }

  /** The angle at the pointer, of the turn that is nearest to the one the view has. */
  angle(event) {
    const box = this.root.getBoundingClientRect();
    const at = turnOf([event.clientX - box.x - box.width / 2, event.clientY - box.y - box.height / 2]);
    const now = this.views[this.moving].pose.turntable;
    return Math.round(now + turnBetween(now, at));
  }

  show() {
    const unknown = this.views.filter(({ pose }) => !pose);
    this.found.replaceChildren();
    for (const [number, { pose, found, isChanged }] of this.views.entries()) {
      const group = this.cameras[number];
      const place = direction(pose);
      const [x, z] = place ? place.map((part) => part * CIRCLE) : [-HALF + 20 + 34 * unknown.indexOf(this.views[number]), -HALF + 28];
      group.setAttribute("transform", `translate(${x} ${z})`);
      // The name stands outside the circle.
      group.querySelector("text").setAttribute("y", String(z < 0 ? -CAMERA / 2 - 3 : CAMERA / 2 + 8));
      group.classList.toggle("is-changed", Boolean(isChanged));
      group.classList.toggle("is-fixed", pose?.turntable === undefined);
      group.setAttribute("aria-valuenow", String(pose?.turntable ?? 0));
      group.setAttribute("aria-valuetext", pose ? (pose.turntable === undefined ? "a matrix" : `${pose.turntable} degrees`) : "not known");
      const sight = group.querySelector(".sight");
      for (const [name, value] of Object.entries({ x1: 0, y1: 0, x2: place ? -x * 0.36 : 0, y2: place ? -z * 0.36 : 0 })) sight.setAttribute(name, String(value));
      if (!found) continue;
      const [fx, fz] = direction({ camera_to_world: found.camera_to_world }).map((part) => part * INNER);
      this.found.append(draw("circle", { cx: String(fx), cy: String(fz), r: "3.5" }, draw("title", {}, `Where the last model has ${this.views[number].capture}`)));
    }
  }
}

/** What the plan's parts mean. */
export function legend() {
  return element("p", { class: "faint" }, "Seen from above; the camera of each view looks at the object. Drag it, or choose it with Tab and turn it with the arrow keys (Shift: ten degrees). A green point is where the last model has the view.");
}
