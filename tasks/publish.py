"""Publishing: an object's newest results as a version, with everything that is needed to repeat it."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

from glint.storage.catalogue.confinement import resolved
from glint.storage.catalogue.models import Capture
from glint.storage.errors import InputError, StoreError
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository, Version
from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.tasks.code_provenance import code_provenance
from glint.tasks.engine.capture_context import INPUTS, CaptureContext
from glint.tasks.pipeline import NAMES, SCHEMAS

EDITED_FIELDS = {"markup": "marks"}
"""Keys of an entry whose edited field has another name."""


def publish(works: Sequence[CaptureContext], run: str, catalogue: str, model: bool | None = None) -> Version:
    """Publish the results of these captures of one object as a version, if they differ from the newest one.

    run: the flow run that computed them; catalogue: its address; model: whether the object's model is part of the
    version, None: as before.

    Raises:
        StoreError: a result is missing or damaged, or the store cannot be written.
    """
    metadata = {
        "run": run,
        "catalogue": catalogue,
        **code_provenance(),
        "stages": NAMES,
        "captures": {work.capture.id: {"catalogue": catalogue, **capture_provenance(work)} for work in works},
    }
    repository, newest = works[0].repository, works[0].repository.version_names()[-1:]
    if newest:
        # Captures that this run leaves alone keep what is known of them.
        metadata["captures"] = repository.version(newest[0]).metadata.get("captures", {}) | metadata["captures"]
    names = [work.capture.id for work in works] + [WHOLE_OBJECT] * (model is True)
    removed = [WHOLE_OBJECT] if model is False else []
    return repository.publish(names, metadata, NAMES, message=f"run {run}", remove=removed, schemas=SCHEMAS)


def check_catalogue(works: Sequence[CaptureContext], catalogue: str) -> None:
    """Check that an object's newest version is of this catalogue, or of the same videos, and of no other object.

    Videos are the same if their content is, or their place: a file that was replaced is still that of its object, also
    for a copy of the catalogue, as the inbox makes one.

    Raises:
        StoreError: another catalogue has published an object of this id from other videos.
    """
    repository = works[0].repository
    names = repository.version_names()
    earlier = repository.version(names[-1]).metadata if names else {}
    owner, captures = earlier.get("catalogue") or catalogue, earlier.get("captures", {})
    if owner != catalogue and not any(_is_same_video(work, captures.get(work.capture.id, {})) for work in works):
        raise StoreError(
            f"object {works[0].object_id} in {works[0].location.uri} was published from the catalogue {owner}, with "
            f"other videos than {catalogue} names",
            "give one of the two objects another id, use another --store, or run with --adopt if they are the same",
        )


def _is_same_video(work: CaptureContext, recorded: Mapping[str, Any]) -> bool:
    """Return whether a capture's video is the recorded one; one that cannot be read is not.

    recorded: what a version holds of a capture, see `capture_provenance`.
    """
    address, digest = recorded.get("entry", {}).get("frames"), recorded.get("inputs", {}).get("frames")
    try:
        if address is not None and resolved(Location.parse(address)) == resolved(Location.parse(work.capture.frames)):
            return True
        return digest is not None and work.digest("frames") == digest
    except InputError:
        return False


def catalogues_of(store: Location, object_ids: Sequence[str]) -> dict[str, list[str]]:
    """Return objects by the catalogue that their newest readable version names, empty where there is none."""
    catalogues: dict[str, list[str]] = {}
    for object_id in object_ids:
        catalogue = ""
        with suppress(StoreError):
            repository = ObjectRepository.open(store, object_id, create=False)
            for name in repository.version_names():
                with suppress(StoreError):
                    catalogue = str(repository.version(name).metadata.get("catalogue", "")) or catalogue
        catalogues.setdefault(catalogue, []).append(object_id)
    return catalogues


def capture_provenance(work: CaptureContext) -> dict[str, Any]:
    """Return a capture's entry, all its parameters, the digests of its inputs, and what of it a person has edited."""
    edits = {} if work.edits is None else {"edits": work.edits.to_json()}
    if work.catalogue_entry is not None:
        edits["catalogue_entry"] = _entry_json(work.catalogue_entry)
    return edits | {
        "entry": _entry_json(work.capture),
        "parameters": work.parameters.model_dump(mode="json"),
        "inputs": {name: digest for name in INPUTS if (digest := work.digest(name))},
    }


def unedited_entry(recorded: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return a capture's entry as the catalogue gave it, as JSON values; None where a version records no entry.

    Older versions record the entry with its edits alone: of these, edited keys are left out, since nobody knows what
    the catalogue gave, and edited masks and marks lie in a cache that maintenance empties.

    recorded: what a version holds of a capture, see `capture_provenance`.
    """
    entry: dict[str, Any] | None = recorded.get("catalogue_entry") or recorded.get("entry")
    if entry is None or "catalogue_entry" in recorded:
        return entry
    changes = recorded.get("edits", {}).get("changes", {})
    return {key: value for key, value in entry.items() if EDITED_FIELDS.get(key, key) not in changes}


def _entry_json(capture: Capture) -> dict[str, Any]:
    return capture.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
