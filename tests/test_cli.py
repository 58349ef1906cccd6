"""The command line as a user types it; in a process of its own where loading, signals and streams matter."""

from __future__ import annotations

import contextlib
import csv
import functools
import http.server
import io
import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import av
import numpy as np
import pytest
from worlds import two_apart

from perdure.cli import main
from perdure.files.log import read_log
from perdure.files.mot import read_tracks
from perdure.metrics.clear import clear
from perdure.types import Regions

PERDURE = [sys.executable, "-c", "from perdure.cli import main; main()"]


def perdure(*words: object, at: Path) -> subprocess.CompletedProcess[str]:
    """What comes of these words, without the process that would have to load everything first."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(at),
        pytest.MonkeyPatch.context() as patched,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        patched.setattr(sys, "argv", ["perdure", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
    return subprocess.CompletedProcess(words, ended.value.code, out.getvalue(), err.getvalue())


def perdure_alone(*words: object, at: Path) -> subprocess.CompletedProcess[str]:
    """What comes of these words in a process that has loaded nothing else."""
    return subprocess.run([*PERDURE, *map(str, words)], cwd=at, capture_output=True, text=True, timeout=120)


def write_film(path: Path, images: list[np.ndarray], codec: str = "mpeg4", fps: int = 10) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=fps)
        stream.height, stream.width = images[0].shape[:2]
        stream.pix_fmt, stream.bit_rate, stream.gop_size = "yuv420p", 2_000_000, 10
        for image in images:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode(None))
    return path


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `walk.avi`, two walkers, and the run `first` over it."""
    folder = tmp_path_factory.mktemp("place")
    write_film(folder / "walk.avi", [frame.image for frame in two_apart().frames()])
    done = perdure_alone("track", "walk.avi", "-o", "first", "--json", at=folder)
    assert done.returncode == 0, done.stderr
    return folder


def test_the_package_may_be_run_as_the_command(place: Path):
    words = [sys.executable, "-m", "perdure", "--version"]
    done = subprocess.run(words, cwd=place, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout[:8]) == (0, "perdure ")


def test_a_run_folder_holds_run_log_tracks_events_and_a_film(place: Path):
    assert {path.name for path in (place / "first").iterdir()} == {
        "run.json", "tracks.jsonl", "tracks.txt", "events.csv", "tracked.mp4",
    }  # fmt: skip
    about = json.loads((place / "first/run.json").read_text())
    assert (about["status"], about["frames"], about["tracks"]) == ("done", 40, 2)
    assert about["tracker"]["parameters"]["patience"] == 2.0


def test_the_two_walkers_are_found_where_they_are(place: Path):
    figures = clear(read_tracks(place / "first/tracks.txt", fps=10), two_apart().truth(), least_overlap=0.4)
    assert figures.recall > 0.95
    assert figures.precision > 0.95
    assert figures.switches == 0


def test_events_are_a_table_with_frames_and_times(place: Path):
    rows = list(csv.DictReader((place / "first/events.csv").read_text().splitlines()))
    entered = [row for row in rows if row["kind"] == "entered"]
    assert sorted(row["ids"] for row in entered) == ["1", "2"]
    assert all(float(row["begin_time"]) == pytest.approx(int(row["begin_frame"]) / 10) for row in rows)
    frames = [int(row["begin_frame"]) for row in rows]
    assert frames == sorted(frames)


def test_the_film_has_every_frame_in_vp9(place: Path):
    with av.open(str(place / "first/tracked.mp4")) as film:
        assert film.streams.video[0].codec_context.name == "vp9"
        assert sum(1 for _ in film.decode(video=0)) == 40


def test_json_is_the_last_line_and_tells_the_totals(place: Path):
    done = perdure("track", "walk.avi", "-o", "again", "--json", "--no-video", at=place)
    told = json.loads(done.stdout.splitlines()[-1])
    assert (told["status"], told["frames"], told["tracks"]) == ("done", 40, 2)
    assert not (place / "again/tracked.mp4").exists()


def test_the_closing_table_tells_frames_tracks_and_rate(place: Path):
    done = perdure("track", "walk.avi", "-o", "table", "--no-video", at=place)
    assert "frames" in done.stdout
    assert "frames/s" in done.stdout
    assert "tracks.txt" in done.stdout


def test_the_run_goes_to_perdure_runs_when_no_place_is_named(tmp_path: Path, place: Path):
    done = perdure("track", place / "walk.avi", "--no-video", at=tmp_path)
    assert done.returncode == 0
    assert (tmp_path / "perdure-runs/walk/tracks.txt").is_file()


def test_a_run_is_not_touched_without_overwrite(place: Path):
    perdure("track", "walk.avi", "-o", "kept", "--no-video", at=place)
    before = (place / "kept/run.json").read_bytes()
    refused = perdure("track", "walk.avi", "-o", "kept", "--no-video", "--patience", "2", at=place)
    assert refused.returncode == 2
    assert "--overwrite" in refused.stderr
    assert (place / "kept/run.json").read_bytes() == before
    allowed = perdure("track", "walk.avi", "-o", "kept", "--no-video", "--patience", "2", "--overwrite", at=place)
    assert allowed.returncode == 0
    assert json.loads((place / "kept/run.json").read_text())["tracker"]["parameters"]["patience"] == 2.0


def test_a_folder_with_other_files_is_never_written_into(place: Path):
    (place / "mine").mkdir()
    (place / "mine/thesis.tex").write_text("years of work")
    done = perdure("track", "walk.avi", "-o", "mine", "--overwrite", at=place)
    assert done.returncode == 2
    assert [path.name for path in (place / "mine").iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["track", "nothing.mp4", "-o", "x"], "nothing.mp4"),
        (["track", "notes.mp4", "-o", "x"], "notes.mp4"),
        (["track", "empty.mp4", "-o", "x"], "empty.mp4"),
        (["track", "walk.avi", "-o", "x", "--patience", "-1"], "patience = -1.0 is out of range"),
        (["track", "walk.avi", "-o", "x", "--patiense", "1"], "--patience"),
        (["track", "walk.avi", "-o", "x", "--patience", "long"], "patience"),
        (["track", "walk.avi", "-o", "x", "--tracker", "overlpa"], "did you mean 'overlap'"),
        (["track", "walk.avi", "-o", "x", "--detector", "backgruond"], "did you mean 'background'"),
        (["track", "walk.avi", "-o", "x", "--detector", "gone.txt"], "gone.txt"),
        (["track", "walk.avi", "-o", "x", "--detector", "notes.mp4"], "line 1"),
        (["track", "walk.avi", "-o", "x", "--class", "dog"], "--detector"),
        (["track", "walk.avi", "-o", "x", "--least-score", "0.5"], "'recorded'"),
        (["track", "walk.avi", "-o", "x", "--parameters", "notes.mp4"], "not JSON"),
        (["track", "walk.avi", "-o", "x", "--start", "soon"], "soon"),
        (["track", "walk.avi", "-o", "x", "--start", "99"], "99"),
        (["track", "walk.avi", "-o", "x", "--stride", "0"], "stride"),
        (["track", "walk.avi", "-o", "x", "--fps", "-3"], "fps"),
        (["track", "walk.avi", "-o", "x", "--roi", "1,2,3"], "roi"),
        (["track", "walk.avi", "-o", "notes.mp4"], "notes.mp4"),
        (["detect", "walk.avi", "-o", "x.xml"], ".jsonl"),
        (["draw", "walk.avi", "nowhere", "-o", "x.mp4"], "not a run folder"),
        (["draw", "walk.avi", "first", "-o", "x.gif"], ".mp4"),
        (["export", "first", "--format", "coc", "-o", "x"], "csv"),
        (["trakc"], "track"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_a_mistake_is_one_clear_message_exit_code_2_and_nothing_left_behind(place: Path, words, said):
    (place / "notes.mp4").write_text("these are my notes\n")
    (place / "empty.mp4").write_bytes(b"")
    before = sorted(path.name for path in place.iterdir())
    done = perdure(*words, at=place)
    assert done.returncode == 2, done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(path.name for path in place.iterdir()) == before


def test_frame_numbers_are_the_sources_own_after_start_and_stride(place: Path):
    perdure(
        "track",
        "walk.avi",
        "-o",
        "part",
        "--no-video",
        "--start",
        "20f",
        "--end",
        "3.0",
        "--stride",
        "2",
        at=place,
    )
    assert [entry.frame for entry in read_log(place / "part/tracks.jsonl")] == [20, 22, 24, 26, 28, -1]


def test_fps_sets_the_times(place: Path):
    perdure("track", "walk.avi", "-o", "slow", "--no-video", "--fps", "5", at=place)
    entries = list(read_log(place / "slow/tracks.jsonl"))
    assert entries[10].time == pytest.approx(2.0)


def test_an_roi_keeps_the_lower_walker_out(place: Path):
    perdure("track", "walk.avi", "-o", "upper", "--no-video", "--roi", "0,0,120,40", at=place)
    assert set(read_tracks(place / "upper/tracks.txt").ids.tolist()) == {1}


def test_a_long_polygon_is_no_file_name_when_a_run_is_replaced(place: Path):
    polygon = " ".join(f"{x},{y}" for y in (0, 79) for x in (range(0, 119, 2) if y == 0 else range(118, -1, -2)))
    assert len(polygon) > 300
    for _ in range(2):
        done = perdure("track", "walk.avi", "-o", "poly", "--no-video", "--roi", polygon, "--overwrite", at=place)
        assert done.returncode == 0, done.stderr


def test_parameters_of_a_file_count_and_those_of_the_command_line_win(place: Path):
    (place / "mine.json").write_text('{"patience": 3, "confirm": 0.5, "report_confidence": 0.25}')
    perdure(
        "track", "walk.avi", "-o", "tuned", "--no-video", "--parameters", "mine.json", "--confirm", "0", at=place
    )
    about = json.loads((place / "tuned/run.json").read_text())
    assert about["tracker"]["parameters"]["patience"] == 3.0
    assert about["tracker"]["parameters"]["confirm"] == 0.0
    assert about["reporting"]["report_confidence"] == 0.25


def test_what_detect_wrote_tracks_like_the_video_itself(place: Path):
    done = perdure("detect", "walk.avi", "-o", "seen.jsonl", "--json", at=place)
    assert json.loads(done.stdout)["frames"] == 40
    perdure("track", "walk.avi", "-o", "recorded", "--no-video", "--detector", "seen.jsonl", at=place)
    for name in ("tracks.jsonl", "tracks.txt", "events.csv"):
        assert (place / "recorded" / name).read_bytes() == (place / "first" / name).read_bytes()


def test_a_motchallenge_folder_without_images_needs_no_detector_named(place: Path):
    folder = place / "SEQ-01"
    (folder / "det").mkdir(parents=True)
    (folder / "seqinfo.ini").write_text(
        "[Sequence]\nname=SEQ-01\nimDir=img1\nframeRate=10\nseqLength=40\nimWidth=120\nimHeight=80\nimExt=.jpg\n"
    )
    assert perdure("detect", "walk.avi", "-o", "SEQ-01/det/det.txt", at=place).returncode == 0
    done = perdure("track", "SEQ-01", "-o", "boxes", "--json", at=place)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.splitlines()[-1])["tracks"] == 2
    assert (place / "boxes/tracked.mp4").is_file()
    refused = perdure("track", "SEQ-01", "-o", "y", "--detector", "background", at=place)
    assert (refused.returncode, (place / "y").exists()) == (2, False)


def test_draw_makes_the_film_again(place: Path):
    done = perdure("draw", "walk.avi", "first", "-o", "film.webm", at=place)
    assert done.returncode == 0, done.stderr
    with av.open(str(place / "film.webm")) as film:
        assert sum(1 for _ in film.decode(video=0)) == 40
    assert perdure("draw", "walk.avi", "first", "-o", "film.webm", at=place).returncode == 2


def test_export_writes_what_counts_as_mot_and_csv(place: Path):
    assert perdure("export", "first", "--format", "mot", "-o", "out.txt", at=place).returncode == 0
    assert (place / "out.txt").read_bytes() == (place / "first/tracks.txt").read_bytes()
    perdure("export", "first", "--format", "csv", "-o", "out.csv", at=place)
    rows = list(csv.DictReader((place / "out.csv").read_text().splitlines()))
    assert len(rows) == len((place / "out.txt").read_text().splitlines())
    assert {"frame", "time", "id", "x1", "status"} <= set(rows[0])


def test_a_truncated_video_is_tracked_up_to_its_damage_and_says_so(place: Path):
    data = (place / "walk.avi").read_bytes()
    (place / "cut.avi").write_bytes(data[: len(data) * 3 // 4])
    done = perdure("track", "cut.avi", "-o", "cut", "--json", at=place)
    assert done.returncode == 3, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["status"] == "damaged"
    assert 3 < told["frames"] < 40
    assert f"frame {told['frames']}" in done.stderr
    assert len(list(read_log(place / "cut/tracks.jsonl"))) == told["frames"] + 1
    assert (place / "cut/tracked.mp4").is_file()


def test_ctrl_c_ends_cleanly_with_everything_so_far_kept(tmp_path: Path):
    images = [frame.image.repeat(4, axis=0).repeat(4, axis=1) for frame in two_apart().frames()] * 20
    write_film(tmp_path / "long.avi", images)
    running = subprocess.Popen(
        [*PERDURE, "track", "long.avi", "-o", "run"], cwd=tmp_path, stderr=subprocess.PIPE, text=True
    )
    log = tmp_path / "run/tracks.jsonl"
    while not (log.exists() and log.stat().st_size > 20_000):
        assert running.poll() is None, running.stderr.read()
        time.sleep(0.01)
    os.kill(running.pid, signal.SIGINT)
    _, printed = running.communicate(timeout=60)
    assert running.returncode == 130
    assert "interrupted" in printed
    assert "Traceback" not in printed
    frames = len(list(read_log(log))) - 1
    assert 10 < frames < len(images)
    assert json.loads((tmp_path / "run/run.json").read_text())["status"] == "interrupted"
    assert len(read_tracks(tmp_path / "run/tracks.txt")) > 0


def test_a_run_that_would_replace_its_own_source_is_refused(place: Path):
    perdure("track", "walk.avi", "-o", "own", at=place)
    before = {path.name: path.read_bytes() for path in (place / "own").iterdir()}
    refused = perdure("track", "own/tracked.mp4", "-o", "own", "--overwrite", at=place)
    assert (refused.returncode, "own/tracked.mp4" in refused.stderr) == (2, True)
    assert {path.name: path.read_bytes() for path in (place / "own").iterdir()} == before
    kept = (place / "walk.avi").read_bytes()
    (place / "walk.mp4").write_bytes((place / "own/tracked.mp4").read_bytes())
    assert perdure("draw", "walk.mp4", "own", "-o", "walk.mp4", "--overwrite", at=place).returncode == 2
    assert (place / "walk.avi").read_bytes() == kept


def test_files_that_are_there_are_not_written_over_unasked(place: Path):
    (place / "precious.txt").write_text("1,1,1,1,1,1")
    for words in (["detect", "walk.avi"], ["export", "first"]):
        refused = perdure(*words, "-o", "precious.txt", at=place)
        assert (refused.returncode, "--overwrite" in refused.stderr) == (2, True)
    assert (place / "precious.txt").read_text() == "1,1,1,1,1,1"
    assert perdure("export", "first", "-o", "precious.txt", "--overwrite", at=place).returncode == 0


def test_draw_over_a_film_of_another_size_is_refused(place: Path):
    write_film(place / "small.avi", [np.zeros((40, 60, 3), np.uint8)] * 5)
    done = perdure("draw", "small.avi", "first", "-o", "wrong.mp4", at=place)
    assert (done.returncode, (place / "wrong.mp4").exists()) == (2, False)
    assert "60x40" in done.stderr


def test_draw_over_a_damaged_film_says_so(place: Path):
    data = (place / "walk.avi").read_bytes()
    (place / "torn.avi").write_bytes(data[: len(data) * 3 // 4])
    done = perdure("draw", "torn.avi", "first", "-o", "torn.mp4", at=place)
    assert (done.returncode, (place / "torn.mp4").exists()) == (3, True)
    assert "frame" in done.stderr


def test_a_usage_mistake_is_one_line_with_meaning_and_range(place: Path):
    done = perdure("track", "walk.avi", "-o", "x", "--patience", "long", at=place)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert "0 to 3600 s" in done.stderr


def test_detections_for_a_part_of_the_film_only_are_worth_a_note(place: Path):
    (place / "few.txt").write_text("1,-1,11,11,20,30,0.9\n2,-1,11,11,20,30,0.9\n")
    done = perdure("track", "walk.avi", "-o", "few", "--no-video", "--detector", "few.txt", at=place)
    assert "covers 2 frames" in done.stderr


@pytest.mark.parametrize("damage", ['{"window": null}', '{"reporting": 3}', "[" * 100_000, "[]", "nonsense"])
def test_a_damaged_run_json_is_named(place: Path, damage: str):
    shutil.copytree(place / "first", place / "hurt", dirs_exist_ok=True)
    (place / "hurt/run.json").write_text(damage)
    done = perdure("export", "hurt", "-o", "hurt.txt", "--overwrite", at=place)
    assert (done.returncode, "run.json" in done.stderr, "Traceback" in done.stderr) == (2, True, False)


@pytest.mark.parametrize(
    "values", ["[" * 100_000, '{"patience": 1, "patience": 2}', '{"patience": ' + "9" * 400 + "}"]
)
def test_a_parameter_file_that_cannot_be_is_refused(place: Path, values: str):
    (place / "odd.json").write_text(values)
    done = perdure("track", "walk.avi", "-o", "x", "--parameters", "odd.json", at=place)
    assert (done.returncode, (place / "x").exists(), "Traceback" in done.stderr) == (2, False, False)


def test_a_run_without_a_terminal_or_an_error_stream_is_a_run(place: Path):
    words = shlex.join([*PERDURE, "track", "walk.avi", "--no-video", "-o"])
    assert subprocess.run(f"{words} silent 2>&-", shell=True, cwd=place, capture_output=True).returncode == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_standard_output_is_said_in_one_line(place: Path):
    words = shlex.join([*PERDURE, "track", "walk.avi", "--no-video", "-o", "loud"])
    done = subprocess.run(f"{words} > /dev/full", shell=True, cwd=place, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, "Traceback" in done.stderr) == (2, False)
    assert "No space" in done.stderr


def test_a_failed_run_leaves_no_wreck(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from perdure import pipeline
    from perdure.cli.running import run
    from perdure.files.runs import Reporting, RunFolder

    def broken(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("perdure.cli.running.RunLog.append", broken)
    plan = pipeline.plan([frame.image for frame in two_apart().frames()], fps=10)
    with pytest.raises(OSError, match="No space"):
        run(plan, RunFolder.create(tmp_path / "run", overwrite=False), Reporting(), film=False)
    status = (
        json.loads((tmp_path / "run/run.json").read_text())["status"] if (tmp_path / "run").exists() else "gone"
    )
    assert status in ("failed", "gone")


def test_a_stream_is_tracked_and_drawn_while_it_comes(place: Path):
    """A server on this machine; what comes from it cannot be read a second time."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None: ...

    handler = functools.partial(Quiet, directory=str(place))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        url = f"http://127.0.0.1:{server.server_port}/walk.avi"
        done = perdure("track", url, "-o", "streamed", "--json", at=place)
        missing = perdure("track", url.replace("walk", "gone"), "-o", "y", at=place)
        server.shutdown()
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.splitlines()[-1])["tracks"] == 2
    with av.open(str(place / "streamed/tracked.mp4")) as film:
        assert sum(1 for _ in film.decode(video=0)) == 40
    assert (missing.returncode, "404" in missing.stderr, (place / "y").exists()) == (2, True, False)


def test_help_tells_meaning_range_and_default_of_every_parameter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("TERM", "dumb")
    done = perdure("track", "--help", at=tmp_path)
    assert "--patience" in done.stdout
    assert "0 to 3600 s; default 1" in done.stdout
    assert "Detector background" in done.stdout


def test_the_regions_file_of_detect_holds_silhouettes(place: Path):
    from perdure.files.regions import read_regions

    perdure("detect", "walk.avi", "-o", "masks.jsonl", at=place)
    regions: Regions = read_regions(place / "masks.jsonl")[20]
    assert [mask.area > 50 for mask in regions.masks] == [True, True]
