// Elements made without markup: text that comes from files of other people is only ever text.

/** Returns an element with attributes, listeners (on..) and children; strings become text. */
export function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (key === "class") made.className = value;
    else if (key in made && typeof value !== "string") made[key] = value;
    else made.setAttribute(key, value === true ? "" : value);
  }
  made.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return made;
}

/** Adds style sheets to the page, each once. */
export function addStyleSheets(...addresses) {
  for (const href of addresses) {
    if (!document.querySelector(`link[href="${href}"]`)) document.head.append(element("link", { rel: "stylesheet", href }));
  }
}

/** How long a message that is no error is shown, in milliseconds. */
const MESSAGE_MS = 5000;

let refusal = "";

/** Announces that a value which was entered is not taken, and why. */
export function refuse(text) {
  announce(text, "error");
  refusal = text;
}

/** Announces that everything else is saved where a value that was entered is not taken; before: that refusal, or none. */
export function announceSaved(before) {
  if (before) announce(`Saved, except: ${before}`, "error");
  else announce("Saved.");
}

/** Returns why the value that was entered last is not taken, as long as that is shown; nothing where it is. */
export function shownRefusal() {
  return refusal;
}

/** Has the last refusal count no longer: a person has seen it, and gone on. */
export function forgetRefusal() {
  refusal = "";
}

/** Shows a message near the bottom; errors stay until the next one, or until a person closes them. */
export function announce(text, kind = "") {
  const status = document.getElementById("status");
  refusal = "";
  status.className = kind;
  status.title = kind === "error" ? "Click it, or press Escape, to close it" : "";
  status.textContent = text;
  clearTimeout(announce.timer);
  if (kind !== "error" && text) announce.timer = setTimeout(() => (status.textContent = ""), MESSAGE_MS);
}

/** Announces that saving would change nothing, unless the refusal of a value says why. */
export function announceNothingChanged() {
  if (!refusal) announce("There is nothing to save.");
}

/** Announces why something has failed, unless it was given up because its view was left. */
export function announceError(error) {
  if (error.name !== "AbortError") announce(String(error.message ?? error), "error");
}

/** Returns `action` as a listener that announces why it fails. */
export function guarded(action) {
  return async (...given) => {
    try {
      await action(...given);
    } catch (error) {
      announceError(error);
    }
  };
}

/** Takes a message away that begins so, if it is still shown: it no longer holds. */
export function withdraw(beginning) {
  if (document.getElementById("status").textContent.startsWith(beginning)) announce("");
}

/** What a number must be that is more than nothing: arguments of `typedNumber`. */
export const POSITIVE = [(value) => value > 0, "it must be more than 0"];

/** Returns the number in a field, null where there is none or one that is not allowed, and says so. */
export function typedNumber(field, isAllowed = Number.isFinite, rule = "it must be a number") {
  const value = Number(field.value), name = `"${field.ariaLabel}"`;
  // A field for numbers is empty also where what was typed is no number.
  if (field.value === "") refuse(`No number was typed for ${name}: it stays as it was.`);
  else if (!isAllowed(value)) refuse(`${name} cannot be ${field.value}: ${rule}.`);
  else {
    withdraw(`No number was typed for ${name}`);
    withdraw(`${name} cannot be`);
    return value;
  }
  return null;
}

/** Whether a field for numbers was emptied, rather than filled with what is no number. */
export function isEmptied(field) {
  return field.value === "" && !field.validity.badInput;
}

/** Returns a share as a percentage, a dash for what is not known. */
export function percent(share) {
  return share === null || share === undefined ? "–" : `${Math.round(share * 100)}%`;
}

/** Returns an ISO date as the day and the time of day where the browser is; nothing for none. */
export function moment(date) {
  return date ? new Date(date).toLocaleString("sv-SE", { dateStyle: "short", timeStyle: "short" }) : "";
}

/** Returns seconds as `12 s`, `3 min`, `1 h 5 min`. */
export function duration(seconds) {
  if (seconds === null || seconds === undefined) return "";
  if (seconds < 90) return `${Math.max(1, Math.round(seconds))} s`;
  const minutes = Math.round(seconds / 60);
  return minutes < 90 ? `${minutes} min` : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}
