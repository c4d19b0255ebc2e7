// The server's interface: JSON in, JSON out; errors carry what is wrong and what to do.

import { lookForServer } from "./connection.js";

export class ApiError extends Error {
  constructor(status, answer) {
    super(answer.remedy ? `${answer.error} → ${answer.remedy}` : answer.error);
    this.status = status;
    this.answer = answer;
  }
}

/** The status of an error where no server has answered, and what is said then. */
export const NO_ANSWER = 0;
export const NOT_ANSWERING = "the server does not answer";

/** The status of an error where the session has ended. */
export const NOT_LET_IN = 401;

/** Returns that error, and looks for the server until it answers. */
export function noAnswer() {
  lookForServer();
  return new ApiError(NO_ANSWER, { error: NOT_ANSWERING, remedy: "start glint review again; this page keeps what is not saved" });
}

/** Returns the path of a capture's interface. */
export function capturePath(object, capture) {
  return `/api/captures/${encodeURIComponent(object)}/${encodeURIComponent(capture)}`;
}

/** Returns the path of an object's interface. */
export function objectPath(object) {
  return `/api/objects/${encodeURIComponent(object)}`;
}

/** Returns the address of a view of a capture, after the page's own. */
export function addressOf(object, capture, view = "inputs") {
  return `#/${encodeURIComponent(object)}/${encodeURIComponent(capture)}/${view}`;
}

/** Asks the server for a picture. */
export async function askPicture(path, signal) {
  return (await answerOf(path, { signal })).blob();
}

/** Asks the server; null where it has nothing new. */
export async function ask(path, { method = "GET", body, signal } = {}) {
  const options = { method, signal };
  if (body !== undefined) {
    options.body = JSON.stringify(body);
    options.headers = { "Content-Type": "application/json" };
  }
  const answer = await answerOf(path, options);
  return answer.status === 204 ? null : answer.json();
}

/** Returns what counts the requests of one kind: each call begins one, and returns whether it is still the newest. */
export function newest() {
  let count = 0;
  return () => {
    const own = (count += 1);
    return () => own === count;
  };
}

async function answerOf(path, options) {
  let answer;
  try {
    answer = await fetch(path, options);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw noAnswer();
  }
  if (answer.ok) return answer;
  if (answer.status === NOT_LET_IN) throw new ApiError(NOT_LET_IN, { error: "this browser is not let in any longer", remedy: "open the link that glint review printed in another tab; this page keeps what is not saved" });
  throw new ApiError(answer.status, await answer.json().catch(() => ({ error: `status ${answer.status}`, remedy: "" })));
}
