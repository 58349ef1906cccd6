"""Folders of index PNGs, a picture a frame: the value of a pixel is the id of what is seen there, 0 for nothing.

Grey pictures of 8 or 16 bits, or palettes, whose index counts and not its colour. In 8 bits 255 is kept for
void: pixels of a truth that belong to no object and cost nothing.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from perdure.errors import FormatError, OutputError
from perdure.features.masks import disjoint
from perdure.files.folders import is_number, whole_folder
from perdure.files.images import natural_order
from perdure.types import Mask, Rows, Tracks, Use

SUFFIX = ".png"
VOID = 255  # of an 8-bit truth
LARGEST_ID = 65_535

Indices = NDArray[np.uint8] | NDArray[np.uint16]  # (H, W)


def read_masks(folder: Path, *, void: bool = False) -> Rows:
    """Return the silhouettes of a folder of index PNGs.

    Where every name is a plain number, that number is the frame, as it stands (00000.png is frame 0); else the
    frame is the picture's place among them, in the order of the numbers in their names. Where 255 is the only
    value other than 0 in the whole folder, as in DAVIS 2016, the pictures are black and white and show object 1.

    Parameters
    ----------
    folder : Path
        Other files in it than `.png` are passed over.
    void : bool
        Take 255 of 8-bit pictures for an area that is no object (`Use.REGION`), as in the truths of DAVIS 2017.

    Raises
    ------
    FormatError
        Naming the picture: without any, for one that is in colour, damaged or of another size than the first,
        and for two of one frame.
    """
    frames: list[int] = []
    ids: list[int] = []
    masks: list[Mask] = []
    narrow: list[bool] = []
    size: tuple[int, int] | None = None
    for frame, path in pictures_in(folder):
        picture = read_indices(path)  # (H, W)
        height, width = picture.shape
        if size is not None and size != (height, width):
            raise FormatError(f"{path} is {width}x{height}, the first picture {size[1]}x{size[0]}")
        size = height, width
        for identity, mask in silhouettes(picture):
            frames.append(frame)
            ids.append(identity)
            masks.append(mask)
            narrow.append(picture.dtype == np.uint8)
    values, eight_bits = np.array(ids, np.int64), np.array(narrow, np.bool_)
    is_void = (values == VOID) & eight_bits & void
    if len(values) and (values == VOID).all() and eight_bits.all():
        values, is_void = np.ones_like(values), np.zeros_like(is_void)
    use = np.where(is_void, Use.REGION, Use.SCORED)
    return Rows.of(frames=frames, ids=values, use=use, masks=masks, size=size)


def pictures_in(folder: Path) -> list[tuple[int, Path]]:
    """Return the pictures of a folder with their frames, in that order; which they are, `read_masks` tells.

    Raises
    ------
    FormatError
        If it cannot be read, holds no PNG, or holds two of one frame.
    """
    try:
        paths = [one for one in folder.iterdir() if one.suffix.lower() == ".png" and not one.name.startswith(".")]
    except OSError as error:
        raise FormatError(f"cannot read {folder}: {error.strerror or error}") from error
    if not paths:
        raise FormatError(f"{folder} holds no PNG")
    paths.sort(key=natural_order)
    if not all(is_number(one.stem) for one in paths):
        return list(enumerate(paths))
    numbered = sorted((int(one.stem), one) for one in paths)
    for (frame, one), (following, other) in pairwise(numbered):
        if frame == following:
            raise FormatError(f"{one} and {other.name} are both frame {frame}")
    return numbered


def write_masks(
    folder: Path,
    rows: Iterable[tuple[int, Tracks]],
    frames: Iterable[int],
    height: int,
    width: int,
    *,
    largest_id: int,
    overwrite: bool = False,
) -> int:
    """Write a picture for each frame into a folder that appears whole or not at all; return the masks' number.

    Parameters
    ----------
    folder : Path
        Made; one that is there is replaced only if that is asked and if it holds nothing but such pictures.
    rows : iterable of (int, Tracks)
        Rows by frame; a pixel that several claim goes to the first.
    frames : iterable of int
        Those that get a picture, a black one where they have no rows. It is named by the frame, in six digits.
    height, width : int
        Of the pictures, in pixels.
    largest_id : int
        8 bits are written up to 254 (255 is what readers take for void), else 16.
    overwrite : bool
        Whether pictures that are there may be replaced.

    Raises
    ------
    OutputError
        If the place cannot be written or is taken, if `largest_id` is above 65 535, or an id above that.
    """
    if largest_id > LARGEST_ID:
        raise OutputError(
            f"id {largest_id} is too large for a picture of 16 bits ({LARGEST_ID} at most); write MOTS text instead"
        )
    black = np.zeros((height, width), np.uint8 if largest_id < VOID else np.uint16)
    count, written = 0, set()
    with whole_folder(folder, SUFFIX, overwrite=overwrite) as write:
        for frame, here in rows:
            if len(here) and int(here.ids.max()) > largest_id:
                raise OutputError(
                    f"id {int(here.ids.max())} came where {largest_id} was to be the largest; try again when the run has ended"
                )
            picture = black.copy()
            count += _paint(picture, here)
            write(frame, _encoded(picture))
            written.add(frame)
        for frame in set(frames) - written:
            write(frame, _encoded(black))
    return count


def silhouettes(picture: Indices) -> Iterator[tuple[int, Mask]]:
    """Yield the values of an index picture but 0, ascending, each with its tight mask."""
    from scipy.ndimage import find_objects

    for value, place in enumerate(find_objects(picture), 1):
        if place is not None:
            rows, columns = place
            yield value, Mask(rows.start, columns.start, picture[place] == value)


def read_indices(path: Path) -> Indices:
    """Return an index picture (H, W); FormatError for a file that is none.

    One that a paint program has saved in colours, all of them grey and opaque, is an index picture too.
    """
    import cv2

    try:
        depth, plain = _without_palette(path.read_bytes())
        decoded = cv2.imdecode(np.frombuffer(plain, np.uint8), cv2.IMREAD_UNCHANGED)
        picture = None if decoded is None else _grey_of(decoded)
    except OSError as error:
        raise FormatError(f"cannot read {path}: {error.strerror or error}") from error
    except ValueError as error:
        raise FormatError(f"{path} {error}") from None
    except cv2.error:
        picture = None
    if picture is None or picture.ndim != 2:
        raise FormatError(f"{path} is damaged")
    if depth < 8:  # the decoder spreads few bits over eight
        picture = picture // (255 // ((1 << depth) - 1))
    return cast("Indices", picture)


def _grey_of(picture: NDArray[Any]) -> NDArray[Any]:
    """Return the one channel (H, W) of a decoded picture; ValueError where it is in colour or has transparency."""
    if picture.ndim == 2:
        return picture
    colours, alpha = picture[..., :3], picture[..., 3:]
    if (colours != colours[..., :1]).any() or (alpha != np.iinfo(picture.dtype).max).any():
        raise ValueError("is in colour or has transparency; write the ids as grey values or as a palette's index")
    return np.ascontiguousarray(colours[..., 0])


def _without_palette(encoded: bytes) -> tuple[int, bytes]:
    """Return a PNG's bits per pixel, and the PNG with its indices as grey values and nothing that changes them.

    ValueError says what is wrong with it.
    """
    if not encoded.startswith(_SIGNATURE):
        raise ValueError("is not a PNG")
    kept, depth = [_SIGNATURE], 0
    for kind, body in _chunks(encoded):
        if kind == b"IHDR":
            width, height, depth, colours, *rest = struct.unpack(">IIBBBBB", body)
            if width * height > _LARGEST_AREA:
                raise ValueError(f"cannot be read: a picture of {width}x{height}")
            if colours == _PALETTE:
                body = struct.pack(">IIBBBBB", width, height, depth, _GREY, *rest)
        if kind in (b"IHDR", b"IDAT", b"IEND"):
            kept.append(struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body)))
    return depth, b"".join(kept)


def _chunks(encoded: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Kind and content of every part of a PNG; ValueError where it ends early or a checksum is wrong."""
    at, kind = len(_SIGNATURE), b""
    while kind != b"IEND":
        length, kind = int.from_bytes(encoded[at : at + 4]), encoded[at + 4 : at + 8]
        body, checksum = encoded[at + 8 : at + 8 + length], encoded[at + 8 + length : at + 12 + length]
        if (
            len(checksum) < 4
            or zlib.crc32(kind + body) != int.from_bytes(checksum)
            or (at == 8) != (kind == b"IHDR")
        ):
            raise ValueError("is damaged or ends early")
        if kind == b"IHDR" and length != _HEADER:
            raise ValueError("is damaged")
        yield kind, body
        at += 12 + length


def _paint(picture: Indices, rows: Tracks) -> int:
    """Write the ids into a picture, the first row's last; return how many have a silhouette in it."""
    cut = [disjoint([mask], *picture.shape)[0] for mask in rows.masks]
    for identity, mask in zip(rows.ids[::-1], cut[::-1], strict=True):
        x1, y1, x2, y2 = mask.box
        picture[y1:y2, x1:x2][mask.bits] = identity
    return sum(mask.bits.size > 0 for mask in cut)


def _encoded(picture: Indices) -> bytes:
    import cv2

    return cv2.imencode(".png", picture)[1].tobytes()


_SIGNATURE, _HEADER = b"\x89PNG\r\n\x1a\n", 13  # bytes
_GREY, _PALETTE = 0, 3  # kinds of colour of a PNG
_LARGEST_AREA = 1 << 28  # px, of a picture
