"""What the viewer must not answer."""

from __future__ import annotations

import http.client
import json
from pathlib import Path

import pytest
from web.conftest import Viewer, write_run

from perdure.files.runs import RunFolder


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, film: Path) -> RunFolder:
    folder = write_run(tmp_path_factory.mktemp("runs") / "run", film)
    (folder.path / "private.txt").write_text("nobody's business")
    return folder


@pytest.fixture(scope="module")
def viewer(run: RunFolder, serve) -> Viewer:
    return serve(run)


def raw(viewer: Viewer, path: str, method: str = "GET", **headers: str) -> tuple[int, bytes]:
    """A request whose path is sent as it is written."""
    line = http.client.HTTPConnection("127.0.0.1", viewer.port, timeout=20)
    try:
        line.putrequest(method, path, skip_host="host" in headers)
        for name, value in headers.items():
            line.putheader(name.replace("_", "-"), value)
        line.endheaders()
        answer = line.getresponse()
        return answer.status, answer.read()
    finally:
        line.close()


@pytest.mark.parametrize(
    "path",
    [
        "/static/../app.py",
        "/static/..%2fapp.py",
        "/static/%2e%2e/app.py",
        "/static/....//app.py",
        "/static//etc/passwd",
        "/static/..\\app.py",
        "/../../../../etc/passwd",
        "/api/runs/0/pictures/../../private.txt",
        "/api/runs/0/pictures/..%2f..%2fprivate.txt",
        "/api/runs/0/private.txt",
        "/run.json",
        "/tracks.jsonl",
        "/static/",
        "/static/app.js%00.html",
    ],
)
def test_no_address_leads_to_a_file_that_is_not_part_of_the_page(viewer: Viewer, path: str):
    status, body = raw(viewer, path)
    assert status in (400, 404)
    assert b"nobody's business" not in body
    assert b"root:" not in body
    assert b"import" not in body


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "", "[::1]", "127.0.0.1:x"]
)
def test_another_hosts_name_is_refused(viewer: Viewer, host: str):
    assert raw(viewer, "/api/session", host=host)[0] == 421


def test_localhost_is_answered(viewer: Viewer):
    assert raw(viewer, "/api/session", host="localhost:1")[0] == 200


@pytest.mark.parametrize("token", ["", "wrong", "Secret", "secret0"])
def test_without_the_token_nothing_is_written(viewer: Viewer, run: RunFolder, token: str):
    line = {"do": "delete", "ids": [1], "begin": 0}
    answer = viewer.ask("/api/runs/0/corrections", "POST", line, x_perdure_token=token)
    assert answer.status == 403
    assert not run.corrections.exists()


@pytest.mark.parametrize("path", ["zones", "calibration", "corrections"])
@pytest.mark.parametrize("method", ["PUT", "POST", "DELETE", "PATCH"])
def test_no_way_of_writing_goes_without_the_token(viewer: Viewer, run: RunFolder, path: str, method: str):
    before = sorted(one.name for one in run.path.iterdir())
    assert viewer.ask(f"/api/runs/0/{path}", method, {}, x_perdure_token="").status == 403
    assert sorted(one.name for one in run.path.iterdir()) == before


def test_another_pages_write_is_refused_even_with_the_token(viewer: Viewer):
    own = f"http://127.0.0.1:{viewer.port}"
    for origin, status in (("http://evil.example", 403), ("null", 403), (own, 422)):
        assert viewer.ask("/api/runs/0/corrections", "POST", {"do": "nothing"}, origin=origin).status == status


def test_a_giant_body_is_refused_before_it_is_read(viewer: Viewer):
    token = {"x_perdure_token": viewer.token}
    assert raw(viewer, "/api/runs/0/zones", "PUT", content_length=str(10**11), **token)[0] == 413
    assert raw(viewer, "/api/runs/0/zones", "PUT", content_length="1" * 30, **token)[0] in (400, 413)


def test_a_giant_body_of_unknown_length_is_cut_off(viewer: Viewer):
    line = http.client.HTTPConnection("127.0.0.1", viewer.port, timeout=20)
    pieces = (b"x" * 65536 for _ in range(40))
    try:
        line.request("PUT", "/api/runs/0/zones", pieces, {"x-perdure-token": viewer.token}, encode_chunked=True)
        status = line.getresponse().status
    except (BrokenPipeError, ConnectionResetError):
        status = 413  # the server hung up while it was being told
    finally:
        line.close()
    assert status == 413


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("rows?from=0&to=100000000", 422),
        ("rows?from=-1&to=3", 422),
        ("rows?from=9&to=3", 422),
        ("rows?from=1e3&to=3", 422),
        ("rows", 422),
        ("shapes?from=0&to=5000", 422),
        ("explain?id=0&frame=1", 422),
        ("explain?id=1&frame=" + "9" * 40, 422),
        ("pictures/999999999999.jpg", 404),
        ("pictures/-1.jpg", 404),
        ("truth/rows?from=0&to=3", 422),
        ("rows?from=0&to=3&" + "x" * 4000, 414),
    ],
)
def test_what_cannot_be_asked_is_refused_in_words(viewer: Viewer, path: str, status: int):
    answer = viewer.ask(f"/api/runs/0/{path}")
    assert answer.status == status
    if status != 404 or "jpg" not in path:
        assert answer.value["error"]


def test_a_run_that_was_not_given_is_not_there(viewer: Viewer):
    assert viewer.ask("/api/runs/1/state").status == 422


@pytest.mark.parametrize(
    "body",
    [b"", b"{", b"\xff\xfe", b"[" * 5000, b"[]", b'{"do":"format"}', b'{"do":"swap","ids":[1,1],"begin":0}'],
)
def test_a_body_that_is_no_correction_is_refused_in_words(viewer: Viewer, run: RunFolder, body: bytes):
    answer = viewer.ask("/api/runs/0/corrections", "POST", body)
    assert answer.status == 422
    assert json.loads(answer.body)["error"]
    assert not run.corrections.exists()


def test_every_answer_forbids_foreign_scripts_and_frames(viewer: Viewer):
    for path in ("/", "/api/session", "/static/main.js", "/nowhere"):
        headers = viewer.ask(path).headers
        assert "default-src 'none'" in headers["content-security-policy"]
        assert "frame-ancestors 'none'" in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["cross-origin-resource-policy"] == "same-origin"


def test_the_page_asks_nobody_else(viewer: Viewer):
    from importlib import resources

    for part in (resources.files("perdure.web") / "static").iterdir():
        text = Path(str(part)).read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "")
        assert "http://" not in text
        assert "https://" not in text
        assert "@import" not in text
