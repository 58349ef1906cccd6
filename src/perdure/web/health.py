"""How a live run is: a small page on this machine, and the same as JSON for whoever watches it."""

from __future__ import annotations

import html
import json
import threading
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from perdure.errors import OutputError

_HOSTS = ("127.0.0.1", "localhost")
_STYLE = """
:root { color-scheme: light dark; --ink: #1d2733; --paper: #f6f7f9; --card: #fff; --line: #d9dee5; --good: #1a7f4b; --bad: #b3261e }
@media (prefers-color-scheme: dark) { :root { --ink: #e7ebf0; --paper: #14181d; --card: #1d232b; --line: #333c48; --good: #58c08a; --bad: #ff8a80 } }
body { margin: 0; padding: 2rem; font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper) }
main { max-width: 46rem; margin: auto } h1 { font-size: 1.25rem; margin: 0 0 1rem; overflow-wrap: anywhere }
dl { display: grid; grid-template-columns: repeat(auto-fill, minmax(13rem, 1fr)); gap: .75rem; margin: 0 }
div { background: var(--card); border: 1px solid var(--line); border-radius: 8px; padding: .75rem 1rem }
dt { font-size: .8rem; opacity: .75 } dd { margin: 0; font-size: 1.35rem; font-variant-numeric: tabular-nums }
.good { color: var(--good) } .bad { color: var(--bad) } p { overflow-wrap: anywhere }
"""


class Health:
    """Serves what `tell` returns, at / for people and at /health.json for programs.

    Parameters
    ----------
    port : int
        0 for any that is free.
    tell : function
        Returns plain values: `source`, `state`, `why` and figures by name; called by the thread of a request.

    Raises
    ------
    OutputError
        If the port is taken.
    """

    def __init__(self, port: int, tell: Callable[[], Mapping[str, Any]]) -> None:
        try:
            self._server = ThreadingHTTPServer(("127.0.0.1", port), _handler(tell))
        except (OSError, OverflowError) as error:
            why = getattr(error, "strerror", None) or error
            raise OutputError(f"the health page cannot be served at port {port}: {why}; name another") from None
        self._server.daemon_threads = True
        self.url = f"http://127.0.0.1:{self._server.server_address[1]}/"
        self._thread = threading.Thread(target=self._server.serve_forever, name="perdure-health", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End serving."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


def _handler(tell: Callable[[], Mapping[str, Any]]) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            host = (self.headers.get("Host") or "").rpartition(":")[0] or (self.headers.get("Host") or "")
            if host not in _HOSTS:  # a page of elsewhere must not read it by a name that leads here
                self._answer(403, "text/plain", "ask for it by 127.0.0.1")
            elif self.path == "/health.json":
                self._answer(200, "application/json", json.dumps(tell()))
            elif self.path == "/":
                self._answer(200, "text/html; charset=utf-8", page(tell()))
            else:
                self._answer(404, "text/plain", "there are / and /health.json")

        def _answer(self, code: int, kind: str, text: str) -> None:
            body = text.encode()
            self.send_response(code)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *arguments: Any) -> None:
            """Write nothing: stdout may hold events."""

    return Handler


def page(told: Mapping[str, Any]) -> str:
    """Return the page that shows what a run tells of itself; it asks for itself anew every two seconds."""
    good = told.get("state") == "running"
    cells = "".join(
        f"<div><dt>{html.escape(str(name).replace('_', ' '))}</dt><dd>{html.escape(_shown(value))}</dd></div>"
        for name, value in told.items()
        if name not in ("source", "state", "why")
    )
    why = f"<p>{html.escape(str(told['why']))}</p>" if told.get("why") else ""
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><meta http-equiv="refresh" content="2">'
        f'<meta name="viewport" content="width=device-width"><title>perdure live</title><style>{_STYLE}</style></head>'
        f"<body><main><h1>{html.escape(str(told.get('source', '')))} "
        f'<span class="{"good" if good else "bad"}">{html.escape(str(told.get("state", "")))}</span></h1>{why}'
        f"<dl>{cells}</dl></main></body></html>"
    )


def _shown(value: object) -> str:
    if value is None:
        return "–"
    return f"{value:g}" if isinstance(value, float) else str(value)
