"""Provenance of the code: the digest of its sources, their revision, and the versions of packages that matter."""

import platform
import subprocess
from collections.abc import Mapping
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

PACKAGES = (
    "numpy", "scipy", "numba", "opencv-python-headless", "PyMaxflow", "open3d-cpu", "trimesh", "av", "zarr",
    "icechunk", "dask", "prefect",
)  # fmt: skip
"""Packages whose version may change a result, or how it is stored."""
GIT_TIMEOUT_S = 10
"""Seconds after which `git describe` is given up."""
PACKAGE = Path(__file__).parents[1]
"""Folder of the package glint, in a checkout and where it is installed."""


@cache
def code_provenance() -> Mapping[str, Any]:
    """Return what computes: Glint's version, the digest of its sources, their revision, Python, packages, machine."""
    return {
        "glint": version("glint"),
        "source": source_digest(),
        "revision": revision(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        "packages": {name: installed for name in PACKAGES if (installed := _version(name))},
    }


def source_digest() -> str:
    """Return the SHA-256 (hex) of the names and bytes of all sources: flows, storage, tasks, and glint itself.

    A checkout and an installed package of the same sources have the same digest.
    """
    digest = sha256()
    # In a checkout the three folders are links, which a search from the package's folder would not follow.
    files = [file for folder in ("flows", "storage", "tasks") for file in sorted((PACKAGE / folder).rglob("*.py"))]
    for file in [*files, *sorted(PACKAGE.glob("*.py"))]:
        digest.update(f"{file.relative_to(PACKAGE).as_posix()}\0".encode() + file.read_bytes() + b"\0")
    return digest.hexdigest()


def revision() -> str:
    """Return the checkout's commit, with `-dirty` if files differ from it; empty where Glint is installed."""
    checkout = PACKAGE.resolve().parent
    if not (checkout / ".git").exists():
        return ""
    command = ["git", "-C", str(checkout), "describe", "--always", "--dirty", "--abbrev=12"]
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=GIT_TIMEOUT_S).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""


def _version(package: str) -> str | None:
    """Return the version of an installed package, None if it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None
