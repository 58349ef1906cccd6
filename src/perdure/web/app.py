"""The application: addresses, and what stands behind each.

    GET  /                                   the page
    GET  /static/NAME                        its parts, those of this package and no others
    GET  /api/session                        the runs, what is known of them, and whether this caller may write
    GET  /api/runs/N/state|frames|tracks|events|rows|shapes|explain|zones|calibration
    GET  /api/runs/N/pictures/K.jpg          frame K of the source; with ?near, one before it that is had at once
    GET  /api/runs/N/truth/tracks|rows|score
    POST /api/runs/N/corrections             a correction, "undo" or "redo"
    PUT  /api/runs/N/zones|calibration       POST …/calibration only checks

Runs are named by their numbers, files never: no address leads to a path.
"""

from __future__ import annotations

import contextlib
import hmac
import json
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

import anyio
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from perdure import __version__
from perdure.errors import ParameterError, PerdureError
from perdure.files.lines import why_not_json
from perdure.web import place
from perdure.web.guard import TOKEN, App, Guard
from perdure.web.run import OpenRun
from perdure.web.truths import OpenTruth

Json = Any
T = TypeVar("T")
_MOST_ROWS, _MOST_SHAPES = 1024, 64  # frames of one request
_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}


@dataclass(frozen=True)
class Shown:
    """What is served: runs, the truth of each or None, and where drawn zones and calibrations are kept, if said."""

    runs: tuple[OpenRun, ...]
    truths: tuple[OpenTruth | None, ...]
    zones: Path | None = None
    calibration: Path | None = None


def application(shown: Shown, token: str) -> App:
    """Return the guarded application; `token` is what writers must bring."""
    pages = _Pages(shown, token, _static())
    app = Starlette(
        routes=pages.routes(),
        exception_handlers={PerdureError: _mistake, HTTPException: _refused},
        lifespan=pages.lifespan,
    )
    return Guard(GZipMiddleware(app, minimum_size=2048, compresslevel=1), token)


async def _mistake(request: Request, error: Exception) -> Response:
    """The caller's mistake, in words."""
    return JSONResponse({"error": str(error)}, 422)


async def _refused(request: Request, error: Exception) -> Response:
    """What is not there, or may not be."""
    status = error.status_code if isinstance(error, HTTPException) else 500
    words = error.detail if isinstance(error, HTTPException) else ""
    return JSONResponse({"error": words}, status)


def _static() -> dict[str, tuple[bytes, str]]:
    """The page and its parts by name: what lies in the package's folder, read once."""
    folder = resources.files("perdure.web") / "static"
    return {
        one.name: (one.read_bytes(), _TYPES[Path(one.name).suffix])
        for one in folder.iterdir()
        if Path(one.name).suffix in _TYPES
    }


def _number(request: Request, name: str, low: int, high: int) -> int:
    """A whole number of the query; ParameterError names it."""
    text = request.query_params.get(name, "")
    if not (text.isascii() and text.isdigit() and len(text) < 16 and low <= int(text) <= high):
        raise ParameterError(f"{name} = {text[:20]!r} must be a whole number from {low} to {high}")
    return int(text)


def _span(request: Request, most: int) -> tuple[int, int]:
    """The frames asked for, the end not included."""
    begin = _number(request, "from", 0, 2**53)
    return begin, _number(request, "to", begin, begin + most)


async def _body(request: Request) -> Json:
    """The JSON value of a body; ParameterError if it is none."""
    raw = await request.body()
    try:
        return json.loads(raw)
    except (ValueError, RecursionError) as error:
        raise ParameterError(f"the request is not JSON ({why_not_json(error)})") from None


class _Pages:
    """The answers."""

    def __init__(self, shown: Shown, token: str, static: dict[str, tuple[bytes, str]]) -> None:
        self._shown, self._token, self._static = shown, token, static
        self._decoding: dict[int, anyio.Lock] = {}

    def routes(self) -> list[Route]:
        """Every address."""
        asked: dict[str, Callable[[OpenRun], Json]] = {
            "state": OpenRun.state,
            "frames": OpenRun.frames,
            "tracks": OpenRun.tracks,
            "events": OpenRun.events,
        }
        told = [Route(f"/api/runs/{{n:int}}/{name}", self._of_run(ask)) for name, ask in asked.items()]
        run = "/api/runs/{n:int}"
        return [
            Route("/", self.page),
            Route("/static/{name}", self.part),
            Route("/api/session", self.session),
            *told,
            Route(f"{run}/rows", self.rows),
            Route(f"{run}/shapes", self.shapes),
            Route(f"{run}/explain", self.explain),
            Route(f"{run}/pictures/{{k:int}}.jpg", self.picture),
            Route(f"{run}/truth/tracks", self.truth_tracks),
            Route(f"{run}/truth/rows", self.truth_rows),
            Route(f"{run}/truth/score", self.score),
            Route(f"{run}/corrections", self.correct, methods=["POST"]),
            Route(f"{run}/zones", self.zones, methods=["GET", "PUT"]),
            Route(f"{run}/calibration", self.calibration, methods=["GET", "PUT", "POST"]),
        ]

    @contextlib.asynccontextmanager
    async def lifespan(self, app: Starlette) -> AsyncIterator[None]:
        """Read the logs ahead while the page is being opened; at the end write what is to be written."""
        async with anyio.create_task_group() as tasks:
            for run in self._shown.runs:
                tasks.start_soon(_read_ahead, run)
                tasks.start_soon(run_in_threadpool, run.pictures.why_not)
            yield
            tasks.cancel_scope.cancel()
        for run in self._shown.runs:
            await run_in_threadpool(run.close)

    async def page(self, request: Request) -> Response:
        """The page itself."""
        return self._file("index.html")

    async def part(self, request: Request) -> Response:
        """A part of the page."""
        return self._file(request.path_params["name"])

    async def session(self, request: Request) -> Response:
        """What is shown, and whether the caller may write."""
        brought = request.headers.get(TOKEN, "")
        runs = [await run_in_threadpool(self._about, n) for n in range(len(self._shown.runs))]
        return JSONResponse(
            {
                "version": __version__,
                "writable": hmac.compare_digest(brought.encode(), self._token.encode()),
                "runs": runs,
                "zone_kinds": place.kinds(),
            }
        )

    async def rows(self, request: Request) -> Response:
        """Settled rows of some frames, packed."""
        run, span = self._run(request), _span(request, _MOST_ROWS)
        return _packed(await run_in_threadpool(run.rows, *span))

    async def shapes(self, request: Request) -> Response:
        """Silhouettes and contours of some frames."""
        run, span = self._run(request), _span(request, _MOST_SHAPES)
        return JSONResponse(await run_in_threadpool(run.shapes, *span))

    async def explain(self, request: Request) -> Response:
        """Why a row has its id."""
        identity, frame = _number(request, "id", 1, 2**53), _number(request, "frame", 0, 2**53)
        return JSONResponse(await run_in_threadpool(self._run(request).explain, identity, frame))

    async def picture(self, request: Request) -> Response:
        """A frame of the source, or with `?near` one before it that can be had at once; `X-Frame` says which.

        Of those who wait, one who has gone away is not decoded for.
        """
        n, index = request.path_params["n"], request.path_params["k"]
        pictures, near = self._run(request).pictures, "near" in request.query_params
        if near:
            index = await run_in_threadpool(pictures.near, index)
        found = pictures.kept(index)
        if found is None:
            async with self._decoding.setdefault(n, anyio.Lock()):
                if await request.is_disconnected():
                    return Response(status_code=499)
                try:
                    found = await run_in_threadpool(pictures.jpeg, index)
                except PerdureError as error:
                    return JSONResponse({"error": str(error)}, 404)
        kept = "no-store" if near else "private, max-age=600"
        return Response(found, media_type="image/jpeg", headers={"cache-control": kept, "x-frame": str(index)})

    async def truth_tracks(self, request: Request) -> Response:
        """Where the objects of the truth are."""
        return JSONResponse(self._truth(request).tracks())

    async def truth_rows(self, request: Request) -> Response:
        """Rows of the truth, packed."""
        return _packed(self._truth(request).rows(*_span(request, _MOST_ROWS)))

    async def score(self, request: Request) -> Response:
        """How the run scores as it is corrected now."""
        run, truth = self._run(request), self._truth(request)
        edition = (await run_in_threadpool(run.state))["edition"]
        return JSONResponse(await run_in_threadpool(truth.score, run.folder.path, edition))

    async def correct(self, request: Request) -> Response:
        """Take up a correction."""
        run, value = self._run(request), await _body(request)
        return JSONResponse(await run_in_threadpool(run.correct, value))

    async def zones(self, request: Request) -> Response:
        """The zones that are drawn, or new ones to be saved."""
        run = self._run(request)
        path = place.zones_file(run, self._shown.zones)
        if request.method == "PUT":
            return JSONResponse(await run_in_threadpool(place.save_drawn, run, path, await _body(request)))
        return JSONResponse(await run_in_threadpool(place.read_drawn, run, path))

    async def calibration(self, request: Request) -> Response:
        """The ground plane that is drawn, or a new one to be tried or saved."""
        run = self._run(request)
        path = place.calibration_file(run, self._shown.calibration)
        if request.method == "GET":
            return JSONResponse(await run_in_threadpool(place.read_plane, run, path))
        value = await _body(request)
        if request.method == "POST":
            return JSONResponse(await run_in_threadpool(place.check_plane, run, value))
        return JSONResponse(await run_in_threadpool(place.save_plane, run, path, value))

    def _of_run(self, ask: Callable[[OpenRun], Json]) -> Callable[[Request], Any]:
        async def answer(request: Request) -> Response:
            return JSONResponse(await run_in_threadpool(ask, self._run(request)))

        return answer

    def _file(self, name: str) -> Response:
        if name not in self._static:
            return JSONResponse({"error": "there is no such thing"}, 404)
        content, kind = self._static[name]
        return Response(content, media_type=kind, headers={"cache-control": "no-cache"})

    def _run(self, request: Request) -> OpenRun:
        runs: tuple[OpenRun, ...] = self._shown.runs
        return _one_of(runs, int(request.path_params["n"]), "run")

    def _truth(self, request: Request) -> OpenTruth:
        truth = _one_of(self._shown.truths, int(request.path_params["n"]), "run")
        if truth is None:
            raise ParameterError("no truth was given; name it behind --truth")
        return truth

    def _about(self, n: int) -> dict[str, Json]:
        """What the page must know of a run before anything else."""
        run, truth = self._shown.runs[n], self._shown.truths[n]
        about = run.about
        named = {
            key: str(about[key].get("name", ""))
            for key in ("tracker", "detector")
            if isinstance(about.get(key), dict)
        }
        return {
            "name": run.folder.path.resolve().name,
            "path": str(run.folder.path),
            "source": str(about.get("source", "")),
            "width": run.size[0],
            "height": run.size[1],
            "fps": run.fps,
            **named,
            "no_pictures": run.pictures.why_not(),
            "report_confidence": run.report_confidence(),
            "truth": "" if truth is None else truth.name,
        }


async def _read_ahead(run: OpenRun) -> None:
    """Read a log to its end, a slice at a time, so that others are heard in between."""
    while True:
        await run_in_threadpool(run.refresh)
        await anyio.sleep(0.005)
        if run.ledger.complete:
            return


def _one_of(several: Sequence[T], n: int, what: str) -> T:
    if not 0 <= n < len(several):
        raise ParameterError(f"there is no {what} {n}; there are {len(several)}, from 0")
    return several[n]


def _packed(rows: bytes) -> Response:
    return Response(rows, media_type="application/octet-stream")
