"""A folder that is replaced is lost only when all that belongs to its replacement has succeeded."""

from pathlib import Path

import pytest

from glint.storage.replacement import replaced


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


def test_what_a_killed_process_has_left_aside_does_not_keep_a_folder_from_being_replaced(tmp_path: Path) -> None:
    folder = filled(tmp_path / "object", "earlier")
    filled(tmp_path / ".object-earlier", "older")
    with replaced(folder, filled(tmp_path / "new", "new")):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["object"]
