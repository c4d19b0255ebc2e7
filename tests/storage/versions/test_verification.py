"""Results of earlier versions that a key asks for again."""

from pathlib import Path

import numpy as np

from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.verification import EARLIER_VERSIONS, earlier_result
from tests.storage.stores import local_store


def publish(repository: ObjectRepository, key: str, values: np.ndarray) -> str:
    repository.save("front", "depth", key, {"depth": values}, {"seconds": 1.0, "warnings": []})
    return repository.publish(["front"], {}).name


def test_an_earlier_result_is_found_by_its_key(tmp_path: Path) -> None:
    repository = ObjectRepository.open(local_store(tmp_path), "duck")
    assert earlier_result(repository, "front", "depth", "k0") is None
    noise = np.random.default_rng(0).random((60, 70))
    for number in range(3):
        assert publish(repository, f"k{number}", noise + number) == f"v{number + 1}"
    for number in range(3):
        stored = earlier_result(repository, "front", "depth", f"k{number}")
        assert stored is not None and stored.version == f"v{number + 1}"
        np.testing.assert_array_equal(stored.read("depth"), noise + number)
    assert earlier_result(repository, "front", "depth", "other") is None
    assert earlier_result(repository, "back", "depth", "k0") is None


def test_only_the_newest_versions_are_looked_at(tmp_path: Path) -> None:
    repository = ObjectRepository.open(local_store(tmp_path), "duck")
    for number in range(EARLIER_VERSIONS + 1):
        publish(repository, f"k{number}", np.full((2, 3), float(number)))
    assert earlier_result(repository, "front", "depth", "k0") is None
    assert earlier_result(repository, "front", "depth", "k1") is not None


def test_a_damaged_earlier_result_is_none(tmp_path: Path) -> None:
    repository = ObjectRepository.open(local_store(tmp_path), "duck")
    publish(repository, "k0", np.random.default_rng(0).random((60, 70)))
    (chunk,) = (tmp_path / "objects/duck/repo/chunks").iterdir()
    publish(repository, "k1", np.zeros((60, 70)))
    data = bytearray(chunk.read_bytes())
    data[100] ^= 1
    chunk.write_bytes(data)
    assert earlier_result(ObjectRepository.open(local_store(tmp_path), "duck"), "front", "depth", "k0") is None
