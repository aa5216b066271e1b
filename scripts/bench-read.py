#!/usr/bin/env python3
"""Reads topics of a log into arrays: with Log.read_many, if the package atvrec is installed (make python
installs it), and with the packages mcap and protobuf.

usage: bench-read.py LOG TOPIC...
"""

import importlib.util
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


def read_many(log, topics):
    """Three times with Log.read_many."""
    import atvrec

    for _ in range(3):
        begin = time.monotonic()
        tables = atvrec.Log([log]).read_many(topics)
        seconds = time.monotonic() - begin
        print(f"{'Log.read_many':<20} {len(tables)} topics in {seconds:.3f} s")


def main():
    log, *topics = sys.argv[1:]
    if importlib.util.find_spec("atvrec"):
        read_many(log, topics)
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
