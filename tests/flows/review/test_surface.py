"""The surface and the versions of a capture on the review page: what is sent, and what a browser draws of it."""

import base64
import json
import urllib.error
import urllib.request
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from glint import reading
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from glint.tasks.algorithms.meshing.shading import relit
from tests import browser
from tests.flows.review.conftest import ServedPage
from tests.flows.review.inputs_view import NOISE as DRAWING_NOISE
from tests.storage.export.page.unpacking import unfolded, unpacked

pytestmark = pytest.mark.long

OBJECT = "/api/objects/hemisphere"
SURFACE = f"{OBJECT}/versions/v1/captures/front/surface"
NOISE = (*DRAWING_NOISE, "Password forms should")
"""What Chromium remarks about drawing without a graphics card, and about the page of the password."""


def answer_of(served: ServedPage, path: str, body: Any = None) -> tuple[int, bytes]:
    """Status and content of an answer."""
    headers = served.session | {"Content-Type": "application/json"}
    data = None if body is None else json.dumps(body).encode()
    try:
        with urllib.request.urlopen(urllib.request.Request(served.origin + path, data, headers)) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


@pytest.fixture(scope="module")
def second_version(served: ServedPage) -> str:
    """Make a version whose normals are turned by 10 degrees about the vertical axis."""
    repository = ObjectRepository.open(Location.parse(str(served.store)), "hemisphere", create=False)
    results = repository.load_capture("front", "v1")
    labels = results["labels"]
    arrays = {name: labels.read(name) for name in labels.arrays}
    sine, cosine = np.sin(np.radians(10.0)), np.cos(np.radians(10.0))
    turn = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
    arrays["normals"] = (arrays["normals"].astype(float) @ turn.T).astype(np.float32)
    record = dict(labels.record)
    record["parameters"] = dict(record["parameters"]) | {"prior": "</td><script>window.hacked = 1</script>"}
    repository.save("front", "labels", "turned", arrays, record)
    return repository.publish(["front"], dict(repository.version("v1").metadata)).name


@pytest.fixture
def page(served: ServedPage) -> Iterator[browser.Page]:
    """A tab that was let in; nothing may have been refused, thrown or asked of others when a test ends."""
    if browser.program() is None:
        pytest.skip("Chromium is not installed (Debian: chromium)")
    with browser.Browser() as running:
        page = running.page()
        page.open(served.access.link())
        page.wait("location.pathname === '/' && document.querySelector('#main .row') !== null")
        yield page
        assert [text for text in page.complaints() if not any(noise in text for noise in NOISE)] == []
        assert not [event for event in page.events if event.get("method") == "Runtime.exceptionThrown"]
        assert [url for url in page.requested() if not url.startswith((served.origin, "blob:", "data:"))] == []


def open_view(page: browser.Page, view: str) -> None:
    page.evaluate(f"globalThis.glint = null; location.hash = '#/hemisphere/front/{view}'")
    page.wait("globalThis.glint?.ready.then(() => true)")


def test_parts_are_what_the_store_holds(served: ServedPage) -> None:
    status, body = answer_of(served, SURFACE)
    facts = json.loads(body)
    assert status == 200 and {"normals", "mask", "confidence", "provenance", "depth", "candidates"} <= set(
        facts["parts"]
    )
    capture = reading.open(served.store)["hemisphere"]["v1"]["front"]

    def array(name: str) -> np.ndarray:
        from glint.storage.export.page.packing import Part

        about = facts["parts"][name]
        return unpacked(Part(about["kind"], tuple(about["shape"]), answer_of(served, f"{SURFACE}/{name}")[1]))

    np.testing.assert_array_equal(array("mask"), capture.mask)
    np.testing.assert_allclose(unfolded(array("normals"))[capture.mask], capture.normals[capture.mask], atol=1e-4)
    np.testing.assert_array_equal(array("provenance"), np.where(capture.mask, capture.provenance, 0))
    initial = unfolded(array("initial_normals"))[capture.mask]
    np.testing.assert_allclose(initial, capture.initial_normals[capture.mask], atol=1e-4)
    frames = [photograph for photograph in facts["photographs"] if photograph["frame"] is not None]
    assert len(frames) > 20 and all(capture.accepted[photograph["frame"]] for photograph in frames)
    status, picture = answer_of(served, f"{SURFACE}/{frames[-1]['part']}")
    assert status == 200 and picture.startswith(b"\xff\xd8\xff")


def test_other_names_are_refused(served: ServedPage) -> None:
    for path, status in {
        f"{SURFACE}/nothing": 404,
        f"{SURFACE}/frame_999999999": 404,
        f"{SURFACE}/..%2Fv1": 404,
        f"{SURFACE}/NORMALS": 422,
        f"{OBJECT}/versions/v9/captures/front/surface": 404,
        f"{OBJECT}/versions/main/captures/front/surface": 422,
        f"{OBJECT}/versions/v1/captures/back/surface": 404,
        "/api/objects/other/versions": 404,
        f"{OBJECT}/versions/v1/model/positions": 404,
        f"{OBJECT}/differences/v1/v9/front": 404,
    }.items():
        assert answer_of(served, path)[0] == status, path
    assert answer_of(served, f"{OBJECT}/versions/v1/model") == (200, b"null")
    assert answer_of(served, f"{OBJECT}/rollback", {"version": "v7"})[0] == 404
    assert answer_of(served, f"{OBJECT}/rollback", {"version": "main"})[0] == 422


def test_the_surface_is_relit_as_the_pipeline_does(served: ServedPage, page: browser.Page) -> None:
    open_view(page, "surface")
    assert page.evaluate("glint.viewer.hasFailed") is False, page.text()
    view = "glint.viewer.surface.relight"
    code = f"""(() => {{ glint.viewer.surface.setMaterial("matte"); {view}.set({{ light: [0.6, 0, 0.8] }});
      let text = "";
      for (const octet of {view}.pixels()) text += String.fromCharCode(octet);
      return btoa(text); }})()"""
    capture = reading.open(served.store)["hemisphere"].latest["front"]
    pixels = np.frombuffer(base64.b64decode(page.evaluate(code)), np.uint8).reshape(*capture.mask.shape, 4)
    expected = relit(capture.normals, capture.mask, (0.6, 0.0, 0.8))
    assert np.abs(pixels[..., 0].astype(int) - expected).max() <= 1
    for lens in ("confidence", "provenance", "depth", "candidates"):
        page.evaluate(f"glint.viewer.surface.setLens('{lens}')")
        assert page.evaluate("document.querySelector('.legend').textContent.length > 3")
    page.evaluate("glint.viewer.surface.setWipe(0.5)")
    page.wait("document.querySelector('.caption').textContent.startsWith('Photograph: frame ')")
    for field in ("winner", "initial", "candidate_0", ""):
        page.evaluate(f"glint.viewer.surface.field.value = '{field}'; glint.viewer.surface.setField('{field}')")
    page.evaluate("glint.viewer.show('mesh')")
    assert page.evaluate("glint.viewer.hasFailed") is False, page.text()


def test_keys_reach_the_surface(page: browser.Page) -> None:
    open_view(page, "surface")
    for key, expression in {
        "4": "glint.viewer.surface.relight.state.material === 'relief'",
        "c": "glint.viewer.surface.lensName === 'confidence'",
        "d": "!document.querySelector('.profile').hidden",
        "m": "glint.viewer.mode === 'mesh'",
    }.items():
        page.command("Input.dispatchKeyEvent", type="keyDown", key=key, text=key)
        page.wait(expression)


def test_two_versions_are_compared_noted_and_rolled_back(
    served: ServedPage, page: browser.Page, second_version: str
) -> None:
    assert second_version == "v2"
    open_view(page, "versions")
    assert [page.evaluate(f"document.querySelector('.name-of.{side}').textContent") for side in "ab"] == ["v1", "v2"]
    page.evaluate("globalThis.glint.stage.angles.click()")
    page.wait("document.querySelector('.legend-box').textContent.includes('Angle between')")
    text = page.evaluate("document.querySelector('.changes').textContent")
    assert "median angle" in text or "mean angle" in text
    assert "window.hacked = 1" in text and page.evaluate("window.hacked ?? null") is None
    page.evaluate("globalThis.glint.stage.split(0.25)")
    assert page.evaluate("document.querySelector('.stage-b').style.clipPath").endswith("25%)")
    page.evaluate("""(() => { const form = document.querySelector('.versions form');
      form.querySelector('textarea').value = 'Turned <b>too far</b>'; form.querySelector('input').value = 'Ada';
      form.requestSubmit(); })()""")
    page.wait("document.querySelector('.notes').textContent.includes('Turned <b>too far</b>Ada')")
    page.evaluate("window.confirm = () => true; document.querySelector('.versions td button').click()")
    page.wait("document.querySelector('.name-of.b').textContent === 'v3'")
    stored = reading.open(served.store)["hemisphere"]
    assert stored.versions == ("v1", "v2", "v3")
    np.testing.assert_array_equal(stored["v3"]["front"].normals, stored["v1"]["front"].normals)


def test_the_angles_between_versions_are_exact(served: ServedPage, second_version: str) -> None:
    path = f"{OBJECT}/differences/v1/{second_version}/front"
    facts = json.loads(answer_of(served, path)[1])
    assert {"labels"} == {change["stage"] for change in facts["changes"]}
    assert 5.0 < facts["figures"]["mean angle"] <= 10.0
