"""A frame and what is said of it, as a picture: silhouettes, boxes, trails and labels.

How a row looks says how well it is known:

=================  ==========================================================================
VISIBLE            solid box, filled silhouette, chip in the colour of the id
PARTLY_OCCLUDED    the same, the edges on the hidden side dashed; the believed outline dotted
OCCLUDED           dashed and dimmer; a dark chip
LOST               sparse short dashes, dimmer still; a dark chip
AMBIGUOUS          dotted, the id with a '?'
a group            corner brackets around it and its members' ids
=================  ==========================================================================

A contour between pixels is solid where it is seen, and dashed where it is only believed.

Boxes and trails lie on a translucent dark band, so that they read on light and on dark scenes. Widths and
letters grow with the picture's height. Nothing here opens a file, and the same input gives the same picture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.draw.colours import Colour, colour_of, dimmer
from perdure.draw.labels import Label, lay_labels
from perdure.draw.marks import LEGEND, Mark, mark_labels, mark_strokes
from perdure.draw.strokes import SHIFT, Lines, Stroke, Style, between_pixels, brackets, broken, whole
from perdure.draw.trails import Trails, draw_trails
from perdure.draw.zones import draw_zones
from perdure.features.outlines import seen_and_hidden
from perdure.types import Frame, Image, Mask, Scene, Status, Tracks

_CANVAS: Colour = (30, 33, 40)
_NAMED_MEMBERS = 6


def paint(
    frame: Frame,
    rows: Tracks,
    trails: Trails,
    scene: Scene,
    *,
    masks: bool = True,
    marks: Sequence[Mark] | None = None,
    words: Mapping[int, str] | None = None,
) -> Image:
    """Return a new picture of the frame with its rows drawn in.

    Parameters
    ----------
    frame : Frame
        Left as it is. Without an image, the rows are drawn on a calm dark canvas of the scene's size.
    rows : Tracks
        The rows of this frame.
    trails : Trails
        Where the ids have been; `Trails.empty()` for none.
    scene : Scene
        Gives the size where the frame has no image, and the zones, whose outlines are drawn beneath.
    masks : bool
        Whether silhouettes are drawn too.
    marks : sequence of Mark, or None
        What departs from a truth in this frame, and a line that says what the marks mean; None for neither.
    words : mapping of int to str, or None
        What is written behind ids: what they are doing.

    Returns
    -------
    (H, W, 3) uint8 RGB array
    """
    picture = _canvas(frame, scene)
    height, width = picture.shape[:2]
    style = Style.of(height)
    seen = rows.take(_inside(rows, height, width))
    looks = _looks(seen, style, words or {})
    silhouettes = _silhouettes(seen, looks, style, height, width) if masks else []
    dashed = _believed_contours(seen, looks, style, height, width) if masks else []
    names = draw_zones(picture, scene, style) if scene.zones else ()
    if masks:
        _fill_masks(picture, seen)
    if frame.image is None:
        _fill_boxes(picture, seen)
    draw_trails(picture, trails, frame.time, style.line, style.halo)
    boxes = [_box_stroke(box, look, style) for box, look in zip(seen.boxes, looks, strict=True)]
    _darken_beneath(picture, [*boxes, *dashed], style)
    for stroke in (*silhouettes, *dashed):
        cv2.polylines(picture, stroke.lines, False, stroke.colour, stroke.width, cv2.LINE_AA, stroke.shift)
    for stroke in boxes:  # upright lines are crisp without anti-aliasing
        cv2.polylines(picture, stroke.lines, False, stroke.colour, stroke.width)
    for stroke in mark_strokes(marks or (), style):
        cv2.polylines(picture, stroke.lines, False, stroke.colour, stroke.width, cv2.LINE_AA)
    labels = [*_labels(seen, looks, style), *mark_labels(marks or (), style, height, width)]
    title = "" if marks is None else LEGEND
    lay_labels(picture, f"{frame.index}   {frame.time:.2f} s", labels, style.letters, title=title, beside=names)
    return picture


class _Look(NamedTuple):
    """How one row is drawn: colour, label, and the dash of each side (left, top, right, bottom)."""

    colour: Colour
    text: str
    dashes: tuple[tuple[float, float] | None, ...]  # (drawn, left out) in pixels; None for solid
    bold: bool  # a chip in full colour and a line of full width
    group: bool


def _canvas(frame: Frame, scene: Scene) -> Image:
    if frame.image is not None:
        return frame.image.copy()
    canvas = np.empty((scene.height, scene.width, 3), np.uint8)
    cv2.rectangle(
        canvas, (0, 0), (scene.width, scene.height), _CANVAS, cv2.FILLED
    )  # many times faster than np.full
    return canvas


def _inside(rows: Tracks, height: int, width: int) -> NDArray[np.bool_]:
    x1, y1, x2, y2 = rows.boxes.T
    return np.asarray((x1 < width) & (y1 < height) & (x2 > 0) & (y2 > 0))


def _looks(rows: Tracks, style: Style, words: Mapping[int, str]) -> list[_Look]:
    is_group = rows.is_group
    looks = []
    for i, identity in enumerate(rows.ids.tolist()):
        colour = colour_of(identity)
        status = Status(int(rows.status[i]))
        text = _group_text(identity, rows.ids[rows.groups == identity].tolist()) if is_group[i] else str(identity)
        if status == Status.AMBIGUOUS and not is_group[i]:
            text += "?"
        place = rows.ground[i]
        if place is not None and place.speed is not None and not is_group[i]:
            text += f" {place.speed:.1f} m/s"
        text = " ".join(filter(None, (text, words.get(identity, ""))))
        dim = status in (Status.OCCLUDED, Status.LOST)
        dashes = _dashes(status, str(rows.hidden_side[i]), style)
        looks.append(_Look(dimmer(colour) if dim else colour, text, dashes, not dim, bool(is_group[i])))
    return looks


def _group_text(identity: int, members: Sequence[int]) -> str:
    named = " ".join(str(member) for member in sorted(members)[:_NAMED_MEMBERS])
    more = len(members) - _NAMED_MEMBERS
    return f"group {identity}: {named}" + (f" +{more}" if more > 0 else "")


def _dashes(status: Status, hidden_side: str, style: Style) -> tuple[tuple[float, float] | None, ...]:
    dash = style.dash
    if status == Status.PARTLY_OCCLUDED:
        hidden = hidden_side.split("+")
        return tuple((dash, dash) if side in hidden else None for side in ("left", "top", "right", "bottom"))
    pattern = {
        Status.VISIBLE: None,
        Status.OCCLUDED: (1.3 * dash, 0.9 * dash),
        Status.LOST: (0.7 * dash, 1.3 * dash),
        Status.AMBIGUOUS: (2.0, 1.0 + 3.0 * style.line),
    }[status]
    return (pattern,) * 4


# Silhouettes ------------------------------------------------------------------------------------------------


def _fill_masks(picture: Image, rows: Tracks) -> None:
    """Tint the pixels seen: three quarters of the picture, one of the colour."""
    height, width = picture.shape[:2]
    for identity, mask in zip(rows.ids.tolist(), rows.masks, strict=True):
        x1, y1, x2, y2 = mask.box
        left, top, right, bottom = max(x1, 0), max(y1, 0), min(x2, width), min(y2, height)
        if left < right and top < bottom:
            bits = mask.bits[top - y1 : bottom - y1, left - x1 : right - x1].view(np.uint8)
            _tint(picture[top:bottom, left:right], colour_of(identity), 0.26, bits)


def _fill_boxes(picture: Image, rows: Tracks) -> None:
    """Tint whole boxes where there is no image to see."""
    height, width = picture.shape[:2]
    for identity, box, group in zip(rows.ids.tolist(), rows.boxes, rows.is_group, strict=True):
        left, top = max(round(float(box[0])), 0), max(round(float(box[1])), 0)
        right, bottom = min(round(float(box[2])), width), min(round(float(box[3])), height)
        if left < right and top < bottom and not group:
            _tint(picture[top:bottom, left:right], colour_of(identity), 0.18)


def _tint(crop: Image, colour: Colour, share: float, bits: NDArray[np.uint8] | None = None) -> None:
    flat = np.empty_like(crop)
    flat[:] = colour
    mixed = cv2.addWeighted(crop, 1.0 - share, flat, share, 0.0)
    if bits is None:
        crop[:] = mixed
    else:
        cv2.copyTo(mixed, bits, crop)


def _silhouettes(rows: Tracks, looks: Sequence[_Look], style: Style, height: int, width: int) -> list[Stroke]:
    """Outlines of what is seen, and dotted ones of what is believed where part of it is hidden."""
    strokes = []
    for i, look in enumerate(looks):
        outline = rows.outlines[i]
        if outline is not None:
            lines = _within(seen_and_hidden(outline, rows.masks[i]).seen, height, width)
            strokes.append(Stroke([between_pixels(line) for line in lines], look.colour, style.thin, SHIFT))
            continue
        seen = _outlines(rows.masks[i], height, width)
        if seen:
            strokes.append(Stroke(seen, look.colour, style.thin))
        whole = rows.believed[i]
        if whole is not None and rows.status[i] in (Status.PARTLY_OCCLUDED, Status.OCCLUDED):
            dots = [part for line in _outlines(whole, height, width) for part in broken(line, 2.0, style.dash / 2)]
            strokes.append(Stroke(dots, dimmer(look.colour), style.thin))
    return strokes


def _believed_contours(
    rows: Tracks, looks: Sequence[_Look], style: Style, height: int, width: int
) -> list[Stroke]:
    """Dashed lines of contours where they are not seen."""
    strokes = []
    dash, gap = ((1 << SHIFT) * style.dash * share for share in (0.75, 0.75))
    for outline, mask, look in zip(rows.outlines, rows.masks, looks, strict=True):
        if outline is not None:
            hidden = _within(seen_and_hidden(outline, mask).hidden, height, width)
            dashes = [part for line in hidden for part in broken(between_pixels(line), dash, gap)]
            strokes.append(Stroke(dashes, look.colour, style.line, SHIFT))
    return strokes


def _within(lines: Sequence[NDArray[np.float64]], height: int, width: int) -> list[NDArray[np.float64]]:
    """The lines that reach into the picture."""
    return [line for line in lines if (line.max(axis=0) > 0).all() and (line.min(axis=0) < (width, height)).all()]


def _outlines(mask: Mask, height: int, width: int) -> Lines:
    """Closed lines around a mask's parts and holes; what lies far outside the picture is left out."""
    if not mask.bits.size or mask.x >= width or mask.y >= height:
        return []
    contours, _ = cv2.findContours(mask.bits.view(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_TC89_L1)
    corner = np.array([mask.x, mask.y], np.int32)
    closed = [np.concatenate([contour, contour[:1]]) for contour in contours if len(contour) > 2]
    return [np.asarray(line[:, 0] + corner, np.int32) for line in closed]


# Boxes ------------------------------------------------------------------------------------------------------


def _box_stroke(box: NDArray[np.float32], look: _Look, style: Style) -> Stroke:
    x1, y1, x2, y2 = whole(box)
    x2, y2 = max(x2 - 1, x1), max(y2 - 1, y1)  # half-open: the last pixel inside
    if look.group:
        return Stroke(brackets(x1, y1, x2, y2, style), look.colour, style.line)
    if not look.bold and min(x2 - x1, y2 - y1) < 4 * style.dash:  # dashes would not make a box
        return Stroke(brackets(x1, y1, x2, y2, style), look.colour, style.thin)
    if not any(look.dashes):
        ring = np.array([[x1, y1], [x2, y1], [x2, y2], [x1, y2], [x1, y1]], np.int32)
        return Stroke([ring], look.colour, style.line)
    sides = ([[x1, y1], [x1, y2]], [[x1, y1], [x2, y1]], [[x2, y1], [x2, y2]], [[x1, y2], [x2, y2]])
    lines: Lines = []
    for side, dashes in zip(sides, look.dashes, strict=True):
        line = np.array(side, np.int32)
        lines.extend([line] if dashes is None else broken(line, *dashes))
    return Stroke(lines, look.colour, style.line if look.bold else style.thin)


# The dark band ----------------------------------------------------------------------------------------------


def _darken_beneath(picture: Image, strokes: Sequence[Stroke], style: Style) -> None:
    """Lay the dark band under all lines at once."""
    band = np.zeros(picture.shape[:2], np.uint8)
    for stroke in strokes:
        cv2.polylines(band, stroke.lines, False, 255, stroke.width + style.halo, cv2.LINE_8, stroke.shift)
    cv2.copyTo(cv2.convertScaleAbs(picture, alpha=0.42), band, picture)


# Labels -----------------------------------------------------------------------------------------------------


def _labels(rows: Tracks, looks: Sequence[_Look], style: Style) -> list[Label]:
    """The labels, the surest and nearest first: they choose their places first; small unseen targets have none."""
    sides = np.minimum(*(rows.boxes[:, 2:] - rows.boxes[:, :2]).T)
    named = [i for i in range(len(rows)) if looks[i].bold or sides[i] > 1.5 * style.letters]
    order = sorted(named, key=lambda i: (looks[i].bold, float(rows.boxes[i][3])), reverse=True)
    return [
        Label(
            look.text, look.colour, look.bold, whole(rows.boxes[i]), style.gap if look.group else style.line // 2
        )
        for i, look in ((i, looks[i]) for i in order)
    ]
