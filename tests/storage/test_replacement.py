"""A folder that is replaced is lost only when all that belongs to its replacement has succeeded."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from glint.storage.replacement import replaced, restore_earlier


def filled(folder: Path, text: str) -> Path:
    folder.mkdir()
    (folder / "file").write_text(text)
    return folder


def test_a_folder_is_replaced(tmp_path: Path) -> None:
    folder, new = filled(tmp_path / "object", "earlier"), filled(tmp_path / "new", "new")
    with replaced(folder, new):
        assert (folder / "file").read_text() == "new"
    assert (folder / "file").read_text() == "new"
    assert [path.name for path in tmp_path.iterdir()] == ["object"]


def test_a_folder_that_does_not_exist_is_made(tmp_path: Path) -> None:
    with replaced(tmp_path / "object", filled(tmp_path / "new", "new")):
        pass
    assert (tmp_path / "object" / "file").read_text() == "new"


def test_the_earlier_folder_comes_back_where_the_new_one_cannot_be_moved(tmp_path: Path) -> None:
    folder = filled(tmp_path / "object", "earlier")
    with pytest.raises(FileNotFoundError), replaced(folder, tmp_path / "absent"):
        pass
    assert (folder / "file").read_text() == "earlier"


@pytest.mark.parametrize("has_earlier", [True, False])
def test_the_earlier_state_comes_back_where_what_follows_fails(tmp_path: Path, has_earlier: bool) -> None:
    folder, new = tmp_path / "object", filled(tmp_path / "new", "new")
    if has_earlier:
        filled(folder, "earlier")
    with pytest.raises(KeyboardInterrupt), replaced(folder, new):
        raise KeyboardInterrupt
    assert folder.exists() == has_earlier
    assert not has_earlier or (folder / "file").read_text() == "earlier"


KILLED = f"""
import os, pathlib
from glint.storage.replacement import replaced
def kill(*_): os.kill(os.getpid(), {signal.SIGKILL:d})
folder, new, point = (pathlib.Path(name) for name in ("object", "new", os.environ["POINT"]))
rename, renames = pathlib.Path.rename, []
def counted(source, target):
    if str(point) == f"rename-{{len(renames)}}": kill()
    renames.append(source)
    return rename(source, target)
pathlib.Path.rename = counted
with replaced(folder, new):
    if str(point) == "block": kill()
kill()
"""
"""A process that is killed before its n-th rename, in the context, or at its end."""


@pytest.mark.parametrize(
    ("point", "content"),
    [("rename-0", "earlier"), ("rename-1", "earlier"), ("block", "earlier"), ("rename-2", "earlier"), ("end", "new")],
)
def test_a_killed_process_leaves_one_of_the_two(tmp_path: Path, point: str, content: str) -> None:
    folder = filled(tmp_path / "object", "earlier")
    filled(tmp_path / "new", "new")
    done = subprocess.run([sys.executable, "-c", KILLED], cwd=tmp_path, env=os.environ | {"POINT": point}, check=False)
    assert done.returncode == -signal.SIGKILL
    assert restore_earlier(folder) == (point in ("rename-1", "block", "rename-2"))
    assert (folder / "file").read_text() == content
    assert {path.name for path in tmp_path.iterdir()} <= {"object", "new"}
    assert not restore_earlier(folder)


def test_what_a_killed_process_has_left_comes_back_where_the_next_replacement_fails(tmp_path: Path) -> None:
    filled(tmp_path / ".object-earlier", "earlier")
    with pytest.raises(KeyboardInterrupt), replaced(tmp_path / "object", filled(tmp_path / "new", "new")):
        raise KeyboardInterrupt
    assert (tmp_path / "object" / "file").read_text() == "earlier"
    with replaced(tmp_path / "object", tmp_path / "new"):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["object"]
