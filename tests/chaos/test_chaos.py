"""A short game of chaos; `python -m tests.chaos.chaos --kills 50` plays the long one."""

import random
from pathlib import Path

import pytest

from tests.chaos.chaos import Chaos

pytestmark = [pytest.mark.slow, pytest.mark.server, pytest.mark.timeout(1800)]


def test_nothing_is_lost_by_five_kills(tmp_path: Path) -> None:
    chaos = Chaos(tmp_path, random.Random(5), objects=2, captures=2, frames=80)
    try:
        played = chaos.play(5)
    finally:
        chaos.end()
    assert sum(played["kills"].values()) == 5 and played["versions"] >= 2
