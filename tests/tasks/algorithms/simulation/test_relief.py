import numpy as np
import pytest

from glint.tasks.algorithms.simulation.ray_tracing import Scene
from glint.tasks.algorithms.simulation.shapes import untransformed_solids


@pytest.mark.parametrize("shape", ["hobnail-vase", "ribbed-bottle", "cut-bowl"])
def test_a_vessel_lies_within_the_box_that_it_is_meshed_in(shape: str) -> None:
    """What a box cuts off would have the normals of the solid that goes on beyond it."""
    (solid,) = untransformed_solids(shape)
    assert solid.function is not None
    assert np.abs(solid.function(solid.vertices)).max() < 1e-6


def test_the_base_of_the_cut_bowl_is_flat_in_the_mesh_and_in_its_normals() -> None:
    (solid,) = untransformed_solids("cut-bowl")
    origins = np.column_stack([np.linspace(-22.0, 22.0, 12), np.full(12, -200.0), np.full(12, 3.0)])
    upwards = np.tile([0.0, 1.0, 0.0], (12, 1))
    distances, _, normals = Scene([solid]).cast(origins, upwards)
    exact = solid.exact_normals(origins + upwards * distances[:, None])
    assert exact is not None
    assert np.ptp(distances) < 1e-3
    assert np.allclose(normals, -upwards, atol=1e-6) and np.allclose(exact, -upwards, atol=1e-6)
