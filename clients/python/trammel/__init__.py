"""Trammel: an industrial robot lands where it was told to.

Offline, on files:  `Cell`, `Batch`, `Model`, `train`, `diagnose`, `extend`, `plan`, `simulate`, `history`.
A running service:  `Session`.
What goes wrong:    `TrammelError` and its kinds, with code, file, row, column, value and limit.

Lengths are mm and angles deg, as in files; joints of rails are mm. Frames: B is the robot's base, T the tool. Poses are
X_BT in rows of seven: `x_mm, y_mm, z_mm, qw, qx, qy, qz` (unit quaternion, Hamilton, active). N is a number of poses, n
the robot's number of joints. Work runs without the interpreter's lock; values may be shared by threads.
"""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import os
from typing import TYPE_CHECKING, Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple, TypeVar, Union

import numpy as np
import numpy.typing as npt

from . import _trammel
from .arrays import POSE, Floats, Frame, branches, floats, one_each, whole
from .errors import (Busy, Conflict, Internal, NotFound, Refused, TooLarge, TrammelError, Unreachable, Usage)

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "Batch", "Busy", "Cell", "Conflict", "CorrectedProgram", "Corrections", "Extension", "Internal", "Model", "NotFound", "Plan",
    "Predictions", "Refused", "Residuals", "Session", "TooLarge", "TrammelError", "Unreachable", "Usage", "__version__", "diagnose",
    "extend", "history", "plan", "simulate", "train",
]

__version__: str = _trammel.version


def __dir__() -> List[str]:
    """The names that are meant for users."""
    return sorted(__all__)


Path = Union[str, "os.PathLike[str]"]
Progress = Callable[[str, float], object]  #: told what is being done and the share done, [0, 1]; may raise to give up

_NAMES = ("pose_id", "tool_id", "payload_id", "session_id", "set", "anchor_id", "minus_pose_id", "from_pose_id")  #: columns of a batch that hold words

Table = Union[npt.ArrayLike, "pd.DataFrame"]  #: an array, or a pandas frame with the columns of a file


def _frame(columns: Mapping[str, Any]) -> "pd.DataFrame":
    import pandas

    return pandas.DataFrame(dict(columns))


def _asked_poses(joints_deg: Table, columns: Optional[Sequence[str]], **context: Any) -> Tuple[Any, ...]:
    """Joints as an array, then tool, payload, directions and temperature; a frame may say them in its columns."""
    frame = Frame.of(joints_deg, "joints_deg")
    if frame is not None:
        context = frame.circumstances(context)
    joints = floats(joints_deg, "joints_deg") if frame is None else frame.needed_joints(columns)
    return (joints, *_in_order(context))


def _asked_targets(pose: Optional[Table], joints_deg: Optional[Table], conf: Optional[npt.ArrayLike],
                   columns: Optional[Sequence[str]], **context: Any) -> Tuple[Any, ...]:
    """Poses, joints and branches as arrays, then the same; a frame of targets may hold all of it."""
    targets, near = Frame.of(pose, "pose"), Frame.of(joints_deg, "joints_deg")
    joints = None if joints_deg is None else floats(joints_deg, "joints_deg") if near is None else near.needed_joints(columns)
    said = targets or near
    if said is not None:
        context = said.circumstances(context)
    if targets is None:
        return (None if pose is None else floats(pose, "pose"), joints, branches(conf), *_in_order(context))
    wanted = targets.pose()
    joints = targets.joints(columns) if joints is None else joints
    if wanted is None and joints is None:
        raise Usage(f"pose: neither a pose ({', '.join(POSE)}) nor joints (q1_deg ...) among its columns")
    return (wanted, joints, targets.conf() if conf is None else branches(conf), *_in_order(context))


def _with_circumstances(pose: Optional[Table], joints_deg: Optional[Table]) -> Tuple[Optional[Table], str]:
    """The frame whose columns say them, and its argument."""
    return (joints_deg, "joints_deg") if Frame.of(pose, "pose") is None else (pose, "pose")


Answer = TypeVar("Answer", "Predictions", "Corrections")


def _in_parts(table: Optional[Table], argument: str, given: Dict[str, Any],
              ask: Callable[[Callable[..., Any]], Answer]) -> Answer:
    """Of a frame whose rows differ in tool, payload, approach or temperature: what `ask` says of each part of it, in the
    order of its rows. `ask` is handed what takes the part of an argument."""
    frame = Frame.of(table, argument)
    parts = [] if frame is None else frame.parts(given)
    if len(parts) < 2:
        return ask(lambda values, least=1: values)
    order = np.concatenate(parts)
    answers = []
    for rows in parts:
        try:
            answers.append(ask(_taking(rows, len(order))))
        except TrammelError as error:
            raise error.seen_in(rows.tolist()) from None
    return _joined(answers, np.argsort(order))


def _taking(rows: npt.NDArray[np.intp], whole_length: int) -> Callable[..., Any]:
    """Takes `rows` of a value that has as many as the whole; what is one for all stays."""
    def of_part(values: Any, least: int = 1) -> Any:
        if values is None or np.ndim(values) < least or len(values) != whole_length:
            return values
        return values.iloc[rows] if hasattr(values, "iloc") else np.asarray(values)[rows]

    return of_part


def _joined(answers: Sequence[Answer], order: npt.NDArray[np.intp]) -> Answer:
    def joined(name: str) -> Any:
        values = [getattr(answer, name) for answer in answers]
        if name == "joint_columns":
            return values[0]
        if isinstance(values[0], np.ndarray):
            return np.concatenate(values)[order]
        flat = [item for value in values for item in value]
        return [flat[k] for k in order]

    return dataclasses.replace(answers[0], **{field.name: joined(field.name) for field in dataclasses.fields(answers[0])})


def _in_order(context: Mapping[str, Any]) -> Tuple[str, str, List[int], Optional[float]]:
    return context["tool"], context["payload"], list(context["directions"]), context["temperature_c"]


def _column_by_column(names: Sequence[str], table: Floats) -> Dict[str, Any]:
    return {name: table[:, k] for k, name in enumerate(names)}


@dataclasses.dataclass(frozen=True)
class Predictions:
    """The errors to expect at N poses; all vectors in B."""

    nominal: Floats  #: (N, 7): X_BT, where the controller believes the tool to be; mm and quaternion
    predicted: Floats  #: (N, 7): X_BT, where it will be
    error_mm: Floats  #: (N, 3): predicted - nominal
    stddev_mm: Floats  #: (N, 3): of one measurement of it, the instrument's noise included
    true_stddev_mm: Floats  #: (N, 3): of the true error
    covariance_mm2: Floats  #: (N, 3, 3): of one measurement
    rotation_deg: Floats  #: (N, 3): rotation vector from nominal to predicted
    rotation_stddev_deg: Floats  #: (N, 3): of one measured orientation; NaN where none was learned
    in_domain: npt.NDArray[np.bool_]  #: (N,): False where the learned bias is not fully taken
    bias_share: Floats  #: (N,): of the learned bias that is taken

    def __len__(self) -> int:
        return len(self.error_mm)

    def frame(self) -> "pd.DataFrame":
        """A pandas frame with the columns of `trammel predict`: `dx_mm ... sz_mm, in_domain`, the predicted pose."""
        return _frame({**_column_by_column(("dx_mm", "dy_mm", "dz_mm"), self.error_mm),
                       **_column_by_column(("sx_mm", "sy_mm", "sz_mm"), self.stddev_mm),
                       "in_domain": self.in_domain, **_column_by_column(POSE, self.predicted)})


@dataclasses.dataclass(frozen=True)
class Corrections:
    """What to command so that the tool lands on each of N targets."""

    status: List[str]  #: N of `ok out_of_domain joint_limit unreachable singular not_converged refused`
    pose: Floats  #: (N, 7): X_BT to command; of a target that is neither ok nor out of domain the wanted one
    joints_deg: Floats  #: (N, n): the controller's joints for it; of rails mm; NaN where there are none
    error_before_mm: Floats  #: (N,): rms distance to expect without correction; NaN: nothing to say
    error_after_mm: Floats  #: (N,): the same with it
    sigma_mm: Floats  #: (N,): stddev of the true position, rms of the axes
    sigma_measured_mm: Floats  #: (N,): the same of one measurement, the instrument's noise included
    turn_before_deg: Floats  #: (N,): orientation error to expect without correction
    turn_after_deg: Floats  #: (N,): the same with it
    iterations: npt.NDArray[np.int32]  #: (N,)
    message: List[str]  #: N: why it is not ok
    joint_columns: Optional[List[str]] = None  #: n names in files, `q1_deg` or of a rail `q1_mm`; None: of a service

    def __len__(self) -> int:
        return len(self.status)

    def frame(self) -> "pd.DataFrame":
        """A pandas frame with the columns of `trammel correct`."""
        joints = self.joint_columns or [f"q{j + 1}_deg" for j in range(self.joints_deg.shape[1])]
        return _frame({"status": self.status, **_column_by_column(POSE, self.pose),
                       **_column_by_column(joints, self.joints_deg), "error_before_mm": self.error_before_mm,
                       "error_after_mm": self.error_after_mm, "sigma_mm": self.sigma_mm, "message": self.message})


@dataclasses.dataclass(frozen=True)
class Residuals:
    """What is left of N measured poses, measured - predicted; vectors in B."""

    pose_id: List[str]  #: N
    nominal_mm: Floats  #: (N, 3): against the robot as drawn
    calibrated_mm: Floats  #: (N, 3): with the identified parameters
    compensated_mm: Floats  #: (N, 3): with the learned bias, too
    stddev_mm: Floats  #: (N, 3): as predicted, of compensated
    in_domain: npt.NDArray[np.bool_]  #: (N,)

    def __len__(self) -> int:
        return len(self.pose_id)

    def frame(self) -> "pd.DataFrame":
        """A pandas frame, a row a pose: `pose_id`, `dx_mm dy_mm dz_mm` that are left, and the length at each level."""
        lengths = {f"{level}_mm": np.linalg.norm(getattr(self, f"{level}_mm"), axis=1)
                   for level in ("nominal", "calibrated", "compensated")}
        return _frame({"pose_id": self.pose_id, **_column_by_column(("dx_mm", "dy_mm", "dz_mm"), self.compensated_mm),
                       **lengths, "in_domain": self.in_domain})


@dataclasses.dataclass(frozen=True)
class CorrectedProgram:
    """A robot program with corrected targets; all other bytes are as they were."""

    files: Dict[str, bytes]  #: by name
    receipt_csv: str  #: a row for each target, as `trammel correct --receipt` writes it
    receipt: Dict[str, Any]  #: the same as data, with the keys of `trammel correct --json`
    complete: bool  #: every target is corrected

    def frame(self) -> "pd.DataFrame":
        """The receipt as a pandas frame."""
        import pandas

        return pandas.read_csv(io.StringIO(self.receipt_csv))


@dataclasses.dataclass(frozen=True)
class Plan:
    """N poses to measure."""

    pose_ids: List[str]  #: N
    joints_deg: Floats  #: (N, n); of rails mm
    csv: str  #: the text that `trammel plan -o` writes

    def __len__(self) -> int:
        return len(self.pose_ids)


class Cell:
    """A cell as its file describes it: the robot, its base, tools, payloads and tracker. Immutable."""

    def __init__(self, inside: _trammel.Cell) -> None:
        self._inside = inside

    @staticmethod
    def load(path: Path) -> "Cell":
        """Reads a cell file (YAML) and the robot file that it names. Raises `Refused` with file, row and key."""
        return Cell(_trammel.Cell.load(os.fspath(path)))

    @property
    def name(self) -> str:
        """Its name."""
        return self._inside.name()

    @property
    def robot(self) -> str:
        """Name of its robot."""
        return self._inside.robot()

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return self._inside.joints()

    @property
    def tools(self) -> List[str]:
        """Ids of its tools."""
        return self._inside.tools()

    @property
    def payloads(self) -> List[str]:
        """Ids of its payloads."""
        return self._inside.payloads()

    def tool_poses(self, joints_deg: Table, tool: str = "") -> Floats:
        """(N, 7): X_BT, where the nominal robot has the tool; no model is needed. `joints_deg` (N, n) or (n,), deg, of rails
        mm. `tool`: empty: the cell's only one; `flange`: none."""
        frame = Frame.of(joints_deg, "joints_deg")
        joints = floats(joints_deg, "joints_deg") if frame is None else frame.needed_joints(self._inside.joint_columns())
        return self._inside.tool_poses(joints, tool)

    def __repr__(self) -> str:
        return f"<Cell {self.name}: {self.robot}, {self.joints} joints>"


class Batch:
    """Measurements taken together: commanded joints and measured tool positions. Immutable."""

    def __init__(self, inside: _trammel.Batch) -> None:
        self._inside = inside

    @staticmethod
    def load(path: Path) -> "Batch":
        """Reads a batch file: our CSV, or RoboDK's."""
        return Batch(_trammel.Batch.load(os.fspath(path)))

    @staticmethod
    def parse(csv: str, name: str) -> "Batch":
        """The same from a text; `name` becomes its id."""
        return Batch(_trammel.Batch.parse(csv, name))

    @staticmethod
    def from_arrays(joints_deg: npt.ArrayLike, position_mm: npt.ArrayLike, name: str = "batch",
                    orientation: Optional[npt.ArrayLike] = None, rails: Sequence[int] = (),
                    **columns: Union[Sequence[object], npt.ArrayLike]) -> "Batch":
        """From arrays: `joints_deg` (N, n) as commanded, `position_mm` (N, 3) measured in W or B, `orientation` (N, 4)
        unit quaternions `qw, qx, qy, qz`. `rails`: the numbers, from 1, of the joints that are rails; theirs are mm. More
        columns of a batch file come by their names, N values or one for all: `pose_id=..., sigma_mm=...,
        temperature_c=..., session_id=...`."""
        joints = floats(joints_deg, "joints_deg")
        position = floats(position_mm, "position_mm")
        if joints.ndim != 2 or position.shape != (len(joints), 3):
            raise Usage(f"joints_deg {joints.shape} and position_mm {position.shape}: (N, n) and (N, 3) are needed")
        parts = [joints, position]
        wrong = [rail for rail in rails if not 1 <= rail <= joints.shape[1]]
        if wrong:
            raise Usage(f"rails: joint {wrong[0]} of 1 to {joints.shape[1]}")
        names = [f"q{j}_mm" if j in rails else f"q{j}_deg" for j in range(1, joints.shape[1] + 1)] + ["x_mm", "y_mm", "z_mm"]
        if orientation is not None:
            turned = floats(orientation, "orientation")
            if turned.shape != (len(joints), 4):
                raise Usage(f"orientation {turned.shape}: (N, 4) is needed")
            parts.append(turned)
            names += ["qw", "qx", "qy", "qz"]
        more = [one_each(column, values, len(joints)) for column, values in columns.items()]
        text = io.StringIO()
        table = csv.writer(text, lineterminator="\n")
        table.writerow([*names, *columns])
        for i, row in enumerate(np.hstack(parts)):
            table.writerow([*(repr(float(value)) for value in row), *(values[i] for values in more)])
        return Batch.parse(text.getvalue(), name)

    @staticmethod
    def from_frame(frame: "pd.DataFrame", name: str = "batch") -> "Batch":
        """From a pandas frame with the columns of a batch file: `q1_deg ... qn_deg, x_mm, y_mm, z_mm` and more."""
        return Batch.parse(frame.to_csv(index=False), name)

    @property
    def name(self) -> str:
        """Its id."""
        return self._inside.name()

    def __len__(self) -> int:
        return self._inside.size()

    def __repr__(self) -> str:
        return f"<Batch {self.name}: {len(self)} poses>"

    def csv(self) -> str:
        """Its text as it came."""
        return self._inside.csv()

    def frame(self) -> "pd.DataFrame":
        """As a pandas frame with the columns of a batch file."""
        import pandas

        return pandas.read_csv(io.StringIO(self._inside.table()), dtype={name: str for name in _NAMES})


Batches = Union[Batch, Sequence[Batch]]  #: several are sessions of one arm


def _wrong_kind(argument: str, value: object, needed: str) -> Usage:
    return Usage(f"{argument} is of type {type(value).__name__}: {needed} is needed")


def _inside_cell(cell: Cell) -> _trammel.Cell:
    if not isinstance(cell, Cell):
        raise _wrong_kind("cell", cell, "a Cell (Cell.load(path))")
    return cell._inside


def _inside_of(batches: Batches) -> List[_trammel.Batch]:
    several: Any = [batches] if isinstance(batches, Batch) else batches
    if isinstance(several, str) or not hasattr(several, "__iter__") or not all(isinstance(one, Batch) for one in several):
        raise _wrong_kind("batches", batches, "a Batch (Batch.load(path)) or a list of them")
    return [one._inside for one in several]


def _id_and_text(batch: Union[Batch, str]) -> Tuple[str, str]:
    """What names a batch to a service: the id of a stored one, or measurements."""
    if isinstance(batch, str):
        return batch, ""
    if not isinstance(batch, Batch):
        raise _wrong_kind("batch", batch, "a Batch (Batch.load(path)) or the id of a stored one")
    return "", batch.csv()


class Model:
    """Nominal chain, identified error sources and learned bias. Immutable."""

    def __init__(self, inside: _trammel.Model) -> None:
        self._inside = inside
        self._joint_columns = inside.cell().joint_columns()

    @staticmethod
    def load(path: Path) -> "Model":
        """Reads a model file. Raises `Refused` where its hash does not fit its content."""
        return Model(_trammel.Model.load(os.fspath(path)))

    @staticmethod
    def parse(text: str, where: str = "model") -> "Model":
        """The same from its text, as `Session.export_model()` returns it; `where` names it in errors."""
        return Model(_trammel.Model.parse(text, where))

    def save(self, path: Path) -> None:
        """Writes the model file, whole or not at all."""
        self._inside.save(os.fspath(path))

    def text(self) -> str:
        """The text of the model file."""
        return self._inside.text()

    @property
    def id(self) -> str:
        """First 12 characters of the hash of its content."""
        return str(self.facts["id"])

    @property
    def facts(self) -> Dict[str, Any]:
        """`id hash cell level batch training_poses notes budget`; `budget`: its first lines for people."""
        return self._inside.facts()

    @property
    def cell(self) -> Cell:
        """The cell that it was trained for."""
        return Cell(self._inside.cell())

    @property
    def bias(self) -> str:
        """The kernel of its bias; `none` without."""
        return self._inside.bias()

    @property
    def parameters(self) -> List[Dict[str, Any]]:
        """P dictionaries `name unit value u95 identified`; u95 is U(k=2)."""
        return self._inside.parameters()

    @property
    def parameter_covariance(self) -> Floats:
        """(P, P), in the products of the parameters' units."""
        return self._inside.parameter_covariance()

    @property
    def figures(self) -> Dict[str, Any]:
        """Errors on poses held out from training, else on the training poses, as `evaluate()` returns them."""
        return self._inside.figures()

    @property
    def measured(self) -> Dict[str, Any]:
        """What its training poses were, as `measured` of `trammel train --json`: a promise is about these."""
        return self._inside.measured()

    def budget(self) -> Optional[Dict[str, Any]]:
        """Where the millimetres come from, as `budget` of `trammel train --json`: `nominal_rms_mm`, `lines` (each with
        `line`, `value`, `u95`, `unit`, `alone_rms_mm`, `share`, `action`, ...), `poses`, `beyond_frames`, `sentences` for people. None where
        no training pose has a position."""
        found: Optional[Dict[str, Any]] = json.loads(self._inside.budget_json())
        return found

    @property
    def notes(self) -> List[Dict[str, Any]]:
        """What a user of the model should know, the gravest first: `code`, `severity` (`info`, `warning`, `stop`), `text`."""
        return self._inside.notes()

    def predict(self, joints_deg: Table, tool: str = "", payload: str = "", directions: Sequence[int] = (),
                temperature_c: Optional[float] = None) -> Predictions:
        """The error to expect at `joints_deg` (N, n) or (n,), deg, of rails mm; or a pandas frame with `q1_deg ...`.

        `tool`, `payload`: ids of the cell; empty: its only one. `directions`: from which each joint is approached,
        n of -1, 0, +1. Raises `Refused` with the row of a pose beyond the limits.
        """
        given = {"tool": tool, "payload": payload, "directions": directions, "temperature_c": temperature_c}
        return _in_parts(joints_deg, "joints_deg", given, lambda of_part: Predictions(
            **self._inside.predict(*_asked_poses(of_part(joints_deg, 2), self._joint_columns, **given))))

    def correct(self, pose: Optional[Table] = None, joints_deg: Optional[Table] = None,
                conf: Optional[npt.ArrayLike] = None, tool: str = "", payload: str = "",
                directions: Sequence[int] = (), temperature_c: Optional[float] = None) -> Corrections:
        """What to command so that the tool lands on each target.

        `pose` (N, 7): X_BT wanted, mm and quaternion. The branch is said by `conf` (N,) or one for all (0..7: +4 wrist
        behind axis 1, +2 behind the lower arm, +1 joint 5 negative) or by `joints_deg` (N, n) near it, deg, of rails mm.
        Without `pose` the nominal poses at `joints_deg` are wanted. `pose` may be a pandas frame with the columns of a file
        of targets: the pose, joints, `conf`. A target that cannot be corrected says so in its status.
        """
        given = {"tool": tool, "payload": payload, "directions": directions, "temperature_c": temperature_c}
        return _in_parts(*_with_circumstances(pose, joints_deg), given, lambda of_part: Corrections(
            **self._inside.correct(*_asked_targets(of_part(pose, 2), of_part(joints_deg, 2), of_part(conf),
                                                   self._joint_columns, **given)), joint_columns=self._joint_columns))

    def __repr__(self) -> str:
        return f"<Model {self.id} of {self.facts['cell']}: {self.facts['level']}, bias {self.bias}>"

    def evaluate(self, batches: Batches) -> Dict[str, Any]:
        """Measured against predicted, with the keys of `trammel evaluate --json`; mm and deg."""
        return self._inside.evaluate(_inside_of(batches))

    def residuals(self, batches: Batches) -> "Residuals":
        """What is left of each measured pose, as `trammel evaluate --residuals` writes it."""
        return Residuals(**self._inside.residuals(_inside_of(batches)))

    def check(self, batch: Batch, tolerance_mm: Optional[float] = None, new_tool: bool = False,
              earlier: Sequence[Mapping[str, Any]] = ()) -> Dict[str, Any]:
        """Whether the robot is still the one that the model was trained on, by a few poses, with the keys of
        `trammel check --json`. `earlier`: what earlier checks of this robot returned; the next one is due by all of them."""
        told = [json.dumps(dict(one)) for one in earlier]
        found: Dict[str, Any] = json.loads(self._inside.check(_inside_of(batch)[0], tolerance_mm, new_tool, told))
        return found

    def report(self, path: Optional[Path] = None, batches: Optional[Batches] = None) -> str:
        """The model's page, as `trammel report` writes it: HTML that opens without a network; written to `path` where one is
        given. `batches`: fresh measurements to compare the model with."""
        page = self._inside.report([] if batches is None else _inside_of(batches))
        if path is not None:
            with open(path, "w", encoding="utf-8") as file:
                file.write(page)
        return page

    def correct_program(self, files: Union[Path, Sequence[Path]], output: Optional[Path] = None, format: str = "", tool: str = "",
                        payload: str = "", keep_digits: bool = False) -> "CorrectedProgram":
        """Corrects a robot program of one or more files as `trammel correct` does; `output`: the folder to write it into.
        `format`: the dialect, where the ending does not tell it."""
        paths = [files] if isinstance(files, (str, os.PathLike)) else list(files)
        program = []
        for path in paths:
            with open(path, "rb") as file:
                program.append((os.path.basename(os.fspath(path)), file.read()))
        corrected, receipt, told, whole_ = self._inside.correct_program(program, format, tool, payload, keep_digits)
        if output is not None:
            os.makedirs(output, exist_ok=True)
            for name, text in corrected:
                target = os.path.join(output, name)
                if any(os.path.exists(target) and os.path.samefile(target, path) for path in paths):
                    raise Usage(f"output: {target} is the program itself")
                with open(target, "wb") as file:
                    file.write(text)
        return CorrectedProgram(dict(corrected), receipt, json.loads(told), whole_)


def train(cell: Cell, batches: Batches, level: Optional[str] = None, bias: Optional[str] = None, seed: int = 1,
          validation_share: float = 0.0, progress: Optional[Progress] = None, as_read: bool = False,
          fleet: Sequence[Model] = ()) -> Model:
    """A model of `cell`. `level` (`M0` to `M3`, `M2,gear_transmission:3`) and `bias` (`none`, `auto`, a kernel) instead
    of what the cell file says; `validation_share` of the rows are held out where the batch has no column `set`. A
    batch that was read wrongly or in the middle of which something changed is refused, unless `as_read`: then the
    model's notes tell it. `fleet`: models of robots of the same type, at least three; what they have in common is
    expected of this one. A cell with `prior: fleet` needs them."""
    return Model(_trammel.train(_inside_cell(cell), _inside_of(batches), level, bias, whole(seed, "seed"), validation_share,
                                progress, as_read, [twin._inside for twin in fleet]))


def diagnose(cell: Cell, batches: Batches, seed: int = 1, progress: Optional[Progress] = None) -> Dict[str, Any]:
    """What the cell's model lacks, with the keys of `trammel diagnose --json`."""
    found: Dict[str, Any] = json.loads(_trammel.diagnose(_inside_cell(cell), _inside_of(batches), whole(seed, "seed"), progress))
    return found


class Extension(NamedTuple):
    """What extending a cell by what a diagnosis found is worth."""

    findings: Dict[str, Any]  # as `diagnose()` returns them
    model: Optional[Model]  # the extended model; None where it is not to be applied
    error_sources: List[str]  # of it, those that belong into the cell file
    why_not: str  # why nothing is applied, in the words of every door; empty: apply it


def extend(cell: Cell, batches: Batches, seed: int = 1, progress: Optional[Progress] = None) -> Extension:
    """What `trammel diagnose --apply` does, without writing anything: some rows are set aside before the batch is looked at,
    the cell is extended by what is found, and the model is one to apply where a service would put it in force."""
    findings, model, error_sources, why_not = _trammel.extend(_inside_cell(cell), _inside_of(batches), whole(seed, "seed"), progress)
    return Extension(json.loads(findings), None if model is None else Model(model), error_sources, why_not)


def history(models: Sequence[Model]) -> Dict[str, Any]:
    """What a cell went through, over models of it, the oldest first, with the keys of `trammel history --json`."""
    told: Dict[str, Any] = json.loads(_trammel.history([model._inside for model in models]))
    return told


def plan(cell: Cell, count: int, seed: int = 1, criterion: str = "lhs", positions_only: bool = False) -> Plan:
    """`count` poses to measure, inside the cell's workspace and in sight of its tracker. `criterion`: `lhs`,
    `observability`, `separate:CAUSE,CAUSE`, `check`. `positions_only`: for a single reflector."""
    return Plan(**_trammel.plan(_inside_cell(cell), whole(count, "count", 1), whole(seed, "seed"), criterion, positions_only))


def simulate(cell: Cell, truth: Path, planned: Union[Plan, str], seed: int = 1, positions_only: bool = False,
             noise_free: bool = False) -> Batch:
    """Measures a plan (or its CSV) on a virtual robot; `truth` is a truth file: what is really wrong with the robot."""
    text = planned.csv if isinstance(planned, Plan) else planned
    return Batch(_trammel.simulate(_inside_cell(cell), os.fspath(truth), text, whole(seed, "seed"), positions_only, noise_free))


class Session:
    """One client of a running service; one per process is enough, and a forked process opens its own. Raises
    `Unreachable` where no server answers within `timeout_s`.

    `hosts`: where its servers are, names or IPv4 addresses, with `:port` behind them or not; empty: this host, on
    127.0.0.1. `ports`: those of each host that is named without one. `security`: the folder with certificate, key and
    permissions that a secured service asks for. `discovery_servers`: those that tell where servers are, names or IPv4
    addresses with `:port` behind them or not; their order is their number.
    """

    def __init__(self, domain: int = 0, ports: Sequence[int] = (17500,), timeout_s: float = 5.0,
                 hosts: Union[str, Sequence[str]] = (), security: Path = "",
                 discovery_servers: Union[str, Sequence[str]] = ()) -> None:
        if not 0 < timeout_s < float("inf"):
            raise Usage(f"timeout_s is {timeout_s}: a number of seconds above 0 is needed")
        named = [hosts] if isinstance(hosts, str) else list(hosts)
        told_by = [discovery_servers] if isinstance(discovery_servers, str) else list(discovery_servers)
        self._inside = _trammel.Session.open(domain, list(ports), timeout_s, named, os.fspath(security), told_by)

    def status(self) -> List[Dict[str, Any]]:
        """The servers that are there: `id version state cells trouble uptime_s queued_jobs`."""
        return self._inside.servers()

    def models(self, cell: str = "") -> List[Dict[str, Any]]:
        """The models of a cell, or those in force of all: `id hash cell level batch training_poses version in_force notes`,
        and `budget`: of the one in force, where the millimetres come from, for people."""
        return self._inside.models(cell)

    def export_model(self, cell: str, version: int = 0) -> str:
        """The text of a model file, for `Model.parse()`; version 0: in force."""
        return self._inside.export_model(cell, version)

    def predict(self, cell: str, joints_deg: Table, tool: str = "", payload: str = "",
                directions: Sequence[int] = (), temperature_c: Optional[float] = None) -> Predictions:
        """As `Model.predict()`, by the model in force: `joints_deg` (N, n) or (n,), deg, of rails mm."""
        given = {"tool": tool, "payload": payload, "directions": directions, "temperature_c": temperature_c}
        return _in_parts(joints_deg, "joints_deg", given, lambda of_part: Predictions(
            **self._inside.predict(cell, *_asked_poses(of_part(joints_deg, 2), None, **given))[1]))

    def correct(self, cell: str, pose: Optional[Table] = None, joints_deg: Optional[Table] = None,
                conf: Optional[npt.ArrayLike] = None, tool: str = "", payload: str = "",
                directions: Sequence[int] = (), temperature_c: Optional[float] = None) -> Corrections:
        """As `Model.correct()`, by the model in force: `pose` (N, 7), `joints_deg` (N, n), `conf` (N,)."""
        given = {"tool": tool, "payload": payload, "directions": directions, "temperature_c": temperature_c}
        return _in_parts(*_with_circumstances(pose, joints_deg), given, lambda of_part: Corrections(
            **self._inside.correct(cell, *_asked_targets(of_part(pose, 2), of_part(joints_deg, 2), of_part(conf), None,
                                                         **given))[1]))

    def submit(self, cell: str, batch: Batch) -> int:
        """Hands in measurements, from which the service trains. Returns the job."""
        if not isinstance(batch, Batch):
            raise _wrong_kind("batch", batch, "a Batch (Batch.load(path))")
        return self._inside.submit(cell, batch.name, batch.csv())

    def wait_for(self, job: int, limit_s: float = 600.0) -> Dict[str, Any]:
        """Waits until the job is done or failed: `id cell stage what share verdict version in_force why next held_back`."""
        return self._inside.wait_for(job, limit_s)

    def retrain(self, cell: str, batch_ids: Sequence[str] = (), level: str = "", bias: str = "") -> int:
        """Trains from stored batches (none: the newest) and returns the job. `level` and `bias` instead of the cell's."""
        return self._inside.retrain(cell, list(batch_ids), level, bias)

    def extend(self, cell: str, batch: Union[Batch, str] = "", limit_s: float = 600.0) -> Dict[str, Any]:
        """What `trammel diagnose --apply` does at the service: the model with the causes that `batch` shows is put in force if
        it is better. Waits; the job as in `wait_for()`. `batch` as in `diagnose()`."""
        return self.wait_for(self._inside.diagnose(cell, *_id_and_text(batch), True), limit_s)

    def diagnose(self, cell: str, batch: Union[Batch, str] = "", limit_s: float = 600.0) -> Dict[str, Any]:
        """What the cell's model lacks, with the keys of `trammel diagnose --json`. `batch`: the id of a stored one (empty:
        the newest), or measurements, which are not kept. Waits; raises `Refused` with the reason where the job fails."""
        job = self._inside.diagnose(cell, *_id_and_text(batch), False)
        return self._findings(cell, job, limit_s)

    def check(self, cell: str, batch: Union[Batch, str] = "", tolerance_mm: Optional[float] = None,
              limit_s: float = 600.0) -> Dict[str, Any]:
        """Whether the robot is still as the model in force has it, by a few poses, with the keys of `trammel check --json`.
        `batch` as in `diagnose()`; `tolerance_mm` instead of what the cell holds."""
        job = self._inside.check(cell, *_id_and_text(batch), tolerance_mm)
        return self._findings(cell, job, limit_s)

    def _findings(self, cell: str, job: int, limit_s: float) -> Dict[str, Any]:
        ended = self.wait_for(job, limit_s)
        if ended["stage"] != "done":
            raise Refused(f"job {job} of cell {cell}: {ended['why'] or ended['what']}", {"code": "refused", "next": ended["next"]})
        found: Dict[str, Any] = json.loads(self._inside.findings(cell, job))
        return found

    def import_model(self, cell: str, model: Model) -> int:
        """Adds a model to the history of its cell; `activate()` puts it in force. Returns its version."""
        if not isinstance(model, Model):
            raise _wrong_kind("model", model, "a Model (Model.load(path))")
        return self._inside.import_model(cell, model.text())

    def jobs(self, cell: str = "") -> List[Dict[str, Any]]:
        """Jobs that wait or run or ended lately, oldest first."""
        return self._inside.jobs(cell)

    def cancel(self, job: int) -> None:
        """A waiting job does not begin; a running one stops as soon as it can. `Conflict`: it has ended."""
        self._inside.cancel(job)

    def batches(self, cell: str = "") -> List[Dict[str, Any]]:
        """The batches of a cell or of all, oldest first: `cell id kept_out hash server poses accepted_unix_s learned`;
        `kept_out`: why nothing learns from it, empty: it is not."""
        return self._inside.batches(cell)

    def export_batch(self, cell: str, batch_id: str) -> Batch:
        """A batch as it came."""
        return Batch.parse(self._inside.export_batch(cell, batch_id), batch_id)

    def audit(self, cell: str = "", since_unix_s: int = 0, most: int = 0) -> List[Dict[str, Any]]:
        """The changes and their authors, the trail of each server: the newest `most` (0: all) since then."""
        trails: List[Dict[str, Any]] = [json.loads(text) for text in self._inside.audit(cell, since_unix_s, most)]
        return trails

    def activate(self, cell: str, version: int, reason: str = "", expected_version: Optional[int] = None,
                 force: bool = False) -> int:
        """Puts a version in force; `Conflict` where another than `expected_version` is. `Refused` where it is worse than
        the version in force, or cannot be judged, unless `force` is true."""
        return self._inside.activate(cell, version, reason, expected_version, force)

    def roll_back(self, cell: str, reason: str = "", expected_version: Optional[int] = None) -> int:
        """Puts the version before in force again, and returns it; `Conflict` where another than `expected_version` is."""
        return self._inside.roll_back(cell, reason, expected_version)

    def release(self, cell: str, batch_id: str, reason: str = "", expected_version: Optional[int] = None) -> None:
        """Lets a batch out of quarantine, so that models may learn from it; `Conflict` where another version than
        `expected_version` is in force."""
        self._inside.release(cell, batch_id, reason, expected_version)

    def discard(self, cell: str, batch_id: str, reason: str = "", expected_version: Optional[int] = None) -> None:
        """Nothing learns from the batch any more; `Conflict` where another version than `expected_version` is in force."""
        self._inside.discard(cell, batch_id, reason, expected_version)
