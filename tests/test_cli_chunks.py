"""`perdure run --chunks`: a long film in parts, whose tracks are those of one run."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path

import numpy as np
import pytest
from dying import killed_in_frame_20
from test_cli import perdure, write_film
from worlds import two_apart

from perdure.cli.jobs import Job, chunks_of, placed, stitch_here, work_here
from perdure.cli.parts import Chunks
from perdure.cluster import Where, work_at
from perdure.comparison import Wanted, compare_files
from perdure.errors import ParameterError
from perdure.files.mot import write_rows
from perdure.files.runs import RunFolder
from perdure.files.scored import Match
from perdure.files.video import open_source

CUT = Chunks.of("16f", "10f")


def in_chunks(source: Path, cut: Chunks = CUT, **settings: object) -> Job:
    opened = open_source(source)
    return Job(str(source), {"stride": 1, **settings}, chunks=cut.cut(opened))


def done(job: Job, folder: Path) -> Path:
    """What `perdure run` makes of a job in chunks, in this process."""
    for part in job.parts:
        work_here((part, placed(part, chunks_of(folder))))
    stitch_here((job, folder))
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {one.name: one.read_bytes() for one in folder.iterdir()}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A film of two walkers, their truth, and the run `whole` that was made in three chunks."""
    folder = tmp_path_factory.mktemp("chunks")
    write_film(folder / "walk.avi", [frame.image for frame in two_apart().frames()])
    with (folder / "truth.txt").open("w") as file:
        write_rows(file, two_apart().truth())
    done(in_chunks(folder / "walk.avi"), folder / "whole")
    return folder


def test_the_run_is_laid_out_as_any_other_and_says_that_it_was_made_in_chunks(place: Path):
    assert sorted(contents(place / "whole")) == ["events.csv", "run.json", "tracks.jsonl", "tracks.txt"]
    assert not chunks_of(place / "whole").exists()
    about = RunFolder.open(place / "whole").read_about()
    assert (about["status"], about["frames"], about["window"]) == ("done", 40, {"stride": 1})
    assert about["chunks"]["parts"] == [{"begin": 0, "end": 16}, {"begin": 6, "end": 40}]
    entries = [entry.frame for entry in RunFolder.open(place / "whole").entries()]
    assert entries == [*range(40), -1]


def test_the_walkers_keep_their_ids_over_the_border_as_the_truth_says(place: Path):
    scored = compare_files(Match("walk", place / "whole", place / "truth.txt"), Wanted()).boxes
    assert scored.figures["IDF1"] > 0.95
    tracks = RunFolder.open(place / "whole").tracks()
    assert sorted(set(tracks.ids.tolist())) == [1, 2]


def test_explain_says_by_what_an_id_was_joined(place: Path):
    told = perdure("explain", "whole", "--id", 1, at=place)
    assert told.returncode == 0, told.stderr
    assert "joined" in told.stdout
    assert "both parts at the border of frame" in told.stdout


def test_nobody_enters_twice_and_nothing_is_told_of_the_burn_in(place: Path):
    with (place / "whole" / "events.csv").open() as file:
        told = list(csv.DictReader(file))
    entered = [one["ids"] for one in told if one["kind"] == "entered"]
    assert sorted(entered) == ["1", "2"]
    assert len({(one["kind"], one["begin_frame"], one["ids"]) for one in told}) == len(told)


def test_a_source_that_is_no_longer_than_a_chunk_is_the_job_it_is_without(place: Path):
    whole = in_chunks(place / "walk.avi", Chunks.of("4", None))
    assert whole.chunks == ()
    assert whole.key == Job(str(place / "walk.avi"), {"stride": 1}).key
    assert in_chunks(place / "walk.avi").key != whole.key


@pytest.mark.parametrize(
    ("length", "overlap", "stride", "spans"),
    [
        ("1", "0.5", 1, ((0, 10), (5, 20), (15, 30), (25, 40))),
        ("10f", None, 1, ((0, 10), (5, 20), (15, 30), (25, 40))),
        ("1.2", "5f", 1, ((0, 12), (7, 24), (19, 40))),  # what is left is no longer than an overlap
        ("20f", "8f", 2, ((0, 20), (12, 40))),
    ],
)
def test_a_film_is_cut_by_its_frames(
    place: Path, length: str, overlap: str | None, stride: int, spans: tuple[tuple[int, int], ...]
):
    cut = Chunks.of(length, overlap).cut(open_source(place / "walk.avi", stride=stride), stride)
    assert cut == spans


def test_what_passes_only_once_is_refused():
    pictures = (np.zeros((8, 8, 3), np.uint8) for _ in range(9))
    with pytest.raises(ParameterError, match="cannot be entered in its middle"):
        CUT.cut(open_source(pictures))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--chunks", "soon"), "is not a moment"),
        (("--chunks", "0"), "leaves no frame"),
        (("--chunks", "1", "--overlap", "1"), "shorter than the chunks"),
        (("--chunks", "6f"), "overlap must be 4 frames"),
        (("--overlap", "1"), "goes with --chunks"),
        (("--chunks", "1", "--scenarios", "usual"), "perdure scenarios RUN"),
        (("--chunks", "1", "--init", "1,1,5,5"), "--init and --chunks"),
    ],
)
def test_a_mistake_in_the_options_is_told_before_anything_begins(place: Path, words: tuple[str, ...], said: str):
    told = perdure("run", "walk.avi", "-o", "none", *words, at=place)
    assert told.returncode == 2
    assert said in told.stderr
    assert not (place / "none").exists()


def test_detections_without_pictures_are_tracked_in_chunks_too(tmp_path: Path):
    folder = tmp_path / "MOT"
    (folder / "det").mkdir(parents=True)
    (folder / "seqinfo.ini").write_text(
        "[Sequence]\nname=MOT\nimDir=img1\nframeRate=10\nseqLength=40\nimWidth=120\nimHeight=80\nimExt=.jpg\n"
    )
    with (folder / "det" / "det.txt").open("w") as file:
        write_rows(file, two_apart().truth())
    whole = done(in_chunks(folder), tmp_path / "whole")
    assert sorted(set(RunFolder.open(whole).tracks().ids.tolist())) == [1, 2]


def test_a_source_that_breaks_off_is_told_as_far_as_it_goes(place: Path, tmp_path: Path):
    job = in_chunks(place / "walk.avi", Chunks.of("12f", "6f"))
    for part in job.parts:
        work_here((part, placed(part, chunks_of(tmp_path / "whole"))))
    broken = RunFolder.open(placed(job.parts[1], chunks_of(tmp_path / "whole")))
    about = {key: value for key, value in broken.read_about().items() if key not in ("format", "version")}
    broken.write_about({**about, "status": "damaged", "message": "it breaks off at frame 24"})
    told = stitch_here((job, tmp_path / "whole"))
    assert (told["status"], told["message"], told["frames"]) == ("damaged", "it breaks off at frame 24", 24)


def test_parts_of_another_window_are_other_jobs(place: Path):
    job = in_chunks(place / "walk.avi")
    assert len({part.key for part in job.parts}) == 2
    assert job.parts[0].settings["end"] == "16f"
    late = dataclasses.replace(job, settings={**job.settings, "start": "1f"})
    assert late.parts[0].key != job.parts[0].key


@pytest.mark.slow
def test_a_worker_that_is_killed_in_a_chunk_changes_no_byte(place: Path, tmp_path: Path):
    job, folder = in_chunks(place / "walk.avi"), tmp_path / "whole"
    tasks = [(part, placed(part, chunks_of(folder)), tmp_path / "died") for part in job.parts]
    ends = list(work_at(tasks, killed_in_frame_20, on=Where(), workers=2))
    assert [one.failure for one in ends] == ["", ""]
    assert (tmp_path / "died").exists()
    stitch_here((job, folder))
    assert contents(folder) == contents(place / "whole")


@pytest.mark.slow
def test_the_number_of_workers_changes_no_byte_and_what_is_done_is_not_done_again(place: Path, tmp_path: Path):
    words = ("run", "walk.avi", "--chunks", "16f", "--overlap", "10f", "-o", tmp_path / "runs", "--workers", 2)
    first = perdure(*words, at=place)
    assert first.returncode == 0, first.stderr
    (folder,) = (tmp_path / "runs").iterdir()
    assert contents(folder) == contents(place / "whole")
    assert "done before" in perdure(*words, at=place).stdout
