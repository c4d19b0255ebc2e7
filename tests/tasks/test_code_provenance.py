"""Provenance of the code: a digest that every source file changes, and the revision of a checkout."""

from pathlib import Path

import pytest

from glint.tasks import code_provenance


def test_every_source_file_changes_the_digest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(code_provenance, "PACKAGE", tmp_path)
    names = ("__init__.py", "flows/run.py", "storage/errors.py", "tasks/stages/mask.py")
    for name in names:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("")
    digests = {code_provenance.source_digest()}
    for name in names:
        (tmp_path / name).write_text("changed = True")
        digests.add(code_provenance.source_digest())
    assert len(digests) == len(names) + 1


def test_links_and_folders_have_the_same_digest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A checkout, in which the package links to its folders, and an installed package."""
    for package in ("checkout", "installed"):
        (tmp_path / package).mkdir()
    (tmp_path / "installed" / "tasks").mkdir()
    (tmp_path / "installed" / "tasks" / "publish.py").write_text("source")
    (tmp_path / "checkout" / "tasks").symlink_to(tmp_path / "installed" / "tasks")
    digests = set()
    for package in ("checkout", "installed"):
        monkeypatch.setattr(code_provenance, "PACKAGE", tmp_path / package)
        digests.add(code_provenance.source_digest())
    assert len(digests) == 1


def test_an_installed_package_has_no_revision(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(code_provenance, "PACKAGE", tmp_path / "glint")
    assert code_provenance.revision() == ""


def test_a_checkout_has_a_revision() -> None:
    if not (Path(__file__).parents[2] / ".git").exists():
        pytest.skip("not a checkout")
    assert code_provenance.revision()
