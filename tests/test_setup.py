"""What is installed is pinned, all of it, and says nothing about where it comes from."""

import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PINNED = (ROOT / "requirements.txt").read_text()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def name_of(requirement: str) -> str:
    return normal(re.split(r"[^A-Za-z0-9._-]", requirement)[0])


def pins() -> dict[str, str]:
    found = re.findall(r"^([\w.-]+)(?:\[[^]]*\])?==(\S+)", PINNED, re.MULTILINE)
    return {normal(name): version for name, version in found}


def test_every_requirement_is_pinned() -> None:
    project = PROJECT["project"]
    asked = [
        *project["dependencies"],
        *(package for extra in project["optional-dependencies"].values() for package in extra),
    ]
    assert {name_of(package) for package in asked} - set(pins()) == set()


def test_every_pin_has_hashes() -> None:
    entries = re.split(r"^(?=[A-Za-z0-9])", PINNED, flags=re.MULTILINE)
    unpinned = [entry.split()[0] for entry in entries if entry.strip() and "--hash=sha256:" not in entry]
    assert [entry for entry in unpinned if not entry.startswith("#")] == []
    assert len(pins()) > 100


def test_no_address_is_written_down() -> None:
    assert re.findall(r"https?://|file:|--(?:extra-)?index-url|--find-links|--trusted-host", PINNED) == []


def test_the_build_needs_nothing_but_pins() -> None:
    assert {name_of(package) for package in PROJECT["build-system"]["requires"]} <= set(pins())


@pytest.mark.parametrize("script", ["setup.sh", ".ci/run"])
def test_scripts_are_executable_and_parse(script: str) -> None:
    path = ROOT / script
    assert path.stat().st_mode & 0o111 == 0o111
    assert subprocess.run(["bash", "-n", str(path)], capture_output=True).returncode == 0


@pytest.mark.parametrize(("locked", "other", "status"), [(2, 0, 0), (99, 0, 1), (0, 1, 1)])
def test_setup_waits_for_another_apt(tmp_path: Path, locked: int, other: int, status: int) -> None:
    """locked: calls that find the lock taken; other: calls that fail for another cause."""
    fake = tmp_path / "apt-get"
    held = "E: Could not get lock /var/lib/apt/lists/lock."
    fake.write_text(
        "#!/bin/bash\necho x >> calls\n"
        f"if [ $(wc -l < calls) -le {locked} ]; then echo '{held}' >&2; exit 100; fi\n"
        f"if [ $(wc -l < calls) -le {locked + other} ]; then echo 'E: no network' >&2; exit 100; fi\n"
    )
    (tmp_path / "sleep").write_text("#!/bin/bash\n")
    for path in (fake, tmp_path / "sleep"):
        path.chmod(0o755)
    function = (ROOT / "setup.sh").read_text().partition("lock_seconds=600")[2].partition("install_libraries()")[0]
    done = subprocess.run(
        ["bash", "-euc", f"PATH=$PWD:$PATH; lock_seconds=20 {function} apt_get update -qq"],
        cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == status
    assert ("waiting for another apt-get" in done.stderr) == (locked > 0)
    assert ("no network" in done.stderr) == (other > 0)
    calls = len((tmp_path / "calls").read_text().splitlines())
    assert calls == (3 if locked == 2 else 5 if locked else 1)


def test_a_missing_python_is_reported_in_one_line(tmp_path: Path) -> None:
    for name in ("setup.sh", "requirements.txt", "pyproject.toml"):
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    (tmp_path / ".python-version").write_text("3.99\n")
    done = subprocess.run(["bash", "setup.sh"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    assert re.fullmatch(r"setup: no Python 3\.99 with venv: install it \(.*\)\n", done.stderr)
    assert not (tmp_path / ".venv").exists()


def test_the_wheel_holds_one_import_package(tmp_path: Path) -> None:
    """Nothing named `tasks`, `flows` or `storage` enters anybody's site-packages; links become folders."""
    source = tmp_path / "source"
    ignored = shutil.ignore_patterns(
        ".git", ".venv", ".*_cache", ".hypothesis", "__pycache__", "build", "*.egg-info", "glint-*", "tests", "docs"
    )
    shutil.copytree(ROOT, source, symlinks=True, ignore=ignored)
    build = "import setuptools.build_meta as b, sys; print(b.build_wheel(sys.argv[1]))"
    subprocess.run([sys.executable, "-c", build, str(tmp_path)], cwd=source, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names} == {"glint", f"glint-{PROJECT['project']['version']}.dist-info"}
    modules = {path.relative_to(ROOT).as_posix() for top in ("flows", "tasks", "storage") for path in source_of(top)}
    assert {f"glint/{module}" for module in modules} <= set(names)
    viewer = {path.relative_to(ROOT).as_posix() for path in (ROOT / "storage/export/page/static").rglob("*.*")}
    assert {"glint/py.typed"} | {f"glint/{name}" for name in viewer} <= set(names)


def source_of(top: str) -> list[Path]:
    return sorted((ROOT / top).rglob("*.py"))
