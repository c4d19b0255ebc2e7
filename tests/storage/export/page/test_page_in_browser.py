"""The exported page opened from disk in Chromium: what it draws, that it asks for nothing, that nothing runs but it."""

import base64
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from glint.storage.export.export import export, export_page
from glint.storage.export.page.page import MAX_PAGE_BYTES
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.tasks.algorithms.meshing.shading import RELIGHT_DIRECTIONS, relit
from tests import browser
from tests.glint.sample_store import Sphere, save_model, save_sphere
from tests.storage.stores import local_store

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(browser.program() is None, reason="Chromium is not installed (Debian: chromium)"),
]
HOSTILE = '</script><script>window.hacked = 1</script><img src=x onerror="window.hacked = 2">\'\\u003c'
NOISE = ("GL Driver Message", "fallback to software WebGL")
"""What Chromium remarks about drawing without a graphics card."""


@pytest.fixture(scope="module")
def chromium() -> Iterator[browser.Browser]:
    with browser.Browser() as running:
        yield running


@pytest.fixture(scope="module")
def location(tmp_path_factory: pytest.TempPathFactory) -> Location:
    location = local_store(tmp_path_factory.mktemp("store"))
    repository = ObjectRepository.open(location, "cup")
    save_sphere(repository)
    labels = repository.load("front", "labels", "work")
    record = dict(labels.record) | {
        "provenance": ("outside", HOSTILE, "marked", "silhouette", "filled"),
        "warnings": [{"message": HOSTILE, "cause": "light", "cost_deg": 1.0}],
    }
    repository.save("front", "labels", "hostile", {name: labels.read(name) for name in labels.arrays}, record)
    save_sphere(repository, "back", scale_known=False)
    views = [
        {"capture": name, "pose": "turntable", "camera_to_world": np.eye(4).tolist(), "share": 0.5}
        for name in ("front", "back")
    ]
    save_model(repository, Sphere((0.0, 0.0, 0.0), 6.0), views)
    repository.publish(["front", "back", WHOLE_OBJECT], {"run": "r", "catalogue": f"a/{HOSTILE}", "note": HOSTILE})
    return location


@pytest.fixture(scope="module")
def file(location: Location, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("page")
    record = export_page(location, "cup", out)
    assert record.out == str(out / "cup.html") and record.size == (out / "cup.html").stat().st_size < MAX_PAGE_BYTES
    return out / "cup.html"


@pytest.fixture(scope="module")
def page(chromium: browser.Browser, file: Path) -> browser.Page:
    page = chromium.page()
    page.open(file.as_uri())
    page.wait("globalThis.glint?.ready.then(() => true)")
    return page


def values(page: browser.Page, expression: str, dtype: Any) -> np.ndarray:
    """The content of a typed array of the page."""
    code = f"""(async () => {{
      const array = await ({expression}), bytes = new Uint8Array(array.buffer);
      let text = "";
      for (const octet of bytes) text += String.fromCharCode(octet);
      return btoa(text);
    }})()"""
    return np.frombuffer(base64.b64decode(page.evaluate(code)), dtype)


def box_of(page: browser.Page, selector: str) -> list[float]:
    """Left, top, width and height of an element, which is scrolled into sight."""
    code = f"const shown = document.querySelector({selector!r}); shown.scrollIntoView();"
    code += "const box = shown.getBoundingClientRect();"
    return list(page.evaluate(f"(() => {{ {code} return [box.x, box.y, box.width, box.height]; }})()"))


def shown_surface(page: browser.Page, capture: int) -> None:
    page.evaluate(f"glint.viewer.select.selectedIndex = {capture}; glint.viewer.show('surface')")
    assert not page.evaluate("glint.viewer.hasFailed"), page.text()


def test_a_page_asks_for_nothing_and_complains_of_nothing(page: browser.Page, file: Path) -> None:
    for mode in ("surface", "mesh", "model"):
        page.evaluate(f"glint.viewer.show('{mode}')")
    page.evaluate("new Promise((done) => setTimeout(done, 500))")
    asked = [url for url in page.requested() if not url.startswith("data:") and url != file.as_uri()]
    assert asked == []
    assert [text for text in page.complaints() if not any(noise in text for noise in NOISE)] == []
    assert not [event for event in page.events if event.get("method") == "Runtime.exceptionThrown"]
    assert page.evaluate("document.querySelector('.failure').hidden")


@pytest.mark.parametrize("light", [*RELIGHT_DIRECTIONS.values(), (0.6, 0.0, 0.8), (-0.28, -0.96, 0.0)])
def test_relit_pixels_are_those_of_the_pipeline(page: browser.Page, location: Location, light: Any) -> None:
    results = ObjectRepository.open(location, "cup", create=False).load_capture("front", "main")
    normals, mask = results["labels"].read("normals"), results["mask"].read("mask")
    shown_surface(page, 1)
    page.evaluate("glint.viewer.surface.setMaterial('matte')")
    view = "glint.viewer.surface.relight"
    pixels = values(page, f"({view}.set({{light: {list(light)}}}), {view}.pixels())", np.uint8)
    expected = relit(normals, mask, light)
    difference = np.abs(pixels.reshape(*mask.shape, 4)[..., 0].astype(int) - expected)
    assert expected.max() > 200 and difference.max() <= 1


def test_a_dragged_light_is_drawn_coarsely_and_then_wholly(page: browser.Page) -> None:
    shown_surface(page, 1)
    code = """(async () => {
      const relight = glint.viewer.surface.relight, { gl, canvas } = relight;
      const mean = () => {
        const bytes = new Uint8Array(canvas.width * canvas.height * 4);
        gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
        return bytes.reduce((sum, level) => sum + level, 0) / bytes.length;
      };
      relight.draw();
      const whole = [mean(), canvas.width];
      relight.draw(4);
      const coarse = [mean(), canvas.width];
      relight.cost = 16 * 16;
      relight.set({ light: [0.3, 0, 0.954] });
      const moving = relight.asked;
      await new Promise((done) => setTimeout(done, 600));
      return [whole, coarse, moving, relight.asked, canvas.width, gl.getError()];
    })()"""
    whole, coarse, moving, resting, width, error = page.evaluate(code)
    assert coarse[0] == pytest.approx(whole[0], rel=0.03) and coarse[1] == pytest.approx(whole[1] / 4, abs=1)
    assert (moving, resting, width, error) == (4, 1, whole[1], 0)


def test_arrays_are_those_stored(page: browser.Page, location: Location) -> None:
    results = ObjectRepository.open(location, "cup", create=False).load_capture("front", "main")
    labels, mask = results["labels"], results["mask"].read("mask")
    capture = "glint.viewer.captures[1]"
    assert page.evaluate(f"{capture}.facts.name") == "front"
    np.testing.assert_array_equal(values(page, f"{capture}.array('mask')", np.uint8).reshape(mask.shape), mask)
    provenance = values(page, f"{capture}.array('provenance')", np.uint8).reshape(mask.shape)
    np.testing.assert_array_equal(provenance, np.where(mask, labels.read("provenance"), 0))
    normals = values(page, f"{capture}.normals()", np.float32).reshape(*mask.shape, 3)
    np.testing.assert_allclose(normals[mask], labels.read("normals")[mask], atol=1e-4)
    confidence = values(page, f"{capture}.array('confidence')", np.uint8).reshape(mask.shape)
    np.testing.assert_allclose(confidence[mask] / 254, labels.read("confidence")[mask], atol=0.002)
    depth = values(page, f"{capture}.depth()", np.float32).reshape(mask.shape)
    np.testing.assert_allclose(depth, results["depth"].read("depth"), atol=1e-3)


def test_a_profile_is_in_millimetres_or_says_that_it_is_not(page: browser.Page) -> None:
    shown_surface(page, 1)
    page.evaluate("glint.viewer.surface.setProfile(true)")
    # The sphere's radius is 6 mm: its depth along the middle row rises from the rim by nearly as much.
    words = page.evaluate("document.querySelector('.profile-words').textContent")
    length, rise = (float(number) for number in re.findall(r"([\d.]+) mm", words))
    assert length == pytest.approx(12.0, abs=1.0) and 4.0 < rise <= 6.0
    shown_surface(page, 0)
    assert " pixels long" in page.evaluate("document.querySelector('.profile-words').textContent")
    assert "scale of this capture is not known" in page.text()
    page.evaluate("glint.viewer.surface.setProfile(false)")


def test_confidence_cuts_the_mesh(page: browser.Page) -> None:
    page.evaluate("glint.viewer.select.selectedIndex = 1; glint.viewer.show('mesh')")
    count = "glint.viewer.meshes.view.geometry.index.count"
    whole = page.evaluate(count)
    page.evaluate("glint.viewer.meshes.view.cutBelow(0.9)")
    assert 0 < page.evaluate(count) < whole
    page.evaluate("glint.viewer.meshes.view.cutBelow(0)")
    assert page.evaluate(count) == whole


def test_outlines_of_views_lie_where_the_surface_turns_away(page: browser.Page) -> None:
    page.evaluate("glint.viewer.show('model')")
    panel = "glint.viewer.meshes"
    assert not page.evaluate(f"Boolean({panel}.view.outlines)")
    page.evaluate(f"{panel}.hasOutlines.click()")
    page.evaluate("new Promise((done) => setTimeout(done, 300))")
    assert page.evaluate(f"{panel}.view.outlines.children.length") == 2
    line = f"{panel}.view.outlines.children[0].geometry.getAttribute('position').array"
    ends = values(page, line, np.float32).reshape(-1, 3)
    # Both cameras look along -z: the outline of a sphere is its equator, a closed line.
    assert np.hypot(ends[:, 0], ends[:, 1]).min() > 0.97 * 6.0 and np.abs(ends[:, 2]).max() < 0.05 * 6.0
    assert not (np.unique(ends, axis=0, return_counts=True)[1] % 2).any()
    page.evaluate(f"{panel}.hasOutlines.click()")
    assert not page.evaluate(f"{panel}.view.outlines.visible")


def test_two_clicks_measure_on_the_mesh(page: browser.Page) -> None:
    page.evaluate("glint.viewer.show('model')")
    view = "glint.viewer.meshes.view"
    page.evaluate(f"{view}.camera.position.set(0, 0, 3); {view}.controls.update(); {view}.measure(true)")
    box = box_of(page, ".light-stage canvas")
    radius = box[3] / 2 / 1.05
    for across in (-0.6, 0.6):
        x, y = box[0] + box[2] / 2 + across * radius, box[1] + box[3] / 2
        for kind in ("mousePressed", "mouseReleased"):
            page.command("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
    words = page.wait("document.querySelector('.caption').textContent")
    assert float(words.split()[0]) == pytest.approx(2 * 0.6 * 6.0, rel=0.03) and "mm between" in words


def test_two_points_are_measured_on_the_mesh_by_keys(page: browser.Page) -> None:
    page.evaluate("glint.viewer.show('model')")
    panel = "glint.viewer.meshes"
    page.evaluate(f"{panel}.view.camera.position.set(0, 0, 3); {panel}.view.controls.update()")
    page.evaluate(f"{panel}.isMeasuring.checked || {panel}.isMeasuring.click()")
    assert page.evaluate(f"{panel}.caption.textContent").startswith("Click two points")
    page.evaluate(f"{panel}.view.canvas.focus()")
    for key in ("Enter", *["ArrowRight"] * 5, "Enter"):
        page.command("Input.dispatchKeyEvent", type="keyDown", key=key, code=key)
    words = page.wait(f"{panel}.caption.textContent")
    chord = 2 * 6.0 * np.sin(5 * 0.12 / 2)
    assert float(words.split()[0]) == pytest.approx(chord, rel=0.03) and "mm between" in words
    page.evaluate(f"{panel}.isMeasuring.click()")
    assert page.evaluate(f"{panel}.caption.textContent") == ""


def test_the_light_follows_pointer_and_keys(page: browser.Page) -> None:
    shown_surface(page, 1)
    light = "glint.viewer.surface.relight.state.light"
    page.evaluate("document.querySelector('.picture').focus()")
    before = page.evaluate(light)
    page.command("Input.dispatchKeyEvent", type="keyDown", key="ArrowRight", code="ArrowRight")
    assert page.evaluate(light)[0] > before[0] + 0.05
    box = box_of(page, ".picture")
    place = {"x": box[0] + box[2] * 0.5, "y": box[1] + box[3] * 0.25, "button": "left", "clickCount": 1}
    page.command("Input.dispatchMouseEvent", type="mousePressed", **place)
    page.command("Input.dispatchMouseEvent", type="mouseReleased", **place)
    x, y, z = page.evaluate(light)
    assert abs(x) < 0.02 and y > 0.3 and z > 0
    assert "from above" in page.evaluate("document.querySelector('.light-words').textContent")


def test_hostile_texts_are_shown_and_never_run(page: browser.Page, file: Path) -> None:
    shown_surface(page, 1)
    page.evaluate("glint.viewer.surface.setLens('provenance')")
    assert page.evaluate("window.hacked ?? null") is None
    assert "window.hacked = 1" in page.evaluate("document.querySelector('.legend').textContent")
    assert "window.hacked = 1" in page.evaluate("document.querySelector('.warning').textContent")
    blocked = page.evaluate("""(() => { const s = document.createElement("script"); s.textContent = "window.hacked = 3";
      document.body.append(s); return window.hacked ?? null; })()""")
    assert blocked is None, "the policy allows the viewer's script alone"
    page.events.clear()
    html = file.read_text(encoding="utf-8")
    assert html.count("<script>window.hacked") == 0 and "'unsafe-inline'" not in html


@pytest.mark.slow
def test_a_large_capture_is_shown_smaller_and_says_so(chromium: browser.Browser, tmp_path: Path) -> None:
    location = local_store(tmp_path / "store")
    repository = ObjectRepository.open(location, "plate")
    save_sphere(repository)
    shape = (1500, 2400)
    normals = np.random.default_rng(0).normal(size=(*shape, 3)).astype(np.float32)
    normals[..., 2] = np.abs(normals[..., 2])
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    everywhere = np.ones(shape, bool)
    repository.save("front", "mask", "large", {"mask": everywhere}, {})
    confidence = np.random.default_rng(1).random(shape).astype(np.float32)
    repository.save("front", "labels", "large", {"normals": normals, "confidence": confidence}, {})
    depth = cv2.GaussianBlur(confidence, (0, 0), 3)
    repository.save("front", "depth", "large", {"depth": depth}, {"unit": "pixels", "pixel_size": None})
    clusters = {"observations": np.ones(shape, np.int32)}
    repository.save("front", "clusters", "large", clusters, {})
    repository.publish(["front"], {}, required=["mask"])
    export(location, "plate", tmp_path / "out")
    path = tmp_path / "out/front/report.html"
    assert path.stat().st_size < MAX_PAGE_BYTES
    page = chromium.page()
    page.open(path.as_uri())
    page.wait("globalThis.glint?.ready.then(() => true)")
    page.wait("document.querySelector('.caption').textContent.includes('Shown at ')")
