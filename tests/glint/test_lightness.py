"""`import glint` costs nothing, and reading needs the base dependencies alone."""

import json
import re
import subprocess
import sys
import tomllib
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HEAVY = {"prefect", "dask", "distributed", "cv2", "open3d", "numba", "scipy", "pydantic", "trimesh", "jinja2"}
BASE = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]

READ_ALL = """
capture = glint.open(sys.argv[1])["wine-glass"].latest["phone"]
version = glint.open(sys.argv[1])["wine-glass"].latest
for name in dir(type(capture)):
    if not name.startswith("_"):
        getattr(capture, name)
capture.point_cloud().in_frame("ros_optical")
version.model, version.metadata, repr(version), repr(capture)
"""


def run(code: str, *arguments: str) -> list[str]:
    """Run Python code in a process of its own; the words that it printed."""
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def distribution_names(requirement: str) -> str:
    return re.sub(r"[-_.]+", "-", re.split(r"[^A-Za-z0-9._-]", requirement)[0]).lower()


def closure(requirements: list[str]) -> set[str]:
    """Names of all distributions that installing these would install, extras left out."""
    found, waiting = set[str](), [distribution_names(requirement) for requirement in requirements]
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        try:
            needed = requires(name) or []
        except PackageNotFoundError:
            continue  # for another platform
        found.add(name)
        waiting += [distribution_names(requirement) for requirement in needed if "extra ==" not in requirement]
    return found


def test_importing_glint_imports_nothing() -> None:
    code = "import sys, typing; before = set(sys.modules); import glint; print(*sorted(set(sys.modules) - before))"
    assert run(code) == ["glint"]


@pytest.mark.long
def test_the_public_names_exist() -> None:
    code = (
        "import glint; print(*[name for name in glint.__all__ if not hasattr(glint, name) or name not in dir(glint)])"
    )
    assert run(code) == []


@pytest.mark.long
def test_reading_imports_nothing_heavy(store: Path) -> None:
    code = f"import sys, glint\n{READ_ALL}\nprint(*sorted({HEAVY!r} & {{name.split('.')[0] for name in sys.modules}}))"
    assert run(code, str(store)) == []


@pytest.mark.long
def test_the_base_dependencies_suffice_to_read(store: Path) -> None:
    """Every distribution that the base dependencies would not install is hidden from the process."""
    allowed = closure(BASE)
    assert {"numpy", "zarr", "icechunk", "obstore"} <= allowed and not HEAVY & allowed
    hidden = sorted(
        module
        for module, owners in packages_distributions().items()
        if module != "glint" and not {distribution_names(owner) for owner in owners} & allowed
    )
    assert {"cv2", "pydantic", "prefect"} <= set(hidden)
    hide = "import json, sys\nfor name in json.loads(sys.argv[2]):\n    sys.modules[name] = None\n"
    code = f"{hide}import glint\n{READ_ALL}"
    assert run(code, str(store), json.dumps(hidden)) == []


def test_what_needs_the_pipeline_says_how_to_install_it() -> None:
    code = """
import importlib.metadata, sys
def missing(name):
    raise importlib.metadata.PackageNotFoundError(name)
importlib.metadata.distribution = missing
for name in ("prefect", "dask", "pydantic", "ruamel", "typer", "click"):
    sys.modules[name] = None
import glint
for call in (lambda: glint.catalogue("x.yaml"), lambda: glint.run("x.yaml", store="y")):
    try:
        call()
    except ImportError as error:
        print("glint[pipeline]" in str(error))
sys.argv = ["glint", "status"]
from glint.__main__ import run_command
try:
    run_command()
except SystemExit as end:
    print(end.code)
"""
    assert run(code) == ["True", "True", "2"]
