"""After a restore every view shows the restored version: its verdict, its warnings, its spheres, its mask."""

from pathlib import Path

import numpy as np
import pytest

from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from tests.flows.review.conftest import ServedPage, Tab
from tests.flows.review.inputs_view import INPUTS, READY, asked, settle

pytestmark = pytest.mark.long
WARNING = {"message": "the sphere lies elsewhere: correct it", "cause": "sphere", "cost_deg": 20.0}


def publish_worse(store: Path) -> None:
    """Publish a version with a warning of its survey, and with half the mask."""
    repository = ObjectRepository.open(Location.parse(store), "hemisphere", create=False)
    survey, mask = (repository.load("front", stage) for stage in ("survey", "mask"))
    halved = {name: mask.read(name) for name in mask.arrays}
    halved["mask"] = halved["mask"] & (np.arange(halved["mask"].shape[1]) < halved["mask"].shape[1] // 2)
    repository.save("front", "survey", "other", {}, survey.record | {"warnings": [WARNING]})
    repository.save("front", "mask", "other", halved, mask.record)
    assert repository.publish(["front"], {}).name == "v2"


def test_a_restored_version_is_what_all_views_show(served: ServedPage, tab: Tab) -> None:
    before = asked(served, "inputs")
    page = tab.open(INPUTS, READY)
    page.wait_for_selector("section[data-pixels]")
    verdict, pixels = page.inner_text("aside h2 >> nth=0"), page.get_attribute("section[data-pixels]", "data-pixels")
    publish_worse(served.store)
    tab.open("#/", ".row .state.doubtful")
    page = tab.open(INPUTS, READY)
    assert page.inner_text("aside h2 >> nth=0") != verdict
    tab.open(INPUTS.replace("inputs", "versions"), ".versions .divider")
    page.once("dialog", lambda dialog: dialog.accept())
    page.click("tr:has-text('v1') button:has-text('Restore')")
    tab.wait("document.getElementById('status').textContent === 'v3 has the content of v1'")
    page = tab.open(INPUTS, READY)
    page.wait_for_selector("section[data-pixels]")
    assert page.inner_text("aside h2 >> nth=0") == verdict
    tab.wait(f"document.querySelector('section[data-pixels]').dataset.pixels === '{pixels}'")
    after = asked(served, "inputs")
    assert after == before, "lights, spheres and warnings are the restored version's, too"
    settle(tab)
