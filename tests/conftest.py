"""What all tests share."""

import pytest

from rasterizer.cli import main
from rasterizer.compiler.kernels import STORE


@pytest.fixture(scope="session", autouse=True)
def compiled_kernels():
    """Compile all kernels before the first test, so that no test pays for it, or finds the notice about it on
    stderr. Where nothing is kept, as with RASTER_STORE=off, each kernel is compiled when it is met."""
    if STORE.is_kept:
        assert main(["warmup", "--quiet"]) == 0


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder: an empty one of the test's own."""
    monkeypatch.chdir(tmp_path)
    return tmp_path
