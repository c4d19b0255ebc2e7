from pathlib import Path

import pytest

from glint.flows.runtime.environment import glint_home, prepare_environment


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the tests set is taken back."""
    for name in ("GLINT_HOME", "PREFECT_API_URL", "PREFECT_HOME", "DO_NOT_TRACK", "NUMBA_NUM_THREADS"):
        monkeypatch.setenv(name, "unset")
        monkeypatch.delenv(name)


def test_home_is_the_users_unless_said(monkeypatch: pytest.MonkeyPatch) -> None:
    assert glint_home() == Path.home() / ".glint"
    monkeypatch.setenv("GLINT_HOME", "some/where")
    assert glint_home() == Path.cwd() / "some/where"


def test_the_users_settings_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    import os

    monkeypatch.setenv("NUMBA_NUM_THREADS", "7")
    prepare_environment()
    assert os.environ["NUMBA_NUM_THREADS"] == "7"
    assert os.environ["DO_NOT_TRACK"] == "1"
    assert "PREFECT_API_URL" not in os.environ


def test_the_embedded_servers_address_is_set_in_any_case(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    import os

    monkeypatch.setenv("PREFECT_HOME", "/elsewhere")
    prepare_environment("http://127.0.0.1:4321/api", tmp_path)
    assert os.environ["PREFECT_API_URL"] == "http://127.0.0.1:4321/api"
    assert os.environ["PREFECT_HOME"] == str(tmp_path)
