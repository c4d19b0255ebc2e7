"""Damaged edits are told where they are needed; what does not need them is shown all the same."""

import numpy as np
import pytest

from glint.storage.edits.edits import Edits
from glint.storage.edits.models import Changes
from glint.storage.locations.location import Location
from tests.flows.review.conftest import ServedPage, Tab
from tests.flows.review.inputs_view import INPUTS, asked, settle
from tests.storage.edits.sample_edits import damage_a_chunk

pytestmark = pytest.mark.long
DAMAGE, REMEDY = "hemisphere/front/edits in edit 1 is damaged", "`glint edits hemisphere/front --discard`"


def test_damaged_edits_are_told_in_their_place(served: ServedPage, tab: Tab) -> None:
    width, height = asked(served, "inputs")["frame_size"]
    noise = np.random.default_rng(0).random((height, width)) < 0.5
    edits = Edits.open(Location.parse(served.store), "hemisphere")
    edits.save("front", Changes(mask=noise), "Ann", 0)
    damage_a_chunk(served.store / "objects/hemisphere", 1_000)
    page = tab.open(INPUTS, ".problem")
    assert DAMAGE in page.inner_text(".problem") and REMEDY in page.inner_text(".problem")
    tab.open(INPUTS.replace("inputs", "poses"), ".plan .camera")
    assert DAMAGE in page.inner_text("aside td .doubt") and page.is_disabled("[aria-label='Pose of front']")
    page.click("text=Evenly, as they are listed")
    assert page.input_value("[aria-label='Pose of front']") == ""
    tab.open(INPUTS.replace("inputs", "versions"), ".versions .divider")
    assert DAMAGE in page.inner_text(".versions .side .doubt")
    edits.discard("front", "Bob")
    tab.open(INPUTS, ".stage[data-shown]")
    settle(tab)
    tab.complaints[:] = [text for text in tab.complaints if "422" not in text]
