// Leaving a view with something on it that is not saved: by a link of the page, the browser's Back, or otherwise.

const LOSS = "Lose what you have changed and not saved?";
const LEAVE = "glint-leave";

/** Asks before what is not saved is lost; isDirty: whether there is any, forget: called where a person agrees. */
export function guardLeaving(isDirty, forget, signal) {
  const refuse = (event) => {
    if (!isDirty()) return;
    if (confirm(LOSS)) forget();
    else event.preventDefault();
  };
  document.addEventListener("click", (event) => {
    const link = event.target.closest?.("a[href^='#/']");
    const isForThisTab = !(event.ctrlKey || event.metaKey || event.shiftKey);
    if (isForThisTab && link && link.getAttribute("href") !== location.hash) refuse(event);
  }, { signal, capture: true });
  addEventListener(LEAVE, refuse, { signal });
  addEventListener("beforeunload", (event) => { if (isDirty()) event.preventDefault(); }, { signal });
}

/** Whether nothing is unsaved, or a person agrees to lose it. */
export function mayLeave() {
  return dispatchEvent(new Event(LEAVE, { cancelable: true }));
}
