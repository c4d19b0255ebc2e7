"""What the surface view keeps while a person looks around, and what it says where a part cannot be read."""

from typing import Any

import pytest

from tests.flows.review.conftest import Tab
from tests.flows.review.inputs_view import INPUTS, settle
from tests.flows.review.test_late_answers import Held

pytestmark = pytest.mark.long

OPEN = "globalThis.glint?.ready?.then(() => true)"
SURFACE = "glint.viewer.surface"


@pytest.fixture
def surface(tab: Tab) -> Any:
    """A tab with the surface drawn, whose remarks about drawing do not count."""
    tab.page.evaluate("view => { location.hash = view; }", INPUTS.replace("inputs", "surface"))
    tab.wait(OPEN)
    yield tab
    settle(tab)


def test_a_version_whose_parts_come_after_another_was_chosen_is_not_drawn(tab: Tab) -> None:
    held = Held(tab, "**/surface/normals")
    tab.page.evaluate("view => { location.hash = view; }", INPUTS.replace("inputs", "surface"))
    held.wait()
    tab.page.evaluate("document.querySelector('[aria-label=Version]').dispatchEvent(new Event('change'))")
    tab.wait(f"{SURFACE}?.capture !== undefined")
    held.release()
    settle(tab)


def test_few_photographs_are_kept_while_the_light_goes_round(surface: Tab) -> None:
    kept = surface.page.evaluate(f"""async () => {{
      const view = {SURFACE}, seen = new Set(), set = view.relight.setPhotograph;
      view.relight.setPhotograph = function (bitmap) {{ seen.add(bitmap); set.call(this, bitmap); }};
      view.setWipe(0.5);
      for (let turn = 0; turn < 20; turn += 1) {{
        const angle = (turn / 20) * 2 * Math.PI;
        view.dial.move(0.5 * Math.cos(angle), 0.5 * Math.sin(angle));
        await view.photograph();
        for (let wait = 0; wait < 100 && ![...view.pictures.keys()].includes(view.shown); wait += 1) {{
          await new Promise((resolve) => setTimeout(resolve, 20));
        }}
      }}
      const open = [...seen].filter((bitmap) => bitmap.width > 0).length;
      return [seen.size, open, view.pictures.size];
    }}""")
    seen, still_open, listed = kept
    assert seen > 10 and still_open == listed == 8


def test_a_capture_is_shown_beside_its_own_photograph(surface: Tab) -> None:
    shown = surface.page.evaluate(f"""async () => {{
      const view = {SURFACE}, first = view.capture, pictures = [];
      view.setWipe(0.5);
      await view.photograph();
      const second = Object.create(first);
      second.picture = async () => createImageBitmap(new ImageData(3, 5));
      const set = view.relight.setPhotograph;
      view.relight.setPhotograph = function (bitmap) {{ pictures.push(bitmap.width); set.call(this, bitmap); }};
      await view.setCapture(second);
      await new Promise((resolve) => setTimeout(resolve, 300));
      return pictures;
    }}""")
    assert shown[-1:] == [3]


def test_a_part_that_cannot_be_read_is_named_and_asked_for_again(surface: Tab) -> None:
    page, refusal = surface.page, {"error": "frame 7 is not cached", "remedy": "run again"}
    page.route("**/surface/frame_*", lambda route: route.fulfill(status=422, json=refusal))
    page.route("**/surface/winner_*", lambda route: route.fulfill(status=422, json=refusal))
    page.evaluate(f"{SURFACE}.setWipe(0.5)")
    surface.wait("document.querySelector('.caption').textContent.includes('frame 7 is not cached → run again')")
    page.select_option("[aria-label=Normals]", "winner")
    surface.wait("document.querySelector('.caption').textContent.startsWith('winner_')")
    page.unroute("**/surface/frame_*")
    page.unroute("**/surface/winner_*")
    page.evaluate(f"{SURFACE}.setField('winner')")
    surface.wait("document.querySelector('.caption').textContent.startsWith('Normals: ')")
    page.evaluate(f"{SURFACE}.setWipe(0.5)")
    surface.wait(f"{SURFACE}.pictures.size === 1")
    surface.complaints[:] = [text for text in surface.complaints if "422" not in text]


def test_a_lens_that_cannot_be_read_leaves_none_and_says_why(surface: Tab) -> None:
    page, refusal = surface.page, {"error": "confidence of front is damaged", "remedy": "glint verify"}
    page.route("**/surface/confidence", lambda route: route.fulfill(status=422, json=refusal))
    page.evaluate(f"{SURFACE}.setLens('provenance')")
    page.evaluate(f"{SURFACE}.setLens('confidence')")
    surface.wait("document.querySelector('.legend-box').textContent.includes('is damaged → glint verify')")
    state = page.evaluate(f"[{SURFACE}.lensName, {SURFACE}.relight.state.lensShare, {SURFACE}.share.hidden]")
    assert state == ["none", 0, True]
    page.unroute("**/surface/confidence")
    page.evaluate(f"{SURFACE}.setLens('confidence')")
    surface.wait("document.querySelector('.legend').textContent.includes('Probability')")
    surface.complaints[:] = [text for text in surface.complaints if "422" not in text]


def test_a_mesh_that_cannot_be_read_is_asked_for_again(surface: Tab) -> None:
    page, refusal = surface.page, {"error": "the mesh is damaged", "remedy": "glint verify"}
    page.route("**/surface/positions", lambda route: route.fulfill(status=422, json=refusal))
    assert page.evaluate("glint.viewer.show('mesh').then(() => glint.viewer.hasFailed)") is True
    assert "the mesh is damaged" in page.inner_text(".failure")
    page.unroute("**/surface/positions")
    assert page.evaluate("glint.viewer.show('mesh').then(() => glint.viewer.hasFailed)") is False
    assert page.evaluate("glint.viewer.meshes.view.mesh.geometry.index.count") > 0
    surface.complaints[:] = [text for text in surface.complaints if "422" not in text]


def test_a_view_that_fails_late_says_nothing_about_the_one_that_is_shown(surface: Tab) -> None:
    failed, text = surface.page.evaluate("""async () => {
      const { viewer } = glint, held = Promise.withResolvers(), show = viewer.showMesh;
      viewer.showMesh = () => held.promise;
      const late = viewer.show("mesh");
      await viewer.show("surface");
      held.reject(new Error("the mesh is damaged"));
      await late;
      viewer.showMesh = show;
      return [viewer.hasFailed, viewer.failure.textContent];
    }""")
    assert (failed, text) == (False, "")


def test_a_map_of_angles_that_cannot_be_read_says_why(tab: Tab) -> None:
    refusal = {"error": "normals of front are damaged", "remedy": "glint verify"}
    tab.page.route("**/differences/**/difference", lambda route: route.fulfill(status=422, json=refusal))
    tab.page.evaluate("view => { location.hash = view; }", INPUTS.replace("inputs", "versions"))
    tab.wait("globalThis.glint?.stage && globalThis.glint.ready.then(() => true)")
    tab.page.check("text=Map of angles")
    tab.wait("document.querySelector('.legend-box').textContent.includes('are damaged → glint verify')")
    tab.page.unroute("**/differences/**/difference")
    tab.page.uncheck("text=Map of angles")
    tab.page.check("text=Map of angles")
    tab.wait("document.querySelector('.legend-box').textContent.includes('Angle between')")
    settle(tab)
    tab.complaints[:] = [text for text in tab.complaints if "422" not in text]


def test_meshes_that_are_not_shown_any_longer_take_no_graphics_memory(surface: Tab) -> None:
    counts = surface.page.evaluate("""async () => {
      await glint.viewer.show("mesh");
      const { meshArrays } = await import("/static/viewer/payload.js");
      const { view } = glint.viewer.meshes, { facts } = glint.viewer.captures[0], counts = [];
      const arrays = await meshArrays(glint.viewer.captures[0]);
      const cameras = [{ toward: [0, 0, 1], up: [0, 1, 0] }];
      for (let turn = 0; turn < 4; turn += 1) {
        view.setMesh(arrays);
        view.setCameras(cameras);
        view.showOutlines(cameras, true);
        view.renderer.render(view.scene, view.camera);
        counts.push(view.renderer.info.memory.geometries);
      }
      return counts;
    }""")
    assert counts[0] > 0 and set(counts) == {counts[0]}


def test_a_profile_is_not_left_beside_a_capture_without_depth(surface: Tab) -> None:
    surface.page.evaluate(f"{SURFACE}.setProfile(true)")
    assert surface.page.is_visible(".profile")
    surface.page.evaluate(f"""async () => {{
      const without = Object.create({SURFACE}.capture);
      without.has = (name) => name !== "depth" && name in without.facts.parts;
      await {SURFACE}.setCapture(without);
    }}""")
    assert surface.page.is_hidden(".profile")
    surface.page.focus("main")
    surface.page.keyboard.press("d")
    assert surface.page.is_hidden(".profile")
