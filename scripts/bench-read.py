#!/usr/bin/env python3
"""Reads topics of a log into arrays with the package mcap and protobuf: a peer of Log.read_many.

usage: bench-read.py LOG TOPIC...
"""

import sys
import time

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory


def numbers(message, prefix="", found=None):
    """All numbers of a message by their names."""
    found = {} if found is None else found
    for field, value in message.ListFields():
        if field.message_type is None:
            found[prefix + field.name] = value
        elif field.is_repeated if hasattr(field, "is_repeated") else field.label == 3:
            for index, entry in enumerate(value):
                numbers(entry, f"{prefix}{index}.", found)
        else:
            numbers(value, f"{prefix}{field.name}.", found)
    return found


def main():
    log, *topics = sys.argv[1:]
    begin = time.monotonic()
    columns = {topic: [] for topic in topics}
    with open(log, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages(topics=topics):
            columns[channel.topic].append((message.log_time, numbers(decoded)))
    rows = 0
    for messages in columns.values():
        rows += len(messages)
        for name in messages[0][1] if messages else ():
            np.array([values.get(name) for _, values in messages])
    print(f"{'mcap and protobuf':<20} {rows} messages in {time.monotonic() - begin:.3f} s")


main()
