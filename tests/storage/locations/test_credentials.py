"""Credentials of S3: from the environment or a profile, renewed when they expire, never printed."""

import importlib.util
import json
import pickle
import sys
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import icechunk
import obstore
import pytest

from glint.storage.errors import StoreError
from glint.storage.locations import credentials
from glint.storage.locations.credentials import icechunk_credentials, obstore_credentials, s3_options
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from tests.storage.locations.lax_server import LaxServer, lax_server

HAS_BOTO3 = importlib.util.find_spec("boto3") is not None
needs_boto3 = pytest.mark.skipif(not HAS_BOTO3, reason="boto3 is not installed")

PROVIDER = """
import datetime, json, pathlib, sys
counter = pathlib.Path(sys.argv[1])
number = int(counter.read_text()) + 1 if counter.exists() else 1
counter.write_text(str(number))
expiry = datetime.datetime.now(datetime.UTC) + datetime.timedelta(seconds=int(sys.argv[2]))
keys = {"AccessKeyId": f"key-{number}", "SecretAccessKey": "secret", "SessionToken": f"token-{number}"}
print(json.dumps({"Version": 1, "Expiration": expiry.isoformat(), **keys}))
"""
"""A credential process (see AWS's shared configuration) that hands out numbered credentials."""


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A home folder without credentials, and an environment without variables of AWS."""
    for name in [name for name in credentials.os.environ if name.startswith("AWS_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    (tmp_path / ".aws").mkdir()
    return tmp_path


@pytest.fixture
def server(home: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[LaxServer]:
    with lax_server() as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", server.url)
        yield server


def credential_process(home: Path, lifetime_s: int) -> None:
    """Make numbered credentials, each valid for `lifetime_s` seconds, the default profile's."""
    script = home / "provider.py"
    script.write_text(PROVIDER)
    command = f'"{sys.executable}" "{script}" "{home / "counter"}" {lifetime_s}'
    (home / ".aws" / "config").write_text(f"[default]\ncredential_process = {command}\n")


def write_with_obstore(place: Location) -> None:
    store = place.obstore()
    for _ in range(3):
        obstore.put(store, "key", b"value", use_multipart=False)


def read_with_icechunk(place: Location) -> None:
    storage = place.icechunk_storage()
    for _ in range(3):
        assert not icechunk.Repository.exists(storage)


@needs_boto3
@pytest.mark.parametrize("use", [write_with_obstore, read_with_icechunk])
def test_expired_credentials_are_renewed_during_a_run(
    home: Path, server: LaxServer, monkeypatch: pytest.MonkeyPatch, use: Callable[[Location], None]
) -> None:
    # Botocore renews what expires within 10 minutes; the libraries ask it for every request.
    credential_process(home, lifetime_s=60)
    monkeypatch.setattr(credentials, "CREDENTIALS_TTL", timedelta(0))
    use(Location.parse("s3://store/here"))
    # Icechunk sends two requests at once, so their order is not that of their tokens.
    assert len(set(server.tokens)) >= 3 and None not in server.tokens


@needs_boto3
@pytest.mark.parametrize("use", [write_with_obstore, read_with_icechunk])
def test_valid_credentials_are_requested_once(home: Path, server: LaxServer, use: Callable[[Location], None]) -> None:
    credential_process(home, lifetime_s=3600)
    use(Location.parse("s3://store/here"))
    assert len(server.tokens) >= 3 and set(server.tokens) == {"token-1"}


@needs_boto3
def test_credentials_outlive_the_time_that_the_libraries_keep_them(home: Path) -> None:
    credential_process(home, lifetime_s=3600)
    keys = obstore_credentials()
    expiry = keys["expires_at"]
    assert expiry is not None
    assert timedelta(0) < expiry - datetime.now(UTC) <= credentials.CREDENTIALS_TTL <= timedelta(minutes=10)
    assert icechunk_credentials().session_token == keys.get("token")


@needs_boto3
def test_a_profile_gives_keys_region_and_endpoint(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (home / ".aws" / "config").write_text("[profile lab]\nregion = eu-west-1\nendpoint_url = http://lab:7480\n")
    (home / ".aws" / "credentials").write_text("[lab]\naws_access_key_id = a\naws_secret_access_key = hidden\n")
    monkeypatch.setenv("AWS_PROFILE", "lab")
    options = s3_options()
    assert (options.region, options.endpoint, options.is_refreshable) == ("eu-west-1", "http://lab:7480", True)
    keys = obstore_credentials()
    assert (keys["access_key_id"], keys["secret_access_key"], keys.get("token")) == ("a", "hidden", None)
    monkeypatch.setenv("AWS_REGION", "us-west-2")
    monkeypatch.setenv("AWS_ENDPOINT_URL_S3", "https://elsewhere")
    assert (s3_options().region, s3_options().endpoint) == ("us-west-2", "https://elsewhere")
    assert "hidden" not in repr(s3_options()) + json.dumps(s3_options().for_icechunk(), default=repr)


@needs_boto3
def test_a_profile_that_is_missing_or_malformed_is_reported(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_PROFILE", "none")
    with pytest.raises(StoreError, match="none") as error:
        s3_options()
    assert "AWS_PROFILE" in error.value.remedy
    (home / ".aws" / "config").write_text("region = x\n")
    monkeypatch.delenv("AWS_PROFILE")
    with pytest.raises(StoreError, match="config"):
        s3_options()


@needs_boto3
@pytest.mark.parametrize("use", [write_with_obstore, read_with_icechunk])
def test_a_failed_renewal_is_reported_with_its_remedy(
    home: Path, server: LaxServer, use: Callable[[Location], None]
) -> None:
    credential_process(home, lifetime_s=60)
    assert s3_options().is_refreshable
    (home / "provider.py").write_text("raise SystemExit('signed out')")
    with pytest.raises(StoreError, match="signed out") as error, store_errors("s3://store/here", "writing"):
        use(Location.parse("s3://store/here"))
    assert "credentials" in error.value.remedy and server.tokens == []


def test_keys_in_the_environment_need_no_profile(server: LaxServer, monkeypatch: pytest.MonkeyPatch) -> None:
    for variable, value in (("ACCESS_KEY_ID", "a"), ("SECRET_ACCESS_KEY", "b"), ("SESSION_TOKEN", "c")):
        monkeypatch.setenv(f"AWS_{variable}", value)
    write_with_obstore(Location.parse("s3://store/here"))
    read_with_icechunk(Location.parse("s3://store/here"))
    assert set(server.tokens) == {"c"}


def test_without_boto3_the_libraries_read_the_environment(server: LaxServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(credentials, "find_spec", lambda name: None)
    monkeypatch.setenv("AWS_PROFILE", "lab")
    with pytest.raises(StoreError, match="boto3") as error:
        s3_options()
    assert "glint[s3]" in error.value.remedy
    for variable, value in (("ACCESS_KEY_ID", "a"), ("SECRET_ACCESS_KEY", "b"), ("SESSION_TOKEN", "c")):
        monkeypatch.setenv(f"AWS_{variable}", value)
    assert s3_options().for_icechunk()["from_env"] is True
    write_with_obstore(Location.parse("s3://store/here"))
    read_with_icechunk(Location.parse("s3://store/here"))
    assert set(server.tokens) == {"c"}


def test_providers_reach_other_processes(home: Path) -> None:
    for provider in (obstore_credentials, icechunk_credentials):
        assert pickle.loads(pickle.dumps(provider)) is provider
