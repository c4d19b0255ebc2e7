"""The state of the page's server: captures as the catalogue lists them, or as the newest version records them."""

import shutil
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from glint.flows.review.review import Review
from glint.storage.catalogue.models import Capture
from glint.storage.edits.edits import Edits
from glint.storage.edits.models import Changes, mask_png
from glint.storage.errors import NotFoundError, StoreError
from glint.storage.inputs.markup import AnnotationEntry
from glint.storage.versions.repository import ObjectRepository
from glint.tasks.engine.capture_context import CaptureContext, with_edits
from glint.tasks.engine.parameters import Parameters
from glint.tasks.publish import capture_provenance, unedited_entry


def test_without_a_catalogue_a_capture_has_the_parameters_of_its_version(tmp_path: Path) -> None:
    capture = Capture(id="front", frames=str(tmp_path / "front.mp4"))
    parameters = Parameters.model_validate({"labels": {"strength": 3.0}})
    work = CaptureContext(str(tmp_path / "store"), "vase", capture, parameters)
    provenance = {"entry": capture.model_dump(mode="json"), "parameters": parameters.model_dump(mode="json")}
    work.repository.save("front", "mask", "key", {"mask": np.ones((2, 2), bool)}, {})
    work.repository.publish(["front"], {"captures": {"front": provenance}}, ("mask",))
    context = Review(work.store, None).context("vase", "front")
    assert (context.capture, context.parameters) == (capture, parameters)


def test_a_version_is_opened_once_until_its_object_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    work = CaptureContext(str(tmp_path / "store"), "vase", Capture(id="front", frames="front.mp4"), Parameters())
    work.repository.save("front", "mask", "key", {"mask": np.ones((2, 2), bool)}, {})
    work.repository.publish(["front"], {}, ("mask",))
    opened, review = Mock(wraps=ObjectRepository.open), Review(work.store, None)
    monkeypatch.setattr(ObjectRepository, "open", opened)
    first = review.version("vase", "v1")
    assert review.version("vase", "v1") is first and opened.call_count == 1
    with pytest.raises(NotFoundError):
        review.version("vase", "v2")
    first.repository.save("front", "mask", "other", {"mask": np.ones((2, 2), bool)}, {})
    first.repository.publish(["front"], {}, ("mask",))
    assert review.version("vase", "v1") == first and review.version("vase", "v2").name == "v2"
    shutil.rmtree(tmp_path / "store")
    with pytest.raises(NotFoundError):
        review.version("vase", "v1")


def test_a_recorded_capture_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    sphere = {"x": 50.0, "y": 50.0, "radius": 9.0}
    entry = {"id": "front", "frames": str(tmp_path / "front.mp4"), "spheres": [sphere, sphere]}
    work = CaptureContext(str(tmp_path / "store"), "vase", Capture(id="front", frames="/front.mp4"), Parameters())
    work.repository.save("front", "mask", "key", {"mask": np.ones((2, 2), bool)}, {})
    work.repository.publish(["front"], {"captures": {"front": {"entry": entry}}}, ("mask",))
    with pytest.raises(StoreError, match=r"of front cannot be used \(spheres 1 and 2 are the same circle") as caught:
        Review(work.store, None).context("vase", "front")
    assert "start glint review with a CATALOGUE" in caught.value.remedy


def test_without_a_catalogue_edits_are_not_taken_for_what_the_catalogue_gives(tmp_path: Path) -> None:
    capture = Capture(id="front", frames=str(tmp_path / "frames"), pixel_size=0.5)
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "1.png").write_bytes(mask_png(np.ones((2, 2), bool)))
    work = CaptureContext(str(tmp_path / "store"), "vase", capture, Parameters())
    mark = AnnotationEntry(frame=3, x=1.0, y=1.0, kind="true")
    Edits.open(work.location, "vase").save("front", Changes(marks=(mark,), pixel_size=0.25), "Ann", 0)
    (edited,) = with_edits([work])
    work.repository.save("front", "mask", "key", {"mask": np.ones((2, 2), bool)}, {})
    recorded = capture_provenance(edited)
    work.repository.publish(["front"], {"captures": {"front": recorded}}, ("mask",))
    assert recorded["entry"]["pixel_size"] == 0.25 and "markup" in recorded["entry"]
    assert Review(work.store, None).context("vase", "front").capture == capture
    del recorded["catalogue_entry"]
    assert unedited_entry(recorded) == {"id": "front", "frames": capture.frames}, "as older versions record it"
