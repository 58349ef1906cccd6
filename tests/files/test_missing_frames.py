"""What is missing of a film that can be decoded all the same: at its end, within it, and before its first picture."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import av
import damage
import numpy as np
import pytest

from perdure.files.cut_short import cut_short
from perdure.files.tally import Promise, Tally
from perdure.files.video import open_source

CONTAINERS = ("mp4-first", "avi-raw", "webm-vp8", "ts-h264", "flv-h264", "y4m")


@pytest.fixture(scope="module", name="films")
def whole_films(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("films")
    return {kind: damage.KINDS[kind](folder / kind) for kind in CONTAINERS}


def written(place: Path, content: bytes) -> Path:
    place.write_bytes(content)
    return place


@pytest.mark.parametrize("kind", CONTAINERS)
def test_a_whole_file_is_not_said_to_be_cut_and_one_that_lacks_its_end_is(
    films: dict[str, Path], tmp_path: Path, kind: str
):
    whole = films[kind]
    assert cut_short(whole) == ""
    content = whole.read_bytes()
    for share in (0.3, 0.6, 0.99):
        cut = written(tmp_path / whole.name, content[: int(share * len(content)) // 94 * 94 - 1])
        assert cut_short(cut) in (
            f"it ends {len(content) - cut.stat().st_size} bytes before its header says",
            "it ends within a packet",
        )
        assert cut_short(cut)


@pytest.mark.parametrize(
    "content",
    [b"", b"\x1aE\xdf\xa3", b"RIFF\0\0\0\0AVI LIST", b"YUV4MPEG2 W0\nFRAME\n", b"G", b"\0\0\0\1mdat"],
)
def test_of_a_file_that_says_no_size_nothing_is_said(tmp_path: Path, content: bytes):
    assert cut_short(written(tmp_path / "film", content)) == ""


def test_a_film_whose_end_is_cut_within_a_frame_says_so_though_no_header_counts_its_frames(
    films: dict[str, Path], tmp_path: Path
):
    source = open_source(written(tmp_path / "cut.y4m", films["y4m"].read_bytes()[:-15_000]))
    assert len(list(source)) == damage.FRAMES - 2
    assert list(source.warnings) == ["it ends within a packet: frames may be missing behind frame 37"]
    assert len(list(source)) == damage.FRAMES - 2
    assert len(source.warnings) == 1  # however often it is read


def without(place: Path, lost: Callable[[int], bool], film: Path) -> Path:
    """A film of key frames without some of its packets."""
    with av.open(str(film)) as container, av.open(str(place), "w") as out:
        stream = out.add_stream_from_template(container.streams.video[0])
        for number, packet in enumerate(container.demux(video=0)):
            if packet.dts is not None and not lost(number):
                packet.stream = stream
                out.mux(packet)
    return place


def test_frames_that_are_lost_within_a_film_are_told(tmp_path: Path):
    film = damage.coded("mjpeg", ".mkv")(tmp_path / "film")
    assert not open_source(film).warnings
    torn = without(tmp_path / "torn.mkv", lambda number: number in (7, 20, 21), film)
    source = open_source(torn)
    assert len(list(source)) == damage.FRAMES - 3
    assert list(source.warnings) == ["3 frames are missing within it, by its timestamps: the first behind frame 6"]


def test_a_film_that_begins_within_a_group_of_pictures_says_what_cannot_be_decoded(
    films: dict[str, Path], tmp_path: Path
):
    torn = without(tmp_path / "torn.ts", lambda number: number == 0, films["ts-h264"])
    source = open_source(torn)
    frames = list(source)
    assert len(frames) == 30
    assert "those before it are missing, or cannot be decoded" in source.warnings[0]


def test_a_matroska_film_whose_first_packets_are_lost_says_when_it_begins(tmp_path: Path):
    film = damage.coded("mjpeg", ".mkv")(tmp_path / "film")
    source = open_source(without(tmp_path / "torn.mkv", lambda number: number < 6, film))
    assert len(list(source)) == damage.FRAMES - 6
    assert list(source.warnings) == [
        "its first frame is at 0.60 s: those before it are missing, or cannot be decoded"
    ]


def tally(times: list[float]) -> Tally:
    told = Tally()
    for index, time in enumerate(times):
        told.note(index, time)
    return told


def test_of_a_film_with_a_varying_rate_no_gap_is_told():
    rng = np.random.default_rng(5)
    assert tally(np.cumsum(rng.uniform(0.02, 0.4, 300)).tolist()).notes(Promise(), "") == ()
    assert tally([0.0, 0.1, 0.9, 1.0]).gaps() == (0, -1)  # too few to tell
    assert tally([]).notes(Promise(end=8.0), "") == ()


def test_what_a_header_promises_is_compared_with_what_came():
    forty = tally([k / 10 for k in range(40)])
    assert forty.notes(Promise(end=4.0), "") == forty.notes(Promise(end=4.08), "") == ()
    assert forty.notes(Promise(end=5.0), "it is cut") == (
        "10 frames are missing, by what its header says: 40 came",
    )
    assert forty.notes(Promise(frames=41), "") == ()  # an AVI with packed frames
    assert forty.notes(Promise(frames=43), "") == ("3 frames are missing, by what its header says: 40 came",)
    assert forty.notes(Promise(frames=90, end=4.0), "") == ()  # an MP4 of which an edit list leaves out 50


def test_odd_numbers_of_steps_take_no_memory():
    told = tally([float(time) for time in np.cumsum(np.arange(1, 3000) / 100)])
    assert sys.getsizeof(told.steps) < 200_000
    assert told.step == 0
