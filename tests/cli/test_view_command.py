"""`raster view`: the address on stdout, one line a message on stderr, and the ends that it has."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import urllib.request
from contextlib import contextmanager

import pytest
from helpers.command import CUBE, GEAR, one_error
from helpers.raster import ROOT

from rasterizer.cli import main


@contextmanager
def viewing(*argv, **options):
    """The program itself, with its address; it must have ended when the block ends."""
    process = subprocess.Popen(
        [sys.executable, "-m", "rasterizer", "view", *argv],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )
    try:
        yield process, process.stdout.readline().strip()
        process.wait(20)
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()


def hold(url) -> socket.socket:
    """What a page holds open."""
    port, token = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/([\w-]{32})/", url).groups()
    connection = socket.create_connection(("127.0.0.1", int(port)), timeout=10)
    connection.sendall(f"GET /{token}/alive HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
    assert connection.recv(65536).startswith(b"HTTP/1.1 200")
    return connection


def status_of(url) -> dict:
    """What a first message is answered with."""
    message = {"size": [40, 30], "background": "#ffffff", "is_rest": True, "events": []}
    request = urllib.request.Request(f"{url}frame", json.dumps(message).encode(), method="POST")
    with urllib.request.urlopen(request, timeout=10) as answer:
        return json.loads(answer.read().partition(b"\n")[0])


def test_the_address_is_the_only_line_on_stdout_and_once_ends_with_the_page():
    with viewing(CUBE, "--once") as (process, url):
        page = hold(url)
        assert status_of(url)["switches"]["shading"] == "phong"
        page.close()
    out, err = process.communicate()
    assert process.returncode == 0 and out == "", err
    assert err.count("\n") == 1 and err.startswith("raster: ") and "cube.obj" in err


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_an_interrupt_ends_it_with_its_exit_code_and_tells_the_page():
    with viewing(GEAR, "-q", "--shading", "flat", "--azimuth", "10", "--ortho") as (process, url):
        told = status_of(url)
        page = hold(url)
        process.send_signal(signal.SIGINT)
        assert page.recv(1) == b""
        page.close()
    out, err = process.communicate()
    assert (process.returncode, out, err) == (130, "", "raster: error: interrupted\n")
    assert told["switches"] == {"shading": "flat", "lights": "own", "projection": "orthographic"}


def test_a_model_comes_from_stdin_and_a_browser_that_is_missing_is_no_error(folder):
    shutil.copy(CUBE, "cube.obj")
    with open("cube.obj", "rb") as stream:
        program = "import webbrowser; webbrowser.open = lambda _: False; from rasterizer.cli import main; main({!r})"
        argv = ["view", "-", "--input-format", "obj", "--open", "--once"]
        process = subprocess.Popen(
            [sys.executable, "-c", program.format(argv)],
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdin=stream,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
    url = process.stdout.readline().strip()
    hold(url).close()
    _, err = process.communicate(timeout=20)
    assert "no browser could be opened" in err


@pytest.mark.parametrize(
    ("argv", "code", "text"),
    [
        ([CUBE, GEAR], 2, "2 models"),
        ([CUBE, "--view", "top", "--view", "front"], 2, "2 views"),
        ([CUBE, "--port", "65536"], 2, "0..65535"),
        ([CUBE, "--port", "-1"], 2, "-1"),
        ([CUBE, "--port", "http"], 2, "'http'"),
        (["missing.obj"], 3, "missing.obj"),
        ([], 2, "MODEL"),
        ([CUBE, "--threads", "0"], 2, "threads"),
        ([CUBE, "--zoom", "0"], 2, "--zoom"),
    ],
    ids=str,
)
def test_what_can_not_be_shown_is_told_before_there_is_an_address(argv, code, text, folder, capsys):
    assert main(["view", *argv]) == code
    assert text in one_error(capsys)


def test_a_port_that_is_taken_is_an_output_that_can_not_be_written(capsys):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert main(["view", CUBE, "--port", str(port)]) == 4
    assert f"port {port}" in one_error(capsys)


def test_a_view_that_shows_nothing_is_told():
    with viewing(CUBE, "--once", "--eye", "5,5,5", "--target", "9,9,9") as (process, url):
        hold(url).close()
    assert "the picture is empty" in process.communicate()[1]
