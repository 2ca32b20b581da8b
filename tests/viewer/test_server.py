"""Who may ask the viewer's server, and for what: this machine, with the token, a short list of names."""

import http.client
import io
import json
import socket
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.raster import ROOT
from helpers.viewing import SIZE, drag, message
from PIL import Image

import rasterizer as rz
from rasterizer.viewer.controls import MAX_BYTES
from rasterizer.viewer.server import Server
from rasterizer.viewer.session import Session

SCENE = rz.load(str(ROOT / "models" / "cube.obj"))


@pytest.fixture(scope="module")
def server():
    with serving(Session(SCENE, title="cübe.obj", threads=1)) as server:
        yield server


class serving:
    """A server on a thread of its own inside a `with` block."""

    def __init__(self, session, **options):
        self.server = Server(session, **options)
        self.thread = threading.Thread(target=self.server.serve)

    def __enter__(self):
        self.thread.start()
        return self.server

    def __exit__(self, *_):
        self.server.shutdown()
        self.server.server_close()
        self.thread.join(10)
        assert not self.thread.is_alive()


def ask(server, method="GET", name="", body=None, path=None, **headers):
    """Status, headers and content of an answer."""
    connection = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=10)
    connection.request(method, f"/{server.token}/{name}" if path is None else path, body, headers)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, answer.headers, content


def ask_raw(server, text: bytes) -> bytes:
    """What is answered to bytes that may be no HTTP."""
    with socket.create_connection(("127.0.0.1", server.server_address[1]), timeout=10) as connection:
        connection.sendall(text.replace(b"TOKEN", server.token.encode()))
        connection.shutdown(socket.SHUT_WR)
        parts = []
        while part := connection.recv(65536):
            parts.append(part)
    return b"".join(parts)


def status_of(answer: bytes) -> int:
    return int(answer.split(b" ", 2)[1]) if answer.startswith(b"HTTP/") else 0  # HTTP 0.9 has none


def assert_answers(server, status, requests):
    """The status of the answer to each of several requests, given as `ask` takes them or as bytes."""
    for request in requests:
        found = status_of(ask_raw(server, request)) if isinstance(request, bytes) else ask(server, **request)[0]
        assert found == status, f"{str(request)[:90]}: {found}, not {status}"


PAGE = Path(rz.__file__).parent / "viewer" / "page"


def test_the_page_and_its_parts_are_served_and_refer_to_nothing_outside(server):
    for file in PAGE.iterdir():
        name = "" if file.name == "index.html" else file.name
        status, headers, content = ask(server, name=name)
        kind = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}[file.suffix]
        assert status == 200 and headers["Content-Type"] == f"{kind}; charset=utf-8", name
        assert content == file.read_bytes(), name
        assert "default-src 'none'" in headers["Content-Security-Policy"] and headers["Cache-Control"] == "no-store"
        assert headers["X-Content-Type-Options"] == "nosniff" and headers["Referrer-Policy"] == "no-referrer"
        assert not [each for each in headers if each.lower().startswith("access-control")]
        text = content.decode()
        assert "://" not in text and "<style" not in text and "onclick" not in text, file.name


def test_a_message_is_answered_with_a_line_of_json_and_a_picture(server):
    status, _, content = ask(server, "POST", "frame", json.dumps(message(drag(5, 5), is_rest=True)))
    line, _, picture = content.partition(b"\n")
    told = json.loads(line)
    assert status == 200 and told["type"] == "image/png" and told["title"] == "cübe.obj"
    found = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"))
    assert not differences(found, server.session.frame.rgb) and found.shape[:2] == SIZE[::-1]


def test_a_connection_serves_many_pictures(server):
    connection = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=10)
    connection.connect()
    mine = connection.sock
    for _ in range(3):
        connection.request("POST", f"/{server.token}/frame", json.dumps(message(drag(1, 0))))
        assert connection.getresponse().read() and connection.sock is mine
    connection.close()


def test_without_the_token_nothing_is_answered(server):
    paths = ("/", "", "/x/", "/TOKEN", "/TOKENx/", "/x/TOKEN/", "*", "/\u00fc/", "//TOKEN", "http://127.0.0.1/TOKEN/",
             "TOKEN/", "/TOKE/", "/token/")  # fmt: skip
    for path in paths:
        answer = ask_raw(server, f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        assert status_of(answer) in (0, 400, 403), f"{path}: {answer[:80]}"
        assert b"<" not in answer and server.token.encode() not in answer, path
    wrong = server.token[:-1] + ("A" if server.token[-1] != "A" else "B")
    assert ask(server, "POST", path=f"/{wrong}/frame", body=json.dumps(message()))[0] == 403


def test_only_names_of_the_table_are_served(server):
    names = (
        "../session.py",
        "%2e%2e/session.py",
        "..\\session.py",
        "page.js/../../session.py",
        "index.html",
        "page.js?x=1",
        "page.js%00",
        "C:/x",
        "//etc/passwd",
        "/etc/passwd",
        "favicon.ico",
        "Page.js",
        "frame/",
    )
    assert_answers(server, 404, [f"GET /TOKEN/{name} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()
                                 for name in names])  # fmt: skip


def test_this_machine_alone_is_answered_so_that_no_name_can_be_bound_to_it(server):
    own = ("127.0.0.1", "localhost", "LOCALHOST:80", "127.0.0.1:65535", "[::1]:8000")
    assert_answers(server, 200, [{"Host": host} for host in own])
    others = (
        "example.com",
        "127.0.0.1.example.com",
        "localhost.example.com:80",
        "",
        "127.0.0.1@example.com",
        "0.0.0.0",
        "localhost/",
        "example.com#localhost",
        "localhost:x",
        "[::1",
        "192.168.0.1",
        "127.0.0.1:99999",
    )
    assert_answers(server, 403, [{"Host": host} for host in others])  # fmt: skip
    heads = (b"", b"Host: localhost\r\nHost: example.com\r\n", b"Host: localhost\r\nHost: localhost\r\n")
    assert_answers(server, 403, [b"GET /TOKEN/ HTTP/1.1\r\n" + hosts + b"\r\n" for hosts in heads])
    assert_answers(server, 403, [b"GET /TOKEN/ HTTP/1.0\r\n\r\n"])


def test_pages_of_other_origins_are_refused(server):
    def posted(origin):
        return {"method": "POST", "name": "frame", "body": json.dumps(message()), "Origin": origin}

    others = ("http://example.com", "null", "https://127.0.0.1", "http://127.0.0.1:1", "file://")
    assert_answers(server, 403, map(posted, others))
    assert_answers(server, 200, [posted(f"http://127.0.0.1:{server.server_address[1]}")])
    assert_answers(server, 403, [{"Origin": "http://example.com"}])


def test_pictures_are_asked_for_by_post_and_pages_by_get(server):
    assert_answers(server, 501, [{"method": method, "name": "frame"} for method in ("HEAD", "PUT", "OPTIONS")])
    others = [{"method": "POST", "name": name} for name in ("", "alive", "nothing")]
    assert_answers(server, 404, [{"name": "frame"}, *others])


def test_a_message_needs_a_length_that_is_not_large(server):
    for lines, status in (
        ("", 411),
        ("Transfer-Encoding: chunked\r\n", 411),
        ("Content-Length: -2\r\n", 411),
        ("Content-Length: 2_0\r\n", 411),
        ("Content-Length: \u00b2\r\n", 411),
        (f"Content-Length: {MAX_BYTES + 1}\r\n", 413),
        ("Content-Length: " + "9" * 5000 + "\r\n", 413),
        ("Content-Length: 9\r\n", 400),  # more than comes
    ):
        head = f"POST /TOKEN/frame HTTP/1.1\r\nHost: localhost\r\n{lines}\r\n"
        assert_answers(server, status, [head.encode() + b"{}"])


def test_what_is_no_message_is_told_and_the_server_goes_on(server):
    for body in (b"", b"{", b"\xff\xfe", b"[" * 30000, b"null", b"{}", b'{"size": 1e999}', b"1" * 5000):
        status, _, content = ask(server, "POST", "frame", body)
        assert status == 400 and content.endswith(b"\n") and len(content) < 400, body[:9]
    assert ask(server, "POST", "frame", json.dumps(message()))[0] == 200


def test_what_is_no_http_does_no_harm(server):
    for text in (b"\r\n\r\n", b"\x16\x03\x01\x02\x00", b"GET\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n"):
        assert status_of(ask_raw(server, text)) in (0, 400, 403, 505) or text.startswith(b"\x16"), text
    assert_answers(server, 414, [b"GET /" + b"x" * 70000 + b" HTTP/1.1\r\n\r\n"])
    many = b"".join(b"X%d: 1\r\n" % k for k in range(200))
    assert_answers(server, 431, [b"GET /TOKEN/ HTTP/1.1\r\n" + many + b"\r\n"])
    assert ask(server)[0] == 200


def test_a_fault_of_the_program_is_told_and_the_server_goes_on(capfd):
    told = []
    broken = SimpleNamespace(title="broken", answer=lambda _: 1 / 0, close=lambda: None)
    with serving(broken, note=told.append) as server:
        status, _, content = ask(server, "POST", "frame", "{}")
        assert status == 500 and b"ZeroDivisionError" in content and "ZeroDivisionError" in told[0]
        assert ask(server)[0] == 200
    assert capfd.readouterr() == ("", "")


def test_a_port_that_is_taken_is_told(server):
    with pytest.raises(rz.OutputError, match=f"port {server.server_address[1]} of 127.0.0.1"):
        Server(Session(SCENE, threads=1), server.server_address[1])


def test_it_listens_on_this_machine_alone_with_a_token_of_its_own(server):
    assert server.server_address[0] == "127.0.0.1"
    with serving(Session(SCENE, threads=1)) as other:
        assert other.token != server.token and len(other.token) >= 32


def test_the_page_notices_when_the_server_ends():
    """What `--once` does with pages that are closed is in tests/cli/test_view.py."""
    with serving(Session(SCENE, threads=1)) as server:
        page = socket.create_connection(server.server_address[:2], timeout=10)
        page.sendall(f"GET /{server.token}/alive HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        assert status_of(page.recv(65536)) == 200
    assert page.recv(1) == b""
    page.close()
