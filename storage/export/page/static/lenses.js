// Lenses: a map of the capture as colours over the relit surface, with a legend.

import { NO_CONFIDENCE, NO_DEPTH } from "./payload.js";
import { make } from "./elements.js";

/** Dark blue to yellow (cividis), also without colour vision in order. */
const SCALE = [[0, 34, 78], [33, 62, 108], [82, 88, 109], [114, 113, 117], [145, 140, 120], [185, 170, 106], [219, 199, 85], [254, 232, 56]];

/** The colour of a value from 0 to 1. */
export function scaleColour(value) {
  const place = Math.min(Math.max(value, 0), 1) * (SCALE.length - 1), low = Math.min(Math.floor(place), SCALE.length - 2);
  return SCALE[low].map((part, i) => Math.round(part + (SCALE[low + 1][i] - part) * (place - low)));
}

/** Names of the lenses that a capture has, in order. */
export function lensesOf(capture) {
  const names = [["none", "None"]];
  if (capture.has("confidence")) names.push(["confidence", "Confidence"]);
  if (capture.has("provenance")) names.push(["provenance", "Provenance"]);
  if (capture.has("depth")) names.push(["depth", "Depth"]);
  if (capture.has("candidates")) names.push(["candidates", "Candidates"]);
  if (capture.has("difference")) names.push(["difference", "Difference"]);
  return names;
}

/** Colours of a lens, four bytes a pixel, and its legend. */
export async function lens(capture, name) {
  if (name === "confidence") {
    const codes = await capture.array("confidence");
    const caption = "Probability that the normal is within 5° of the truth";
    return { colours: coloured(codes, (code) => (code === NO_CONFIDENCE ? null : scaleColour(code / 254))), isSmooth: true, legend: scale(caption, "0", "1") };
  }
  if (name === "depth") {
    const codes = await capture.array("depth"), { low, high, unit, direction } = capture.facts.depth;
    const range = (value) => `${Number(value.toPrecision(4))} ${unit}`;
    return {
      colours: coloured(codes, (code) => (code === NO_DEPTH ? null : scaleColour((code - 1) / 65534))), isSmooth: true,
      legend: scale(`Depth, ${direction}`, range(low), range(high)),
    };
  }
  if (name === "difference") {
    const codes = await capture.array("difference"), { limit } = capture.facts.difference;
    return {
      colours: coloured(codes, (code) => (code === NO_CONFIDENCE ? null : scaleColour(code / 254))), isSmooth: true,
      legend: scale("Angle between the normals of the two versions", "0°", `${limit}° or more`),
    };
  }
  if (name === "candidates") {
    const counts = await capture.array("candidates"), { largest } = capture.facts.candidates, span = Math.max(largest - 1, 1);
    return {
      colours: coloured(counts, (count) => (count ? scaleColour((count - 1) / span) : null)), isSmooth: false,
      legend: scale("Candidates for the normal at each pixel; none where nothing is drawn", "1", String(largest)),
    };
  }
  const codes = await capture.array("provenance");
  const colours = new Map(capture.facts.provenance.map((entry) => [entry.code, entry.colour]));
  const rows = capture.facts.provenance.map(({ name: text, colour, share }) =>
    make("li", {}, swatch(colour), make("span", {}, text), make("b", {}, `${(100 * share).toFixed(share < 0.1 ? 1 : 0)} %`)));
  const caption = make("p", {}, "Where each normal comes from; only what is called observed was measured");
  return {
    colours: coloured(codes, (code) => colours.get(code) ?? null), isSmooth: false,
    legend: make("div", { className: "legend" }, caption, make("ul", {}, ...rows)),
  };
}

function coloured(codes, colour) {
  const known = new Map(), bytes = new Uint8Array(codes.length * 4);
  for (let i = 0; i < codes.length; i++) {
    let entry = known.get(codes[i]);
    if (entry === undefined) known.set(codes[i], (entry = colour(codes[i])));
    if (!entry) continue;
    bytes.set(entry, 4 * i);
    bytes[4 * i + 3] = 255;
  }
  return bytes;
}

function scale(caption, low, high) {
  const ends = make("div", { className: "ends" }, make("span", {}, low), make("span", {}, high));
  return make("div", { className: "legend" }, make("p", {}, caption), make("div", { className: "scale" }), ends);
}

function swatch(colour) {
  const element = make("i", { className: "swatch" });
  element.style.backgroundColor = `rgb(${colour.join(" ")})`;
  return element;
}
