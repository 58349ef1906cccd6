"""Reading a file as the program does, and looking at what came of it; one function a reader."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from hostile import seeds
from hostile.sanity import (
    check_boxes,
    check_content,
    check_events,
    check_masks,
    check_regions,
    check_report,
    check_rows,
    check_tracks,
    want,
)
from perdure import params, states
from perdure.cli.options import read_parameters
from perdure.errors import FormatError, PerdureError
from perdure.files import (
    calibration,
    contexts,
    corrections,
    counting,
    mask_pngs,
    mot_table,
    mots,
    roi,
    scenarios,
    zones,
)
from perdure.files.checkpoints import Progress
from perdure.files.clip import read_blobs, read_clip
from perdure.files.formats import FORMATS, READ, Reading, recognised
from perdure.files.formats import read as read_format
from perdure.files.images import read_pixels, read_seqinfo
from perdure.files.lines import to_line
from perdure.files.log import read_log
from perdure.files.marks import read_marks
from perdure.files.mot import PROTOCOLS, read_detections, read_said, read_tracks, read_truth
from perdure.files.networks import read_class_names
from perdure.files.regions import read_regions
from perdure.files.reports import check_report as check_plain
from perdure.files.reports import report_of_json, report_to_json
from perdure.files.runs import Reporting, RunFolder
from perdure.files.scored import read_result, read_scored_truth
from perdure.files.settings import read_settings
from perdure.files.shapes import is_polygon, read_ring, read_shape
from perdure.files.span import read_span
from perdure.trackers.overlap import Overlap, OverlapState
from perdure.types import Scene, Tracks
from perdure.web.ledger import Ledger

HEIGHT, WIDTH = seeds.HEIGHT, seeds.WIDTH
Look = Callable[[Path, bytes], None]


def at(place: Path, name: str, data: bytes) -> Path:
    """Put down a file."""
    path = place / name
    path.write_bytes(data)
    return path


def format_named(name: str) -> Look:
    """Read a file as one of a format, and as what it is recognised to be."""
    one = FORMATS[name]

    def look(place: Path, data: bytes) -> None:
        path = at(place, f"given{one.suffixes[0]}", data)
        try:
            known = recognised(path)
        except FormatError:
            known = one
        check_content(read_format(path, one), one, place)
        if known is not one and known.name in READ:
            check_content(read_format(path, known), known, place)

    return look


def mot(place: Path, data: bytes) -> None:
    """MOTChallenge text: as rows, truth, result and detections, which must agree; quickly and carefully."""
    path = at(place, "given.txt", data)
    table = mot_table.read_table(path)
    lines = mot_table.read_lines(path)
    filled = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    slow = mot_table._carefully(path, filled)
    want(slow.shape == table.values.shape and (slow == table.values).all(), "quickly it says other than carefully")
    detections = read_detections(path)
    want(sum(map(len, detections.values())) == len(table.values), "detections are lost")
    for frame, seen in detections.items():
        want(0 <= frame <= 10**9, "a frame that cannot be")
        check_regions(seen)
    said = read_said(path)
    check_rows(said)
    check_boxes(read_tracks(path).boxes)
    for protocol in ("auto", *PROTOCOLS[: 1 if table.values.shape[1] < 8 else 3]):
        want(len(read_truth(path, protocol)) == len(said), "the truth has other rows than the result")
    check_rows(read_result(path, masks=True).boxes)
    format_named("mot")(place, data)


def mots_text(place: Path, data: bytes) -> None:
    """MOTS text, as silhouettes and as a format."""
    path = at(place, "given.txt", data)
    rows = mots.read_masks(path)
    check_rows(rows)
    for truth in (read_scored_truth(path, masks=True).masks,):
        want(truth is None or len(truth) == len(rows), "the truth has other rows than the result")
    for mask in rows.masks:
        if rows.size is not None and mask.area and sum(rows.size) < 2000:
            packed = mots.packed_runs(mots.picture_runs(mask, *rows.size), *rows.size)
            again = mots.of_picture_runs(mots.unpacked_runs(packed), *rows.size)
            want(again == mask, "packed run lengths are others")
    format_named("mots")(place, data)


def run_log(place: Path, data: bytes) -> None:
    """The log of a run: report by report, settled, and as the viewer reads it on."""
    path = at(place, "tracks.jsonl", data)
    ledger = Ledger(path)
    ledger.refresh()
    entries = list(read_log(path))
    for frame, time, report in entries:
        want(-1 <= frame <= 2**62 and math.isfinite(time), "a report of no frame, or of no time")
        check_report(report)
        line = json.loads(to_line(report_to_json(frame, time, report)))
        want(check_plain(line) == (frame, time), "written again it is of another frame")
        want(report_of_json(line).equals(report), "written again it says something else")
    want(not ledger.damage, f"the viewer refuses what the log reads ({ledger.damage})")
    want(len(ledger.offsets) == len(entries), "the viewer sees other reports")
    narrow = [one.report.rows.ids.tolist() for one in read_log(path, with_masks=False)]
    want(narrow == [one.report.rows.ids.tolist() for one in entries], "without silhouettes it says something else")
    folder = RunFolder(place)
    tracks, events, _ = folder.read()
    check_tracks(tracks)
    check_events(events)
    want(
        Tracks.join(rows for _, rows in folder.settled_by_frame()).equals(tracks),
        "settled by frames it is another",
    )
    folder.write_results(Reporting())
    check_content(FORMATS["run"].read(place, Reading()), FORMATS["run"], place)  # type: ignore[misc]


def run_about(place: Path, data: bytes) -> None:
    """`run.json` of a run whose log is good."""
    at(place, "tracks.jsonl", seeds.lines_of_log())
    at(place, "run.json", data)
    folder = RunFolder.open(place)
    check_events(folder.scenario_events())
    content = FORMATS["run"].read(place, Reading())  # type: ignore[misc]
    check_content(content, FORMATS["run"], place)
    check_rows(read_result(place, masks=True).boxes)


def by_hand(place: Path, data: bytes) -> None:
    """Corrections of a run whose log is good."""
    at(place, "tracks.jsonl", seeds.lines_of_log())
    path = at(place, corrections.NAME, data)
    history = corrections.read_corrections(path)
    for one in (*history.in_force, *history.undone):
        want(corrections.correction_of_json(json.loads(to_line(one.to_json()))) == one, "written, it is another")
        check_report(one.report())
    fresh = corrections.newest_id([1, 2], history)
    want(type(fresh) is int and fresh > 2, "no new id")
    tracks, events, _ = RunFolder(place).read()
    check_tracks(tracks)
    check_events(events)


def recorded(name: str) -> Look:
    """A file of regions."""

    def look(place: Path, data: bytes) -> None:
        path = at(place, name, data)
        seen = read_regions(path)
        for frame in list(seen):
            want(type(frame) is int and frame >= 0, "a frame that cannot be")
            check_regions(seen[frame])

    return look


def zone_file(place: Path, data: bytes) -> None:
    """Zones, in a picture and without one; written they are the same, and boxes can be asked of them."""
    path = at(place, "zones.json", data)
    found = zones.read_zones(path)
    again = zones.zones_of_json(json.loads(json.dumps(zones.zones_to_json(found), allow_nan=False)))
    want(again == found, "written, they are others")
    zones.write_zones(place / "again.json", found)
    want(zones.read_zones(place / "again.json") == found, "written in lines, they are others")
    inside = zones.read_zones(path, WIDTH, HEIGHT)
    boxes = np.array([[0, 2, 3, 5], [9, 6, 12, 9]], np.float32)
    shares = inside.shares(boxes)
    want(np.isfinite(shares).all() and (shares >= 0).all() and (shares <= 1 + 1e-6).all(), "shares beyond all")
    for told in (inside.evidence(boxes), inside.reach(boxes), inside.stays(boxes)):
        want(not np.isnan(told).any(), "a figure that is none")


def context_file(place: Path, data: bytes) -> None:
    """A learnt context; written it is the same, and similarities are weighed by it."""
    found = contexts.read_context(at(place, "context.json", data))
    again = contexts.context_of_json(contexts.context_to_json(found))
    value = contexts.context_to_json(again)
    want(value == contexts.context_to_json(found), "written, it is another")
    contexts.write_context(place / "again.json", found)
    for name in found.used:
        levelled = found.levelled(name, np.array([0.0, 0.5, 1.0]))
        want(np.isfinite(levelled).all(), "a similarity that is none")


def ground_plane(place: Path, data: bytes) -> None:
    """A calibration; boxes stand somewhere by it, or nowhere."""
    ground = calibration.read_calibration(at(place, "calibration.json", data), 1280, 720)
    boxes = np.array([[100, 300, 140, 420], [600, 500, 680, 700]], np.float32)
    feet = np.array([[120, 420], [640, 700]], float)
    places = ground.places(feet)
    want(not np.isinf(places).any(), "a place infinitely far")
    for told in (ground.spread(feet), ground.jitter(feet), ground.heights(boxes), ground.horizon):
        want(np.asarray(told).dtype.kind == "f", "no numbers")
    json.dumps(ground.about(), allow_nan=False)


def rules(place: Path, data: bytes) -> None:
    """Scenarios; what `run.json` tells of them is JSON."""
    path = at(place, "scenarios.toml", data)
    found = scenarios.read_rules(path)
    json.dumps(scenarios.rules_to_json(found), allow_nan=False)
    want(len({one.name for one in found.scenarios}) == len(found.scenarios), "two scenarios have one name")


def tracker_state(packed: Callable[[bytes], bytes] = bytes) -> Look:
    """A saved state; what is loaded saves to the same again, and a tracker goes on from it or says why not."""

    def look(_: Path, data: bytes) -> None:
        kind = Progress if b"lasting" in data else OverlapState
        loaded = states.load(packed(data), kind)
        once = states.save(loaded)
        want(states.save(states.load(once, kind)) == once, "saved and loaded it is another")
        if isinstance(loaded, OverlapState):
            _go_on(loaded)

    return look


def _go_on(state: OverlapState) -> None:
    """Have a tracker go on: the kinds of its arrays are those that it declares."""
    good = seeds.state()
    for name, value in vars(good).items():
        if isinstance(value, np.ndarray):
            other = getattr(state, name)
            same = other.dtype == value.dtype and other.ndim == value.ndim
            want(same, f"{name} is an array of another kind ({other.dtype}, {other.ndim} dimensions)")


def pictures(packed: Callable[[bytes], bytes] = bytes) -> Look:
    """An index picture: alone, in a folder, as marks and as a region of interest, and as a frame."""

    def look(place: Path, data: bytes) -> None:
        folder = place / "masks"
        folder.mkdir()
        at(folder, "00000.png", seeds.png(seeds.picture_lines()[:13], seeds.picture_lines()[13:]))
        path = at(folder, "00001.png", packed(data))
        refused: list[PerdureError] = []
        picture = _tried(lambda: mask_pngs.read_indices(path), refused)
        if picture is not None:
            want(picture.ndim == 2 and picture.dtype in (np.uint8, np.uint16), "no index picture")
            for identity, mask in mask_pngs.silhouettes(picture):
                want(1 <= identity <= mask_pngs.LARGEST_ID and mask.area > 0, "no silhouette")
            check_rows(mask_pngs.read_masks(folder))
            check_content(FORMATS["mask-png"].read(folder, Reading()), FORMATS["mask-png"], place)  # type: ignore[misc]
        frame = _tried(lambda: read_pixels(path), refused)
        want(frame is None or (frame.ndim == 3 and frame.shape[2] == 3), "no picture")
        for read in (lambda: roi.read_roi(path, WIDTH, HEIGHT), lambda: read_marks(str(path), _scene(), range(9))):
            _tried(read, refused)
        if refused:
            raise refused[0]

    return look


def _tried(read: Callable[[], object], refused: list[PerdureError]) -> object:
    """What is read; None where it is refused."""
    try:
        return read()
    except PerdureError as error:
        refused.append(error)
        return None


def _scene() -> Scene:
    return Scene(WIDTH, HEIGHT, 25.0)


def region_of_interest(place: Path, data: bytes) -> None:
    """A file of polygons or a picture."""
    inside = roi.read_roi(at(place, "roi.json", data), WIDTH, HEIGHT)
    want(inside.shape == (HEIGHT, WIDTH) and inside.dtype == np.bool_ and inside.any(), "no region")


def typed(place: Path, data: bytes) -> None:
    """What a user types: marks, regions, lines and zones to count at, moments."""
    text = data.decode("utf-8", "replace").replace("\0", " ")
    refused: list[PerdureError] = []

    def marks() -> None:
        for mark in read_marks(text, _scene(), range(9)):
            want(mark.id >= 1 and 0 <= mark.frame < 9 and mark.area.area > 0, "a mark of nothing")
            check_masks([mark.area], (HEIGHT, WIDTH))

    def lines() -> None:
        for line in counting.lines_of([text], (HEIGHT, WIDTH)):
            want(all(0 <= x <= WIDTH and 0 <= y <= HEIGHT for x, y in line.points), "a line outside")

    def shapes() -> None:
        for ring in [read_ring(text)] if read_shape(text, WIDTH, HEIGHT) is not None and is_polygon(text) else []:
            want(all(abs(x) <= 1e6 and abs(y) <= 1e6 for x, y in ring), "a point beyond all")

    def span() -> None:
        found = read_span(text, None, 1)
        want(found.start is not None and 0 <= found.start.number(25.0) <= 10**11, "a moment beyond all")

    for read in (marks, lines, span, lambda: roi.read_roi(text, WIDTH, HEIGHT)):
        _tried(read, refused)
    _tried(lambda: counting.zones_of([text], None, None, (HEIGHT, WIDTH)), refused)
    if len(refused) == 5:
        raise refused[0]
    shapes()


def clip(place: Path, data: bytes) -> None:
    """`clip.json` of a composed clip."""
    events, size = read_clip(at(place, "clip.json", data))
    check_events(events)
    want(size is None or all(type(side) is int and 1 <= side <= 2**16 for side in size), "a picture of no size")


def blobs(place: Path, data: bytes) -> None:
    """`blobs.txt` of a composed clip."""
    for frame, several in read_blobs(at(place, "blobs.txt", data)).items():
        want(0 <= frame <= 2**31, "a frame that cannot be")
        want(all(1 <= one <= 2**53 for blob in several for one in blob), "an id that cannot be")


def settings(place: Path, data: bytes) -> None:
    """A JSON object of settings or parameters, as the trackers take them."""
    path = at(place, "settings.json", data)
    found = read_settings(path, "--settings")
    want(isinstance(found, Mapping), "no object")
    given = read_parameters(path, {})
    built = params.build(Overlap, given)
    for name, value in params.values(built).items():
        want(not isinstance(value, float) or math.isfinite(value), f"{name} = {value}")


def sequence(place: Path, data: bytes) -> None:
    """`seqinfo.ini` of a MOTChallenge folder."""
    told = read_seqinfo(at(place, "seqinfo.ini", data))
    want(0.001 <= told.rate <= 1000 and 0 <= told.length <= 10**8, "a film that cannot be")
    want(1 <= told.width <= 16384 and 1 <= told.height <= 16384, "a picture of no size")
    want("/" not in told.images.strip("/") or ".." not in told.images, "images elsewhere")
    (place / "gt").mkdir()
    at(place / "gt", "gt.txt", b"1,1,2,3,4,5,1,-1,-1,-1\n")
    check_content(FORMATS["mot"].read(place, Reading()), FORMATS["mot"], place)  # type: ignore[misc]


def class_names(place: Path, data: bytes) -> None:
    """Names of classes."""
    names = read_class_names(at(place, "names.txt", data))
    want(bool(names) and all(isinstance(one, str) and one for one in names), "no names")
