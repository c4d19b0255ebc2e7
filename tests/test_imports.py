"""Imports run one way: flows -> tasks and storage; tasks -> storage and tasks.algorithms; those two import none."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LAYERS = ("glint.flows", "glint.tasks", "glint.tasks.algorithms", "glint.storage")
MAY_IMPORT = {
    "glint.flows": {"glint.flows", "glint.tasks", "glint.storage"},
    "glint.tasks": {"glint.tasks", "glint.tasks.algorithms", "glint.storage"},
    "glint.tasks.algorithms": {"glint.tasks.algorithms"},
    "glint.storage": {"glint.storage"},
}
ORDER = {
    "glint.flows": "cli review deployments pipeline object_captures reporting runtime results errors",
    "glint.storage": (
        "inbox submissions maintenance export edits kept_values versions locking frames inputs catalogue footage"
        " locations json_values seals replacement fsync errors"
    ),
    "glint.tasks": (
        "check review verdict memory up_to_date publish forked warm_up robustness evaluation simulation"
        " questions pipeline agreement model sphere_agreement stages figures engine version_diff code_provenance"
    ),
    "glint.tasks.algorithms": (
        "simulation evaluation registration multiview questions published labelling angular_bodies facets faces prisms"
        " frames mask_checks masks table vessels revolution sections silhouettes continuation prior sheets meshing"
        " candidates integration near_light sphere_checks lighting geometry errors"
    ),
}
"""The rooms of a layer in descending order: a room imports only those after it."""
CROWDED = {
    "flows/cli": "one module for each command",
    "flows/review": "one module for each view's interface",
    "storage/export": "one module for each format",
    "tasks/stages": "one module for each stage",
}
"""Folders of more than MAX_MODULES modules, and why."""
MAX_MODULES, MAX_LINES = 12, 250
LONG: dict[str, str] = {}
"""Modules of more than MAX_LINES lines, and why."""
NOT_IN_ALGORITHMS = {
    "prefect",
    "dask",
    "distributed",
    "zarr",
    "icechunk",
    "obstore",
    "pydantic",
    "typer",
    "rich",
    "fastapi",
}
NOT_IN_STORAGE = {"prefect", "dask", "distributed", "typer", "rich", "fastapi", "maxflow", "open3d"}
NOT_IN_FLOWS = {"numpy", "cv2"}
NOT_IN_TASKS = {"prefect", "dask", "distributed", "typer", "rich", "fastapi"}
SLOW = {
    "prefect",
    "distributed",
    "dask",
    "numpy",
    "cv2",
    "numba",
    "scipy",
    "zarr",
    "icechunk",
    "pydantic",
    "rich.progress",
}


def layer_of(name: str) -> str | None:
    """The layer of a dotted module name, None for what is not ours."""
    inside = [layer for layer in LAYERS if name == layer or name.startswith(layer + ".")]
    return max(inside, key=len) if inside else None


def modules() -> Iterator[tuple[str, Path]]:
    for folder in ("flows", "tasks", "storage"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            yield "glint." + ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"), path


def imported(tree: ast.AST, package: str) -> Iterator[str]:
    """Dotted names of everything a module imports, at any depth of the code; relative ones resolved."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[: len(package.split(".")) + 1 - node.level] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            yield source
            yield from (f"{source}.{alias.name}" for alias in node.names)


def violations(name: str, source: str, package: str) -> list[str]:
    layer = layer_of(name)
    assert layer is not None
    foreign = {
        "glint.tasks.algorithms": NOT_IN_ALGORITHMS,
        "glint.storage": NOT_IN_STORAGE,
        "glint.tasks": NOT_IN_TASKS,
        "glint.flows": NOT_IN_FLOWS,
    }.get(layer, set())
    found = []
    for target in imported(ast.parse(source), package):
        ours = layer_of(target)
        if (ours is not None and ours not in MAY_IMPORT[layer]) or target.split(".")[0] in foreign:
            found.append(f"{name} imports {target}")
    return found


@pytest.mark.parametrize(("name", "path"), list(modules()), ids=[name for name, _ in modules()])
def test_imports_run_one_way(name: str, path: Path) -> None:
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    assert violations(name, path.read_text(encoding="utf-8"), package) == []


def room_of(name: str) -> tuple[str, str] | None:
    """The layer and the room (sub-package or module) of a dotted name."""
    layer = layer_of(name)
    if layer is None or name == layer:
        return None
    return layer, name[len(layer) + 1 :].split(".")[0]


def climbs(name: str, source: str, package: str) -> list[str]:
    """Imports of a room that stands above the module's own."""
    home = room_of(name)
    found = []
    for target in imported(ast.parse(source), package):
        room = room_of(target)
        if home and room and home[0] == room[0] and home[1] != room[1]:
            rooms = ORDER[home[0]].split()
            if rooms.index(room[1]) < rooms.index(home[1]):
                found.append(f"{name} imports {target}")
    return found


@pytest.mark.parametrize(("name", "path"), list(modules()), ids=[name for name, _ in modules()])
def test_rooms_stand_in_descending_order(name: str, path: Path) -> None:
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    assert climbs(name, path.read_text(encoding="utf-8"), package) == []


def test_every_room_has_its_place_in_the_order() -> None:
    for layer, rooms in ORDER.items():
        folder = ROOT.joinpath(*layer.split(".")[1:])
        there = {path.name for path in folder.iterdir() if path.is_dir() and (path / "__init__.py").exists()}
        there |= {path.stem for path in folder.glob("*.py")} - {"__init__"}
        assert there - {"algorithms"} == set(rooms.split()), layer


def test_a_climbing_import_is_found() -> None:
    assert climbs("glint.flows.runtime.x", "from glint.flows.pipeline import run", "glint.flows.runtime")
    assert not climbs("glint.flows.pipeline.x", "from glint.flows.runtime import signals", "glint.flows.pipeline")


def test_no_room_is_crowded_and_no_module_long() -> None:
    folders: dict[str, int] = {}
    for _, path in modules():
        place = path.relative_to(ROOT)
        folders[place.parent.as_posix()] = folders.get(place.parent.as_posix(), 0) + (place.name != "__init__.py")
        lines = len(path.read_text(encoding="utf-8").splitlines())
        assert lines <= MAX_LINES or place.as_posix() in LONG, f"{place} has {lines} lines"
    assert {folder for folder, count in folders.items() if count > MAX_MODULES} <= set(CROWDED)


@pytest.mark.parametrize(
    ("name", "source"),
    [
        ("glint.tasks.algorithms.x", "from glint.storage import frames"),
        ("glint.tasks.algorithms.x", "from glint.tasks.engine.capture_context import CaptureContext"),
        ("glint.tasks.algorithms.x", "import glint.tasks.engine.capture_context"),
        ("glint.tasks.algorithms.x", "def f():\n    import zarr"),
        ("glint.storage.x", "from glint.tasks.algorithms.errors import UnusableCapture"),
        ("glint.storage.x", "import glint.flows.server"),
        ("glint.tasks.x", "import prefect"),
        ("glint.tasks.x", "from glint.flows import cluster"),
    ],
)
def test_imports_the_other_way_are_found(name: str, source: str) -> None:
    assert violations(name, source, name.rpartition(".")[0])


def test_relative_imports_are_resolved() -> None:
    assert violations("glint.tasks.algorithms.x", "from .. import workspace", "glint.tasks.algorithms") == [
        "glint.tasks.algorithms.x imports glint.tasks",
        "glint.tasks.algorithms.x imports glint.tasks.workspace",
    ]
    assert violations("glint.tasks.algorithms.x", "from . import errors", "glint.tasks.algorithms") == []


def test_packages_are_empty() -> None:
    assert [path for _, path in modules() if path.name == "__init__.py" and path.read_text().strip()] == []


@pytest.mark.parametrize(
    "module",
    [
        "glint.flows.runtime.prefect_server",
        "glint.flows.runtime.environment",
        "glint.flows.reporting.events",
        "glint.flows.reporting.console",
        "glint.flows.runtime.orphaned_runs",
        "glint.flows.cli.main",
    ],
)
def test_the_command_line_imports_nothing_slow(module: str) -> None:
    """Help comes at once, and the server is started before prefect reads its settings."""
    code = f"import sys, {module}; print(*sorted(set(sys.modules) & set({sorted(SLOW)!r})))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.split() == []


def test_benchmarks_import_what_there_is() -> None:
    """No other test runs most of them."""
    names = [f"tests.benchmarks.{path.stem}" for path in sorted((ROOT / "tests" / "benchmarks").glob("*.py"))]
    code = f"import importlib\nfor name in {names}: importlib.import_module(name)"
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
