// The page: which view is open, by the address after #.
//
//   #/                         the catalogue
//   #/OBJECT/CAPTURE/VIEW      a view of a capture
//
// A view is a module with `open(root, capture, signal)`: it fills `root`, and ends what it does when `signal` does.
// capture: {object, capture, path}, `path` being that of the capture's interface.

import { addressOf, ApiError, capturePath, NO_ANSWER, noAnswer, NOT_ANSWERING, NOT_LET_IN } from "./api.js";
import { ANSWERS } from "./connection.js";
import { announce, element } from "./dom.js";
import { showKeys } from "./keys.js";
import { mayLeave } from "./leaving.js";

const VIEWS = [
  ["inputs", "Inputs", () => import("./inputs/view.js")],
  ["poses", "Poses", () => import("./poses/view.js")],
  ["questions", "Questions", () => import("./questions/view.js")],
  ["surface", "Surface", () => import("./surface.js")],
  ["versions", "Versions", () => import("./versions.js")],
];

let leaving = new AbortController();
let shown = location.hash;
let isMissing = false;

function placeOf(hash) {
  const parts = hash.replace(/^#\/?/, "").split("/").filter(Boolean).map(decodeURIComponent);
  if (parts.length < 2) return null;
  const [object, capture, asked] = parts;
  return { object, capture, view: VIEWS.find(([name]) => name === asked)?.[0] ?? VIEWS[0][0] };
}

function showPlace(place) {
  const path = document.getElementById("place");
  const tabs = document.getElementById("tabs");
  path.replaceChildren();
  tabs.replaceChildren();
  const view = VIEWS.find(([name]) => name === place?.view)?.[1];
  document.title = place ? `${view} · ${place.object}/${place.capture} · Glint` : "Captures · Glint";
  if (!place) return;
  path.append(element("a", { href: "#/" }, "Catalogue"), element("span", {}, " / "), element("b", { title: `${place.object}/${place.capture}` }, `${place.object}/${place.capture}`));
  for (const [name, text] of VIEWS) {
    const current = name === place.view ? "page" : undefined;
    tabs.append(element("a", { href: addressOf(place.object, place.capture, name), "aria-current": current }, text));
  }
}

/** Returns a view's module; it comes from the server, too. */
async function loaded(load) {
  try {
    return await load();
  } catch (error) {
    throw error instanceof TypeError ? noAnswer() : error;
  }
}

async function show() {
  shown = location.hash;
  isMissing = false;
  leaving.abort();
  leaving = new AbortController();
  const main = document.getElementById("main");
  const root = element("div", { class: "view" });
  main.replaceChildren(root);
  main.setAttribute("aria-busy", "true");
  announce("");
  const { signal } = leaving;
  try {
    const place = placeOf(location.hash);
    showPlace(place);
    if (!place) {
      await (await loaded(() => import("./catalogue/view.js"))).open(root, signal);
      return;
    }
    const view = VIEWS.find(([name]) => name === place.view);
    const capture = { ...place, path: capturePath(place.object, place.capture) };
    await (await loaded(view[2])).open(root, capture, signal);
  } catch (error) {
    if (error.name === "AbortError") return;
    if (error instanceof ApiError && error.status === NOT_LET_IN) location.assign(`/open${location.hash}`);
    isMissing = error.status === NO_ANSWER;
    // What a view has begun to lay out has no place for it.
    root.className = "view";
    root.replaceChildren(element("p", { class: "problem", role: "alert" }, String(error.message ?? error)));
  } finally {
    if (!signal.aborted) main.removeAttribute("aria-busy");
  }
}

document.getElementById("help").addEventListener("click", showKeys);
document.getElementById("status").addEventListener("click", () => announce(""));
addEventListener("keydown", (event) => {
  if (event.key === "Escape") announce("");
  if (event.key === "?" && !event.target.closest?.("input, textarea")) showKeys();
});
document.querySelector(".skip").addEventListener("click", (event) => {
  // The address after # is that of a view.
  event.preventDefault();
  document.getElementById("main").focus();
});
addEventListener(ANSWERS, () => {
  // A module that did not come is not asked for again by the same page.
  if (isMissing) location.reload();
  else if (document.getElementById("status").textContent.startsWith(NOT_ANSWERING)) announce("The server answers again.");
});
addEventListener("hashchange", () => {
  if (location.hash === shown || mayLeave()) show();
  else history.pushState(null, "", shown || "#/");
});
show();
