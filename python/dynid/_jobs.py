# SPDX-License-Identifier: Apache-2.0
"""The program's subcommands as functions. Each releases the GIL, tells `progress(stage, fraction)` from the
calling thread, and ends within 0.2 s of Ctrl-C."""

import json as _json
import os as _os

from . import _core
from . import _results as _r
from ._files import read as _read
from ._models import robot as _robot


class Effect:
    """An effect of one's own for `diagnose(effects=[...])`: torque of one joint, linear in its coefficients.

    columns(motion, joint): `motion` has t [s] (samples,), q [rad or m], dq, ddq, tau (measured), nominal
    [N m] (samples, n), low-passed; `joint` counts from 0. Returns (samples,) or (samples, k): the torque of
    coefficients 1, on the measured side. parameters: k pairs (name, unit). prior: how likely it is before the
    data are seen, relative to the library's effects (1).

        cogging = dynid.Effect("cogging", lambda m, j: np.sin(12 * m.q[:, j]), [("amplitude", "N m")])
    """

    def __init__(self, name, columns, parameters=(("coefficient", "N m"),), prior=1.0):
        self.name = str(name)
        self.parameters = [(str(key), str(unit)) for key, unit in parameters]
        self.prior = float(prior)
        self._columns = columns

    def evaluate(self, motion, joint):
        """For the library: the columns, (samples, k)."""
        import numpy as np
        from types import SimpleNamespace

        values = np.asarray(self._columns(SimpleNamespace(**motion), joint), dtype=float)
        return values[:, None] if values.ndim == 1 else values


def _logs(logs, robot):
    if isinstance(logs, (str, _os.PathLike, _core.Log)):
        logs = [logs]
    return [log if isinstance(log, _core.Log) else _read(log, robot=robot) for log in logs]


def _spread(*logs):
    """diagnose(model, log), diagnose(model, log1, log2) and diagnose(model, [log1, log2]) alike."""
    if len(logs) == 1 and isinstance(logs[0], (list, tuple)):
        return list(logs[0])
    return list(logs)


def diagnose(model, *logs, reference=None, withhold=(), assume="", cutoff=0.0, tolerance=0.02, seed=1,
             gravity=None, base="", tip="", effects=(), replay=True, progress=None):
    """Where a model and a robot disagree, which effect makes it, and how far it shrinks.

    model: what `robot()` takes. logs: Logs or paths, with q, dq, tau; of several, the last only judges.
    reference: a log of the healthy robot. withhold: "friction", "payload" or names of effects. assume: "",
    "auto" or what a diagnosis `misread` proposes. cutoff [Hz]: of the band looked at, 0: chosen. tolerance:
    relative error of the parameters that is no gap. gravity [m/s^2], base frame. effects: of one's own, see
    `Effect`; the patch is without them, for no model file can say them, and so is the replayed motion. replay:
    replay the motion and propose the next experiment. Returns a `Diagnosis`.
    """
    model = _robot(model, base, tip, gravity)
    found = _core.diagnose(
        model, _logs(_spread(*logs), model), None if reference is None else _logs(reference, model)[0],
        [withhold] if isinstance(withhold, str) else list(withhold), assume, cutoff, tolerance, seed,
        replay, list(effects), progress,
    )
    data = _json.loads(found["json"])
    return _r.Diagnosis(
        verdict=data["verdict"],
        effects=[
            _r.FoundEffect(e["name"], e["joints"], e["share"], e["probability"], e["aliases"],
                           {key: _r.Parameter(p["value"], p["low"], p["high"], p["unit"]) for key, p in e["parameters"].items()})
            for e in data["effects"]
        ],
        shrink=data["shrink"]["fraction"], shrink_low=data["shrink"]["low"], shrink_high=data["shrink"]["high"],
        p_value=data["gap"]["p_value"], rms=data["gap"]["rms"], floor=data["gap"]["floor"], ranking=data["ranking"],
        succeeded=found["succeeded"], patch=found["patch"], next_experiment=data["next_experiment"]["text"],
        next_motion=_r.Motion(**found["next_motion"]) if len(found["next_motion"]["t"]) else None,
        json=found["json"], text=found["text"], _page=found["html"],
    )


def identify(robot, logs, validate=(), *, assume="", friction="linear", rotor_inertia=False, method="ols",
             cutoff=0.0, prune=30.0, gravity=None, base="", tip="", progress=None):
    """Dynamic coefficients and friction from recorded motions.

    robot: what `robot()` takes; its kinematics count. logs, validate: Logs or paths, with q, dq, tau; the
    latter are predicted, never fitted. friction: "none", "linear" (eq. (24)) or "sigmoid" (eq. (25) where it
    predicts better). method: "ols", "wls", "irls". cutoff [Hz], 0: chosen. prune [%]: drop coefficients whose
    standard deviation exceeds this; 0: none. Returns an `Identification`.
    """
    robot = _robot(robot, base, tip, gravity)
    found = _core.identify(robot, _logs(logs, robot), _logs(validate, robot), assume, friction, rotor_inertia, method,
                           cutoff, prune, progress)
    data = _json.loads(found["json"])
    return _r.Identification(
        robot=found["robot"],
        coefficients=[_r.Coefficient(c["name"], c["expression"], c["value"], c["std_percent"], c["kept"]) for c in data["coefficients"]],
        rank=data["rank"], condition_number=data["condition_number"],
        relative_error_percent=data["relative_error_percent"], rmse=data["rmse"], validation=data.get("validation"),
        json=found["json"], text=found["text"],
    )


def identify_servo(logs, robot=None, *, gravity=None, base="", tip="", progress=None):
    """Position servos from commanded and measured positions.

    logs: Logs or paths, with u and q. robot: what `robot()` takes, for values in SI; without it each joint
    stands alone and only ratios are claimed. Returns a `ServoIdentification`.
    """
    robot = None if robot is None else _robot(robot, base, tip, gravity)
    found = _core.identify_servo(robot, _logs(logs, robot), progress)
    return _r.ServoIdentification(robot=found["robot"], joints=_json.loads(found["json"])["joints"],
                                  json=found["json"], text=found["text"])


def reverse(robot, q, mass_matrices=None, gravity_torques=None, *, source="samples", prune=30.0, progress=None):
    """Dynamic coefficients from a controller's values of M(q) and g(q), Section IV-A.

    q [rad or m]: (samples, n); mass_matrices [kg m^2]: (samples, n, n), their lower triangles are read;
    gravity_torques [N m]: (samples, n). Or q alone, the path of a CSV. Returns an `Identification`.
    """
    import numpy as np

    robot = _robot(robot)
    if mass_matrices is None:
        source = _os.fspath(q)
        names, table = _columns_of_csv(source)
        n = robot.n
        wanted = [f"m{r + 1}{c + 1}" for r in range(n) for c in range(r + 1)] + [f"g{r + 1}" for r in range(n)]
        try:
            q = table[:, [names.index(f"q{j + 1}") for j in range(n)]]
            values = table[:, [names.index(name) for name in wanted]]
        except ValueError as error:
            raise _core.Error(f"{source}: column missing: {error}") from None
    else:
        mass_matrices = np.asarray(mass_matrices, dtype=float)
        rows, columns = np.tril_indices(robot.n)
        values = np.column_stack([mass_matrices[:, rows, columns], np.asarray(gravity_torques, dtype=float)])
    found = _core.reverse(robot, np.asarray(q, dtype=float), values, source, prune, progress)
    data = _json.loads(found["json"])
    return _r.Identification(
        robot=found["robot"],
        coefficients=[_r.Coefficient(c["name"], c["expression"], c["value"], c["std_percent"], c["kept"]) for c in data["coefficients"]],
        rank=data["rank"], condition_number=data["condition_number"],
        relative_error_percent=data["relative_error_percent"], rmse=data["rmse"], validation=data.get("validation"),
        json=found["json"], text=found["text"],
    )


def _columns_of_csv(path):
    import numpy as np

    with open(path, encoding="utf-8-sig") as file:
        names = [name.strip() for name in file.readline().split(",")]
        return names, np.loadtxt(file, delimiter=",", ndmin=2)


def torque(model, log, *, cutoff=0.0, gravity=None, base="", tip="", progress=None):
    """Torques that a model, its effects included, predicts along a log (t, q, dq; ddq is taken as it stands).

    Returns a `Torque`: tau (samples, n) is the whole model torque, friction included.
    """
    model = _robot(model, base, tip, gravity)
    found = _core.torque(model, _logs(log, model)[0], cutoff, progress)
    values, n = found["table"]["values"], model.n
    return _r.Torque(t=values[:, 0], tau=values[:, 1 : 1 + n], friction=values[:, 1 + n :], json=found["json"], text=found["text"])


def replay(model, log, *, gravity=None, base="", tip="", progress=None):
    """The motion that a model with servos makes of a log's commands (t, u, q), open loop from its first state.

    Returns a `Replay`.
    """
    model = _robot(model, base, tip, gravity)
    found = _core.replay(model, _logs(log, model)[0], progress)
    values, n = found["table"]["values"], model.n
    return _r.Replay(t=values[:, 0], q=values[:, 1 : 1 + n], dq=values[:, 1 + n :], json=found["json"], text=found["text"])


def retrieve(model, bounds, *, logs=(), prior=None, constraints=None, runs=10, steps=10, seed=1, threads=0,
             agree=0, weighted=False, cutoff=0.0, progress=None):
    """Feasible masses, centres of mass and inertias, eq. (29).

    model: a Robot or path with coefficients (an Identification's `robot`), or with `logs` its kinematics
    (one step). bounds: the path of a bounds file. constraints: {name: h} with h(p) >= 0, p (10 n,): m [kg],
    c_x, c_y, c_z [m], I_xx, I_xy, I_yy, I_xz, I_yz, I_zz [kg m^2] (about c, link frame) of each link; called
    from several threads. Returns a `Retrieval`.
    """
    model = _robot(model)
    found = _core.retrieve(
        model, _os.fspath(bounds), _logs(logs, model), None if prior is None else _robot(prior),
        list((constraints or {}).items()), runs, steps, seed, threads, agree, weighted, cutoff, progress,
    )
    data = _json.loads(found["json"])
    return _r.Retrieval(robot=found["robot"], feasible=found["feasible"], objective=data["objective"],
                        total_mass=data["total_mass"], constraints=data["constraints"], json=found["json"], text=found["text"])


def excite(robot, *, collision="", harmonics=5, period=21.0, rate=1000.0, seed=1, starts=8, effort=300, threads=0,
           margin=0.05, rotor_inertia=False, gravity=None, base="", tip="", progress=None):
    """A motion worth recording, optimised within every limit of the robot.

    period [s]: from rest to rest; rate [Hz] of the samples. Returns an `Excitation`.
    """
    robot = _robot(robot, base, tip, gravity)
    found = _core.excite(robot, collision, harmonics, period, rate, seed, starts, effort, threads, margin,
                         rotor_inertia, progress)
    return _r.Excitation(motion=_r.Motion(**found["motion"]) if found["feasible"] else None, feasible=found["feasible"],
                         condition_number=_json.loads(found["json"])["condition_number"], json=found["json"], text=found["text"])


def simulate(model, motion=None, *, duration=20.0, effects=(), seed=1, noise=None, clean=False, rate=1000.0,
             spread=0.0, gravity=None, base="", tip="", progress=None):
    """A closed-loop run of a robot that has chosen effects.

    motion: a `Motion`, or None for a random smooth one of `duration` [s]. effects: texts
    NAME[:key=value,...] as `dynid simulate --effect` takes them. rate [Hz] of the log. Returns a `Simulation`.
    """
    import numpy as np

    model = _robot(model, base, tip, gravity)
    table = None if motion is None else np.column_stack([motion.t, motion.q, motion.dq, motion.ddq])
    found = _core.simulate(model, table, duration, [effects] if isinstance(effects, str) else list(effects), seed,
                           noise, clean, rate, spread, progress)
    return _r.Simulation(log=found["log"], labels=found["labels"], json=found["json"], text=found["text"])


def export(model, format, *, into="", gravity=None, base="", tip="", progress=None):
    """A model for another program: format "urdf", "mjcf", "sdf", "yaml", "header" or "franka".

    into: with "urdf", the path of a URDF whose inertials and joint dynamics are replaced. Returns an `Export`.
    """
    found = _core.export(_robot(model, base, tip, gravity), format, _os.fspath(into) if into else "", progress)
    return _r.Export(text=found["text"], not_expressed=found["not_expressed"], json=found["json"])
