# SPDX-License-Identifier: Apache-2.0
"""How long a log takes to be read: MCAP with sensor_msgs/JointState as ROS 2 writes it (alone, and with another topic
between), and parquet, of a seven-joint arm at 1 kHz; written first, by the formats' own writers.

    python test/benchmark/python_logs.py [HOURS] [FOLDER]"""

import pathlib
import resource
import struct
import sys
import tempfile
import time

import numpy as np

import dynid

NAMES = [f"joint{j + 1}" for j in range(7)]
DEFINITION = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def messages(values, count):
    """The serialised JointStates: the first one made by rosbags, the others alike but for stamp and numbers."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    state = store.types["sensor_msgs/msg/JointState"](
        header=header(stamp=stamp(sec=0, nanosec=0), frame_id="base"), name=NAMES,
        position=np.full(7, 1.0), velocity=np.full(7, 2.0), effort=np.full(7, 3.0))
    first = bytes(store.serialize_cdr(state, "sensor_msgs/msg/JointState"))
    places = [first.index(np.full(7, x).tobytes()) for x in (1.0, 2.0, 3.0)]
    raw = bytearray(first)
    for k in range(count):
        struct.pack_into("<iI", raw, 4, k // 1000, k % 1000 * 1000000)
        for role, place in enumerate(places):
            raw[place : place + 56] = values[k, 7 * role : 7 * role + 7].tobytes()
        yield bytes(raw)


def write_mcap(path, values, other):
    from mcap.writer import Writer

    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", DEFINITION.encode())
        channel = writer.register_channel("/joint_states", "cdr", schema)
        beside = writer.register_channel("/beside", "cdr", writer.register_schema("std_msgs/msg/Empty", "ros2msg", b""))
        for k, raw in enumerate(messages(values, len(values))):
            writer.add_message(channel, k * 1000000, raw, k * 1000000)
            if other:
                writer.add_message(beside, k * 1000000, bytes(4 + k % 60), k * 1000000)
        writer.finish()


def write_parquet(path, values):
    import pyarrow
    import pyarrow.parquet

    names = [f"{role}{j + 1}" for role in ("q", "dq", "tau") for j in range(7)]
    table = {"t": np.arange(len(values)) / 1000, **{name: values[:, k] for k, name in enumerate(names)}}
    pyarrow.parquet.write_table(pyarrow.table(table), path)


def main(hours=1.0, folder=None):
    count = int(3.6e6 * float(hours))
    values = np.sin(np.arange(count)[:, None] * np.linspace(1e-3, 5e-3, 21))
    values += 1e-3 * np.random.default_rng(1).normal(size=values.shape)
    with tempfile.TemporaryDirectory(dir=folder) as where:
        where = pathlib.Path(where)
        for name, write in (("log.parquet", write_parquet), ("alone.mcap", lambda p, v: write_mcap(p, v, False)),
                            ("beside.mcap", lambda p, v: write_mcap(p, v, True))):
            write(where / name, values)
            start = time.perf_counter(), time.process_time()
            log = dynid.read(where / name)
            took, worked = time.perf_counter() - start[0], time.process_time() - start[1]
            assert np.array_equal(log.q, values[:, :7]) and np.array_equal(log.tau, values[:, 14:])
            size = (where / name).stat().st_size
            print(f"{name:12} {count} samples, {size / 1e6:.0f} MB: {took:.2f} s ({worked:.2f} s of processor), "
                  f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.1f} GB at most", flush=True)
            del log
            (where / name).unlink()


if __name__ == "__main__":
    main(*sys.argv[1:])
