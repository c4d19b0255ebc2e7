"""A store to export from."""

from pathlib import Path

import pytest

from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from tests.storage.stores import local_store, save_capture


@pytest.fixture
def location(tmp_path: Path) -> Location:
    """A store that holds a version of one capture, duck/front."""
    location = local_store(tmp_path / "store")
    repository = ObjectRepository.open(location, "duck")
    save_capture(repository, "front", "k1")
    repository.publish(["front"], {})
    return location
