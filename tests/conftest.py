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


@pytest.fixture(scope="session")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A catalogue with one small simulated capture, `hemisphere/front` of 300 frames, with markup beside it."""
    from tasks.simulation import CaptureOptions, simulate

    folder = tmp_path_factory.mktemp("simulated")
    return simulate("hemisphere", folder, CaptureOptions(frames=300, scale=0.3, ball_radius=22.0)).catalogue
