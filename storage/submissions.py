"""List the sub-folders of an inbox, each by itself: whatever is wrong with one does not hide the others."""

import os
import stat
from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import obstore

from glint.storage.catalogue.confinement import check_inside
from glint.storage.errors import GlintError, InputError, StoreError, StoreUnreachable
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from glint.storage.seals import digest_of

CATALOGUE = "catalogue.yaml"

File = tuple[str, int, str]
"""Path within the sub-folder, size in bytes, and entity tag."""
Contents = tuple[list[File], datetime]
"""The files of a sub-folder, and the time of its last change."""


@dataclass(frozen=True, slots=True)
class Submission:
    """A sub-folder: the digest of its files' names, sizes and entity tags, the time of its last change, and whether it
    has a catalogue of its own."""

    name: str
    digest: str
    changed: datetime
    has_catalogue: bool


def list_submissions(inbox: Location, allowed: Sequence[Location] = ()) -> tuple[list[Submission], dict[str, str]]:
    """List the sub-folders that hold files, by name, and the problems of those that cannot be listed.

    allowed: folders or prefixes that a sub-folder may be a link to.

    Raises:
        StoreError: the inbox cannot be listed.
    """
    submissions, problems = list[Submission](), dict[str, str]()
    listed = _listed_at_once(inbox) if inbox.local is None else None
    for name in sorted(folder_names(inbox) if listed is None else listed):
        try:
            folder = inbox.child(name)
            check_inside(folder, [inbox, *allowed], "the sub-folder")
            files, changed = _contents(folder) if listed is None else listed[name]
        except StoreUnreachable:
            raise
        except GlintError as error:
            problems[name] = str(error)
            continue
        if files:
            digest = digest_of(sorted(list(file) for file in files))
            submissions.append(Submission(name, digest, changed, any(path == CATALOGUE for path, *_ in files)))
    return submissions, problems


def folder_names(inbox: Location) -> list[str]:
    """Return the names of the sub-folders, without hidden ones.

    Raises:
        StoreError: the inbox cannot be listed.
    """
    with store_errors(inbox.uri, "listing the inbox"):
        if inbox.local is not None:
            names = [path.name for path in inbox.local.iterdir() if path.is_dir()]
        else:
            prefixes = obstore.list_with_delimiter(inbox.obstore())["common_prefixes"]
            names = [prefix.strip("/").rpartition("/")[2] for prefix in prefixes]
    return [name for name in names if not name.startswith(".")]


def _listed_at_once(inbox: Location) -> dict[str, Contents] | None:
    """Return what the sub-folders of a prefix hold by name, which takes one request for each thousand of files.

    None: they cannot be listed together, as when a key has an empty part.
    """
    try:
        files = _remote_files(inbox)
    except StoreUnreachable:
        raise
    except StoreError:
        return None
    folders = defaultdict[str, list[tuple[File, datetime]]](list)
    for (path, size, tag), changed in files:
        name, _, rest = path.partition("/")
        if rest and not name.startswith("."):
            folders[name].append(((rest, size, tag), changed))
    return {name: _with_newest(files) for name, files in folders.items()}


def _contents(folder: Location) -> Contents:
    return _with_newest(_remote_files(folder)) if folder.local is None else _local_files(folder.local)


def _remote_files(folder: Location) -> list[tuple[File, datetime]]:
    """Return the files below a prefix, and when each was written.

    Raises:
        StoreError: it cannot be listed.
    """
    with store_errors(folder.uri, "listing a sub-folder"):
        return [
            ((meta["path"], meta["size"], meta["e_tag"] or meta["last_modified"].isoformat()), meta["last_modified"])
            for page in obstore.list(folder.obstore())
            for meta in page
        ]


def _with_newest(files: list[tuple[File, datetime]]) -> Contents:
    """Return the files, and the time at which the newest was written."""
    return [file for file, _ in files], max((changed for _, changed in files), default=datetime.min.replace(tzinfo=UTC))


def _local_files(folder: Path) -> Contents:
    """Return the files below a folder, and the time at which one of them or of the folders was changed last.

    That is the time of the status, since copying often preserves the one of the content. Links to folders are not
    followed, and count as files.

    Raises:
        InputError: a folder cannot be read.
    """
    files = list[File]()
    try:
        changed = folder.stat().st_ctime
        for parent, folders, names in os.walk(folder, onerror=_raise_unless_gone):
            for path in (Path(parent, name) for name in (*folders, *names)):
                with suppress(FileNotFoundError):  # copying programs rename their files in the end
                    status = path.lstat()
                    is_link = stat.S_ISLNK(status.st_mode)
                    if is_link:
                        with suppress(OSError):  # it leads nowhere
                            status = path.stat()
                    changed = max(changed, status.st_ctime)
                    if is_link or not stat.S_ISDIR(status.st_mode):
                        # As obstore's entity tag: with another one, all finished sub-folders would run again.
                        tag = f'"{status.st_ino:x}-{max(status.st_mtime_ns // 1000, 0):x}-{status.st_size:x}"'
                        files.append((path.relative_to(folder).as_posix(), status.st_size, tag))
    except OSError as error:
        place = folder if error.filename is None else error.filename
        raise InputError(f"{place} cannot be read ({error.strerror})", "check its permissions") from error
    return files, datetime.fromtimestamp(changed, UTC)


def _raise_unless_gone(error: OSError) -> None:
    if not isinstance(error, FileNotFoundError):
        raise error
