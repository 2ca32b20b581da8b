"""Who may ask the viewer's server, and for what: this machine, with the token, a short list of names."""

import http.client
import io
import json
import socket
import threading
import time

import numpy as np
import pytest
from helpers.raster import ROOT
from helpers.viewing import SIZE, drag, message
from PIL import Image

import rasterizer as rz
from rasterizer.viewer import server as server_module
from rasterizer.viewer.events import MOST_BYTES
from rasterizer.viewer.server import Server
from rasterizer.viewer.session import Session

SCENE = rz.load(str(ROOT / "models" / "cube.obj"))


@pytest.fixture
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


@pytest.mark.parametrize(
    ("name", "kind"), [("", "html"), ("page.js", "javascript"), ("viewer.js", "javascript"), ("viewer.css", "css")]
)
def test_the_page_and_its_parts_are_served(server, name, kind):
    status, headers, content = ask(server, name=name)
    assert status == 200 and kind in headers["Content-Type"] and content
    assert "default-src 'none'" in headers["Content-Security-Policy"] and headers["Cache-Control"] == "no-store"
    assert headers["X-Content-Type-Options"] == "nosniff" and headers["Referrer-Policy"] == "no-referrer"
    assert not [name for name in headers if name.lower().startswith("access-control")]


def test_the_page_refers_to_nothing_outside(server):
    for file in (server_module._FOLDER).iterdir():
        text = file.read_text(encoding="utf-8")
        assert "://" not in text and "<style" not in text and "onclick" not in text, file.name
        assert file.name in {each for each, _ in server_module._FILES.values()}, "a file that nobody can ask for"


def test_a_message_is_answered_with_a_line_of_json_and_a_picture(server):
    status, _, content = ask(server, "POST", "frame", json.dumps(message(drag(5, 5), is_rest=True)))
    line, _, picture = content.partition(b"\n")
    told = json.loads(line)
    assert status == 200 and told["type"] == "image/png" and told["title"] == "cübe.obj"
    found = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"))
    assert np.array_equal(found, server.session.frame.rgb) and found.shape[:2] == SIZE[::-1]


def test_a_connection_serves_many_pictures(server):
    connection = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=10)
    connection.connect()
    mine = connection.sock
    for _ in range(3):
        connection.request("POST", f"/{server.token}/frame", json.dumps(message(drag(1, 0))))
        assert connection.getresponse().read() and connection.sock is mine
    connection.close()


@pytest.mark.parametrize(
    "path",
    [
        "/",
        "",
        "/x/",
        "/TOKEN",
        "/TOKENx/",
        "/x/TOKEN/",
        "*",
        "/\u00fc/",
        "//TOKEN",
        "http://127.0.0.1/TOKEN/",
        "TOKEN/",
    ],
)
def test_without_the_token_nothing_is_answered(server, path):
    answer = ask_raw(server, f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
    assert status_of(answer) in (0, 400, 403) and b"<" not in answer and server.token.encode() not in answer, answer


@pytest.mark.parametrize(
    "name",
    ["../session.py", "%2e%2e/session.py", "..\\session.py", "page.js/../../session.py", "index.html", "page.js?x=1",
     "page.js%00", "C:/x", "//etc/passwd", "/etc/passwd", "favicon.ico", "Page.js", "frame/"],
)  # fmt: skip
def test_only_names_of_the_table_are_served(server, name):
    answer = ask_raw(server, f"GET /TOKEN/{name} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
    assert status_of(answer) == 404 and b"class Session" not in answer


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "LOCALHOST:80", "127.0.0.1:65535", "[::1]:8000"])
def test_this_machine_is_answered_by_its_own_names(server, host):
    assert ask(server, Host=host)[0] == 200


@pytest.mark.parametrize(
    "host",
    ["example.com", "127.0.0.1.example.com", "localhost.example.com:80", "", "127.0.0.1@example.com", "0.0.0.0",
     "localhost/", "example.com#localhost", "localhost:x", "[::1", "192.168.0.1", "127.0.0.1:99999"],
)  # fmt: skip
def test_other_names_are_refused_so_that_no_name_can_be_bound_to_this_machine(server, host):
    assert ask(server, Host=host)[0] == 403


def test_a_request_needs_one_name_of_the_host(server):
    for hosts in (b"", b"Host: localhost\r\nHost: example.com\r\n", b"Host: localhost\r\nHost: localhost\r\n"):
        assert status_of(ask_raw(server, b"GET /TOKEN/ HTTP/1.1\r\n" + hosts + b"\r\n")) == 403
    assert status_of(ask_raw(server, b"GET /TOKEN/ HTTP/1.0\r\n\r\n")) == 403


@pytest.mark.parametrize("origin", ["http://example.com", "null", "https://127.0.0.1", "http://127.0.0.1:1", "file://"])
def test_pages_of_other_origins_are_refused(server, origin):
    body = json.dumps(message())
    assert ask(server, "POST", "frame", body, Origin=origin)[0] == 403
    own = f"http://127.0.0.1:{server.server_address[1]}"
    assert ask(server, "POST", "frame", body, Origin=own)[0] == 200


@pytest.mark.parametrize("method", ["HEAD", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE"])
def test_other_methods_are_refused(server, method):
    status, headers, _ = ask(server, method, "frame")
    assert status == 405 and headers["Allow"] == "GET, POST"
    assert status_of(ask_raw(server, b"BREW /TOKEN/ HTTP/1.1\r\nHost: localhost\r\n\r\n")) == 501


def test_pictures_are_asked_for_by_post_and_pages_by_get(server):
    assert ask(server, "GET", "frame")[0] == 405
    assert ask(server, "POST", "")[0] == 405
    assert ask(server, "POST", "nothing")[0] == 404


@pytest.mark.parametrize(
    ("lines", "status"),
    [
        ("", 411),
        ("Transfer-Encoding: chunked", 411),
        ("Content-Length: 2\r\nContent-Length: 2", 411),
        ("Content-Length: -2", 400),
        ("Content-Length: +2", 400),
        ("Content-Length: 2_0", 400),
        ("Content-Length: \u00b2", 400),
        (f"Content-Length: {MOST_BYTES + 1}", 413),
        ("Content-Length: " + "9" * 5000, 413),
        ("Content-Length: 9", 400),  # more than comes
    ],
)
def test_a_message_needs_a_length_that_is_not_large(server, lines, status):
    head = f"POST /TOKEN/frame HTTP/1.1\r\nHost: localhost\r\n{lines}\r\n\r\n".replace("\r\n\r\n\r\n", "\r\n\r\n")
    assert status_of(ask_raw(server, head.encode() + b"{}")) == status


@pytest.mark.parametrize(
    "body", [b"", b"{", b"\xff\xfe", b"[" * 30000, b"null", b"{}", b'{"size": 1e999}', b"1" * 5000], ids=lambda b: b[:9]
)
def test_what_is_no_message_is_told_and_the_server_goes_on(server, body):
    status, _, content = ask(server, "POST", "frame", body)
    assert status == 400 and content.endswith(b"\n") and len(content) < 400
    assert ask(server, "POST", "frame", json.dumps(message()))[0] == 200


@pytest.mark.parametrize("text", [b"\r\n\r\n", b"\x16\x03\x01\x02\x00", b"GET\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n"])
def test_what_is_no_http_does_no_harm(server, text):
    assert status_of(ask_raw(server, text)) in (0, 400, 403, 505) or text.startswith(b"\x16")
    assert status_of(ask_raw(server, b"GET /" + b"x" * 70000 + b" HTTP/1.1\r\n\r\n")) == 414
    many = b"".join(b"X%d: 1\r\n" % k for k in range(200))
    assert status_of(ask_raw(server, b"GET /TOKEN/ HTTP/1.1\r\n" + many + b"\r\n")) == 431
    assert ask(server)[0] == 200


def test_a_fault_of_the_program_is_told_and_the_server_goes_on(monkeypatch, capfd):
    told = []
    with serving(Session(SCENE, threads=1), note=told.append) as server:
        with monkeypatch.context() as patch:
            patch.setattr(Session, "answer", lambda *_: 1 / 0)
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


def test_connections_that_are_held_open_are_not_endless(server, monkeypatch):
    port = server.server_address[1]
    held = [socket.create_connection(("127.0.0.1", port)) for _ in range(server_module._MOST_CONNECTIONS)]
    time.sleep(0.3)
    with socket.create_connection(("127.0.0.1", port), timeout=5) as more:
        assert more.recv(1) == b"", "one more is closed at once"
    for connection in held:
        connection.close()
    deadline = time.monotonic() + 5
    while time.monotonic() < deadline:
        try:
            assert ask(server)[0] == 200
            break
        except (ConnectionError, http.client.HTTPException):
            time.sleep(0.05)
    else:
        pytest.fail("connections that were closed are still counted")


# --- the end --------------------------------------------------------------------------------------------------


def hold(server) -> socket.socket:
    """What a page holds open."""
    connection = socket.create_connection(("127.0.0.1", server.server_address[1]), timeout=10)
    connection.sendall(f"GET /{server.token}/alive HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
    assert status_of(connection.recv(65536)) == 200
    return connection


def test_once_ends_when_the_last_page_is_closed_and_not_while_one_is_loaded_again(monkeypatch):
    monkeypatch.setattr(server_module, "_GRACE", 0.3)
    ends = serving(Session(SCENE, threads=1), is_once=True)
    with ends as server:
        first, second = hold(server), hold(server)
        first.close()
        time.sleep(0.6)
        assert ends.thread.is_alive(), "one page is open"
        second.close()
        again = hold(server)
        time.sleep(0.6)
        assert ends.thread.is_alive(), "the page was loaded again"
        again.close()
        ends.thread.join(5)
        assert not ends.thread.is_alive()


def test_the_page_notices_when_the_server_ends():
    with serving(Session(SCENE, threads=1)) as server:
        page = hold(server)
    assert page.recv(1) == b""
    page.close()
