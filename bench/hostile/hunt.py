"""One reader, tried with inputs that atheris makes up from what code they reach; run by `bench/fuzz.py` as a process.

    python -m hostile.hunt PLACE SECONDS READER...

Each reader has a process of its own, forked when all that takes long is loaded, and a folder of its own in PLACE:
`corpus` are inputs to begin from, to which those are added that reach new code; what fails is put into `found`, one input
for each place in the code and kind of failure, with a text beside it that says what it was; `log` is what libFuzzer says.
For each a line is printed: its name, the status with which its process ended, and how long that took.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from pathlib import Path

import atheris

# Kernels are compiled from their own bytecode, so no part of `perdure.maths` may be changed.
_WATCHED = ["files", "states", "types", "params", "scene", "fold", "web.ledger", "cli.options"]
_WATCHED = [f"perdure.{name}" for name in _WATCHED] + ["perdure.features.masks", "perdure.features.outlines"]
_LONGEST, _MOST_MIB, _HANGS = (
    6000,
    4000,
    30,
)  # bytes of an input, memory, s; beyond these libFuzzer ends the process

with atheris.instrument_imports(include=[*_WATCHED, "tomllib", "configparser", "zipfile"]):
    from hostile.readers import READERS, Reader
    from hostile.trying import Outcome, scratch, tried


def main() -> None:
    place, seconds, *names = sys.argv[1:]
    for name in names:
        begun = time.monotonic()
        child = os.fork()
        if not child:
            _hunt(READERS[name], Path(place) / name, float(seconds))
        _, status = os.waitpid(child, 0)
        print(json.dumps([name, os.waitstatus_to_exitcode(status), time.monotonic() - begun]), flush=True)


def _hunt(reader: Reader, home: Path, seconds: float) -> None:
    """Try a reader for some time; libFuzzer ends the process."""
    log = os.open(home / "log", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(log, 1)
    os.dup2(log, 2)
    found = home / "found"
    known = {one.stem for one in found.glob("*.json")}
    words = found / "words.dict"
    words.write_text("".join(f'"{_escaped(word)}"\n' for word in reader.words))
    options = [
        f"-max_total_time={seconds:g}",
        f"-max_len={_LONGEST}",
        f"-timeout={_HANGS}",
        "-print_final_stats=1",
    ]
    options += [f"-rss_limit_mb={_MOST_MIB}", f"-artifact_prefix={found}/", "-reduce_inputs=1"]
    options += [f"-report_slow_units={_HANGS}"]
    options += [f"-dict={words}"] if reader.words else []
    with scratch() as place:

        def one(data: bytes) -> None:
            outcome = tried(reader, data, place)
            if outcome.fault and (key := _key(outcome)) not in known:
                known.add(key)
                _put_down(found / key, data, outcome)

        atheris.Setup([sys.argv[0], *options, str(home / "corpus")], one)
        atheris.Fuzz()


def _key(outcome: Outcome) -> str:
    return hashlib.sha256(outcome.where.encode()).hexdigest()[:16]


def _put_down(path: Path, data: bytes, outcome: Outcome) -> None:
    path.with_suffix(".input").write_bytes(data)
    told = {"where": outcome.where, "fault": outcome.fault, "trace": outcome.trace}
    path.with_suffix(".json").write_text(json.dumps(told, indent=1))


def _escaped(word: str) -> str:
    """A word as libFuzzer's dictionaries have it."""
    return "".join(
        chr(one) if 32 < one < 127 and chr(one) not in '"\\' else f"\\x{one:02x}" for one in word.encode("utf-8")
    )


if __name__ == "__main__":
    main()
