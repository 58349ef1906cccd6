"""Folders and globs of images, and MOTChallenge folders with or without their images.

Images come in the order of the numbers in their names. Grey ones become RGB, transparency is dropped, and
16-bit values are divided by one power of two for the whole folder, found from a sample of its images;
where the depth changes on the way, the source breaks off.
A JPEG or PNG that ends early is refused, a PNG with any changed byte also; a JPEG with changed bytes
decodes to a changed picture, which nothing tells.
"""

from __future__ import annotations

import configparser
import glob
import os
import re
import zlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from perdure.errors import FormatError, VideoError
from perdure.files.numbered import Numbered
from perdure.files.span import Span, cut
from perdure.types import Image

SUFFIXES = frozenset({".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm", ".jp2"})
_FILMS = frozenset({".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".ts", ".wmv", ".flv"})
_N = TypeVar("_N", int, float)
_Pixels = NDArray[np.uint8] | NDArray[np.uint16]
_RATE = 25.0
_NO_RATE = "images say no frame rate: 25 per second are taken; give fps for the true one"


def open_folder(folder: Path, fps: float | None, span: Span) -> Numbered:
    """Open a folder of images, or a MOTChallenge folder."""
    if (folder / "seqinfo.ini").is_file():
        return _open_sequence(folder, fps, span)
    paths, warnings = _images_in(folder)
    if not paths:
        raise VideoError(_nothing_in(folder))
    richer = [one.name for one in _folders_of_images(folder) if len(_images_in(one)[0]) > len(paths)]
    if richer:
        warnings.append(f"there are more images in its folder {' and '.join(richer[:3])} than in {folder} itself")
    return _open_images(paths, folder.resolve().name, str(folder.resolve()), fps, span, warnings)


def open_glob(pattern: str, fps: float | None, span: Span) -> Numbered:
    """Open the images that a pattern such as 'frames/*.png' matches."""
    paths = sorted((Path(one) for one in glob.glob(pattern, recursive=True)), key=natural_order)
    paths = [one for one in paths if one.is_file()]
    if not paths:
        raise VideoError(f"nothing matches {cut(pattern, 250)}")
    name = paths[0].resolve().parent.name
    return _open_images(paths, name, str(Path(pattern).absolute()), fps, span, [])


def open_single(path: Path, fps: float | None, span: Span) -> Numbered:
    """Open one image as a source of one frame."""
    return _open_images([path], path.stem, str(path.resolve()), fps, span, [])


def natural_order(path: Path) -> tuple[object, ...]:
    """Return what sorts img2 before img10.

    >>> sorted([Path("img10.png"), Path("img2.png")], key=natural_order)[0].name
    'img2.png'
    """
    parts = re.split(r"(\d+)", path.name)
    words, numbers = parts[::2], [int(one) for one in parts[1::2]]
    return (*(one for pair in zip(words, [*numbers, -1], strict=True) for one in pair), str(path))


def read_pixels(path: Path) -> _Pixels:
    """Read an image file as (H, W, 3) RGB of 8 or 16 bits; VideoError for one that cannot be read."""
    import cv2

    try:
        encoded = path.read_bytes()
    except OSError as error:
        raise VideoError(f"{path} cannot be read ({error.strerror})") from None
    if not encoded:
        raise VideoError(f"{path} is empty (0 bytes)")
    if not _is_whole(encoded):
        raise VideoError(f"{path} is damaged or ends early")
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH
    try:
        pixels = cv2.imdecode(np.frombuffer(encoded, np.uint8), flags)
    except cv2.error:
        pixels = None
    if pixels is None:
        raise VideoError(f"{path} is not an image that can be read")
    if pixels.dtype not in (np.uint8, np.uint16):
        raise VideoError(f"{path} has {pixels.dtype} pixels; 8 or 16 bits can be read")
    return cast("_Pixels", cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB))  # (H, W, 3)


@dataclass(frozen=True)
class _Reader:
    """Reads the images of a folder as 8-bit RGB, 16-bit values divided by 2 ** shift."""

    paths: Sequence[Path]
    depth: int  # bits: 8 or 16
    shift: int = 0

    def __call__(self, index: int) -> Image:
        pixels = read_pixels(self.paths[index])
        depth = _depth(pixels)
        if depth != self.depth:
            raise VideoError(f"it has {depth} bits a channel, the first image has {self.depth} bits")
        narrow = np.minimum(pixels >> self.shift, 255) if depth == 16 else pixels
        return narrow.astype(np.uint8, copy=False)


def _depth(pixels: _Pixels) -> int:
    return 8 * pixels.dtype.itemsize


def _open_images(
    paths: Sequence[Path], name: str, origin: str, fps: float | None, span: Span, warnings: list[str]
) -> Numbered:
    first = read_pixels(paths[0])
    height, width = first.shape[:2]
    reader = _Reader(paths, _depth(first), _shift_of(paths, warnings) if _depth(first) == 16 else 0)
    return Numbered(
        name,
        origin,
        width,
        height,
        fps or _RATE,
        len(paths),
        span,
        reader,
        names=tuple(one.name for one in paths),
        warnings=(*warnings, *([] if fps else [_NO_RATE])),
    )


def _open_sequence(folder: Path, fps: float | None, span: Span) -> Numbered:
    """Open a MOTChallenge folder."""
    told = read_seqinfo(folder / "seqinfo.ini")
    place = folder / told.images
    paths, warnings = _images_in(place) if place.is_dir() else ([], [])
    name, origin, rate = folder.resolve().name, str(folder.resolve()), fps or told.rate
    if not paths:
        return Numbered(
            name, origin, told.width, told.height, rate, told.length, span, _no_image, False, folder=folder
        )
    if len(paths) != told.length:
        warnings.append(f"seqinfo.ini says {told.length} frames, {place.name} holds {len(paths)} images")
    return replace(_open_images(paths, name, origin, rate, span, warnings), folder=folder)


def _no_image(_: int) -> None:
    return None


@dataclass(frozen=True)
class Told:
    """What a seqinfo.ini says."""

    images: str
    rate: float
    length: int
    width: int
    height: int


def read_seqinfo(path: Path) -> Told:
    """Read what a seqinfo.ini says; FormatError names key, value and range."""
    parser = configparser.ConfigParser(interpolation=None)
    try:
        parser.read_string(path.read_text(encoding="utf-8-sig"), str(path))
    except (configparser.Error, UnicodeDecodeError) as error:
        raise FormatError(f"{path}{_fault(error)}") from None
    if not parser.has_section("Sequence"):
        raise FormatError(f"{path}: the section [Sequence] is missing")
    told = parser["Sequence"]
    images = told.get("imDir", "img1")
    if len(images) > 255 or not images.isprintable():
        raise FormatError(f"{path}: imDir = {cut(images)} is no name of a folder")
    return Told(
        images,
        _number(path, told, "frameRate", float, 0.001, 1000),
        _number(path, told, "seqLength", int, 0, 10**8),
        _number(path, told, "imWidth", int, 1, 16384),
        _number(path, told, "imHeight", int, 1, 16384),
    )


def _number(
    path: Path, told: Mapping[str, str], key: str, kind: Callable[[str], _N], low: float, high: float
) -> _N:
    """The value of a key, in its range."""
    text = told.get(key)
    if text is None:
        raise FormatError(f"{path}: the key {key} is missing in [Sequence]")
    try:
        value = kind(text)
        if low <= value <= high:
            return value
        what = ""
    except ValueError:
        what = "a number, "
    what = "a whole number, " if kind is int else what
    raise FormatError(f"{path}: {key} = {cut(text)} is out of range: it must be {what}{low} to {high}")


def _fault(error: configparser.Error | UnicodeDecodeError) -> str:
    """Where a seqinfo.ini cannot be read, and why."""
    if isinstance(error, configparser.MissingSectionHeaderError):
        return f", line {error.lineno}: it stands in no section; the first must be [Sequence]"
    if isinstance(error, configparser.ParsingError):
        return f", line {error.errors[0][0]}: not 'key = value'"
    if isinstance(error, (configparser.DuplicateOptionError, configparser.DuplicateSectionError)):
        return f", line {error.lineno}: it is given twice"
    return ": it is not text"


def _images_in(folder: Path) -> tuple[list[Path], list[str]]:
    """The images of a folder in their order: those of the commonest suffix, with a warning of others."""
    paths = [
        one
        for one in sorted(folder.iterdir(), key=natural_order)
        if one.suffix.lower() in SUFFIXES and not one.name.startswith(".") and one.is_file()
    ]
    counts = Counter(one.suffix.lower() for one in paths).most_common()
    if len(counts) < 2:
        return paths, []
    chosen = [one for one in paths if one.suffix.lower() == counts[0][0]]
    others = ", ".join(f"{count} {suffix}" for suffix, count in counts[1:])
    return chosen, [f"only the {len(chosen)} {counts[0][0]} images are read, not the others ({others})"]


def _nothing_in(folder: Path) -> str:
    """Say that a folder holds no images, with what it holds instead."""
    inside = sorted(folder.iterdir(), key=natural_order)
    films = [one.name for one in inside if one.suffix.lower() in _FILMS]
    if films:
        return f"{folder} holds no images; did you mean the video in it: {', '.join(films[:5])}?"
    below = [one.name for one in _folders_of_images(folder)]
    if below:
        return f"{folder} holds no images itself; did you mean its folder {' or '.join(below[:5])}?"
    nothing = f"{folder} holds no images ({', '.join(sorted(SUFFIXES))})"
    if any((folder / one).is_dir() for one in ("det", "gt")):
        return f"{nothing} and no seqinfo.ini, so it is no MOTChallenge folder"
    return nothing


def _folders_of_images(folder: Path) -> list[Path]:
    inside = sorted(folder.iterdir(), key=natural_order)
    return [one for one in inside if one.is_dir() and os.access(one, os.R_OK | os.X_OK) and _images_in(one)[0]]


def _shift_of(paths: Sequence[Path], warnings: list[str]) -> int:
    """By how many bits 16-bit values are shifted, so that the largest of nine images fits 8 bits."""
    places = np.unique(np.linspace(0, len(paths) - 1, 9).astype(int))
    largest = 0
    for place in places:
        try:
            largest = max(largest, int(read_pixels(paths[place]).max()))
        except VideoError:
            continue  # said when its turn comes
    shift = max(0, largest.bit_length() - 8)
    warnings.append(f"16-bit images: their values are divided by {1 << shift}")
    return shift


def _is_whole(encoded: bytes) -> bool:
    """Whether an encoded JPEG has its end, and a PNG all its checksums; others are left to the decoder."""
    if encoded.startswith(b"\xff\xd8"):
        return encoded.rfind(b"\xff\xd9") > encoded.rfind(b"\xff\xda") > 0
    if not encoded.startswith(b"\x89PNG\r\n\x1a\n"):
        return True
    at, kind = 8, b""
    while kind != b"IEND":
        length, kind = int.from_bytes(encoded[at : at + 4]), encoded[at + 4 : at + 8]
        end = at + 8 + length
        if end + 4 > len(encoded) or zlib.crc32(encoded[at + 4 : end]) != int.from_bytes(encoded[end : end + 4]):
            return False
        at = end + 4
    return True
