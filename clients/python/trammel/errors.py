"""What goes wrong, as exceptions that are data: `except Refused as error: error.file, error.row, error.limit`."""

from __future__ import annotations

from typing import Any, List, Mapping, Optional, Sequence

__all__ = [
    "TrammelError", "Usage", "Refused", "NotFound", "Conflict", "TooLarge", "Busy", "Unreachable", "Internal",
]


class TrammelError(Exception):
    """Anything that Trammel expects to go wrong. `str()` is the sentence for people; the rest is for programs.

    Members that are not known are empty or None. `value` and `limit` are in the unit of `column` (mm, deg).
    """

    code: str = "internal"  #: `usage refused not_found conflict too_large busy unreachable internal`

    def __init__(self, sentence: str, data: Optional[Mapping[str, Any]] = None) -> None:
        super().__init__(sentence, data)
        known: Mapping[str, Any] = data or {}
        self.message: str = known.get("message", sentence)  #: one clause that says what, with value and limit
        self.file: str = known.get("file", "")  #: path or id of what was read: a file, a batch, a model
        self.row: Optional[int] = known.get("row")  #: line of the file, from 1; of an array the index, from 0
        self.column: str = known.get("column", "")  #: column, key or argument
        self.value: Optional[float] = known.get("value")  #: as given
        self.limit: Optional[float] = known.get("limit")  #: the limit that was broken
        self.text: str = known.get("text", "")  #: the value as given, where it is a word
        self.next: str = known.get("next", "")  #: what to do about it
        #: what else is wrong, found in the same reading
        self.also: List[TrammelError] = [exception_of(other) for other in known.get("also", [])]

    def __str__(self) -> str:
        return str(self.args[0])

    def seen_in(self, rows: Sequence[int]) -> TrammelError:
        """The same of a whole of which `rows` were asked."""
        if self.row is None or not 0 <= self.row < len(rows):
            return self
        row = int(rows[self.row])
        sentence = str(self).replace(f"row {self.row}", f"row {row}", 1)
        return type(self)(sentence, {**(self.args[1] or {}), "row": row})


class Usage(TrammelError):
    """Something was asked for that does not exist, or an argument has the wrong shape."""

    code = "usage"


class Refused(TrammelError):
    """Data that must not be used: a bad row, an unknown tool, an ill-conditioned fit."""

    code = "refused"


class NotFound(TrammelError):
    """An unknown cell, model or job."""

    code = "not_found"


class Conflict(TrammelError):
    """The same id with other content, or a second writer."""

    code = "conflict"


class TooLarge(TrammelError):
    """Over a stated limit."""

    code = "too_large"


class Busy(TrammelError):
    """A bounded queue is full: try again."""

    code = "busy"


class Unreachable(TrammelError):
    """No service answered in time."""

    code = "unreachable"


class Internal(TrammelError):
    """The disk, the database, a corrupt file of Trammel's own."""

    code = "internal"


_KINDS = {kind.code: kind for kind in (Usage, Refused, NotFound, Conflict, TooLarge, Busy, Unreachable, Internal)}


def exception_of(data: Mapping[str, Any]) -> TrammelError:
    """The exception that fits the code in `data`."""
    return _KINDS.get(data["code"], Internal)(data["sentence"], data)
