#!/usr/bin/env python3
"""Puts small sound bags, without their magic, into fuzz/corpus/bag. pip install mcap mcap-ros2-support"""

import io
import pathlib

from mcap.writer import CompressionType, Writer

HERE = pathlib.Path(__file__).parent
MESSAGES = HERE.parent / "msg" / "governor_msgs" / "msg"
GOLDEN = HERE.parent / "tests" / "fixtures" / "cdr" / "golden.txt"
DEPENDENCIES = f"{'=' * 80}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n" + (
    f"{'=' * 80}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)
TOPICS = {
    "/governor/command": "GovernorCommand",
    "/governor/esv": "EsvState",
    "/plant/servo_state": "ServoState",
}

golden = {}
for line in GOLDEN.read_text().splitlines():
    kind, order, _, data = line.split(" ")
    golden.setdefault(kind, []).append(bytes.fromhex(data))

corpus = HERE / "corpus" / "bag"
corpus.mkdir(parents=True, exist_ok=True)
for name, options in {
    "zstd": {"compression": CompressionType.ZSTD, "chunk_size": 200},
    "lz4": {"compression": CompressionType.LZ4, "chunk_size": 200},
    "plain": {"compression": CompressionType.NONE, "chunk_size": 200},
    "no_crc": {"compression": CompressionType.NONE, "enable_crcs": False},
    "no_chunks": {"use_chunking": False},
    "no_summary": {"use_chunking": False, "use_statistics": False, "use_summary_offsets": False},
}.items():
    file = io.BytesIO()
    writer = Writer(file, **options)
    writer.start(profile="ros2")
    channels = {}
    for topic, kind in TOPICS.items():
        text = (MESSAGES / f"{kind}.msg").read_text() + DEPENDENCIES
        schema = writer.register_schema(f"governor_msgs/msg/{kind}", "ros2msg", text.encode())
        channels[topic] = writer.register_channel(topic, "cdr", schema)
    for step in range(4):
        for topic, kind in TOPICS.items():
            for data in golden[f"governor_msgs/msg/{kind}"]:
                writer.add_message(channels[topic], step * 10**8, data, step * 10**8)
    writer.finish()
    (corpus / name).write_bytes(file.getvalue()[8:])
