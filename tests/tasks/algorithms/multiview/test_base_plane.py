"""The plane on which an object stands: where silhouettes allow it, what contradicts it, what it adds to a model."""

import numpy as np
import pytest
import trimesh

from glint.tasks.algorithms.evaluation.mesh_metrics import score_model
from glint.tasks.algorithms.meshing.implicit import ellipsoid, surface_nets
from glint.tasks.algorithms.multiview.base_plane import BaseEvidence, base_evidence
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.reconstruction import reconstruct_surface
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.multiview.visual_hull import hull_model
from glint.tasks.algorithms.registration.turntable import Turntable
from tests.tasks.algorithms.multiview.figurine import views_of

BASE = -14.0


@pytest.fixture(scope="module")
def truth() -> trimesh.Trimesh:
    """An egg that stands on its flattened end."""
    egg = ellipsoid((3, 2, 0), (24, 28, 20))
    vertices, triangles = surface_nets(
        lambda points: np.maximum(egg(points), BASE - points[:, 1]),
        np.array([-24.0, -30, -22]),
        np.array([30.0, 32, 22]),
        0.8,
    )
    return trimesh.Trimesh(vertices, triangles, process=False)


@pytest.fixture(scope="module")
def from_above(truth: trimesh.Trimesh) -> list[View]:
    """Six views that look down at 25 degrees, and so see nothing of the base."""
    return views_of(truth, Turntable(0.0, 25.0, 0.0, np.arange(0.0, 360.0, 60.0)))


def test_the_plane_is_where_all_silhouettes_allow_it(from_above: list[View]) -> None:
    evidence = base_evidence(from_above)
    assert evidence.height == pytest.approx(BASE, abs=0.7)
    assert evidence.lowest < BASE - 4.0
    names = [view.name for view in from_above]
    assert evidence.contradiction(BASE, names) is None
    assert "shows the object 5." in str(evidence.contradiction(BASE + 5.5, names))
    assert "end" in str(evidence.contradiction(evidence.lowest - 5.0, names))


@pytest.mark.parametrize(
    ("height", "text"),
    [
        (-1.0 + 1.4 * 2.0, None),
        (-1.0 + 1.6 * 2.0, "side shows the object 1.6 pixels below it"),
        (-20.0 - 1.4 * 2.0, None),
        (-20.0 - 1.6 * 2.0, "the silhouettes end 1.6 pixels above it"),
    ],
)
def test_a_plane_may_err_by_a_pixel_and_a_half_either_way(height: float, text: str | None) -> None:
    evidence = BaseEvidence(np.array([0.0, -1.0]), -20.0, 2.0)
    assert evidence.height == -1.0
    assert evidence.contradiction(height, ["front", "side"]) == text


def test_seen_level_the_silhouettes_end_on_the_plane(truth: trimesh.Trimesh) -> None:
    evidence = base_evidence(views_of(truth, Turntable(0.0, 0.0, 0.0, np.arange(0.0, 180.0, 45.0))))
    assert evidence.height == pytest.approx(BASE, abs=0.6) and evidence.lowest == pytest.approx(BASE, abs=0.6)


@pytest.mark.long
def test_the_model_ends_on_the_plane(truth: trimesh.Trimesh, from_above: list[View]) -> None:
    def built(base: float | None) -> Model:
        return reconstruct_surface(from_above, hull_model(from_above, 4000, base), rounds=2, base=base)

    known, unknown = built(BASE), built(None)
    assert unknown.vertices[:, 1].min() < BASE - 4.0 < BASE - 0.6 < known.vertices[:, 1].min()
    scores = [score_model(model.vertices, model.triangles, truth, 20_000).chamfer for model in (known, unknown)]
    assert scores[0] < 0.6 * scores[1] and scores[0] < 0.006
