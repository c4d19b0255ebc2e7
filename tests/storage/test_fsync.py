"""Files forced onto the disk: which ones, and what happens if one cannot be."""

import os
from pathlib import Path

import pytest

from glint.storage.fsync import CLOCK_LAG_SECONDS, flush_tree


@pytest.fixture
def flushed(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Paths that are flushed."""
    paths: list[Path] = []
    monkeypatch.setattr("glint.storage.fsync.flush", paths.append)
    return paths


def test_only_what_was_written_since_is_flushed(tmp_path: Path, flushed: list[Path]) -> None:
    for name in ("old", "new"):
        (tmp_path / name).mkdir()
        for number in range(20):
            (tmp_path / name / str(number)).touch()
    for path in (*(tmp_path / "old").iterdir(), tmp_path / "old"):
        os.utime(path, (1000.0, 1000.0))
    flush_tree(tmp_path, 2000.0)
    assert sorted(flushed) == sorted([tmp_path, tmp_path / "new", *(tmp_path / "new").iterdir()])


def test_times_of_files_may_lag_behind_the_clock(tmp_path: Path, flushed: list[Path]) -> None:
    (tmp_path / "file").touch()
    for path in (tmp_path / "file", tmp_path):
        os.utime(path, (1000.0, 1000.0))
    flush_tree(tmp_path, 1000.0 + 0.5 * CLOCK_LAG_SECONDS)
    assert sorted(flushed) == [tmp_path, tmp_path / "file"]


def test_a_file_that_cannot_be_flushed_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(handle: int) -> None:
        raise OSError(28, "No space left on device")

    (tmp_path / "file").touch()
    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match="No space left"):
        flush_tree(tmp_path, 0.0)
