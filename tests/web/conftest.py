"""A small run to look at, the viewer that serves it, and a browser where there is one."""

from __future__ import annotations

import json
import shutil
import socket
import threading
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from perdure.files.film import save_png
from perdure.files.log import RunLog
from perdure.files.runs import Reporting, RunFolder
from perdure.types import Event, Explanation, Mask, Report, Tracks

FILM, WIDTH, HEIGHT, FPS = 40, 160, 120, 10.0
CROSSING = 20  # frame in which the tracker exchanges 1 and 2


def true_boxes(k: int) -> dict[int, tuple[int, int, int, int]]:
    """Two who walk towards each other and past, and one who stands."""
    return {1: (10 + 3 * k, 40, 24 + 3 * k, 80), 2: (130 - 3 * k, 44, 144 - 3 * k, 84), 3: (70, 10, 80, 36)}


def said_ids(k: int) -> dict[int, int]:
    """Which id the tracker says for each of the truth: the first two exchanged after they met; 3 seen from frame 15."""
    pair = {1: 1, 2: 2} if k < CROSSING else {1: 2, 2: 1}
    return pair if k < 15 else pair | {3: 3}


def picture(k: int) -> np.ndarray:
    """Frame k: its number in grey, and people in colours."""
    image = np.full((HEIGHT, WIDTH, 3), 40 + k, np.uint8)
    for identity, (x1, y1, x2, y2) in true_boxes(k).items():
        image[y1:y2, max(0, x1) : x2] = ((200, 60, 60), (60, 200, 60), (60, 60, 200))[identity - 1]
    return image


def report(k: int) -> Report:
    """What the tracker says in frame k."""
    boxes, names = true_boxes(k), said_ids(k)
    masks = [Mask.of_image(np.ones((y2 - y1, x2 - x1), bool), y1, x1) for x1, y1, x2, y2 in map(boxes.get, names)]
    rows = Tracks.of(
        frames=k,
        times=k / FPS,
        ids=list(names.values()),
        boxes=[boxes[one] for one in names],
        masks=masks,
        confidence=[0.9] * len(names),
    )
    events = {
        0: (Event("entered", 0, 0, (1,)), Event("entered", 0, 0, (2,))),
        18: (Event("merge", 18, 18, (1, 2)),),
        CROSSING: (
            Event("split", 20, 20, (1, 2)),
            Event("resolved", 20, 20, (1,), confidence=0.6, why="rule b: colours +0.02 (met 2)"),
        ),
    }
    reason = Explanation(
        1, "highest score", {"score": 0.7, "link:area": 0.8, "global:area": 0.7, "weight:area": 1.0}
    )
    return Report(rows, events=events.get(k, ()), explanations=(reason,))


def write_run(place: Path, film: Path, frames: int = FILM, status: str = "done") -> RunFolder:
    """A run folder over a folder of pictures."""
    folder = RunFolder.create(place, overwrite=False)
    about = {"source": str(film), "width": WIDTH, "height": HEIGHT, "fps": FPS, "window": {"fps": FPS}}
    folder.write_about({**about, "tracker": {"name": "drawn"}, "status": status, "frames": frames})
    with RunLog(folder.log) as log:
        for k in range(frames):
            log.append(k, k / FPS, report(k))
    folder.write_results(Reporting())
    return folder


@pytest.fixture(scope="session")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("film")
    for k in range(FILM):
        save_png(folder / f"{k:04d}.png", picture(k))
    return folder


@pytest.fixture(scope="session")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("truth") / "gt.txt"
    path.write_text(
        "".join(
            f"{k + 1},{one},{x1 + 1},{y1 + 1},{x2 - x1},{y2 - y1},1,-1,-1,-1\n"
            for k in range(FILM)
            for one, (x1, y1, x2, y2) in true_boxes(k).items()
        )
    )
    return path


@pytest.fixture
def run(tmp_path: Path, film: Path) -> RunFolder:
    return write_run(tmp_path / "run", film)


@dataclass(frozen=True)
class Answer:
    """What came back."""

    status: int
    body: bytes
    headers: dict[str, str]

    @property
    def value(self) -> Any:
        return json.loads(self.body)


@dataclass(frozen=True)
class Viewer:
    """A viewer that answers at a port."""

    port: int
    token: str

    @property
    def page(self) -> str:
        return f"http://127.0.0.1:{self.port}/#token={self.token}"

    def ask(self, path: str, method: str = "GET", body: Any = None, **headers: str) -> Answer:
        """Send a request with the token; `headers` with underlines for strokes win, and '' leaves one out."""
        data = body if isinstance(body, bytes) else None if body is None else json.dumps(body).encode()
        named = {"x-perdure-token": self.token} | {k.replace("_", "-"): v for k, v in headers.items()}
        asked = urllib.request.Request(
            f"http://127.0.0.1:{self.port}{path}", data, {k: v for k, v in named.items() if v}, method=method
        )
        try:
            with urllib.request.urlopen(asked, timeout=20) as answer:
                return Answer(answer.status, answer.read(), {k.lower(): v for k, v in answer.headers.items()})
        except urllib.error.HTTPError as error:
            with error:
                return Answer(error.code, error.read(), {k.lower(): v for k, v in error.headers.items()})

    def correct(self, **line: Any) -> Answer:
        return self.ask("/api/runs/0/corrections", "POST", line)


@pytest.fixture(scope="module")
def serve() -> Iterator[Callable[..., Viewer]]:
    """Serve run folders until the tests of a file end."""
    uvicorn = pytest.importorskip("uvicorn", reason="the viewer's extra is not installed")
    from perdure.web.app import Shown, application
    from perdure.web.run import OpenRun
    from perdure.web.truths import OpenTruth

    servers: list[tuple[Any, threading.Thread, socket.socket]] = []

    def started(*folders: RunFolder, truth: Path | None = None, **files: Path) -> Viewer:
        truths = tuple(OpenTruth(truth) if truth else None for _ in folders)
        shown = Shown(tuple(OpenRun(one) for one in folders), truths, **files)
        listening = socket.create_server(("127.0.0.1", 0))
        settings = uvicorn.Config(
            application(shown, "secret"), log_level="error", lifespan="on", ws="none", timeout_graceful_shutdown=1
        )
        server = uvicorn.Server(settings)
        thread = threading.Thread(target=server.run, args=([listening],), daemon=True)
        thread.start()

        servers.append((server, thread, listening))
        viewer = Viewer(listening.getsockname()[1], "secret")
        while not viewer.ask("/api/runs/0/state").value["complete"]:
            pass
        return viewer

    yield started
    for server, _, _ in servers:
        server.should_exit = True
    for _, thread, listening in servers:
        thread.join(10)
        listening.close()


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Debian's Chromium without a window."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    place = shutil.which("chromium")
    if place is None:
        pytest.skip("there is no chromium; on Debian, apt-get install chromium")
    with playwright.sync_playwright() as running:
        chromium = running.chromium.launch(executable_path=place, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture
def open_page(browser: Any) -> Iterator[Callable[..., Any]]:
    """Open a viewer's page; the test fails if the page logs an error."""
    contexts, wrongs = [], []

    def opened(viewer: Viewer, address: str | None = None, **options: Any) -> Any:
        context = browser.new_context(viewport={"width": 1280, "height": 720}, **options)
        contexts.append(context)
        context.set_default_timeout(6000)
        page = context.new_page()
        page.on("pageerror", lambda error: wrongs.append(str(error)))
        page.on("console", lambda told: wrongs.append(told.text) if told.type == "error" else None)
        page.wrongs = wrongs
        page.goto(address or viewer.page)
        page.wait_for_selector("canvas[data-rows]:not([data-rows=''])")
        return page

    yield opened
    for context in contexts:
        context.close()
    assert not wrongs
