"""What all tests share."""

import signal
import time

import pytest

from rasterizer.compiler.kernels import STORE, compile_into, missing_in
from rasterizer.engine import draw
from rasterizer.engine.recorded_kernels import list_all_kernels


def pytest_addoption(parser):
    """Let kernels be compiled one by one, where a few tests need a few of them."""
    parser.addoption("--lazily", action="store_true", help="compile each kernel when a test needs it, not all ahead")


@pytest.hookimpl(tryfirst=True)
def pytest_sessionstart(session):
    """Compile all recorded kernels before the workers are started, so that no test pays for them, or finds the notice
    about them on stderr. Where nothing is kept, as with RASTER_STORE=off, each kernel is compiled when it is met."""
    config = session.config
    if hasattr(config, "workerinput") or config.option.collectonly or config.option.lazily or not STORE.is_kept:
        return
    with config.pluginmanager.getplugin("capturemanager").global_and_fixture_disabled():
        compile_into(STORE, missing_in(STORE, list_all_kernels()))


@pytest.fixture
def alone(tmp_path_factory):
    """Keep tests that count, stop or kill processes, or wait for a given time, from running beside each other."""
    import fcntl

    with open(tmp_path_factory.getbasetemp().parent / "alone", "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


@pytest.fixture(scope="session", autouse=True)
def threads_for_small_pictures():
    """Draw pictures on as many threads as they ask for, however small they are: most of the tests' are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(draw, "MIN_THREADED_TIME", 0)
        yield


@pytest.fixture(scope="session", autouse=True)
def interrupts():
    """Let the processes that tests start be interrupted. A shell that starts the tests in the background has SIGINT
    ignored, and what they start would inherit that."""
    before = signal.getsignal(signal.SIGINT)
    if before == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder: an empty one of the test's own."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def pass_days(monkeypatch):
    """A function that sets the clock on by a number of days, for those who ask for the date as zip files do."""
    clock, day = time.time, time.localtime

    def pass_days(count: int) -> None:
        later = clock() + count * 86400.0
        monkeypatch.setattr(time, "time", lambda: later)
        monkeypatch.setattr(time, "localtime", lambda seconds=None: day(later if seconds is None else seconds))

    return pass_days
