# SPDX-License-Identifier: Apache-2.0
"""`dynid.diagnose` beside the program on the same files: times, interleaved, and whether the JSON has the same bytes
(but for the line with the seconds that it took).

    python test/benchmark/python_diagnose.py PROGRAM [REPETITIONS] [MODEL LOG...]"""

import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import dynid

ROOT = pathlib.Path(__file__).resolve().parents[2]


def without_seconds(text):
    return "\n".join(line for line in text.splitlines() if '"seconds"' not in line)


def main(program, repetitions="5", *files):
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        if files:
            model, logs = files[0], list(files[1:])
        else:
            model, logs = str(ROOT / "config" / "panda.yaml"), []
            for seed in (1, 2):
                logs.append(str(folder / f"{seed}.csv"))
                hidden = ["payload:mass=1.5,com=0:0:0.08", "coulomb_friction:joints=4,coefficient=1.0"]
                dynid.simulate(model, duration=20.0, rate=500, effects=hidden, seed=seed).log.write(logs[-1])
        here, there = [], []
        for _ in range(int(repetitions)):
            start = time.perf_counter()
            subprocess.run([program, "diagnose", "--model", model, "--log", *logs, "--json", str(folder / "gap.json"), "--quiet"],
                           check=False)
            there.append(time.perf_counter() - start)
            start = time.perf_counter()
            gap = dynid.diagnose(model, *logs)
            here.append(time.perf_counter() - start)
            same = without_seconds((folder / "gap.json").read_text()) == without_seconds(gap.json)
            print(f"program {there[-1]:.2f} s, Python {here[-1]:.2f} s, {'the same bytes' if same else 'OTHER BYTES'}", flush=True)
        ratio = min(here) / min(there)
        print(f"minimum: program {min(there):.2f} s, Python {min(here):.2f} s, ratio {ratio:.3f}; "
              f"median: {statistics.median(there):.2f} s, {statistics.median(here):.2f} s")


if __name__ == "__main__":
    main(*sys.argv[1:])
