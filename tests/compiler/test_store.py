"""The files of compiled kernels: nothing that is damaged is read, nothing half-written is used, and each code is found
for what it was made for alone."""

import errno
import hashlib
import os
import pickle

import numpy as np
import pytest
from helpers.stores import start

from rasterizer.compiler import fingerprint, store
from rasterizer.compiler.store import Store

KEY, CODE = b"a key", bytes(range(256)) * 40
SIGNATURE = (("array", "float64", 1, "C"), "int64")
IS_ROOT = hasattr(os, "geteuid") and os.geteuid() == 0
posix = pytest.mark.skipif(os.name != "posix", reason="limits and signals of POSIX")


def written(folder):
    """Write a code into a new folder; return its file."""
    folder.mkdir(exist_ok=True)
    path = folder / f"scan{store.SUFFIX}"
    store.write_code(path, KEY, CODE)
    assert store.read_code(path, KEY) == CODE
    return path


# ---------------------------------------------------------------- damaged files


def flip(content, place, bit=16):
    """Change one bit."""
    return content[:place] + bytes([content[place] ^ bit]) + content[place + 1 :]


DAMAGES = {
    "empty": lambda content: b"",
    "one byte": lambda content: content[:1],
    "half": lambda content: content[: len(content) // 2],
    "all but one byte": lambda content: content[:-1],
    "garbage": lambda content: np.random.default_rng(1).bytes(len(content)),
    "garbage behind the head": lambda content: content[:60] + np.random.default_rng(2).bytes(len(content) - 60),
    "zeros": lambda content: bytes(len(content)),
    "more behind it": lambda content: content + b"more",
    "a pickle": lambda _: pickle.dumps({"a": 1}),
    "text": lambda _: b"hello\n" * 99,
}


def test_what_is_damaged_is_as_good_as_not_there(tmp_path):
    for kind, damage in DAMAGES.items():
        path = written(tmp_path / kind)
        path.write_bytes(damage(path.read_bytes()))
        assert store.read_code(path, KEY) is None, f"{kind} is read"
        written(path.parent)
        assert not list(path.parent.glob(f"*{store.HALF_WRITTEN}")), f"{kind} leaves a half-written file"


def make_folder(path):
    path.unlink()
    path.mkdir()
    (path / "something").write_text("precious")


REPLACEMENTS = {
    "a folder": make_folder,
    "nothing": lambda path: path.unlink(),
    "a dangling link": lambda path: (path.unlink(), path.symlink_to(path.parent / "nowhere")),
    "a link to itself": lambda path: (path.unlink(), path.symlink_to(path)),
}


def test_what_is_no_file_is_as_good_as_not_there(tmp_path):
    for kind, replace in REPLACEMENTS.items():
        path = written(tmp_path / kind)
        replace(path)
        assert store.read_code(path, KEY) is None, f"{kind} is read"
        store.write_code(path, KEY, CODE)
        if kind == "a folder":  # it stays, with what is in it
            assert (path / "something").read_text() == "precious"
        else:
            assert store.read_code(path, KEY) == CODE, f"{kind} isn't replaced"
        assert not list(path.parent.glob(f"*{store.HALF_WRITTEN}")), f"{kind} leaves a half-written file"


@pytest.mark.skipif(not IS_ROOT, reason="only root can give files away")
def test_a_file_of_somebody_else_is_read_only_where_the_package_came_with_it(tmp_path):
    path = written(tmp_path)
    os.chown(path, 12345, 12345)
    assert store.read_code(path, KEY) is None and store.read_code(path, KEY, is_shipped=True) == CODE


def test_every_bit_counts(tmp_path):
    """A changed bit of machine code would run."""
    path, rng = written(tmp_path), np.random.default_rng(3)
    content = path.read_bytes()
    for place in [*range(70), len(content) - 1, *map(int, rng.integers(70, len(content), 200))]:
        path.write_bytes(flip(content, place, 1 << rng.integers(8)))
        assert store.read_code(path, KEY) is None, f"byte {place} of {len(content)} doesn't count"


def test_a_file_of_another_kernel_is_not_taken_for_this_one(tmp_path):
    """Somebody may have renamed it."""
    path = written(tmp_path)
    assert store.read_code(path, b"another key") is None and store.read_code(path, b"") is None


def test_sizes_that_lie_are_read_no_further_than_the_file(tmp_path):
    """As a wrong program may write them, under a checksum that is right."""
    path = tmp_path / "file"
    for rest in (b"", b"\1", b"\xff\xff\xff\xff" + KEY, b"\0\0\0\0", (len(KEY) + 1).to_bytes(4, "little") + KEY):
        path.write_bytes(store.FORMAT + hashlib.sha256(rest).digest() + rest)
        assert not store.read_code(path, KEY), rest


# ---------------------------------------------------------------- disks that are full


def is_done_without(folder, caplog, code) -> None:
    """Write where that fails: one line tells of it, and nothing is left."""
    caplog.clear()
    store.write_code(folder / "file", KEY, CODE)
    (line,) = caplog.messages
    assert line.startswith(f"kernel {folder}") and line.endswith(f"can't be kept ({os.strerror(code)})")
    assert not list(folder.iterdir()), f"left: {list(folder.iterdir())}"


def test_a_disk_that_is_full_or_fails_is_done_without_and_told(tmp_path, monkeypatch, caplog):
    caplog.set_level("INFO", "rasterizer")
    for call, code in (
        ("open", errno.EROFS),
        ("open", errno.EDQUOT),
        ("replace", errno.ENOSPC),
        ("replace", errno.EIO),
    ):

        def fail(*_given, code=code, **_options):
            raise OSError(code, os.strerror(code))

        with monkeypatch.context() as patch:  # the disk, as the system tells of it
            patch.setattr(os, call, fail)
            is_done_without(tmp_path, caplog, code)
    written(tmp_path)


# ---------------------------------------------------------------- which code is found


def fill():
    """A kernel of the package."""


def fill_box():
    """Another one."""


fill.__module__ = fill_box.__module__ = "rasterizer.pipeline.scan"


@pytest.fixture
def own(tmp_path):
    """A store in a folder of its own."""
    tmp_path.chmod(0o700)
    return Store.into(tmp_path / "store")


def test_a_code_is_found_for_its_function_and_signature_alone(own):
    own.keep(fill, SIGNATURE, CODE)
    assert own.find(fill, SIGNATURE) == CODE
    others = [(fill, SIGNATURE[:1]), (fill, (("array", "float64", 1, "A"), "int64")), (fill_box, SIGNATURE)]
    assert [own.find(*other) for other in others] == [None] * 3


def test_the_best_code_that_runs_here_is_found_first(own):
    for processor in ("this one +all", *fingerprint.PROCESSOR_LEVELS, "another one"):
        own._replace(processors=(processor, "not written for")).keep(fill, SIGNATURE, processor.encode())
    for processors in (("this one +all", "x86-64-v3"), ("not written for", "x86-64-v3", "x86-64-v2")):
        found = own._replace(processors=processors).find(fill, SIGNATURE)
        assert found == next(name for name in processors if name != "not written for").encode()
    assert own._replace(processors=("not written for",)).find(fill, SIGNATURE) is None


def test_what_was_shipped_is_looked_into_first_and_never_written_to(tmp_path, own):
    shipped = Store.into(tmp_path / "shipped")
    shipped.keep(fill, SIGNATURE, b"shipped")
    both = own._replace(folders=(shipped.own, own.own))
    for function in (fill, fill_box):
        both.keep(function, SIGNATURE, b"own")
    assert both.find(fill, SIGNATURE) == shipped.find(fill, SIGNATURE) == b"shipped"
    assert both.find(fill_box, SIGNATURE) == b"own" and shipped.find(fill_box, SIGNATURE) is None
    nowhere = Store(is_used=True, processors=("any",))
    nowhere.keep(fill, SIGNATURE, CODE)
    assert nowhere.find(fill, SIGNATURE) is None and not nowhere.is_kept


# ---------------------------------------------------------------- many processes

WRITES = f"""
import sys
from pathlib import Path
from rasterizer.compiler import store

code = bytes(range(256)) * 4000
while True:
    store.write_code(Path(sys.argv[1]), {KEY!r}, code)
    print("x", end="", flush=True)
"""


@posix
def test_what_processes_write_at_once_is_read_whole_even_when_they_are_killed(tmp_path, alone):
    """They write the same file again and again, and are killed in the middle."""
    whole, path = bytes(range(256)) * 4000, tmp_path / "file"
    writers = [start(WRITES, tmp_path, path) for _ in range(2)]
    assert [writer for writer in writers if writer.stdout.read(1) != "x"] == []
    for _ in range(40):
        assert store.read_code(path, KEY) == whole
    for writer in writers:
        writer.kill()
        writer.communicate()
    assert store.read_code(path, KEY) == whole
