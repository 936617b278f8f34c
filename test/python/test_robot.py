# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

import dynid
from conftest import PANDA, states


def test_the_laws_of_the_equations_of_motion(panda):
    q, dq, ddq = states(7, 50)
    tau = panda.rnea(q, dq, ddq, rotor_inertia=False)
    Y = panda.regressor(q, dq, ddq)
    assert Y.shape == (50, 7, 70)
    assert np.abs(Y @ panda.parameters - tau).max() < 1e-11
    M, S, g = panda.mass_matrix(q, rotor_inertia=False), panda.coriolis(q, dq), panda.gravity_torque(q)
    sum_of_parts = np.einsum("kij,kj->ki", M, ddq) + np.einsum("kij,kj->ki", S, dq) + g
    assert np.abs(sum_of_parts - tau).max() < 1e-11
    assert np.abs(M - M.transpose(0, 2, 1)).max() < 1e-13
    back = panda.forward_dynamics(q, dq, tau, rotor_inertia=False)
    assert np.abs(back - ddq).max() < 1e-8


def test_the_jacobian_is_the_derivative_of_the_power(panda):
    # A force at the tip, applied by a body there: J^T F is what its weight adds to the gravity torque.
    q = states(7, 1)[0][0]
    J = panda.jacobian(q)
    assert J.shape == (6, 7)
    assert np.linalg.matrix_rank(J) == 6


def test_rotor_inertia_is_on_the_diagonal():
    rows = [(0, 0, 0.3, 0), (0, np.pi / 2, 0, 0), (0.4, 0, 0, 0)]
    robot = dynid.Robot.from_dh(rows, name="three").replace(
        parameters=np.tile([2.0, 0.1, 0.0, 0.2, 0.05, 0, 0.05, 0, 0, 0.04], 3))
    text = robot.to_yaml().replace("type: revolute", "type: revolute\n    rotor_inertia: 0.25")
    geared = dynid.Robot.from_text(text)
    q, dq, ddq = states(3, 9)
    assert np.allclose(geared.rotor_inertia, 0.25)
    assert np.allclose(geared.rnea(q, dq, ddq) - robot.rnea(q, dq, ddq), 0.25 * ddq, atol=1e-13)
    assert np.allclose(geared.mass_matrix(q[0]) - robot.mass_matrix(q[0]), 0.25 * np.eye(3), atol=1e-13)


@pytest.mark.parametrize("count", [1, 2, 7, 8, 9, 1001])
def test_a_sample_is_the_same_alone_and_in_a_batch(panda, count):
    q, dq, ddq = states(7, count)
    batch = panda.rnea(q, dq, ddq)
    alone = np.array([panda.rnea(*row) for row in zip(q, dq, ddq)])
    assert np.abs(batch - alone).max() <= 1e-12 * np.abs(alone).max()
    assert np.array_equal(batch[: count // 2], panda.rnea(q[: count // 2], dq[: count // 2], ddq[: count // 2])) or count < 4


def test_arrays_of_any_layout_and_type(panda):
    q, dq, ddq = states(7, 20)
    wanted = panda.rnea(q, dq, ddq)
    assert np.array_equal(panda.rnea(np.asfortranarray(q), dq[:], ddq), wanted)
    assert np.array_equal(panda.rnea(q[::-1][::-1], dq, ddq), wanted)
    assert panda.rnea(np.zeros(7, dtype=int), np.zeros(7), np.zeros(7)).shape == (7,)
    assert panda.rnea(q[:0], dq[:0], ddq[:0]).shape == (0, 7)


@pytest.mark.parametrize("count", [1, 63, 64, 65, 200])
def test_a_given_array_is_filled(panda, count):
    q, dq, ddq = states(7, count)
    out = np.full((count + 1, 7), np.nan)
    assert panda.rnea(q, dq, ddq, out=out[:count]).ctypes.data == out.ctypes.data
    assert np.array_equal(out[:count], panda.rnea(q, dq, ddq)) and np.isnan(out[count:]).all()
    for wrong in (out, np.empty((7, count)) if count > 1 else out, np.empty((count, 7), dtype=np.float32), "no array"):
        with pytest.raises(dynid.Error, match=rf"out: a writable float64 array .* of shape \({count}, 7\)"):
            panda.rnea(q, dq, ddq, out=wrong)
    out.setflags(write=False)
    with pytest.raises(dynid.Error, match="out: a writable"):
        panda.rnea(q, dq, ddq, out=out[:count])


def test_wrong_shapes_are_named(panda):
    q, dq, ddq = states(7, 3)
    with pytest.raises(dynid.Error, match="q: shape"):
        panda.rnea(q[:, :6], dq, ddq)
    with pytest.raises(dynid.Error, match="dq: another shape"):
        panda.rnea(q, dq[:2], ddq)


def test_errors_have_the_librarys_text(tmp_path):
    with pytest.raises(dynid.Error, match="no_such.yaml"):
        dynid.Robot.from_file(str(tmp_path / "no_such.yaml"))
    with pytest.raises(ValueError):  # it is one
        dynid.robot("<robot name='x'/>")
    with pytest.raises(dynid.Error, match="withhold: nonsense is not friction"):
        dynid.diagnose(PANDA, dynid.log(q=np.zeros((10, 7)), rate=10.0), withhold=["nonsense"])
    with pytest.raises(dynid.Error, match="friction: 'no' is none of"):
        dynid.identify(PANDA, [], friction="no")


def test_yaml_reads_back(panda):
    again = dynid.robot(panda.to_yaml())
    q, dq, ddq = states(7, 5)
    assert np.allclose(again.rnea(q, dq, ddq), panda.rnea(q, dq, ddq), atol=1e-12)
    assert again.joint_names == panda.joint_names
    assert "7 joints" in repr(again)


def test_gravity(panda):
    q = states(7, 4)[0]
    assert np.array_equal(panda.replace(gravity=np.zeros(3)).gravity_torque(q), np.zeros((4, 7)))
    assert np.allclose(dynid.robot(PANDA, gravity=[0, 0, 9.81]).gravity_torque(q), -panda.gravity_torque(q), atol=1e-12)


def test_the_estimator_sees_a_push(panda):
    estimator = dynid.Estimator(panda)
    q, zero = np.array([0.1, -0.5, 0.2, -1.8, 0.1, 1.5, 0.3]), np.zeros(7)
    holding = panda.gravity_torque(q) + panda.friction_torque(np.zeros((1, 7)))[0]
    push = np.array([0, 5.0, 0, 0, 0, 0, 0])
    for k in range(500):
        # Encoders and torque sensors are never quite still.
        estimate = estimator.step(0.001, q + 1e-9 * (k % 2), zero, holding - push)
    assert np.allclose(estimate.residual, push, atol=0.05)
    assert estimate.contact[1] and not estimate.contact[0]
    assert estimator.step(0.001, q * np.nan, zero, holding).status == ["bad_input"]
