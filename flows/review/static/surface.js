// The surface view: a version of a capture relit, its lenses, its mesh and the object's model, by the viewer's modules.

import { ask, objectPath } from "./api.js";
import { addStyleSheets, element, guarded, moment } from "./dom.js";
import { bind } from "./keys.js";
import { Capture, ServedParts } from "./viewer/payload.js";
import { Viewer } from "./viewer/viewer.js";

const MATERIALS = ["matte", "glossy", "glass", "relief", "normals", "curvature"];

/** Adds the viewer's styles to the page, once. */
export function addStyles() {
  addStyleSheets("/static/viewer/viewer.css", "/static/surface.css");
}

export async function open(root, capture, signal) {
  addStyles();
  const place = element("div", { class: "surface-page" });
  root.append(place);
  const versions = (await ask(`${objectPath(capture.object)}/versions`, { signal })).filter(({ captures }) => captures.includes(capture.capture));
  if (!versions.length) {
    place.append(element("p", { class: "faint" }, "No version holds this capture yet: run it first."));
    return;
  }
  const select = element("select", { "aria-label": "Version", onchange: guarded(() => show(select.value)) },
    ...versions.map(({ name, time }) => element("option", { value: name }, `${name}, ${moment(time)}`)));
  const choice = element("label", { class: "version" }, "Version ", select);
  let viewer = null;

  async function show(version) {
    const path = `${objectPath(capture.object)}/versions/${version}`;
    const surface = `${path}/captures/${encodeURIComponent(capture.capture)}/surface`;
    const [facts, model] = await Promise.all([ask(surface, { signal }), ask(`${path}/model`, { signal })]);
    if (signal.aborted || select.value !== version) return;
    viewer?.dispose();
    const captures = [new Capture(facts, new ServedParts(surface, { signal }))];
    viewer = new Viewer(captures, model ? new Capture(model, new ServedParts(`${path}/model`, { signal })) : null);
    const hadFocus = document.activeElement === select;
    viewer.element.querySelector(".viewer-bar").append(choice);
    place.replaceChildren(viewer.element);
    if (hadFocus) select.focus();
    globalThis.glint = { viewer, ready: viewer.show("surface") };
    await globalThis.glint.ready;
  }

  signal.addEventListener("abort", () => viewer?.dispose());
  const materials = MATERIALS.map((name, i) => [String(i + 1), `the material ${name}`, () => viewer?.surface?.setMaterial(name)]);
  bind([
    ...materials,
    ["s", "the relit surface", () => viewer?.show("surface")],
    ["m", "the mesh", () => viewer?.show("mesh")],
    ["c", "confidence over the surface, or no lens", () => toggle(viewer?.surface, "confidence")],
    ["p", "the photograph beside the surface, or not", () => viewer?.surface?.setWipe(viewer.surface.relight.state.wipe ? 0 : 0.5)],
    ["d", "the depth along a line, or not", () => viewer?.surface?.setProfile(!viewer.surface.profile.isOn)],
  ], signal);
  await show(versions[0].name);
}

function toggle(surface, name) {
  surface?.setLens(surface.lensName === name ? "none" : name);
}
