"""Fixtures of the reading interface's tests."""

from pathlib import Path

import pytest

from tests.glint.sample_store import make_store


@pytest.fixture(scope="session")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder `glint-store` with the object `wine-glass`: see make_store."""
    return make_store(tmp_path_factory.mktemp("reading") / "glint-store")
