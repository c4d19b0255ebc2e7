"""Views are labelled again along the rays of their own cameras."""

from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import create_autospec

import numpy as np
import pytest

from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.model import view_registration
from glint.tasks.model.view_registration import relabelled
from glint.tasks.stages.labels import reconstruct
from tests.tasks.algorithms.multiview.figurine import full_view


@pytest.mark.parametrize("focal_length", [500.0, 900.0])
def test_a_perspective_view_is_labelled_with_its_cameras_matrix(
    focal_length: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    view, camera = full_view("view"), np.diag([focal_length, focal_length, 1.0])
    labelling: Any = create_autospec(
        reconstruct, return_value=SimpleNamespace(normals=view.normals, confidence=view.confidence)
    )
    geometry = SimpleNamespace(region_camera=camera, view_vectors=np.ones((*view.mask.shape, 3)))
    for name, value in {
        "reconstruct": labelling,
        "expected_normals": lambda model, view: np.ones((*view.mask.shape, 3)),
        "load_geometry": lambda work: geometry,
        "load_clusters": lambda work: None,
        "load_marks": lambda work: None,
    }.items():
        monkeypatch.setattr(view_registration, name, value)
    stage = SimpleNamespace(read=lambda name: view.normals)
    work = cast(CaptureContext, SimpleNamespace(parameters=Parameters(), load=lambda name: stage))
    relabelled(view, cast(Model, None), work)
    assert labelling.call_args.kwargs["camera"] is camera
