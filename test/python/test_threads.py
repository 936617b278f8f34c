# SPDX-License-Identifier: Apache-2.0
import concurrent.futures
import gc
import resource
import subprocess
import sys
import tracemalloc

import numpy as np

import dynid
from conftest import states, without_seconds


def test_eight_threads_give_the_same_bytes(panda):
    log = dynid.simulate(panda, duration=8.0, effects=["payload:mass=2,com=0:0:0.1"], rate=200, seed=3).log
    alone = without_seconds(dynid.diagnose(panda, log, replay=False).json)
    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        together = list(pool.map(lambda _: without_seconds(dynid.diagnose(panda, log, replay=False).json), range(8)))
    assert set(together) == {alone}


def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


def test_a_thousand_calls_leave_nothing(panda, tmp_path):
    q, dq, ddq = states(7, 100)
    arrays = dict(t=np.arange(100) / 100, q=q, dq=dq, tau=ddq)
    np.savez(tmp_path / "a.npz", **arrays)
    text = panda.to_yaml()

    def once():
        panda.rnea(q, dq, ddq)
        panda.regressor(q, dq, ddq)
        panda.mass_matrix(q[0])
        robot = dynid.Robot.from_text(text)
        log = dynid.read(tmp_path / "a.npz", robot)
        kept = log.q
        del log
        assert kept[0, 0] == q[0, 0]  # the view keeps what it looks at
        dynid.torque(robot, dynid.log(**arrays, ddq=ddq))
        try:
            panda.rnea(q, dq[:1], ddq)
        except dynid.Error:
            pass

    for _ in range(100):
        once()
    gc.collect()
    tracemalloc.start()
    before, resident_before = tracemalloc.get_traced_memory()[0], resident()
    for _ in range(1000):
        once()
    gc.collect()
    after = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert after - before < 100_000
    assert resident() - resident_before < 20_000_000


def test_the_import_loads_nothing_that_takes_long():
    code = "import sys, dynid; print([m for m in ('numpy', 'pandas', 'mujoco', 'pyarrow') if m in sys.modules])"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert loaded.strip() == "[]"
