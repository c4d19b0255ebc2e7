"""A catalogue, its inputs and its store in object storage: run, resumed, exported, rolled back by the command line."""

import json
import os
import subprocess
import sys
from pathlib import Path
from uuid import uuid4

import numpy as np
import obstore
import pytest

from glint.storage.locations.credentials import azure_options
from glint.storage.locations.location import Location
from tests.flows.conftest import glint_home, server
from tests.scene import draw_scene
from tests.storage.locations.lax_server import lax_server

__all__ = ["glint_home", "server"]

pytestmark = [pytest.mark.slow, pytest.mark.server, pytest.mark.usefixtures("server"), pytest.mark.timeout(900)]

ROOT = Path(__file__).parents[2]


def glint(*arguments: str, status: int = 0) -> str:
    """What a command says on both outputs."""
    command = [sys.executable, "-c", "from glint.flows.cli.main import main; main()", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout + done.stderr


def lines(text: str) -> list[dict[str, object]]:
    return [json.loads(line) for line in text.splitlines() if line.startswith("{")]


@pytest.fixture(params=["s3", "azure"])
def place(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Location:
    """A prefix of its own on a running server, credentials in the environment."""
    for name, value in request.getfixturevalue(request.param).environment.items():
        monkeypatch.setenv(name, value)
    return Location.parse(f"{'az' if request.param == 'azure' else 's3'}://store/{uuid4().hex}")


def test_everything_in_object_storage(place: Location, tmp_path: Path, glint_home: Path) -> None:
    scene = draw_scene(tmp_path / "scene", frames=200)
    inputs, store = place.child("in").obstore(), place.child("store")
    for path in sorted(scene.catalogue.parent.rglob("*")):
        if path.is_file():
            obstore.put(inputs, path.relative_to(scene.catalogue.parent).as_posix(), path.read_bytes())
    catalogue, uri = place.child("in", "catalogue.yaml").uri, store.uri
    output = glint("check", catalogue, "--store", uri, "--out", str(tmp_path / "check"))
    output += glint("run", catalogue, "--store", uri, "--workers", "1")
    output += glint("export", "ellipsoid", "--out", str(tmp_path / "out"), "--store", uri)
    normals = np.load(tmp_path / "out" / "front" / "normals.npy")
    cosine = np.sum(normals * scene.normals, axis=-1)[scene.mask]
    assert np.degrees(np.nanmedian(np.arccos(np.clip(cosine, -1, 1)))) < 5.0
    for name in ("surface.ply", "surface.glb", "report.html", "confidence.npy"):
        assert (tmp_path / "out" / "front" / name).stat().st_size > 0
    assert len(list(store.child("frames").obstore().list())) > 0

    again = glint("run", catalogue, "--store", uri, "--workers", "1", "--json")
    summary = lines(again)[-1]
    assert "up to date" in json.dumps(summary) or '"cached": true' in again
    (version,) = lines(glint("history", "ellipsoid", "--store", uri, "--json"))
    assert version["version"] == "v1"
    text = bytes(obstore.get(inputs, "catalogue.yaml").bytes())
    obstore.put(inputs, "catalogue.yaml", text + b"parameters: {labels: {strength: 3.0}}\n")
    output += again + glint("run", catalogue, "--store", uri, "--workers", "1")
    output += glint("rollback", "ellipsoid", "v1", "--store", uri) + glint("status", "--store", uri)
    assert [version["version"] for version in lines(glint("history", "ellipsoid", "--store", uri, "--json"))] == [
        "v1",
        "v2",
        "v3",
    ]
    output += glint("maintain", "--store", uri, "--older-than", "0")
    output += glint("export", "ellipsoid", "--out", str(tmp_path / "out"), "--store", uri)
    np.testing.assert_array_equal(np.load(tmp_path / "out" / "front" / "normals.npy"), normals)
    _check_secrets_are_hidden(place, output, [tmp_path / "out", glint_home])


def _check_secrets_are_hidden(place: Location, output: str, folders: list[Path]) -> None:
    """No secret in the store, in files, in Prefect's database, in the output."""
    secret = os.environ.get("AWS_SECRET_ACCESS_KEY") if place.scheme == "s3" else azure_options().key
    assert secret and len(secret) > 20 and secret not in output
    store = place.obstore()
    for meta in [meta for batch in obstore.list(store) for meta in batch]:
        assert secret.encode() not in bytes(obstore.get(store, meta["path"]).bytes()), meta["path"]
    files = [path for folder in folders for path in folder.rglob("*") if path.is_file()]
    assert any(path.name == "prefect.db" for path in files)
    for path in files:
        assert secret.encode() not in path.read_bytes(), path


def test_a_run_refuses_a_store_that_ignores_conditions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = draw_scene(tmp_path, frames=60)
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "any")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "any")
    with lax_server() as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", server.url)
        output = glint("run", str(scene.catalogue), "--store", "s3://store/here", status=2)
    assert "should only create" in output and "conditional writes" in output and "Traceback" not in output
