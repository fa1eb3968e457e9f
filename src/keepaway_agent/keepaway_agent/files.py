"""Files that appear whole or not at all, and are never lost, on any file system.

A file is written beside its place, under a hidden name that ends in `.tmp`, and moved there once it
is on the disk: a writer that is killed leaves the old file or the new one, never half of one. A
file that cannot be moved into its place stays beside it, and the error names that place.
"""

import contextlib
import errno
import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final

from keepaway_agent.errors import AgentError

NO_LINKS: Final = frozenset(
    (errno.EPERM, errno.EACCES, errno.EMLINK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP)
)
"""How file systems without hard links refuse one (exFAT: EPERM; SMB and FUSE: others of these)."""


@contextlib.contextmanager
def moved_into_place(path: Path, overwrite: bool = False) -> Iterator[BinaryIO]:
    """A file to write, that appears at `path` when the block ends without an error.

    Args:
        path: where; its folder exists.
        overwrite: whether a file that is there is replaced.

    Raises:
        FileExistsError: there is a file, and `overwrite` was not asked for.
        OSError: it cannot be written, or not moved into its place; then the message has the name
            under which the whole file was kept.
    """
    beside = name_beside(path)
    try:
        with beside.open("xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
    try:
        beside.replace(path) if overwrite else _move_without_replacing(beside, path)
    except FileExistsError:
        beside.unlink()
        raise
    except OSError as error:
        raise OSError(error.errno, f"{error.strerror}; what was written is {beside}") from error
    _sync_folder(path.parent)


def write_whole(path: Path, text: str) -> None:
    """Write a text file, or replace it, in one step."""
    with moved_into_place(path, overwrite=True) as file:
        file.write(text.encode())


def path_within(folder: Path, asked: str) -> Path:
    """The path of a file in a folder; relative ones are taken from there.

    Raises:
        AgentError: it is elsewhere.
    """
    inside = folder.resolve()
    path = (inside / asked).resolve()
    if not path.is_relative_to(inside):
        raise AgentError(f"{asked} is not in {inside}: set weights_dir to a folder above it")
    return path


def name_beside(path: Path) -> Path:
    """A name beside `path` that nothing else has, for what is not whole yet."""
    return path.with_name(f".{path.name[:50]}.{os.getpid()}.{secrets.token_hex(4)}.tmp")


def check_writable(folder: Path) -> None:
    """Make the folder if it is missing, and see that files can be made in it.

    Raises:
        OSError: they cannot.
    """
    folder.mkdir(parents=True, exist_ok=True)
    probe = name_beside(folder / "probe")
    probe.touch(exist_ok=False)
    probe.unlink()


def _move_without_replacing(beside: Path, path: Path) -> None:
    """Move, but fail with FileExistsError where there is a file."""
    try:
        path.hardlink_to(beside)  # fails if there is a file, which a move does not
    except FileExistsError:
        raise
    except OSError as error:
        if error.errno not in NO_LINKS:
            raise
        _move_onto_own_place(beside, path)
    else:
        beside.unlink()


def _move_onto_own_place(beside: Path, path: Path) -> None:
    """The same without hard links: reserve the name with an empty file, and move onto that."""
    path.touch(exist_ok=False)
    try:
        beside.replace(path)
    except OSError:
        path.unlink()  # the empty file made above
        raise


def _sync_folder(folder: Path) -> None:
    """Wait until a folder's new entry is on the disk, where the file system can do that."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
