"""Records of options that several functions share: collect them from a function's arguments, and show them in its help.

The options of a blend are those of a function, of a fluent method and of a command. Their names, defaults and
documentation stand in one dataclass; this module connects it with the signatures. Depends on the standard library only.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

RecordT = TypeVar("RecordT", bound="DataclassInstance")
FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])


def collect_options(record: type[RecordT], arguments: Mapping[str, Any]) -> RecordT:
    """Return a record of those arguments that are its fields; fields that are missing have their defaults.

    Parameters
    ----------
    record
        A dataclass.
    arguments
        Values by name: ``locals()`` at the start of a function, or ``vars()`` of a parsed command line.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass
    ... class Size:
    ...     width: float = 1.0
    ...     height: float = 1.0
    >>> def draw(path, width=1.0):
    ...     return collect_options(Size, locals())
    >>> draw("a.svg", width=3.0)
    Size(width=3.0, height=1.0)
    """
    names = [field.name for field in fields(record) if field.init]
    return record(**{name: arguments[name] for name in names if name in arguments})


def document_options(record: type[Any]) -> Callable[[FunctionT], FunctionT]:
    """Decorate a function so that its help shows the documentation of a record's fields among its parameters.

    In the function's docstring one line refers to the record, as ``... : the options of `BlendOptions```. What the
    record's docstring has under "Attributes" takes the place of that line.

    Parameters
    ----------
    record
        A dataclass with a docstring in NumPy's format.
    """

    def insert_documentation(function: FunctionT) -> FunctionT:
        if function.__doc__ and record.__doc__:  # there are none under ``python -OO``
            reference = f"... : the options of `{record.__name__}`"
            before, found, after = inspect.cleandoc(function.__doc__).partition(reference)
            if not found:
                raise ValueError(f"the docstring of {function.__qualname__} has no line {reference!r}")
            function.__doc__ = before + _extract_attributes(record.__doc__) + after
        return function

    return insert_documentation


def _extract_attributes(docstring: str) -> str:
    """Return the paragraphs under "Attributes" in a docstring in which that is the last section."""
    return inspect.cleandoc(docstring).partition("Attributes\n----------\n")[2]
