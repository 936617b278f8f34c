# SPDX-License-Identifier: Apache-2.0
"""Every kind of log, made by the format's own writer, is the CSV to the last bit; damaged and foreign ones are one line."""

import json
import pathlib

import numpy as np
import pytest

import dynid

N, ROWS = 7, 400
NAMES = [f"arm_joint{j + 1}" for j in range(N)]


@pytest.fixture(scope="module")
def arrays():
    random = np.random.default_rng(5)
    return {"t": np.arange(ROWS) / 250, "q": random.normal(size=(ROWS, N)), "dq": random.normal(size=(ROWS, N)),
            "tau": random.normal(size=(ROWS, N))}


@pytest.fixture(scope="module")
def robot():
    rows = [(0, 0, 0.3, 0)] + [(0, np.pi / 2 * (-1) ** j, 0.1, 0) for j in range(N - 1)]
    text = dynid.Robot.from_dh(rows).to_yaml()
    for j in range(N):
        text = text.replace(f"name: joint{j + 1}\n", f"name: arm_joint{j + 1}\n")
    made = dynid.Robot.from_text(text)
    assert made.joint_names == NAMES
    return made


@pytest.fixture(scope="module")
def csv(arrays, tmp_path_factory):
    path = tmp_path_factory.mktemp("csv") / "log.csv"
    names = ["t"] + [f"{r}{j + 1}" for r in ("q", "dq", "tau") for j in range(N)]
    rows = np.column_stack([arrays["t"], arrays["q"], arrays["dq"], arrays["tau"]])
    path.write_text(",".join(names) + "\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows.tolist()))
    return dynid.read(path)


def same(a, b):
    for role in ("t", "q", "dq", "tau"):
        x, y = getattr(a, role), getattr(b, role)
        assert x is not None, role
        assert x.shape == y.shape and x.tobytes() == y.tobytes(), role


def ns(t, k):
    return int(round(t[k] * 1e9))


# ------------------------------------------------------------------------------------------------------------ writers

def write_npz(path, a):
    np.savez(path, **a)


def write_mat(path, a):
    pytest.importorskip("scipy.io").savemat(path, a)


def write_mat_struct(path, a):
    pytest.importorskip("scipy.io").savemat(path, {"log": {"t": a["t"], "q": a["q"].T, "dq": a["dq"].T, "tau": a["tau"].T}})


def write_hdf5(path, a):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        group = file.create_group("run")
        for name, value in a.items():
            group[name] = value


def write_parquet(path, a):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet

    columns = {"t": a["t"]}
    for role in ("q", "dq", "tau"):
        columns.update({f"{role}{j + 1}": a[role][:, j] for j in range(N)})
    pa.parquet.write_table(pa.table(columns), path)


def write_parquet_lists(path, a):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet

    pa.parquet.write_table(pa.table({"t": a["t"], **{r: list(a[r]) for r in ("q", "dq", "tau")}}), path)


def joint_state(store, kind, a, k, order):
    header = store.types["std_msgs/msg/Header"]
    time = store.types["builtin_interfaces/msg/Time"]
    stamp = ns(a["t"], k)
    fields = dict(stamp=time(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="base")
    if "seq" in getattr(header, "__dataclass_fields__", {}):
        fields["seq"] = k
    return store.types[kind](header=header(**fields), name=[NAMES[j] for j in order], position=a["q"][k, order],
                             velocity=a["dq"][k, order], effort=a["tau"][k, order])


KIND = "sensor_msgs/msg/JointState"
ORDER = [3, 0, 6, 1, 2, 5, 4]  # as joint_state_publisher has them: in none


def write_bag1(path, a):
    pytest.importorskip("rosbags")
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as writer:
        connection = writer.add_connection("/joint_states", KIND, typestore=store)
        for k in range(ROWS):
            writer.write(connection, 10**9 + ns(a["t"], k), store.serialize_ros1(joint_state(store, KIND, a, k, ORDER), KIND))


def write_bag2(path, a, storage="sqlite3"):
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/joint_states", KIND, typestore=store)
        for k in range(ROWS):
            writer.write(connection, 10**9 + ns(a["t"], k), store.serialize_cdr(joint_state(store, KIND, a, k, ORDER), KIND))


def write_bag2_mcap(path, a):
    write_bag2(path, a, "mcap")


def write_mcap_ros2(path, a):
    pytest.importorskip("mcap_ros2")
    from mcap_ros2.writer import Writer

    definition = ("std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
                  "================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
                  "================\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n")
    with open(path, "wb") as file:
        writer = Writer(file)
        schema = writer.register_msgdef(KIND, definition)
        for k in range(ROWS):
            stamp = ns(a["t"], k)
            writer.write_message(topic="/joint_states", schema=schema, log_time=10**9 + stamp, publish_time=10**9 + stamp, message={
                "header": {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": "base"},
                "name": [NAMES[j] for j in ORDER], "position": a["q"][k, ORDER].tolist(),
                "velocity": a["dq"][k, ORDER].tolist(), "effort": a["tau"][k, ORDER].tolist()})
        writer.finish()


def write_mcap_json(path, a):
    pytest.importorskip("mcap")
    from mcap.writer import Writer

    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("sensor_msgs/JointState", "jsonschema", b"{}")
        channel = writer.register_channel("/joint_states", "json", schema)
        for k in range(ROWS):
            stamp = ns(a["t"], k)
            writer.add_message(channel, 10**9 + stamp, json.dumps({
                "header": {"stamp": {"sec": stamp // 10**9, "nsec": stamp % 10**9}, "frame_id": ""},
                "name": [NAMES[j] for j in ORDER], "position": a["q"][k, ORDER].tolist(),
                "velocity": a["dq"][k, ORDER].tolist(), "effort": a["tau"][k, ORDER].tolist()}).encode(), 10**9 + stamp)
        writer.finish()


def write_sage(path, a):
    path.mkdir()
    (path / "joint_list.txt").write_text("\n".join(NAMES[j] for j in ORDER) + "\n")
    lists = lambda role, k: '"' + json.dumps(a[role][k, ORDER].tolist()) + '"'
    (path / "state_motor.csv").write_text("type,timestamp,positions,velocities,torques\n" + "".join(
        f"STATE_MOTOR,{float(a['t'][k])!r},{lists('q', k)},{lists('dq', k)},{lists('tau', k)}\n" for k in range(ROWS)))


PLAIN = {"npz": (write_npz, "log.npz"), "mat": (write_mat, "log.mat"), "mat_struct": (write_mat_struct, "log.mat"),
         "hdf5": (write_hdf5, "log.h5"), "parquet": (write_parquet, "log.parquet"),
         "parquet_lists": (write_parquet_lists, "log.parquet")}
NAMED = {"bag": (write_bag1, "log.bag"), "bag2_sqlite": (write_bag2, "log"), "bag2_mcap": (write_bag2_mcap, "log"),
         "mcap_ros2": (write_mcap_ros2, "log.mcap"), "mcap_json": (write_mcap_json, "log.mcap"), "sage": (write_sage, "log")}


@pytest.mark.parametrize("kind", PLAIN)
def test_arrays_are_the_csv_to_the_last_bit(kind, arrays, csv, tmp_path):
    write, name = PLAIN[kind]
    write(tmp_path / name, arrays)
    same(dynid.read(tmp_path / name), csv)


@pytest.mark.parametrize("kind", NAMED)
def test_named_joints_are_the_csv_to_the_last_bit(kind, arrays, csv, robot, tmp_path):
    write, name = NAMED[kind]
    write(tmp_path / name, arrays)
    same(dynid.read(tmp_path / name, robot), csv)
    if kind != "sage":
        order = list(dict.fromkeys(ORDER))
        assert np.array_equal(dynid.read(tmp_path / name).q, csv.q[:, order])


@pytest.mark.parametrize("kind", [*PLAIN, *NAMED])
def test_a_truncated_file_is_one_line(kind, arrays, robot, tmp_path):
    write, name = {**PLAIN, **NAMED}[kind]
    write(tmp_path / name, arrays)
    path = tmp_path / name
    file = path
    if path.is_dir():
        file = next(f for f in sorted(path.iterdir()) if f.suffix in (".db3", ".mcap") or f.name == "state_motor.csv")
    whole = file.read_bytes()
    # In the middle of a row of a text, and of whatever it is elsewhere.
    file.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(dynid.Error) as error:
        log = dynid.read(path, robot)
        if kind == "sage":
            assert len(log) < ROWS
            raise dynid.Error("a text that ends early is shorter: one line")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["log.npz", "log.mat", "log.h5", "log.parquet", "log.bag", "log.db3", "log.mcap", "log.csv"])
def test_a_foreign_file_is_one_line(name, tmp_path):
    (tmp_path / name).write_bytes(b"\x7fELF\x02\x01\x01 nothing of the kind\n" * 40)
    with pytest.raises(dynid.Error) as error:
        dynid.read(tmp_path / name)
    assert str(tmp_path / name) in str(error.value) and "\n" not in str(error.value)


def test_a_missing_joint_and_topic_are_named(arrays, robot, tmp_path, panda):
    write_bag1(tmp_path / "log.bag", arrays)
    with pytest.raises(dynid.Error, match=panda.joint_names[0]):
        dynid.read(tmp_path / "log.bag", panda)
    with pytest.raises(dynid.Error, match="no topic /nothing .there are /joint_states"):
        dynid.read(tmp_path / "log.bag", robot, topic="/nothing")


def test_a_missing_package_is_named(arrays, tmp_path, monkeypatch):
    write_parquet(tmp_path / "log.parquet", arrays)
    import builtins

    real = builtins.__import__

    def without(name, *rest, **more):
        if name.startswith("pyarrow"):
            raise ModuleNotFoundError(f"No module named '{name}'", name="pyarrow")
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(dynid.Error, match=r"pyarrow.*pip install dynid\[files\]"):
        dynid.read(tmp_path / "log.parquet")


def test_lerobot(tmp_path):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet

    random = np.random.default_rng(2)
    state, action = (random.normal(size=(90, 3)).astype(np.float32) for _ in range(2))
    joints = ["pan.pos", "lift.pos", "grip.pos"]
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "info.json").write_text(json.dumps({"fps": 30, "features": {
        name: {"dtype": "float32", "shape": [3], "names": joints} for name in ("observation.state", "action")}}))
    folder = tmp_path / "data" / "chunk-000"
    folder.mkdir(parents=True)
    pa.parquet.write_table(pa.table({
        "observation.state": list(state), "action": list(action),
        "timestamp": np.tile(np.arange(45) / 30, 2), "episode_index": np.repeat([0, 1], 45)}), folder / "file-000.parquet")
    with pytest.raises(dynid.Error, match="2 episodes, 0 to 1: choose one"):
        dynid.read(tmp_path)
    log = dynid.read(tmp_path, episode=1)
    assert np.array_equal(log.q, state[45:].astype(float)) and np.array_equal(log.u, action[45:].astype(float))
    with pytest.raises(dynid.Error, match="no episode 7"):
        dynid.read(folder / "file-000.parquet", episode=7)


def test_commands_of_a_bag_are_held(arrays, robot, tmp_path):
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    commands = np.random.default_rng(3).normal(size=(40, N))
    kind = "std_msgs/msg/Float64MultiArray"
    layout = store.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    with Writer(tmp_path / "log", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        state = writer.add_connection("/joint_states", KIND, typestore=store)
        command = writer.add_connection("/commands", kind, typestore=store)
        for k in range(ROWS):
            if k % 10 == 0:
                message = store.types[kind](layout=layout, data=commands[k // 10])
                writer.write(command, ns(arrays["t"], k), store.serialize_cdr(message, kind))
            writer.write(state, ns(arrays["t"], k), store.serialize_cdr(joint_state(store, KIND, arrays, k, ORDER), KIND))
    log = dynid.read(tmp_path / "log", robot, command_topic="/commands")
    assert np.array_equal(log.u, np.repeat(commands, 10, axis=0))
    assert np.array_equal(log.q, arrays["q"])
