"""Nothing damaged is served: a seeded share of the trials of `tests.damage.damage`, which runs more of them."""

from pathlib import Path

import pytest

from tests.damage.damage import build, run


@pytest.mark.timeout(600)
def test_nothing_damaged_is_served(tmp_path: Path) -> None:
    outcome = run(build(tmp_path), 20, 7, tmp_path / "exports")
    assert outcome["wrong"] == []
    noticed = sum(count for name, count in outcome["outcomes"].items() if name.endswith("error"))
    assert noticed > 5, outcome["outcomes"]


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_nothing_of_a_thousand_damages_is_served(tmp_path: Path) -> None:
    assert run(build(tmp_path), 1200, 0, tmp_path / "exports")["wrong"] == []
