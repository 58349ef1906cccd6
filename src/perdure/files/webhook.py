"""Events posted to an address as they happen: in a thread, never waited for, tried again, dropped and counted at worst."""

from __future__ import annotations

import contextlib
import json
import queue
import threading
import urllib.error
import urllib.request
from collections.abc import Mapping
from typing import Any
from urllib.parse import urlsplit

from perdure.errors import ParameterError

_WAITING = 1000  # events that may wait
_TRIES, _TIMEOUT, _PAUSE = 3, 5.0, 1.0


class Webhook:
    """Posts values as JSON, one a request, in their order.

    Parameters
    ----------
    url : str
        http:// or https://.

    Raises
    ------
    ParameterError
        For another address.
    """

    def __init__(self, url: str, pause: float = _PAUSE) -> None:
        try:
            parts = urlsplit(url)
        except ValueError:
            parts = urlsplit("")
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise ParameterError("a webhook must be an address that begins with http:// or https://")
        self.sent = self.dropped = 0
        self.why = ""  # the last one was not sent
        self._url, self._pause = url, pause
        self._queue: queue.Queue[bytes | None] = queue.Queue(_WAITING)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._work, name="perdure-webhook", daemon=True)
        self._thread.start()

    def post(self, value: Mapping[str, Any]) -> None:
        """Have a value posted; dropped where too many wait."""
        try:
            self._queue.put_nowait(json.dumps(value).encode())
        except queue.Full:
            self.dropped += 1

    def close(self, timeout: float = 5.0) -> None:
        """Give what waits a last chance of `timeout` seconds."""
        with contextlib.suppress(queue.Full):
            self._queue.put(None, timeout=timeout)
        self._thread.join(timeout)
        self._stop.set()

    def _work(self) -> None:
        while not self._stop.is_set() and (body := self._queue.get()) is not None:
            for attempt in range(_TRIES):
                if self._posted(body):
                    self.sent += 1
                    break
                if attempt + 1 < _TRIES and self._stop.wait(self._pause * 2**attempt):
                    return
            else:
                self.dropped += 1

    def _posted(self, body: bytes) -> bool:
        request = urllib.request.Request(self._url, body, {"Content-Type": "application/json"}, method="POST")
        try:
            with urllib.request.urlopen(request, timeout=_TIMEOUT):
                return True
        except (urllib.error.URLError, OSError, ValueError) as error:
            self.why = str(getattr(error, "reason", error))
            return False
