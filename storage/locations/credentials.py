"""How to reach an object store: from the environment, else from the usual profile files; never shown anywhere."""

import configparser
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from glint.storage.errors import StoreError


@dataclass(frozen=True, slots=True)
class S3Options:
    """Endpoint (None: Amazon's own), region and keys (None: whatever the platform offers, such as a role)."""

    endpoint: str | None
    region: str
    access_key_id: str | None = field(default=None, repr=False)
    secret_access_key: str | None = field(default=None, repr=False)
    session_token: str | None = field(default=None, repr=False)

    def _keys(self) -> dict[str, str]:
        named = {name: getattr(self, name) for name in ("access_key_id", "secret_access_key", "session_token")}
        return {name: value for name, value in named.items() if value}

    def for_obstore(self) -> dict[str, Any]:
        """Arguments of S3Store."""
        options: dict[str, Any] = {"region": self.region, **self._keys()}
        if self.endpoint:
            options |= {"endpoint": self.endpoint, "virtual_hosted_style_request": False}
            options["client_options"] = {"allow_http": self.endpoint.startswith("http://")}
        return options

    def for_icechunk(self) -> dict[str, Any]:
        """Arguments of icechunk.s3_storage."""
        options: dict[str, Any] = {"region": self.region, **(self._keys() or {"from_env": True})}
        if self.endpoint:
            options |= {"endpoint_url": self.endpoint, "force_path_style": True}
            options["allow_http"] = self.endpoint.startswith("http://")
        return options


def s3_options() -> S3Options:
    """AWS_ENDPOINT_URL(_S3), AWS_REGION, AWS_ACCESS_KEY_ID, .., else the profile AWS_PROFILE of ~/.aws."""
    profile = _profile()

    def look(*names: str) -> str | None:
        """From the environment (AWS_ENDPOINT_URL), else from the profile (endpoint_url)."""
        for source, spell in ((os.environ, str), (profile, lambda name: name.lower().removeprefix("aws_"))):
            for name in names:
                if value := source.get(spell(name)):
                    return value
        return None

    region = look("AWS_REGION", "AWS_DEFAULT_REGION") or "us-east-1"
    endpoint = look("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT")
    if os.environ.get("AWS_ACCESS_KEY_ID"):
        token = os.environ.get("AWS_SESSION_TOKEN")
        return S3Options(
            endpoint, region, os.environ["AWS_ACCESS_KEY_ID"], os.environ.get("AWS_SECRET_ACCESS_KEY"), token
        )
    keys = [profile.get(f"aws_{name}") for name in ("access_key_id", "secret_access_key", "session_token")]
    return S3Options(endpoint, region, *keys)


def _profile() -> dict[str, str]:
    """The chosen profile of the shared credentials and config files."""
    name = os.environ.get("AWS_PROFILE") or "default"
    found: dict[str, str] = {}
    for variable, default, section in (
        ("AWS_CONFIG_FILE", "~/.aws/config", name if name == "default" else f"profile {name}"),
        ("AWS_SHARED_CREDENTIALS_FILE", "~/.aws/credentials", name),
    ):
        parser = configparser.RawConfigParser()
        try:
            parser.read(Path(os.environ.get(variable) or default).expanduser(), encoding="utf-8")
        except (configparser.Error, UnicodeDecodeError) as error:
            raise StoreError(
                f"the profile file {os.environ.get(variable) or default} cannot be read", "mend it"
            ) from error
        if parser.has_section(section):
            found |= dict(parser.items(section))
    return found


@dataclass(frozen=True, slots=True)
class AzureOptions:
    """Endpoint (None: Azure's own) and account key (None: whatever the platform offers)."""

    account: str
    endpoint: str | None
    key: str | None = field(default=None, repr=False)
    emulator: bool = False

    def for_obstore(self) -> dict[str, Any]:
        """Arguments of AzureStore; it reads the other AZURE_ variables itself."""
        options: dict[str, Any] = {"account_name": self.account}
        if self.key:
            options["account_key"] = self.key
        if self.emulator:
            options |= {"use_emulator": True, "client_options": {"allow_http": True}}
        elif self.endpoint:
            options["endpoint"] = self.endpoint
            options["client_options"] = {"allow_http": self.endpoint.startswith("http://")}
        return options

    def for_icechunk(self) -> dict[str, Any]:
        """Arguments of icechunk.azure_storage beside the account."""
        options: dict[str, Any] = {"access_key": self.key} if self.key else {"from_env": True}
        if self.emulator:
            options["config"] = {"azure_storage_use_emulator": "true", "azure_allow_http": "true"}
        elif self.endpoint:
            allow = "true" if self.endpoint.startswith("http://") else "false"
            options["config"] = {"endpoint": self.endpoint, "allow_http": allow}
        return options


def azure_options() -> AzureOptions:
    """AZURE_STORAGE_ACCOUNT_NAME, AZURE_STORAGE_ACCOUNT_KEY, AZURE_STORAGE_ENDPOINT, AZURE_STORAGE_USE_EMULATOR.

    Raises:
        StoreError: no account is named.
    """
    emulator = os.environ.get("AZURE_STORAGE_USE_EMULATOR", "").lower() in ("1", "true")
    account = os.environ.get("AZURE_STORAGE_ACCOUNT_NAME") or ("devstoreaccount1" if emulator else "")
    if not account:
        raise StoreError("no Azure account is named", "set AZURE_STORAGE_ACCOUNT_NAME and a key or another credential")
    endpoint = os.environ.get("AZURE_STORAGE_ENDPOINT") or os.environ.get("AZURE_ENDPOINT")
    key = os.environ.get("AZURE_STORAGE_ACCOUNT_KEY") or os.environ.get("AZURE_STORAGE_ACCESS_KEY")
    return AzureOptions(account, endpoint, key, emulator)
