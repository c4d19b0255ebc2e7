// The buttons of a loop, for those who have no keys.

import { element } from "../dom.js";

/** loop: what they stop and step; tint: shows its tint, or not. Returns their group. */
export function loopControls(loop, tint) {
  const button = (text, label, onclick) => element("button", { type: "button", "aria-label": label, onclick }, text);
  const play = button("", null, () => loop.toggle());
  const tinted = button("Tint", null, tint);
  loop.onplaying = () => (play.textContent = loop.playing ? "Stop" : "Play");
  loop.ontint = () => tinted.setAttribute("aria-pressed", String(loop.tinted));
  loop.onplaying();
  loop.ontint();
  return element("div", { class: "line", role: "group", "aria-label": "Loop" },
    button("‹", "Frame before", () => loop.step(-1)), play, button("›", "Next frame", () => loop.step(1)), tinted);
}
