"""The server's answers to requests that cannot be met: what is wrong, and what to do about it."""

import shutil
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from glint.flows.review.access import Access
from glint.flows.review.app import create_app
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from tests.glint.sample_store import Sphere, save_sphere

CATALOGUE = "schema: 1\nname: x\nobjects:\n- {id: vase, captures: [{id: front, frames: %s}]}\n"
INPUTS = "/api/captures/vase/front/inputs"


def client(store: Path, catalogue: Path | None = None) -> TestClient:
    """A browser that was let in, without a server in between; what the server does not expect is raised."""
    access = Access(("http://127.0.0.1:4300",))
    app = create_app(str(store), None if catalogue is None else str(catalogue), access)
    headers = {"Cookie": f"{access.cookie}={access.session}"}
    return TestClient(app, base_url=access.origins[0], headers=headers)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (CATALOGUE % "a.mp4" + "nonsense: [\n", "not YAML"),
        (CATALOGUE % "'http://host/a.mp4'", "addresses of http:// are not supported"),
    ],
)
def test_a_catalogue_that_cannot_be_used_is_answered_with_its_error(tmp_path: Path, text: str, error: str) -> None:
    (tmp_path / "catalogue.yaml").write_text(text)
    answer = client(tmp_path / "store", tmp_path / "catalogue.yaml").get(INPUTS)
    assert answer.status_code == 422
    assert error in answer.json()["error"] and answer.json()["remedy"]


def test_a_store_that_was_removed_and_filled_again_is_shown_as_it_is_now(tmp_path: Path) -> None:
    browser, shown = client(tmp_path / "store"), []
    for radius, run in ((5.0, "run a"), (6.0, "run b")):
        shutil.rmtree(tmp_path / "store", ignore_errors=True)
        repository = ObjectRepository.open(Location.parse(tmp_path / "store"), "vase")
        save_sphere(repository, "front", Sphere((0.0, 0.0, 0.0), radius))
        repository.publish(["front"], {"run": run})
        (version,) = browser.get("/api/objects/vase/versions").json()
        assert version["run"] == run
        shown.append(browser.get("/api/objects/vase/versions/v1/captures/front/surface/normals").content)
    assert shown[0] != shown[1]
    assert browser.get("/api/objects/vase/versions/v2/captures/front/surface").status_code == 404
    assert browser.get("/api/objects/vase/differences/v1/v1/front").status_code == 200
