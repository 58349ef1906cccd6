"""The inputs that are kept for every test: a file a reader in `tests/kept`, a line an input.

    {"text": "1,1,0,0,nan,5,1,-1,-1,-1\\n", "was": "NaN was a side of a box"}

`text`, or `base64` for what is no text; `was` says what was wrong when it was found, and is missing where it is the smallest
input that gets some answer of its reader.
"""

from __future__ import annotations

import base64
import json
import re
import time
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from hostile.readers import Reader
from hostile.trying import scratch, tried

FOLDER = Path(__file__).parents[2] / "tests" / "kept"
_LONGEST, _MOST = 2500, 6000  # bytes of an input, and of all of a reader that never failed
_SLOWEST = 0.1  # s of the processor; tests are to be quick
_NAMED = re.compile(r"\S*/\S*|'[^']*'|[-+0-9.eE]+")  # what an answer names: the file, a word of it, numbers


class Kept(NamedTuple):
    """An input, and what was wrong with it when it was found."""

    data: bytes
    was: str = ""


def read_kept(name: str) -> list[Kept]:
    """Return the inputs that are kept for a reader."""
    path = FOLDER / f"{name}.jsonl"
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return [Kept(_bytes(value), value.get("was", "")) for value in map(json.loads, lines)]


def write_kept(name: str, kept: Iterable[Kept]) -> None:
    """Write the inputs of a reader; those that once failed first."""
    lines = [json.dumps(_value(one), ensure_ascii=True) for one in sorted(kept, key=lambda one: not one.was)]
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / f"{name}.jsonl").write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def chosen(reader: Reader, inputs: Iterable[bytes], known: Iterable[Kept]) -> list[Kept]:
    """Return those that once failed, and of the others the smallest for each answer that the reader gives, not too many, and no slow ones."""
    kept = [one for one in known if one.was]
    answers: set[str] = set()
    size = 0
    with scratch() as place:
        for data in sorted(set(inputs), key=lambda data: (len(data), data)):
            if len(data) > _LONGEST or size + len(data) > _MOST:
                break
            begun = time.process_time()
            answer = _NAMED.sub("", tried(reader, data, place).word)
            if answer not in answers and time.process_time() - begun < _SLOWEST:
                answers.add(answer)
                kept.append(Kept(data))
                size += len(data)
    return kept


def _bytes(value: dict[str, str]) -> bytes:
    return value["text"].encode("utf-8") if "text" in value else base64.b64decode(value["base64"])


def _value(one: Kept) -> dict[str, str]:
    try:
        value = {"text": one.data.decode("utf-8")}
    except UnicodeDecodeError:
        value = {"base64": base64.b64encode(one.data).decode("ascii")}
    return value | ({"was": one.was} if one.was else {})
