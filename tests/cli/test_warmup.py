"""`raster warmup`: all kernels into a store, the user's own or one that can be shipped."""

import os
import re

import pytest
from helpers.command import assert_refused, errors, one_error, raster, start

from rasterizer.compiler import store

pytestmark = pytest.mark.usefixtures("folder")


@pytest.mark.nightly  # compiles all kernels that there are
def test_kernels_that_are_there_are_not_compiled_again(capsys):
    assert raster("warmup") == 0 and raster("warmup") == 0
    assert re.search(r"^raster: kernels were ready already after [\d.]+ s, in ", errors(capsys), re.MULTILINE)


@pytest.mark.skipif(os.name != "posix", reason="modes are looked at on POSIX alone")
def test_a_place_where_no_store_can_be_is_refused(folder, capsys):
    (folder / "file").write_text("precious")
    assert_refused(capsys, [(["--into", str(folder / "file"), "-q"], "no store can be made in")], "warmup", code=4)
    assert (folder / "file").read_text() == "precious"
    own = folder / "kernels" / store.shipped_name()
    own.mkdir(parents=True)
    own.chmod(0o777)
    assert raster("warmup", "--into", str(own.parent)) == 4
    assert "others can write to it" in one_error(capsys)
    done = start("warmup", variables={"RASTER_STORE": str(folder / "file" / "below")})
    assert done.returncode == 4 and done.stderr.startswith(b"raster: error: compiled kernels can't be kept: ")
    assert b"RASTER_STORE names another folder" in done.stderr
