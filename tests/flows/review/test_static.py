"""What runs in the browser: nothing from elsewhere, no markup from data, parts of others with their licences."""

import json
import re
from pathlib import Path

import pytest

from glint.flows.review.app import STATIC

OWN = [path for path in sorted(STATIC.rglob("*")) if path.is_file() and "vendor" not in path.parts]
VENDOR = STATIC / "vendor"


@pytest.mark.parametrize("path", OWN, ids=[path.name for path in OWN])
def test_own_files_name_no_other_host_and_make_no_markup_of_text(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    addresses = set(re.findall(r"(?:https?:)?//[a-z0-9-]+(?:\.[a-z0-9-]+)+", text))
    assert addresses <= {"http://www.w3.org"}
    assert not re.search(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function", text)
    assert not re.search(r"<script(?![^>]*\bsrc=)|\son[a-z]+=[\"']|style=[\"']", text)


def test_parts_of_others_are_those_that_are_pinned_with_their_licences() -> None:
    pinned = json.loads((VENDOR / "versions.json").read_text())
    folders = {f"{name.removeprefix('@').replace('/', '-')}-{part['version']}" for name, part in pinned.items()}
    assert folders == {path.name for path in VENDOR.iterdir() if path.is_dir()}
    for folder in folders:
        assert any("LICENSE" in path.name for path in (VENDOR / folder).iterdir()), folder
