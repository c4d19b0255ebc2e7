"""Fixtures shared by all tests."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of shared captures and photographs; tests that read it are skipped where it is absent."""
    folder = Path(os.environ.get("GLINT_SHARED_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not (folder / "captures").is_dir():
        pytest.skip(f"no shared data at {folder} (set GLINT_SHARED_DATA)")
    return folder
