# SPDX-License-Identifier: Apache-2.0
"""MuJoCo's own mass matrix, bias and tip against the library's, on arms that say things in MuJoCo's many ways."""

import importlib.util
import os
import pathlib
import re

import numpy as np
import pytest

import dynid
from conftest import PANDA
from mjcf_models import DEFAULTS, FULL_INERTIA, GRIPPER, INHERIT_RANGE, MODELS

mujoco = pytest.importorskip("mujoco")


def full_mass_matrix(model, data):
    M = np.zeros((model.nv, model.nv))
    try:
        mujoco.mj_fullM(model, M, data.qM)
    except (TypeError, AttributeError):  # from version 3.3 on
        mujoco.mj_fullM(model, data, M)
    return M


def body_of(model, name):
    """Its index: by its name, or where it has none by the library's `body9`."""
    try:
        return model.body(name).id
    except KeyError:
        return int(name[len("body"):])


def joint_of(model, name):
    """By its name, or where it has none by its body's, as the library names it."""
    try:
        return model.joint(name)
    except KeyError:
        body = body_of(model, name[: -len("_joint")])
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        return next(model.joint(j) for j in range(first, first + count) if not model.joint(j).name)


def addresses(model, robot):
    joints = [joint_of(model, name) for name in robot.joint_names]
    return [int(j.qposadr[0]) for j in joints], [int(j.dofadr[0]) for j in joints]


def compare(model, robot, tip, count=20, beside_at_reference=True):
    """Both to 1e-10 of their largest entries."""
    at, dof = addresses(model, robot)
    data = mujoco.MjData(model)
    random = np.random.default_rng(7)
    for _ in range(count):
        q, dq = random.uniform(-1.5, 1.5, (2, robot.n))
        data.qpos[:] = model.qpos0
        data.qpos[at] = q
        data.qvel[:] = 0
        data.qvel[dof] = dq
        mujoco.mj_forward(model, data)
        M = full_mass_matrix(model, data)[np.ix_(dof, dof)]
        mine = robot.mass_matrix(q)
        assert np.abs(M - mine).max() <= 1e-10 * np.abs(M).max()
        bias = data.qfrc_bias[dof]
        mine = robot.rnea(q, dq, np.zeros(robot.n))
        assert np.abs(bias - mine).max() <= 1e-10 * max(np.abs(bias).max(), 1.0)
        linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        if tip and mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, tip) >= 0:
            mujoco.mj_jacSite(model, data, linear, angular, model.site(tip).id)
        else:
            mujoco.mj_jacBody(model, data, linear, angular, body_of(model, robot.tip_link))
        base = data.xmat[body_of(model, robot.base_link)].reshape(3, 3)  # its axes are those of ours
        wanted = np.vstack([base.T @ linear, base.T @ angular])[:, dof]
        assert np.abs(wanted - robot.jacobian(q)).max() <= 1e-10


@pytest.mark.parametrize("name, text, tip", MODELS, ids=[m[0] for m in MODELS])
def test_mass_matrix_bias_and_tip_are_mujocos(name, text, tip):
    model = mujoco.MjModel.from_xml_string(text)
    compare(model, dynid.robot(model, tip=tip), tip)


@pytest.mark.parametrize("name, text, tip", MODELS, ids=[m[0] for m in MODELS])
def test_a_text_is_read_as_its_compiled_model(name, text, tip):
    a, b = dynid.robot(text, tip=tip), dynid.robot(mujoco.MjModel.from_xml_string(text), tip=tip)
    assert a.joint_names == b.joint_names
    for key in ("parameters", "rotor_inertia", "viscous", "coulomb", "lower", "upper", "kp", "kd", "torque_limit", "gravity"):
        x, y = getattr(a, key), getattr(b, key)
        assert np.allclose(x, y, rtol=1e-12, atol=1e-15), key


def packaged_models():
    """MJCF that installed packages of PyPI ship, and what is in the folder DYNID_MJCF, such as unpacked wheels."""
    folders = [os.environ["DYNID_MJCF"]] if "DYNID_MJCF" in os.environ else []
    for package in ("robosuite", "gymnasium_robotics", "dm_control", "mujoco"):
        spec = importlib.util.find_spec(package)
        folders += list(spec.submodule_search_locations or ()) if spec else []
    return [path for folder in folders for path in sorted(pathlib.Path(folder).rglob("*.xml"))]


def arm_of(model):
    """The serial arm of a compiled model, up to where it branches; None where there is none."""
    try:
        return dynid.robot(model)
    except dynid.Error as error:
        branch = re.search(r"branch at body '([^']+)'", str(error))
    try:
        return dynid.robot(model, tip=branch[1]) if branch else None
    except dynid.Error:
        return None


def test_what_packages_ship():
    compared = []
    for path in packaged_models():
        try:
            model = mujoco.MjModel.from_xml_path(str(path))
        except ValueError:
            continue  # not a model by itself
        robot = arm_of(model)
        if robot is None:
            continue
        compare(model, robot, "", 3)
        compared.append(f"{path.parent.name}/{path.name}: {robot.n} joints")
    if not compared:
        pytest.skip("no installed package ships an arm in MJCF")
    print("\n".join(compared))


def test_friction_armature_limits_and_servos():
    robot = dynid.robot(INHERIT_RANGE)
    assert np.array_equal(robot.viscous, [0.6] * 3) and np.array_equal(robot.coulomb, [0.05] * 3)
    assert np.array_equal(robot.rotor_inertia, [0.03] * 3)
    assert np.allclose(robot.upper, 1.5)
    # Force = gear (kp u - kp gear q - kv gear dq): in the joint's unit both times gear^2.
    assert np.allclose(robot.kp, [40, 12, 48]) and np.allclose(robot.kd, [0, 0.4, 3.6])
    assert np.allclose(robot.torque_limit, [3, 3, 2])
    assert any("gear" in line for line in robot.not_expressed)


def test_a_spring_is_the_effect_and_moves_the_joint():
    robot = dynid.robot(FULL_INERTIA)
    assert "joint_spring" in robot.to_yaml()
    model = mujoco.MjModel.from_xml_string(FULL_INERTIA)
    data = mujoco.MjData(model)
    q = np.array([0.1, 0.02, 0.3, -0.5])
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    log = dynid.log(t=np.arange(3) * 0.01, q=np.tile(q, (3, 1)), dq=np.zeros((3, 4)), ddq=np.zeros((3, 4)))
    tau = dynid.torque(robot, log).tau[1]
    # MuJoCo's passive forces pull; ours is what it takes.
    assert np.allclose(tau, data.qfrc_bias - data.qfrc_passive, atol=1e-9)


def test_branches_ask_for_a_tip_and_fingers_are_lumped():
    with pytest.raises(dynid.Error, match="branch at body 'palm': choose a tip"):
        dynid.robot(GRIPPER)
    robot = dynid.robot(GRIPPER, tip="palm")
    assert robot.joint_names == ["swing", "roll"]
    assert any("left, right" in line for line in robot.not_expressed)


@pytest.mark.parametrize("change, text", [
    (('type="slide"', 'type="ball"'), "ball joint"),
    (('<joint name="j1"', '<joint nonsense="1" name="j1"'), "nonsense"),
    (("</worldbody>", ""), "not well-formed"),
])
def test_what_is_wrong_is_named_in_one_line(change, text, tmp_path):
    broken = FULL_INERTIA.replace(*change)
    if "ball" in text:
        broken = broken.replace(' axis="0 1 0.2" ref="0.05"', "")
    path = tmp_path / "broken.xml"
    path.write_text(broken)
    with pytest.raises(dynid.Error) as error:
        dynid.robot(path)
    assert str(path) in str(error.value) and text in str(error.value) and "\n" not in str(error.value)


def test_meshes_that_are_not_there(tmp_path):
    mesh = '<asset><mesh name="m" file="nowhere.stl"/></asset><worldbody>'
    seen = FULL_INERTIA.replace("<worldbody>", mesh).replace(
        '<joint name="j1"', '<geom type="mesh" mesh="m"/><joint name="j1"')
    path = tmp_path / "seen.xml"
    path.write_text(seen)
    assert np.array_equal(dynid.robot(path).parameters, dynid.robot(FULL_INERTIA).parameters)
    carried = DEFAULTS.replace("<worldbody>", mesh).replace(
        '<joint name="b"', '<geom type="mesh" mesh="m"/><joint name="b"')
    path.write_text(carried)
    with pytest.raises(dynid.Error, match="body 'fore' takes its inertia from its geoms, and nowhere.stl is not there"):
        dynid.robot(path)


def test_includes(tmp_path):
    head, body = DEFAULTS.split("<worldbody>")
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "body.xml").write_text("<mujoco><worldbody>" + body.replace("</mujoco>", "") + "</mujoco>")
    path = tmp_path / "robot.xml"
    path.write_text(head + '<include file="parts/body.xml"/></mujoco>')
    assert np.array_equal(dynid.robot(path).parameters, dynid.robot(DEFAULTS).parameters)


def test_the_exported_panda_comes_back(panda):
    again = dynid.robot(dynid.export(PANDA, "mjcf").text)
    q, dq, ddq = np.random.default_rng(3).uniform(-1, 1, (3, 10, 7))
    wanted = panda.rnea(q, dq, ddq)
    assert np.abs(again.rnea(q, dq, ddq) - wanted).max() < 1e-8 * np.abs(wanted).max()
    assert np.allclose(again.rotor_inertia, panda.rotor_inertia)


def test_a_patch_of_a_full_inertia_goes_in_to_the_last_digits():
    robot = dynid.robot(FULL_INERTIA)
    changed = robot.parameters.copy()
    changed[:10] *= 1.3
    changed[30:40] *= 0.8
    patched = robot.replace(parameters=changed)
    again = dynid.robot(dynid.write_mjcf(patched, mujoco.MjSpec.from_string(FULL_INERTIA)))
    q, dq, ddq = np.random.default_rng(6).uniform(-1, 1, (3, 10, 4))
    wanted = patched.rnea(q, dq, ddq)
    assert np.abs(again.rnea(q, dq, ddq) - wanted).max() <= 1e-10 * np.abs(wanted).max()


def test_a_patch_goes_into_the_mjcf(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(GRIPPER)
    robot = dynid.robot(path, tip="palm")
    changed = robot.parameters.copy()
    changed[10:20] *= 1.25
    patched = robot.replace(parameters=changed)
    out = tmp_path / "patched.xml"
    spec = dynid.write_mjcf(patched, path, out)
    q, dq, ddq = np.random.default_rng(4).uniform(-1, 1, (3, 10, 2))
    inside = dynid.robot(spec, tip="palm")
    wanted = patched.rnea(q, dq, ddq)
    assert np.abs(inside.rnea(q, dq, ddq) - wanted).max() <= 1e-10 * np.abs(wanted).max()
    again = dynid.robot(out, tip="palm")  # six digits, as MuJoCo writes
    assert np.allclose(again.rnea(q, dq, ddq), patched.rnea(q, dq, ddq), rtol=1e-6, atol=1e-9)
    assert not np.allclose(again.rnea(q, dq, ddq), robot.rnea(q, dq, ddq), rtol=1e-3)


def test_the_shipped_so101_without_its_meshes(data):
    robot = dynid.robot(data / "so101_real" / "so101_new_calib.xml")
    assert robot.n == 6 and robot.joint_names[0] == "shoulder_pan"
    assert np.allclose(robot.kp, 998.22) and np.allclose(robot.kd, 2.731)
    assert np.allclose(robot.viscous, 0.60) and np.allclose(robot.rotor_inertia, 0.028)
