"""Reads a recording of a run with the readers of ROS 2 that need no ROS: mcap-ros2-support, rosbags and its converter, rosbags-dataframe.

    python tests/peers/recording_readers.py TAKT

Ends with 1 and a sentence at the first difference.
"""

import collections
import subprocess
import sys
import tempfile
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.reader import read_ros2_messages
from rosbags.dataframe import get_dataframe
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from difference import Difference, expect


def main(takt):
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "run.mcap"
        subprocess.run([takt, "run", "configs/first.toml", "--record", recording], check=True, capture_output=True)
        try:
            counts = counted(recording)
            expect("topics with messages", [counts[topic] > 0 for topic in ("/journal", "/joint_states")], [True, True])
            mcap_ros2_decodes(recording, counts)
            rosbags_decodes(recording, counts)
            rosbags_converts(recording, counts, Path(folder) / "converted")
            dataframe_has_the_joints(recording, counts)
        except Difference as difference:
            sys.exit(str(difference))
    print("recordings: all done")


def counted(recording):
    """The messages of each topic by the statistics of the file."""
    with open(recording, "rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    counts = summary.statistics.channel_message_counts
    return {channel.topic: counts.get(number, 0) for number, channel in summary.channels.items()}


def mcap_ros2_decodes(recording, counts):
    read = collections.Counter(message.channel.topic for message in read_ros2_messages(str(recording)))
    same("mcap-ros2-support", read, counts)


def rosbags_decodes(recording, counts):
    read = collections.Counter()
    with AnyReader([recording], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for connection, _, message in reader.messages():
            reader.deserialize(message, connection.msgtype)
            read[connection.topic] += 1
        for connection in reader.connections:
            expect(f"QoS profiles of {connection.topic}", len(connection.ext.offered_qos_profiles), 1)
    same("rosbags", read, counts)


def rosbags_converts(recording, counts, folder):
    converter = Path(sys.executable).with_name("rosbags-convert")
    command = [converter, "--src", recording, "--dst", folder]
    converted = subprocess.run(command, capture_output=True, text=True, check=False)
    expect(f"exit code of rosbags-convert ({converted.stdout}{converted.stderr})", converted.returncode, 0)
    with AnyReader([folder]) as reader:
        same("rosbags-convert", {topic: of.msgcount for topic, of in reader.topics.items()}, counts)


def dataframe_has_the_joints(recording, counts):
    with AnyReader([recording], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        frame = get_dataframe(reader, "/joint_states", ["position", "velocity"])
    expect("rows of rosbags-dataframe", len(frame), counts["/joint_states"])
    expect("that the times of rosbags-dataframe increase", bool(frame.index.is_monotonic_increasing), True)


def same(reader, read, counts):
    written = {topic: count for topic, count in counts.items() if count > 0}
    expect(f"messages that {reader} has read", dict(read), written)


if __name__ == "__main__":
    main(sys.argv[1])
