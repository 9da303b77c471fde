"""The error by which a fit of a blend's rails or interior reports that it needs more spans than are allowed.

It is a class of its own because callers catch it and try a looser tolerance.
"""

from cqblend.errors import GeometryError


class TooManySpansError(GeometryError):
    """A fit within a tolerance takes more spans than are allowed: what was found, and what helps.

    Attributes
    ----------
    finding : str
        What was found, without the advice.
    """

    def __init__(self, finding: str, advice: str) -> None:
        super().__init__(f"{finding}: {advice}", kind="spans")
        self.finding = finding
