"""A simulated object that is simulated again."""

from pathlib import Path

import pytest

from glint.storage.catalogue.loading import CatalogueError, load
from glint.tasks.simulation.simulate import CaptureOptions, simulate


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_an_object_stays_until_the_one_that_replaces_it_is_in_the_catalogue(tmp_path: Path) -> None:
    small = CaptureOptions(frames=2, scale=0.1, sphere_radius=20.0, rays=1)
    simulate("hemisphere", tmp_path, small)
    whole = (tmp_path / "catalogue.yaml").read_text()
    (tmp_path / "catalogue.yaml").write_text("objects: {")
    before = contents(tmp_path)
    with pytest.raises(CatalogueError):
        simulate("hemisphere", tmp_path, CaptureOptions(frames=3, scale=0.12, sphere_radius=20.0, rays=1))
    assert contents(tmp_path) == before
    (tmp_path / "catalogue.yaml").write_text(whole)
    record = simulate("hemisphere", tmp_path, CaptureOptions(frames=3, scale=0.12, sphere_radius=20.0, rays=1))
    assert [entry.id for entry in load(record.catalogue).objects] == ["hemisphere"]
    assert {name.split("/")[0] for name in contents(tmp_path)} == {"catalogue.yaml", "hemisphere"}


def test_the_object_that_a_killed_simulation_was_replacing_comes_back(tmp_path: Path) -> None:
    small = CaptureOptions(frames=2, scale=0.1, sphere_radius=20.0, rays=1)
    simulate("hemisphere", tmp_path, small)
    before = contents(tmp_path)
    (tmp_path / "hemisphere").rename(tmp_path / ".hemisphere-earlier")

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate("hemisphere", tmp_path, small, interrupt)
    assert contents(tmp_path) == before
