// The row of a view in the table of poses; its elements stay the same, so that the keyboard's place is kept.

import { addressOf } from "../api.js";
import { element, typedNumber } from "../dom.js";
import { direction, turnOf } from "./plan.js";
import { POSE_KINDS, TURN, kindOf, turnBetween } from "./pose.js";

const NOTICED_DEG = 1;

export class PoseRow {
  /** onkind: called with the kind of pose that is chosen; onturn: with the degrees that are typed. */
  constructor(object, capture, onkind, onturn) {
    this.origin = element("span", { class: "faint" });
    this.kind = element("select", { "aria-label": `Pose of ${capture}`, onchange: () => onkind(this.kind.value) },
      POSE_KINDS.map(([value, text]) => element("option", { value }, text)));
    this.angle = element("input", {
      type: "number", step: "any", "aria-label": `Degrees of ${capture}`,
      onchange: () => {
        const turn = typedNumber(this.angle, ...TURN);
        if (turn === null) this.show(this.view);
        else onturn(turn);
      },
    });
    this.link = element("a", { href: addressOf(object, capture) }, "under Inputs");
    this.none = element("span", {}, "–");
    this.fit = element("td", {});
    this.root = element("tr", {}, element("th", { scope: "row" }, capture, " ", this.origin), element("td", {}, this.kind),
      element("td", {}, this.angle, this.link, this.none), this.fit);
  }

  /** Shows a view of the server's answer, with what was changed on the page. */
  show(view) {
    const { pose, is_edited: isEdited, isChanged, damage } = this.view = view;
    const kind = kindOf(pose);
    this.root.classList.toggle("is-changed", isChanged);
    this.origin.textContent = isChanged ? "changed" : isEdited ? "set here" : pose ? "catalogue" : "";
    this.kind.value = kind;
    this.kind.disabled = Boolean(damage);
    this.angle.value = kind === "turntable" ? String(pose.turntable) : "";
    this.angle.hidden = kind !== "turntable";
    this.link.hidden = kind !== "camera_to_world";
    this.none.hidden = kind !== "";
    this.fit.replaceChildren(fitWords(view));
  }
}

/** How a view's pose agrees with the last model. */
function fitWords({ pose, found, left_out: leftOut, damage }) {
  if (damage) return element("span", { class: "doubt" }, damage);
  if (leftOut) return element("span", { class: "doubt" }, `left out: ${leftOut}`);
  if (!found) return element("span", { class: "faint" }, "no model");
  const misses = `contour off by ${found.outline_misses_pixels.toFixed(1)} px`;
  if (pose?.turntable === undefined) return misses;
  const turn = turnOf(direction({ camera_to_world: found.camera_to_world }));
  const off = turnBetween(pose.turntable, turn);
  return Math.abs(off) < NOTICED_DEG ? misses : `${misses}; it has ${off > 0 ? "+" : ""}${off.toFixed(1)}°`;
}
