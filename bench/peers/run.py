"""Runs one peer over sequences of regions; executed by the peers' own interpreter, which has no perdure.

    python run.py JOB.json          run a peer
    python run.py --versions NAME…  print the installed versions of distributions, as JSON

The job names the library, what to make of it and with which arguments, and a folder. For every sequence NAME the
folder holds NAME.regions.npz (frames, counts, boxes, scores, fps, width, height); NAME.rows.npz (frames, ids, boxes,
seconds) is put beside it, or NAME.fault with one line. Only the calls of `update` are timed, after a warm-up of
another tracker on the first frames; `seconds` is the best of several turns, each with a new tracker.
"""

from __future__ import annotations

import importlib.metadata
import json
import runpy
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

SHARED = Path(__file__).resolve().parents[2] / "src/perdure/trackers/foreign/libraries.py"
_shared = runpy.run_path(str(SHARED))  # how each library is spoken to: a program of its own, too
Peer, LIBRARIES = _shared["Peer"], _shared["LIBRARIES"]

WARM_UP = 50  # frames
TURNS = 3


def main() -> None:
    if sys.argv[1] == "--versions":
        print(json.dumps({name: installed(name) for name in sys.argv[2:]}))
        return
    job = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    folder = Path(job["folder"])
    for name in job["sequences"]:
        try:
            run(job, folder, name)
        except Exception as error:
            fault = f"{type(error).__name__}: {error}".splitlines()[0]
            (folder / f"{name}.fault").write_text(fault, encoding="utf-8")


def installed(name: str) -> str | None:
    """Return the version of a distribution, None where it is absent."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def run(job: dict[str, Any], folder: Path, name: str) -> None:
    """Run the peer over one sequence and write its rows."""
    with np.load(folder / f"{name}.regions.npz") as regions:
        frames, counts, boxes, scores = (regions[key] for key in ("frames", "counts", "boxes", "scores"))
        fps = float(regions["fps"])
    ends = np.cumsum(counts)
    seen = []
    for begin, end in zip(ends - counts, ends, strict=True):
        kept = np.arange(begin, end)
        if job["scores_above"] is not None:
            kept = kept[scores[kept] > job["scores_above"]]
        seen.append((boxes[kept], scores[kept]))
    peer = LIBRARIES[job["library"]](job, fps)
    follow(peer, frames[:WARM_UP], seen[:WARM_UP])
    turns = [follow(peer, frames, seen) for _ in range(TURNS)]
    said = np.array(turns[0][0], np.float64).reshape(-1, 6)
    seconds = min(one for _, one in turns)
    np.savez(folder / f"{name}.rows.npz", frames=said[:, 0], ids=said[:, 1], boxes=said[:, 2:], seconds=seconds)


def follow(peer: Any, frames: Any, seen: list[tuple[Any, Any]]) -> tuple[list[tuple[float, ...]], float]:
    """Return rows (frame, id, x1, y1, x2, y2) and the seconds that a new tracker spent in `update`."""
    tracker, offered = peer.start(), [peer.offer(*one) for one in seen]
    rows, seconds = [], 0.0
    for frame, regions in zip(frames, offered, strict=True):
        begun = time.perf_counter()
        answer = tracker.update(regions)
        seconds += time.perf_counter() - begun
        rows += [(frame, identity, *box) for identity, box in peer.read(answer)]
    return rows, seconds


if __name__ == "__main__":
    main()
