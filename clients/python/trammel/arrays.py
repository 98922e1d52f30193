"""Arguments as arrays: numbers, branches, and pandas frames read as files are, by the names of their columns."""

from __future__ import annotations

import re
from typing import Any, Dict, List, Optional, Sequence

import numpy as np
import numpy.typing as npt

from .errors import Usage

Floats = npt.NDArray[np.float64]

POSE = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
_JOINT = re.compile(r"q([0-9]+)_(deg|mm)")
_OTHER_POSITION = re.compile(r"[xyz](_(m|cm|in))?")
_ONE_FOR_ALL = {"tool_id": "tool", "payload_id": "payload", "temperature_c": "temperature_c"}


def floats(values: Any, argument: str) -> Floats:
    """Numbers; refused where that would lose something: masked, complex, words."""
    try:
        if isinstance(values, np.ma.MaskedArray) and np.any(values.mask):
            raise Usage(f"{argument}: some values are masked")
        if np.iscomplexobj(values):
            raise Usage(f"{argument}: complex numbers")
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise Usage(f"{argument}: {error}") from None


def branches(conf: Any) -> Optional[npt.NDArray[np.int32]]:
    """Whole numbers, one or one for each target."""
    if conf is None:
        return None
    values = floats(conf, "conf")
    if np.asarray(conf).dtype.kind not in "iuf" or not np.all(np.isfinite(values) & (values == np.round(values))):
        raise Usage("conf: whole numbers from 0 to 7 are needed, one or one for each target")
    return np.clip(values, -1, 2**30).astype(np.int32)  # beyond 7 is refused with its row


def whole(value: Any, argument: str, least: int = 0) -> int:
    """A whole number from `least`."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not least <= value < 2**63:
        raise Usage(f"{argument} is {value!r}: a whole number from {least} is needed")
    return int(value)


def one_each(column: str, values: Any, poses: int) -> List[str]:
    """A column of a file: `poses` values, or one that is the same for all."""
    if isinstance(values, str) or not hasattr(values, "__iter__"):
        return [str(values)] * poses
    listed = [str(value) for value in values]
    if len(listed) != poses:
        raise Usage(f"{column}: {len(listed)} values, {poses} are needed, one for each pose")
    return listed


class Frame:
    """A pandas frame, or a row of one. Names are read as in files: without regard to case and order."""

    def __init__(self, table: Any, argument: str) -> None:
        self._table = table if hasattr(table, "columns") else table.to_frame().T
        self._argument = argument
        self._columns: Dict[str, Any] = {}
        for name in self._table.columns:
            known = str(name).strip().lower()
            if known in self._columns:
                raise Usage(f"{argument}: two columns {known}")
            self._columns[known] = name

    @staticmethod
    def of(table: Any, argument: str) -> Optional["Frame"]:
        """None where it has no names: what is not a frame goes by position."""
        is_row = hasattr(table, "to_frame") and any(isinstance(name, str) for name in table.index)
        return Frame(table, argument) if hasattr(table, "columns") or is_row else None

    def _said(self) -> str:
        return f"the columns are {', '.join(self._columns)}"

    def _numbers(self, names: Sequence[str]) -> Floats:
        return floats(self._table[[self._columns[name] for name in names]].to_numpy(), self._argument)

    def joints(self, columns: Optional[Sequence[str]]) -> Optional[Floats]:
        """(N, n), deg, of rails mm; None where there are none. `columns`: what they are called for the robot, if known."""
        numbers = sorted(int(joint.group(1)) for joint in map(_JOINT.fullmatch, self._columns) if joint)
        if not numbers:
            return None
        wanted = columns or [f"q{j + 1}_mm" if f"q{j + 1}_mm" in self._columns else f"q{j + 1}_deg" for j in range(numbers[-1])]
        for name in wanted:
            if name not in self._columns:
                raise Usage(f"{self._argument}: missing column {name}; {self._said()}")
        if len(numbers) != len(wanted):
            raise Usage(f"{self._argument}: {len(numbers)} columns of joints, {len(wanted)} are needed; {self._said()}")
        return self._numbers(wanted)

    def needed_joints(self, columns: Optional[Sequence[str]]) -> Floats:
        """The same; raises `Usage` where there are none."""
        joints = self.joints(columns)
        if joints is None:
            raise Usage(f"{self._argument}: missing column q1_deg; {self._said()}")
        return joints

    def pose(self) -> Optional[Floats]:
        """(N, 7); None where no column is of a pose."""
        if {"status", "error_before_mm", "error_after_mm"} <= set(self._columns):
            raise Usage(f"{self._argument}: it is corrected already: correct the frame that it was made from")
        present = [name for name in POSE if name in self._columns]
        missing = [name for name in POSE if name not in self._columns]
        other = [name for name in self._columns if _OTHER_POSITION.fullmatch(name)]
        if not present and other:
            raise Usage(f"{self._argument}: column {other[0]} is no position in mm (x_mm, y_mm, z_mm); {self._said()}")
        if not present:
            return None
        if missing:
            raise Usage(f"{self._argument}: missing column {missing[0]}; {', '.join(POSE)} come all together or not at all")
        return self._numbers(POSE)

    def conf(self) -> Optional[npt.NDArray[np.int32]]:
        """(N,); None where there is no such column, or nothing in it."""
        if "conf" not in self._columns:
            return None
        values = self._table[self._columns["conf"]]
        return None if values.isna().all() else branches(values.to_numpy())

    def circumstances(self, given: Dict[str, Any]) -> Dict[str, Any]:
        """`tool`, `payload`, `directions`, `temperature_c`: as given, else what the columns say for all rows: those of one part."""
        said = dict(given)
        for column, argument in _ONE_FOR_ALL.items():
            value = self._same(column)
            if value is None:
                continue
            if given[argument] not in (None, "", value):
                raise Usage(f"{self._argument}: {argument} is {given[argument]!r}, but column {column} says {value!r}")
            said[argument] = value
        turns = self._turns()
        if turns and not given["directions"]:
            said["directions"] = [int(self._same(name) or 0) for name in turns]
        return said

    def parts(self, given: Dict[str, Any]) -> List[npt.NDArray[np.intp]]:
        """Positions of the rows that say the same `circumstances()`, which one call has in common."""
        said = [name for name in _ONE_FOR_ALL if name in self._columns] + ([] if given["directions"] else self._turns())
        if not said or len(self._table) < 2:
            return [np.arange(len(self._table))]
        numbers = self._table.groupby([self._columns[name] for name in said], sort=False, dropna=False).ngroup().to_numpy()
        return [np.flatnonzero(numbers == number) for number in range(numbers.max() + 1)]

    def _turns(self) -> List[str]:
        return sorted((name for name in self._columns if re.fullmatch(r"dir[0-9]+", name)), key=lambda name: int(name[3:]))

    def _same(self, column: str) -> Any:
        """Its value in the first row that has one; None where none has."""
        if column not in self._columns:
            return None
        found = self._table[self._columns[column]].dropna()
        return found.tolist()[0] if len(found) > 0 else None
