# SPDX-License-Identifier: Apache-2.0
"""What one waits for: `import dynid` in a fresh interpreter (beyond the interpreter's own start), and from Ctrl-C to
KeyboardInterrupt in the middle of a diagnosis and of a retrieval.

    python test/benchmark/python_startup.py [REPETITIONS]"""

import os
import pathlib
import signal
import statistics
import subprocess
import sys
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
IMPORT = """
import resource, time
used = lambda: sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
wall, work = time.perf_counter(), used()
import dynid
print(time.perf_counter() - wall, used() - work)
"""


def interrupted(work):
    """[s] from the signal to the exception; the signal comes half a second after the first word of progress."""
    sent = []

    def send():
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    def progress(stage, share):
        if not timer:
            timer.append(threading.Timer(0.5, send))
            timer[0].start()

    timer = []
    try:
        work(progress)
    except KeyboardInterrupt:
        return time.monotonic() - sent[0]
    timer[0].cancel()
    return float("nan")  # it was done before


def show(name, seconds):
    print(f"{name}: minimum {min(seconds) * 1e3:.0f} ms, median {statistics.median(seconds) * 1e3:.0f} ms, "
          f"longest {max(seconds) * 1e3:.0f} ms")


def main(repetitions="10"):
    runs = [tuple(map(float, subprocess.run([sys.executable, "-c", IMPORT], capture_output=True, text=True, check=True)
                      .stdout.split())) for _ in range(int(repetitions))]
    show("import, wall", [wall for wall, _ in runs])
    show("import, processor", [work for _, work in runs])
    import dynid

    panda = dynid.robot(ROOT / "config" / "panda.yaml")
    log = dynid.simulate(panda, duration=30.0, rate=500, effects=["payload:mass=2,com=0:0:0.1"]).log
    identified = dynid.identify(panda, log).robot
    bounds = ROOT / "config" / "panda_bounds.yaml"
    for name, work in (("diagnose", lambda p: dynid.diagnose(panda, log, progress=p)),
                       ("retrieve", lambda p: dynid.retrieve(identified, bounds, runs=1000, progress=p))):
        show(f"Ctrl-C in {name}", [interrupted(work) for _ in range(3)])
    # Jobs left behind end where they next look.
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
