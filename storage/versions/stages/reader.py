"""Reading one stage's result from its group of a versioned store, and the keys of all that a store holds.

All that is read is verified, see `checksums`.
"""

from collections.abc import Mapping
from typing import Any

from glint.storage.errors import StoreError, damaged
from glint.storage.seals import SEAL, is_sealed
from glint.storage.versions.stage_results import FileInfo, Keys, StageResult, owner_name
from glint.storage.versions.stages.attributes import UNSEALED, attributes_problem
from glint.storage.versions.stages.checksums import VerifiedGroup
from glint.storage.versions.stages.groups import LAYOUT_NUMBER, open_group, readable_metadata
from glint.storage.versions.stages.names import check_name


def check_layout(store: Any, object_id: str, uri: str) -> None:
    """Check that a store is empty or has the layout of this version of Glint.

    Raises:
        StoreError: another version of Glint has written it; DamagedError: what says so is damaged.
    """
    root = open_group(store, object_id, "")
    if root is None:
        return
    layout = root.attrs.get("layout", 1)
    if SEAL in root.attrs and not is_sealed(dict(root.attrs)):
        raise damaged(f"the root of object {object_id} in {uri}", "its attributes are not what was written", object_id)
    if layout != LAYOUT_NUMBER:
        older = not isinstance(layout, int) or layout < LAYOUT_NUMBER
        raise StoreError(
            f"object {object_id} in {uri} was written by {'an older' if older else 'a newer'} version of Glint "
            f"(layout {layout}; this version reads layout {LAYOUT_NUMBER})",
            "use a new --store and run again" if older else "update Glint, or use a new --store and run again",
        )


def read_stage(store: Any, object_id: str, capture: str, stage: str) -> StageResult | None:
    """Return the stage's newest result without the values of arrays and files, or None where it was never saved.

    Raises:
        DamagedError: the group is not what was written as this stage's result.
    """
    group = open_group(store, object_id, f"{check_name(capture, 'capture')}/{check_name(stage, 'stage')}")
    return None if group is None else _result(store, dict(group.attrs), object_id, capture, stage, "work")


def read_capture(
    store: Any, object_id: str, capture: str, version: str = "work", seals: Mapping[str, str] | None = None
) -> dict[str, StageResult]:
    """Return the results of a capture by stage; seals: of the stages that it must have, by default it has any.

    Raises:
        DamagedError: one is damaged, missing or another.
    """
    present, results = _present(store, object_id, capture), dict[str, StageResult]()
    for stage in _usable(present) if seals is None else seals:
        owner = owner_name(object_id, capture, stage, version)
        if stage not in present:
            raise damaged(owner, "it is missing", object_id)
        results[stage] = _result(store, present[stage], object_id, capture, stage, version)
        if seals is not None and present[stage][SEAL] != seals[stage]:
            raise damaged(owner, "it is not the result of this version", object_id)
    return results


def _result(
    store: Any, attributes: dict[str, Any], object_id: str, capture: str, stage: str, version: str
) -> StageResult:
    owner, path = owner_name(object_id, capture, stage, version), f"{capture}/{stage}"
    problem = attributes_problem(attributes)
    if problem or attributes["name"] != f"{object_id}/{path}":
        raise damaged(owner, problem or UNSEALED, object_id)
    return StageResult(
        object_id=object_id,
        capture=capture,
        stage=stage,
        version=version,
        key=attributes["key"],
        record=attributes["record"],
        files={name: FileInfo(**info) for name, info in attributes["files"].items()},
        group=VerifiedGroup(store, path, attributes["checksums"], owner, object_id),
    )


def contents(store: Any, object_id: str) -> Keys:
    """Return the stage keys of everything in a store, WHOLE_OBJECT included."""
    root = open_group(store, object_id, "")
    with readable_metadata(object_id, ""):
        names = [] if root is None else sorted(root.group_keys())
    return {name: stage_keys(store, object_id, name) for name in names}


def saved_key(store: Any, object_id: str, capture: str, stage: str) -> str | None:
    """Return the key of one saved stage; None where it was never saved, or its attributes are damaged.

    Raises:
        DamagedError: metadata of the capture or the stage cannot be read.
    """
    # A stage is computed again if its capture's metadata are damaged, which replaces them.
    is_known = open_group(store, object_id, check_name(capture, "capture")) is not None
    group = open_group(store, object_id, f"{capture}/{check_name(stage, 'stage')}") if is_known else None
    attributes: dict[str, Any] = {} if group is None else dict(group.attrs)
    return None if attributes_problem(attributes) else attributes["key"]


def stage_keys(store: Any, object_id: str, capture: str) -> dict[str, str]:
    """Return the keys of the saved stages of a capture."""
    return {stage: attributes["key"] for stage, attributes in stage_attributes(store, object_id, capture).items()}


def stage_attributes(store: Any, object_id: str, capture: str) -> dict[str, dict[str, Any]]:
    """Return the attributes of the saved stages of a capture; one whose attributes are damaged counts as not saved."""
    return _usable(_present(store, object_id, capture))


def _usable(present: Mapping[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    return {stage: values for stage, values in present.items() if not attributes_problem(values)}


def _present(store: Any, object_id: str, capture: str) -> dict[str, dict[str, Any]]:
    """Return the attributes of the stages of a capture, as they are."""
    group = open_group(store, object_id, check_name(capture, "capture"))
    with readable_metadata(object_id, capture):
        stages = {} if group is None else dict(group.groups())
        return {name: dict(stage.attrs) for name, stage in sorted(stages.items())}
