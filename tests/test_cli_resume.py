"""Going on with runs that were killed, as a user types it; the bytes are those of a run that nobody disturbed."""

from __future__ import annotations

import io
import json
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from test_cli import PERDURE, perdure, write_film
from worlds import crossing, two_apart

from perdure import pipeline
from perdure.cli import resuming
from perdure.errors import OutputError, ParameterError
from perdure.files import checkpoints
from perdure.files.live_events import LiveEvents, lines_to
from perdure.files.log import RunLog, read_log
from perdure.files.mot import write_rows
from perdure.fold import Step
from perdure.types import Event, Frame, Regions, Report

RESULTS = ("tracks.jsonl", "tracks.txt", "events.csv")
PLAIN = ("--no-video", "--tracker", "overlap")


def results(run: Path) -> dict[str, bytes]:
    return {name: (run / name).read_bytes() for name in RESULTS}


def about(run: Path) -> dict:
    return json.loads((run / "run.json").read_text())


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("place")
    write_film(folder / "walk.avi", [frame.image for frame in crossing().frames()])
    write_film(folder / "other.avi", [frame.image for frame in two_apart().frames()])
    return folder


@pytest.fixture
def at_every_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    """Checkpoints at every frame, whatever they take."""
    monkeypatch.setattr(resuming, "SHARE", float("inf"))


def killed_at(frames: set[int], words: tuple[object, ...], at: Path, kept: str = "killed") -> Iterator[Path]:
    """Run these words, and yield the folder as a kill leaves it behind each of the frames."""
    append = RunLog.append

    def and_copy(log: RunLog, frame: int, *rest: object) -> None:
        append(log, frame, *rest)
        if frame in frames:
            shutil.copytree(at / "whole", at / f"{kept}-{frame}", dirs_exist_ok=True)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(RunLog, "append", and_copy)
        done = perdure("track", *words, "-o", "whole", "--overwrite", "--checkpoint-every", 0, at=at)
    assert done.returncode == 0, done.stderr
    for frame in sorted(frames):
        yield at / f"{kept}-{frame}"


@pytest.mark.usefixtures("at_every_frame")
def test_a_run_killed_behind_any_frame_ends_with_the_bytes_of_an_unbroken_one(place: Path):
    for run in killed_at({0, 17, 54}, ("walk.avi", *PLAIN), place):
        with (run / "tracks.jsonl").open("ab") as log:
            log.write(b'{"frame":99,"time":9.9,"rows":[{"id":7,"bo')  # cut off while it was written
        done = perdure("track", "walk.avi", *PLAIN, "-o", run, "--resume", at=place)
        assert done.returncode == 0, done.stderr
        frame = int(run.name.rpartition("-")[2])
        assert ("begins anew" if frame == 0 else f"behind frame {frame - 1}") in done.stderr
        assert results(run) == results(place / "whole")
        assert about(run)["resumed"] == [max(0, frame)]
        assert not (run / "checkpoint.zip").exists()


@pytest.mark.usefixtures("at_every_frame")
@pytest.mark.parametrize(
    "words",
    [
        ("--tracker", "compound", "--scenarios", "usual", "--start", "4f", "--stride", "2"),
        ("--tracker", "contour", "--init", "20,28,16,20@10", "--detector", "background", "--end", "30f"),
        ("--tracker", "multifeature", "--calibration", "plane.json"),
        ("--tracker", "overlap", "--detector", "boxes.txt", "--box-masks", "background"),
    ],
    ids=lambda words: words[1],
)
def test_every_tracker_is_gone_on_with_whatever_is_around_it(place: Path, words: tuple[str, ...]):
    with (place / "boxes.txt").open("w") as file:
        write_rows(file, crossing().truth())
    camera = {"focal": 90, "height": 6.0, "tilt_degrees": 30}
    (place / "plane.json").write_text(json.dumps({"frame": [120, 80], "camera": camera}))
    for run in killed_at({26}, ("walk.avi", "--no-video", *words), place, kept=words[1]):
        done = perdure("track", "walk.avi", "--no-video", *words, "-o", run, "--resume", at=place)
        assert "behind frame" in done.stderr
        assert results(run) == results(place / "whole")


@pytest.mark.slow
def test_runs_that_are_killed_at_any_moment_are_gone_on_with(place: Path):
    program = Path(__file__).parent / "killed.py"
    words = [sys.executable, str(program), str(place / "walk.avi"), str(place / "kills"), "5"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert sum(one["killed"] for one in told) >= 3, told
    assert any(frame > 0 for one in told for frame in one["resumed"]), told
    for number in range(5):
        assert results(place / "kills" / str(number)) == results(place / "kills/peace"), told[number]


@pytest.fixture(scope="module")
def once_killed(place: Path) -> Path:
    """A run of `walk.avi` that was killed behind frame 30, with its checkpoint behind frame 29."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(resuming, "SHARE", float("inf"))
        return next(killed_at({30}, ("walk.avi", *PLAIN), place, kept="once"))


@pytest.fixture
def unfinished(once_killed: Path, tmp_path: Path) -> Path:
    """One like it, to be spoilt."""
    return Path(shutil.copytree(once_killed, tmp_path / "unfinished"))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--patience", "3"), "tracker.parameters.patience was 1.0, now 3.0"),
        (("--threshold", "4"), "detector.parameters.threshold was 3.0, now 4.0"),
        (("--end", "40f"), 'window.end was not given, now "40f"'),
        (("--tracker", "compound"), 'tracker.name was "overlap", now "compound"'),
        (("--detector", "boxes.txt"), 'detector.name was "background", now "recorded"'),
        (("--report-confidence", "0.9"), "reporting.report_confidence was 0.5, now 0.9"),
        (("--overwrite",), "leave out one of them"),
    ],
    ids=lambda words: words[0] if isinstance(words, tuple) else "",
)
def test_another_run_than_the_one_asked_for_is_refused_by_what_differs(
    place: Path, once_killed: Path, words, said: str
):
    (place / "boxes.txt").write_text("")
    before = {one.name: one.read_bytes() for one in once_killed.iterdir()}
    done = perdure("track", "walk.avi", *PLAIN, *words, "-o", once_killed, "--resume", at=place)
    assert (done.returncode, said in done.stderr) == (2, True), done.stderr
    assert {one.name: one.read_bytes() for one in once_killed.iterdir()} == before


@pytest.mark.usefixtures("at_every_frame")
def test_another_source_or_file_of_detections_under_the_same_name_is_refused(tmp_path: Path, place: Path):
    shutil.copy(place / "walk.avi", tmp_path)
    with (tmp_path / "boxes.txt").open("w") as file:
        write_rows(file, crossing().truth())
    words = ("walk.avi", *PLAIN, "--detector", "boxes.txt")
    run = next(killed_at({30}, words, tmp_path))
    resume = ("track", *words, "-o", run, "--resume")
    kept = (tmp_path / "boxes.txt").read_text()
    (tmp_path / "boxes.txt").write_text(kept.replace("40.00", "41.00"))
    assert "the file for --detector has other contents" in perdure(*resume, at=tmp_path).stderr
    (tmp_path / "boxes.txt").write_text(kept)
    images = [frame.image for frame in crossing().frames()]
    for film, said in ((images[::-1], "shows something else there"), (images[:20], "ends before it")):
        write_film(tmp_path / "walk.avi", film)
        done = perdure(*resume, at=tmp_path)
        assert (done.returncode, f"stood at frame 29: it {said}" in done.stderr) == (2, True), done.stderr
    shutil.copy(place / "walk.avi", tmp_path)
    assert perdure(*resume, at=tmp_path).returncode == 0
    assert results(run) == results(tmp_path / "whole")


@pytest.mark.parametrize(
    ("harm", "said"),
    [
        ("version", "saved by another version (Perdure 0."),
        ("checkpoint", "checkpoint.zip: this saved state is damaged"),
        ("log", "is not the log that this run wrote"),
        ("shorter", "is not the log that this run wrote"),
    ],
)
def test_a_checkpoint_that_cannot_be_gone_on_from_is_refused_with_a_remedy(
    place: Path, unfinished: Path, monkeypatch: pytest.MonkeyPatch, harm: str, said: str
):
    checkpoint, log = unfinished / "checkpoint.zip", unfinished / "tracks.jsonl"
    if harm == "version":
        monkeypatch.setattr(checkpoints, "__version__", "9.9.9")
    elif harm == "checkpoint":
        checkpoint.write_bytes(checkpoint.read_bytes()[:-100])
    elif harm == "log":
        log.write_bytes(log.read_bytes().replace(b'"id":1', b'"id":8'))
    else:
        log.write_bytes(log.read_bytes()[:500])
    before = log.read_bytes()
    done = perdure("track", "walk.avi", *PLAIN, "-o", unfinished, "--resume", at=place)
    assert (done.returncode, said in done.stderr, "--overwrite" in done.stderr) == (2, True, True), done.stderr
    assert log.read_bytes() == before


def test_to_go_on_with_nothing_is_to_begin_and_with_a_finished_run_to_do_nothing(place: Path):
    words = ("track", "walk.avi", "--tracker", "overlap", "-o", "idempotent", "--resume", "--json")
    first = perdure(*words, "--no-video", at=place)
    told = json.loads(first.stdout.splitlines()[-1])
    assert (first.returncode, first.stderr) == (0, "")
    kept = {one.name: one.stat().st_mtime_ns for one in (place / "idempotent").iterdir()}
    again = perdure(*words, "--no-video", at=place)
    assert (again.returncode, "is finished: there is nothing to go on with" in again.stderr) == (0, True)
    assert json.loads(again.stdout.splitlines()[-1])["rows"] == told["rows"] > 0
    assert {one.name: one.stat().st_mtime_ns for one in (place / "idempotent").iterdir()} == kept
    drawn = perdure(*words, at=place)
    assert drawn.returncode == 0
    assert (place / "idempotent/tracked.mp4").stat().st_size > 1000
    refused = perdure("track", "walk.avi", "--tracker", "overlap", "-o", "idempotent", at=place)
    assert "add --overwrite, or" in refused.stderr


def test_what_passes_only_once_is_refused(place: Path):
    made = pipeline.plan(iter([frame.image for frame in crossing().frames()]), fps=10)
    with pytest.raises(ParameterError, match="passes only once, so that a run of it cannot be gone on with"):
        resuming.found(made, place / "nowhere", {})


def test_a_tracker_that_cannot_be_saved_begins_anew(
    place: Path, unfinished: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("perdure.cli.running.cannot_resume", lambda _: "it cannot be saved")
    done = perdure("track", "walk.avi", *PLAIN, "-o", unfinished, "--resume", at=place)
    assert "begins anew: it cannot be saved" in done.stderr
    assert results(unfinished) == results(place / "whole")


@pytest.mark.usefixtures("at_every_frame")
def test_an_interrupted_run_is_gone_on_with(place: Path):
    append = RunLog.append

    def and_interrupt(log: RunLog, frame: int, *rest: object) -> None:
        append(log, frame, *rest)
        if frame == 20:
            os.kill(os.getpid(), 2)

    words = ("track", "walk.avi", *PLAIN, "-o", "stopped", "--checkpoint-every", 0)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(RunLog, "append", and_interrupt)
        done = perdure(*words, at=place)
    assert (done.returncode, "--resume goes on" in done.stderr) == (130, True)
    assert b'"frame":-1' in (place / "stopped/tracks.jsonl").read_bytes()
    assert "--resume to go on" in perdure(*words, at=place).stderr
    assert perdure(*words, "--resume", at=place).returncode == 0
    perdure("track", "walk.avi", *PLAIN, "-o", "unstopped", at=place)
    assert results(place / "stopped") == results(place / "unstopped")
    assert about(place / "stopped")["frames"] == 55


@pytest.mark.usefixtures("at_every_frame")
def test_a_run_without_room_for_checkpoints_goes_on_and_says_so(place: Path, monkeypatch: pytest.MonkeyPatch):
    def full(*_: object) -> None:
        raise OutputError("no room")

    monkeypatch.setattr(resuming, "write_checkpoint", full)
    done = perdure("track", "walk.avi", *PLAIN, "-o", "unsaved", "--checkpoint-every", 0, at=place)
    assert (done.returncode, "a checkpoint could not be written: no room" in done.stderr) == (0, True)


def test_a_run_that_another_process_writes_is_left_alone(place: Path, unfinished: Path):
    (unfinished / "checkpoint.zip").unlink()
    with RunLog(unfinished / "tracks.jsonl"):
        kept = (unfinished / "tracks.jsonl").read_bytes()
        done = perdure("track", "walk.avi", *PLAIN, "-o", unfinished, "--resume", at=place)
        assert (done.returncode, "is being written by another process" in done.stderr) == (2, True)
        assert (unfinished / "tracks.jsonl").read_bytes() == kept


def test_a_disk_that_becomes_full_is_said_in_a_line_and_everything_before_is_kept(place: Path):
    """A limit on how large a file may become stands for the disk."""

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (9_000, resource.RLIM_INFINITY))

    words = ["track", "walk.avi", *PLAIN, "-o", "full", "--checkpoint-every", "0"]
    done = subprocess.run(
        [*PERDURE, *words], cwd=place, capture_output=True, text=True, preexec_fn=limited, timeout=120
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.splitlines()[-1].startswith("perdure: cannot write")
    assert "--resume" in done.stderr
    assert "Traceback" not in done.stderr
    kept = [entry.frame for entry in read_log(place / "full/tracks.jsonl")]
    assert kept == list(range(len(kept)))
    assert len(kept) > 5
    assert perdure("export", "full", "--format", "mot", "-o", "full.txt", at=place).returncode == 0
    assert perdure(*words, "--resume", at=place).returncode == 0
    perdure("track", "walk.avi", *PLAIN, "-o", "roomy", at=place)
    assert results(place / "full") == results(place / "roomy")


def test_a_film_that_could_not_be_drawn_leaves_the_run_done_and_is_drawn_later(
    place: Path, monkeypatch: pytest.MonkeyPatch
):
    def full(*_: object) -> None:
        raise OutputError("no room for the film")

    words = ("track", "walk.avi", "--tracker", "overlap", "-o", "filmless")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("perdure.cli.running.draw_film", full)
        done = perdure(*words, at=place)
    assert (done.returncode, "no room for the film" in done.stderr) == (2, True)
    assert about(place / "filmless")["status"] == "done"
    assert perdure(*words, "--resume", at=place).returncode == 0
    assert (place / "filmless/tracked.mp4").exists()


def test_what_was_told_as_begun_is_told_as_ended_by_the_run_that_goes_on():
    lasting, out = Event("loiter", 3, 9, (1,), "door"), io.StringIO()
    first, again = LiveEvents(lines_to(io.StringIO())), LiveEvents(lines_to(out))
    first.tell(Step(Frame(9, 0.9, None), Regions.empty(), Report(begun=(lasting,))))
    assert first.lasting == (("loiter", (1,), "door"),)
    again.go_on(first.lasting, 0.9)
    again.tell(Step(None, Regions.empty(), Report(events=(lasting,))))
    told = json.loads(out.getvalue())
    assert (told["state"], told["time"]) == ("ends", 0.9)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 20 kB, where this user may mount one."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = shutil.which("mount")
    words = [mount or "", "-t", "tmpfs", "-o", "size=20k", "tmpfs", str(disk)]
    if mount is None or subprocess.run(words, capture_output=True).returncode:
        pytest.skip("no disk can be mounted here")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


@pytest.mark.slow
def test_a_run_on_a_disk_that_is_full_goes_on_when_there_is_room(place: Path, small_disk: Path):
    words = ("track", "walk.avi", "--no-video", "--tracker", "compound", "-o", small_disk / "run")
    done = perdure(*words, at=place)
    assert (done.returncode, "No space left on device" in done.stderr) == (2, True), done.stderr
    kept = [entry.frame for entry in read_log(small_disk / "run/tracks.jsonl")]
    assert kept == list(range(len(kept)))
    subprocess.run(["mount", "-o", "remount,size=30m", str(small_disk)], check=True)
    assert perdure(*words, "--resume", at=place).returncode == 0
    perdure("track", "walk.avi", "--no-video", "--tracker", "compound", "-o", "wide", at=place)
    assert results(small_disk / "run") == results(place / "wide")


def test_what_is_made_of_a_run_that_was_killed_says_that_it_is_not_whole(place: Path, once_killed: Path):
    for words in (("export", once_killed, "-o", "part.txt"), ("convert", once_killed, "part.csv")):
        done = perdure(*words, at=place)
        assert done.returncode == 0
        assert "has not ended: it is running still, or was killed" in done.stderr
