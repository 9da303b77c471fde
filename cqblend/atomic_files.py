"""Writes files under a temporary name and renames them when they are whole, so that failures leave no broken file.

A file that was there before survives every failure, and no temporary file is left. Depends on errors only.
"""

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path as File

from cqblend.errors import FileError, InputError, reason, shown

UNFINISHED_PREFIX = ".cqblend"
"""Beginning of the names of unfinished files; the number of the process that writes them follows."""


def check_target(path: object, suffixes: tuple[str, ...], contents: str) -> File:
    """Return the path of a file that can be written, or replaced, as far as can be known before.

    Parameters
    ----------
    path
        A str or os.PathLike.
    suffixes
        Allowed endings, in lower or upper case.
    contents
        Name of what is written, in the plural, for messages.

    Raises
    ------
    InputError
        If it is no path, its suffix is not known, its folder does not exist, or it is a folder itself.
    FileError
        If the folder, or the file that is there, is protected.
    """
    try:
        target = File(os.fspath(path))  # type: ignore[call-overload]
    except Exception as error:
        raise InputError(f"a file has a path, {contents}{suffixes[0]} for example, not {shown(path)}") from error
    if target.suffix.lower() not in suffixes:
        raise InputError(f"{contents} are written to {', '.join(suffixes)}, not to {shown(target.name)}")
    try:
        if not target.parent.is_dir():
            raise InputError(f"{target}: the folder {target.parent} does not exist: make it first")
        if target.is_dir():
            raise InputError(f"{target} is a folder: name a file in it")
        exists = target.exists()
    except (OSError, ValueError) as error:
        raise InputError(f"{target} is no file name: {reason(error)}") from error
    if not os.access(target.parent, os.W_OK) or (exists and not os.access(target, os.W_OK)):
        raise FileError(f"{target} cannot be written: it is protected")
    return target


@contextmanager
def write_atomically(target: File) -> Iterator[File]:
    """Yield the path of a temporary file, which replaces the target when it is written.

    Where the target is a link, the file that it leads to is replaced.

    Raises
    ------
    OSError
        If the file system refuses.
    """
    target = target.resolve()
    if target.is_dir():
        raise IsADirectoryError(21, "Is a directory")
    temporary = target.with_name(f"{UNFINISHED_PREFIX}-{os.getpid()}-{secrets.token_hex(4)}{target.suffix}")
    try:
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        temporary.replace(target)
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def remove_unfinished(folder: File, process: int) -> None:
    """Remove the temporary files of a process that has died, given by its number, from a folder."""
    with suppress(OSError):
        for temporary in folder.glob(f"{UNFINISHED_PREFIX}-{process}-*"):
            temporary.unlink()


def make_folder(folder: File) -> None:
    """Make a folder, and those that it is in, unless it is there.

    Raises
    ------
    InputError
        If that is not possible.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"the folder {folder} cannot be made: {error.strerror}") from error
