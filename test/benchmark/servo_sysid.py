# SPDX-License-Identifier: Apache-2.0
"""`dynid identify --servo` beside MuJoCo's own system identification (`mujoco.sysid`) on a real SO-101, in one run:
seconds, also of processor time (which other work on the machine leaves as it is), and mean absolute open-loop position
error on the motions that neither was fitted to.

    python3 test/benchmark/servo_sysid.py PROGRAM DATA [FOLDER] [--iterations N] [--held-out N]

DATA: the folder that has so101_real. FOLDER: where a virtual environment with `mujoco[sysid]` from PyPI is made, once
(build/venv_sysid). MuJoCo fits, as its example for this arm does, armature, frictionloss, damping and stiffness of each joint, from
the shipped model, and one transport delay, chosen from --delays by a first short fit to one motion with each. Its progress goes to
the standard error; it takes a quarter of an hour of processor time."""

import argparse
import contextlib
import csv
import json
import pathlib
import resource
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as xml

FITTED = ("chirp_sweep", "multisine", "friction_gravity")
JOINTS = 6


def read(path):
    """t, u, q as lists of rows."""
    with open(path, encoding="utf-8") as file:
        rows = [[float(x) for x in row] for row in csv.reader(file) if row and not row[0][:1].isalpha()]
    with open(path, encoding="utf-8") as file:
        names = next(csv.reader(file))
    at = {name: k for k, name in enumerate(names)}
    pick = lambda prefix: [[row[at[f"{prefix}{j + 1}"]] for j in range(JOINTS)] for row in rows]
    return [row[at["t"]] for row in rows], pick("u") if "u1" in at else None, pick("q")


def mean_error(a, b):
    return [sum(abs(x[j] - y[j]) for x, y in zip(a, b)) / len(a) for j in range(JOINTS)]


def of_dynid(program, data, held_out):
    arm = data / "so101_new_calib.xml"
    with tempfile.TemporaryDirectory() as folder:
        model, motion = f"{folder}/servos.yaml", f"{folder}/motion.csv"
        start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([program, "identify", "--servo", "--robot", arm, "--log", *(data / f"{name}.csv" for name in FITTED),
                        "--out", model, "--quiet"], check=True)
        seconds, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
        processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        errors = []
        for name in held_out:
            subprocess.run([program, "replay", "--model", model, "--log", data / f"{name}.csv", "--out", motion, "--quiet"],
                           check=True)
            errors.append(mean_error(read(motion)[2], read(data / f"{name}.csv")[2]))
    return seconds, processor, errors


def without_looks(path):
    """The model as text, without meshes and what is drawn."""
    tree = xml.parse(path)
    root = tree.getroot()
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag in ("geom", "mesh", "material", "texture", "visual", "asset"):
                parent.remove(child)
    sensors = xml.SubElement(root, "sensor")
    for joint in root.find("actuator"):
        xml.SubElement(sensors, "jointpos", name=joint.get("joint") + "_pos", joint=joint.get("joint"))
    return xml.tostring(root, encoding="unicode")


def of_mujoco(data, held_out, iterations, delays):
    """Runs in the environment."""
    import mujoco
    import mujoco.rollout
    import numpy as np
    from mujoco import sysid

    spec = mujoco.MjSpec.from_string(without_looks(data / "so101_new_calib.xml"))
    model = spec.compile()
    names = [model.joint(model.actuator_trnid[a, 0]).name for a in range(model.nu)]

    def sequence(name, delay):
        t, u, q = (np.array(x) for x in read(data / f"{name}.csv"))
        t = t - t[0]
        times = np.arange(0.0, t[-1], model.opt.timestep)
        held = u[np.clip(np.searchsorted(t, times - delay + 1e-9, side="right") - 1, 0, None)]
        initial = sysid.create_initial_state(model, q[0], np.zeros(model.nv), np.zeros(model.na))
        return (initial, sysid.TimeSeries.from_control_names(times, held, model),
                sysid.TimeSeries.from_names(t, q, model), t, q)

    def parameters():
        out = sysid.ParameterDict()

        def add(name, nominal, low, high, modifier):
            out.add(sysid.Parameter(name, nominal=nominal, min_value=low, max_value=high, modifier=modifier))

        def set_joint(joint, key, value):
            now = np.asarray(getattr(joint, key), dtype=float)
            if now.size > 1:  # newer versions have a polynomial of the speed
                now[...] = 0.0
                now.flat[0] = value
            setattr(joint, key, now if now.size > 1 else value)

        def set_gain(s, actuator, kp):
            s.actuator(actuator).gainprm[0] = kp
            s.actuator(actuator).biasprm[1] = -kp

        for a, joint in enumerate(names):
            dof = model.jnt_dofadr[model.joint(joint).id]
            for key, initial, high in (("armature", model.dof_armature[dof], 1.0), ("damping", model.dof_damping[dof], 100.0),
                                       ("frictionloss", model.dof_frictionloss[dof], 10.0)):
                add(f"{joint}_{key}", initial, 1e-4, high, lambda s, p, j=joint, k=key: set_joint(s.joint(j), k, p.value[0]))
            actuator = model.actuator(a).name
            add(f"{joint}_kp", model.actuator_gainprm[a, 0], 1.0, 5000.0,
                lambda s, p, n=actuator: set_gain(s, n, p.value[0]))
        return out

    def fit(delay, most, logs=FITTED):
        all_of = [sequence(name, delay) for name in logs]
        sequences = sysid.ModelSequences(name="arm", spec=spec, sequence_name=list(logs), initial_state=[s[0] for s in all_of],
                                         control=[s[1] for s in all_of], sensordata=[s[2] for s in all_of])
        residual = sysid.build_residual_fn(models_sequences=[sequences])
        print(f"MuJoCo fits with a delay of {delay:g} s, {most} iterations at most", file=sys.stderr)
        with contextlib.redirect_stdout(sys.stderr):
            found, result = sysid.optimize(initial_params=parameters(), residual_fn=residual, optimizer="mujoco",
                                           max_iters=most)
        residuals, _, _ = residual(result.x, found)
        return float(sum(np.sum(np.square(r)) for r in residuals)), found

    start, before = time.perf_counter(), time.process_time()
    best = delays[0] if len(delays) == 1 else min((fit(delay, 3, FITTED[1:2])[0], delay) for delay in delays)[1]
    _, found = fit(best, iterations)
    seconds, processor = time.perf_counter() - start, time.process_time() - before
    fitted = sysid.apply_param_modifiers(found, spec)
    errors = []
    for name in held_out:
        initial, control, _, t, q = sequence(name, best)
        state, _ = mujoco.rollout.rollout(fitted, mujoco.MjData(fitted), initial, control.data[:-1])
        state = np.squeeze(state, axis=0)
        motion = np.stack([np.interp(t, state[:, 0], state[:, 1 + model.jnt_qposadr[model.joint(j).id]]) for j in names], axis=1)
        errors.append(np.abs(motion - q).mean(axis=0).tolist())
    print(json.dumps({"seconds": seconds, "processor": processor, "errors": errors, "delay": best, "version": mujoco.__version__}))


def environment(folder):
    python = folder / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "mujoco[sysid]"], check=True)
    return python


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path, nargs="?", default=pathlib.Path("build/venv_sysid"))
    parser.add_argument("--iterations", type=int, default=30)
    parser.add_argument("--held-out", type=int, default=27, help="motions, in the order of their names")
    parser.add_argument("--delays", default="0,0.01,0.02,0.03,0.04", help="[s] that MuJoCo's fit chooses from")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    a = parser.parse_args()
    data = a.data / "so101_real"
    held_out = [p.stem for p in sorted(data.glob("*.csv")) if p.stem not in FITTED][:a.held_out]
    if a.inside:
        return of_mujoco(data, held_out, a.iterations, [float(x) for x in a.delays.split(",")])
    python = environment(a.folder)
    seconds, processor, errors = of_dynid(a.program, data, held_out)
    out = subprocess.run([python, __file__, a.program, a.data, a.folder, "--iterations", str(a.iterations),
                          "--held-out", str(a.held_out), "--delays", a.delays, "--inside"], check=True, stdout=subprocess.PIPE, text=True).stdout
    theirs = json.loads(out.strip().splitlines()[-1])
    print(f"fitted on {', '.join(FITTED)}; mean absolute open-loop error on {len(held_out)} other motions")
    for name, time_taken, busy, all_of in (
            ("dynid identify --servo", seconds, processor, errors),
            (f"MuJoCo {theirs['version']} sysid", theirs["seconds"], theirs["processor"], theirs["errors"])):
        by_joint = [1e3 * sum(e[j] for e in all_of) / len(all_of) for j in range(JOINTS)]
        print(f"{name:24s} {time_taken:8.1f} s ({busy:.1f} s of processor time)  " + " ".join(f"{e:6.2f}" for e in by_joint) +
              f"  mean {sum(by_joint) / JOINTS:.2f} mrad")
    print(f"ratio of times {theirs['seconds'] / seconds:.1f}, of processor times {theirs['processor'] / processor:.1f}")


if __name__ == "__main__":
    main()
