#!/usr/bin/env python3
"""Cuts a log at many places and saves what can be saved with `atvrec recover` and `mcap recover`.

usage: compare-recovery.py ATVREC LOG [CUTS]

Prints how many messages each saved, and fails if atvrec saved fewer anywhere than stand in intact chunks
before the cut (`mcap recover` saves no others), or if its result does not open in the reference reader or in `mcap doctor`. Without the program `mcap` (the reference
command-line tool) only atvrec is tried.
"""

import pathlib
import shutil
import subprocess
import sys
import tempfile

from mcap.reader import make_reader


def messages(path: pathlib.Path) -> int:
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return sum(1 for _ in reader.iter_messages(log_time_order=False))


def run(*command: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(word) for word in command], capture_output=True, text=True)


def main() -> None:
    atvrec, log = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    cuts = int(sys.argv[3]) if len(sys.argv) > 3 else 20
    whole = log.read_bytes()
    ours = theirs = 0
    peer = shutil.which("mcap")
    with tempfile.TemporaryDirectory() as folder:
        cut, theirs_path = pathlib.Path(folder, "cut.mcap"), pathlib.Path(folder, "theirs.mcap")
        for number in range(1, cuts + 1):
            data = whole[: len(whole) * number // (cuts + 1)]
            cut.write_bytes(data)
            saved_by_peer = 0
            if peer:
                # It ends with an error code when the file was cut; what it saved is what counts.
                run(peer, "recover", cut, "-o", theirs_path)
                saved_by_peer = messages(theirs_path) if theirs_path.exists() else 0
            done = run(atvrec, "recover", cut)
            # 3: something was lost, and the original is kept; each cut begins with another one.
            if done.returncode not in (0, 3):
                sys.exit(f"atvrec recover failed at byte {len(data)}: {done.stderr}")
            saved = messages(cut)
            for original in cut.parent.glob("cut.mcap.*damaged"):
                original.unlink()
            if peer:
                doctor = run(peer, "doctor", cut)
                if doctor.returncode != 0:
                    sys.exit(f"mcap doctor at byte {len(data)}: {doctor.stdout}{doctor.stderr}")
            if saved < saved_by_peer:
                sys.exit(f"at byte {len(data)}: atvrec saved {saved}, mcap recover {saved_by_peer}")
            ours, theirs = ours + saved, theirs + saved_by_peer
    beside = f"; mcap recover {theirs}" if peer else "; mcap is not installed"
    print(f"{cuts} cuts: atvrec recover saved {ours} messages{beside}")


main()
