# SPDX-License-Identifier: Apache-2.0
"""Batched inverse dynamics from NumPy beside Pinocchio's Python loop and its own batched form, the published Panda,
one core, one run, repetitions interleaved:

    taskset -c 1 python test/benchmark/python_rnea.py [SAMPLES] [REPETITIONS]

needs dynid and NumPy; the comparison needs `pip install pin` in the same environment."""

import pathlib
import statistics
import sys
import time

import numpy as np

import dynid

ROOT = pathlib.Path(__file__).resolve().parents[2]


def pinocchio_forms(panda, states):
    """{name: (work, samples)}: the loop over a tenth of the samples, and what Pinocchio has for many."""
    try:
        import pinocchio as pin
    except ImportError:
        print("pinocchio is not installed: no comparison", file=sys.stderr)
        return {}
    model = pin.buildModelFromXML(dynid.export(panda, "urdf").text)
    model.gravity.linear = panda.gravity
    model.armature = panda.rotor_inertia
    data = model.createData()
    q, dq, ddq = (x[: max(1, len(x) // 10)] for x in states)
    tau = panda.rnea(q[0], dq[0], ddq[0])
    assert np.abs(pin.rnea(model, data, q[0], dq[0], ddq[0]) - tau).max() < 1e-9 * np.abs(tau).max()
    rnea = pin.rnea

    def loop():
        for a, b, c in zip(q, dq, ddq):
            rnea(model, data, a, b, c)

    forms = {"pinocchio, loop in Python": (loop, len(q))}
    if hasattr(pin, "rneaInParallel"):
        pool = pin.ModelPool(model, 1)
        columns = [np.asfortranarray(x.T) for x in states]  # as it wants them: a sample a column
        out = np.zeros_like(columns[0], order="F")
        forms["pinocchio, rneaInParallel, 1 thread"] = (lambda: pin.rneaInParallel(1, pool, *columns, out), len(states[0]))
    else:
        print("this Pinocchio has no rneaInParallel", file=sys.stderr)
    return forms


def main(samples=100_000, repetitions=25):
    panda = dynid.robot(ROOT / "config" / "panda.yaml")
    random = np.random.default_rng(1)
    states = [random.uniform(-2, 2, (samples, panda.n)) for _ in range(3)]
    out = np.empty_like(states[0])
    forms = {
        "dynid, rnea(q, dq, ddq)": (lambda: panda.rnea(*states), samples),
        "dynid, rnea(..., out=tau)": (lambda: panda.rnea(*states, out=out), samples),
        **pinocchio_forms(panda, states),
    }
    times = {name: [] for name in forms}
    for _ in range(repetitions):
        for name, (work, count) in forms.items():
            start = time.perf_counter()
            work()
            times[name].append((time.perf_counter() - start) / count * 1e9)
    first = min(times["dynid, rnea(q, dq, ddq)"])
    print(f"{'ns a sample':40} minimum   median   ratio of minima")
    for name, found in times.items():
        print(f"{name:40} {min(found):7.1f}  {statistics.median(found):7.1f}   {min(found) / first:.2f}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
