# SPDX-License-Identifier: Apache-2.0
import json
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import dynid
from conftest import PANDA, without_seconds


def run(*arguments, **options):
    return subprocess.run([sys.executable, "-m", "dynid", *map(str, arguments)], capture_output=True, text=True, **options)


@pytest.fixture(scope="session")
def files(payload_log, other_log, tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    payload_log.write(str(folder / "a.csv"))
    other_log.write(str(folder / "b.csv"))
    return folder


@pytest.fixture(scope="session")
def gap(files):
    return dynid.diagnose(PANDA, files / "a.csv", files / "b.csv")


def test_diagnose_names_the_payload(gap):
    assert gap.verdict == "explained" and gap.succeeded
    assert gap.effects[0].name == "payload"
    assert gap.effects[0].parameters["mass"].value == pytest.approx(2.0, abs=0.1)
    assert gap.shrink > 0.9
    assert gap.patch.n == 7
    assert "payload" in str(gap) and "payload" in repr(gap)


def test_the_json_is_the_programs(gap, files, tmp_path):
    done = run("diagnose", "--model", PANDA, "--log", files / "a.csv", files / "b.csv", "--json", tmp_path / "gap.json", "--quiet")
    assert done.returncode == 0, done.stderr
    assert without_seconds((tmp_path / "gap.json").read_text()) == without_seconds(gap.json)


def test_the_json_is_that_of_the_cpp_program(gap, files, tmp_path):
    program = os.environ.get("DYNID_PROGRAM")
    if not program:
        pytest.skip("DYNID_PROGRAM is not set")
    subprocess.run([program, "diagnose", "--model", PANDA, "--log", str(files / "a.csv"), str(files / "b.csv"), "--json",
                    str(tmp_path / "gap.json"), "--quiet"], check=True)
    assert without_seconds((tmp_path / "gap.json").read_text()) == without_seconds(gap.json)


def test_results_in_memory_are_those_of_files(gap, payload_log, other_log, files):
    # The source's name is in the JSON; all else is the same.
    again = dynid.diagnose(PANDA, payload_log, other_log)
    strip = lambda text: without_seconds(text).replace(str(files / "a.csv"), "a").replace(str(files / "b.csv"), "b")
    assert strip(again.json).replace(payload_log.source, "a").count("payload") == strip(gap.json).count("payload")
    assert again.effects == gap.effects


def test_report_frame_and_notebook(gap, tmp_path):
    gap.report(tmp_path / "gap.html")
    page = (tmp_path / "gap.html").read_text()
    assert page.lstrip().startswith("<!DOCTYPE html>") and "payload" in page
    assert "<pre>" in gap._repr_html_()
    pandas = pytest.importorskip("pandas")
    frame = gap.to_frame()
    assert isinstance(frame, pandas.DataFrame) and "mass" in set(frame["parameter"])
    gap.write_json(tmp_path / "gap.json")
    assert json.loads((tmp_path / "gap.json").read_text())["verdict"] == "explained"


def test_identify_retrieve_and_export(panda, tmp_path):
    logs = [dynid.simulate(panda, duration=12.0, rate=250, seed=seed).log for seed in (1, 2)]
    found = dynid.identify(panda, logs[:1], validate=logs[1:])
    assert found.relative_error_percent < 10 and found.rank > 40
    assert found.validation is not None
    assert {c.name for c in found.coefficients} >= {"zz1", "mx2", "fv1"}
    frame = found.to_frame()
    assert len(frame) == len(found.coefficients)
    found.report(tmp_path / "identified.html")
    assert "Identification" in (tmp_path / "identified.html").read_text()
    urdf = dynid.export(found.robot, "urdf")
    assert urdf.text.startswith("<?xml") or "<robot" in urdf.text
    assert dynid.robot(urdf.text).n == 7
    with pytest.raises(dynid.Error, match="format: 'collada' is none of"):
        dynid.export(panda, "collada")


def test_reverse_and_retrieve_with_a_constraint_in_python(panda):
    q = np.random.default_rng(1).uniform(-2, 2, (300, 7))
    reversed_ = dynid.reverse(panda, q, panda.mass_matrix(q, rotor_inertia=False), panda.gravity_torque(q))
    assert reversed_.relative_error_percent < 1e-6
    calls = []

    def lighter(p):  # the second link, p as in the docs
        calls.append(p.shape)
        return 5.0 - p[10]

    found = dynid.retrieve(reversed_.robot, pathlib.Path(PANDA).with_name("panda_bounds.yaml"), runs=1, steps=1,
                           constraints={"link 2 below 5 kg": lighter})
    assert calls and set(calls) == {(70,)}
    names = {c["name"]: c for c in found.constraints}
    assert "link 2 below 5 kg" in names
    if found.feasible:
        assert found.robot.links[1][0] <= 5.0 + 1e-9
    with pytest.raises(dynid.Error, match="constraint 'broken': division by zero"):
        dynid.retrieve(reversed_.robot, pathlib.Path(PANDA).with_name("panda_bounds.yaml"), runs=1, steps=1,
                       constraints={"broken": lambda p: 1 / 0})


def test_an_effect_of_ones_own_is_named(panda):
    log = dynid.simulate(panda, duration=12.0, rate=250, seed=9).log
    tau = log.tau.copy()
    tau[:, 3] += 1.5 * np.sin(3 * log.q[:, 3])
    changed = dynid.log(t=log.t, q=log.q, dq=log.dq, tau=tau, source="cogging")
    own = dynid.Effect("magnet", lambda motion, j: np.sin(3 * motion.q[:, j]), [("size", "N m")])
    gap = dynid.diagnose(panda, changed, effects=[own], withhold=["torque_ripple"])
    assert len(json.loads(gap.json)["shrink"]["rollout"]["horizon_s"]) == 3  # the motion is replayed, without it
    assert [(e.name, e.joints) for e in gap.effects][:1] == [("magnet", [4])]
    # One value a joint, base to tip.
    assert gap.effects[0].parameters["size"].value == pytest.approx([0, 0, 0, 1.5, 0, 0, 0], abs=0.15)
    assert (gap.patch is None) == all(e.name == "magnet" for e in gap.effects)  # no model file can say it
    with pytest.raises(dynid.Error, match="effect 'broken': .*no attribute"):
        dynid.diagnose(panda, changed, effects=[dynid.Effect("broken", lambda motion, j: motion.nothing)], replay=False)


def test_torque_replay_and_servos(panda, tmp_path):
    log = dynid.simulate(panda, duration=3.0, rate=250, clean=True).log
    predicted = dynid.torque(panda, log)
    assert np.abs(predicted.tau - log.tau).max() < 0.5
    pytest.importorskip("mujoco")
    from mjcf_models import INHERIT_RANGE

    arm = dynid.robot(INHERIT_RANGE)
    t = np.arange(300) / 50
    u = 0.4 * np.sin(t)[:, None] * np.ones(3)
    first = dynid.replay(arm, dynid.log(t=t, u=u, q=np.zeros((300, 3))))
    assert first.q.shape == (300, 3) and np.abs(first.q[:, 0] - u[:, 0]).mean() < 0.2
    again = dynid.replay(arm, dynid.log(t=t, u=u, q=first.q))
    assert max(json.loads(again.json)["error"]) < 0.05
    found = dynid.identify_servo(dynid.log(t=t, u=u, q=first.q))
    assert len(found.joints) == 3 and found.robot.n == 3
    with pytest.raises(dynid.Error, match="u1"):
        dynid.replay(arm, dynid.log(t=t, q=first.q))


def test_excite(panda):
    found = dynid.excite(panda, collision="none", starts=1, effort=10, period=5.0, rate=100.0)
    if found.feasible:
        assert found.motion.q.shape[1] == 7 and len(found.motion.t) == pytest.approx(501, abs=2)


def test_progress_is_told_on_the_calling_thread(panda, payload_log):
    told = []
    dynid.diagnose(panda, payload_log, progress=lambda stage, share: told.append((stage, share, threading.get_ident())))
    assert told and all(thread == threading.get_ident() for _, _, thread in told)
    shares = [share for _, share, _ in told]
    assert shares == sorted(shares) and 0 <= shares[0] and shares[-1] <= 1


def test_what_progress_raises_ends_the_job(panda, payload_log):
    def refuse(stage, share):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        dynid.diagnose(panda, payload_log, progress=refuse)


INTERRUPTED = """
import os, signal, sys, threading, time
import dynid
robot = dynid.robot(sys.argv[1])
found = dynid.identify(robot, dynid.read(sys.argv[2], robot)).robot
sent = []
threading.Timer(1.0, lambda: (sent.append(time.monotonic()), os.kill(os.getpid(), signal.SIGINT))).start()
try:
    dynid.retrieve(found, sys.argv[3], runs=10000, steps=100)
except KeyboardInterrupt:
    print(time.monotonic() - sent[-1])
    sys.exit(7)  # joins the search where it next looks
print("not interrupted")
"""


def test_ctrl_c_ends_a_long_job(files):
    done = subprocess.run([sys.executable, "-c", INTERRUPTED, PANDA, str(files / "a.csv"),
                           str(pathlib.Path(PANDA).with_name("panda_bounds.yaml"))], capture_output=True, text=True, timeout=300)
    assert done.returncode == 7, done.stdout + done.stderr
    assert float(done.stdout) < 10  # of minutes; how soon it is: test/benchmark/python_startup.py


def test_bad_input_is_one_line_and_status_2(tmp_path):
    done = run("diagnose", "--model", PANDA, "--log", tmp_path / "none.csv")
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and "none.csv" in done.stderr
    assert run("--version").stdout.strip() == dynid.__version__


def test_the_program_reads_what_python_reads(payload_log, files, tmp_path):
    np.savez(tmp_path / "a.npz", t=payload_log.t, q=payload_log.q, dq=payload_log.dq, tau=payload_log.tau)
    for name, file in (("csv", files / "a.csv"), ("npz", tmp_path / "a.npz")):
        done = run("identify", "--robot", PANDA, "--log", file, "--json", tmp_path / f"{name}.json", "--quiet",
                   "--out", tmp_path / f"{name}.yaml")
        assert done.returncode == 0, done.stderr
    a, b = (json.loads((tmp_path / f"{name}.json").read_text()) for name in ("csv", "npz"))
    assert a["coefficients"] == b["coefficients"]


def test_mjcf_for_the_program(tmp_path):
    pytest.importorskip("mujoco")
    from mjcf_models import FULL_INERTIA

    (tmp_path / "arm.xml").write_text(FULL_INERTIA)
    done = run("info", "--robot", tmp_path / "arm.xml", "--json", "-")
    assert done.returncode == 0, done.stderr
    assert len(json.loads(done.stdout)["joints"]) == 4
