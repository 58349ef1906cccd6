"""How many clicks it takes to repair a run in the viewer, and how it scores then.

    python bench/repair.py RUN --truth TRUTH [--json]

The run is copied, served, and repaired in Chromium by clicks, each counted. The reviewer goes through the identity faults
that the Score panel lists, worst first: one click to look, one to mend. The script has no eyes: it clicks the proposed
repairs one after the other until one lowers identity switches or raises IDF1, and undoes the others; these clicks count,
too. `told` says of each fault whether a doubt, which needs no truth, is about the same ids within 25 frames of it.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

FAULTS = ("exchange", "switch", "resolution")


class Reviewer:
    """Somebody at the page, whose clicks are counted."""

    def __init__(self, page: Any) -> None:
        self.page, self.clicks = page, 0

    def click(self, place: Any) -> None:
        """Click, and wait until the page has taken it in."""
        self.clicks += 1
        place.click()
        self.settle()

    def settle(self) -> None:
        """Wait until nothing is on its way any more."""
        self.page.wait_for_timeout(400)

    def score(self) -> dict[str, Any]:
        """Return figures and mistakes as the viewer gives them."""
        found: dict[str, Any] = self.page.evaluate("fetch('/api/runs/0/truth/score').then((one) => one.json())")
        return found

    def faults(self) -> list[dict[str, Any]]:
        """The identity faults that are left."""
        return [one for one in self.score()["mistakes"] if one["kind"] in FAULTS]

    def worth(self) -> tuple[int, float]:
        """How well it stands: what rises is better."""
        figures = self.score()["figures"]
        return -figures["IDSW"], round(figures["IDF1"], 6)

    def told(self) -> int:
        """Of how many identity faults a doubt tells."""
        page = self.page.evaluate("fetch('/api/runs/0/events').then((one) => one.json())")
        doubts = [one for one in page["doubts"] if one["doubtful"]]
        return sum(
            any(
                set(one["ids"]) & set(fault["ids"]) and one["begin"] - 25 <= fault["begin"] <= one["end"] + 25
                for one in doubts
            )
            for fault in self.faults()
        )


def mend(one: Reviewer) -> None:
    """Mend what the Score panel lists, until it lists nothing that has not been looked at."""
    one.click(one.page.get_by_role("tab", name="Score"))
    one.page.locator(".scores").wait_for()
    seen: set[str] = set()
    while True:
        items = one.page.locator("#panel .item")
        texts = items.all_inner_texts()
        fresh = [k for k, text in enumerate(texts) if text not in seen]
        if not fresh:
            return
        seen.add(texts[fresh[0]])
        before = one.worth()
        one.click(items.nth(fresh[0]))
        for k in reversed(range(one.page.locator(".mend").count())):  # the shortest first
            one.click(one.page.locator(".mend").nth(k))
            if one.worth() > before:
                break
            one.click(one.page.locator("#undo"))
            one.page.locator(".mend").first.wait_for()


def repair(run: Path, truth: Path) -> dict[str, Any]:
    """Repair a copy of a run, and return what it took and what it gave."""
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary) / "run"
        shutil.copytree(run, place)
        (place / "corrections.jsonl").unlink(missing_ok=True)
        code = "from perdure.cli import main; main()"
        command = [sys.executable, "-c", code, "view", str(place), "--truth", str(truth), "--port", "0"]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        assert server.stdout is not None
        address = re.search(r"http\S+", server.stdout.readline())
        if address is None:
            raise SystemExit("perdure view did not start")
        try:
            with sync_playwright() as running:
                chromium = running.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
                page = chromium.new_page(viewport={"width": 1440, "height": 900}, bypass_csp=True)
                page.goto(address[0])
                page.wait_for_selector("canvas[data-rows]:not([data-rows=''])")
                one = Reviewer(page)
                before = one.score()["figures"]
                faults, told = len(one.faults()), one.told()
                mend(one)
                after, left = one.score()["figures"], len(one.faults())
                chromium.close()
        finally:
            server.terminate()
            server.wait(20)
        lines = (
            (place / "corrections.jsonl").read_text().splitlines()[1:]
            if (place / "corrections.jsonl").exists()
            else []
        )
        done = [json.loads(line)["do"] for line in lines]
    return {
        "clicks": one.clicks,
        "corrections": {kind: done.count(kind) for kind in dict.fromkeys(done)},
        "identity faults": [faults, left],
        "told": told,
        **{name: [before[name], after[name]] for name in ("IDF1", "HOTA", "AssA", "MOTA", "IDSW")},
    }


def main() -> None:
    """Print what it took."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("--truth", type=Path, required=True)
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    found = repair(chosen.run, chosen.truth)
    if chosen.json:
        print(json.dumps(found))
        return
    for name, value in found.items():
        words = (
            " → ".join(f"{one:.4f}" if isinstance(one, float) else str(one) for one in value)
            if isinstance(value, list)
            else value
        )
        print(f"{name:16}  {words}")


if __name__ == "__main__":
    main()
