"""The server's answers to requests that cannot be met: what is wrong, and what to do about it."""

import base64
import shutil
import socket
from pathlib import Path

import cv2
import numpy as np
import pytest
from fastapi.testclient import TestClient

from glint.flows.review.access import Access
from glint.flows.review.app import create_app
from glint.storage.edits.models import mask_png
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from tests.glint.sample_store import Sphere, save_sphere
from tests.pictures import decode_picture

CATALOGUE = "schema: 1\nname: x\nobjects:\n- {id: vase, captures: [{id: front, frames: %s}]}\n"
INPUTS = "/api/captures/vase/front/inputs"


def client(store: Path | Location, catalogue: Path | None = None) -> TestClient:
    """A browser that was let in, without a server in between; what the server does not expect is raised."""
    access = Access(("http://127.0.0.1:4300",))
    address = store.uri if isinstance(store, Location) else str(store)
    app = create_app(address, None if catalogue is None else str(catalogue), access)
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


@pytest.mark.long
def test_a_store_that_does_not_answer_is_no_fault_of_the_request(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as unused:
        endpoint = f"http://127.0.0.1:{unused.getsockname()[1]}"
    keys = {"AWS_ACCESS_KEY_ID": "a", "AWS_SECRET_ACCESS_KEY": "b", "AWS_REGION": "us-east-1"}
    for name, value in (keys | {"AWS_ENDPOINT_URL": endpoint, "AWS_ALLOW_HTTP": "true"}).items():
        monkeypatch.setenv(name, value)
    answer = client(Location.parse("s3://bucket/store")).get("/api/objects/vase/versions")
    assert answer.status_code == 503 and "the server is up" in answer.json()["remedy"]


def test_a_version_names_what_people_had_edited(tmp_path: Path) -> None:
    repository = ObjectRepository.open(Location.parse(tmp_path / "store"), "vase")
    save_sphere(repository, "front", Sphere((0.0, 0.0, 0.0), 5.0))
    changes = {"mask": {"author": "Ada", "revision": 2}, "spheres": {"author": "Bob", "revision": 1}}
    repository.publish(["front"], {"captures": {"front": {"edits": {"changes": changes, "revision": 2}}}})
    (version,) = client(tmp_path / "store").get("/api/objects/vase/versions").json()
    assert version["edits"] == {"front": {"mask": "Ada", "spheres": "Bob"}}


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
    rolled_back = browser.post("/api/objects/vase/rollback", json={"version": "v1"})
    assert rolled_back.json() == {"version": "v1", "created": False}


def test_an_object_that_never_ran_has_no_versions_and_one_that_nobody_lists_is_absent(tmp_path: Path) -> None:
    (tmp_path / "catalogue.yaml").write_text(CATALOGUE % "a.mp4")
    browser = client(tmp_path / "store", tmp_path / "catalogue.yaml")
    answer = browser.get("/api/objects/vase/versions")
    assert (answer.status_code, answer.json()) == (200, [])
    assert browser.get("/api/objects/cup/versions").status_code == 404
    asked = browser.get("/api/captures/vase/front/questions").json()
    assert (asked["error"], asked["remedy"]) == ("vase/front has no results yet", "run the capture")


def test_a_mask_is_grown_in_place_of_one_that_cannot_be_used(tmp_path: Path) -> None:
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "1.png").write_bytes(mask_png(np.ones((4, 6), bool)))
    (tmp_path / "mask.png").write_bytes(mask_png(np.ones((3, 3), bool)))
    (tmp_path / "catalogue.yaml").write_text(CATALOGUE % "frames, mask: mask.png")
    browser = client(tmp_path / "store", tmp_path / "catalogue.yaml")
    refused = browser.get("/api/captures/vase/front/mask")
    assert refused.status_code == 422 and "paint the mask with Brush" in refused.json()["remedy"]
    grown = browser.get("/api/captures/vase/front/growth?x=2&y=2&tolerance=10&picture=0")
    assert grown.status_code == 200
    assert decode_picture(grown.content, cv2.IMREAD_GRAYSCALE).all()


def test_edits_have_one_form_before_the_first_and_after_all_are_taken_back(tmp_path: Path) -> None:
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "1.png").write_bytes(mask_png(np.ones((4, 6), bool)))
    (tmp_path / "catalogue.yaml").write_text(CATALOGUE % "frames")
    browser = client(tmp_path / "store", tmp_path / "catalogue.yaml")
    before = browser.get("/api/captures/vase/front/edits").json()
    assert not (tmp_path / "store" / "objects").exists()
    body = {"changes": {"verdict": "good"}, "author": "Ann", "base_revision": 0}
    assert browser.post("/api/captures/vase/front/edits", json=body).status_code == 200
    undo = {"revision": 1, "author": "Ann"}
    assert browser.post("/api/captures/vase/front/edits/undo", json=undo).status_code == 200
    after = browser.get("/api/captures/vase/front/edits").json()
    assert before == after | {"revision": 0, "history": [], "changes": {}}


def test_a_mask_is_decoded_only_if_its_head_states_the_size_of_the_frames(tmp_path: Path) -> None:
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "1.png").write_bytes(mask_png(np.ones((4, 6), bool)))
    (tmp_path / "catalogue.yaml").write_text(CATALOGUE % "frames")
    browser = client(tmp_path / "store", tmp_path / "catalogue.yaml")

    def saved(data: bytes) -> tuple[int, str]:
        changes = {"mask": base64.b64encode(data).decode()}
        body = {"changes": changes, "author": "Ann", "base_revision": 0}
        answer = browser.post("/api/captures/vase/front/edits", json=body)
        return answer.status_code, answer.text

    def refused(mask: str) -> str:
        body = {"changes": {"mask": mask}, "author": "Ann", "base_revision": 0}
        answer = browser.post("/api/captures/vase/front/edits", json=body)
        assert answer.status_code == 422
        return str(answer.json()["error"])

    assert all(refused(mask).startswith("the mask is not base64") for mask in ("====", "\u00e9", "a b"))
    whole = mask_png(np.ones((4, 6), bool))
    head = mask_png(np.ones((4, 12_000), bool))[:60]
    for data, error in (
        (head, "the painted mask is 12000 x 4"),
        (b"no image", "the mask is no PNG"),
        (cv2.imencode(".tiff", np.full((4, 6), 255, np.uint8))[1].tobytes(), "the mask is no PNG"),
        (mask_png(np.zeros((4, 6), bool)), "the mask is empty"),
    ):
        status, text = saved(data)
        assert status == 422 and error in text
    assert saved(whole)[0] == 200
    misnamed = browser.get("/api/captures/VASE/front/edits")
    assert misnamed.status_code == 422 and "'VASE': this is not of the form ^[a-z0-9]" in misnamed.json()["error"]
