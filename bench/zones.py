"""What zones bring: people of a film by every tracker without zones, with those that a user drew, and with learnt ones.

    python bench/zones.py [--data DIR] [--trackers NAME ...] [--regions background detections] [--json] [--write]

The film is pets09-s2l1, the zones are bench/zones/pets09-s2l1.json, drawn once by looking at one frame: an occluder
round the lamp post with its sign, and an entry and an exit at each place where the picture's border crosses the road or
the path. `background` is the whole chain from pixels, as `perdure track` runs it, `detections` the film with the boxes of
det/det.txt. `learnt` zones are those that `perdure learn-zones` proposes from the run without zones, as they are; all else
is equal. Counted is as `perdure score` counts: MOTA, IDF1 in percent at IoU 0.5, identity switches, fragments, and
ids said. The data is read from $PERDURE_DATA or ../shared/data beside the repository. --write puts the table into
docs/zones.md, --json prints everything as one object in the last line.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pages import Marks
from regions import Table, chosen, markdown, plain

from perdure import fold
from perdure.cli.learn_zones import LOOKS, learnt_from
from perdure.errors import PerdureError
from perdure.files.mot import read_truth
from perdure.files.video import open_source
from perdure.files.whole import whole_file
from perdure.metrics.scoring import score
from perdure.pipeline import plan
from perdure.scene.zones import Zones
from perdure.trackers import TRACKERS
from perdure.types import Report

ROOT = Path(__file__).resolve().parents[1]
CLIP = "pets09-s2l1"
ZONES = ROOT / "bench" / "zones" / f"{CLIP}.json"
PAGE = ROOT / "docs" / "zones.md"
MARKS = Marks.of("bench/zones.py", PAGE)
REGIONS = {"background": None, "detections": "det/det.txt"}
FIGURES = ("MOTA", "IDF1", "IDSW", "Frag")


def main() -> None:
    arguments = _arguments()
    try:
        trackers = chosen(arguments.trackers, {name: [name] for name in TRACKERS}, "tracker")
        kinds = chosen(arguments.regions, {name: [name] for name in REGIONS}, "kind of regions")
        told = measure(arguments.data / CLIP, trackers, kinds)
        print(plain(table(told)))
        if arguments.write:
            text = PAGE.read_text(encoding="utf-8")
            with whole_file(PAGE) as file:
                file.write(replaced(text, told))
        if arguments.json:
            print(json.dumps([one.as_json() for one in told]))
    except PerdureError as error:
        print(f"zones.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = Path(os.environ.get("PERDURE_DATA") or ROOT.parent / "shared" / "data")
    parser.add_argument("--data", type=Path, default=root, help="where the clips are")
    parser.add_argument("--trackers", nargs="+", metavar="NAME", default=list(TRACKERS), help=", ".join(TRACKERS))
    parser.add_argument("--regions", nargs="+", metavar="NAME", default=list(REGIONS), help=", ".join(REGIONS))
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    parser.add_argument("--write", action="store_true", help="replace the table in docs/zones.md")
    return parser.parse_args()


@dataclass(frozen=True)
class Told:
    """The figures of one run."""

    tracker: str
    regions: str
    zones: str  # none, drawn or learnt
    figures: Mapping[str, float]
    ids: int
    rate: float  # frames a second, decoding and regions included

    def as_json(self) -> dict[str, Any]:
        own = {name: self.figures[name] for name in FIGURES}
        return {
            "tracker": self.tracker,
            "regions": self.regions,
            "zones": self.zones,
            **own,
            "ids": self.ids,
            "frames/s": self.rate,
        }


def measure(folder: Path, trackers: Sequence[str], kinds: Sequence[str]) -> list[Told]:
    """Run every tracker on every kind of regions, without zones, with those that were drawn, and with learnt ones."""
    truth, told = read_truth(folder / "gt" / "gt.txt"), []
    for kind in kinds:
        for tracker in trackers:
            plain_one, reports = _run(folder, tracker, kind, "none", None, truth)
            learnt = _learnt(folder, reports)
            told.append(plain_one)
            for name, zones in (("drawn", ZONES), ("learnt", learnt)):
                told.append(_run(folder, tracker, kind, name, zones, truth)[0])
            rates = ", ".join(f"{one.zones} {one.rate:.0f}" for one in told[-3:])
            print(f"{tracker}, {kind}: {rates} frames/s", file=sys.stderr)
    return told


def _learnt(folder: Path, reports: Sequence[Report]) -> Zones:
    """The zones that are proposed from a run over the film, as they are."""
    source = open_source(folder / "video.avi")
    try:
        looks, times = source.sample(LOOKS), [frame.time for frame in source]
    finally:
        source.close()
    size = source.height, source.width
    settled = fold.settle_by_frame(lambda: iter(reports))
    found = learnt_from(settled, (times[0], times[-1]), size, [look.image for look in looks])
    return Zones(tuple(one.zone for one in found.proposals), (), size)


def _run(
    folder: Path, tracker: str, kind: str, name: str, zones: Path | Zones | None, truth: Any
) -> tuple[Told, list[Report]]:
    """The figures of one run, and what it said."""
    detector = None if REGIONS[kind] is None else folder / str(REGIONS[kind])
    made = plan(str(folder / "video.avi"), tracker=tracker, detector=detector, zones=zones)
    begun = time.monotonic()
    reports: list[Report] = []
    try:
        for step in made.prepared().steps():
            reports.append(step.report)
    finally:
        made.source.close()
    seconds = time.monotonic() - begun
    tracks = fold.settle(reports).counted()
    figures = score(tracks, truth).figures
    rate = (len(reports) - 1) / seconds
    return Told(tracker, kind, name, figures, len(np.unique(tracks.ids)), rate), reports


def table(told: Sequence[Told]) -> Table:
    """A row for every run."""
    rows = [
        [
            one.tracker,
            one.regions,
            one.zones,
            *(f"{100 * one.figures[name]:.1f}" for name in FIGURES[:2]),
            *(f"{one.figures[name]:.0f}" for name in FIGURES[2:]),
            str(one.ids),
        ]
        for one in told
    ]
    head = ["tracker", "regions", "zones", "MOTA", "IDF1", "switches", "fragments", "ids"]
    return Table(f"{CLIP}: MOTA and IDF1 in percent", head, rows)


def replaced(text: str, told: Sequence[Told]) -> str:
    """Return the page with the table in the place of the last one."""
    command = " ".join(["python bench/zones.py", *sys.argv[1:]])
    return MARKS.replaced(text, f"`{command}`\n\n{markdown(table(told))}")


if __name__ == "__main__":
    main()
