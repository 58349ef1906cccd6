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
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

WARM_UP = 50  # frames
TURNS = 3


class Peer(NamedTuple):
    """How one library is spoken to."""

    start: Callable[[], Any]  # a new tracker, with `update`
    offer: Callable[[Any, Any], Any]  # boxes (N, 4), scores (N,) -> what `update` takes
    read: Callable[[Any], Iterator[tuple[int, Any]]]  # what `update` returns -> (id from 1, box)


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


def follow(peer: Peer, frames: Any, seen: list[tuple[Any, Any]]) -> tuple[list[tuple[float, ...]], float]:
    """Return rows (frame, id, x1, y1, x2, y2) and the seconds that a new tracker spent in `update`."""
    tracker, offered = peer.start(), [peer.offer(*one) for one in seen]
    rows, seconds = [], 0.0
    for frame, regions in zip(frames, offered, strict=True):
        begun = time.perf_counter()
        answer = tracker.update(regions)
        seconds += time.perf_counter() - begun
        rows += [(frame, identity, *box) for identity, box in peer.read(answer)]
    return rows, seconds


def trackers_peer(job: dict[str, Any], fps: float) -> Peer:
    """Roboflow's trackers: the regions come back with an id each, -1 for those that have none yet."""
    import supervision
    import trackers

    make, arguments = getattr(trackers, job["make"]), with_fps(job["arguments"], fps)

    def offer(boxes: Any, scores: Any) -> Any:
        return supervision.Detections(xyxy=boxes.astype(np.float32), confidence=scores.astype(np.float32))

    def read(answer: Any) -> Iterator[tuple[int, Any]]:
        return ((int(one) + 1, box) for one, box in zip(answer.tracker_id, answer.xyxy, strict=True) if one >= 0)

    return Peer(lambda: make(**arguments), offer, read)


def pyxtrackers_peer(job: dict[str, Any], fps: float) -> Peer:
    """The ports of the authors' code: x1 y1 x2 y2 score in, x1 y1 x2 y2 id out, ids from 1."""
    import pyxtrackers

    make, arguments = getattr(pyxtrackers, job["make"]), with_fps(job["arguments"], fps)

    def offer(boxes: Any, scores: Any) -> Any:
        return np.column_stack([boxes, scores]).astype(np.float64)

    def read(answer: Any) -> Iterator[tuple[int, Any]]:
        return ((int(row[4]), row[:4]) for row in answer)

    return Peer(lambda: make(**arguments), offer, read)


def norfair_peer(job: dict[str, Any], fps: float) -> Peer:
    """Norfair: a box is two points; an object with live points says where it is estimated to be."""
    import norfair
    import norfair.filter

    arguments = dict(job["arguments"])
    if "filter_factory" in arguments:
        arguments["filter_factory"] = getattr(norfair.filter, arguments["filter_factory"])()

    def offer(boxes: Any, scores: Any) -> Any:
        return [
            norfair.Detection(box.reshape(2, 2), np.array([score, score]))
            for box, score in zip(boxes, scores, strict=True)
        ]

    def read(answer: Any) -> Iterator[tuple[int, Any]]:
        return ((one.id, one.estimate.reshape(4)) for one in answer if one.live_points.any())

    return Peer(lambda: getattr(norfair, job["make"])(**arguments), offer, read)


def with_fps(arguments: dict[str, Any], fps: float) -> dict[str, Any]:
    """Return the arguments with the sequence's frames per second where they ask for them."""
    return {name: fps if value == "fps" else value for name, value in arguments.items()}


LIBRARIES = {"trackers": trackers_peer, "pyxtrackers": pyxtrackers_peer, "norfair": norfair_peer}

if __name__ == "__main__":
    main()
