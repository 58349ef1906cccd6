"""How quick the viewer is in a browser, for a long run of many: `python bench/viewer.py [--frames 10000] [--tracks 50]`.

A film is encoded and a run written (boxes, silhouettes, statuses, meetings); `perdure view` serves it, and Chromium
without a window opens it at once, while the server still reads the log. Measured in the browser, by its own clock:

first paint   from the navigation to the first frame on the screen with all its boxes
whole         from the navigation until the timeline and all events are there
seek          from a jump to a frame anywhere to that frame on the screen, boxes and all
scrub         the playhead dragged over the whole timeline and back, a move each 16 ms: how long the page let the screen
              wait between two frames of its own, and how many film frames were on the screen a second
play          film frames on the screen a second at the film's own rate
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import av
import numpy as np

from perdure.files.lines import to_line
from perdure.files.log import FORMAT, VERSION
from perdure.files.runs import RunFolder
from perdure.types import Mask
from perdure.types.frame import run_lengths

FPS = 25
SIZE = (26, 60)  # of a silhouette, px
SCRUB = """async () => {
    const canvas = document.querySelector("#timeline canvas"), box = canvas.getBoundingClientRect();
    const film = document.querySelector("canvas[data-frame]"), seen = new Set(), waits = [];
    const point = (kind, x) => canvas.dispatchEvent(new PointerEvent(kind, {
        bubbles: true, clientX: box.left + x, clientY: box.top + 8, offsetX: x, offsetY: 8, pointerId: 1, button: 0 }));
    canvas.setPointerCapture = () => {};
    let last = performance.now(), on = true;
    const watch = (now) => { waits.push(now - last); last = now; seen.add(film.dataset.frame); if (on) requestAnimationFrame(watch); };
    requestAnimationFrame(watch);
    const begin = performance.now(), steps = 360;
    point("pointerdown", 60);
    for (let k = 0; k <= steps; k++) {
        const there = k < steps / 2 ? k / (steps / 2) : 2 - k / (steps / 2);
        point("pointermove", 60 + there * (box.width - 90));
        await new Promise((go) => setTimeout(go, 16));
    }
    point("pointerup", 60);
    on = false;
    const seconds = (performance.now() - begin) / 1000;
    waits.sort((a, b) => a - b);
    return { worst: waits.at(-1), p95: waits[Math.floor(waits.length * 0.95)], stalls: waits.filter((one) => one > 100).length,
             shown: seen.size / seconds, seconds };
}"""
SEEK = """async (frame) => {
    const field = document.querySelector("input.frame"), film = document.querySelector("canvas[data-frame]");
    const begin = performance.now();
    field.value = String(frame);
    field.dispatchEvent(new Event("change"));
    while (film.dataset.frame !== String(frame) || !film.dataset.rows) await new Promise(requestAnimationFrame);
    return performance.now() - begin;
}"""
PLAY = """async (seconds) => {
    const film = document.querySelector("canvas[data-frame]"), seen = new Set();
    document.querySelector(".transport .primary").click();
    const begin = performance.now();
    while (performance.now() - begin < seconds * 1000) { await new Promise(requestAnimationFrame); seen.add(film.dataset.frame); }
    document.querySelector(".transport .primary").click();
    return seen.size / seconds;
}"""


def encode(path: Path, frames: int, width: int, height: int) -> None:
    """A film with a moving pattern on a textured ground, MPEG-4 with a key frame each ten seconds."""
    rng = np.random.default_rng(0)
    ground = rng.integers(70, 130, (height // 8, width // 8, 3)).repeat(8, 0).repeat(8, 1).astype(np.uint8)
    with av.open(str(path), "w") as film:
        stream = film.add_stream("mpeg4", rate=FPS)
        stream.width, stream.height, stream.pix_fmt, stream.bit_rate = width, height, "yuv420p", 4_000_000
        stream.codec_context.gop_size = 10 * FPS
        for k in range(frames):
            image = ground.copy()
            for one in range(12):
                x, y = (37 * one + 3 * k) % (width - 40), (53 * one + k) % (height - 80)
                image[y : y + 60, x : x + 26] = (40 + 15 * one, 200 - 12 * one, 90)
            for packet in stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")):
                film.mux(packet)
        for packet in stream.encode(None):
            film.mux(packet)


def write_log(folder: RunFolder, frames: int, tracks: int, width: int, height: int) -> None:
    """A log of everybody in every frame, half of the time hidden or in groups now and then."""
    down, across = np.ogrid[: SIZE[1], : SIZE[0]]
    oval = ((across - SIZE[0] / 2) / (SIZE[0] / 2)) ** 2 + ((down - SIZE[1] / 2) / (SIZE[1] / 2)) ** 2 < 1
    mask = {"size": [SIZE[1], SIZE[0]], "runs": run_lengths(Mask(0, 0, oval))}
    words = ("visible", "visible", "visible", "partly_occluded", "ambiguous", "occluded", "lost")
    rng = np.random.default_rng(1)
    phases = rng.integers(0, 400, tracks)
    with folder.log.open("w", encoding="utf-8") as log:
        log.write(to_line({"format": FORMAT, "version": VERSION}))
        for k in range(frames):
            rows: list[dict[str, Any]] = []
            for one in range(tracks):
                x, y = (37 * one + 3 * k) % (width - 40), (53 * one + k) % (height - 80)
                status = words[(k + int(phases[one])) // 60 % len(words)]
                row: dict[str, Any] = {"id": one + 1, "box": [x, y, x + SIZE[0], y + SIZE[1]], "status": status}
                rows.append(row | {"confidence": 0.9, "links": [one], "mask": {"x": x, "y": y, **mask}})
            value: dict[str, Any] = {"frame": k, "time": k / FPS, "rows": rows}
            if k % 20 == 0:
                pair = [k // 20 % tracks + 1, (k // 20 + 7) % tracks + 1]
                about = {"begin": k, "end": k, "ids": pair, "zone": "", "why": "drawn"}
                value["events"] = [{"kind": "merge", "confidence": 1.0, **about}]
                value["events"] += [{"kind": "resolved", "confidence": 0.5 + k % 100 / 200, **about}]
            log.write(to_line(value))


def measure(run: Path, frames: int, tracks: int, rounds: int) -> dict[str, float]:
    """Serve the run, open it, and use it."""
    from playwright.sync_api import sync_playwright

    begin = time.monotonic()
    code = "from perdure.cli import main; main()"
    server = subprocess.Popen(
        [sys.executable, "-c", code, "view", str(run), "--port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert server.stdout is not None
    address = re.search(r"http\S+", server.stdout.readline())
    if address is None:
        raise SystemExit("perdure view did not start")
    found = {"server ready, s": time.monotonic() - begin}
    try:
        with sync_playwright() as running:
            chromium = running.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
            page = chromium.new_page(viewport={"width": 1440, "height": 900}, bypass_csp=True)
            page.goto(address[0], wait_until="commit")
            whole = "performance.now() / 1000"
            page.wait_for_function(
                f"document.querySelector('canvas[data-frame]')?.dataset.rows === '{tracks}'",
                polling="raf",
                timeout=60000,
            )
            found["first paint, s"] = page.evaluate(whole)
            page.wait_for_function(
                f"document.querySelector('#standing').innerText.includes('{frames} frames')",
                polling="raf",
                timeout=120000,
            )
            found["whole, s"] = page.evaluate(whole)
            page.wait_for_timeout(2500)
            jumps = np.random.default_rng(2).integers(0, frames, rounds).tolist()
            waits = np.array([page.evaluate(SEEK, frame) for frame in jumps])
            found |= {"seek median, ms": float(np.median(waits)), "seek p95, ms": float(np.percentile(waits, 95))}
            scrub = page.evaluate(SCRUB)
            found |= {
                "scrub: longest wait, ms": scrub["worst"],
                "scrub: p95 wait, ms": scrub["p95"],
                "scrub: waits over 100 ms": scrub["stalls"],
                "scrub: film frames/s": scrub["shown"],
            }
            page.evaluate(SEEK, frames // 3)
            found["play at 1x, film frames/s"] = page.evaluate(PLAY, 8)
            heap = page.evaluate("performance.memory?.usedJSHeapSize ?? 0")
            found["page memory, MiB"] = heap / 2**20
            chromium.close()
        status = Path(f"/proc/{server.pid}/status")
        if status.exists():
            (kib,) = re.findall(r"VmHWM:\s+(\d+)", status.read_text())
            found["server memory, MiB"] = int(kib) / 1024
    finally:
        server.terminate()
        server.wait(20)
    return {name: round(value, 3) for name, value in found.items()}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=10000)
    parser.add_argument("--tracks", type=int, default=50)
    parser.add_argument("--size", type=int, nargs=2, default=(1280, 720), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--seeks", type=int, default=40)
    parser.add_argument("--keep", type=Path, help="make film and run here, and take those that are there")
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    if shutil.which("chromium") is None:
        raise SystemExit("there is no chromium; on Debian, apt-get install chromium")
    with tempfile.TemporaryDirectory() as temporary:
        place = chosen.keep or Path(temporary)
        run, film = place / "run", place / "film.mp4"
        width, height = chosen.size
        if not (run / "tracks.jsonl").exists():
            place.mkdir(parents=True, exist_ok=True)
            encode(film, chosen.frames, width, height)
            folder = RunFolder.create(run, overwrite=True)
            folder.write_about(
                {"source": str(film), "width": width, "height": height, "fps": FPS, "status": "done"}
            )
            write_log(folder, chosen.frames, chosen.tracks, width, height)
        found = measure(run, chosen.frames, chosen.tracks, chosen.seeks)
        log = (run / "tracks.jsonl").stat().st_size / 2**20
    about = {
        "frames": chosen.frames,
        "tracks": chosen.tracks,
        "width": width,
        "height": height,
        "log, MiB": round(log),
    }
    if chosen.json:
        print(json.dumps(about | found))
        return
    print("  ".join(f"{name} {value}" for name, value in about.items()))
    for name, value in found.items():
        print(f"{name:28}{value:10.2f}")


if __name__ == "__main__":
    main()
