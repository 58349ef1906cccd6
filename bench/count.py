"""What is counted against what was seen: vehicles that cross a line, by every tracker asked for.

    python bench/count.py [--data DIR] [--trackers NAME ...] [--json] [--write]

The film is cdnet-highway, from pixels, as `perdure track` runs it. What was seen is bench/count/cdnet-highway.csv, made
by looking at the pictures; its head says how. A crossing that was counted and one that was seen are the same if they are
at most 12 frames apart (0.2 s) and of one line and direction; the nearest go together first. The data is read from
$PERDURE_DATA or ../shared/data beside the repository. --write puts the table into docs/counting.md, --json prints
everything as one object in the last line.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import statistics
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from pages import Marks
from regions import Table, chosen, markdown, plain

from perdure import fold
from perdure.errors import FormatError, PerdureError
from perdure.files.whole import whole_file
from perdure.pipeline import plan
from perdure.scene.counting import IN, OUT, Line, count
from perdure.trackers import TRACKERS

ROOT = Path(__file__).resolve().parents[1]
CLIP = "cdnet-highway"
SEEN = ROOT / "bench" / "count" / f"{CLIP}.csv"
LINES = (Line("far", ((60, 130), (268, 130))), Line("near", ((20, 170), (272, 170))))
PAGE = ROOT / "docs" / "counting.md"
MARKS = Marks.of("bench/count.py", PAGE)
APART = 12  # frames


@dataclass(frozen=True)
class Told:
    """Counted against seen, of one tracker, line and direction."""

    tracker: str
    line: str
    direction: str
    seen: int
    counted: int
    matched: list[tuple[int, int]]  # frames seen and counted
    missed: list[int]  # frames
    doubled: list[int]

    @property
    def off(self) -> float | None:
        """By how much the count is off, in percent; None where nothing was seen."""
        return 100 * abs(self.counted - self.seen) / self.seen if self.seen else None


def main() -> None:
    arguments = _arguments()
    try:
        trackers = chosen(arguments.trackers, {name: [name] for name in TRACKERS}, "tracker")
        seen = read_seen(SEEN)
        told = [one for tracker in trackers for one in measure(arguments.data / CLIP / "video.avi", tracker, seen)]
        print(plain(table(told)))
        for one in told:
            if one.matched:
                pairs = " ".join(f"{a}:{b}" for a, b in one.matched)
                print(f"\n{one.tracker}, {one.line}, {one.direction}, frames seen:counted\n{pairs}")
        if arguments.write:
            text = PAGE.read_text(encoding="utf-8")
            with whole_file(PAGE) as file:
                file.write(replaced(text, told))
        if arguments.json:
            print(json.dumps([{**asdict(one), "off_percent": one.off} for one in told]))
    except PerdureError as error:
        print(f"count.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = Path(os.environ.get("PERDURE_DATA") or ROOT.parent / "shared" / "data")
    usual = ["compound", "overlap"]
    parser.add_argument("--data", type=Path, default=root, help="where the clips are")
    parser.add_argument("--trackers", nargs="+", metavar="NAME", default=usual, help=", ".join(TRACKERS))
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    parser.add_argument("--write", action="store_true", help="replace the table in docs/counting.md")
    return parser.parse_args()


def read_seen(path: Path) -> dict[tuple[str, str], list[int]]:
    """Return the frames at which crossings were seen, by line and direction."""
    seen: dict[tuple[str, str], list[int]] = {(line.name, way): [] for line in LINES for way in (IN, OUT)}
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(line for line in file if not line.startswith("#")):
            place = row["line"], row["direction"]
            if place not in seen:
                raise FormatError(f"{path} speaks of {place}; there are {sorted(seen)}")
            seen[place].append(int(row["frame"]))
    return seen


def measure(film: Path, tracker: str, seen: dict[tuple[str, str], list[int]]) -> list[Told]:
    """Track the film and hold the count against what was seen."""
    made = plan(str(film), tracker=tracker)
    try:
        tracks = fold.settle(step.report for step in made.prepared().steps()).counted()
        size = made.scene.height, made.scene.width
    finally:
        made.source.close()
    counts = count(tracks, lines=LINES, size=size)
    return [
        compared(tracker, line, way, frames, [one.frame for one in counts.of_line(line, way)])
        for (line, way), frames in seen.items()
    ]


def compared(tracker: str, line: str, way: str, seen: Sequence[int], counted: Sequence[int]) -> Told:
    """Match the frames of what was seen and counted, the nearest first."""
    near = sorted((abs(a - b), i, j) for i, a in enumerate(seen) for j, b in enumerate(counted))
    mine: dict[int, int] = {}
    for apart, i, j in near:
        if apart <= APART and i not in mine and j not in mine.values():
            mine[i] = j
    return Told(
        tracker,
        line,
        way,
        len(seen),
        len(counted),
        [(seen[i], counted[j]) for i, j in sorted(mine.items())],
        [frame for i, frame in enumerate(seen) if i not in mine],
        [frame for j, frame in enumerate(counted) if j not in mine.values()],
    )


def table(told: Sequence[Told]) -> Table:
    """A row for every tracker, line and direction."""
    rows = []
    for one in told:
        apart = [abs(a - b) for a, b in one.matched]
        rows.append(
            [
                one.tracker,
                one.line,
                one.direction,
                str(one.seen),
                str(one.counted),
                "-" if one.off is None else f"{one.off:.1f}",
                str(len(one.matched)),
                " ".join(map(str, one.missed)) or "-",
                " ".join(map(str, one.doubled)) or "-",
                f"{statistics.median(apart):g}, {max(apart)}" if apart else "-",
            ]
        )
    head = [
        "tracker", "line", "direction", "seen", "counted", "off %", "matched", "missed at", "too many at",
        "frames apart: median, most",
    ]  # fmt: skip
    return Table(f"{CLIP}: vehicles counted and seen", head, rows)


def replaced(text: str, told: Sequence[Told]) -> str:
    """Return the page with the table in the place of the last one."""
    command = " ".join(["python bench/count.py", *sys.argv[1:]])
    return MARKS.replaced(text, f"`{command}`\n\n{markdown(table(told))}")


if __name__ == "__main__":
    main()
