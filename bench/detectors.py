"""What detectors find, and what trackers make of a small network's boxes.

    python bench/detectors.py [--parts boxes trackers pictures batch] [--environment DIR] [--frames N] [--json] [--write]

boxes     precision and recall at IoU 0.5 on PETS09-S2L1 of the networks at several scores, of `people` and of
          `background`; objects of the truth that are not asked for excuse what lies on them, as with `perdure score`.
          A network runs once, at its lowest score: what is less sure suppresses nothing that is surer. Of `people`,
          which is slow, every 10th frame counts. Milliseconds a frame are those of `step` alone, on one thread.
trackers  every tracker of bench/peers.py and ours on the boxes of yolox_nano of class person at a score of .25, as
          bench/peers.py runs them: nobody is given pictures.
pictures  ours on the same boxes with pictures, with and without silhouettes for boxes (--box-masks).
batch     milliseconds a picture of yolox_nano for several pictures at once, on one thread (needs the package onnx).

The data is read from $PERDURE_DATA, the peers' environment is as bench/peers.py has it. --frames ends the film early.
--write puts the tables into docs/detectors.md and leaves those of other parts there; --json prints everything as one
object in the last line.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import peers
from pages import Marks, versions
from regions import Table, chosen, markdown, plain

from perdure.detect import Background, Network, People, Recorded
from perdure.errors import PerdureError
from perdure.files.mot import read_truth
from perdure.files.networks import read_network
from perdure.files.video import open_source
from perdure.files.whole import whole_file
from perdure.metrics import score
from perdure.pipeline import FIRST_LOOKS, track
from perdure.types import Frame, Regions, Rows, Scene

PARTS = ("boxes", "trackers", "pictures", "batch")
PAGE = Path(__file__).resolve().parents[1] / "docs" / "detectors.md"
MARKS = Marks.of("bench/detectors.py", PAGE)
FILM = "pets09-s2l1"
YOLOX = "yolox_nano_416.onnx"
NETWORKS = {  # engine, file, names of classes, scores
    "yolox_nano": ("onnx", YOLOX, (), (0.1, 0.25, 0.4, 0.5, 0.6)),
    "person-detection-0200": ("openvino", "person-detection-0200.xml", ("person",), (0.1, 0.2, 0.3, 0.5)),
}
SCORE = 0.25  # of the boxes that trackers are given
RARE = 10  # every so many frames are looked at by `people`
BATCHES, TURNS = (1, 2, 4, 8), 20
SILHOUETTES = ("none", "background", "cut")
WITH_PICTURES = ("compound", "multifeature")


def main() -> None:
    arguments = _arguments()
    cv2.setNumThreads(1)
    try:
        parts = chosen(arguments.parts, {name: [name] for name in PARTS}, "part")
        told = {name: _measured(name, arguments) for name in parts}
        tables = {name: tables_of(name, value) for name, value in told.items()}
        print("\n\n".join(plain(one) for many in tables.values() for one in many))
        if arguments.write:
            page = PAGE.read_text(encoding="utf-8")
            with whole_file(PAGE) as file:
                file.write(MARKS.replaced(page, section(tables, page)))
        if arguments.json:
            print(json.dumps({"versions": versions(), **told}))
    except (PerdureError, peers.PeersError) as error:
        sys.exit(f"bench/detectors.py: {error}")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", nargs="+", metavar="NAME", default=PARTS, help=", ".join(PARTS))
    parser.add_argument("--frames", type=int, default=None, metavar="N", help="of the film; default: all")
    parser.add_argument("--environment", type=Path, default=peers.ENVIRONMENT, metavar="DIR", help="of the peers")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/detectors.md")
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    return parser.parse_args()


def _measured(part: str, arguments: argparse.Namespace) -> Any:
    if part == "boxes":
        return boxes_part(arguments.frames)
    if part == "trackers":
        return trackers_part(arguments.frames, arguments.environment)
    return pictures_part(arguments.frames) if part == "pictures" else batch_part()


# What detectors find.


@dataclass(frozen=True)
class Looked:
    """What a detector saw of the film."""

    scene: Scene
    seen: tuple[tuple[Frame, Regions], ...]  # frames without pictures
    ms: float  # a frame


def looked(detector: Any, frames: int | None, stride: int = 1) -> Looked:
    """Run a detector over the film; only `step` is timed."""
    source = open_source(
        peers.data_folder() / FILM / "video.avi", end=None if frames is None else f"{frames}f", stride=stride
    )
    try:
        if hasattr(detector, "prepare"):
            detector = detector.prepare(source.sample(FIRST_LOOKS))
        scene = source.scene()
        state, seconds, seen = detector.start(scene), 0.0, []
        for frame in source:
            begun = time.process_time()
            state, regions = detector.step(state, frame)
            seconds += time.process_time() - begun
            seen.append((dataclasses.replace(frame, image=None), regions))
    finally:
        source.close()
    return Looked(scene, tuple(seen), 1e3 * seconds / max(1, len(seen)))


def network_of(name: str, least: float) -> Network:
    """Return a network of `NETWORKS` at a score."""
    engine, file, names, _ = NETWORKS[name]
    return Network(
        network_score=least, model=read_network(engine, peers.data_folder() / "models" / file, names=names)
    )


def boxes_part(frames: int | None) -> list[dict[str, Any]]:
    """Return a line for every detector and score."""
    lines = []
    for name, (_, _, _, scores) in NETWORKS.items():
        found = looked(network_of(name, min(scores)), frames)
        lines += [{"detector": name, "score": least, **found_by(found, least, "person")} for least in scores]
    for name, detector, stride in (("people", People(), RARE), ("background", Background(), 1)):
        lines.append({"detector": name, "score": None, **found_by(looked(detector, frames, stride), 0.0, "")})
    return lines


def found_by(found: Looked, least: float, kind: str) -> dict[str, Any]:
    """Return precision and recall of the boxes of a class ("": of any) with a score of `least` or more."""
    kept = [(frame, wanted(regions, least, kind)) for frame, regions in found.seen]
    boxes = np.concatenate([regions.boxes for _, regions in kept])
    numbers = np.concatenate([np.full(len(regions), frame.index) for frame, regions in kept])
    said = Rows.of(frames=numbers, ids=np.arange(1, len(boxes) + 1), boxes=boxes)  # nobody is followed
    looked_at = [frame.index for frame, _ in kept]
    truth = true_rows(looked_at[-1] + 1)
    figures = score(said, truth.take(np.isin(truth.frames, looked_at))).figures
    return {
        "frames": len(kept),
        "boxes": len(boxes),
        "precision": float(figures["Precision"]),
        "recall": float(figures["Recall"]),
        "ms": found.ms,
    }


def wanted(regions: Regions, least: float, kind: str) -> Regions:
    """Return the regions of a class ("": of any) with a score of `least` or more."""
    return regions.take((regions.scores >= least) & ((regions.classes == kind) | (kind == "")))


def true_rows(count: int) -> Rows:
    """Return the truth of the first frames."""
    return read_truth(peers.data_folder() / FILM / "gt" / "gt.txt").between(0, count - 1)


# What trackers make of them.


def given_to_trackers(frames: int | None) -> peers.Seen:
    """Return what every tracker is given: people that yolox_nano sees."""
    found = looked(network_of("yolox_nano", SCORE), frames)
    numbers = tuple(frame for frame, _ in found.seen)
    regions = tuple(wanted(regions, SCORE, "person") for _, regions in found.seen)
    return peers.Seen(found.scene, numbers, regions, true_rows(len(numbers)))


def trackers_part(frames: int | None, folder: Path) -> list[dict[str, Any]]:
    """Return a line for every tracker and its settings, the best HOTA first."""
    given, python = given_to_trackers(frames), peers.environment(folder)
    lines = []
    for runner in peers.runners():
        print(f"{runner.tracker}, {runner.settings}", file=sys.stderr, flush=True)
        seen = {FILM: given}
        outcome = (
            peers.follow_here(runner, seen) if runner.job is None else peers.follow_there(runner, seen, python)
        )[FILM]
        lines.append(peers.line(runner, [given], [outcome], len(given.frames)))
    return [
        {"tracker": one.runner.tracker, "settings": one.runner.settings, "fault": one.fault, "ms": one.ms}
        | ({name: float(one.score.figures[name]) for name in peers.FIGURES} if one.score else {})
        for one in sorted(lines, key=lambda one: -one.score.figures["HOTA"] if one.score else 1.0)
    ]


def pictures_part(frames: int | None) -> list[dict[str, Any]]:
    """Return a line for ours with pictures, without silhouettes and with each kind of them."""
    given = given_to_trackers(frames)
    detector = Recorded(regions={frame.index: one for frame, one in zip(given.frames, given.regions, strict=True)})
    lines = []
    for tracker in WITH_PICTURES:
        for masks in SILHOUETTES:
            print(f"{tracker}, {masks}", file=sys.stderr, flush=True)
            begun = time.perf_counter()
            said = track(
                peers.data_folder() / FILM / "video.avi",
                end=f"{len(given.frames)}f",
                detector=detector,
                tracker=tracker,
                box_masks=masks,
            ).counted()
            seconds = time.perf_counter() - begun
            figures = score(Rows.of(frames=said.frames, ids=said.ids, boxes=said.boxes), given.truth).figures
            told = {name: float(figures[name]) for name in peers.FIGURES}
            lines.append(
                {"tracker": f"perdure/{tracker}", "masks": masks, **told, "ms": 1e3 * seconds / len(given.frames)}
            )
    return lines


# Several pictures at once.


def batch_part() -> list[dict[str, float]]:
    """Return milliseconds a picture for several at once; the network is changed so that it takes any number."""
    import onnx
    import onnxruntime

    model = onnx.load(str(peers.data_folder() / "models" / YOLOX))
    for port in (*model.graph.input, *model.graph.output):
        port.type.tensor_type.shape.dim[0].dim_param = "pictures"
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    session = onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
    chance = np.random.default_rng(1)
    lines = []
    for count in BATCHES:
        pictures = chance.uniform(0, 255, (count, 3, 416, 416)).astype(np.float32)
        times = []
        for _ in range(TURNS):
            begun = time.perf_counter()
            session.run(None, {"images": pictures})
            times.append(1e3 * (time.perf_counter() - begun) / count)
        lines.append({"pictures": count, "ms": float(np.median(times))})
    return lines


# Tables.


def tables_of(part: str, lines: Sequence[Mapping[str, Any]]) -> list[Table]:
    """Return what a part measured as a table, its title beginning with the part's name."""
    if part == "boxes":
        head = ["detector", "score from", "precision", "recall", "boxes", "frames", "ms a frame"]
        rows = [
            [
                one["detector"], "" if one["score"] is None else f"{one['score']:g}", f"{one['precision']:.3f}",
                f"{one['recall']:.3f}", str(one["boxes"]), str(one["frames"]), f"{one['ms']:.1f}",
            ]
            for one in lines
        ]  # fmt: skip
        return [Table("boxes: PETS09-S2L1, boxes at IoU 0.5", head, rows)]
    if part == "batch":
        rows = [[str(one["pictures"]), f"{one['ms']:.1f}"] for one in lines]
        return [
            Table("batch: yolox_nano, several pictures at once on one thread", ["pictures", "ms a picture"], rows)
        ]
    column = "settings" if part == "trackers" else "masks"
    title = {
        "trackers": f"trackers: PETS09-S2L1, people of yolox_nano from a score of {SCORE:g}, no pictures",
        "pictures": "pictures: ours on the same boxes, with pictures, by silhouettes for boxes (ms: all but the network)",
    }[part]
    return [Table(title, ["tracker", column, *peers.FIGURES, "ms a frame"], list(_figures(lines, column)))]


def _figures(lines: Sequence[Mapping[str, Any]], column: str) -> Iterator[list[str]]:
    for one in lines:
        if one.get("fault"):
            yield [one["tracker"], one[column], f"failed: {one['fault']}", *[""] * len(peers.FIGURES)]
            continue
        cells = [f"{one[name]:.0f}" if name == "IDSW" else f"{100 * one[name]:.1f}" for name in peers.FIGURES]
        yield [one["tracker"], one[column], *cells, peers.two_digits(one["ms"])]


def section(tables: Mapping[str, Sequence[Table]], page: str = "") -> str:
    """Return what stands between the marks in docs/detectors.md; a page's tables of parts that were not run stay."""
    kept = [(title, table) for title, table in MARKS.tables(page) if title.partition(":")[0] not in tables]
    written = [*kept, *((one.title, markdown(one)) for many in tables.values() for one in many)]
    ordered = [table for part in PARTS for title, table in written if title.startswith(f"{part}:")]
    told = ", ".join(f"{name} {version}" for name, version in versions().items())
    return "\n\n".join(
        ["`python bench/detectors.py --write`", *ordered, f"Versions: {told}. Processor: {peers.cpu()}."]
    )


if __name__ == "__main__":
    main()
