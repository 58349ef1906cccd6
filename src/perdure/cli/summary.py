"""What became of the jobs of `perdure run`, as a table and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from perdure.cli.jobs import Job
from perdure.cli.tables import aligned
from perdure.comparison import Wanted, Window, compare_files
from perdure.files.log import read_log
from perdure.files.scored import Match
from perdure.metrics import Score

SHOWN = ("IDF1", "HOTA", "MOTA", "M")
COUNTS = ("frames", "tracks", "rows", "events")


@dataclass
class Row:
    """A job, where its run is, and what came of it."""

    job: Job
    folder: Path
    label: str
    told: dict[str, Any] | None = None
    failure: str = ""
    defect: str = ""
    before: bool = False  # done by an earlier call
    scored: Score | None = None
    seconds: float = 0.0  # of work, by all workers

    @property
    def word(self) -> str:
        """How it ended, in a word or two."""
        if self.told is None:
            return "failed"
        return f"{self.told['status']} before" if self.before else str(self.told["status"])

    def score(self, truth: Path, *, windowed: bool) -> None:
        """Hold the run against its truth, in the frames of the run alone where it is of a part of the source."""
        window = Window()
        if windowed:
            frames = [
                one.frame for one in read_log(self.folder / "tracks.jsonl", with_masks=False) if one.frame >= 0
            ]
            window = Window(min(frames), max(frames)) if frames else window
        compared = compare_files(Match(self.label, self.folder, truth), Wanted(window=window))
        self.scored = compared.boxes or compared.masks


def code_of(rows: Sequence[Row]) -> int:
    """0 where all is done, 1 where one met a defect of ours, 2 where none is done, 3 where something is lost."""
    if any(row.defect for row in rows):
        return 1
    if all(row.told is None for row in rows):
        return 2
    return 3 if any(row.told is None or row.told["status"] == "damaged" for row in rows) else 0


def _together(rows: Sequence[Row]) -> dict[str, Score]:
    """The scores of all sources together, of each tracker and detector that had several."""
    groups: dict[str, list[Score]] = {}
    for row in rows:
        if row.scored is not None:
            words = (row.job.settings.get("tracker"), row.job.settings.get("detector"))
            groups.setdefault(" ".join(Path(word).name for word in words if word), []).append(row.scored)
    return {f"together {name}".strip(): Score.together(all_) for name, all_ in groups.items() if len(all_) > 1}


def value_of(rows: Sequence[Row]) -> dict[str, Any]:
    """All that is known of the jobs, ready for JSON."""
    value: dict[str, Any] = {"jobs": [_row_value(row) for row in rows]}
    return value | {name: score.figures for name, score in _together(rows).items()}


def _row_value(row: Row) -> dict[str, Any]:
    return {
        "name": row.label,
        "source": row.job.source,
        "job": row.job.key,
        "run": str(row.folder),
        "skipped": row.before,
        **(row.told or {"status": "failed", "message": row.failure}),
        **({"scores": row.scored.figures} if row.scored else {}),
    }


def page(rows: Sequence[Row]) -> str:
    """The table, and what the reader must know of single jobs."""
    with_scores = any(row.scored for row in rows)
    heading = ["run", *COUNTS, "frames/s", *(SHOWN if with_scores else ()), "how it ended"]
    lines = [heading, *(_cells(row, with_scores) for row in rows)]
    for name, score in _together(rows).items():
        lines.append([name, *["-"] * (len(COUNTS) + 1), *_scores(score), ""])
    notes = [f"{row.label}: {note}" for row in rows if row.told for note in row.told["warnings"]]
    notes += [f"{row.label}: {row.told['message']}" for row in rows if row.told and row.told["message"]]
    notes += [f"{row.label}: {row.failure}" for row in rows if row.failure]
    notes += [row.defect.rstrip() for row in rows if row.defect]
    return "\n".join([aligned(lines), *notes, f"results in {rows[0].folder.parent}"])


def _cells(row: Row, with_scores: bool) -> list[str]:
    told = row.told or {}
    rate = f"{told['rate']:.0f}" if "rate" in told else "-"
    scores = (_scores(row.scored) if row.scored else ["-"] * len(SHOWN)) if with_scores else []
    return [row.label, *(str(told.get(name, "-")) for name in COUNTS), rate, *scores, row.word]


def _scores(score: Score) -> list[str]:
    figures = score.figures
    return [f"{100 * figures[name]:.1f}" if name in figures else "-" for name in SHOWN]
