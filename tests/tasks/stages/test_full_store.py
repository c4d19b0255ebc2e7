"""Stores that fill up, stay read-only or refuse large files: told as such, and what was acknowledged is kept."""

import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from glint.storage.errors import StoreError
from glint.tasks.engine.stage import perform, stage_keys
from glint.tasks.pipeline import STAGES
from tests.scene import Scene, draw_scene
from tests.tasks.make_context import make_context, perform_all
from tests.tasks.smooth_labels import smooth_labels

pytestmark = pytest.mark.usefixtures("smooth_labels")
ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return draw_scene(tmp_path_factory.mktemp("scene"), frames=300)


@pytest.fixture(scope="module")
def needed(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> int:
    """Kilobytes of a whole store of the scene."""
    folder = tmp_path_factory.mktemp("whole")
    with smooth_labels():
        perform_all(make_context(scene.catalogue, folder / "store"))
    return int(subprocess.run(["du", "-sk", folder], capture_output=True, text=True, check=True).stdout.split()[0])


@pytest.fixture
def small(tmp_path: Path) -> Iterator[Path]:
    """An empty file system of a few pages, to be given a size by `mount`."""
    place = tmp_path / "small"
    place.mkdir()
    made = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", str(place)], capture_output=True)
    if made.returncode != 0:
        pytest.skip("needs the right to mount a small file system")
    yield place
    subprocess.run(["umount", "-l", str(place)], check=False)


def remount(place: Path, options: str) -> None:
    subprocess.run(["mount", "-o", f"remount,{options}", str(place)], check=True)


@pytest.mark.parametrize("share", [0.1, 0.6, 0.75, 0.85])
def test_disk_that_fills_up(scene: Scene, needed: int, small: Path, share: float) -> None:
    """Wherever the room ends, the stages before it are kept, and the run goes on from there when there is room."""
    remount(small, f"size={int(share * needed)}k")
    work = make_context(scene.catalogue, small / "store")
    keys, done = stage_keys(work, STAGES), []
    with pytest.raises(StoreError, match="No space left") as caught:
        for stage in STAGES:
            perform(work, stage, keys[stage.name])
            done.append(stage.name)
    assert "free space" in caught.value.remedy and str(small) in str(caught.value)
    remount(small, "size=100m")
    records = perform_all(make_context(scene.catalogue, small / "store"))
    assert [record.stage for record in records if record.cached] == done


def test_read_only_store(scene: Scene, small: Path) -> None:
    remount(small, "ro")
    with pytest.raises(StoreError) as caught:
        perform_all(make_context(scene.catalogue, small / "store"))
    assert "Read-only" in str(caught.value) and str(small) in str(caught.value)


def test_files_that_may_not_grow(scene: Scene, tmp_path: Path) -> None:
    """A limit on the size of files, as quotas set it; needs no rights."""
    script = (
        "import sys\nfrom pathlib import Path\nfrom tests.tasks.make_context import make_context, perform_all\n"
        "from glint.storage.errors import StoreError\n"
        f"work = make_context(Path({str(scene.catalogue)!r}), Path({str(tmp_path / 'store')!r}))\n"
        "try:\n    perform_all(work)\nexcept StoreError as error:\n    sys.exit(f'{error.message}: {error.remedy}')\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", script],
        cwd=ROOT,
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000)),
    )
    assert ended.returncode == 1 and "File too large" in ended.stderr and str(tmp_path / "store") in ended.stderr
    assert "Traceback" not in ended.stderr
