// The versions view: two versions side by side, the angles between them, what changed in words, notes, rollback.

import { ask, newest, objectPath } from "./api.js";
import { Author } from "./author.js";
import { announce, announceError, element, guarded, moment } from "./dom.js";
import { guardLeaving } from "./leaving.js";
import { addStyles } from "./surface.js";
import { Capture, ServedParts } from "./viewer/payload.js";
import { VersionStage } from "./version_stage.js";

const DIGEST = /^[0-9a-f]{64}$/;
/** A run's identifier, of which the first part is shown. */
const RUN = /^(run [0-9a-f]{8})(-[0-9a-f]{4}){3}-[0-9a-f]{12}$/;

export async function open(root, capture, signal) {
  addStyles();
  const place = element("div", { class: "surface-page" });
  root.append(place);
  const main = element("div"), side = element("div", { class: "side" }), content = element("div", { class: "versions" }, main, side);
  const begin = newest();
  let stage = null, written = null;
  signal.addEventListener("abort", () => stage?.dispose());

  async function show(before, after) {
    const isNewest = begin();
    const versions = (await ask(`${objectPath(capture.object)}/versions`, { signal })).filter(({ captures }) => captures.includes(capture.capture));
    if (!versions.length) {
      place.replaceChildren(element("p", { class: "faint" }, "No version holds this capture yet: run it first."));
      return;
    }
    const [latest, other = latest] = versions;
    const chosen = { before: before ?? other.name, after: after ?? latest.name };
    written ??= await notes().catch((error) => {
      if (error.name === "AbortError") throw error;
      return element("section", {}, element("h2", {}, "Notes"), element("p", { class: "doubt" }, error.message));
    });
    if (!isNewest()) return;
    const focused = side.contains(document.activeElement) && document.activeElement.ariaLabel;
    side.replaceChildren(listed(versions, chosen), written);
    if (!content.isConnected) place.replaceChildren(content);
    if (focused) side.querySelector(`[aria-label="${focused}"]`)?.focus();
    const path = `${objectPath(capture.object)}/differences/${chosen.before}/${chosen.after}/${encodeURIComponent(capture.capture)}`;
    const facts = await ask(path, { signal });
    if (!isNewest()) return;
    stage ??= new VersionStage();
    main.replaceChildren(stage.element, differences(facts, chosen));
    globalThis.glint = { stage, ready: stage.setPair(new Capture(facts, new ServedParts(path, { signal })), chosen.before, chosen.after) };
    await globalThis.glint.ready;
  }

  function listed(versions, chosen) {
    const pick = (name, group, label) => element("input", {
      type: "radio", name: group, checked: chosen[group] === name, "aria-label": `${label}: ${name}`,
      onchange: guarded(() => show(group === "before" ? name : chosen.before, group === "after" ? name : chosen.after)),
    });
    const rows = versions.map(({ name, time, message, edits }, i) => element("tr", {},
      element("td", {}, pick(name, "before", "Left")), element("td", {}, pick(name, "after", "Right")),
      element("td", {}, element("b", {}, name), ` ${moment(time)}`, element("div", {}, editWords(edits[capture.capture])), element("div", { class: "faint" }, message.replace(RUN, "$1"))),
      element("td", { class: "state" }, i ? element("button", { type: "button", onclick: guarded(() => restore(name)) }, "Restore") : "newest")));
    const head = element("thead", {}, element("tr", {}, ...["Left", "Right", "Version", "State"].map((text) => element("th", { scope: "col" }, text))));
    return element("section", {}, element("h2", {}, "Versions"), element("table", {}, head, element("tbody", {}, ...rows)));
  }

  async function restore(name) {
    if (!confirm(`Publish the content of ${name} as the newest version? All versions are kept.`)) return;
    const { version, created } = await ask(`${objectPath(capture.object)}/rollback`, { method: "POST", body: { version: name }, signal });
    announce(created ? `${version} has the content of ${name}` : `${version} has this content already`);
    await show();
  }

  async function notes() {
    const { notes: all, revision } = await ask(`${capture.path}/edits`, { signal });
    const author = new Author("note");
    const text = element("textarea", { "aria-label": "Note", placeholder: "What should others know?", maxlength: "4000", required: true });
    const add = element("button", { class: "primary" }, "Add the note");
    const form = element("form", {}, text, author.input, add);
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      if (!text.value.trim()) return announce("Write the note first.", "error");
      const name = author.name;
      if (!name) return;
      add.disabled = true;
      try {
        await ask(`${capture.path}/edits`, { method: "POST", signal, body: { changes: { note: text.value }, author: name, base_revision: revision } });
        written = await notes();
        section.replaceWith(written);
        announce("Note added.");
      } catch (error) {
        announceError(error);
      } finally {
        add.disabled = false;
      }
    });
    const items = all.map((note) => element("li", {}, note.text, element("div", { class: "faint" }, `${note.author}, ${moment(note.time)}`)));
    const section = element("section", {}, element("h2", {}, "Notes"), element("ul", { class: "notes" }, ...items), form);
    return section;
  }

  const draft = () => written?.querySelector("textarea");
  guardLeaving(() => Boolean(draft()?.value.trim()), () => (draft().value = ""), signal);
  await show();
}

/** What differs, in figures and words. */
function differences({ figures, changes }, { before, after }) {
  if (before === after) return element("p", { class: "faint" }, `${before} is on both sides: choose another version on one of them, once there is one.`);
  const shown = Object.entries(figures).filter(([, value]) => value !== null);
  const words = shown.map(([name, value]) => element("tr", {}, element("th", { scope: "row" }, name), element("td", {}, valueWords(name, value))));
  const rows = changes.map((change) => element("tr", {}, ...[change.stage, change.name, change.before, change.after].map((text) => element("td", { title: text }, shortened(text)))));
  const head = element("thead", {}, element("tr", {}, ...["Stage", "What", before, after].map((text) => element("th", { scope: "col" }, text))));
  const table = rows.length ? element("table", {}, head, element("tbody", {}, ...rows)) : element("p", { class: "faint" }, "Parameters, inputs and code are the same.");
  return element("section", { class: "changes" }, element("h2", {}, `From ${before} to ${after}`), element("table", {}, element("tbody", {}, ...words)), element("h2", {}, "What changed"), table);
}

/** Which inputs a version was made with that people had edited; edits: authors by field. */
function editWords(edits = {}) {
  const fields = Object.keys(edits);
  if (!fields.length) return "inputs of the catalogue";
  return `edited: ${fields.join(", ").replaceAll("_", " ")} (${[...new Set(Object.values(edits))].join(", ")})`;
}

/** A digest by its beginning, which is enough to tell two apart; any other text as it is. */
function shortened(text) {
  return DIGEST.test(text) ? `contents ${text.slice(0, 8)}…` : text;
}

function valueWords(name, value) {
  if (typeof value !== "number") return String(value);
  if (name.includes("beyond")) return `${(100 * value).toFixed(1)} % of the pixels`;
  return name.includes("angle") ? `${value.toFixed(2)}°` : value.toLocaleString("en");
}
