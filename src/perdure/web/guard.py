"""Who may ask what: this machine's own names only, writers with the token only, nothing giant."""

from __future__ import annotations

import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse

LARGEST_BODY = 1 << 20  # bytes
_TOO_LARGE = f"a request may have {LARGEST_BODY >> 20} MiB at most"
_LONGEST_PATH = 2048
TOKEN = "x-perdure-token"
_READS = ("GET", "HEAD")
Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

_HEADERS = (
    (
        b"content-security-policy",
        b"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
        b"form-action 'none'; frame-ancestors 'none'; base-uri 'none'",
    ),
    (b"x-content-type-options", b"nosniff"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"referrer-policy", b"no-referrer"),
)


class Guard:
    """Refuses, before the application sees it, what it must not answer.

    Another host's name in `Host` (a page elsewhere whose name was made to lead here) is 421; a write without the
    token, or from another origin, 403; a body over `LARGEST_BODY` 413; a long path 414.

    Parameters
    ----------
    app : ASGI application
    token : str
        What every write must bring in the header `X-Perdure-Token`.
    """

    def __init__(self, app: App, token: str) -> None:
        self._app, self._token = app, token.encode()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a refusal, or pass the request on."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return
        refusal = self._refusal(scope, Headers(scope=scope))

        async def sent(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", ()), *_HEADERS]
            await send(message)

        if refusal is not None:
            await refusal(scope, receive, sent)
            return
        await self._app(scope, _limited(receive), sent)

    def _refusal(self, scope: Scope, headers: Headers) -> JSONResponse | None:
        host = headers.get("host", "")
        if not _is_own(host):
            return _refused(421, "this viewer answers to 127.0.0.1 and localhost only")
        if len(scope.get("raw_path") or scope["path"]) + len(scope.get("query_string", b"")) > _LONGEST_PATH:
            return _refused(414, "the address is too long")
        length = headers.get("content-length", "0")
        if not length.isdigit() or len(length) > 12 or int(length) > LARGEST_BODY:
            return _refused(413, _TOO_LARGE)
        if scope["method"] in _READS:
            return None
        if not hmac.compare_digest(headers.get(TOKEN, "").encode(), self._token):
            return _refused(403, "writing needs the token: open the address that `perdure view` printed")
        origin = headers.get("origin")
        if origin is not None and origin != f"http://{host}":
            return _refused(403, "another page may not write here")
        return None


def _is_own(host: str) -> bool:
    name, _, port = host.partition(":")
    return name in ("127.0.0.1", "localhost") and (not port or port.isdigit())


def _refused(status: int, why: str) -> JSONResponse:
    return JSONResponse({"error": why}, status)


def _limited(receive: Receive) -> Receive:
    """`receive`, which raises a 413 where the pieces of a body sum up to more than may be."""
    got = 0

    async def limited() -> Message:
        nonlocal got
        message = await receive()
        if message["type"] == "http.request":
            got += len(message.get("body", b""))
            if got > LARGEST_BODY:
                raise HTTPException(413, _TOO_LARGE)
        return message

    return limited
