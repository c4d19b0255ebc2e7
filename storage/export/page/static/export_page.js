// The start of an exported page: facts and parts stand in the page itself.

import { Capture, EmbeddedParts } from "./payload.js";
import { Viewer } from "./viewer.js";

const facts = JSON.parse(document.getElementById("facts").textContent), parts = new EmbeddedParts();
const captures = facts.captures.map((capture, number) => new Capture(capture, parts, `${number}/`));
const viewer = new Viewer(captures, facts.model ? new Capture(facts.model, parts, "model/") : null);
document.getElementById("viewer").replaceChildren(viewer.element);
// The still picture stays where the browser cannot draw the surface.
const ready = viewer.show().then(() => document.documentElement.classList.toggle("has-viewer", !viewer.hasFailed));
/** For scripts and tests: the viewer, and a promise that it is drawn. */
globalThis.glint = { viewer, ready };
