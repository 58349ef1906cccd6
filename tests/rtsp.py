"""A camera drawn for tests: an RTSP server on this machine that sends VP8 in RTP over TCP (RFC 2326, 3550, 7741)."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Callable
from fractions import Fraction

import av
import numpy as np

_PIECE = 1200  # bytes of a packet
_CLOCK = 90000  # ticks a second of video in RTP


class Camera:
    """Serves pictures `draw(k)` at `fps` to whoever asks, until it is closed; k goes on while nobody looks."""

    def __init__(self, draw: Callable[[int], np.ndarray], fps: float = 10.0, port: int = 0) -> None:
        self.draw, self.fps = draw, fps
        self.begun = time.monotonic()
        self._open: list[socket.socket] = []
        self.start(port)

    def start(self, port: int = 0) -> None:
        """Listen, again on the same port after `stop`."""
        self._server = socket.socket()
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._server.bind(("127.0.0.1", port))
        self._server.listen()
        self.port = self._server.getsockname()[1]
        self._stop = threading.Event()
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    def stop(self) -> None:
        """Be gone: no one is answered, and who looks is cut off."""
        self._stop.set()
        with contextlib.suppress(OSError):
            self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        for one in self._open:
            with contextlib.suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
            one.close()
        self._open = []
        for thread in self._threads:
            thread.join(timeout=5)

    @property
    def url(self) -> str:
        return f"rtsp://127.0.0.1:{self.port}/camera"

    def _accept(self) -> None:
        while not self._stop.is_set():
            try:
                peer, _ = self._server.accept()
            except OSError:
                return
            self._open.append(peer)
            thread = threading.Thread(target=self._serve, args=(peer,), daemon=True)
            self._threads.append(thread)
            thread.start()

    def _serve(self, peer: socket.socket) -> None:
        try:
            while not self._stop.is_set():
                request = self._request(peer)
                if not request:
                    return
                self._answer(peer, request)
                if request.startswith("PLAY"):
                    self._play(peer)
                    return
        except OSError:
            return

    @staticmethod
    def _request(peer: socket.socket) -> str:
        data = b""
        while not data.endswith(b"\r\n\r\n"):
            piece = peer.recv(1)
            if not piece:
                return ""
            data += piece
        return data.decode()

    def _answer(self, peer: socket.socket, request: str) -> None:
        number = next(
            line.split(":")[1].strip() for line in request.splitlines() if line.lower().startswith("cseq")
        )
        head, body = ["RTSP/1.0 200 OK", f"CSeq: {number}"], ""
        if request.startswith("OPTIONS"):
            head.append("Public: OPTIONS, DESCRIBE, SETUP, PLAY, TEARDOWN")
        elif request.startswith("DESCRIBE"):
            body = (
                "v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=camera\r\nt=0 0\r\nm=video 0 RTP/AVP 96\r\n"
                f"c=IN IP4 127.0.0.1\r\na=rtpmap:96 VP8/{_CLOCK}\r\na=framerate:{self.fps:g}\r\na=control:video\r\n"
            )
            head += ["Content-Type: application/sdp", f"Content-Base: {self.url}/", f"Content-Length: {len(body)}"]
        elif request.startswith("SETUP"):
            head += ["Transport: RTP/AVP/TCP;unicast;interleaved=0-1", "Session: 1"]
        else:
            head.append("Session: 1")
        peer.sendall(("\r\n".join(head) + "\r\n\r\n" + body).encode())

    def _play(self, peer: socket.socket) -> None:
        coder = av.CodecContext.create("libvpx", "w")
        first = self.draw(0)
        coder.height, coder.width = first.shape[:2]
        coder.pix_fmt, coder.time_base = "yuv420p", Fraction(1, _CLOCK)
        coder.framerate = Fraction(self.fps).limit_denominator(1000)
        coder.options = {"deadline": "realtime", "cpu-used": "8", "lag-in-frames": "0", "g": "10"}
        coder.bit_rate = 2_000_000
        sequence = 0
        while not self._stop.is_set():
            k = int((time.monotonic() - self.begun) * self.fps) + 1
            if self._stop.wait(max(0.0, self.begun + k / self.fps - time.monotonic())):
                return
            picture = av.VideoFrame.from_ndarray(self.draw(k), format="rgb24")
            picture.pts = round(k / self.fps * _CLOCK)
            for packet in coder.encode(picture):
                sequence = self._send(peer, bytes(packet), picture.pts, sequence)

    @staticmethod
    def _send(peer: socket.socket, data: bytes, stamp: int, sequence: int) -> int:
        pieces = [data[at : at + _PIECE] for at in range(0, len(data), _PIECE)]
        for number, piece in enumerate(pieces):
            last = number + 1 == len(pieces)
            head = struct.pack(
                ">BBHII", 0x80, 96 | (0x80 if last else 0), sequence & 0xFFFF, stamp & 0xFFFFFFFF, 1
            )
            body = head + bytes([0x10 if number == 0 else 0x00]) + piece
            peer.sendall(b"$\x00" + struct.pack(">H", len(body)) + body)
            sequence += 1
        return sequence
