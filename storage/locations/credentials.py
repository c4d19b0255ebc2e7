"""Endpoint, region and credentials of object stores, from the environment or the usual profile files; never printed.

S3: boto3 finds the credentials (environment, profiles, single sign-on, assumed roles, the platform's role) and renews
those that expire; obstore and icechunk call the functions of this module again when theirs run out. Without boto3 both
libraries read the environment and the platform's role themselves. Azure: an account key, else what the libraries find.
"""

import os
from dataclasses import dataclass, field
from datetime import timedelta
from functools import lru_cache
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import icechunk

from glint.storage.errors import StoreError

if TYPE_CHECKING:
    from botocore.session import Session
    from obstore.auth.boto3 import Boto3CredentialProvider
    from obstore.store import S3Credential

CREDENTIALS_TTL = timedelta(minutes=5)
"""Time for which the libraries keep credentials before they ask again; botocore renews at least 10 minutes before
expiry."""


@dataclass(frozen=True, slots=True)
class S3Options:
    """Endpoint (None: Amazon's own), region, and whether boto3 has credentials (else the libraries find their own)."""

    endpoint: str | None
    region: str
    is_refreshable: bool = False

    def for_obstore(self) -> dict[str, Any]:
        """Return the arguments of S3Store."""
        options: dict[str, Any] = {"region": self.region}
        if self.is_refreshable:
            options["credential_provider"] = obstore_credentials
        if self.endpoint:
            options |= {"endpoint": self.endpoint, "virtual_hosted_style_request": False}
            options["client_options"] = {"allow_http": self.endpoint.startswith("http://")}
        return options

    def for_icechunk(self) -> dict[str, Any]:
        """Return the arguments of icechunk.s3_storage."""
        options: dict[str, Any] = {"region": self.region}
        options |= {"get_credentials": icechunk_credentials} if self.is_refreshable else {"from_env": True}
        if self.endpoint:
            options |= {"endpoint_url": self.endpoint, "force_path_style": True}
            options["allow_http"] = self.endpoint.startswith("http://")
        return options


def s3_options() -> S3Options:
    """Return the options of S3 from AWS_ENDPOINT_URL(_S3), AWS_REGION, .., else from the profile AWS_PROFILE of ~/.aws.

    Raises:
        StoreError: the profile is missing or malformed, or boto3, which reads profiles, is not installed.
    """
    profile, provider = _profile(_environment_hash()) if _has_boto3() else ({}, None)
    region = os.environ.get("AWS_REGION") or os.environ.get("AWS_DEFAULT_REGION") or profile.get("region")
    variables = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT")
    endpoint = next(filter(None, map(os.environ.get, variables)), None) or profile.get("endpoint_url")
    return S3Options(endpoint, region or "us-east-1", provider is not None)


def obstore_credentials() -> "S3Credential":
    """Return the current keys of S3, for obstore to ask for again once they expire."""
    _, provider = _profile(_environment_hash())
    if provider is None:
        raise StoreError("no credentials for S3 were found", "set AWS_ACCESS_KEY_ID or AWS_PROFILE")
    return provider()


def icechunk_credentials() -> icechunk.S3StaticCredentials:
    """Return the current keys of S3, for icechunk to ask for again once they expire; icechunk pickles this function."""
    keys = obstore_credentials()
    return icechunk.S3StaticCredentials(
        access_key_id=keys["access_key_id"],
        secret_access_key=keys["secret_access_key"],
        session_token=keys.get("token"),
        expires_after=keys["expires_at"],
    )


def _has_boto3() -> bool:
    """Return whether boto3 is installed.

    Raises:
        StoreError: it is not installed, and AWS_PROFILE requires it.
    """
    if find_spec("boto3") is not None:
        return True
    if os.environ.get("AWS_PROFILE") and not os.environ.get("AWS_ACCESS_KEY_ID"):
        raise StoreError("AWS_PROFILE is set, but boto3, which reads profiles, is not installed", "install glint[s3]")
    return False


def _environment_hash() -> int:
    """Return a hash of the variables on which the credentials depend; their values must not appear in tracebacks."""
    return hash(tuple(sorted(item for item in os.environ.items() if item[0] == "HOME" or item[0].startswith("AWS_"))))


@lru_cache(maxsize=4)
def _profile(environment_hash: int) -> "tuple[dict[str, Any], Boto3CredentialProvider | None]":
    """Return the chosen profile's settings and its credentials, None if there are none.

    Cached as long as the environment stays, so that all stores of a process share the credentials and their renewal.
    """
    import botocore.session
    from botocore.exceptions import BotoCoreError
    from obstore.auth.boto3 import Boto3CredentialProvider

    session: Session = botocore.session.Session()
    try:
        settings = dict(session.get_scoped_config())
        if session.get_credentials() is None:
            return settings, None
        return settings, Boto3CredentialProvider(session, ttl=CREDENTIALS_TTL)
    except (BotoCoreError, UnicodeDecodeError) as error:
        raise StoreError(
            f"the credentials for S3 cannot be read ({error})",
            "check the credentials: AWS_PROFILE and the profile files",
        ) from error


@dataclass(frozen=True, slots=True)
class AzureOptions:
    """Endpoint (None: Azure's own) and account key (None: what the platform provides, such as a managed identity)."""

    account: str
    endpoint: str | None
    key: str | None = field(default=None, repr=False)
    emulator: bool = False

    def for_obstore(self) -> dict[str, Any]:
        """Return the arguments of AzureStore; it reads the other AZURE_ variables itself."""
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
        """Return the arguments of icechunk.azure_storage beside the account."""
        options: dict[str, Any] = {"access_key": self.key} if self.key else {"from_env": True}
        if self.emulator:
            options["config"] = {"azure_storage_use_emulator": "true", "azure_allow_http": "true"}
        elif self.endpoint:
            allow = "true" if self.endpoint.startswith("http://") else "false"
            options["config"] = {"endpoint": self.endpoint, "allow_http": allow}
        return options


def azure_options() -> AzureOptions:
    """Return the options of Azure from the environment.

    AZURE_STORAGE_ACCOUNT_NAME, AZURE_STORAGE_ACCOUNT_KEY, AZURE_STORAGE_ENDPOINT, AZURE_STORAGE_USE_EMULATOR.

    Raises:
        StoreError: AZURE_STORAGE_ACCOUNT_NAME is missing.
    """
    emulator = os.environ.get("AZURE_STORAGE_USE_EMULATOR", "").lower() in ("1", "true")
    account = os.environ.get("AZURE_STORAGE_ACCOUNT_NAME") or ("devstoreaccount1" if emulator else "")
    if not account:
        raise StoreError("no Azure account is named", "set AZURE_STORAGE_ACCOUNT_NAME and a key or another credential")
    endpoint = os.environ.get("AZURE_STORAGE_ENDPOINT") or os.environ.get("AZURE_ENDPOINT")
    key = os.environ.get("AZURE_STORAGE_ACCOUNT_KEY") or os.environ.get("AZURE_STORAGE_ACCESS_KEY")
    return AzureOptions(account, endpoint, key, emulator)
