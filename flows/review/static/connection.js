// The connection to the server: one that does not answer is looked for until it does.

/** The event of the window that says that the server answers again. */
export const ANSWERS = "glint-answers";

const RETRY_MS = 2500;
let isLooking = false;

/** Looks for a server that has not answered, and says when it does. */
export function lookForServer() {
  if (isLooking) return;
  isLooking = true;
  const look = async () => {
    try {
      await fetch("/open", { cache: "no-store" });
    } catch {
      setTimeout(look, RETRY_MS);
      return;
    }
    isLooking = false;
    dispatchEvent(new Event(ANSWERS));
  };
  setTimeout(look, RETRY_MS);
}
