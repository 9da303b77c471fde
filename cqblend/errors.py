"""Everything cqblend raises.

One root, :class:`CqblendError`. Each error also subclasses the builtin a caller would expect, so ``except ValueError``
keeps working. Messages name the thing (edge 14, face 3), the number and the way out; what programs want to know stands
in attributes as well, so that nothing has to read a message. Imports nothing of cqblend.
"""

import inspect
import warnings
from dataclasses import dataclass
from typing import Any, Self


class CqblendError(Exception):
    """Root of all errors that cqblend raises.

    Attributes
    ----------
    message : str
        What is wrong, with the number and the way out, without the name of the shape.
    kind : str
        Which of the failures of its type it is, for programs, as ``"seam"`` or ``"spans"``; empty if the type says all.
    shape : str
        The edge or face that it is about, as messages name it: ``"edge 14"``; empty if it is about none.
    place : float or None
        Where on that shape: t, the fraction of the length of an edge or a rail, from 0 to 1.
    value : float or None
        The number at fault, in the unit that the message says.
    """

    def __init__(
        self,
        message: str = "",
        *,
        kind: str = "",
        shape: str = "",
        place: float | None = None,
        value: float | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.kind = kind
        self.shape = shape
        self.place = place
        self.value = value

    def __str__(self) -> str:
        return f"{self.shape}: {self.message}" if self.shape else self.message

    def with_details(self, *, shape: str = "", before: str = "", after: str = "") -> Self:
        """Return the same error, of the same type and with the same attributes, with more in its message.

        Parameters
        ----------
        shape : str
            The edge or face that it is about. One that it named so far becomes part of the message, as an edge of a
            face does.
        before, after : str
            What to put before and after the message.
        """
        inner = str(self) if shape or before else self.message
        error = type(self).__new__(type(self))
        error.__dict__.update(self.__dict__)
        error.message = f"{before}{inner}{after}"
        error.shape = shape or ("" if before else self.shape)
        error.args = (error.message,)
        return error


class InputError(CqblendError, ValueError):
    """An argument is of the wrong type, not a number, out of range, or contradicts another one."""


class OperandError(InputError, TypeError):
    """A spline is added to, or multiplied by, something that is no spline, number or vector of its dim."""


class SelectionError(CqblendError, ValueError):
    """An edge or face cannot be used: foreign to the solid, a seam, degenerate, smooth already, or not on two faces."""


class SizeError(CqblendError, ValueError):
    """The asked radius or width does not fit; the message says the largest that does, where that is known.

    Attributes
    ----------
    room : float
        Where a blend runs into something: for what share of its width there is room, as far as can be told; 0 if that
        is not known.
    """

    def __init__(
        self,
        message: str = "",
        *,
        kind: str = "",
        shape: str = "",
        place: float | None = None,
        value: float | None = None,
        room: float = 0.0,
    ) -> None:
        super().__init__(message, kind=kind, shape=shape, place=place, value=value)
        self.room = room


class DegreeError(CqblendError, ValueError):
    """The exact result has a degree that OCCT cannot hold (more than 25)."""


class GeometryError(CqblendError, ArithmeticError):
    """The geometry is singular or a solver did not converge; the message names the parameter."""


class TopologyError(CqblendError, RuntimeError):
    """The faces around the edge are arranged in a way the topology surgery cannot handle."""


class VerificationError(CqblendError, RuntimeError):
    """A result was computed but failed verification, and is withheld."""


@dataclass(frozen=True, slots=True)
class Failure:
    """Faces that could not be unrolled, by their numbers, and why."""

    faces: tuple[int, ...]
    error: CqblendError


class UnrollError(CqblendError, RuntimeError):
    """Some faces could not be unrolled; the message names them.

    Attributes
    ----------
    pattern : cqblend.Pattern or None
        Of the other faces, None if there are none.
    failures : tuple of Failure
        The numbers of the faces that could not be done, and the error of each.
    """

    def __init__(self, message: str, pattern: Any = None, failures: tuple[Failure, ...] = ()) -> None:
        super().__init__(message)
        self.pattern = pattern
        self.failures = failures


class UnsupportedError(CqblendError, NotImplementedError):
    """The option exists in the interface but is not built yet."""


class StepError(CqblendError, OSError):
    """A STEP file is missing, damaged, empty, or could not be written."""


class FileError(CqblendError, OSError):
    """A pattern or a picture could not be written."""


class InstallationError(CqblendError, ImportError):
    """The installation is broken; the message names the repair."""


class CqblendWarning(UserWarning):
    """Root of all warnings that cqblend gives."""


class FlatEndWarning(CqblendWarning):
    """A blend ends in a flat cap at a vertex; the message says where, why, and what helps."""


class DamagedFileWarning(CqblendWarning):
    """Some entities of a file are unusable, although the solids in it are whole; the message names the entities."""


class PatternWarning(CqblendWarning):
    """A pattern is sound, but not what its maker may expect: approximated, or without some of its seams."""


def warn(warning: CqblendWarning) -> None:
    """Give a warning, at the line of the caller's own code from which cqblend was called."""
    level, frame = 1, inspect.currentframe()
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "cqblend":
        level, frame = level + 1, frame.f_back
    warnings.warn(warning, stacklevel=level)


def shown(value: object) -> str:
    """Return a value as a message names it: in full if that is short and one line, else by its type."""
    try:
        text = repr(value)
    except Exception:  # noqa: BLE001  (of an object that cannot even be shown, a message names the type)
        text = ""
    return text if 0 < len(text) <= 40 and text.isprintable() else with_article(type(value).__name__)


def reason(error: BaseException) -> str:
    """Return what an exception that is not ours says, in one line, with its type."""
    try:
        said = " ".join(str(error).split())
    except Exception:  # noqa: BLE001  (as above)
        said = ""
    return f"{type(error).__name__}: {said}" if said else type(error).__name__


def with_article(noun: str) -> str:
    """Return a noun with "a" or "an" before it."""
    return f"{'an' if noun[0] in 'aeiouAEIOU' else 'a'} {noun}"
