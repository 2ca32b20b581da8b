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

TITLE, KEY, CODE = "scan.scan", b"a key", bytes(range(256)) * 40
SIGNATURE = (("array", "float64", 1, "C"), "int64")
IS_ROOT = hasattr(os, "geteuid") and os.geteuid() == 0
posix = pytest.mark.skipif(os.name != "posix", reason="limits and signals of POSIX")


def written(folder):
    """Write a code into a new folder; return its file."""
    folder.mkdir(exist_ok=True)
    store.write_code(folder, TITLE, KEY, CODE)
    assert store.read_code(folder, TITLE, KEY) == CODE
    (path,) = folder.glob(f"*{store.SUFFIX}")
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
        assert store.read_code(path.parent, TITLE, KEY) is None, f"{kind} is read"
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
if os.name == "posix":
    REPLACEMENTS |= {
        "a pipe": lambda path: (path.unlink(), os.mkfifo(path)),
        "a link to the file": lambda path: path.symlink_to(path.rename(path.with_suffix(".moved"))),
        "a file that others can write": lambda path: path.chmod(0o602),
        "a device": lambda path: (path.unlink(), path.symlink_to("/dev/zero")),
        "a file without rights": lambda path: path.chmod(0),
    }


def test_what_is_no_file_of_ours_is_as_good_as_not_there(tmp_path):
    for kind, replace in REPLACEMENTS.items():
        path = written(tmp_path / kind)
        replace(path)
        is_readable = kind == "a file without rights" and IS_ROOT
        assert store.read_code(path.parent, TITLE, KEY) == (CODE if is_readable else None), f"{kind} is read"
        store.write_code(path.parent, TITLE, KEY, CODE)
        if kind == "a folder":  # it stays, with what is in it
            assert (path / "something").read_text() == "precious"
        else:
            assert store.read_code(path.parent, TITLE, KEY) == CODE, f"{kind} isn't replaced"
        assert not list(path.parent.glob(f"*{store.HALF_WRITTEN}")), f"{kind} leaves a half-written file"


def test_every_bit_counts(tmp_path):
    """A changed bit of machine code would run."""
    path, rng = written(tmp_path), np.random.default_rng(3)
    content = path.read_bytes()
    for place in [*range(70), len(content) - 1, *map(int, rng.integers(70, len(content), 200))]:
        path.write_bytes(flip(content, place, 1 << rng.integers(8)))
        assert store.read_code(tmp_path, TITLE, KEY) is None, f"byte {place} of {len(content)} doesn't count"


def test_a_file_of_another_kernel_is_not_taken_for_this_one(tmp_path):
    """Somebody may have renamed it."""
    path = written(tmp_path)
    for title, key in ((TITLE, b"another key"), ("clip.clip_faces", KEY), (TITLE, b"")):
        other = tmp_path / store.file_name(title, key)
        path.rename(other)
        found = store.read_code(tmp_path, title, key)
        assert found == (CODE if key == KEY else None)  # a title is for those who look into the folder
        other.rename(path)


def test_sizes_that_lie_are_read_no_further_than_the_file(tmp_path):
    """As a wrong program may write them, under a checksum that is right; and a file that is larger than any kernel."""
    path = tmp_path / store.file_name(TITLE, KEY)
    for rest in (b"", b"\1", b"\xff\xff\xff\xff" + KEY, b"\0\0\0\0", (len(KEY) + 1).to_bytes(4, "little") + KEY):
        path.write_bytes(store.FORMAT + hashlib.sha256(rest).digest() + rest)
        assert not store.read_code(tmp_path, TITLE, KEY), rest
    os.truncate(path, store.MAX_BYTES + 1)
    assert store.read_code(tmp_path, TITLE, KEY) is None


# ---------------------------------------------------------------- disks that are full


def is_done_without(folder, caplog, code) -> None:
    """Write where that fails: one line tells of it, and nothing is left."""
    caplog.clear()
    store.write_code(folder, TITLE, KEY, CODE)
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


@posix
def test_what_does_not_fit_is_not_half_kept(tmp_path, caplog):
    """The limit of the system on the size of files stands for a full disk."""
    import resource

    caplog.set_level("INFO", "rasterizer")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(CODE) // 2, limits[1]))
    try:
        is_done_without(tmp_path, caplog, errno.EFBIG)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    written(tmp_path)


def test_damage_is_told_and_what_is_missing_is_not(tmp_path, caplog):
    caplog.set_level("INFO", "rasterizer")
    assert store.read_code(tmp_path, TITLE, KEY) is None and not caplog.messages
    path = tmp_path / store.file_name(TITLE, KEY)
    path.write_bytes(b"damaged")
    store.read_code(tmp_path, TITLE, KEY)
    path.unlink()
    path.mkdir()
    store.read_code(tmp_path, TITLE, KEY)
    assert caplog.messages[0] == f"kernel {path} is damaged and is compiled again"
    assert caplog.messages[1].startswith(f"kernel {path} can't be read and is compiled again (")


# ---------------------------------------------------------------- which code is found


@pytest.fixture
def own(tmp_path):
    """A store in a folder of its own."""
    tmp_path.chmod(0o700)
    return Store.into(tmp_path / "store")


def test_a_code_is_found_for_its_title_and_signature_alone(own):
    own.keep(TITLE, SIGNATURE, CODE)
    assert list(own.find(TITLE, SIGNATURE)) == [CODE]
    others = [(TITLE, SIGNATURE[:1]), (TITLE, (("array", "float64", 1, "A"), "int64")), ("scan.scan2", SIGNATURE)]
    assert [list(own.find(*other)) for other in others] == [[]] * 3


def test_the_best_code_that_runs_here_is_found_first(own):
    for processor in ("this one +all", *fingerprint.PROCESSOR_LEVELS, "another one"):
        own._replace(processors=(processor, "not written for")).keep(TITLE, SIGNATURE, processor.encode())
    here = own._replace(processors=("this one +all", "x86-64-v3", "x86-64-v2"))
    assert list(here.find(TITLE, SIGNATURE)) == [b"this one +all", b"x86-64-v3", b"x86-64-v2"]
    assert list(own._replace(processors=("not written for",)).find(TITLE, SIGNATURE)) == []


def test_what_was_shipped_is_looked_into_first_and_never_written_to(tmp_path, own):
    shipped = Store.into(tmp_path / "shipped")
    shipped.keep(TITLE, SIGNATURE, b"shipped")
    both = own._replace(folders=(shipped.own, own.own))
    both.keep(TITLE, SIGNATURE, b"own")
    assert list(both.find(TITLE, SIGNATURE)) == [b"shipped", b"own"]
    assert list(shipped.find(TITLE, SIGNATURE)) == [b"shipped"]
    nowhere = Store(is_used=True, processors=("any",))
    nowhere.keep(TITLE, SIGNATURE, CODE)
    assert list(nowhere.find(TITLE, SIGNATURE)) == [] and not nowhere.is_kept


# ---------------------------------------------------------------- many processes

WRITES = f"""
import sys
from pathlib import Path
from rasterizer.compiler import store

code = bytes(range(256)) * 4000
while True:
    store.write_code(Path(sys.argv[1]), {TITLE!r}, {KEY!r}, code)
    print("x", end="", flush=True)
"""


@posix
def test_what_processes_write_at_once_is_read_whole_even_when_they_are_killed(tmp_path, alone):
    """They write the same file again and again, and are killed in the middle."""
    whole = bytes(range(256)) * 4000
    writers = [start(WRITES, tmp_path, tmp_path) for _ in range(2)]
    assert [writer for writer in writers if writer.stdout.read(1) != "x"] == []
    for _ in range(40):
        assert store.read_code(tmp_path, TITLE, KEY) == whole
    for writer in writers:
        writer.kill()
        writer.communicate()
    assert store.read_code(tmp_path, TITLE, KEY) == whole
