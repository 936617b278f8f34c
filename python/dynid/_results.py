# SPDX-License-Identifier: Apache-2.0
"""What the jobs return. `json` is what the program writes with --json, byte for byte."""

import json as _json
from dataclasses import dataclass, field
from typing import Any, Callable, Optional

from ._core import Log, Robot


class _Result:
    """What all results have: `json`, a summary for people, and tables."""

    json: str
    text: str

    @property
    def data(self):
        """The JSON, parsed."""
        return _json.loads(self.json)

    def __str__(self):
        return self.text.rstrip("\n")

    def _repr_html_(self):
        import html

        return f"<pre>{html.escape(str(self))}</pre>"

    def write_json(self, path):
        """Writes what the program writes with --json PATH."""
        with open(path, "w", encoding="utf-8", newline="") as file:
            file.write(self.json)

    def _frame(self, rows, columns=None):
        try:
            import pandas
        except ImportError:
            raise ImportError("to_frame() makes a pandas.DataFrame: pip install pandas (or dynid[frames])") from None
        return pandas.DataFrame(rows, columns=columns)


@dataclass(frozen=True)
class Coefficient:
    """One identified dynamic coefficient (base parameter)."""

    name: str
    expression: str
    value: float
    std_percent: Optional[float]
    kept: bool


@dataclass(frozen=True)
class Parameter:
    """A number, or one for each joint, with its 90 % interval."""

    value: Any
    low: Any
    high: Any
    unit: str


@dataclass(frozen=True)
class FoundEffect:
    """An effect that the diagnosis found. joints: from 1."""

    name: str
    joints: list
    share: float
    probability: float
    aliases: list
    parameters: dict


@dataclass(frozen=True)
class Motion:
    """Samples of a motion: t [s] (samples,), q [rad or m], dq, ddq (samples, n)."""

    t: Any
    q: Any
    dq: Any
    ddq: Any

    def write(self, path):
        """Writes it as the program does: CSV t, q1.., dq1.., ddq1..."""
        import numpy as np

        n = self.q.shape[1]
        names = ["t"] + [f"{role}{j + 1}" for role in ("q", "dq", "ddq") for j in range(n)]
        rows = np.column_stack([self.t, self.q, self.dq, self.ddq])
        with open(path, "w", encoding="utf-8") as file:
            file.write(",".join(names) + "\n")
            file.writelines(",".join(map(repr, row)) + "\n" for row in rows.tolist())


@dataclass(frozen=True, repr=False)
class Diagnosis(_Result):
    """Where a model and a robot disagree, which effect makes it, and how far it shrinks."""

    verdict: str
    effects: list
    shrink: float
    shrink_low: float
    shrink_high: float
    p_value: float
    rms: list
    floor: list
    ranking: list
    succeeded: bool
    patch: Optional[Robot] = field(repr=False)
    next_experiment: str
    next_motion: Optional[Motion] = field(repr=False)
    json: str = field(repr=False)
    text: str = field(repr=False)
    _page: Callable = field(repr=False, compare=False)

    def __repr__(self):
        named = ", ".join(f"{e.name} {e.joints}" for e in self.effects)
        return f"<dynid.Diagnosis {self.verdict}: {named or 'no effect'}>"

    def html(self):
        """The page: what was found, in words, figures and plots; self-contained."""
        return self._page()

    def report(self, path):
        """Writes the page."""
        page = self.html()
        with open(path, "w", encoding="utf-8", newline="") as file:
            file.write(page)

    def to_frame(self):
        """One row for each parameter of each effect, as a pandas.DataFrame."""
        return self._frame(
            [
                {"effect": e.name, "joints": e.joints, "share": e.share, "probability": e.probability,
                 "parameter": key, "value": p.value, "low": p.low, "high": p.high, "unit": p.unit}
                for e in self.effects
                for key, p in (e.parameters or {"": Parameter(None, None, None, "")}).items()
            ],
            ["effect", "joints", "share", "probability", "parameter", "value", "low", "high", "unit"],
        )


@dataclass(frozen=True, repr=False)
class Identification(_Result):
    """Dynamic coefficients and friction; `robot` has the nearest parameters that make them."""

    robot: Robot
    coefficients: list
    rank: int
    condition_number: float
    relative_error_percent: float
    rmse: list
    validation: Optional[dict]
    json: str
    text: str

    def to_frame(self):
        """One row for each coefficient, as a pandas.DataFrame."""
        return self._frame([vars(c) for c in self.coefficients])

    def report(self, path):
        """Writes the summary as a page."""
        _write_page(self, path, "Identification")


@dataclass(frozen=True, repr=False)
class ServoIdentification(_Result):
    """Position servos; `joints` as in the JSON, `robot` has them."""

    robot: Robot
    joints: list
    json: str
    text: str

    def to_frame(self):
        """One row for each joint and number, as a pandas.DataFrame."""
        return self._frame(
            [
                {"joint": joint.get("joint"), "name": joint.get("name"), "parameter": key, **_number(value)}
                for joint in self.joints
                for key, value in joint.get("parameters", {}).items()
            ]
        )

    def report(self, path):
        """Writes the summary as a page."""
        _write_page(self, path, "Position servos")


@dataclass(frozen=True, repr=False)
class Retrieval(_Result):
    """Feasible masses, centres of mass and inertias."""

    robot: Robot
    feasible: bool
    objective: float
    total_mass: float
    constraints: list
    json: str
    text: str

    def to_frame(self):
        """One row for each link, as a pandas.DataFrame."""
        return self._frame(self.data["links"])

    def report(self, path):
        """Writes the summary as a page."""
        _write_page(self, path, "Feasible parameters")


@dataclass(frozen=True, repr=False)
class Excitation(_Result):
    """A motion worth recording; None where none keeps the limits."""

    motion: Optional[Motion]
    feasible: bool
    condition_number: float
    json: str
    text: str

    def to_frame(self):
        """The motion, as a pandas.DataFrame."""
        return self._frame(_motion_columns(self.motion))


@dataclass(frozen=True, repr=False)
class Simulation(_Result):
    """A closed-loop run of a robot that has chosen effects. labels: what they are, as JSON."""

    log: Log
    labels: str
    json: str
    text: str

    def to_frame(self):
        """The log, as a pandas.DataFrame."""
        return self._frame(_log_columns(self.log))


@dataclass(frozen=True, repr=False)
class Torque(_Result):
    """Torques that a model predicts along a log: t (samples,), tau and, alone, friction (samples, n)."""

    t: Any
    tau: Any
    friction: Any
    json: str
    text: str

    def to_frame(self):
        """The torques, as a pandas.DataFrame."""
        n = self.tau.shape[1]
        return self._frame(
            {"t": self.t, **{f"tau{j + 1}": self.tau[:, j] for j in range(n)},
             **{f"tauf{j + 1}": self.friction[:, j] for j in range(n)}}
        )


@dataclass(frozen=True, repr=False)
class Replay(_Result):
    """The motion that servos make of a log's commands: t (samples,), q, dq (samples, n); error [rad] (n,)."""

    t: Any
    q: Any
    dq: Any
    json: str
    text: str

    def to_frame(self):
        """The motion, as a pandas.DataFrame."""
        n = self.q.shape[1]
        return self._frame(
            {"t": self.t, **{f"q{j + 1}": self.q[:, j] for j in range(n)},
             **{f"dq{j + 1}": self.dq[:, j] for j in range(n)}}
        )


@dataclass(frozen=True, repr=False)
class Export(_Result):
    """A model in another program's words, and what these cannot say."""

    text: str
    not_expressed: list
    json: str

    def write(self, path):
        """Writes the text."""
        with open(path, "w", encoding="utf-8", newline="") as file:
            file.write(self.text)


def _number(value):
    return value if isinstance(value, dict) else {"value": value}


def _motion_columns(motion):
    if motion is None:
        return {}
    n = motion.q.shape[1]
    return {"t": motion.t, **{f"{role}{j + 1}": getattr(motion, role)[:, j] for role in ("q", "dq", "ddq") for j in range(n)}}


def _log_columns(log):
    columns = {} if log.t is None else {"t": log.t}
    for role in ("q", "dq", "tau", "ddq", "u", "i"):
        values = getattr(log, role)
        if values is not None:
            columns.update({f"{role}{j + 1}": values[:, j] for j in range(log.n)})
    return columns


def _write_page(result, path, title):
    with open(path, "w", encoding="utf-8") as file:
        file.write(f'<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>{title}</title>'
                   f"<h1>{title}</h1>{result._repr_html_()}</html>\n")
