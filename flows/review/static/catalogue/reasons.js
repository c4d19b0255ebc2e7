// What is said about a capture: a row has room for two lines, a dialog for all of it.

import { addressOf } from "../api.js";
import { element } from "../dom.js";

/** Returns all that is said about a capture: its error and what to do, the verdict's reason, the warnings. */
function textsOf(data) {
  return [data.error, data.remedy, data.reason, ...data.warnings].filter(Boolean);
}

/** Returns the first of it, and a button for the rest, which `offerMore` shows where there is any. */
export function reasonOf(data, onmore) {
  const texts = textsOf(data);
  return element("div", { class: "about" },
    element("div", { class: "reason" }, texts[0] ?? ""),
    element("button", { type: "button", class: "more", "data-texts": String(texts.length), "aria-label": `More about ${data.object}/${data.capture}`, "aria-haspopup": "dialog", onclick: onmore }, "More"));
}

/** Offers `More` in those rows that do not say all. */
export function offerMore(rows) {
  // All are measured before any is changed: the page is laid out once.
  const measured = rows.map((row) => [row.querySelector(".more"), row.querySelector(".reason")])
    .filter(([more]) => more)
    .map(([more, reason]) => [more, more.dataset.texts > (reason.clientHeight ? 1 : 0) || reason.scrollHeight > reason.clientHeight]);
  for (const [more, isCut] of measured) more.classList.toggle("needless", !isCut);
}

/** Shows all that is said about a capture, if anything is; onclose: called when a person goes back to the row. */
export function showReasons(data, onclose) {
  const texts = textsOf(data);
  if (!texts.length) return;
  const name = `${data.object}/${data.capture}`;
  const open = element("a", { href: addressOf(data.object, data.capture), onclick: () => dialog.remove() }, "Open the capture");
  const dialog = element("dialog", { class: "reasons", "aria-labelledby": "reasons-title", onclose: () => { dialog.remove(); onclose(); } },
    element("h2", { id: "reasons-title" }, name),
    element("div", { class: "said", role: "group", "aria-labelledby": "reasons-title", tabindex: "0" }, texts.map((text) => element("p", {}, text))),
    element("form", { method: "dialog" }, element("button", {}, "Close"), open));
  document.body.append(dialog);
  dialog.showModal();
}
