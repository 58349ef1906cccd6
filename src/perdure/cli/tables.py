"""Figures as tables of plain text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

_RATIOS = {
    *("HOTA", "DetA", "AssA", "LocA", "MOTA", "MOTP", "MOTSA", "sMOTSA", "MOTSP", "IDF1", "IDP", "IDR"),
    *("M1", "M2", "M3", "M", "J", "F", "J&F"),
}
BOXES = ("HOTA", "DetA", "AssA", "LocA", "MOTA", "MOTP", "IDF1", "IDP", "IDR")
COUNTS = ("IDSW", "Frag", "FP", "FN", "MT", "PT", "ML", "truth_rows", "rows", "truth_ids", "ids")
MASKS = ("HOTA", "DetA", "AssA", "LocA", "MOTSA", "sMOTSA", "MOTSP", "IDF1", "IDP", "IDR", "J", "F", "J&F")
ETISEO = ("M1", "M2", "M3", "M", "tracks_TP", "tracks_FN", "tracks_FP")
_HEADINGS = {
    "truth_rows": "true rows",
    "truth_ids": "true ids",
    "M": "M mean",
    "tracks_TP": "TP tracks",
    "tracks_FN": "FN tracks",
    "tracks_FP": "FP tracks",
}


def table(title: str, columns: Sequence[str], rows: Mapping[str, Mapping[str, float]]) -> str:
    """Return a table of figures, a sequence a row; ratios in percent.

    >>> print(table("boxes", ["MOTA", "IDSW"], {"street": {"MOTA": 0.5, "IDSW": 3}}))
    boxes     MOTA  IDSW
    street    50.0     3
    """
    headings = [_HEADINGS.get(name, name) for name in columns]
    body = [[name, *(_cell(figures, column) for column in columns)] for name, figures in rows.items()]
    return aligned([[title, *headings], *body])


def aligned(rows: Sequence[Sequence[str]]) -> str:
    """Return rows of words in columns; the first to the left, the others to the right."""
    widths = [max(len(row[place]) for row in rows) for place in range(len(rows[0]))]
    widths[1:] = [max(4, width) for width in widths[1:]]
    lines = [
        "  ".join(
            [
                f"{row[0]:<{max(8, widths[0])}}",
                *(f"{word:>{width}}" for word, width in zip(row[1:], widths[1:], strict=True)),
            ]
        )
        for row in rows
    ]
    return "\n".join(line.rstrip() for line in lines)


def _cell(figures: Mapping[str, float], column: str) -> str:
    if column not in figures:
        return "-"
    return f"{100 * figures[column]:.1f}" if column in _RATIOS else f"{figures[column]:.0f}"
