# SPDX-License-Identifier: Apache-2.0
"""`dynid.read`: logs as people have them. Every kind becomes a table of named columns, which the library then
reads by the rules of CSV: names, units, stamps, holes and wraps mean the same in all of them."""

import os

from . import _core

_KINDS = (
    (b"#ROSBAG V", "bag"),
    (b"SQLite format 3\0", "sqlite"),
    (b"\x89MCAP0\r\n", "mcap"),
    (b"PAR1", "parquet"),
    (b"PK\x03\x04", "npz"),
    (b"\x93NUMPY", "npz"),
    (b"\x89HDF\r\n\x1a\n", "hdf5"),
    (b"MATLAB 5.0 MAT-file", "mat"),
)
_EXTENSIONS = {".bag": "bag", ".db3": "sqlite", ".mcap": "mcap", ".parquet": "parquet", ".npz": "npz", ".npy": "npz",
               ".mat": "mat", ".h5": "hdf5", ".hdf5": "hdf5"}
_SAY = {"bag": "a ROS 1 bag", "sqlite": "a ROS 2 bag (sqlite3)", "mcap": "an MCAP file", "parquet": "a parquet file",
        "npz": "a NumPy file", "mat": "a MATLAB file", "hdf5": "an HDF5 file"}


def read(path, robot=None, *, topic=None, command_topic=None, columns="", rate=0.0, episode=None):
    """Reads a log: CSV in every dialect, ROS 1 bag, ROS 2 bag (sqlite3 or MCAP, a folder or its file), MCAP as
    Foxglove writes it, LeRobot parquet (a file or the dataset's folder), npz, mat, HDF5, a SAGE folder.

    robot: a Robot, or the path of one: its joints are then found by name, in its order. Without it joints
    come in the file's own order. topic: of the sensor_msgs/JointState (/joint_states, or the only one).
    command_topic: of a JointState, trajectory_msgs/JointTrajectory or std_msgs/Float64MultiArray, whose
    positions become u, held until the next. columns: `q=PATTERN,dq=PATTERN,...` for names that are not
    understood by themselves. rate [Hz]: of a log without time. episode: of a LeRobot dataset, from 0.

    Returns a `Log`, SI units. Throws Error, one line that names the file, for one that is damaged, foreign,
    or needs a package that is not installed.
    """
    from ._models import robot as _robot

    path = os.fspath(path)
    known = None if robot is None else _robot(robot)
    names = [] if known is None else known.joint_names
    joints = 0 if known is None else known.n
    table = _table(path, names, topic, command_topic, episode)
    if table is None:
        return _core.read_csv(path, joints, names, columns, rate)
    return _core.log_of(path, table[0], table[1], joints, names, columns, rate)


def columns_for_program(path, joint_names, topic):
    """For the command-line program: names and columns of what it does not read itself, else None.
    `FILE#K` is episode K."""
    episode = None
    if "#" in path and not os.path.exists(path):
        path, _, number = path.rpartition("#")
        if not number.isdigit():
            raise _core.Error(f"{path}#{number}: an episode's number is expected behind #")
        episode = int(number)
    return _table(path, joint_names, None if topic == "/joint_states" else topic, None, episode)


def _table(path, joint_names, topic, command_topic, episode):
    kind = _kind(path)
    if kind is None:
        return None
    try:
        return _READERS[kind](path, joint_names, topic, command_topic, episode)
    except _core.Error:
        raise
    except ImportError as error:
        package = {"yaml": "pyyaml"}.get(error.name, error.name)
        raise _core.Error(
            f"{path}: {_SAY.get(kind, kind)} is read by the package {package}, which is not here: "
            f"pip install dynid[files] (or {package})"
        ) from None
    except Exception as error:  # what the formats' own packages say of a damaged file
        said = " ".join(str(error).split()) or type(error).__name__
        raise _core.Error(f"{path}: {_SAY.get(kind, kind)} that cannot be read: {said}") from None


def _kind(path):
    if os.path.isdir(path):
        entries = set(os.listdir(path))
        if "state_motor.csv" in entries:
            return "sage"
        if "metadata.yaml" in entries or any(e.endswith((".db3", ".mcap")) for e in entries):
            return "bag2"
        if "meta" in entries or any(e.endswith(".parquet") for e in entries):
            return "lerobot"
        raise _core.Error(f"{path}: a folder that is no ROS 2 bag, LeRobot dataset or SAGE recording")
    try:
        with open(path, "rb") as file:
            start = file.read(32)
    except OSError as error:
        raise _core.Error(f"{path}: {error.strerror}") from None
    for magic, kind in _KINDS:
        if start.startswith(magic):
            return "mat" if kind == "hdf5" and path.endswith(".mat") else kind
    wanted = _EXTENSIONS.get(os.path.splitext(path)[1].lower())
    if wanted is not None:
        raise _core.Error(f"{path}: not {_SAY[wanted]}, whatever its name says (its first bytes are others)")
    return None


# ------------------------------------------------------------------------------------------- messages with joints

def _seconds(stamps):
    """[s] from stamps [ns]; those since 1970 count from the first one, which a double holds exactly."""
    import numpy as np

    stamps = np.asarray(stamps, dtype=np.int64)
    if len(stamps) and stamps[0] > 10**17:
        stamps = stamps - stamps[0]
    return stamps / 1e9


class _JointStates:
    """Messages of one topic, put together: joints may be split over several messages."""

    def __init__(self, path, joint_names):
        self.path, self.wanted = path, list(joint_names)
        self.stamps, self.received, self.names, self.values = [], [], [], ([], [], [])

    def add(self, stamp, received, names, position, velocity, effort):
        self.stamps.append(stamp)
        self.received.append(received)
        self.names.append(tuple(names))
        for kept, values in zip(self.values, (position, velocity, effort)):
            kept.append(values)

    def table(self, commands=None, by_arrival=False):
        """Names and columns, in the robot's order where there is one. Stamps are those of the messages' heads,
        of their arrival where these are all zero or commands have none."""
        import numpy as np

        if not self.stamps:
            raise _core.Error(f"{self.path}: no joint states")
        if by_arrival or not any(self.stamps):
            self.stamps = self.received
        groups = list(dict.fromkeys(self.names))
        stamps = np.asarray(self.stamps, dtype=np.int64)
        parts = {}
        for group in groups:
            rows = [k for k, names in enumerate(self.names) if names == group] if len(groups) > 1 else range(len(stamps))
            for role, kept in zip(("pos", "vel", "eff"), self.values):
                values = [kept[k] for k in rows] if len(groups) > 1 else kept
                width = max(map(len, values), default=0)
                if width < len(group) or any(len(v) < len(group) for v in values):
                    continue  # the topic has no such quantity
                array = np.asarray(values, dtype=float)
                for j, joint in enumerate(group):
                    parts[joint, role] = (np.asarray([stamps[k] for k in rows]) if len(groups) > 1 else stamps, array[:, j])
        joints = self._chosen([joint for group in groups for joint in group])
        return _columns(self.path, joints, parts, self.wanted, commands)

    def _chosen(self, found):
        if not self.wanted:
            return list(dict.fromkeys(found))
        missing = [joint for joint in self.wanted if joint not in found]
        if missing:
            raise _core.Error(f"{self.path}: joint {missing[0]} is not in it (there are {', '.join(sorted(set(found)))})")
        return self.wanted


def _columns(path, joints, parts, wanted, commands):
    """A common clock: the stamps of the first joint's positions; what comes at others is the latest before."""
    import numpy as np

    if (joints[0], "pos") not in parts:
        raise _core.Error(f"{path}: joint {joints[0]} has no positions")
    clock = parts[joints[0], "pos"][0]
    start = max(parts[joint, "pos"][0][0] for joint in joints)
    if commands is not None:
        start = max(start, commands[0][0])
    first = int(np.searchsorted(clock, start))
    clock = clock[first:]
    if len(clock) == 0:
        raise _core.Error(f"{path}: the joints are never there together")
    roles = {"pos": "q", "vel": "dq", "eff": "tau"}
    names, columns = ["t"], [_seconds(clock)]
    for role, short in roles.items():
        if any((joint, role) not in parts for joint in joints):
            continue
        for j, joint in enumerate(joints):
            stamps, values = parts[joint, role]
            at = np.searchsorted(stamps, clock, side="right") - 1
            names.append(f"{joint}_{role}" if wanted else f"{short}{j + 1}")
            columns.append(np.ascontiguousarray(values[at]))
    if commands is not None:
        stamps, order, values = commands
        at = np.searchsorted(stamps, clock, side="right") - 1
        for j, joint in enumerate(joints):
            if order and joint not in order:
                raise _core.Error(f"{path}: joint {joint} is not commanded (commanded are {', '.join(order)})")
            k = order.index(joint) if order else j
            names.append(f"u{j + 1}")
            columns.append(np.ascontiguousarray(values[at, k]))
        if wanted:  # `u` goes by number: then all do
            names = ["t"] + [f"{short}{j + 1}" for role, short in roles.items()
                             if all((joint, role) in parts for joint in joints) for j in range(len(joints))]
            names += [f"u{j + 1}" for j in range(len(joints))]
    return names, columns


_STATE = ("sensor_msgs/msg/JointState", "sensor_msgs/JointState")
_COMMANDS = _STATE + ("trajectory_msgs/msg/JointTrajectory", "trajectory_msgs/JointTrajectory",
                      "std_msgs/msg/Float64MultiArray", "std_msgs/Float64MultiArray")


def _choose_topic(path, topics, topic):
    """topics: {name: type}."""
    states = [name for name, kind in topics.items() if kind in _STATE]
    if topic is not None:
        if topic not in topics:
            raise _core.Error(f"{path}: no topic {topic} (there are {', '.join(sorted(topics)) or 'none'})")
        if topics[topic] not in _STATE:
            raise _core.Error(f"{path}: topic {topic} has {topics[topic]}, not sensor_msgs/JointState")
        return topic
    if "/joint_states" in states:
        return "/joint_states"
    if len(states) == 1:
        return states[0]
    found = ", ".join(states) if states else ", ".join(f"{n} ({k})" for n, k in sorted(topics.items())) or "none"
    raise _core.Error(f"{path}: {'several' if states else 'no'} topics with sensor_msgs/JointState: choose one with topic ({found})")


def _stamp(message):
    stamp = message.header.stamp
    return stamp.sec * 10**9 + stamp.nanosec


def _from_messages(path, joint_names, messages, command_topic, command_kind):
    """messages: (is_command, received [ns], message)."""
    import numpy as np

    states = _JointStates(path, joint_names)
    heads, arrivals, order, values = [], [], [], []
    for is_command, received, message in messages:
        if not is_command:
            states.add(_stamp(message), received, message.name, message.position, message.velocity, message.effort)
            continue
        if "JointTrajectory" in command_kind and not len(message.points):
            continue
        arrivals.append(received)
        if "Float64MultiArray" in command_kind:
            values.append(message.data)
        elif "JointTrajectory" in command_kind:
            order = list(message.joint_names)
            values.append(message.points[0].positions)
        else:
            heads.append(_stamp(message))
            order = list(message.name)
            values.append(message.position)
    if command_topic is None:
        return states.table()
    if not values:
        raise _core.Error(f"{path}: no commands on {command_topic}")
    by_arrival = not any(heads) or not any(states.stamps)
    stamps = arrivals if by_arrival else heads
    return states.table((np.asarray(stamps, dtype=np.int64), order, np.asarray(values, dtype=float)), by_arrival)


def _check_command(path, topics, command_topic):
    if command_topic is None:
        return None
    if command_topic not in topics:
        raise _core.Error(f"{path}: no topic {command_topic} (there are {', '.join(sorted(topics)) or 'none'})")
    if topics[command_topic] not in _COMMANDS:
        raise _core.Error(f"{path}: topic {command_topic} has {topics[command_topic]}: no positions are commanded there")
    return topics[command_topic]


def _read_bag(path, joint_names, topic, command_topic, episode):
    from rosbags.rosbag1 import Reader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Reader(path) as reader:
        topics = {c.topic: c.msgtype for c in reader.connections}
        wanted = {_choose_topic(path, topics, topic)}
        kind = _check_command(path, topics, command_topic)
        if kind:
            wanted.add(command_topic)
        chosen = [c for c in reader.connections if c.topic in wanted]

        def messages():
            for connection, received, raw in reader.messages(connections=chosen):
                message = store.deserialize_ros1(raw, connection.msgtype)
                yield connection.topic == command_topic, received, message

        return _from_messages(path, joint_names, messages(), command_topic, kind or "")


def _read_sqlite(path, joint_names, topic, command_topic, episode):
    import sqlite3

    with sqlite3.connect(f"file:{os.path.abspath(path)}?mode=ro", uri=True) as database:
        topics = {name: (number, kind) for number, name, kind in database.execute("SELECT id, name, type FROM topics")}
        kinds = {name: kind for name, (_, kind) in topics.items()}
        chosen = _choose_topic(path, kinds, topic)
        rows = database.execute("SELECT timestamp, data FROM messages WHERE topic_id = ? ORDER BY timestamp",
                                (topics[chosen][0],)).fetchall()
        kind = _check_command(path, kinds, command_topic)
        commands = []
        if kind:
            commands = database.execute("SELECT timestamp, data FROM messages WHERE topic_id = ? ORDER BY timestamp",
                                        (topics[command_topic][0],)).fetchall()
    return _from_cdr(path, joint_names, [r[0] for r in rows], [r[1] for r in rows], command_topic, kind, commands)


def _from_cdr(path, joint_names, received, payloads, command_topic, command_kind, commands):
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    if command_kind is None:
        table = _alike_states(path, joint_names, received, payloads, store)
        if table is not None:
            return table

    def messages():
        for stamp, raw in zip(received, payloads):
            yield False, stamp, store.deserialize_cdr(raw, _STATE[0])
        for stamp, raw in commands:
            yield True, stamp, store.deserialize_cdr(raw, command_kind)

    return _from_messages(path, joint_names, messages(), command_topic, command_kind or "")


def _alike_states(path, joint_names, received, payloads, store):
    """All messages at once where they have one length and the same names: their numbers then lie at the same
    places, which are those of the first one. None where they differ."""
    import numpy as np

    if len(payloads) < 2 or any(len(p) != len(payloads[0]) for p in payloads):
        return None
    layout = _StateLayout(bytes(payloads[0]), store)
    if not layout.fits:
        return None
    taken = layout.take(np.frombuffer(b"".join(payloads), dtype=np.uint8).reshape(len(payloads), -1))
    return None if taken is None else layout.columns(path, joint_names, np.asarray(received, dtype=np.int64), taken)


class _StateLayout:
    """Where a serialised JointState has its numbers, by the first one: later ones of its length are taken apart many
    at a time, where they differ in stamp and numbers alone."""

    def __init__(self, first, store):
        """`first`: bytes. `fits` says whether they can be taken apart so."""
        import numpy as np

        state = store.deserialize_cdr(first, _STATE[0])
        self.names = list(state.name)
        self.places = []
        self.fits = first[1] == 1  # big-endian: seldom, and read one by one
        # The arrays end the message: effort last, each behind its length, aligned to 8 behind the 4 of the head.
        end = len(first)
        for array in (state.effort, state.velocity, state.position):
            array = np.asarray(array, dtype="<f8")
            start = end - 8 * len(array)
            self.places.insert(0, (start, end))
            self.fits = self.fits and (not len(array) or first[start:end] == array.tobytes())
            end = start - 4
            if len(array) and (start - 4) % 8 == 0 and int.from_bytes(first[end : end + 4], "little") != len(array):
                end -= 4  # the padding between a length and its numbers
            self.fits = self.fits and int.from_bytes(first[end : end + 4], "little") == len(array)
        # Behind byte order (4) and stamp (8): names, lengths and paddings, the same in all.
        self.fixed = [(12, end)] + [(start - 4, start) for start, _ in self.places if start >= 4]
        self.fixed = [(start, np.frombuffer(first[start:stop], dtype=np.uint8)) for start, stop in self.fixed]

    def take(self, table):
        """(stamps [ns], positions, velocities, efforts) of messages x bytes; None where one differs otherwise."""
        import numpy as np

        for start, wanted in self.fixed:
            if np.any(table[:, start : start + len(wanted)] != wanted):
                return None
        stamps = table[:, 4:12].copy().view("<u4").astype(np.int64)
        numbers = [table[:, start:stop].copy().view("<f8") for start, stop in self.places]
        return stamps[:, 0] * 10**9 + stamps[:, 1], *numbers

    def columns(self, path, joint_names, received, taken):
        import numpy as np

        stamps, *numbers = taken
        if not stamps.any():
            stamps = received
        parts = {}
        for role, values in zip(("pos", "vel", "eff"), numbers):
            if values.shape[1] < len(self.names):
                continue
            for j, joint in enumerate(self.names):
                parts[joint, role] = (stamps, values[:, j])
        chosen = _JointStates(path, joint_names)._chosen(self.names)
        return _columns(path, chosen, parts, list(joint_names), None)


def _read_mcap(path, joint_names, topic, command_topic, episode):
    import json

    from mcap.reader import make_reader
    from types import SimpleNamespace

    with open(path, "rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        if summary is None:
            raise _core.Error(f"{path}: an MCAP file without its end: it was not closed (mcap recover FILE -o WHOLE)")
        topics, encodings = {}, {}
        for channel in summary.channels.values():
            schema = summary.schemas.get(channel.schema_id)
            name = schema.name if schema else ""
            # Foxglove's own programs call it by either name.
            topics[channel.topic] = _STATE[0] if name in _STATE + ("foxglove.JointStates",) else name
            encodings[channel.topic] = channel.message_encoding
        chosen = _choose_topic(path, topics, topic)
        kind = _check_command(path, topics, command_topic)
        wanted = [chosen] + ([command_topic] if kind else [])
        for name in wanted:
            if encodings[name] not in ("cdr", "ros1", "json"):
                raise _core.Error(f"{path}: topic {name} is encoded as {encodings[name]}: cdr, ros1 and json are read")
        received, payloads, commands = [], [], []
        if not kind and encodings[chosen] == "cdr":
            fast = _mcap_alike(path, file, summary, chosen, joint_names)
            if fast is not None:
                return fast
        for _, channel, message in reader.iter_messages(topics=wanted):
            if channel.topic == chosen:
                received.append(message.log_time)
                payloads.append(message.data)
            else:
                commands.append((message.log_time, message.data))
    if encodings[chosen] == "cdr" and (not kind or encodings[command_topic] == "cdr"):
        return _from_cdr(path, joint_names, received, payloads, command_topic, kind, commands)

    def decoded(raw, encoding, message_kind):
        if encoding == "json":
            return _namespace(json.loads(raw), SimpleNamespace)
        from rosbags.typesys import Stores, get_typestore

        if encoding == "ros1":
            return get_typestore(Stores.ROS1_NOETIC).deserialize_ros1(raw, message_kind)
        return get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr(raw, message_kind)

    def messages():
        for stamp, raw in zip(received, payloads):
            yield False, stamp, decoded(raw, encodings[chosen], _STATE[0])
        for stamp, raw in commands:
            yield True, stamp, decoded(raw, encodings[command_topic], kind)

    return _from_messages(path, joint_names, messages(), command_topic, kind or "")


def _mcap_alike(path, file, summary, topic, joint_names):
    """The chunks of a file in which every record of the topic has one length: found without a Python object a
    message. None where that is not so."""
    import numpy as np
    from mcap.data_stream import ReadDataStream
    from mcap.records import Chunk
    from mcap.stream_reader import get_chunk_data_stream

    numbers = [c.id for c in summary.channels.values() if c.topic == topic]
    if len(numbers) != 1 or not summary.chunk_indexes:
        return None
    from rosbags.typesys import Stores, get_typestore

    pieces, length, layout = [], None, None
    for index in sorted(summary.chunk_indexes, key=lambda i: i.message_start_time):
        if not index.message_index_offsets:
            return None
        if numbers[0] not in index.message_index_offsets:
            continue
        offsets = _offsets(file, index.message_index_offsets[numbers[0]])
        if offsets is None:
            return None
        if not len(offsets):
            continue
        file.seek(index.chunk_start_offset + 1 + 8)
        chunk = Chunk.read(ReadDataStream(file))
        stream, size = get_chunk_data_stream(chunk, validate_crc=False)
        raw = stream.read(size)
        records = _records(raw, offsets, numbers[0], length)
        if records is None:
            return None
        length = records.shape[1]
        layout = layout or _StateLayout(records[0, 22:].tobytes(), get_typestore(Stores.ROS2_HUMBLE))
        # Chunk by chunk: a chunk fits the processor's cache, an hour of it does not.
        taken = layout.take(records[:, 22:]) if layout.fits else None
        if taken is None:
            return None
        pieces.append((records[:, 6:14].copy().view("<u8").reshape(-1).astype(np.int64), *taken))
    if not pieces:
        return None
    received, *taken = (np.concatenate(parts) for parts in zip(*pieces))
    if np.any(np.diff(received) < 0):
        return None
    return layout.columns(path, joint_names, received, taken)


def _records(raw, offsets, channel, length):
    """Contents of the message records (opcode 5) of `channel` at these offsets, (messages, bytes), where all have one
    length."""
    import numpy as np

    data = np.frombuffer(raw, dtype=np.uint8)
    first = int(offsets[0])
    size = int.from_bytes(raw[first + 1 : first + 9], "little")
    if (length is not None and size != length) or int(offsets.max()) + 9 + size > len(data):
        return None
    if np.all(np.diff(offsets) == 9 + size):
        records = data[first : first + len(offsets) * (9 + size)].reshape(-1, 9 + size)
    else:  # other messages lie between
        records = np.lib.stride_tricks.sliding_window_view(data, 9 + size)[offsets]
    head = b"\x05" + size.to_bytes(8, "little") + channel.to_bytes(2, "little")
    if np.any(records[:, :11] != np.frombuffer(head, dtype=np.uint8)):
        return None
    return records[:, 9:]


def _offsets(file, at):
    """Where a channel's messages lie in their chunk, by the MessageIndex record at this place of the file."""
    import numpy as np

    file.seek(at)
    head = file.read(15)  # opcode (1), length (8), channel (2), bytes of the array (4)
    if len(head) != 15 or head[0] != 7:
        return None
    pairs = np.frombuffer(file.read(int.from_bytes(head[11:], "little")), dtype="<u8").reshape(-1, 2)
    return np.sort(pairs[:, 1].astype(np.int64))


def _namespace(value, make):
    if isinstance(value, dict):
        if "nsec" in value and "nanosec" not in value:
            value = {**value, "nanosec": value["nsec"]}
        return make(**{key: _namespace(entry, make) for key, entry in value.items()})
    if isinstance(value, list):
        return [_namespace(entry, make) for entry in value]
    return value


def _read_bag2(path, joint_names, topic, command_topic, episode):
    files = sorted(f for f in os.listdir(path) if f.endswith((".db3", ".mcap")))
    if not files:
        raise _core.Error(f"{path}: a ROS 2 bag without .db3 or .mcap file")
    if len(files) > 1:
        raise _core.Error(f"{path}: a ROS 2 bag in {len(files)} files: give them one by one, as logs of their own ({files[0]}, ...)")
    file = os.path.join(path, files[0])
    return _READERS[_kind(file)](file, joint_names, topic, command_topic, episode)


# ------------------------------------------------------------------------------------------------- tables and arrays

_ROLES = {"t": "t", "time": "t", "timestamp": "t", "stamp": "t", "q": "q", "pos": "q", "position": "q", "positions": "q",
          "qpos": "q", "joint_positions": "q", "dq": "dq", "qd": "dq", "vel": "dq", "velocity": "dq", "velocities": "dq",
          "qvel": "dq", "joint_velocities": "dq", "tau": "tau", "effort": "tau", "torque": "tau", "torques": "tau",
          "joint_torques": "tau", "ddq": "ddq", "qdd": "ddq", "qacc": "ddq", "u": "u", "ctrl": "u", "command": "u",
          "q_cmd": "u", "q_des": "u", "action": "u", "i": "i", "current": "i", "currents": "i", "tau_cmd": "tau_cmd",
          "theta": "theta", "temp": "temp", "temperature": "temp"}


def _from_arrays(path, arrays):
    """{name: array}: columns by name, or matrices (samples, n) by role, transposed ones turned."""
    import numpy as np

    arrays = {name: np.asarray(a) for name, a in arrays.items()}
    arrays = {name: a for name, a in arrays.items() if a.dtype.kind in "fiub" and a.ndim in (1, 2) and a.size > 1}
    if not arrays:
        raise _core.Error(f"{path}: no arrays of numbers")
    lengths = [a.shape[0] if a.ndim == 1 else max(a.shape) for a in arrays.values()]
    samples = max(set(lengths), key=lengths.count)
    names, columns = [], []
    for name, a in arrays.items():
        short = name.rsplit("/", 1)[-1]
        role = _ROLES.get(short.lower(), short)
        if a.ndim == 2 and 1 in a.shape:
            a = a.reshape(-1)
        if a.ndim == 1 and a.shape[0] == samples:
            names.append(role if role == "t" else short)
            columns.append(_float(a))
        elif a.ndim == 2 and samples in a.shape:
            a = a if a.shape[0] == samples else a.T
            for j in range(a.shape[1]):
                names.append(f"{role}{j + 1}")
                columns.append(_float(a[:, j]))
    if not names:
        raise _core.Error(f"{path}: no arrays of one length ({', '.join(f'{n} {a.shape}' for n, a in arrays.items())})")
    return names, columns


def _float(a):
    import numpy as np

    return np.ascontiguousarray(a, dtype=float)


def _read_npz(path, joint_names, topic, command_topic, episode):
    import numpy as np

    with np.load(path, allow_pickle=False) as file:
        if isinstance(file, np.ndarray):
            raise _core.Error(f"{path}: one array without names: save them by name, np.savez(FILE, t=t, q=q, dq=dq, tau=tau)")
        return _from_arrays(path, {name: file[name] for name in file.files})


def _read_mat(path, joint_names, topic, command_topic, episode):
    with open(path, "rb") as file:
        if file.read(8) == b"\x89HDF\r\n\x1a\n" or b"MATLAB 7.3" in file.read(120):
            return _read_hdf5(path, joint_names, topic, command_topic, episode)
    from scipy.io import loadmat

    found = loadmat(path, squeeze_me=False, struct_as_record=False)
    arrays = {}
    for name, value in found.items():
        if name.startswith("__"):
            continue
        if getattr(value, "dtype", None) is not None and value.dtype == object and value.size == 1:
            value = value.flat[0]
        if hasattr(value, "_fieldnames"):  # a struct: log.q, log.dq
            arrays.update({field: getattr(value, field) for field in value._fieldnames})
        else:
            arrays[name] = value
    return _from_arrays(path, arrays)


def _read_hdf5(path, joint_names, topic, command_topic, episode):
    import h5py

    arrays = {}
    with h5py.File(path, "r") as file:
        def take(name, value):
            if isinstance(value, h5py.Dataset) and value.dtype.kind in "fiu" and value.ndim in (1, 2):
                arrays[name] = value[()]

        file.visititems(take)
    return _from_arrays(path, arrays)


def _read_parquet(path, joint_names, topic, command_topic, episode, info=None):
    import pyarrow.parquet as parquet

    table = parquet.read_table(path)
    if "observation.state" in table.column_names:
        if info is None:
            info = _lerobot_info(os.path.dirname(os.path.abspath(path)))
        return _from_lerobot(path, table, info, joint_names, episode)
    arrays = {name: _column(path, name, table[name]) for name in table.column_names}
    return _from_arrays(path, {name: a for name, a in arrays.items() if a is not None})


def _column(path, name, column):
    """(samples,) or, of lists of one length, (samples, n); None for what is no number."""
    import pyarrow

    kind = column.type
    if pyarrow.types.is_list(kind) or pyarrow.types.is_large_list(kind) or pyarrow.types.is_fixed_size_list(kind):
        if not (pyarrow.types.is_floating(kind.value_type) or pyarrow.types.is_integer(kind.value_type)):
            return None
        rows = len(column)
        flat = pyarrow.concat_arrays([c.flatten() for c in column.chunks]) if column.num_chunks else []
        if rows == 0 or len(flat) % rows:
            raise _core.Error(f"{path}: column {name} has lists of several lengths")
        return flat.to_numpy(zero_copy_only=False).reshape(rows, -1)
    if pyarrow.types.is_floating(kind) or pyarrow.types.is_integer(kind):
        return column.to_numpy()
    if pyarrow.types.is_timestamp(kind):
        return column.cast(pyarrow.int64()).to_numpy()
    return None


def _lerobot_info(folder):
    """meta/info.json of the dataset that the folder is in."""
    import json

    for _ in range(4):
        file = os.path.join(folder, "meta", "info.json")
        if os.path.exists(file):
            with open(file, encoding="utf-8") as opened:
                return json.load(opened)
        folder = os.path.dirname(folder)
    return {}


def _feature_names(info, feature):
    names = info.get("features", {}).get(feature, {}).get("names")
    if isinstance(names, dict):
        names = next(iter(names.values()), None)
    return [str(name).rsplit(".", 1)[0] if str(name).endswith((".pos", ".position")) else str(name) for name in names or []]


def _from_lerobot(path, table, info, joint_names, episode):
    """observation.state is q, action is u; in degrees or per cent as the dataset has them: the library says."""
    import numpy as np

    rows = slice(None)
    if "episode_index" in table.column_names:
        episodes = np.asarray(table["episode_index"].to_numpy())
        present = np.unique(episodes)
        if episode is None and len(present) > 1:
            raise _core.Error(f"{path}: {len(present)} episodes, {present[0]} to {present[-1]}: choose one (episode=K, or FILE#K)")
        chosen = int(present[0]) if episode is None else episode
        if chosen not in present:
            raise _core.Error(f"{path}: no episode {chosen} (there are {present[0]} to {present[-1]})")
        rows = episodes == chosen
    names, columns = [], []
    if "timestamp" in table.column_names:
        names.append("t")
        columns.append(_float(_column(path, "timestamp", table["timestamp"])[rows]))
    elif info.get("fps"):
        count = int(np.count_nonzero(rows)) if not isinstance(rows, slice) else len(table)
        names.append("t")
        columns.append(np.arange(count) / float(info["fps"]))
    for feature, role in (("observation.state", "q"), ("action", "u"), ("observation.velocity", "dq"),
                          ("observation.effort", "tau")):
        if feature not in table.column_names:
            continue
        values = _column(path, feature, table[feature])[rows]
        order = range(values.shape[1])
        named = _feature_names(info, feature)
        if joint_names and named:
            missing = [joint for joint in joint_names if joint not in named]
            if missing:
                raise _core.Error(f"{path}: joint {missing[0]} is not in {feature} (there are {', '.join(named)})")
            order = [named.index(joint) for joint in joint_names]
        for j, k in enumerate(order):
            names.append(f"{role}{j + 1}")
            columns.append(_float(values[:, k]))
    return names, columns


def _read_lerobot(path, joint_names, topic, command_topic, episode):
    import glob

    files = sorted(glob.glob(os.path.join(glob.escape(path), "**", "*.parquet"), recursive=True))
    files = [f for f in files if f"{os.sep}meta{os.sep}" not in f]
    if not files:
        raise _core.Error(f"{path}: no parquet file in it")
    info = _lerobot_info(path)
    if len(files) == 1:
        return _read_parquet(files[0], joint_names, topic, command_topic, episode, info)
    wanted = 0 if episode is None else episode
    if episode is None:
        raise _core.Error(f"{path}: {len(files)} files of episodes: choose one (episode=K, or FOLDER#K)")
    import pyarrow.parquet as parquet

    for file in files:
        numbers = parquet.read_table(file, columns=["episode_index"])["episode_index"].to_numpy()
        if wanted in numbers:
            return _read_parquet(file, joint_names, topic, command_topic, wanted, info)
    raise _core.Error(f"{path}: no episode {wanted}")


def _read_sage(path, joint_names, topic, command_topic, episode):
    """A recording of SAGE: state_motor.csv and control.csv with a list in each field, joint_list.txt."""
    state = _sage_csv(os.path.join(path, "state_motor.csv"))
    names, columns = ["t"], [_float(state.pop("timestamp"))]
    # Recordings of robots are stamped in us, those of simulators in s; the library finds that where there are speeds.
    listed = os.path.join(path, "joint_list.txt")
    joints = []
    if os.path.exists(listed):
        with open(listed, encoding="utf-8") as file:
            joints = [line.strip() for line in file if line.strip()]
    control = os.path.join(path, "control.csv")
    if os.path.exists(control):
        import numpy as np

        commanded = _sage_csv(control)
        at = np.searchsorted(commanded["timestamp"], columns[0], side="right") - 1
        state["u"] = commanded["positions"][np.maximum(at, 0)]
    roles = {"positions": "q", "velocities": "dq", "torques": "tau", "u": "u", "currents": "i", "temperatures": "temp"}
    for key, role in roles.items():
        if key not in state:
            continue
        values = state[key]
        order = range(values.shape[1])
        if joint_names and joints:
            missing = [joint for joint in joint_names if joint not in joints]
            if missing:
                raise _core.Error(f"{path}: joint {missing[0]} is not in joint_list.txt ({', '.join(joints)})")
            order = [joints.index(joint) for joint in joint_names]
        for j, k in enumerate(order):
            names.append(f"{role}{j + 1}")
            columns.append(_float(values[:, k]))
    return names, columns


def _sage_csv(path):
    import csv
    import json

    import numpy as np

    found = {}
    with open(path, newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        if reader.fieldnames is None or "timestamp" not in reader.fieldnames or "positions" not in reader.fieldnames:
            raise _core.Error(f"{path}: columns timestamp and positions are expected")
        for number, row in enumerate(reader, 2):
            try:
                for key, text in row.items():
                    if key is None or key == "type" or not text:
                        continue
                    found.setdefault(key, []).append(json.loads(text))
            except ValueError:
                raise _core.Error(f"{path}:{number}: column {key}: '{text[:40]}' is no list of numbers") from None
    rows = len(found.get("timestamp", []))
    if rows == 0:
        raise _core.Error(f"{path}: no samples")
    arrays = {}
    for key, values in found.items():
        try:
            array = np.asarray(values, dtype=float)
        except (ValueError, TypeError):
            continue
        if len(array) == rows:
            arrays[key] = array
    if "positions" not in arrays or arrays["positions"].ndim != 2:
        raise _core.Error(f"{path}: column positions: lists of one length are expected")
    return arrays


_READERS = {"bag": _read_bag, "sqlite": _read_sqlite, "mcap": _read_mcap, "parquet": _read_parquet, "npz": _read_npz,
            "mat": _read_mat, "hdf5": _read_hdf5, "bag2": _read_bag2, "lerobot": _read_lerobot, "sage": _read_sage}
