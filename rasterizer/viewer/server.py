"""The page of the viewer, served to this machine alone, by the standard library's HTTP server.

    GET  /TOKEN/            the page        GET  /TOKEN/alive   held open as long as the page is
    GET  /TOKEN/viewer.js   its parts       POST /TOKEN/frame   a message in, a line of JSON and a picture out

Who may ask:
- only programs of this machine can connect: it listens on 127.0.0.1;
- only who knows the address: it has a random token, compared in constant time. The terminal shows it, the browser keeps
  it in its history, and --open puts it on the command line of a browser;
- no page of another site: `Host` must be this machine's own name, so that a name that is made to point here (DNS
  rebinding) is of no use; a request that a page of another origin makes is refused by `Origin`, and there are no
  headers that would let it read an answer (CORS);
- what is served is a table of names, so that no path leads to another file.
"""

import hmac
import json
import secrets
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from ..errors import OutputError, RasterizerError, error_of
from .controls import MAX_BYTES
from .session import Reply, Session

HOST = "127.0.0.1"
_OWN_NAMES = ("127.0.0.1", "localhost", "::1")  # with any port: it may have been forwarded
_PATIENCE = 60.0  # seconds that a connection may be silent
_GRACE = 2.0  # seconds after which a page that has gone is not being loaded once more
_FOLDER = Path(__file__).parent / "page"
_FILES = {  # name: file and type
    "": ("index.html", "text/html; charset=utf-8"),
    "page.js": ("page.js", "text/javascript; charset=utf-8"),
    "viewer.js": ("viewer.js", "text/javascript; charset=utf-8"),
    "viewer.css": ("viewer.css", "text/css; charset=utf-8"),
    "page.css": ("page.css", "text/css; charset=utf-8"),
}
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class Server(ThreadingHTTPServer):
    """Serve one session to this machine until it is closed.

    Parameters
    ----------
    session : Session that is looked at
    port : number, 0 = one that is free
    is_once : whether `serve` ends when the last page has been closed
    note : function that is called with a line of text about what goes wrong; None = it is said nowhere

    Raises
    ------
    OutputError : the port is taken, or this process may not listen on it
    """

    daemon_threads = True
    block_on_close = False  # connections that are held open end with the process
    request_queue_size = 32

    def __init__(
        self,
        session: Session,
        port: int = 0,
        *,
        is_once: bool = False,
        note: Callable[[str], object] | None = None,
    ) -> None:
        self.session, self.is_once = session, is_once
        self.note = note or (lambda _: None)
        self.token = secrets.token_urlsafe(24)
        self._pages = _Pages()
        try:
            super().__init__((HOST, port), _Handler)
        except (OSError, OverflowError) as fault:
            reason = getattr(fault, "strerror", None) or fault
            raise OutputError(f"can't listen on port {port} of {HOST}: {reason}; port 0 is one that is free") from fault

    @property
    def url(self) -> str:
        """The address of the page, which holds the token."""
        return f"http://{HOST}:{self.server_address[1]}/{self.token}/"

    def serve(self) -> None:
        """Answer requests until `shutdown` is called, or the last page is closed where that is asked for."""
        if self.is_once:
            threading.Thread(target=self._end_with_the_last_page, daemon=True).start()
        self.serve_forever(poll_interval=0.1)

    def server_close(self) -> None:
        """Close the connections, which tells the pages, and end the threads that draw."""
        super().server_close()
        self._pages.close()
        self.session.close()

    def hold(self, connection: socket.socket) -> None:
        """Wait until a page closes its connection; it counts as open until then."""
        with self._pages.opened(connection), suppress(OSError):
            while connection.recv(1024):
                pass

    def _end_with_the_last_page(self) -> None:
        self._pages.wait_for_the_end()
        self.shutdown()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Connections that break are no fault; nothing is printed."""


class _Pages:
    """The pages that are open: a connection each."""

    def __init__(self) -> None:
        self._open: set[socket.socket] = set()
        self._changed = threading.Condition()
        self._was_open = False

    @contextmanager
    def opened(self, connection: socket.socket) -> Iterator[None]:
        """Count a page as open inside a `with` block."""
        with self._changed:
            self._open.add(connection)
            self._was_open = True
            self._changed.notify_all()
        try:
            yield
        finally:
            with self._changed:
                self._open.discard(connection)
                self._changed.notify_all()

    def wait_for_the_end(self) -> None:
        """Wait until a page was open and none is any more; one that is loaded again is given some time."""
        with self._changed:
            while True:
                self._changed.wait_for(lambda: self._was_open and not self._open)
                if not self._changed.wait_for(lambda: bool(self._open), timeout=_GRACE):
                    return

    def close(self) -> None:
        with self._changed:
            for connection in self._open:
                with suppress(OSError):  # it is closed already
                    connection.shutdown(socket.SHUT_RDWR)


class _Refusal(Exception):
    """A request is answered with a status and a line of text."""

    def __init__(self, status: HTTPStatus, text: str) -> None:
        super().__init__(text)
        self.status, self.text = status, text


class _Handler(BaseHTTPRequestHandler):
    """Answer the requests of one connection."""

    protocol_version = "HTTP/1.1"  # connections are kept: one for all pictures
    timeout = _PATIENCE
    disable_nagle_algorithm = True  # a picture is sent at once
    server: Server

    def do_GET(self) -> None:
        """Send a part of the page, or hold the connection open."""
        self._answer(self._get)

    def do_POST(self) -> None:
        """Answer a message with a picture."""
        self._answer(self._post)

    def _answer(self, work: Callable[[str], None]) -> None:
        """Check who asks, and do the work for the name that is asked for."""
        try:
            work(self._checked_name())
        except _Refusal as refusal:
            self._send(refusal.status, f"{refusal.text}\n".encode(), is_last=True)
        except TimeoutError:
            self.close_connection = True

    def _checked_name(self) -> str:
        """Return what stands behind the token; refuse whoever isn't the page itself."""
        hosts = self.headers.get_all("Host") or []
        if len(hosts) != 1 or _name_of(f"//{hosts[0]}") not in _OWN_NAMES:
            raise _Refusal(HTTPStatus.FORBIDDEN, "this server speaks to 127.0.0.1 and localhost alone")
        origin = self.headers.get("Origin")
        if origin is not None and origin.lower() != f"http://{hosts[0]}".lower():
            raise _Refusal(HTTPStatus.FORBIDDEN, "pages of other origins are not answered")
        token, slash, name = self.path.removeprefix("/").partition("/")
        is_known = hmac.compare_digest(token.encode("utf-8", "replace"), self.server.token.encode())
        if not (is_known and slash and self.path.startswith("/")):
            raise _Refusal(HTTPStatus.FORBIDDEN, "the token is wrong: open the address that the program has printed")
        return name

    def _get(self, name: str) -> None:
        if name == "alive":
            self._hold()
        elif name in _FILES:
            file, media_type = _FILES[name]
            self._send(HTTPStatus.OK, (_FOLDER / file).read_bytes(), media_type)
        else:
            raise _Refusal(HTTPStatus.NOT_FOUND, "there is nothing of this name")

    def _post(self, name: str) -> None:
        if name != "frame":
            raise _Refusal(HTTPStatus.NOT_FOUND, "only pictures are asked for by POST")
        try:
            message = json.loads(self._read_body())
        except (ValueError, RecursionError):
            raise _Refusal(HTTPStatus.BAD_REQUEST, "a message is JSON in UTF-8") from None
        try:
            reply = self.server.session.answer(message)
        except RasterizerError as fault:
            raise _Refusal(HTTPStatus.BAD_REQUEST, str(fault)) from fault
        except Exception as fault:  # whatever it is, the page and the terminal say it, and the server goes on
            error = error_of(self.server.session.title, fault)
            self.server.note(str(error))
            raise _Refusal(HTTPStatus.INTERNAL_SERVER_ERROR, str(error)) from fault
        self._send(HTTPStatus.OK, pack_reply(reply), "application/octet-stream")

    def _read_body(self) -> bytes:
        """Return the message; refuse one without a length, or a long one, before it is read."""
        length = self.headers.get("Content-Length", "")
        if not (length.isascii() and length.isdigit()) or self.headers.get("Transfer-Encoding"):
            raise _Refusal(HTTPStatus.LENGTH_REQUIRED, "a message needs a Content-Length")
        if len(length) > 9 or int(length) > MAX_BYTES:
            raise _Refusal(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"a message has at most {MAX_BYTES} bytes")
        return self.rfile.read(int(length))

    def _hold(self) -> None:
        """Keep the connection open, so that either side notices when the other one ends."""
        self._send_head(HTTPStatus.OK, {"Content-Type": "text/plain"}, is_last=True)
        self.connection.settimeout(None)
        self.server.hold(self.connection)

    def _send(
        self,
        status: HTTPStatus,
        content: bytes,
        media_type: str = "text/plain; charset=utf-8",
        *,
        is_last: bool = False,
    ) -> None:
        """Send an answer; the connection is closed after one that refuses, whose body may not have been read."""
        self._send_head(status, {"Content-Type": media_type, "Content-Length": str(len(content))}, is_last)
        if self.command != "HEAD":
            self.wfile.write(content)

    def _send_head(self, status: HTTPStatus, headers: dict[str, str], is_last: bool) -> None:
        self.close_connection = self.close_connection or is_last
        self.send_response(status)
        for name, value in (_HEADERS | headers | ({"Connection": "close"} if is_last else {})).items():
            self.send_header(name, value)
        self.end_headers()

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Refuse what is no request; the base class calls this."""
        status = HTTPStatus(code)
        self._send(status, f"{status.phrase}\n".encode(), is_last=True)

    def version_string(self) -> str:
        """What the header `Server` says."""
        return "raster"

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are not logged: they hold the token."""


def pack_reply(reply: Reply) -> bytes:
    """Return an answer as bytes: its status as one line of JSON, with the picture's type, and then the picture."""
    return json.dumps({**reply.status, "type": reply.media_type}).encode() + b"\n" + reply.content


def _name_of(address: str) -> str | None:
    """Return the name of the machine in an address, in lower case; None where it has none."""
    try:
        parts = urlsplit(address)
        _ = parts.port  # ValueError where it is no number of a port
        is_plain = parts.username is None and not (parts.path or parts.query or parts.fragment)
        return parts.hostname if is_plain else None
    except ValueError:
        return None
