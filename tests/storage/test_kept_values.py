"""Values kept beside an object: read as they were written, or taken for absent."""

import json
from pathlib import Path

from glint.storage.kept_values import KEPT_FOLDER, keep, read_kept
from glint.storage.locations.location import Location

KEY = "0123abcd"


def test_a_value_is_read_under_its_key_alone(tmp_path: Path) -> None:
    location = Location.parse(tmp_path)
    value = [{"frame": 3, "wrong": 0.25, "rows": [1, 2]}]
    assert read_kept(location, "glass", KEY) is None
    keep(location, "glass", KEY, value)
    assert read_kept(location, "glass", KEY) == value
    assert read_kept(location, "glass", KEY[::-1]) is None and read_kept(location, "cup", KEY) is None


def test_what_is_not_whole_or_of_another_key_counts_as_absent(tmp_path: Path) -> None:
    location = Location.parse(tmp_path)
    keep(location, "glass", KEY, {"wrong": 0.25})
    folder = tmp_path / "objects" / "glass" / KEPT_FOLDER
    whole = (folder / f"{KEY}.json").read_bytes()
    (folder / "ffff.json").write_bytes(whole)
    assert read_kept(location, "glass", "ffff") is None
    changed = json.loads(whole) | {"value": {"wrong": 0.75}}
    for damaged in (whole[:-9], whole.replace(b"0.25", b"0.75"), json.dumps(changed).encode(), b"[]", b"\xff", b""):
        (folder / f"{KEY}.json").write_bytes(damaged)
        assert read_kept(location, "glass", KEY) is None
