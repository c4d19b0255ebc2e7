// A pixel that was clicked: the frames in which it was lit, and the candidates for its normal.

import { ask, newest } from "../api.js";
import { element, percent } from "../dom.js";
import { Konva } from "../vendor.js";

const SHOWN_FRAMES = 24;

export class PixelPanel {
  constructor(view) {
    this.view = view;
    this.begin = newest();
    this.content = element("div", {}, element("p", { class: "faint" }, "Click a pixel of the object with the tool Look."));
    this.root = element("section", { "aria-live": "polite" }, element("h2", {}, "Pixel"), this.content);
    this.cross = new Konva.Path({ data: "M-7 0H-2M2 0H7M0 -7V-2M0 2V7", stroke: "#fff", strokeWidth: 1.5, strokeScaleEnabled: false, visible: false, listening: false });
    view.picture.shapes.add(this.cross);
    view.picture.onzoom.push((zoom) => this.cross.scale({ x: 1 / zoom, y: 1 / zoom }));
  }

  async ask(x, y) {
    const { width, height } = this.view.picture;
    if (x < 0 || y < 0 || x >= width || y >= height) return;
    this.cross.setAttrs({ x, y, visible: true, scaleX: 1 / this.view.picture.zoom, scaleY: 1 / this.view.picture.zoom });
    const isNewest = this.begin();
    try {
      const pixel = await ask(`${this.view.capture.path}/pixel?x=${x}&y=${y}`, { signal: this.view.signal });
      if (!isNewest()) return;
      this.show(pixel);
    } catch (error) {
      if (error.name === "AbortError" || !isNewest()) return;
      this.view.lights.showLit([]);
      this.content.replaceChildren(element("p", { class: "faint" }, `${x}, ${y}: ${error.message}`));
    }
    this.root.scrollIntoView({ block: "nearest" });
  }

  show(pixel) {
    this.view.lights.showLit(pixel.frames.map(({ frame }) => frame));
    const brightest = [...pixel.frames].sort((first, second) => second.level - first.level).slice(0, SHOWN_FRAMES);
    const frames = brightest.sort((first, second) => first.frame - second.frame).map(({ frame, level }) =>
      element("button", { type: "button", class: "chip", title: `level ${level}`, onclick: () => this.view.show(frame) }, frame.toLocaleString("en")));
    const normal = pixel.normal;
    this.content.replaceChildren(
      element("p", {}, `x ${pixel.x}, y ${pixel.y}`, pixel.in_mask ? "" : " · outside the mask"),
      element("p", {}, `lit in ${pixel.count.toLocaleString("en")} frames, above level ${pixel.threshold}`, pixel.count > frames.length ? `, the brightest ${frames.length}:` : frames.length ? ":" : ""),
      element("div", { class: "chips" }, frames),
      pixel.candidates.length ? this.table(pixel.candidates) : element("p", { class: "faint" }, "no candidate"),
      normal ? element("p", {}, `normal ${vector(normal.normal)} · ${normal.provenance} · ${percent(normal.confidence)} confident`) : null,
    );
  }

  table(candidates) {
    const heads = ["normal", "frames", "spread", "shading", ""].map((text) => element("th", { scope: "col" }, text));
    const rows = candidates.map((item) => element("tr", {},
      element("td", {}, vector(item.normal)), element("td", {}, String(item.frames)), element("td", {}, item.spread === null ? "–" : `${item.spread.toFixed(1)}°`),
      element("td", {}, item.shading.toFixed(2)), element("td", {}, item.chosen ? "chosen" : "")));
    return element("table", {}, element("caption", {}, "Candidates, heaviest first"), element("thead", {}, element("tr", {}, heads)), element("tbody", {}, rows));
  }
}

function vector(values) {
  return values.map((value) => value.toFixed(2)).join(" ");
}
