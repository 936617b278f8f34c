# SPDX-License-Identifier: Apache-2.0
"""Dynamic coefficients of a Panda from a recorded motion: python 01_identify_a_panda.py [LOG]

Without a log one is made of the published model."""

import os
import pathlib
import sys

import dynid

root = pathlib.Path(os.environ.get("DYNID_EXAMPLE_ROOT", pathlib.Path(__file__).resolve().parents[2]))
panda = dynid.Robot.from_file(str(root / "config" / "panda.yaml"))

if len(sys.argv) > 1:
    log = dynid.read(sys.argv[1], panda)
else:
    log = dynid.simulate(panda, duration=15.0, rate=250, seed=1).log

found = dynid.identify(panda, log)
print(f"{found.rank} coefficients, relative error {found.relative_error_percent:.2f} %")
for c in found.coefficients[:5]:
    print(f"  {c.name:6} {c.value: .4f}  +- {c.std_percent:.1f} %   {c.expression}")
found.robot.write("identified.yaml")
print("written: identified.yaml")
