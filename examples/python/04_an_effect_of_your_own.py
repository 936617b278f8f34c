# SPDX-License-Identifier: Apache-2.0
"""An effect that the library does not know, written in Python, sought beside all the others."""

import os
import pathlib

import numpy as np

import dynid

root = pathlib.Path(os.environ.get("DYNID_EXAMPLE_ROOT", pathlib.Path(__file__).resolve().parents[2]))
model = dynid.robot(root / "config" / "panda.yaml")

log = dynid.simulate(model, duration=12.0, rate=250, seed=4).log
tau = log.tau.copy()
tau[:, 1] += 2.0 * np.tanh(4 * log.q[:, 1])  # a hose that stiffens at both sides
log = dynid.log(t=log.t, q=log.q, dq=log.dq, tau=tau, source="with a hose")


def hose(motion, joint):
    """Torque [N m] of joint `joint` for a stiffness of 1."""
    return np.tanh(4 * motion.q[:, joint])


gap = dynid.diagnose(model, log, effects=[dynid.Effect("hose", hose, [("torque", "N m")])])
print(gap)
for effect in gap.effects:
    print(effect.name, effect.joints, {key: (p.value, p.unit) for key, p in effect.parameters.items()})
