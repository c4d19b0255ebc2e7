"""What is packed can be unpacked: here in numpy, as the viewer does it in JavaScript."""

import numpy as np
import pytest

from glint.storage.export.mesh_files import Mesh
from glint.storage.export.page.mesh_packing import decimated, pack_mesh
from glint.storage.export.page.packing import (
    NO_CONFIDENCE,
    confidence_codes,
    octahedral,
    pack,
    scaled_codes,
)
from glint.storage.export.page.photographs import spread_frames
from tests.storage.export.page.unpacking import unfolded, unpacked


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.uint32])
@pytest.mark.parametrize("shape", [(1, 1), (7, 5), (3, 11, 2), (1, 40, 3)])
def test_nothing_is_lost(dtype: type, shape: tuple[int, ...]) -> None:
    values = np.random.default_rng(0).integers(0, np.iinfo(dtype).max, shape, dtype, endpoint=True)
    part = pack(values)
    assert part.facts == {"kind": f"u{8 * values.itemsize}", "shape": list(shape)}
    np.testing.assert_array_equal(unpacked(part), values)


def test_what_is_smooth_becomes_small() -> None:
    values = np.add.outer(np.arange(300), 7 * np.arange(400)).astype(np.uint16)
    assert len(pack(values).data) < values.nbytes / 50


def test_other_arrays_are_refused() -> None:
    for values in (np.zeros(3, np.uint8), np.zeros((3, 3)), np.zeros((3, 3), np.int16)):
        with pytest.raises(ValueError, match="cannot be packed"):
            pack(values)


def test_directions_keep_four_thousandths_of_a_degree() -> None:
    vectors = np.random.default_rng(1).normal(size=(20_000, 3))
    vectors[:6] = np.concatenate([np.eye(3), -np.eye(3)])
    vectors /= np.linalg.norm(vectors, axis=-1, keepdims=True)
    sine = np.linalg.norm(np.cross(vectors, unfolded(octahedral(vectors))), axis=-1)
    assert np.degrees(sine.max()) < 0.004
    np.testing.assert_allclose(unfolded(octahedral(np.full((1, 3), np.nan))), [[0, 0, 1]], atol=1e-4)


def test_codes_of_depth_and_confidence() -> None:
    values = np.array([[np.nan, -3.0, 0.5, 7.0]], np.float32)
    codes, (low, high) = scaled_codes(values)
    assert codes.tolist()[0][:2] == [0, 1] and codes[0, 3] == 65535 and (low, high) == (-3.0, 7.0)
    assert low + (codes[0, 2] - 1) / 65534 * (high - low) == pytest.approx(0.5, abs=1e-4)
    assert scaled_codes(np.full((1, 2), np.nan))[0].tolist() == [[0, 0]]
    assert scaled_codes(np.full((1, 2), 4.0))[0].tolist() == [[1, 1]]
    assert confidence_codes(np.array([np.nan, 0.0, 1.0, 2.0])).tolist() == [NO_CONFIDENCE, 0, 254, 254]


def sphere(n: int) -> Mesh:
    """A sphere of radius 10 around (5, 6, 7) of about 2 n^2 triangles."""
    azimuth, polar = np.meshgrid(np.linspace(0, 2 * np.pi, n, False), np.linspace(0.02, np.pi - 0.02, n), indexing="ij")
    normals = np.stack([np.sin(polar) * np.cos(azimuth), np.cos(polar), np.sin(polar) * np.sin(azimuth)], axis=-1)
    index = np.arange(n * n).reshape(n, n)
    a, b = index[:, :-1].ravel(), np.roll(index, -1, axis=0)[:, :-1].ravel()
    triangles = np.concatenate([np.stack([a, b, a + 1], -1), np.stack([b, b + 1, a + 1], -1)]).astype(np.int32)
    normals = normals.reshape(-1, 3)
    confidence = np.where(normals[:, 0] > 0, 0.9, 0.2).astype(np.float32)
    return Mesh((normals * 10 + (5, 6, 7)).astype(np.float32), triangles, normals.astype(np.float32), confidence, "mm")


def test_a_decimated_mesh_stays_on_the_surface_and_promises_no_more() -> None:
    mesh = sphere(150)
    small = decimated(mesh, 5000)
    assert 2000 < len(small.triangles) <= 5000 and decimated(mesh, 10**6) is mesh
    radius = np.linalg.norm(small.vertices - (5, 6, 7), axis=-1)
    assert np.all(np.abs(radius - 10) < 0.15)
    corners = small.vertices[small.triangles].astype(float)
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outwards = (facing * (corners.mean(axis=1) - (5, 6, 7))).sum(axis=-1)
    assert (outwards > 0).mean() > 0.98 or (outwards < 0).mean() > 0.98, "triangles keep their side"
    across = small.vertices[:, 0] < 4.5
    assert small.confidence[across].max() < 0.21 and small.confidence.max() == pytest.approx(0.9)


def test_a_packed_mesh_is_the_mesh() -> None:
    mesh = sphere(20)
    facts, parts = pack_mesh(mesh, 10**6)
    positions = np.array(facts["origin"]) + unpacked(parts["positions"])[0] * facts["step"]
    np.testing.assert_allclose(positions, mesh.vertices, atol=20 / 65535)
    corners = unpacked(parts["triangles"])[0]
    corners[:, 1:] += corners[:, :1]
    np.testing.assert_array_equal(corners, mesh.triangles)
    np.testing.assert_allclose(unfolded(unpacked(parts["vertex_normals"])[0]), mesh.normals, atol=1e-4)
    assert facts["unit"] == "mm" and facts["triangles"] == facts["shown_triangles"] == len(mesh.triangles)


def test_frames_come_from_all_sides() -> None:
    angle = np.radians(np.arange(360.0))
    lights = np.stack([np.cos(angle) * 0.8, np.sin(angle) * 0.8, np.full(360, 0.6)], axis=-1)
    lights[10:350:2] = np.nan
    frames = spread_frames(lights, 4)
    assert len(frames) == 4 and np.isfinite(lights[frames]).all()
    assert np.diff([*frames, frames[0] + 360]).min() > 40
    assert spread_frames(np.full((5, 3), np.nan), 4) == [] and spread_frames(lights[:3], 9) == [0, 1, 2]
    assert spread_frames(lights, 1) == [0] and spread_frames(lights, 0) == []
