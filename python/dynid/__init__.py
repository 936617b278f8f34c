# SPDX-License-Identifier: Apache-2.0
"""Dynamic identification of robot arms, and what makes a model and its robot differ.

    import dynid
    log = dynid.read("run.mcap", robot="arm.urdf")
    gap = dynid.diagnose("arm.urdf", log)
    print(gap)

SI units throughout: s, rad, rad/s, rad/s^2, N m, kg, m; joints base to tip. What takes a robot takes a
`Robot`, a path (URDF, MJCF, YAML model) or a `mujoco.MjModel`; what takes a log takes a `Log` or a path.
"""

import atexit as _atexit
import os as _os
from importlib.util import find_spec as _find_spec

from . import _core
from ._core import Error, Estimate, Estimator, Log, Robot
from ._jobs import (
    Effect,
    diagnose,
    excite,
    export,
    identify,
    identify_servo,
    replay,
    retrieve,
    reverse,
    simulate,
    torque,
)
from ._files import read
from ._models import compile_mjcf as _compile_mjcf
from ._models import log, robot, write_mjcf
from ._results import (
    Coefficient,
    Diagnosis,
    Excitation,
    Export,
    FoundEffect,
    Identification,
    Motion,
    Parameter,
    Replay,
    Retrieval,
    ServoIdentification,
    Simulation,
    Torque,
)

__version__ = _core.version

__all__ = [
    "Coefficient", "Diagnosis", "Effect", "Error", "Estimate", "Estimator", "Excitation", "Export",
    "FoundEffect", "Identification", "Log", "Motion", "Parameter", "Replay", "Retrieval", "Robot",
    "ServoIdentification", "Simulation", "Torque", "diagnose", "excite", "export", "identify",
    "identify_servo", "log", "read", "replay", "retrieve", "reverse", "robot", "simulate", "torque",
    "write_mjcf",
]

# Compiled for x86-64-v3 too: taken where this machine has it.
_core.load_kernels(_os.path.join(_os.path.dirname(_core.__file__), "_kernels_v3.so"))
_atexit.register(_core.join_abandoned)

# One MuJoCo in a process: the package where there is one, else what the library was built with.
if not _core.has_mujoco() or _find_spec("mujoco") is not None:
    _core.use_mujoco(_compile_mjcf)
