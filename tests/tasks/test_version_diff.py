"""Differences of two versions: angles, depths, parameters and inputs, and when a surface counts as changed."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glint.storage.errors import StoreError
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.pipeline import STAGES
from glint.tasks.version_diff import ENTRY, ENTRY_KEYS, captures_of_both, compare, drifts
from tests.tasks.tilted_versions import REGION, depth, publish, tilted


@pytest.fixture
def repository(tmp_path: Path) -> ObjectRepository:
    return ObjectRepository.open(Location.parse(tmp_path), "glass")


def test_angles_between_are_exact_where_they_are_small() -> None:
    first = np.array([[0.0, 0.0, 1.0]])
    for degrees in (0.0, 1e-3, 1.0, 90.0, 180.0):
        second = np.array([[np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees))]])
        assert angles(first, second)[0] == pytest.approx(degrees, rel=1e-5)
    assert np.isnan(angles(first, np.full((1, 3), np.nan)))[0]


def test_what_moved_and_what_changed(repository: ObjectRepository) -> None:
    publish(repository, tilted(0.0), depth())
    publish(repository, tilted(7.0, 0.5), depth(3.0), strength=2.0)
    found = compare(repository, "front", "v1", "v2")
    assert found.figures["pixels"] == 40 and found.unit == "mm"
    assert found.figures["mean angle"] == pytest.approx(3.5, abs=1e-3)
    assert found.figures["largest angle"] == pytest.approx(7.0, abs=1e-3)
    assert found.figures["moved beyond 5°"] == 0.5
    assert found.figures["depth, root mean square"] == 0.0, "a common offset of depth means nothing"
    assert found.changes == (("labels", "strength", 1.0, 2.0),)


def test_regions_that_differ_are_laid_over_each_other(repository: ObjectRepository) -> None:
    publish(repository, tilted(0.0), depth())
    publish(repository, tilted(0.0), depth(), region=REGION | {"x": 12, "y": 21})
    found = compare(repository, "front", "v1", "v2")
    assert found.angles.shape == (7, 10) and found.figures["pixels"] == 4 * 6
    assert np.isfinite(found.angles[2:6, 2:8]).all()
    assert ("survey", "input frames", "digest of 10", "digest of 12") in found.changes


def test_values_of_the_entry_that_a_person_has_edited_have_changed(repository: ObjectRepository) -> None:
    entries: list[dict[str, Any]] = [
        {"id": "front", "frames": "a.mp4", "spheres": [{"x": 1.0, "y": 2.0, "radius": 9.0}]},
        {"id": "front", "frames": "b.mp4", "spheres": [{"x": 3.0, "y": 2.0, "radius": 9.0}], "pixel_size": 0.5},
    ]
    for degrees, entry in zip((0.0, 1.0), entries, strict=True):
        publish(repository, tilted(degrees), depth(), entry=entry)
    assert compare(repository, "front", "v1", "v2").changes == (
        (ENTRY, "spheres", entries[0]["spheres"], entries[1]["spheres"]),
        (ENTRY, "pixel_size", None, 0.5),
    )
    assert set(ENTRY_KEYS) == {key for stage in STAGES for key in stage.catalogue_keys}


def test_versions_without_a_common_pixel_have_no_figures(repository: ObjectRepository) -> None:
    publish(repository, tilted(0.0), depth())
    publish(repository, tilted(0.0), depth(), region=REGION | {"x": 200})
    figures = compare(repository, "front", "v1", "v2").figures
    assert figures.pop("pixels") == 0 and set(figures.values()) == {None}
    assert [change.degrees for change in drifts(repository, "v1", "v2", 90.0)] == [180.0]


def test_a_surface_has_moved_when_a_twentieth_of_it_has(repository: ObjectRepository) -> None:
    publish(repository, tilted(0.0), depth())
    publish(repository, tilted(6.0, 1 / 8), depth())
    (moved,) = drifts(repository, "v1", "v2", 5.0)
    assert moved.degrees == pytest.approx(6.0, abs=1e-3) and (moved.before, moved.after) == ("v1", "v2")
    assert "glass/front" in str(moved) and "6.0 degrees" in str(moved)
    assert drifts(repository, "v1", "v2", 6.5) == []
    normals = tilted(0.0)
    normals[1, 0] = 1.0, 0.0, 0.0
    publish(repository, normals, depth())
    assert drifts(repository, "v1", "v3", 1.0) == [], "one pixel of 40 is no drift"


def test_captures_that_only_one_version_has(repository: ObjectRepository) -> None:
    publish(repository, tilted(0.0), depth())
    publish(repository, tilted(0.0), depth(), capture="back")
    assert captures_of_both(repository, "v1", "v2") == (["front"], [], ["back"])
    assert drifts(repository, "v1", "v2", 0.0) == []
    with pytest.raises(StoreError, match="no version 'v7'"):
        captures_of_both(repository, "v1", "v7")
