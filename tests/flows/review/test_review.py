"""The state of the page's server: captures as the catalogue lists them, or as the newest version records them."""

from pathlib import Path

import numpy as np

from glint.flows.review.review import Review
from glint.storage.catalogue.models import Capture
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters


def test_without_a_catalogue_a_capture_has_the_parameters_of_its_version(tmp_path: Path) -> None:
    capture = Capture(id="front", frames=str(tmp_path / "front.mp4"))
    parameters = Parameters.model_validate({"labels": {"strength": 3.0}})
    work = CaptureContext(str(tmp_path / "store"), "vase", capture, parameters)
    provenance = {"entry": capture.model_dump(mode="json"), "parameters": parameters.model_dump(mode="json")}
    work.repository.save("front", "mask", "key", {"mask": np.ones((2, 2), bool)}, {})
    work.repository.publish(["front"], {"captures": {"front": provenance}}, ("mask",))
    context = Review(work.store, None).context("vase", "front")
    assert (context.capture, context.parameters) == (capture, parameters)
