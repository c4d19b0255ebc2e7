"""A browser that was let in stays so when the server starts anew, until the secret is old, removed or another's."""

import os
import time
from pathlib import Path

import pytest

from glint.flows.reporting.review_links import review_address
from glint.flows.review.access import COOKIE_SECONDS
from glint.flows.review.kept_session import kept_session

ORIGIN = "http://127.0.0.1:4300"


def test_the_session_is_kept_where_only_its_owner_reads_it(tmp_path: Path) -> None:
    session = kept_session(ORIGIN, home=tmp_path)
    assert len(session) == 64 and kept_session(ORIGIN, home=tmp_path) == session
    secret = tmp_path / "review" / "session"
    assert secret.stat().st_mode & 0o777 == 0o600 and secret.parent.stat().st_mode & 0o777 == 0o700
    assert session not in secret.read_text()


def test_another_address_or_password_has_another_session(tmp_path: Path) -> None:
    sessions = {kept_session(ORIGIN, word, tmp_path) for word in (None, "a long password", "another password")}
    assert len(sessions | {kept_session("http://127.0.0.1:4301", home=tmp_path)}) == 4


def test_an_old_removed_or_damaged_secret_is_replaced(tmp_path: Path) -> None:
    secret = tmp_path / "review" / "session"
    sessions = {kept_session(ORIGIN, home=tmp_path)}
    then = time.time() - COOKIE_SECONDS - 1
    os.utime(secret, (then, then))
    sessions.add(kept_session(ORIGIN, home=tmp_path))
    secret.unlink()
    sessions.add(kept_session(ORIGIN, home=tmp_path))
    for damage in ("no secret", "00"):
        secret.write_text(damage)
        sessions.add(kept_session(ORIGIN, home=tmp_path))
        assert kept_session(ORIGIN, home=tmp_path) in sessions
    assert len(sessions) == 5


def test_where_nothing_can_be_kept_the_session_is_of_one_start(tmp_path: Path) -> None:
    (tmp_path / "review").write_text("in the way")
    assert kept_session(ORIGIN, home=tmp_path) != kept_session(ORIGIN, home=tmp_path)


def test_the_address_to_bookmark_is_that_of_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    assert review_address("glass/front") == f"{ORIGIN}/#/glass/front/inputs"
    monkeypatch.setenv("GLINT_REVIEW_ORIGIN", "https://glint.example/")
    assert review_address() == "https://glint.example/#/"
