"""Animals in a dish: films from above of flies and of fish, by the background and by grey levels alone.

    python bench/animals.py [--data DIR] [--films NAME ...] [--trackers NAME ...] [--json] [--write]

*grey* is a function: regions are what is brighter than 40 (flies) or darker than 125 (fish) and has 800 or 150 pixels
and more, each picture by itself; *background* is the usual detector. *All there* is the share of frames in which as many
are said as there are animals, ids those of rows that count. IDSW, HOTA and IDF1 where the truth has identities (of the
flies; its boxes are drawn round key points). The data is read from $PERDURE_DATA or ../shared/data beside the repository.
--write puts the table into docs/animals.md, --json prints everything as one object in the last line.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np
from pages import Marks, absent
from regions import Table, chosen, markdown, plain

import perdure
from perdure import Mask, Regions
from perdure.errors import PerdureError
from perdure.files.mot import read_truth
from perdure.files.whole import whole_file
from perdure.metrics.scoring import score
from perdure.trackers import TRACKERS

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "animals.md"
MARKS = Marks.of("bench/animals.py", PAGE)
Image = np.ndarray


@dataclass(frozen=True)
class Film:
    """A film of animals from above."""

    place: str
    animals: int
    bright: bool  # brighter than what is around them
    level: int
    least: int  # px
    truth: str = ""

    def regions(self, image: Image) -> Regions:
        """What is bright, or dark, and large enough."""
        grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
        inside = (grey > self.level if self.bright else grey < self.level).astype(np.uint8)
        count, labels, stats, _ = cv2.connectedComponentsWithStats(inside)
        kept = [k for k in range(1, count) if stats[k, cv2.CC_STAT_AREA] >= self.least]
        masks = [Mask.of_image(labels == k) for k in kept]
        return Regions.of([mask.box for mask in masks], masks=masks) if masks else Regions.empty()


FILMS = {
    "flies": Film("flies/sleap_clip_2flies.mp4", 2, True, 40, 800, "flies/sleap_clip_2flies.gt.txt"),
    "two-flies": Film("flies/two_flies.mp4", 2, True, 40, 800, "flies/two_flies.gt.txt"),
    "fish8": Film("fish8/test_A.avi", 8, False, 125, 150),
}


@dataclass(frozen=True)
class Told:
    """What one run of a film gave."""

    film: str
    detector: str
    tracker: str
    animals: int
    ids: int
    all_there: float
    switches: int | None
    hota: float | None
    idf1: float | None


def main() -> None:
    arguments = _arguments()
    try:
        trackers = chosen(arguments.trackers, {name: [name] for name in TRACKERS}, "tracker")
        names = chosen(arguments.films, {name: [name] for name in FILMS}, "film")
        told = [
            measure(arguments.data, name, detector, tracker)
            for name in names
            if not absent(arguments.data / FILMS[name].place)
            for detector in ("background", "grey")
            for tracker in trackers
        ]
        print(plain(table(told)))
        if arguments.write:
            text = MARKS.replaced(PAGE.read_text(encoding="utf-8"), f"\n{markdown(table(told))}\n")
            with whole_file(PAGE) as file:
                file.write(text)
        if arguments.json:
            print(json.dumps([asdict(one) for one in told]))
    except PerdureError as error:
        print(f"animals.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def measure(data: Path, name: str, detector: str, tracker: str) -> Told:
    """Track a film and count."""
    film = FILMS[name]
    seen: str | Callable[[Image], Regions] = film.regions if detector == "grey" else detector
    frames, reports = 0, []
    for frame, _, report in perdure.follow(str(data / film.place), detector=seen, tracker=tracker):
        frames += frame is not None
        reports.append(report)
    tracks = perdure.settle(reports).counted()
    there = np.bincount(tracks.frames, minlength=frames)  # rows of each frame
    figures = score(tracks, read_truth(data / film.truth)).figures if film.truth else {}
    return Told(
        name, detector, tracker, film.animals, len(np.unique(tracks.ids)),
        float((there == film.animals).mean()),
        figures.get("IDSW"), figures.get("HOTA"), figures.get("IDF1"),
    )  # fmt: skip


def table(told: list[Told]) -> Table:
    """The figures of all runs."""
    heads = ["film", "regions", "tracker", "animals", "ids", "all there", "IDSW", "HOTA", "IDF1"]
    return Table("Films from above", heads, [_row(one) for one in told])


def _row(one: Told) -> list[str]:
    def share(value: float | None) -> str:
        return "–" if value is None else f"{100 * value:.1f}"

    switches = "–" if one.switches is None else str(one.switches)
    counts = [str(one.animals), str(one.ids), f"{100 * one.all_there:.0f} %", switches]
    return [one.film, one.detector, one.tracker, *counts, share(one.hota), share(one.idf1)]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = Path(os.environ.get("PERDURE_DATA") or ROOT.parent / "shared" / "data")
    parser.add_argument("--data", type=Path, default=root, help="where the films are")
    parser.add_argument("--films", nargs="+", metavar="NAME", default=list(FILMS), help=", ".join(FILMS))
    parser.add_argument(
        "--trackers", nargs="+", metavar="NAME", default=["compound", "multifeature"], help=", ".join(TRACKERS)
    )
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    parser.add_argument("--write", action="store_true", help="replace the table in docs/animals.md")
    return parser.parse_args()


if __name__ == "__main__":
    main()
