# SPDX-License-Identifier: Apache-2.0
import os
import pathlib
import re
import subprocess
import sys

import pytest

from conftest import ROOT

EXAMPLES = sorted((ROOT / "examples" / "python").glob("*.py"))


def test_there_are_examples():
    assert len(EXAMPLES) >= 4


@pytest.mark.parametrize("path", EXAMPLES, ids=[p.stem for p in EXAMPLES])
def test_it_runs(path, tmp_path):
    if "mujoco" in path.read_text():
        pytest.importorskip("mujoco")
    done = subprocess.run([sys.executable, str(path)], cwd=tmp_path, capture_output=True, text=True, timeout=900,
                          env={**os.environ, "DYNID_EXAMPLE_ROOT": str(ROOT)})
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.strip()
    for correlation in re.findall(r"correlation ([^)]*)", done.stdout):
        assert abs(float(correlation)) <= 1
