"""Live sources that come back, folders that roll, events posted, a page of health."""

from __future__ import annotations

import json
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from http.server import BaseHTTPRequestHandler, HTTPServer
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from rtsp import Camera
from typer.testing import CliRunner

from perdure.cli.commands import app
from perdure.errors import DamagedVideo, OutputError, ParameterError, VideoError
from perdure.files.clock import Clock
from perdure.files.live_source import LiveSource, Patience, open_live
from perdure.files.passing import Passing, Shot, passing
from perdure.files.rolling import Rolling, check_place
from perdure.files.runs import Reporting, RunFolder
from perdure.files.span import read_span, seconds_of
from perdure.files.webhook import Webhook
from perdure.types import Event, Report, Tracks
from perdure.web.health import Health, page


def picture(value: int = 90, size: tuple[int, int] = (24, 32)) -> np.ndarray:
    return np.full((*size, 3), value, np.uint8)


def connection(shots: Iterator[Shot]) -> Passing:
    return passing("yard", "rtsp://yard", 10.0, read_span(None, None, 1), shots, Clock(10.0, []), [])


class Yard:
    """A source whose connections are scripts: each gives some shots and ends, or cannot be reached."""

    def __init__(self, *scripts: list[Shot] | str) -> None:
        self.scripts = list(scripts)

    def __call__(self) -> Passing:
        script = self.scripts.pop(0) if self.scripts else "nobody is there"
        if isinstance(script, str):
            raise VideoError(script)
        return connection(iter(script))


def shots(count: int, first: float = 0.0, value: int = 90) -> list[Shot]:
    return [Shot(picture(value), first + k / 10) for k in range(count)]


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("perdure.files.live_source._SOONEST", 0.01)


def test_a_connection_that_is_lost_comes_back_and_the_gap_is_told():
    source = LiveSource(Yard(shots(3), "no route", shots(3, first=500.0)), Patience(give_up=0.2, max_latency=60))
    frames, told = [], []

    def follow() -> None:
        for frame in source:
            frames.append(frame)
            told.append(source.happened())

    with pytest.raises(DamagedVideo, match=r"the stream ended; not reached again for 0\.2 s"):
        follow()
    assert [one.index for one in frames] == list(range(6))
    assert all(a.time < b.time for a, b in pairwise(frames)), "though its own clock began anew"
    gaps = [event for some in told for event in some]
    assert [(one.kind, one.begin) for one in gaps] == [("gap", 3)]
    assert gaps[0].why.startswith("the stream ended; back after 0.")
    assert (source.counts.connections, source.counts.received) == (2, 6)
    assert source.counts.failures >= 1


def test_who_is_too_slow_gets_what_is_new_and_the_rest_is_counted():
    now = [0.0]
    source = LiveSource(Yard(shots(50)), Patience(max_latency=0.35, give_up=0.01), clock=lambda: now[0])
    source._begun = 0.0
    for k in range(50):
        now[0] = k / 10
        source._keep(picture(), k / 10, now[0])
    assert source.waiting == 4, "0.35 s at 10 frames a second"
    assert source.counts.dropped == 46
    taken = source._take()
    assert taken is not None
    assert taken.number == 46


def test_frames_that_nobody_takes_do_not_pile_up():
    source = LiveSource(Yard(shots(1)), Patience(max_latency=60.0))
    for k in range(2000):
        source._keep(picture(), k / 1000, k / 1e6)
    assert source.waiting <= 256


def test_pictures_of_another_size_are_scaled_to_the_first():
    source = LiveSource(Yard(shots(2), [Shot(picture(200, (48, 64)), 0.0)]), Patience(give_up=0.1, max_latency=60))
    sizes = []
    with pytest.raises(DamagedVideo):
        sizes += [frame.image.shape for frame in source]
    source.close()
    assert "they are scaled" in source.warnings[0]


def test_a_source_that_is_not_there_yet_is_waited_for():
    camera = Camera(lambda k: picture(size=(48, 64)))
    port = camera.port
    camera.stop()
    on = threading.Timer(0.5, lambda: camera.start(port))
    on.start()
    source = open_live(camera.url, wait=True)
    assert (source.width, source.height) == (64, 48)
    source.close()
    camera.stop()
    with pytest.raises(VideoError, match="cannot be reached"):
        open_live("rtsp://127.0.0.1:9/none", patience=Patience(give_up=0.05), wait=True)


def test_what_is_neither_a_camera_nor_a_url_is_refused():
    with pytest.raises(ParameterError, match="`perdure track` follows files"):
        open_live("film.mp4")
    with pytest.raises(VideoError, match="cannot be reached"):
        open_live("rtsp://127.0.0.1:9/none")


@pytest.mark.parametrize(
    ("text", "seconds"), [("90", 90), ("1:30", 90), ("15m", 900), ("1h", 3600), ("1:00:00", 3600), ("0", 0)]
)
def test_a_length_of_time_is_read_as_people_write_it(text: str, seconds: float):
    assert seconds_of(text, "roll") == seconds


@pytest.mark.parametrize("text", ["", "h", "1:2:3h", "-3", "soon", "1e99"])
def test_what_is_no_length_of_time_is_refused(text: str):
    with pytest.raises(ParameterError, match="roll = "):
        seconds_of(text, "roll")


# Folders ------------------------------------------------------------------------------------------------------------


def row(frame: int, one: int = 1) -> Report:
    rows = Tracks.of(frames=frame, times=frame / 10, ids=[one], boxes=[[10, 10, 20, 30]])
    return Report(rows, events=(Event("entered", frame, frame, (one,)),) if frame == 0 else ())


def test_a_folder_begins_on_the_hour_and_the_last_ones_are_kept(tmp_path: Path):
    now = [datetime(2026, 3, 1, 9, 58, tzinfo=UTC)]
    rolling = Rolling(tmp_path / "yard", {"width": 64, "height": 48}, Reporting(), 3600.0, 2, lambda: now[0])
    for k in range(200):
        rolling.append(k, k / 10, row(k))
        now[0] += timedelta(minutes=1)
    rolling.close()
    assert rolling.failed == []
    names = sorted(one.name for one in (tmp_path / "yard").iterdir())
    assert names[-1] == "2026-03-01T13-00-00"
    assert len(names) == 2
    about = RunFolder(tmp_path / "yard" / names[-1]).read_about()
    assert (about["status"], about["frames"], about["tracks"]) == ("done", 18, 1)
    assert about["live"]["began"].startswith("2026-03-01T13:00")
    frames = [
        int(line.split(",")[0]) for line in (tmp_path / "yard" / names[-1] / "tracks.txt").read_text().splitlines()
    ]
    assert frames == list(range(183, 201))


def test_folders_that_are_not_ours_are_never_deleted(tmp_path: Path):
    (tmp_path / "yard/2020-01-01T00-00-00").mkdir(parents=True)
    (tmp_path / "yard/2020-01-01T00-00-00/run.json").write_text('{"status": "done"}')
    now = [datetime(2026, 3, 1, 9, 30, tzinfo=UTC)]
    rolling = Rolling(tmp_path / "yard", {}, Reporting(), 3600.0, 1, lambda: now[0])
    for k in range(4):
        rolling.append(k, k / 10, row(k))
        now[0] += timedelta(hours=1)
    rolling.close()
    assert (tmp_path / "yard/2020-01-01T00-00-00/run.json").exists()


def test_a_place_that_holds_something_else_is_refused(tmp_path: Path):
    (tmp_path / "file").write_text("")
    (tmp_path / "run").mkdir()
    (tmp_path / "run/run.json").write_text("{}")
    with pytest.raises(OutputError, match="is a file"):
        check_place(tmp_path / "file")
    with pytest.raises(OutputError, match="is a run folder"):
        check_place(tmp_path / "run")


# Telling ------------------------------------------------------------------------------------------------------------


class Listener:
    """An address that takes what is posted; the first `refused` requests are not answered as they should be."""

    def __init__(self, refused: int = 0) -> None:
        self.heard: list[dict] = []
        left = [refused]
        heard = self.heard

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                left[0] -= 1
                self.send_response(500 if left[0] >= 0 else 200)
                self.end_headers()
                if left[0] < 0:
                    heard.append(json.loads(body))

            def log_message(self, format: str, *arguments: object) -> None:
                pass

        self.server = HTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_address[1]}/"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def close(self) -> None:
        self.server.shutdown()
        self.server.server_close()


def test_events_are_posted_in_order_and_tried_again():
    there = Listener(refused=1)
    hook = Webhook(there.url, pause=0.01)
    for k in range(5):
        hook.post({"kind": "entered", "begin": k})
    hook.close()
    there.close()
    assert [one["begin"] for one in there.heard] == list(range(5))
    assert (hook.sent, hook.dropped) == (5, 0)


def test_an_address_that_does_not_answer_holds_nobody_up():
    hook = Webhook("http://127.0.0.1:9/", pause=0.01)
    begun = time.monotonic()
    for k in range(1500):
        hook.post({"begin": k})
    assert time.monotonic() - begun < 1.0
    assert hook.dropped >= 400
    hook.close(timeout=0.1)
    assert hook.why


@pytest.mark.parametrize("url", ["ftp://there/", "file:///etc/passwd", "there", "http://", "http://[::1"])
def test_an_address_that_is_none_of_the_web_is_refused(url: str):
    with pytest.raises(ParameterError, match="http:// or https://"):
        Webhook(url)


def test_the_page_tells_how_it_is_on_this_machine_alone():
    health = Health(
        0, lambda: {"source": "<yard>", "state": "running", "why": "", "latency_ms": 12.5, "dropped": 3}
    )
    try:
        with urllib.request.urlopen(health.url) as answer:
            text = answer.read().decode()
        with urllib.request.urlopen(f"{health.url}health.json") as answer:
            value = json.loads(answer.read())
        foreign = urllib.request.Request(health.url, headers={"Host": "evil.example"})
        with pytest.raises(urllib.error.HTTPError, match="403") as refused:
            urllib.request.urlopen(foreign)
        refused.value.close()
        with pytest.raises(urllib.error.HTTPError, match="404") as missing:
            urllib.request.urlopen(f"{health.url}etc/passwd")
        missing.value.close()
        with pytest.raises(OutputError, match="cannot be served at port"):
            Health(int(health.url.rstrip("/").rpartition(":")[2]), dict)
    finally:
        health.close()
    assert "&lt;yard&gt;" in text
    assert "12.5" in text
    assert value["dropped"] == 3
    assert 'class="bad"' in page({"state": "waiting for the source", "why": "no route"})


@pytest.mark.slow
def test_a_camera_that_is_gone_for_a_while_is_followed_on(tmp_path: Path):
    """An RTSP camera on this machine shows one who walks; it is cut off, and comes back: one id, and a gap in the log."""
    floor = np.random.default_rng(0).integers(60, 120, (96, 160, 3), np.uint8)

    def draw(k: int) -> np.ndarray:
        image = floor.copy()
        x = (k - 25) // 2
        if 0 < x < 150:
            image[30:60, x : x + 12] = (220, 40, 40)
        return image

    camera, there = Camera(draw), Listener()
    port = camera.port
    off, on = threading.Timer(7.0, camera.stop), threading.Timer(7.4, lambda: camera.start(port))
    off.start()
    on.start()
    words = [
        "--for",
        "12",
        "--roll",
        "0",
        "--patience",
        "8",
        "--events",
        "-",
        "--webhook",
        there.url,
        "--health",
        "0",
    ]
    done = CliRunner().invoke(app, ["live", camera.url, "-o", str(tmp_path / "yard"), *words])
    camera.stop()
    there.close()
    assert done.exit_code == 0, f"{done.exception} {done.stderr}"
    told = [json.loads(line) for line in done.stdout.splitlines()]
    kinds = [one["kind"] for one in told]
    assert kinds.count("entered") == 1
    assert kinds.count("gap") == 1
    assert [one["kind"] for one in there.heard] == kinds
    (run,) = (tmp_path / "yard").iterdir()
    events = (run / "events.csv").read_text()
    assert "gap," in events
    assert "back after" in events
    about = RunFolder(run).read_about()
    assert about["status"] == "done"
    assert about["tracks"] == 1
    gap = next(one["begin"] for one in told if one["kind"] == "gap")
    frames = [int(line.split(",")[0]) for line in (run / "tracks.txt").read_text().splitlines()]
    assert frames[0] < gap < frames[-1], "the walker has its id before and after"
    assert "2 connections" in done.stderr
