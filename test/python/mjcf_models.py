# SPDX-License-Identifier: Apache-2.0
"""Arms in MJCF that say the same things in MuJoCo's many ways. Each: name, text, tip (or "")."""

DEFAULTS = """
<mujoco model="defaults">
  <compiler angle="degree" autolimits="true"/>
  <option gravity="0 1 -9.7" integrator="implicitfast"/>
  <default>
    <joint damping="0.3" armature="0.02" frictionloss="0.1"/>
    <geom density="700"/>
    <default class="wrist">
      <joint damping="0.05" range="-90 90"/>
      <default class="last"><joint armature="0.001" axis="1 0 0"/></default>
    </default>
  </default>
  <worldbody>
    <body name="base" pos="0.1 0 0.2" euler="10 20 30">
      <geom type="box" size="0.1 0.1 0.1"/>
      <body name="upper" pos="0 0 0.1" euler="0 0 40" childclass="wrist">
        <joint name="a" axis="0 1 0" pos="0.01 0.02 0.03"/>
        <geom type="capsule" fromto="0 0 0 0 0.05 0.3" size="0.04"/>
        <body name="fore" pos="0 0.05 0.3">
          <joint name="b" axis="1 1 0" class="last" ref="25"/>
          <geom type="cylinder" fromto="0 0 0 0.2 0 0.1" size="0.03" mass="0.7"/>
          <body name="hand" pos="0.2 0 0.1" axisangle="0 1 1 70">
            <joint name="c" class="last"/>
            <geom type="ellipsoid" size="0.05 0.03 0.02"/>
            <site name="tool" pos="0 0 0.07" euler="0 90 0"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

FULL_INERTIA = """
<mujoco model="full">
  <compiler angle="radian"/>
  <worldbody>
    <body name="l1" pos="0 0 0.3">
      <inertial pos="0.01 -0.02 0.1" mass="2.5" fullinertia="0.03 0.04 0.02 0.004 -0.003 0.002"/>
      <joint name="j1" axis="0 0 1" limited="true" range="-2.5 2.5"/>
      <body name="l2" pos="0.2 0 0.1" quat="0.7 0.1 -0.5 0.3">
        <inertial pos="0 0.05 0.1" quat="0.9 0.1 0.2 0.3" mass="1.5" diaginertia="0.012 0.02 0.025"/>
        <joint name="j2" type="slide" axis="0 1 0.2" ref="0.05" damping="3"/>
        <body name="l3" pos="0 0.3 0" zaxis="1 0.2 0">
          <inertial pos="0.03 0 0.02" mass="0.8" fullinertia="0.002 0.0025 0.0021 0.0001 0.0002 -0.0001"/>
          <joint name="j3" axis="0 0 1" armature="0.15"/>
          <joint name="j4" axis="0 1 0" pos="0 0 0.1" stiffness="4" springref="0.3"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

INHERIT_RANGE = """
<mujoco model="servos">
  <compiler angle="radian" autolimits="true"/>
  <default>
    <joint range="-1.5 1.5" damping="0.6" frictionloss="0.05" armature="0.03"/>
    <position kp="40" inheritrange="1" forcerange="-3 3"/>
    <default class="weak"><position kp="12" kv="0.4"/></default>
  </default>
  <worldbody>
    <body name="base">
      <body name="pan" pos="0 0 0.05">
        <joint name="pan" axis="0 0 1"/><geom type="box" size="0.03 0.02 0.03" mass="0.2"/>
        <body name="lift" pos="0.03 0 0.05">
          <joint name="lift" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 0.12" size="0.01" mass="0.15"/>
          <body name="elbow" pos="0 0 0.12">
            <joint name="elbow" axis="0 1 0" actuatorfrcrange="-2 2"/>
            <geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.01" mass="0.1"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="pan" joint="pan"/>
    <position name="lift" joint="lift" class="weak"/>
    <position name="elbow" joint="elbow" class="weak" kv="0.9" gear="2"/>
  </actuator>
</mujoco>
"""

GRIPPER = """
<mujoco model="gripper">
  <worldbody>
    <body name="stand" pos="0 0 0.4">
      <body name="arm">
        <joint name="swing" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02"/>
        <body name="palm" pos="0 0 -0.3" euler="0 0 30">
          <joint name="roll" axis="0 0 1"/><geom type="box" size="0.04 0.02 0.02"/>
          <body name="left" pos="0.03 0 -0.04"><joint name="left" type="slide" axis="1 0 0" ref="0.01"/>
            <geom type="box" size="0.005 0.01 0.03"/></body>
          <body name="right" pos="-0.03 0 -0.04"><joint name="right" type="slide" axis="-1 0 0"/>
            <geom type="box" size="0.005 0.01 0.03"/></body>
          <site name="grasp" pos="0 0 -0.07"/>
        </body>
      </body>
    </body>
    <body name="box" pos="1 0 0.1"><freejoint/><geom type="box" size="0.05 0.05 0.05"/></body>
  </worldbody>
</mujoco>
"""

SPHERICAL_WRIST = """
<mujoco model="wrist">
  <compiler angle="radian" eulerseq="zyx"/>
  <worldbody>
    <body name="shoulder" euler="0.2 -0.4 0.9">
      <joint name="s1" axis="0 0 1"/><joint name="s2" axis="0 1 0"/><joint name="s3" axis="1 0 0"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" density="1500"/>
      <body name="slide" pos="0.3 0 0">
        <joint name="s4" type="slide" axis="1 0 0.3"/><joint name="s5" axis="0 0.6 0.8" pos="0.02 0.01 0" ref="-0.4"/>
        <geom type="box" size="0.05 0.02 0.03" pos="0.03 0.01 0" euler="0.3 0.1 0"/>
        <body name="fixed" pos="0.05 0 0.02" euler="0 0.5 0"><geom type="sphere" size="0.02" mass="0.3"/>
          <body name="end" pos="0 0 0.05"><joint name="s6" axis="0 0 -1"/><geom type="box" size="0.03 0.01 0.02" mass="0.2"/></body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def chain(n, seed):
    """A random serial arm: hinges and slides about any axis, with anchors, references, explicit inertias."""
    import numpy as np

    random = np.random.default_rng(seed)
    row = lambda x: " ".join(map(repr, np.asarray(x).tolist()))
    text, close = "", ""
    for k in range(n):
        half = random.normal(size=(3, 3))
        points = half @ half.T * 0.01 + 0.002 * np.eye(3)  # of a body of points: its inertia can exist
        inertia = np.trace(points) * np.eye(3) - points
        full = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        kind = "slide" if random.random() < 0.3 else "hinge"
        text += (f'<body name="b{k}" pos="{row(random.normal(size=3) * 0.3)}" quat="{row(random.normal(size=4))}">'
                 f'<inertial pos="{row(random.normal(size=3) * 0.1)}" mass="{random.uniform(0.5, 4)!r}" fullinertia="{row(full)}"/>'
                 f'<joint name="j{k}" type="{kind}" axis="{row(random.normal(size=3))}" pos="{row(random.normal(size=3) * 0.1)}" '
                 f'ref="{random.uniform(-1, 1)!r}" armature="{random.uniform(0, 0.2)!r}" damping="{random.uniform(0, 1)!r}"/>')
        close += "</body>"
    return (f'<mujoco model="chain{n}"><compiler angle="radian"/><option gravity="{row(random.normal(size=3) * 5)}"/>'
            f"<worldbody>{text}{close}</worldbody></mujoco>")


MODELS = [("defaults", DEFAULTS, ""), ("defaults_site", DEFAULTS, "tool"), ("full_inertia", FULL_INERTIA, ""),
          ("inherit_range", INHERIT_RANGE, ""), ("gripper_site", GRIPPER, "grasp"), ("gripper_finger", GRIPPER, "left"),
          ("spherical_wrist", SPHERICAL_WRIST, "")] + [(f"chain{n}", chain(n, 40 + n), "") for n in (1, 2, 5, 6, 7, 9)]
