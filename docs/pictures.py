"""Make the pictures of the README, of the example and of docs/viewer.md: `python docs/pictures.py` writes docs/images.

Those of the viewer need Chromium and Playwright; without them only demo.png and trails.png are made.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from site_pages import NOTEBOOK, code_of

from perdure.files.film import save_png

MOMENTS = (100, 160, 235, 300)  # frames of the demo film
IMAGES = Path(__file__).parent / "images"
PERDURE = [sys.executable, "-c", "from perdure.cli import main; main()"]


def main() -> None:
    """Run the example; track the demo film, lay four of its frames side by side, look at the run in the viewer."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-c", code_of(NOTEBOOK)], cwd=folder, check=True)
        shutil.move(Path(folder) / "trails.png", IMAGES / "trails.png")
        subprocess.run([*PERDURE, "demo", "-o", folder], check=True)
        with av.open(str(Path(folder) / "run/tracked.mp4")) as film:
            frames = enumerate(film.decode(video=0))
            shown = [frame.to_ndarray(format="rgb24") for index, frame in frames if index in MOMENTS]
        rows = [np.hstack(shown[:2]), np.hstack(shown[2:])]
        picture = cv2.resize(np.vstack(rows), None, fx=0.75, fy=0.75, interpolation=cv2.INTER_AREA)
        save_png(IMAGES / "demo.png", picture)
        chromium = shutil.which("chromium")
        if chromium is None:
            print("note: there is no chromium; the viewer's pictures are not made", file=sys.stderr)
            return
        photograph(Path(folder), chromium)


def photograph(demo: Path, chromium: str) -> None:
    """Serve the demo's run and save what the viewer shows of it."""
    from playwright.sync_api import sync_playwright

    command = [*PERDURE, "view", str(demo / "run"), "--truth", str(demo / "truth.txt"), "--port", "0"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    address = re.search(r"http\S+", server.stdout.readline())
    assert address is not None
    with sync_playwright() as running:
        browser = running.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for name, theme, (width, height), use in VIEWS:
            page = browser.new_page(viewport={"width": width, "height": height}, color_scheme=theme)
            page.goto(address[0])
            page.wait_for_selector("canvas[data-rows]:not([data-rows=''])")
            use(page)
            page.wait_for_timeout(1500)
            page.screenshot(path=IMAGES / name, type="jpeg", quality=86)
            page.close()
        browser.close()
    server.terminate()
    server.wait(20)


def doubts(page: Any) -> None:
    """The most doubtful event."""
    page.keyboard.press("n")


def beside(page: Any) -> None:
    """The truth beside the run, and a mistake with what may mend it."""
    page.get_by_label("Shown beside the run").select_option("truth")
    page.get_by_role("tab", name="Score").click()
    page.locator("#panel .item").first.click()


def zone(page: Any) -> None:
    """A zone round the kiosk."""
    page.get_by_label("Frame", exact=True).fill("140")
    page.keyboard.press("Enter")
    page.get_by_role("tab", name="Zones").click()
    page.get_by_role("button", name="Draw a zone").click()
    film = page.locator("canvas[data-frame]").bounding_box()
    high, wide = film["height"], film["height"] * 4 / 3
    left = film["x"] + (film["width"] - wide) / 2
    for x, y in ((0.15, 0.3), (0.325, 0.3), (0.325, 0.62), (0.15, 0.62)):
        page.mouse.click(left + wide * x, film["y"] + high * y)
    page.keyboard.press("Enter")
    page.get_by_label("Name").fill("kiosk")
    page.get_by_label("Kind").select_option("occlusion")


VIEWS: tuple[tuple[str, str, tuple[int, int], Callable[[Any], None]], ...] = (
    ("viewer.jpg", "dark", (1280, 720), doubts),
    ("viewer-score.jpg", "light", (1280, 720), beside),
    ("viewer-zones.jpg", "dark", (1280, 720), zone),
)


if __name__ == "__main__":
    main()
