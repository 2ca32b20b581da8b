"""`raster view`: the address on stdout, one line a message on stderr, and the ends that it has."""

import io
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
import webbrowser
from contextlib import contextmanager
from pathlib import Path

import pytest
from helpers.command import CUBE, GEAR, assert_refused, one_error, raster
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.viewer.orbit import camera_flags


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


@contextmanager
def viewing(capsys, *argv):
    """The command on a thread of its own, with its address; it must have ended well when the block ends."""
    codes = []
    thread = threading.Thread(target=lambda: codes.append(raster("view", "--once", *argv)))
    thread.start()
    out, deadline = "", time.monotonic() + 20
    while not out and thread.is_alive() and time.monotonic() < deadline:
        time.sleep(0.02)
        out = capsys.readouterr().out
    yield thread, out.strip()
    thread.join(20)
    assert not thread.is_alive() and codes == [0]


@pytest.mark.nightly  # six seconds of waiting
def test_once_ends_when_the_last_page_is_closed_and_not_while_one_is_loaded_again(capsys, alone):
    """A page that was closed is given two seconds to come back."""
    with viewing(capsys, CUBE) as (thread, url):
        first, second = hold(url), hold(url)
        assert status_of(url)["switches"]["shading"] == "phong"
        first.close()
        time.sleep(1.2)
        second.close()
        again = hold(url)
        time.sleep(1.3)
        assert thread.is_alive(), "it has ended two seconds after the first page, and another one is open"
        time.sleep(0.9)
        assert thread.is_alive(), "it has ended although the page was loaded again"
        again.close()
    out, err = capsys.readouterr()
    assert (out, err) == ("", ""), "the address is the only line on stdout"


def test_a_model_comes_from_stdin_and_what_may_be_a_mistake_is_told(capsys, monkeypatch):
    told = []
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(Path(CUBE).read_bytes())))
    monkeypatch.setattr(sys, "stderr", stderr := io.StringIO())
    monkeypatch.setattr(webbrowser, "open", lambda url: told.append(url))  # a machine without a browser
    argv = ["-", "--input-format", "obj", "--open", "--eye", "5,5,5", "--target", "9,9,9"]
    with viewing(capsys, *argv) as (_, url):
        hold(url).close()
    doubt, notice, browser = stderr.getvalue().splitlines()
    assert doubt.startswith("raster: warning: -: the picture is empty") and told == [url]
    assert notice.startswith(
        "raster: - is shown at this address, to this machine alone; close the page or press Ctrl-C"
    )
    assert browser.startswith("raster: warning: no browser could be opened")


def test_on_a_ground_the_shadow_is_framed_as_in_a_picture(capsys):
    with viewing(capsys, CUBE, "--view", "front", "--ground", "--threads", "1") as (_, url):
        page, seen = hold(url), status_of(url)["camera"]
        page.close()
    camera = rz.render(CUBE, (40, 30), view="front", ground=True, threads=1).camera
    assert seen.startswith(camera_flags(camera, "y")), seen


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_an_interrupt_ends_it_with_its_exit_code_and_tells_the_page(alone):
    """The program itself."""
    process = subprocess.Popen(
        [sys.executable, "-m", "rasterizer", "view", GEAR, "-q", "--shading", "flat", "--azimuth", "10", "--ortho"],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        url = process.stdout.readline().strip()
        told, page = status_of(url), hold(url)
        process.send_signal(signal.SIGINT)
        assert page.recv(1) == b""
        page.close()
        out, err = process.communicate(timeout=20)
    finally:
        process.kill()
    assert (process.returncode, out, err) == (130, "", "raster: error: interrupted\n")
    assert told["switches"] == {"shading": "flat", "lights": "own", "projection": "orthographic"}


def test_what_can_not_be_shown_is_told_before_there_is_an_address(folder, capsys):
    assert_refused(capsys, [(argv, words) for argv, words in (
        ([CUBE, GEAR], "2 models"),
        ([CUBE, "--view", "top", "--view", "front"], "2 views"),
        ([CUBE, "--port", "65536"], "0..65535"),
        ([CUBE, "--port", "-1"], "-1"),
        ([CUBE, "--port", "http"], "'http'"),
        ([], "MODEL"),
        ([CUBE, "--threads", "0"], "threads"),
        ([CUBE, "--zoom", "0"], "--zoom"),
    )], "view")  # fmt: skip
    assert_refused(capsys, [(["missing.obj"], "missing.obj")], "view", code=3)


def test_a_port_that_is_taken_is_an_output_that_can_not_be_written(capsys):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert raster("view", CUBE, "--port", str(port)) == 4
    assert f"port {port}" in one_error(capsys)
