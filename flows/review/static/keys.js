// Keys of the view that is open, and the dialog that lists them.

/** The key that also counts while a field is being filled in. */
const SAVE = "Ctrl+s";
/** Keys that move a slider, or choose another radio button; the timeline moves by the view's keys for frames. */
const SLIDING = /^(Arrow|Page|Home|End)/;

let shown = [];

/** Makes these the view's keys: [key, text, action]; `signal` ends them. */
export function bind(keys, signal) {
  shown = keys;
  signal.addEventListener("abort", () => { if (shown === keys) shown = []; });
  addEventListener(
    "keydown",
    (event) => {
      if (event.altKey) return;
      const name = (event.ctrlKey || event.metaKey ? "Ctrl+" : "") + keyOf(event);
      const field = event.target.closest?.("input:not([type=range], [type=checkbox], [type=radio]), textarea, select, dialog");
      if (field && (name !== SAVE || field.matches("dialog"))) return;
      if (SLIDING.test(event.key) && event.target.matches?.("input[type=range], input[type=radio]") && !event.target.closest(".timeline")) return;
      const known = keys.find(([key]) => key.split(" ").includes(name) || (key === "Space" && event.key === " "));
      if (!known || (event.target.closest?.("button, a, input[type=checkbox], input[type=radio], [role=listbox]") && ["Enter", " "].includes(event.key))) return;
      event.preventDefault();
      // What has been typed so far counts as entered.
      field?.blur();
      field?.focus({ preventScroll: true });
      known[2](event);
    },
    { signal },
  );
}

/** Returns the key as it would be without Caps Lock, which turns no other than letters. */
function keyOf(event) {
  const { key } = event;
  if (key.length > 1 || !event.getModifierState("CapsLock")) return key;
  return key === key.toLowerCase() ? key.toUpperCase() : key.toLowerCase();
}

/** Lists the keys. */
export function showKeys() {
  const dialog = document.getElementById("keys");
  const list = dialog.querySelector("dl");
  list.replaceChildren();
  for (const [key, text] of [...shown, ["?", "this list"]]) {
    const term = document.createElement("dt");
    for (const part of key.split(" ")) {
      const label = document.createElement("kbd");
      label.textContent = part;
      term.append(label, " ");
    }
    const description = document.createElement("dd");
    description.textContent = text;
    list.append(term, description);
  }
  dialog.showModal();
  list.scrollTop = 0;
}
