"""Whether a video file is as long as its container says: what was cut off may have held whole frames.

Told are sizes that formats write down: of the boxes of MP4 and QuickTime (ISO/IEC 14496-12, 4.2), the chunks of AVI
(RIFF), the segment of Matroska and WebM (RFC 8794, RFC 9559), the tags of FLV, the packets of MPEG-TS (ISO/IEC 13818-1,
2.4.3.2) and the frames of YUV4MPEG2. A file that was never closed says none.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import BinaryIO


def cut_short(path: Path) -> str:
    """Return by how much a file is shorter than it says, in words; empty where it is whole, or does not say.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    with path.open("rb") as file:
        head, size = file.read(512), os.fstat(file.fileno()).st_size
        if head[4:8] in _BOXES:
            return _lacking(_end_of_boxes(file, size) - size)
        if head[:4] == b"RIFF" and head[8:12] == b"AVI ":
            return _lacking(_end_of_chunks(file, size) - size)
        if head[:4] == b"\x1aE\xdf\xa3":
            return _lacking(_end_of_segment(head) - size)
        if head[:3] == b"FLV":
            return "" if _ends_with_a_tag(file, size) else _WITHIN
        if head[:10] == b"YUV4MPEG2 ":
            return _WITHIN if _is_in_a_frame(head, size) else ""
        for length, first in ((188, 0), (192, 4)):  # of packets; with a time before each in .m2ts
            if head[first::length][:2] == b"GG" and size % length:
                return _WITHIN
    return ""


_BOXES = {b"ftyp", b"mdat", b"wide", b"free", b"skip", b"moov", b"styp"}
_WITHIN = "it ends within a packet"


def _lacking(count: int) -> str:
    return (
        f"it ends {count} bytes before its header says" if count > 1 else ""
    )  # 1: what fills up to an even number


def _end_of_boxes(file: BinaryIO, size: int) -> int:
    """Where the last box of an MP4 ends."""
    at = 0
    while at < size:
        file.seek(at)
        header = file.read(16)
        length = int.from_bytes(header[:4])
        if length == 1:
            length = int.from_bytes(header[8:16])
        if length == 0:  # up to the end of the file
            return size
        at += max(length, 8)
    return at


def _end_of_chunks(file: BinaryIO, size: int) -> int:
    """Where the last RIFF chunk of an AVI ends; there are several in files above a gigabyte."""
    at = 0
    while at < size:
        file.seek(at)
        header = file.read(8)
        length = int.from_bytes(header[4:], "little")
        if header[:4] != b"RIFF" or length in (0, 0xFFFFFFFF):  # something else, or it was never closed
            return size
        at += 8 + length + length % 2
    return at


def _end_of_segment(head: bytes) -> int:
    """Where the segment of a Matroska file ends; 0 where it does not say."""
    begin, length = _number(head, 4)
    at = begin + length
    if head[at : at + 4] != b"\x18S\x80g":
        return 0
    begin, length = _number(head, at + 4)
    return begin + length if length else 0


def _number(head: bytes, at: int) -> tuple[int, int]:
    """Behind an EBML number of variable length, and its value; 0 where it says that it is not known."""
    first = head[at] if at < len(head) else 0
    count = 9 - first.bit_length()  # bytes
    value = int.from_bytes(head[at : at + count]) & ((1 << 7 * count) - 1) if first else 0
    return at + count, 0 if value == (1 << 7 * count) - 1 else value


def _ends_with_a_tag(file: BinaryIO, size: int) -> bool:
    """Whether an FLV ends with the length of a tag that is where it says."""
    file.seek(max(0, size - 4))
    length = int.from_bytes(file.read(4))
    file.seek(max(0, size - 4 - length))
    tag = file.read(4)
    return length == 0 or (tag[:1] in (b"\x08", b"\x09", b"\x12") and int.from_bytes(tag[1:]) + 11 == length)


def _is_in_a_frame(head: bytes, size: int) -> bool:
    """Whether a YUV4MPEG2 file ends within a frame, as far as the layout of its planes is known."""
    line, _, rest = head.partition(b"\n")
    told = {word[:1]: word[1:] for word in line.split()[1:]}
    width, height = (int(told[key]) if told.get(key, b"").isdigit() else 0 for key in (b"W", b"H"))
    layout = re.fullmatch(rb"(420|422|444|mono)(?:jpeg|mpeg2|paldv)?", told.get(b"C", b"420"))
    if not width or not height or layout is None or rest[:6] != b"FRAME\n":
        return False
    across = width if layout[1] == b"444" else -(-width // 2)
    down = -(-height // 2) if layout[1] == b"420" else height
    planes = width * height + (0 if layout[1] == b"mono" else 2 * across * down)
    return (size - len(line) - 1) % (6 + planes) != 0
