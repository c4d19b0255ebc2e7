from pathlib import Path
from typing import Any

import obstore
import pytest

from glint.storage.errors import StoreError
from glint.storage.locations.conditional_writes import check_conditional_writes
from tests.storage.stores import MemoryLocation, local_store


def test_a_local_folder_passes_and_stays_clean(tmp_path: Path) -> None:
    check_conditional_writes(local_store(tmp_path / "store"))
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_store_with_conditional_writes_passes() -> None:
    place = MemoryLocation()
    check_conditional_writes(place)
    assert not list(obstore.list(place.store))


@pytest.mark.parametrize(("ignored", "message"), [("create", "should only create"), ("swap", "stale writer")])
def test_a_store_that_ignores_conditions_is_refused(
    monkeypatch: pytest.MonkeyPatch, ignored: str, message: str
) -> None:
    put = obstore.put

    def lax_put(store: Any, key: str, data: bytes, mode: Any = None, **options: Any) -> Any:
        is_lax = mode == "create" if ignored == "create" else isinstance(mode, dict)
        return put(store, key, data, mode=None if is_lax else mode, **options)

    monkeypatch.setattr(obstore, "put", lax_put)
    with pytest.raises(StoreError, match=message):
        check_conditional_writes(MemoryLocation())


def test_a_place_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="failed at"):
        check_conditional_writes(local_store(tmp_path / "file"))


def test_a_folder_without_the_right_to_write_is_named_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def denied(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied", str(tmp_path / "store"))

    monkeypatch.setattr(obstore, "put", denied)
    with pytest.raises(StoreError, match="Permission denied") as caught:
        check_conditional_writes(local_store(tmp_path / "store"))
    assert "the right to write" in caught.value.remedy


def test_a_folder_is_left_as_it_was(tmp_path: Path) -> None:
    check_conditional_writes(local_store(tmp_path))
    assert list(tmp_path.iterdir()) == []
