# SPDX-License-Identifier: Apache-2.0
"""A model and a robot disagree: which effect makes it, and what does the model gain by it?"""

import os
import pathlib

import dynid

root = pathlib.Path(os.environ.get("DYNID_EXAMPLE_ROOT", pathlib.Path(__file__).resolve().parents[2]))
model = dynid.robot(root / "config" / "panda.yaml")

# The robot, in place of a recording: it carries something, and joint 4 has more friction than the model says.
hidden = ["payload:mass=1.5,com=0:0:0.08", "coulomb_friction:joints=4,coefficient=1.0"]
logs = [dynid.simulate(model, duration=12.0, rate=250, effects=hidden, seed=seed).log for seed in (1, 2)]

gap = dynid.diagnose(model, *logs)  # or: dynid.diagnose("arm.urdf", "run1.mcap", "run2.mcap")
print(gap)
for effect in gap.effects:
    joints = f" of joints {effect.joints}" if effect.joints else ""
    print(f"{effect.name}{joints}: {effect.share:.0%} of the gap, probability {effect.probability:.2f}")
gap.report("gap.html")
if gap.patch is not None:
    gap.patch.write("patched.yaml")
    print(f"the gap shrinks by {gap.shrink:.0%} with patched.yaml; the page is gap.html")
