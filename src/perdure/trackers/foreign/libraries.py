"""Trackers of other libraries, one way of speaking to all; run by an interpreter that has the library.

    python libraries.py        speaks JSON, a line a message, over standard input and output

This file is a program of its own and knows nothing of Perdure: the interpreter may be that of another environment. The
first line names the library, what to make of it, with which arguments, and the frames per second; the answer is
{"ready": its version} or {"fault": …}. Every other line is a frame: {"boxes": [[x1, y1, x2, y2], …], "scores": […]};
the answer is {"ids": […], "boxes": […], "rows": […]}: which row of the frame's boxes a said one rests on, -1 for none,
and null in place of all where the library does not tell.
"""

from __future__ import annotations

import importlib.metadata
import json
import sys
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np


class Peer(NamedTuple):
    """How one library is spoken to."""

    start: Callable[[], Any]  # a new tracker, with `update`
    offer: Callable[[Any, Any], Any]  # boxes (N, 4), scores (N,) -> what `update` takes
    read: Callable[[Any], Iterator[tuple[int, Any]]]  # what `update` returns -> (id from 1, box)
    rows: Callable[[Any, Any], list[int]] | None = (
        None  # what was offered, what `update` returned -> its rows, -1 for none
    )


def trackers_peer(job: dict[str, Any], fps: float) -> Peer:
    """Roboflow's trackers: the regions come back with an id each, -1 for those that have none yet."""
    import supervision
    import trackers

    make, arguments = getattr(trackers, job["make"]), with_fps(job["arguments"], fps)

    def offer(boxes: Any, scores: Any) -> Any:
        return supervision.Detections(
            xyxy=boxes.astype(np.float32),
            confidence=scores.astype(np.float32),
            data={"row": np.arange(len(boxes))},
        )

    def read(answer: Any) -> Iterator[tuple[int, Any]]:
        return ((int(one) + 1, box) for one, box in zip(answer.tracker_id, answer.xyxy, strict=True) if one >= 0)

    def rows(offered: Any, answer: Any) -> list[int]:
        told = answer.data.get("row", np.full(len(answer), -1))
        return [int(row) for row, one in zip(told, answer.tracker_id, strict=True) if one >= 0]

    return Peer(lambda: make(**arguments), offer, read, rows)


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

    def live(answer: Any) -> Any:
        return [one for one in answer if one.live_points.any()]

    def read(answer: Any) -> Iterator[tuple[int, Any]]:
        return ((one.id, one.estimate.reshape(4)) for one in live(answer))

    def rows(offered: Any, answer: Any) -> list[int]:
        places = {id(one): row for row, one in enumerate(offered)}
        return [places.get(id(one.last_detection), -1) for one in live(answer)]

    return Peer(lambda: getattr(norfair, job["make"])(**arguments), offer, read, rows)


def with_fps(arguments: dict[str, Any], fps: float) -> dict[str, Any]:
    """Return the arguments with the sequence's frames per second where they ask for them."""
    return {name: fps if value == "fps" else value for name, value in arguments.items()}


LIBRARIES = {"trackers": trackers_peer, "pyxtrackers": pyxtrackers_peer, "norfair": norfair_peer}
DISTRIBUTIONS = {"norfair": ("norfair-enough", "norfair")}  # where it is not the library's own name
USUAL: dict[
    str, dict[str, Any]
] = {  # arguments where the user gives none, by library; bench/peers/settings.toml has the same as defaults
    "trackers": {"frame_rate": "fps"},
    "norfair": {"distance_function": "iou", "distance_threshold": 0.7},
}


def serve() -> None:
    """Answer the lines of standard input until it ends."""
    out, sys.stdout = sys.stdout, sys.stderr  # what a library prints is no answer

    def say(message: dict[str, Any]) -> None:
        out.write(json.dumps(message) + "\n")
        out.flush()

    peer, tracker = None, None
    for line in sys.stdin:
        try:
            told = json.loads(line)
            if peer is None:
                job = {**told, "arguments": {**USUAL.get(told["library"], {}), **told["arguments"]}}
                peer = LIBRARIES[told["library"]](job, told["fps"])
                tracker = peer.start()
                say({"ready": version_of(told["library"])})
            else:
                say(answered(peer, tracker, told))
        except Exception as error:
            say({"fault": f"{type(error).__name__}: {error}".splitlines()[0][:300]})


def answered(peer: Peer, tracker: Any, told: dict[str, Any]) -> dict[str, Any]:
    """Return what a tracker says of one frame."""
    boxes = np.array(told["boxes"], np.float64).reshape(-1, 4)
    offered = peer.offer(boxes, np.array(told["scores"], np.float64))
    answer = tracker.update(offered)
    said = list(peer.read(answer))
    return {
        "ids": [int(identity) for identity, _ in said],
        "boxes": [[float(side) for side in box] for _, box in said],
        "rows": None if peer.rows is None else peer.rows(offered, answer),
    }


def version_of(library: str) -> str:
    """Return the version of the distribution that brings a library; empty where it is not known."""
    for name in DISTRIBUTIONS.get(library, (library,)):
        try:
            return importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return ""


if __name__ == "__main__":
    serve()
