"""Imports run one way: flows -> tasks and storage; tasks -> storage and tasks.algorithms; those two import none."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LAYERS = ("flows", "tasks", "tasks.algorithms", "storage")
MAY_IMPORT = {
    "flows": {"flows", "tasks", "storage"},
    "tasks": {"tasks", "tasks.algorithms", "storage"},
    "tasks.algorithms": {"tasks.algorithms"},
    "storage": {"storage"},
}
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
            yield ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"), path


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
    foreign = {"tasks.algorithms": NOT_IN_ALGORITHMS, "storage": NOT_IN_STORAGE, "tasks": NOT_IN_TASKS}.get(
        layer, set()
    )
    found = []
    for target in imported(ast.parse(source), package):
        ours = layer_of(target)
        if layer == "flows" and target.startswith("tasks.algorithms.errors"):
            continue  # whoever decides about a failed capture knows it by its type
        if (ours is not None and ours not in MAY_IMPORT[layer]) or target.split(".")[0] in foreign:
            found.append(f"{name} imports {target}")
    return found


@pytest.mark.parametrize(("name", "path"), list(modules()), ids=[name for name, _ in modules()])
def test_imports_run_one_way(name: str, path: Path) -> None:
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    assert violations(name, path.read_text(encoding="utf-8"), package) == []


@pytest.mark.parametrize(
    ("name", "source"),
    [
        ("tasks.algorithms.x", "from storage import frames"),
        ("tasks.algorithms.x", "from tasks.workspace import Workspace"),
        ("tasks.algorithms.x", "import tasks.workspace"),
        ("tasks.algorithms.x", "def f():\n    import zarr"),
        ("storage.x", "from tasks.algorithms.errors import UnusableCapture"),
        ("storage.x", "import flows.server"),
        ("tasks.x", "import prefect"),
        ("tasks.x", "from flows import cluster"),
    ],
)
def test_imports_the_other_way_are_found(name: str, source: str) -> None:
    assert violations(name, source, name.rpartition(".")[0])


def test_relative_imports_are_resolved() -> None:
    assert violations("tasks.algorithms.x", "from .. import workspace", "tasks.algorithms") == [
        "tasks.algorithms.x imports tasks",
        "tasks.algorithms.x imports tasks.workspace",
    ]
    assert violations("tasks.algorithms.x", "from . import errors", "tasks.algorithms") == []


def test_packages_are_empty() -> None:
    assert [path for _, path in modules() if path.name == "__init__.py" and path.read_text().strip()] == []


@pytest.mark.parametrize(
    "module", ["flows.server", "flows.settings", "flows.progress", "flows.displays", "flows.zombies", "flows.cli"]
)
def test_the_command_line_imports_nothing_slow(module: str) -> None:
    """Help comes at once, and the server is started before prefect reads its settings."""
    if not (ROOT / (module.replace(".", "/") + ".py")).exists():
        pytest.skip(f"no {module}")
    code = f"import sys, {module}; print(*sorted(set(sys.modules) & set({sorted(SLOW)!r})))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.split() == []
