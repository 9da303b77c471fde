"""Files that are written beside their place and put there in one step, whole or not at all.

Exists so that every kind of output keeps one promise: what was there before survives every failure, and nothing else is
left. Must not know what is written.
"""

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path as File

from cqblend.errors import FileError, InputError, reason, shown

UNFINISHED_PREFIX = ".cqblend"
"""With which the names of unfinished files begin; the number of the writing process follows."""


def check_target(path: object, suffixes: tuple[str, ...], what: str) -> File:
    """Return the path of a file that can be written, or replaced, as far as can be told before.

    Parameters
    ----------
    path
        A str or os.PathLike.
    suffixes
        One of which it must end with, in lower or upper case.
    what
        Is written, in the plural, for messages.

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
        raise InputError(f"a file has a path, {what}{suffixes[0]} for example, not {shown(path)}") from error
    if target.suffix.lower() not in suffixes:
        raise InputError(f"{what} are written to {', '.join(suffixes)}, not to {shown(target.name)}")
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
    """Give a new file to be written that takes the place of another one when it is whole.

    Where the target is a link, what it leads to is replaced.

    Raises
    ------
    OSError
        If the file system refuses.
    """
    target = target.resolve()
    if target.is_dir():
        raise IsADirectoryError(21, "Is a directory")
    part = target.with_name(f"{UNFINISHED_PREFIX}-{os.getpid()}-{secrets.token_hex(4)}{target.suffix}")
    try:
        yield part
        with part.open("rb+") as file:
            os.fsync(file.fileno())
        part.replace(target)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def remove_unfinished(folder: File, process: int) -> None:
    """Remove what a process that has died was about to write into a folder."""
    with suppress(OSError):
        for part in folder.glob(f"{UNFINISHED_PREFIX}-{process}-*"):
            part.unlink()
