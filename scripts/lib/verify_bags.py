#!/usr/bin/env python3
"""Judges bags by readers and writers that share no code with this project. Called by scripts/verify_bags."""

import json
import pathlib
import subprocess
import sys

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer as McapWriter
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from ruamel.yaml import YAML  # comes with rosbags

TOP = pathlib.Path(__file__).parents[2]
GOVTWIN, OUT = sys.argv[1], pathlib.Path(sys.argv[2])
checks = failures = 0


def check(what, good, found=""):
    global checks, failures
    checks += 1
    if not good:
        failures += 1
        print(f"FAILED: {what} {found}")


def close(a, b):
    """Equal to the bit, NaN included."""
    return a == b or (a != a and b != b)


def values(message):
    """The numbers of a message, whoever decoded it."""
    names = getattr(message, "__slots__", None) or list(vars(message))
    found = [message.header.stamp.sec, message.header.stamp.nanosec]
    for name in names:
        value = getattr(message, name)
        # Constants, in capitals, are listed by one of the two.
        if name not in ("header", "__msgtype__") and not name.isupper() and isinstance(value, (int, float)):
            found.append((name, value))
    return found


def same(a, b):
    return len(a) == len(b) and all(
        close(x[1], y[1]) and x[0] == y[0] if isinstance(x, tuple) else x == y for x, y in zip(a, b)
    )


def typestore():
    store = get_typestore(Stores.ROS2_JAZZY)
    for path in sorted((TOP / "msg/governor_msgs/msg").glob("*.msg")):
        store.register(get_types_from_msg(path.read_text(), f"governor_msgs/msg/{path.stem}"))
    return store


def info(path):
    """What this project's reader says; exit 3 is a reading with warnings."""
    done = subprocess.run([GOVTWIN, "info", "--json", str(path)], capture_output=True, text=True, check=False)
    check(f"govtwin info {path.name}", done.returncode in (0, 3), done.stderr)
    return json.loads(done.stdout)[0] if done.stdout.strip() not in ("", "[]") else None


def judge_written(folder, original, store):
    """One bag folder that this project wrote."""
    name = folder.name
    with Reader(folder) as reader:  # metadata.yaml and the file together
        meta = YAML(typ="safe").load((folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
        check(f"{name}: version", meta["version"] == 9)
        check(f"{name}: storage", meta["storage_identifier"] == "mcap")
        check(f"{name}: count", reader.message_count == sum(1 for _ in reader.messages()))
        times = [time for _, time, _ in reader.messages()]
        check(f"{name}: start", reader.start_time == min(times), (reader.start_time, min(times)))
        check(f"{name}: end", reader.end_time in (max(times), max(times) + 1), (reader.end_time, max(times)))
        topics = {connection.topic: connection for connection in reader.connections}
        for topic, connection in topics.items():
            expected = store.hash_rihs01(connection.msgtype)
            copied = original is not None and not topic.startswith("/sim/")
            check(f"{name}: {topic}: type hash", connection.digest == expected or copied, connection.digest)
            if not copied:
                check(f"{name}: {topic}: QoS", len(connection.ext.offered_qos_profiles) == 1)
        decoded = {}
        for connection, time, data in reader.messages():
            message = store.deserialize_cdr(data, connection.msgtype)
            decoded.setdefault(connection.topic, []).append((time, values(message), bytes(data)))
    with AnyReader([folder]) as reader:  # types from the schemas inside the file, no typestore given
        count = sum(1 for connection, _, data in reader.messages() if reader.deserialize(data, connection.msgtype))
        check(f"{name}: AnyReader with the file's own schemas", count == len(times))
    files = sorted(folder.glob("*.mcap"))
    check(f"{name}: one file of the folder's name", [file.name for file in files] == [f"{name}_0.mcap"])
    with files[0].open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        check(f"{name}: profile", reader.get_header().profile == "ros2")
        check(f"{name}: chunks", {index.compression for index in summary.chunk_indexes} == {"zstd"})
        check(f"{name}: statistics", summary.statistics.message_count == len(times))
        records = {record.name: record.metadata for record in reader.iter_metadata()}
        text = (folder / "metadata.yaml").read_text()
        check(f"{name}: rosbag2 record", records.get("rosbag2", {}).get("serialized_metadata") == text)
        for channel in summary.channels.values():
            check(f"{name}: {channel.topic}: encoding", channel.message_encoding == "cdr")
            keys = {"offered_qos_profiles", "topic_type_hash"}
            check(f"{name}: {channel.topic}: channel metadata", keys <= set(channel.metadata), channel.metadata)
            check(f"{name}: {channel.topic}: schema", summary.schemas[channel.schema_id].encoding == "ros2msg")
        by_mcap = {}
        for _, channel, message, decoded_message in reader.iter_decoded_messages():
            by_mcap.setdefault(channel.topic, []).append((message.log_time, values(decoded_message), message.data))
    for topic, messages in decoded.items():
        others = by_mcap.get(topic, [])
        agree = len(messages) == len(others) and all(
            a[0] == b[0] and same(a[1], b[1]) and a[2] == bytes(b[2]) for a, b in zip(messages, others)
        )
        check(f"{name}: {topic}: rosbags and mcap-ros2-support decode the same", agree)
    if original is not None:
        with original.open("rb") as file:
            for _, channel, message in make_reader(file).iter_messages():
                by_mcap.setdefault("original " + channel.topic, []).append((message.log_time, bytes(message.data)))
        for topic in [topic for topic in by_mcap if topic.startswith("original ")]:
            copy = [(time, bytes(data)) for time, _, data in by_mcap.get(topic.removeprefix("original "), [])]
            check(f"{name}: {topic}: copied byte for byte", copy == by_mcap[topic])
    told = info(folder)
    counts = {topic["name"]: topic["messages"] for topic in told["topics"]}
    check(f"{name}: read back", counts == {topic: len(messages) for topic, messages in decoded.items()}, counts)
    check(f"{name}: without a warning", told["warnings_in_words"] == [], told["warnings_in_words"])
    return len(times), sorted(decoded)


def read_foreign(source, store):
    """Bags that others write, each in another way; this project reads all of each."""
    with source.open("rb") as file:
        reader = make_reader(file)
        schemas = {schema.id: schema for schema in reader.get_summary().schemas.values()}
        messages = [(schemas[channel.schema_id], channel.topic, message) for _, channel, message in reader.iter_messages()]
    expected = {}
    for _, topic, _ in messages:
        expected[topic] = expected.get(topic, 0) + 1
    reference = info(source)["recording"]
    folder = OUT / "foreign"
    folder.mkdir()
    ways = {
        "lz4": {"compression": CompressionType.LZ4, "chunk_size": 20_000},
        "zstd": {"compression": CompressionType.ZSTD, "chunk_size": 20_000},
        "plain": {"compression": CompressionType.NONE},
        "no_chunks": {"use_chunking": False},
        "no_summary": {"use_statistics": False, "use_summary_offsets": False, "repeat_channels": False, "repeat_schemas": False},
        "no_crcs": {"enable_crcs": False},
    }
    for way, options in ways.items():
        path = folder / f"{way}.mcap"
        with path.open("wb") as file:
            writer = McapWriter(file, **options)
            writer.start(profile="ros2")
            known = {}
            for schema, topic, message in messages:
                if topic not in known:
                    number = writer.register_schema(schema.name, schema.encoding, schema.data)
                    known[topic] = writer.register_channel(topic, "cdr", number)
                writer.add_message(known[topic], message.log_time, message.data, message.publish_time)
            writer.finish()
        told = info(path)
        check(f"mcap {way}: counts", {topic["name"]: topic["messages"] for topic in told["topics"]} == expected)
        check(f"mcap {way}: recording", told["recording"] == reference, told["recording"])
    for plugin in (StoragePlugin.MCAP, StoragePlugin.SQLITE3):
        for version in (8, 9):
            path = folder / f"rosbags_{plugin.name.lower()}_{version}"
            with Writer(path, version=version, storage_plugin=plugin) as writer:
                known = {}
                for schema, topic, message in messages:
                    if topic not in known:
                        known[topic] = writer.add_connection(topic, schema.name, typestore=store)
                    writer.write(known[topic], message.log_time, message.data)
            told = info(path)
            check(f"{path.name}: counts", {topic["name"]: topic["messages"] for topic in told["topics"]} == expected)
            check(f"{path.name}: recording", told["recording"] == reference, told["recording"])
            fits = [topic["type_hash_fits"] for topic in told["topics"]]
            # rosbags keeps the hash beside the file for MCAP, inside it for sqlite3.
            check(f"{path.name}: type hashes as rosbags computes them", all(fits) or plugin == StoragePlugin.MCAP, fits)
    return len(ways) + 4


store = typestore()
written = sorted(path.parent for path in (OUT / "replay").rglob("metadata.yaml"))
check("replay wrote a bag for each recording", len(written) == 4, written)
for folder in written:
    original = next((TOP / "bags/reference").glob(f"{folder.name}*.mcap"), None)
    count, topics = judge_written(folder, original, store)
    print(f"{folder.name}: {count} messages on {', '.join(topics)}")
ways = read_foreign(TOP / "bags/reference/shutdown_01.mcap", store)
print(f"bags written elsewhere and read here: {ways}")
print(f"verify_bags: {checks} checks, {failures} failed")
sys.exit(1 if failures else 0)
