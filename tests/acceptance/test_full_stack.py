"""Everything as in production, on this machine."""

from pathlib import Path

import pytest

from tests import s3_gateway
from tests.acceptance import full_stack as constellation
from tests.acceptance.processes import Postgres

pytestmark = [pytest.mark.slow, pytest.mark.server, pytest.mark.timeout(1200)]


def test_a_catalogue_goes_through_the_whole_constellation(monkeypatch: pytest.MonkeyPatch) -> None:
    missing = s3_gateway.missing() + ["postgresql"] * Postgres(Path("none")).missing
    if missing:
        pytest.skip(
            f"not installed: {', '.join(missing)} (Debian: postgresql ceph-mon ceph-osd ceph-common radosgw curl)"
        )
    for name in ("AWS_ENDPOINT_URL", "AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_REGION"):
        monkeypatch.setenv(name, "")
    constellation.main()
