"""A full disk at export: the output's, not the store's; nothing is left, and the store is untouched."""

import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from glint.storage.errors import OutputError
from glint.storage.export.formats import export_as
from glint.storage.locations.location import Location


@pytest.fixture(params=[4, 12, 24, 40])
def small_disk(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Path]:
    """A disk of some kilobytes."""
    place = tmp_path / "disk"
    place.mkdir()
    size = f"size={request.param}k"
    if os.geteuid() or subprocess.run(["mount", "-t", "tmpfs", "-o", size, "none", place], check=False).returncode:
        pytest.skip("mounting a small disk needs root")
    yield place
    subprocess.run(["umount", place], check=True)


def test_the_disk_of_the_output_is_named(location: Location, small_disk: Path) -> None:
    with pytest.raises(OutputError, match=r"the disk of .*/disk/out is full") as caught:
        export_as("files", location, "duck", small_disk / "out")
    assert "--out" in caught.value.remedy and "--store" not in caught.value.remedy
    assert list(small_disk.iterdir()) == []


def test_a_limit_on_the_size_of_files(location: Location, tmp_path: Path) -> None:
    """As `ulimit -f` sets it, for everybody."""
    code = "import signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\nfrom glint.flows.cli.main import main; main()"
    words = [sys.executable, "-c", code, "export", "duck", "--out", str(tmp_path / "out"), "--store", location.path]

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (600, 600))

    done = subprocess.run(
        words, capture_output=True, text=True, preexec_fn=limit, cwd=Path(__file__).parents[3], check=False
    )
    assert done.returncode == 2
    assert "the disk of" in done.stderr and "--out" in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written(location: Location) -> None:
    with pytest.raises(OutputError, match="exporting duck to /proc/out failed"):
        export_as("files", location, "duck", Path("/proc/out"))


def test_standard_output_may_be_full(location: Location) -> None:
    words = [sys.executable, "-m", "glint", "history", "duck", "--store", location.path]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2 and "No space left on device" in done.stderr and "Traceback" not in done.stderr
