"""What the paper of `compound` shows, repeated: its Fig. 3, its cost, and the cost of a step beside a library's.

    python bench/compound_paper.py [--parts figure cost step] [--data DIR] [--environment DIR] [--rounds N]
                                   [--draw DIR] [--json] [--write]

figure  Fig. 3 as a drawn film: two persons walk together, apart and merged, with shadows, apart, merged; a third,
        whom nobody has seen, comes out of a van into the merged group; then all part (that phase, g, is ours).
        Regions are the connected components of the silhouettes that are seen; in phase c cast shadows and specks come
        and go. Told is what is settled in the end. A row stands on a person if their boxes have IoU >= 0.5, one to
        one; a person counts in frames in which at least 0.15 of the silhouette is seen. The last of its tables is of
        the same film with the two nearer together or farther apart while merged: how much one film's luck weighs.
cost    milliseconds a frame of the whole chain (decode, first look, background, tracker, what the tracker tells the
        background) and of the tracker alone, on the drawn film held in memory and on a video, in one pass after a
        warm-up; beside the paper's. Videos are decoded ahead in a thread: `decode` is the waiting.
step    the tracker's own calls on boxes alone: walkers on a large picture, boxes that jitter and are missed now and
        then, the same for both; against ByteTrackTracker of the library `trackers` at its defaults, in the peers'
        environment as bench/peers.py has it ($PERDURE_PEERS). Both take turns, `--rounds` times; the best counts, a
        round being the best of three after a warm-up.

The data is read from $PERDURE_DATA or ../shared/data beside the repository; a video that is not there is left out
with a note. --draw writes a picture of each phase, --write puts the tables into docs/benchmarks.md, --json prints
everything as one object in the last line.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import os
import platform
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import peers
from regions import Table, chosen, markdown, paired, plain

from perdure import fold
from perdure.demo.figures import Clothes, ellipse
from perdure.demo.world import Occluder, Walker, World
from perdure.detect import Background
from perdure.detect.components import components
from perdure.draw import Trails, paint
from perdure.errors import PerdureError
from perdure.files.video import open_source
from perdure.files.whole import whole_file
from perdure.pipeline import FIRST_LOOKS
from perdure.trackers import TRACKERS
from perdure.types import Bits, Event, Frame, Regions, Report, Rows, Scene, Status, Tracks

TRACKER = "compound"
PARTS = ("figure", "cost", "step")
ROOT = Path(__file__).resolve().parents[1]
VIDEO = Path("pets09-s2l1") / "video.avi"
PAGE = ROOT / "docs" / "benchmarks.md"
HEADING = "## What the paper of `compound` shows"
BEGIN, END = "<!-- bench/compound_paper.py begins -->", "<!-- bench/compound_paper.py ends -->"
PAPER_WHOLE, PAPER_TRACKING = 2500.0, 200.0  # ms a frame, 512x512, SparcStation 10: section V


def main() -> None:
    arguments = _arguments()
    try:
        result = measure(arguments)
        print("\n\n".join(plain(one) for one in result.tables))
        if arguments.write:
            text = PAGE.read_text(encoding="utf-8")
            command = "python bench/compound_paper.py --write"
            with whole_file(PAGE) as file:
                file.write(replaced(text, section(command, result)))
        if arguments.json:
            print(json.dumps(result.told))
    except (PerdureError, peers.PeersError) as error:
        print(f"compound_paper.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = Path(os.environ.get("PERDURE_DATA") or ROOT.parent / "shared" / "data")
    parser.add_argument("--parts", nargs="+", metavar="NAME", default=PARTS, help=", ".join(PARTS))
    parser.add_argument("--data", type=Path, default=root, help="where the clips are")
    parser.add_argument("--environment", type=Path, default=peers.ENVIRONMENT, metavar="DIR", help="of the peers")
    parser.add_argument("--rounds", type=int, default=2, help="turns of both in the part step")
    parser.add_argument("--draw", type=Path, metavar="DIR", help="a picture of each phase goes here")
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    parser.add_argument("--write", action="store_true", help="replace the section in docs/benchmarks.md")
    return parser.parse_args()


@dataclass(frozen=True)
class Result:
    """The tables of the parts that were asked for, and everything as plain values."""

    tables: tuple[Table, ...]
    told: Mapping[str, Any]


def measure(arguments: argparse.Namespace) -> Result:
    """Run the parts that the arguments name."""
    parts = chosen(arguments.parts, {name: [name] for name in PARTS}, "part")
    versions = {"cpu": peers.cpu(), "python": platform.python_version(), "perdure": metadata.version("perdure")}
    tables: list[Table] = []
    told: dict[str, Any] = {"versions": versions}
    if "figure" in parts:
        film = figure_film()
        found = watch(film)
        tables += [phase_table(found), fate_table(found), event_table(found)]
        others = {together: watch(figure_film(together)) for together in VARIATIONS}
        tables.append(variation_table(others))
        told["figure"] = figure_json(found)
        told["variations"] = {
            together: [one.as_json() for one in fates(other)] for together, other in others.items()
        }
        if arguments.draw:
            draw(arguments.draw, film, found)
    if "cost" in parts:
        costs = [cost_of_film(figure_film()), *cost_of_video(arguments.data / VIDEO)]
        tables.append(cost_table(costs))
        told["cost"] = [dataclasses.asdict(one) | {"whole": one.whole, "share": one.share} for one in costs]
    if "step" in parts:
        python = peers.environment(arguments.environment)
        versions |= peers.library_versions(python)
        steps = race({str(count): crowd(count) for count in COUNTS}, python, arguments.rounds)
        tables.append(step_table(steps))
        told["step"] = [one._asdict() | {"ratio": one.ratio} for one in steps]
    return Result(tuple(tables), told)


# The film of Fig. 3 -----------------------------------------------------------------------------------------


class Phase(NamedTuple):
    """A stretch of the film, from `begin` to before `end`, in seconds."""

    name: str
    what: str
    begin: float
    end: float


PHASES = (
    Phase("a", "two, apart", 0.0, 3.0),
    Phase("b", "two, merged", 3.0, 5.0),
    Phase("c", "two, merged, shadows", 5.0, 7.0),
    Phase("d", "two, apart", 7.0, 9.5),
    Phase("e", "two, merged", 9.5, 11.5),
    Phase("f", "a third joins unseen", 11.5, 13.5),
    Phase("g", "all three part", 13.5, 16.0),
)
PERSONS = ("A", "B", "C")  # in the order of the walkers; C is the third
WALK, START = 23.0, 60.0  # pixels a second to the right, and where the two begin
APART, TOGETHER = 32.0, 7.0  # pixels from the middle of the two to each
VARIATIONS = (5.0, 6.0, 7.0, 8.0, 9.0, 10.0)  # of TOGETHER: how much one luck weighs
TURN = 0.6  # s before and after the border of two phases, in which they come together or part
SIZE = (30.0, 80.0)  # pixels
VAN = Occluder("box", START + WALK * 11.5 - 40.0, 258.0, 80.0, 100.0, (92, 104, 126))
LEAST_AREA = 20  # pixels of a component


@dataclass(frozen=True, eq=False)
class Film:
    """A drawn film: pictures, what a perfect background subtraction sees of them, the truth."""

    scene: Scene
    frames: tuple[Frame, ...]
    regions: tuple[Regions, ...]
    truth: Tracks


def figure_world(together: float = TOGETHER) -> World:
    """Return the film of Fig. 3: 512x512 at 12.5 frames a second."""
    fps = 12.5
    return World(
        width=512,
        height=512,
        fps=fps,
        count=round(PHASES[-1].end * fps),
        walkers=(
            _walker(Clothes((196, 52, 44), (44, 52, 84)), _beside(-APART, -together, 285.0, (428.0, 285.0))),
            _walker(Clothes((222, 190, 60), (40, 96, 62)), _beside(APART, together, 300.0, (446.0, 400.0))),
            _walker(Clothes((228, 230, 234), (120, 78, 150)), _third()),
        ),
        occluders=(VAN,),
        noise=3.0,
        seed=3,
    )


def _walker(clothes: Clothes, path: tuple[tuple[float, float, float], ...]) -> Walker:
    return Walker("person", path, *SIZE, clothes, smooth=0.3)


def _beside(
    far: float, near: float, foot: float, end: tuple[float, float]
) -> tuple[tuple[float, float, float], ...]:
    """The path of one of the two, `far` ahead of their middle while apart, `near` while merged; at last to `end`."""
    _, b, _, d, e, _, g = (phase.begin for phase in PHASES)
    points = [(0.0, far)]
    for border, before, after in ((b, far, near), (d, near, far), (e, far, near)):
        points += [(border - TURN, before), (border + TURN, after)]
    points.append((g, near))
    walked = tuple((t, START + WALK * t + offset, foot) for t, offset in points)
    return (*walked, (PHASES[-1].end, *end))


def _third() -> tuple[tuple[float, float, float], ...]:
    """He waits behind the van, comes out behind the two as they pass its end, goes with them, and leaves."""
    f, g, end = PHASES[5].begin, PHASES[6].begin, PHASES[6].end
    return (
        (0.0, VAN.x, 250.0),
        (f - 0.8, VAN.x, 250.0),
        (f + 0.6, START + WALK * (f + 0.6) + 4.0, 250.0),
        (g, START + WALK * g + 4.0, 250.0),
        (end, 420.0, 140.0),
    )


def figure_film(together: float = TOGETHER) -> Film:
    """Draw the film of Fig. 3; merged, the two are `together` pixels from their middle."""
    world = figure_world(together)
    truth = world.truth()
    frames, regions = [], []
    for frame in world.frames():
        seen = silhouettes(truth.in_frame(frame.index), world.height, world.width)
        if phase_at(frame.time).name == "c":
            frame, seen = shadowed(frame, seen, truth.in_frame(frame.index), world.seed)
        frames.append(frame)
        regions.append(components(np.uint8(255) * seen, least_area=LEAST_AREA))
    return Film(world.scene, tuple(frames), tuple(regions), truth)


def phase_at(moment: float) -> Phase:
    return next((one for one in PHASES if moment < one.end), PHASES[-1])


def silhouettes(rows: Tracks, height: int, width: int) -> Bits:
    """Return the pixels in which anybody is seen."""
    picture = np.zeros((height, width), np.bool_)
    for mask in rows.masks:
        picture |= mask.to_image(height, width)
    return picture


def shadowed(frame: Frame, seen: Bits, rows: Tracks, seed: int) -> tuple[Frame, Bits]:
    """Return a frame with shadows of ever other length at the feet and specks, and what is then seen of it."""
    rng = np.random.default_rng((seed, frame.index))
    dark = np.zeros(seen.shape, np.uint8)
    feet = [((x1 + x2) / 2, y2) for (x1, _, x2, y2), mask in zip(rows.boxes, rows.masks, strict=True) if mask.area]
    for x, y in feet:
        length = rng.uniform(14, 36)
        if rng.random() < 0.75:
            _fill(dark, (x + 0.8 * length, y - 3), length, rng.uniform(3, 6))
        for _ in range(2):
            _fill(dark, (x + rng.uniform(-90, 90), y + rng.uniform(-70, 50)), *rng.uniform(2, 5, 2))
    shadow = (dark > 0) & ~seen
    picture = np.array(frame.image)
    picture[shadow] = picture[shadow] // 2
    return dataclasses.replace(frame, image=picture), seen | shadow


def _fill(picture: np.ndarray, centre: tuple[float, float], across: float, down: float) -> None:
    outline = ellipse((float(centre[0]), float(centre[1])), float(across), float(down))
    cv2.fillPoly(picture, [np.rint(outline).astype(np.int32)], 255)


# What was told of it ----------------------------------------------------------------------------------------


class PhaseFound(NamedTuple):
    """What was told in the frames of a phase."""

    phase: Phase
    frames: range
    regions: float  # a frame
    merged: int  # frames in which two or more of the persons seen share a region
    seen: Mapping[str, int]  # person -> frames in which he is seen
    ids: Mapping[str, Counter[int]]  # person -> id -> frames in which it stands on him; 0: nobody does
    said: Mapping[int, int]  # id -> frames in which it has a row, wherever
    groups: Counter[int]  # id of a group's own row -> frames
    grouped: int  # frames in which a group has a row of its own
    strays: Counter[int]  # id -> frames in which it stands on nobody, lost and hidden ones left out


@dataclass(frozen=True, eq=False)
class Found:
    """What was told of the film."""

    phases: tuple[PhaseFound, ...]
    events: tuple[Event, ...]  # with settled ids
    tracks: Tracks
    corrections: int  # rows of earlier frames were given to another id, so many times
    stands: Mapping[
        tuple[int, str], int
    ]  # frame, person -> id; absent where he is not seen, 0 where nobody stands
    alone: int  # frames in which the third had a region of his own before the last phase
    own: Mapping[str, int] = field(default_factory=dict)  # A and B's ids in phase a


def watch(film: Film) -> Found:
    """Track the film and look who stands where."""
    steps = list(fold.track(zip(film.frames, film.regions, strict=True), TRACKERS[TRACKER](), film.scene))
    reports = [step.report for step in steps]
    tracks = fold.settle(reports)
    stands = {}
    for frame in film.frames:
        stands |= standing(tracks.in_frame(frame.index), film.truth.in_frame(frame.index))
    found = tuple(look_at(phase, film, tracks, stands) for phase in PHASES)
    own = {person: commonest(found[0].ids[person]) for person in PERSONS[:2]}
    renamed = sum(len(report.renamed) for report in reports)
    return Found(found, settled_events(reports), tracks, renamed, stands, third_alone(film), own)


def standing(rows: Tracks, truth: Tracks) -> dict[tuple[int, str], int]:
    """Return who stands on whom in a frame: (frame, person) -> id, 0 for nobody; only of persons who are seen."""
    rows = rows.take(~rows.is_group)
    truth = truth.take(truth.status != Status.OCCLUDED)
    pairs = dict(paired(truth.boxes, rows.boxes).pairs.tolist()) if len(rows) else {}
    return {
        (int(truth.frames[i]), PERSONS[truth.ids[i] - 1]): int(rows.ids[pairs[i]]) if i in pairs else 0
        for i in range(len(truth))
    }


def look_at(phase: Phase, film: Film, tracks: Tracks, stands: Mapping[tuple[int, str], int]) -> PhaseFound:
    """Count what was told in the frames of a phase."""
    numbers = [frame.index for frame in film.frames if phase.begin <= frame.time < phase.end]
    ids = {person: Counter(stands[n, person] for n in numbers if (n, person) in stands) for person in PERSONS}
    groups, strays, said_in, grouped = Counter[int](), Counter[int](), Counter[int](), 0
    for number in numbers:
        rows = tracks.in_frame(number)
        own = rows.ids[rows.is_group].tolist()
        groups.update(own)
        said_in.update(rows.ids.tolist())
        grouped += bool(own)
        said = rows.counted()
        strays.update(set(said.ids.tolist()) - {stands.get((number, person), 0) for person in PERSONS})
    return PhaseFound(
        phase,
        range(numbers[0], numbers[-1] + 1),
        float(np.mean([len(film.regions[number]) for number in numbers])),
        sum(shared(film.regions[number], film.truth.in_frame(number)) for number in numbers),
        {person: counts.total() for person, counts in ids.items()},
        ids,
        said_in,
        groups,
        grouped,
        strays,
    )


def shared(regions: Regions, truth: Tracks) -> bool:
    """Return whether two or more persons are seen in one region."""
    homes = [home for mask in truth.masks if mask.area and (home := home_of(regions, mask.box)) is not None]
    return len(set(homes)) < len(homes)


def home_of(regions: Regions, box: tuple[int, int, int, int]) -> int | None:
    """Return the region whose box holds most of a box, None where none holds any."""
    x1, y1, x2, y2 = regions.boxes.T
    across = np.minimum(x2, box[2]) - np.maximum(x1, box[0])
    down = np.minimum(y2, box[3]) - np.maximum(y1, box[1])
    inside = np.maximum(across, 0) * np.maximum(down, 0)
    return int(inside.argmax()) if inside.any() else None


def third_alone(film: Film) -> int:
    """Return in how many frames before the last phase the third had a region that he shared with nobody."""
    count = 0
    for frame, regions in zip(film.frames, film.regions, strict=True):
        rows = film.truth.in_frame(frame.index)
        homes = {
            int(who): home_of(regions, mask.box)
            for who, mask in zip(rows.ids, rows.masks, strict=True)
            if mask.area >= LEAST_AREA
        }
        third = homes.pop(3, None)
        count += frame.time < PHASES[-1].begin and third is not None and third not in homes.values()
    return count


def commonest(ids: Counter[int]) -> int:
    """Return the id that stands there in most frames; 0 if nobody ever does."""
    named = Counter({name: count for name, count in ids.items() if name})
    return named.most_common(1)[0][0] if named else 0


def settled_events(reports: Sequence[Report]) -> tuple[Event, ...]:
    """Return every event with the ids that are settled in the end, in order of frames."""
    corrections = fold.Corrections.of(reports)
    told = [corrections.event(event, number) for number, report in enumerate(reports) for event in report.events]
    return tuple(sorted(told, key=lambda event: event.end))


class Fate(NamedTuple):
    """What became of a person's id by the end of a phase in which they parted."""

    phase: str
    person: str
    own: int  # his id before; 0 for the third, who had none
    ids: Counter[int]  # in the phase; 0: nobody stands on him
    last: int  # his id in the phase's last frame; 0 if he has none
    since: int | None  # the frame from which on it was that one, until the phase's end

    @property
    def verdict(self) -> str:
        if not self.own:
            return "had none"
        if self.last != self.own:
            return "no"
        return "yes" if set(self.ids) == {self.own} else f"from frame {self.since}"

    def as_json(self) -> dict[str, Any]:
        return {**self._asdict(), "ids": dict(self.ids), "verdict": self.verdict}


def fates(found: Found) -> list[Fate]:
    """Return every person's fate in the phases in which they part."""
    rows = []
    for one in found.phases:
        for person in PERSONS if one.phase.name in "dg" else ():
            numbers = [n for n in one.frames if (n, person) in found.stands]
            if numbers:
                ids = [found.stands[n, person] for n in numbers]
                changes = [i for i in range(len(ids)) if ids[i] != ids[-1]]
                since = numbers[changes[-1] + 1 if changes else 0] if ids[-1] else None
                own = found.own.get(person, 0)
                rows.append(Fate(one.phase.name, person, own, one.ids[person], ids[-1], since))
    return rows


# Its tables -------------------------------------------------------------------------------------------------


def phase_table(found: Found) -> Table:
    """A row per phase."""
    rows = [
        [
            f"{one.phase.name} {one.phase.what}",
            f"{one.frames.start}-{one.frames.stop - 1}",
            f"{one.regions:.1f}",
            f"{one.merged}/{len(one.frames)}",
            *(in_words(one.ids[person], one.seen[person]) for person in PERSONS),
            ", ".join(f"{own} {one.said[own]}/{len(one.frames)}" for own in found.own.values()),
            in_words(one.groups, len(one.frames)),
            in_words(one.strays, len(one.frames)),
        ]
        for one in found.phases
    ]
    title = (
        "Fig. 3: ids that stand on each person, with the frames in which they do / in which the person is seen "
        f"({len(found.tracks)} settled rows, {found.corrections} corrections)"
    )
    head = [
        "phase",
        "frames",
        "regions",
        "merged in",
        *PERSONS,
        "rows of A's, B's id",
        "group's own row",
        "ids on nobody",
    ]
    return Table(title, head, rows)


def in_words(ids: Counter[int], of: int) -> str:
    """Write which ids stood there in how many frames: '1 25/25', '1 20/25, none 5'; '-' for nothing."""
    named = [f"{name} {count}/{of}" for name, count in ids.most_common() if name]
    return ", ".join([*named, *([f"none {ids[0]}"] if ids[0] else [])]) or "-"


def fate_table(found: Found) -> Table:
    """A row per person and split; what became of the third says the last."""
    rows = [
        [one.phase, one.person, str(one.own or "-"), in_words(one.ids, one.ids.total()), one.verdict]
        for one in fates(found)
    ]
    return Table(
        f"Fig. 3: who has the id back after each split; {third_in_words(found)}",
        ["after phase's split", "person", "id before", "ids in the phase", "has it back"],
        rows,
    )


def third_in_words(found: Found) -> str:
    """Say what became of the third, as it is."""
    joined, parted, third = found.phases[5], found.phases[6], PERSONS[2]
    return (
        f"the third had a region of his own in {found.alone} frames before; ids on him while in the group: "
        f"{in_words(joined.ids[third], joined.seen[third])}; while they part: "
        f"{in_words(parted.ids[third], parted.seen[third])}; in the end he has {third_at_last(found)}"
    )


def third_at_last(found: Found) -> str:
    """Say whose id the third has in the last frame."""
    last = next((one.last for one in fates(found) if one.phase == "g" and one.person == PERSONS[2]), 0)
    owner = next((person for person, own in found.own.items() if own == last), None) if last else None
    if not last:
        return "no id"
    return f"{owner}'s id {last}: mislabelled" if owner else f"an id of his own, {last}"


def variation_table(others: Mapping[float, Found]) -> Table:
    """A row per film in which the two, merged, walk nearer together or farther apart."""
    rows = []
    for together, found in others.items():
        verdicts = {(one.phase, one.person): one.verdict for one in fates(found)}
        held = [verdicts.get((phase, person), "-") for phase in "dg" for person in PERSONS[:2]]
        rows.append([f"{2 * together:.0f}", *held, third_at_last(found)])
    split = [f"{person} back in {phase}" for phase in "dg" for person in PERSONS[:2]]
    return Table(
        "Fig. 3, the same with the two merged more or less",
        ["pixels between them", *split, "the third has in the end"],
        rows,
    )


def event_table(found: Found) -> Table:
    """A row per event."""
    rows = [
        [
            one.kind,
            str(one.begin) if one.begin == one.end else f"{one.begin}-{one.end}",
            phase_of(found, one.end),
            " ".join(map(str, one.ids)) or "-",
            one.why or "-",
        ]
        for one in found.events
    ]
    return Table("Fig. 3: the events, with settled ids", ["event", "frames", "phase", "ids", "why"], rows)


def phase_of(found: Found, frame: int) -> str:
    return next((one.phase.name for one in found.phases if frame in one.frames), PHASES[-1].name)


def figure_json(found: Found) -> dict[str, Any]:
    """Return everything of the figure as plain values."""
    return {
        "phases": [
            {
                "phase": one.phase.name,
                "what": one.phase.what,
                "frames": [one.frames.start, one.frames.stop - 1],
                "regions": one.regions,
                "merged": one.merged,
                "seen": dict(one.seen),
                "ids": {person: dict(ids) for person, ids in one.ids.items()},
                "said": dict(one.said),
                "groups": dict(one.groups),
                "grouped": one.grouped,
                "strays": dict(one.strays),
            }
            for one in found.phases
        ],
        "fates": [one.as_json() for one in fates(found)],
        "third": {"alone": found.alone, "words": third_in_words(found)},
        "events": [dataclasses.asdict(one) for one in found.events],
        "corrections": found.corrections,
    }


def draw(folder: Path, film: Film, found: Found) -> None:
    """Write a picture of the last third of each phase."""
    folder.mkdir(parents=True, exist_ok=True)
    wanted = {one.frames[2 * len(one.frames) // 3]: one.phase.name for one in found.phases}
    trails = Trails.empty()
    for frame in film.frames:
        rows = found.tracks.in_frame(frame.index)
        trails = trails.extended(rows, frame.time, keep=60.0)
        if frame.index in wanted:
            picture = paint(frame, rows, trails, film.scene)
            path = folder / f"{wanted[frame.index]}-{frame.index:04d}.png"
            cv2.imwrite(str(path), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))


# Cost -------------------------------------------------------------------------------------------------------

WARM_UP = 50  # frames


@dataclass(frozen=True)
class Cost:
    """Milliseconds a frame of every part of the chain; `tracks` are rows said a frame."""

    film: str
    frames: int
    regions: float  # a frame
    tracks: float  # a frame
    decode: float
    first_look: float
    detection: float
    tracking: float

    @property
    def whole(self) -> float:
        return self.decode + self.first_look + self.detection + self.tracking

    @property
    def share(self) -> float:
        return self.tracking / self.whole


class Stopwatch:
    """Seconds spent by name."""

    def __init__(self) -> None:
        self.spent: Counter[str] = Counter()

    def __call__(self, name: str, work: Callable[..., Any], *given: Any) -> Any:
        begun = time.perf_counter()
        result = work(*given)
        self.spent[name] += time.perf_counter() - begun
        return result


def cost_of_film(film: Film) -> Cost:
    """Time the chain on a film that is held in memory."""
    spread = np.linspace(0, len(film.frames) - 1, FIRST_LOOKS).astype(int)
    name = f"drawn film, {film.scene.width}x{film.scene.height}"
    run_chain(name, film.scene, film.frames[:WARM_UP], lambda: [film.frames[i] for i in spread])
    return run_chain(name, film.scene, film.frames, lambda: [film.frames[i] for i in spread])


def cost_of_video(path: Path) -> list[Cost]:
    """Time the chain on a video; nothing if it is not there."""
    if not path.is_file():
        print(f"note: {path} is not there; it is left out", file=sys.stderr)
        return []
    for end in (f"{WARM_UP}f", None):
        source = open_source(str(path), end=end)
        try:
            name = f"{path.parent.name}, {source.width}x{source.height}"
            cost = run_chain(name, source.scene(None), source, lambda source=source: source.sample(FIRST_LOOKS))
        finally:
            source.close()
    return [cost]


def run_chain(name: str, scene: Scene, frames: Iterable[Frame], sample: Callable[[], Iterable[Frame]]) -> Cost:
    """Run detector and tracker as `perdure track` does, frame by frame, each part timed."""
    watch = Stopwatch()
    detector = watch("first look", lambda: Background().prepare(sample()))
    tracker, count, regions_seen, rows = TRACKERS[TRACKER](), 0, 0, 0
    state, beliefs = detector.start(scene), tracker.start(scene)
    given = iter(frames)
    while (frame := watch("decode", next, given, None)) is not None:
        state, regions = watch("detection", detector.step, state, frame)
        beliefs, report = watch("tracking", tracker.step, beliefs, frame, regions)
        state = watch("detection", detector.heed, state, report)
        count, regions_seen, rows = count + 1, regions_seen + len(regions), rows + len(report.rows)
    watch("tracking", tracker.finish, beliefs)
    a_frame = {part: 1e3 * seconds / count for part, seconds in watch.spent.items()}
    return Cost(
        name,
        count,
        regions_seen / count,
        rows / count,
        a_frame["decode"],
        a_frame["first look"],
        a_frame["detection"],
        a_frame["tracking"],
    )


def cost_table(costs: Sequence[Cost]) -> Table:
    """A row per film, the paper's first."""
    rows = [
        [
            "the paper's, 512x512, SparcStation 10",
            *["-"] * 6,
            f"{PAPER_TRACKING:.0f}",
            f"{PAPER_WHOLE:.0f}",
            f"{PAPER_TRACKING / PAPER_WHOLE:.1%}",
        ]
    ]
    rows += [
        [
            one.film,
            str(one.frames),
            f"{one.regions:.1f}",
            f"{one.tracks:.1f}",
            *(f"{value:.2f}" for value in (one.decode, one.first_look, one.detection, one.tracking, one.whole)),
            f"{one.share:.1%}",
        ]
        for one in costs
    ]
    head = ["film", "frames", "regions", "rows", "decode", "first look", "detection", "tracking", "whole", "share"]
    return Table("cost: milliseconds a frame, and the tracker's share of the whole", head, rows)


# A step against a library's ---------------------------------------------------------------------------------

COUNTS = (10, 50, 200)
CROWD_FRAMES, CROWD_FPS = 150, 25.0
PEER, SETTINGS = "trackers/bytetrack", "defaults"


class Pair(NamedTuple):
    """Milliseconds a frame of both on the same boxes, and how many ids each said of how many walkers."""

    walkers: int
    frames: int
    boxes: int
    ours: float
    peer: float
    our_ids: int
    peer_ids: int

    @property
    def ratio(self) -> float:
        return self.ours / self.peer


def crowd(count: int, frames: int = CROWD_FRAMES, seed: int = 5) -> peers.Seen:
    """Return walkers on a large picture: every one in each frame but for one in twenty, boxes with jitter."""
    width, height = 3840, 2160
    rng = np.random.default_rng((seed, count))
    tall = rng.uniform(70, 130, count)
    half = np.column_stack([0.19 * tall, 0.5 * tall])  # (N, 2)
    room = np.array([width, height]) - 2 * half  # (N, 2): where the centres may be
    begin = rng.uniform(0, 1, (count, 2)) * room
    angle, speed = rng.uniform(0, math.tau, count), rng.uniform(0.3, 0.9, count) * tall / CROWD_FPS
    step = np.column_stack([np.cos(angle), 0.4 * np.sin(angle)]) * speed[:, None]
    regions, rows = [], []
    for number in range(frames):
        way = np.mod(begin + number * step, 2 * room)
        centre = half + np.where(way > room, 2 * room - way, way)  # they turn at the border
        true = np.column_stack([centre - half, centre + half])
        jittered = true + rng.normal(0.0, 0.015, true.shape) * tall[:, None]
        kept = rng.random(count) >= 0.05
        order = rng.permutation(np.flatnonzero(kept))
        regions.append(Regions.of(jittered[order], scores=rng.uniform(0.75, 0.99, len(order))))
        rows.append(true)
    truth = Rows.of(
        frames=np.repeat(np.arange(frames), count),
        ids=np.tile(np.arange(1, count + 1), frames),
        boxes=np.concatenate(rows),
    )
    given = tuple(Frame(number, number / CROWD_FPS) for number in range(frames))
    return peers.Seen(Scene(width, height, CROWD_FPS), given, tuple(regions), truth)


def race(seen: Mapping[str, peers.Seen], python: Path, rounds: int) -> list[Pair]:
    """Let both take turns on the same boxes; the best of all rounds counts."""
    ours = peers.Runner(f"perdure/{TRACKER}", "defaults", "", None)
    peer = next(one for one in peers.runners() if (one.tracker, one.settings) == (PEER, SETTINGS))
    here, there = [], []
    for number in range(1, max(rounds, 1) + 1):
        print(f"round {number}/{max(rounds, 1)}", file=sys.stderr, flush=True)
        here.append(peers.follow_here(ours, seen))
        there.append(peers.follow_there(peer, seen, python))
    return [
        paired_times(
            sequence, best(PEER, [one[name] for one in there]), best(TRACKER, [one[name] for one in here])
        )
        for name, sequence in seen.items()
    ]


def best(name: str, outcomes: Sequence[peers.Outcome]) -> peers.Outcome:
    """Return the fastest of some outcomes; PeersError where one of them failed."""
    for one in outcomes:
        if one.rows is None:
            raise peers.PeersError(f"{name}: {one.fault}")
    return min(outcomes, key=lambda one: one.seconds)


def paired_times(given: peers.Seen, peer: peers.Outcome, ours: peers.Outcome) -> Pair:
    frames = len(given.frames)
    return Pair(
        len(np.unique(given.truth.ids)),
        frames,
        sum(map(len, given.regions)),
        1e3 * ours.seconds / frames,
        1e3 * peer.seconds / frames,
        len(np.unique(ours.rows.ids)),
        len(np.unique(peer.rows.ids)),
    )


def step_table(pairs: Sequence[Pair]) -> Table:
    """A row per crowd."""
    rows = [
        [
            str(one.walkers),
            str(one.frames),
            str(one.boxes),
            f"{one.ours:.3f}",
            f"{one.peer:.3f}",
            f"{one.ratio:.2f}",
            str(one.our_ids),
            str(one.peer_ids),
        ]
        for one in pairs
    ]
    head = ["walkers", "frames", "boxes", f"{TRACKER}, ms", f"{PEER}, ms", "ratio", "our ids", "its ids"]
    return Table("step: milliseconds a frame of the tracker's calls alone, on the same boxes", head, rows)


# The page ---------------------------------------------------------------------------------------------------


def section(command: str, result: Result) -> str:
    """Return what stands between the marks in docs/benchmarks.md."""
    versions = ", ".join(f"{name} {version}" for name, version in result.told["versions"].items())
    return "\n\n".join([f"`{command}`", *(markdown(one) for one in result.tables), f"Versions: {versions}."])


def replaced(page: str, inside: str) -> str:
    """Return a page with the section between our marks replaced, or put at the end with its heading."""
    if (BEGIN in page) != (END in page):
        raise peers.PeersError(f"{PAGE.name} has one of the lines {BEGIN} and {END} without the other")
    if BEGIN not in page:
        page = f"{page.rstrip()}\n\n{HEADING}\n\n{BEGIN}{END}\n"
    before, _, rest = page.partition(BEGIN)
    return f"{before}{BEGIN}\n{inside}\n{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    main()
