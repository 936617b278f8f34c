# SPDX-License-Identifier: Apache-2.0
"""What the tests of the Python package share. They run on an installed package, or on the one of a build folder by
PYTHONPATH=build/python-package."""

import os
import pathlib

import numpy as np
import pytest

import dynid

ROOT = pathlib.Path(__file__).resolve().parents[2]
PANDA = str(ROOT / "config" / "panda.yaml")


@pytest.fixture(scope="session")
def panda():
    return dynid.Robot.from_file(PANDA)


@pytest.fixture(scope="session")
def data():
    """The folder of recordings; without it a test is skipped by name."""
    folder = os.environ.get("DYNID_DATA")
    if not folder:
        pytest.skip("DYNID_DATA is not set")
    return pathlib.Path(folder)


@pytest.fixture(scope="session")
def payload_log(panda):
    """A Panda that carries 2 kg, at 250 Hz."""
    return dynid.simulate(panda, duration=12.0, effects=["payload:mass=2,com=0:0:0.1"], rate=250, seed=3).log


@pytest.fixture(scope="session")
def other_log(panda):
    return dynid.simulate(panda, duration=12.0, effects=["payload:mass=2,com=0:0:0.1"], rate=250, seed=4).log


def states(n, count, seed=1):
    """q, dq, ddq (count, n)."""
    random = np.random.default_rng(seed)
    return [random.uniform(-2, 2, (count, n)) for _ in range(3)]


def without_seconds(text):
    """JSON as it stands, but for the time that the work took."""
    return "\n".join(line for line in text.splitlines() if '"seconds"' not in line)
