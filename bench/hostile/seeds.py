"""Files drawn by our own writers, and a few by hand as other programs write them, to begin from."""

from __future__ import annotations

import functools
import io
import json
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from perdure import states
from perdure.files.checkpoints import Progress
from perdure.files.contexts import LIBRARY
from perdure.files.corrections import Correction, append_correction
from perdure.files.formats import FORMATS, Content
from perdure.files.log import RunLog
from perdure.files.regions import write_regions
from perdure.files.runs import RunFolder
from perdure.files.zones import write_zones
from perdure.scene.zones import Rule, Zone, Zones, rectangle
from perdure.trackers.overlap import Overlap, OverlapState
from perdure.types import (
    Dropped,
    Event,
    Explanation,
    Frame,
    Ground,
    Mask,
    Outline,
    Regions,
    Renamed,
    Report,
    Scene,
    Status,
    Tracks,
)

HEIGHT, WIDTH = 12, 16
Seeds = tuple[bytes, ...]


def drawn(picture: str, y: int = 0, x: int = 0) -> Mask:
    """A silhouette as it is drawn."""
    return Mask(y, x, np.array([[mark == "#" for mark in row] for row in picture.split()]))


@functools.cache
def rows() -> Tracks:
    """Two people over four frames, with all that rows may say."""
    ring, disc = drawn("#### #..# ####", 2, 3), drawn(".#. ### .#.", 6, 9)
    return Tracks.of(
        frames=[0, 0, 1, 1, 3],
        times=[0.0, 0.0, 0.04, 0.04, 0.12],
        ids=[1, 2, 1, 2, 1],
        boxes=[[3, 2, 7, 5], [9, 6, 12, 9], [3.5, 2.25, 8, 6], [9, 6, 12, 9], [4, 2, 8, 5]],
        status=[0, 0, Status.PARTLY_OCCLUDED, Status.AMBIGUOUS, Status.OCCLUDED],
        confidence=[1, 0.5, 0.75, 0.5, 0.625],
        classes=["car", "pedestrian", "car", "pedestrian", "car"],
        groups=[0, 0, 0, 7, 0],
        inferred=[False, False, False, False, True],
        masks=[ring, disc, ring, disc, Mask.empty()],
        believed=[None, None, drawn("##### ##### #####", 2, 3), None, None],
        outlines=[Outline.of([[[3, 2], [7.25, 2], [7.25, 5.5], [3, 5]]]), None, None, None, None],
        hidden_side=["", "", "bottom+left", "", ""],
        ground=[Ground(1.5, 2.25, 0.5), Ground(-3.0, 4.0), None, None, None],
        links=[(0,), (1,), (0, 2), (), ()],
    )


def written(write: Callable[[Path], object], name: str = "file") -> bytes:
    """The bytes that a writer writes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        write(path)
        return path.read_bytes()


def of_format(name: str) -> bytes:
    """The rows in a format."""
    one = FORMATS[name]
    content = Content(rows(), (HEIGHT, WIDTH), (0, 1, 2, 3), timed=True, name="yard")
    assert one.write is not None
    write = one.write
    return written(lambda path: write(path, content, overwrite=False), f"file{one.suffixes[0]}")


def parquet() -> bytes:
    """Two rows in Parquet, not packed."""
    import pyarrow.parquet as pq

    table = rows().take([0, 2]).to_arrow()
    file = io.BytesIO()
    pq.write_table(table, file, compression="none", use_dictionary=False, write_statistics=False)
    return file.getvalue()


def lines_of_log() -> bytes:
    """A log of all that reports hold."""
    here, reason = rows(), Explanation(1, "joined", {"score": 0.5, "rival": 0.25})
    event = Event("merge", 0, 1, (1, 2), "yard", 0.5, "they meet")
    reports = [
        Report(here.take([0, 1]), events=(event,), begun=(event,), explanations=(reason,)),
        Report(here.take([2, 3]), renamed=(Renamed(2, 1, 0, 1),)),
        Report(here.take([4, 0]), dropped=(Dropped(1, 0, 0),)),
    ]

    def write(path: Path) -> None:
        with RunLog(path) as log:
            for frame, report in enumerate(reports):
                log.append(frame, frame / 25, report)
            log.append(-1, 0.12, Report.empty())

    return written(write)


def regions(name: str) -> bytes:
    """Two frames of regions, in either kind of file."""
    here = rows().take([0, 1])
    seen = Regions.of(here.boxes, [0.5, 0.75], ["car", ""], [here.masks[0], Mask.empty()])
    events = Regions(
        seen.boxes, seen.scores, seen.classes, seen.masks, {}, (Event("light", 1, 1, why="dark"),), True
    )
    frames = [(Frame(0, 0.0), seen), (Frame(1, 0.04), events)]
    return written(lambda path: write_regions(path, frames), name)


def corrections() -> bytes:
    """Every action by hand, one undone."""
    made: tuple[Correction | str, ...] = (
        Correction("swap", (1, 2), 1),
        Correction("join", (2, 1), 0, 3),
        Correction("cut", (1, 7), 3),
        Correction("delete", (2,), 0),
        Correction("confirm", (1, 2), 0, event=(0, 0)),
        "undo",
        "redo",
    )
    return written(lambda path: [append_correction(path, one) for one in made])


def zones() -> bytes:
    """Two zones and a rule."""
    door, yard = Zone("entry", "door", rectangle(0, 2, 3, 9)), Zone("ground", "yard", rectangle(4, 0, 16, 12))
    return written(lambda path: write_zones(path, Zones((door, yard), (Rule("door", "yard", 1.0, 20.0, False),))))


def contexts() -> Seeds:
    """A context that comes along, with one feature's training."""
    value = json.loads((LIBRARY / "campus.json").read_text(encoding="utf-8"))
    value["training"]["alone"] = {"area": value["training"]["alone"]["area"]}
    return (json.dumps(value).encode(),)


def about() -> bytes:
    """What a run says of itself."""
    told = {"source": "yard.mp4", "width": WIDTH, "height": HEIGHT, "fps": 25.0, "status": "done", "frames": 4}
    told |= {"reporting": {"report_confidence": 0.5}, "window": {"start": None, "end": "2"}}
    told |= {"scenarios": {"scenarios": [{"name": "merge"}]}}
    return written(lambda path: RunFolder(path.parent).write_about(told), "run.json")


# Pictures -------------------------------------------------------------------------------------------------------


def chunk(kind: bytes, body: bytes) -> bytes:
    """A part of a PNG."""
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png(header: bytes, lines: bytes) -> bytes:
    """A PNG of a header and its lines."""
    parts = chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(lines, 1)), chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def picture_lines(bits: int = 8, colours: int = 0) -> bytes:
    """Header and lines of an index picture with the ids 1 and 2, for `png`."""
    picture = np.zeros((HEIGHT, WIDTH), np.uint16)
    picture[2:5, 3:7], picture[6:9, 9:12] = 1, 2
    values = picture.astype(">u2") if bits == 16 else picture.astype(np.uint8)
    lines = b"".join(b"\0" + values[row].tobytes() for row in range(HEIGHT))
    return struct.pack(">IIBBBBB", WIDTH, HEIGHT, bits, colours, 0, 0, 0) + lines


def resealed(data: bytes) -> bytes:
    """A PNG whose parts have the right checksums again."""
    kept, at = data[:8], 8
    while at + 8 <= len(data):
        length = int.from_bytes(data[at : at + 4])
        kept += chunk(data[at + 4 : at + 8], data[at + 8 : at + 8 + length])
        at += 12 + length
    return kept


# States ---------------------------------------------------------------------------------------------------------


@functools.cache
def state() -> OverlapState:
    """Where a tracker stands behind two frames."""
    tracker, scene = Overlap(confirm=0.0), Scene(WIDTH, HEIGHT, 25.0)
    now = tracker.start(scene)
    for index in range(2):
        now, _ = tracker.step(now, Frame(index, index / 25), Regions.of([[3, 2, 7, 5], [9, 6, 12, 9]]))
    return now


def entries(data: bytes) -> bytes:
    """The entries of a saved state, one behind the other, as `sealed` takes them."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return _BETWEEN.join(archive.read(name) for name in archive.namelist())


def sealed(data: bytes) -> bytes:
    """An archive of the entries, with the right checksums."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        for number, body in enumerate(data.split(_BETWEEN)):
            archive.writestr(f"{number - 1}.npy" if number else "state.json", body)
    return out.getvalue()


def saved_states() -> Seeds:
    """Where a tracker stands, and how far a run is."""
    return states.save(state()), states.save(Progress(frames=4, lasting=(("waits", (1, 2), "yard"),)))


_BETWEEN = b"\0<next>\0"
