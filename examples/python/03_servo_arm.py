# SPDX-License-Identifier: Apache-2.0
"""A hobby arm without torque sensors, from an MJCF and a LeRobot dataset, in ten lines.

python 03_servo_arm.py [MODEL.xml LOG...]: with an SO-101, `so101_new_calib.xml dataset#0 dataset#1`. Without, an arm
and its motion are made."""

import sys

import mujoco
import numpy as np

import dynid

ARM = """
<mujoco model="arm">
  <compiler angle="radian" autolimits="true"/>
  <default><joint range="-2 2" damping="0.6" frictionloss="0.05" armature="0.03"/><position kp="18" forcerange="-3 3"/></default>
  <worldbody><body name="base"><body name="pan" pos="0 0 0.05">
    <joint name="pan" axis="0 0 1"/><geom type="box" size="0.03 0.02 0.03" mass="0.2"/>
    <body name="lift" pos="0.03 0 0.05"><joint name="lift" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 0.12" size="0.01" mass="0.3"/>
    </body></body></body></worldbody>
  <actuator><position joint="pan"/><position joint="lift"/></actuator>
</mujoco>
"""


def recorded():
    """MuJoCo moves the arm, with stiffer servos than the model has; positions at 50 Hz."""
    model = mujoco.MjModel.from_xml_string(ARM.replace('kp="18"', 'kp="26"'))
    data = mujoco.MjData(model)
    t = np.arange(0, 20, 0.02)
    u = 0.6 * np.column_stack([np.sin(1.3 * t + 0.05 * t**2), np.sign(np.sin(0.9 * t))])
    q = np.empty_like(u)
    for k in range(len(t)):
        q[k] = data.qpos
        data.ctrl[:] = u[k]
        while data.time < t[k] + 0.02 - 1e-9:
            mujoco.mj_step(model, data)
    return dynid.log(t=t, u=u, q=q, source="recorded")


if len(sys.argv) > 2:
    robot = dynid.robot(sys.argv[1])
    logs = [dynid.read(path.partition("#")[0], robot, episode=int(path.partition("#")[2] or 0)) for path in sys.argv[2:]]
else:
    robot, logs = dynid.robot(ARM), [recorded()]

before = dynid.replay(robot, logs[-1])
found = dynid.identify_servo(logs, robot)
after = dynid.replay(found.robot, logs[-1])
print("error of the motion [mrad] before", 1e3 * np.abs(before.q - logs[-1].q).mean(axis=0).round(5))
print("                            after", 1e3 * np.abs(after.q - logs[-1].q).mean(axis=0).round(5))
print(found)
