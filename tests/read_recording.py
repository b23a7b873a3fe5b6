#!/usr/bin/env python3
"""Reads a recording of takt with the reader of the MCAP project, and prints its contents.

    pip install mcap mcap-ros2-support
    tests/read_recording.py runs/arm6-erob-20250131T120000Z.mcap

It fails if the file, its index, a schema or a message cannot be read, if slots go backwards, or if the number of an
axis' messages is not the number of cycles.
"""

import sys
from collections import Counter

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory


def main(path):
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        header, summary = reader.get_header(), reader.get_summary()
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}["takt"]
        print(f"{header.library}, profile {header.profile}: {metadata['machine']}, {metadata['cycle_ns']} ns")
        counts, last_slot, last_message = Counter(), {}, {}
        # The journal is for `takt replay` alone.
        journal = sum(1 for _ in reader.iter_messages(topics=["/journal"]))
        topics = [channel.topic for channel in summary.channels.values() if channel.message_encoding == "cdr"]
        for schema, channel, message, decoded in reader.iter_decoded_messages(topics=topics):
            counts[channel.topic] += 1
            last_message[channel.topic] = decoded
            if not hasattr(decoded, "slot"):
                continue  # what is not of one cycle
            assert decoded.slot >= last_slot.get(channel.topic, 0), f"{channel.topic}: slots go backwards"
            last_slot[channel.topic] = decoded.slot
    assert sum(counts.values()) + journal == summary.statistics.message_count, "the statistics have another number of messages"
    for axis in metadata["axes"].splitlines():
        topic = f"/axis/{axis}"
        assert counts[topic] == counts["/cycle"], f"{topic}: {counts[topic]} of {counts['/cycle']} cycles"
    for topic in sorted(channel.topic for channel in summary.channels.values()):
        print(f"{topic}: {counts[topic]} messages; last: {last_message.get(topic)}")


if __name__ == "__main__":
    main(sys.argv[1])
