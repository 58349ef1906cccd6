"""Contours of a frame as an SVG of the picture's size: what is seen in solid lines, what is only believed in dashed ones."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from numpy.typing import NDArray

from perdure.draw.colours import Colour, colour_of, dimmer
from perdure.draw.strokes import Style
from perdure.features.outlines import polygons, seen_and_hidden
from perdure.types import Outline, Status, Tracks


def svg_of(
    rows: Tracks, contours: Iterable[tuple[int, Outline, bool]], frame: int, height: int, width: int
) -> str:
    """Return an SVG with a group for each contour.

    Parameters
    ----------
    rows : Tracks
        The rows of a frame.
    contours : iterable of (int, Outline, bool)
        A row, its contour, and whether parts of that may be hidden; then those are dashed.
    frame : int
        Its number, for the title.
    height, width : int
        Of the picture, pixels. Pixel (0, 0) reaches from 0 to 1.

    Returns
    -------
    str
        A group has the id `target-ID`, and a closed path of the whole (`whole`), its lines that are seen (`seen`) and
        those that are not (`believed`).
    """
    style = Style.of(height)
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}">',
        f"<title>frame {frame}</title>",
        *(_group(rows, row, outline, parted, style) for row, outline, parted in contours),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _group(rows: Tracks, row: int, outline: Outline, parted: bool, style: Style) -> str:
    identity, status = int(rows.ids[row]), Status(rows.status[row])
    colour = _hex(dimmer(colour_of(identity)) if status in (Status.OCCLUDED, Status.LOST) else colour_of(identity))
    told = " ".join(word for word in (str(identity), str(rows.classes[row]), status.word) if word)
    whole = " ".join(_path(ring, closed=True) for part in polygons(outline) for ring in (part.outer, *part.holes))
    drawn = [
        f'<path class="whole" d="{whole}" fill="{colour}" fill-opacity="0.2" fill-rule="evenodd" stroke="none"/>'
    ]
    if parted:
        seen, hidden = seen_and_hidden(outline, rows.masks[row])
        drawn += [f'<path class="seen" d="{_paths(seen)}"/>'] if seen else []
        dashes = f'stroke-dasharray="{0.75 * style.dash:g} {0.75 * style.dash:g}"'
        drawn += [f'<path class="believed" d="{_paths(hidden)}" {dashes}/>'] if hidden else []
    else:
        drawn.append(f'<path class="seen" d="{whole}"/>')
    x, y = min(
        (point for ring in outline.rings for point in ring.tolist()), key=lambda point: (point[1], point[0])
    )
    name = f'<text x="{x:.6g}" y="{y - style.line - 1:.6g}" font-family="sans-serif" font-size="{style.letters}" '
    drawn.append(f'{name}text-anchor="middle" fill="{colour}" stroke="none">{identity}</text>')
    return "\n".join(
        [
            f'<g id="target-{identity}" data-status={quoteattr(status.word)} fill="none" stroke="{colour}" '
            f'stroke-width="{style.line}" stroke-linejoin="round">',
            f"<title>{escape(told)}</title>",
            *drawn,
            "</g>",
        ]
    )


def _paths(lines: Sequence[NDArray[np.float64]]) -> str:
    return " ".join(_path(line, closed=False) for line in lines)


def _path(line: NDArray[np.float64], *, closed: bool) -> str:
    points = " ".join(f"{x:.6g},{y:.6g}" for x, y in np.round(line, 2).tolist())
    return f"M{points}" + ("Z" if closed else "")


def _hex(colour: Colour) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
