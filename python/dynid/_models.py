# SPDX-License-Identifier: Apache-2.0
"""Robots and logs from what people hand over, and MuJoCo's models in and out."""

import os

from . import _core


def robot(source, base="", tip="", gravity=None):
    """A `Robot` from what describes one.

    source: a Robot; a path or the text of a URDF, MJCF or YAML model; a mujoco.MjModel or MjSpec.
    base, tip: links (bodies; the tip may be a site), where it branches.
    gravity: [m/s^2] in the base frame, shape (3,), when it is not the file's.
    """
    kind = type(source).__name__
    if isinstance(source, _core.Robot):
        made = source
        if base or tip:
            raise _core.Error("base and tip are chosen when a robot is read")
    elif kind == "MjModel":
        made = _core.Robot.from_mujoco(source, base, tip)
    elif kind == "MjSpec":
        made = _core.Robot.from_mujoco(source.compile(), base, tip)
    elif isinstance(source, (str, os.PathLike)):
        text = os.fspath(source)
        if "\n" in text or text.lstrip().startswith("<"):
            made = _core.Robot.from_text(text, "text", base, tip)
        else:
            made = _core.Robot.from_file(text, base, tip)
    else:
        raise TypeError(f"a robot is expected (Robot, path, text, mujoco.MjModel), not {kind}")
    if gravity is None:
        return made
    import numpy as np

    return made.replace(gravity=np.asarray(gravity, dtype=float))


def log(*, t=None, q, dq=None, tau=None, u=None, ddq=None, i=None, rate=0.0, source="arrays"):
    """A `Log` from arrays: t [s] (samples,), the others (samples, n): q, u [rad or m], dq [rad/s], tau [N m],
    ddq [rad/s^2], i [A]. Without t, `rate` [Hz] makes it."""
    import numpy as np

    names, columns = [], []
    if t is not None:
        names.append("t")
        columns.append(np.asarray(t, dtype=float))
    for role, values in (("q", q), ("dq", dq), ("tau", tau), ("u", u), ("ddq", ddq), ("i", i)):
        if values is None:
            continue
        values = np.asarray(values, dtype=float)
        if values.ndim != 2:
            raise _core.Error(f"{source}: {role}: shape (samples, n) is expected, not {values.shape}")
        for j in range(values.shape[1]):
            names.append(f"{role}{j + 1}")
            columns.append(values[:, j])
    return _core.log_of(source, names, columns, rate=rate)


def compile_mjcf(text, name):
    """A mujoco.MjModel of a text, for the library."""
    try:
        import mujoco
    except ImportError:
        raise _core.Error(
            f"{name}: MJCF is read by the package mujoco, which is not here: pip install mujoco (or dynid[mujoco])"
        ) from None
    try:
        return mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        said = " ".join(str(error).split())
        raise _core.Error(f"{name}: MuJoCo {mujoco.__version__} refuses it: {said}") from None


def write_mjcf(changed, original, path=None):
    """The MJCF `original` (path, or mujoco.MjSpec) with inertias, friction, armature, gravity and servos of
    `changed` (a Robot read from it, such as a diagnosis's patch); all else stays as it is.

    Returns the changed mujoco.MjSpec; with `path`, its XML is written too, by MuJoCo, to its six digits. The spec is
    compiled and read back as a check: its mass matrix and torques are those of `changed`, else Error.
    """
    import mujoco
    import numpy as np

    spec = mujoco.MjSpec.from_file(os.fspath(original)) if isinstance(original, (str, os.PathLike)) else original
    before = _core.Robot.from_mujoco(spec.compile(), "", changed.tip_link)
    if before.joint_names != changed.joint_names:
        raise _core.Error(f"{before.name}: its joints are {', '.join(before.joint_names)}, not {', '.join(changed.joint_names)}")
    servos = {a.target: a for a in spec.actuators if a.biastype == mujoco.mjtBias.mjBIAS_AFFINE and a.gainprm[0] > 0}
    for j, name in enumerate(changed.joint_names):
        joint = spec.joint(name)
        _set(joint, "damping", changed.viscous[j])
        _set(joint, "frictionloss", changed.coulomb[j])
        _set(joint, "armature", changed.rotor_inertia[j])
        body = joint.parent
        mass, com, inertia = changed.links[j]
        was_mass, was_com, was_inertia = before.links[j]
        if mass != was_mass or np.any(com != was_com) or np.any(inertia != was_inertia):
            # What is lumped into the link from other bodies keeps its own inertial.
            own = _own_inertial(spec, body, joint)
            mass, com, inertia = _minus(_plus((mass, com, inertia), own), (was_mass, was_com, was_inertia))
            body.explicitinertial = True
            body.mass = mass
            body.ipos = com + np.asarray(joint.pos)
            # By its principal axes: MuJoCo finds those of a fullinertia to eight digits only.
            moments, axes = np.linalg.eigh(inertia)
            axes[:, 0] *= np.sign(np.linalg.det(axes))
            mujoco.mju_mat2Quat(quaternion := np.empty(4), axes.flatten())
            body.fullinertia = [np.nan, 0, 0, 0, 0, 0]  # not given
            body.inertia, body.iquat = moments, quaternion
        actuator = servos.get(name)
        if actuator is not None and changed.kp[j] > 0:
            gear = actuator.gear[0]
            actuator.gainprm[0] = changed.kp[j] / gear**2
            actuator.biasprm[1] = -changed.kp[j] / gear**2
            actuator.biasprm[2] = -changed.kd[j] / gear**2
    if not np.allclose(before.gravity, changed.gravity, rtol=0, atol=0):
        raise _core.Error(f"{before.name}: another gravity is an <option> of the scene: set spec.option.gravity")
    _check_same(_core.Robot.from_mujoco(spec.compile(), "", changed.tip_link), changed)
    if path is not None:
        with open(path, "w", encoding="utf-8") as file:
            file.write(spec.to_xml())
    return spec


def _set(joint, key, value):
    # From MuJoCo 3.4 on a joint's damping may be several coefficients.
    old = getattr(joint, key)
    if hasattr(old, "__len__"):
        old[0] = value
    else:
        setattr(joint, key, value)


def _moments(link):
    import numpy as np

    mass, com, inertia = link
    about = inertia + mass * (com @ com * np.eye(3) - np.outer(com, com))
    return mass, mass * com, about


def _link(mass, first, about):
    import numpy as np

    com = first / mass if mass != 0 else np.zeros(3)
    return mass, com, about - mass * (com @ com * np.eye(3) - np.outer(com, com))


def _plus(a, b):
    return _link(*(x + y for x, y in zip(_moments(a), _moments(b))))


def _minus(a, b):
    return _link(*(x - y for x, y in zip(_moments(a), _moments(b))))


def _own_inertial(spec, body, joint):
    """Of the compiled body, about its joint's anchor, in the axes of the body."""
    import mujoco
    import numpy as np

    model = spec.compile()
    b = model.body(body.name)
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, b.iquat)
    axes = axes.reshape(3, 3)
    return float(b.mass[0]), b.ipos - np.asarray(joint.pos), axes @ np.diag(b.inertia) @ axes.T


def _check_same(made, wanted):
    import numpy as np

    random = np.random.default_rng(1)
    q, dq, ddq = (random.uniform(-1, 1, (20, wanted.n)) for _ in range(3))
    a, b = made.rnea(q, dq, ddq), wanted.rnea(q, dq, ddq)
    if np.abs(a - b).max() > 1e-9 * max(1e-12, np.abs(b).max()):
        raise _core.Error(f"{wanted.name}: MuJoCo's reading of what was written has other torques")
