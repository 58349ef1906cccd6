"""Live sources: cameras by OpenCV, streams by FFmpeg. What is lost on the way is lost; no frame comes twice."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import av
import numpy as np

from perdure.errors import VideoError
from perdure.files.clock import Clock
from perdure.files.decoding import rgb
from perdure.files.passing import Passing, Shot, passing
from perdure.files.refusal import TOLERANT
from perdure.files.span import Span

if TYPE_CHECKING:
    import cv2

_PATIENCE = 10.0  # s without an answer
_RATE = 25.0
_LOST = "frames are missing: what was damaged on the way is left out"
_NO_SEEKING = "; if it is an mp4, its index may be at its end: download it first"


def open_url(url: str, fps: float | None, span: Span, silence: float = _PATIENCE) -> Passing:
    """Open a stream by its URL (RTSP over TCP, HTTP, RTMP, UDP, …); it may be silent for `silence` seconds."""
    shown = _without_password(url)
    options = {"rtsp_transport": "tcp"} if url.lower().startswith("rtsp") else {}
    try:
        container = av.open(url, options=options, timeout=(_PATIENCE, silence), **TOLERANT)
    except (av.error.FFmpegError, OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise VideoError(f"{shown} cannot be reached ({why}); check the address and the network") from None
    if not container.streams.video:
        container.close()
        raise VideoError(f"{shown} holds no video")
    stream = container.streams.video[0]
    stream.thread_type = "AUTO"
    rate = fps or float(stream.average_rate or stream.guessed_rate or _RATE)
    warnings: list[str] = []
    shots = _stream_shots(container, stream, warnings)
    clock = Clock(rate, warnings, fixed=fps)
    name = urlsplit(url).hostname or "stream"
    try:
        source = passing(name, shown, rate, span, shots, clock, warnings, container.close)
    except VideoError as error:
        container.close()
        raise VideoError(f"{shown} gives no picture: {error}") from None
    if not source.width:
        container.close()
        raise VideoError(f"{shown} gives no picture")
    return source


def open_camera(number: int, fps: float | None, span: Span) -> Passing:
    """Open a camera of this machine by its number."""
    import cv2

    missing = VideoError(f"there is no camera {number} that can be opened; is it connected, and free?")
    if number < 0 or (sys.platform == "linux" and not Path(f"/dev/video{number}").exists()):
        raise missing
    camera = cv2.VideoCapture(number)
    if not camera.isOpened():
        raise missing
    rate = fps or camera.get(cv2.CAP_PROP_FPS) or _RATE
    warnings: list[str] = []
    shots = _camera_shots(camera)
    clock = Clock(rate, warnings, fixed=fps)
    name = f"camera{number}"
    try:
        return passing(name, name, rate, span, shots, clock, warnings, camera.release)
    except VideoError:
        camera.release()
        raise missing from None


def _camera_shots(camera: cv2.VideoCapture) -> Iterator[Shot]:
    """Pictures of a camera, timed by this machine's clock."""
    import cv2

    while True:
        got, image = camera.read()
        if not got:
            raise VideoError("the camera gives no more pictures")
        yield Shot(np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8), time.monotonic())


def _stream_shots(
    container: av.container.InputContainer, stream: av.VideoStream, warnings: list[str]
) -> Iterator[Shot]:
    """Pictures of a stream; damaged ones are left out, and the first time that is said."""
    tick = float(stream.time_base or 0)
    hint = _NO_SEEKING if "mp4" in container.format.name else ""
    try:
        for packet in container.demux(stream):
            try:
                frames: list[object] = list(packet.decode())
            except av.error.InvalidDataError:
                frames = [None]
            for frame in frames:
                if not isinstance(frame, av.VideoFrame) or frame.is_corrupt:
                    warnings.extend([] if _LOST in warnings else [_LOST])
                else:
                    seconds = None if frame.pts is None else frame.pts * tick
                    yield Shot(rgb(frame), seconds)
                    hint = ""  # what gave a picture can be read in its order
    except av.error.FFmpegError as error:
        raise VideoError(f"the connection was lost ({error.strerror or error}){hint}") from None


def _without_password(url: str) -> str:
    """The URL as it may be shown and written down."""
    parts = urlsplit(url)
    return url.replace(f"{parts.username}:{parts.password}@", f"{parts.username}:***@") if parts.password else url
