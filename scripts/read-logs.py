#!/usr/bin/env python3
"""Reads every log of a folder with the reference reader: checksums, summary, all messages."""

import pathlib
import sys

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory


def read(path: pathlib.Path) -> int:
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        if summary is None or summary.statistics is None:
            raise SystemExit(f"{path}: no summary")
        messages = sum(1 for _ in reader.iter_decoded_messages())
        if messages != summary.statistics.message_count:
            raise SystemExit(f"{path}: {messages} messages, {summary.statistics.message_count} told")
        return messages


logs = sorted(pathlib.Path(sys.argv[1]).glob("*.mcap"))
messages = sum(read(log) for log in logs)
print(f"the reference reader opens all {len(logs)} logs: {messages} messages")
