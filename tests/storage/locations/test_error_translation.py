"""The remedy of an error follows from its words, not from numbers in it."""

import icechunk
import pytest

from glint.storage.errors import DamagedError, StoreUnreachable
from glint.storage.locations.error_translation import UNKNOWN_CAUSE_REMEDY, translate
from glint.storage.versions.snapshots import index_errors

DAMAGE = (
    "Invalid Icechunk metadata file: Signed offset at position 1800 has value 1196554032 which points out of bounds"
)


def test_numbers_are_no_status() -> None:
    assert translate("memory", "reading", OSError(DAMAGE)).remedy == UNKNOWN_CAUSE_REMEDY
    for text in ("403 Forbidden", "service error: StatusCode(403)", "AccessDenied"):
        assert "credentials" in translate("memory", "reading", OSError(text)).remedy


def test_a_random_name_is_no_cause() -> None:
    missing = OSError('object not found, path="chunks/HPXWP3NDNSAGZT5X8FCG"')
    assert translate("the store", "reading", missing).remedy == UNKNOWN_CAUSE_REMEDY
    unknown_host = OSError("error: dns error: failed to lookup address information: Name or service not known")
    assert isinstance(translate("s3://here", "reading", unknown_host), StoreUnreachable)


@pytest.mark.parametrize("detail", ["", " (connect, quota)"])
def test_a_damaged_index_is_named_whatever_its_message_holds(detail: str) -> None:
    with pytest.raises(DamagedError, match="index of object vase"), index_errors("memory", "opening it", "vase"):
        raise icechunk.IcechunkError(DAMAGE + detail)


@pytest.mark.parametrize("name", ["PanicException", "RustPanic"])
def test_a_library_that_stops_at_a_damaged_file_is_no_defect_of_glint(name: str) -> None:
    panic = type(name, (BaseException,), {})
    with pytest.raises(DamagedError, match="index of object vase"), index_errors("memory", "reading it", "vase"):
        raise panic("Invalid node data type in flatbuffers file")
