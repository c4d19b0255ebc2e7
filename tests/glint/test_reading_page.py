"""The examples of docs/reading.md run."""

import re
from pathlib import Path
from typing import Any

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "reading.md"
EXAMPLES = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def test_examples_run_one_after_the_other(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(store.parent)
    names: dict[str, Any] = {}
    assert len(EXAMPLES) >= 5
    for example in EXAMPLES:
        exec(compile(example, str(PAGE), "exec"), names)


def test_every_property_is_explained() -> None:
    from glint import StoredCapture

    text = PAGE.read_text(encoding="utf-8")
    public = {name for name in dir(StoredCapture) if not name.startswith("_")} - {"id"}
    assert {name for name in public if f"`{name}" not in text and f".{name}" not in text} == set()
