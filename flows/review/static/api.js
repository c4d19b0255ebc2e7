// The server's interface: JSON in, JSON out; errors carry what is wrong and what to do.

export class ApiError extends Error {
  constructor(status, answer) {
    super(answer.remedy ? `${answer.error} → ${answer.remedy}` : answer.error);
    this.status = status;
    this.answer = answer;
  }
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
  const answer = await fetch(path, { signal });
  if (!answer.ok) throw new ApiError(answer.status, await answer.json());
  return answer.blob();
}

/** Asks the server; null where it has nothing new. */
export async function ask(path, { method = "GET", body, signal } = {}) {
  const options = { method, signal };
  if (body !== undefined) {
    options.body = JSON.stringify(body);
    options.headers = { "Content-Type": "application/json" };
  }
  let answer;
  try {
    answer = await fetch(path, options);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new ApiError(0, { error: "the server does not answer", remedy: "start glint review again" });
  }
  if (answer.status === 204) return null;
  const content = await answer.json().catch(() => ({ error: `status ${answer.status}`, remedy: "" }));
  if (!answer.ok) throw new ApiError(answer.status, content);
  return content;
}
