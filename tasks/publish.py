"""An object's newest results as a version that tells everything needed to repeat it."""

import platform
import subprocess
from collections.abc import Mapping, Sequence
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from glint.storage.versions.repository import Version
from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.tasks.engine.capture_context import INPUTS, Workspace
from glint.tasks.pipeline import NAMES, SCHEMAS

PACKAGES = (
    "numpy", "scipy", "numba", "opencv-python-headless", "PyMaxflow", "open3d-cpu", "trimesh", "av", "zarr",
    "icechunk", "dask", "prefect",
)  # fmt: skip
"""Packages whose version may change a result, or how it is stored."""

ROOT = Path(__file__).parents[1]


def publish(works: Sequence[Workspace], run: str, catalogue: str, model: bool | None = None) -> Version:
    """Make what these captures of one object have computed a version, if it differs from the newest one.

    run: the flow run that computed it; catalogue: its address; model: whether the object's model is part of it, None:
    as before.
    Raises:
        StoreError: a result is missing or damaged, or the store cannot be written.
    """
    metadata = {
        "run": run,
        "catalogue": catalogue,
        **code_facts(),
        "stages": NAMES,
        "captures": {work.capture.id: said_of(work) for work in works},
    }
    names = [work.capture.id for work in works] + [WHOLE_OBJECT] * (model is True)
    retired = [WHOLE_OBJECT] if model is False else []
    return works[0].repository.publish(names, metadata, NAMES, message=f"run {run}", retire=retired, schemas=SCHEMAS)


def said_of(work: Workspace) -> dict[str, Any]:
    """Of a capture: the catalogue's entry, all parameters, and the digests of its inputs."""
    return {
        "entry": work.capture.model_dump(mode="json", exclude_none=True, exclude_defaults=True),
        "parameters": work.parameters.model_dump(mode="json"),
        "inputs": {name: digest for name in INPUTS if (digest := work.digest(name))},
    }


@cache
def code_facts() -> Mapping[str, Any]:
    """What computes here: Glint's version, the digest of its sources, their revision, Python, packages, machine."""
    return {
        "glint": version("glint"),
        "source": _source_digest(),
        "revision": _revision(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        "packages": {name: found for name in PACKAGES if (found := _version(name))},
    }


def _source_digest() -> str:
    """SHA-256 (hex) of the sources' names and bytes."""
    digest = sha256()
    for folder in ("flows", "storage", "tasks"):
        for file in sorted((ROOT / folder).rglob("*.py")):
            digest.update(f"{file.relative_to(ROOT).as_posix()}\0".encode() + file.read_bytes() + b"\0")
    return digest.hexdigest()


def _revision() -> str:
    """The checkout's commit, `-dirty` where files differ from it; empty where Glint was installed."""
    if not (ROOT / ".git").exists():
        return ""
    command = ["git", "-C", str(ROOT), "describe", "--always", "--dirty", "--abbrev=12"]
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
