"""Measure how many pictures a second the viewer relights, in headless Chromium without a graphics card.

    python -m tests.benchmarks.relighting [--side 2000] [--seconds 3]

A sphere of normals of side x side pixels fills a canvas of the same size; the light moves from picture to picture, and
each picture is read back at one pixel, so that it is really drawn. While the light is dragged the viewer draws coarsely
where a whole picture takes longer than a sixtieth of a second. On a busy machine look at the processor time.
"""

import argparse
import tempfile
from pathlib import Path

import psutil

from glint.storage.export.page.bundle import bundled
from tests import browser

SCRIPT = """
(async () => {
  const side = SIDE, canvas = document.createElement("canvas");
  canvas.width = canvas.height = side;
  const relight = new ($relight.Relight)(canvas), gl = relight.gl;
  const vectors = new Float32Array(side * side * 3), mask = new Uint8Array(side * side);
  for (let i = 0; i < side * side; i++) {
    const x = (i % side) / side * 2 - 1, y = 1 - Math.floor(i / side) / side * 2, square = x * x + y * y;
    if (square >= 1) continue;
    mask[i] = 1;
    vectors.set([x, y, Math.sqrt(1 - square)], 3 * i);
  }
  relight.setNormals(vectors, mask, side, side);
  const pixel = new Uint8Array(4);
  {
    const material = "MATERIAL";
    // The first picture, for which the program is compiled, does not count.
    let count = -1, start = performance.now();
    while (count < 1 || performance.now() - start < 1000 * SECONDS) {
      const across = Math.sin(count) * 0.5;
      Object.assign(relight.state, { material, light: [across, 0, Math.sqrt(1 - across * across)] });
      DRAW;
      gl.readPixels(canvas.width / 2, canvas.height / 2, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      count++;
      if (!count) start = performance.now();
    }
    return [count, (performance.now() - start) / 1000];
  }
})()
"""


def processor_seconds() -> float:
    """Processor time of the browser's processes so far; preparing the normals and the first picture count too."""
    processes = psutil.Process().children(recursive=True)
    return sum(sum(process.cpu_times()[:2]) for process in processes if process.is_running())


def main() -> None:
    """Print pictures a second by material."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--side", type=int, default=2000)
    parser.add_argument("--seconds", type=float, default=3.0)
    arguments = parser.parse_args()
    script = bundled("relight.js")
    last = script.rindex("const $module")
    name = script[last:].split()[1]
    with tempfile.TemporaryDirectory() as folder, browser.Browser() as running:
        path = Path(folder) / "page.html"
        path.write_text(f"<!doctype html><script>{script}globalThis.$relight = {name};</script>", encoding="utf-8")
        page = running.page()
        page.open(path.as_uri())
        page.wait("globalThis.$relight !== undefined")
        code = SCRIPT.replace("SIDE", str(arguments.side))
        for material in ("matte", "glossy", "glass", "relief"):
            chosen = code.replace("MATERIAL", material)
            whole_s = 0.0
            for name in ("whole", "dragged"):
                coarse = f"relight.cost = {1000 * whole_s}, relight.draw(relight.coarseness)"
                drawn = chosen.replace("DRAW", "relight.draw()" if name == "whole" else coarse)
                before = processor_seconds()
                count, seconds = page.evaluate(drawn.replace("SECONDS", str(arguments.seconds)))
                whole_s = whole_s or seconds / count
                cost = 1000 * (processor_seconds() - before) / count
                rate = f"{count / seconds:.1f} pictures a second, at most {cost:.0f} ms of processor time for one"
                print(f"{material}, {name}: {rate}, {arguments.side} x {arguments.side}", flush=True)


if __name__ == "__main__":
    main()
