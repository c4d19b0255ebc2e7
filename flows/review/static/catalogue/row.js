// What a row of the catalogue view says of a capture.

import { addressOf, capturePath } from "../api.js";
import { duration, element, moment, percent } from "../dom.js";
import { reasonOf } from "./reasons.js";

/** Returns the parts of a capture's row; image: that of the row before, kept where it shows the same;
 *  onmore: shows all that is said about the capture. */
export function cellsOf(data, image, onmore) {
  const source = `${capturePath(data.object, data.capture)}/thumbnail?of=${encodeURIComponent(data.version || data.state)}`;
  if (image?.getAttribute("src") !== source) {
    image = element("img", { src: source, alt: "", loading: "lazy", decoding: "async" });
    image.addEventListener("error", () => image.classList.add("missing"));
  }
  return [
    image,
    element("a", { class: "name", title: `${data.object}/${data.capture}`, href: addressOf(data.object, data.capture) },
      element("b", {}, data.object), element("span", {}, data.capture)),
    element("div", { class: `state ${data.state}` }, element("span", { class: "dot", "aria-hidden": "true" }), element("span", {}, stateText(data))),
    reasonOf(data, onmore),
    element("div", { class: "share", title: "Share of the object whose normals are within 5 degrees with a probability of at least 95 %" },
      confidentBar(data.confident), element("span", {}, percent(data.confident), element("small", {}, "confident"))),
    element("div", { class: "version" }, element("b", {}, data.version || "–"), element("span", {}, moment(data.date))),
  ];
}

function stateText(data) {
  if (data.state !== "running") return data.verdict && data.state !== "failed" ? data.verdict : data.state;
  const parts = [data.stage || "starting"];
  if (data.progress !== null) parts.push(percent(data.progress));
  if (data.seconds_left) parts.push(`about ${duration(data.seconds_left)} left`);
  return parts.join(" · ");
}

function confidentBar(share) {
  const bar = element("span", { class: "bar", "aria-hidden": "true" }, element("span"));
  bar.firstChild.style.width = `${Math.round((share ?? 0) * 100)}%`;
  return bar;
}
