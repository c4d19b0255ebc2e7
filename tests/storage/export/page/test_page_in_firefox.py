"""The exported page opened from disk in Firefox: it draws what it draws in Chromium, and asks for nothing."""

import base64
from pathlib import Path

import cv2
import numpy as np
import pytest

from glint import reading
from glint.storage.export.export import export_page
from glint.storage.versions.repository import ObjectRepository
from glint.tasks.algorithms.meshing.shading import relit
from tests import firefox
from tests.glint.sample_store import save_sphere
from tests.pictures import decode_picture
from tests.polling import until
from tests.storage.stores import local_store

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(firefox.program() is None, reason="Firefox is not installed (Debian: firefox-esr xvfb)"),
]


def test_the_page_relights_and_turns_the_mesh(tmp_path: Path) -> None:
    location = local_store(tmp_path / "store")
    repository = ObjectRepository.open(location, "cup")
    save_sphere(repository)
    repository.publish(["front"], {"run": "r", "catalogue": "c"})
    export_page(location, "cup", tmp_path)
    file = tmp_path / "cup.html"
    with firefox.Firefox() as running:
        running.open(file.as_uri())
        until(lambda: running.evaluate("Boolean(globalThis.glint)"))
        assert running.evaluate("glint.ready.then(() => glint.viewer.hasFailed)") is False
        code = """(() => { const view = glint.viewer.surface.relight; glint.viewer.surface.setMaterial("matte");
          view.set({ light: [0.6, 0, 0.8] }); let text = "";
          for (const octet of view.pixels()) text += String.fromCharCode(octet);
          return btoa(text); })()"""
        capture = reading.open(location.uri)["cup"].latest["front"]
        pixels = np.frombuffer(base64.b64decode(running.evaluate(code)), np.uint8).reshape(*capture.mask.shape, 4)
        expected = relit(capture.normals, capture.mask, (0.6, 0.0, 0.8))
        assert expected.max() > 200 and np.abs(pixels[..., 0].astype(int) - expected).max() <= 1
        assert running.evaluate("glint.viewer.show('mesh').then(() => glint.viewer.hasFailed)") is False
        picture = decode_picture(running.picture(), cv2.IMREAD_COLOR)
        assert picture.std() > 10.0
        assert [url for url in running.requested() if not url.startswith(("data:", "blob:", file.as_uri()))] == []
        assert running.complaints() == []
