"""Check the files of compiled kernels: nothing that is damaged is read, nothing half-written is used, and each code is
found for what it was made for alone."""

import errno
import hashlib
import io
import os
import pickle
from pathlib import Path

import numpy as np
import pytest
from helpers.stores import start

from rasterizer.compiler import fingerprint, store
from rasterizer.compiler.store import Store

TITLE, KEY, CODE = "scan.scan", b"a key", bytes(range(256)) * 40
NAME = f"{store.PREFIX}0123456789abcdef"
OLD = 400 * 24 * 3600
IS_ROOT = hasattr(os, "geteuid") and os.geteuid() == 0
posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes are looked at on POSIX alone")


def only_file(folder) -> Path:
    (path,) = folder.glob(f"*{store.SUFFIX}")
    return path


# ---------------------------------------------------------------- damaged files


def flip(content, place, bit=16):
    """Change one bit."""
    return content[:place] + bytes([content[place] ^ bit]) + content[place + 1 :]


def damages():
    """Kinds of damage: what becomes of the content, or what is done to the file."""
    for part in (0.0, 0.001, 0.1, 0.5, 0.9, 0.999):
        yield f"cut off after {part:.1%}", lambda content, part=part: content[: int(len(content) * part)]
    for part in (0.0, 0.002, 0.01, 0.3, 0.7):
        yield f"a bit flipped at {part:.1%}", lambda content, part=part: flip(content, int(len(content) * part))
    yield "the last bit flipped", lambda content: flip(content, len(content) - 1)
    yield "garbage", lambda content: np.random.default_rng(1).bytes(len(content))
    yield "garbage behind the head", lambda content: content[:60] + np.random.default_rng(2).bytes(len(content) - 60)
    yield "zeros", lambda content: bytes(len(content))
    yield "more behind it", lambda content: content + b"more"
    yield "another pickle", lambda _: pickle.dumps({"a": 1})
    yield "a pickle that is no pickle", lambda _: b"\x80\x05garbage."
    yield "text", lambda _: b"hello\n" * 99


DAMAGES = dict(damages())


def make_dir(path):
    path.unlink()
    path.mkdir()
    (path / "something").write_text("precious")


def make_fifo(path):
    path.unlink()
    os.mkfifo(path)


def make_link(path):
    path.rename(path.with_suffix(".moved"))
    path.symlink_to(path.with_suffix(".moved"))


REPLACEMENTS = {
    "a folder": make_dir,
    "nothing": lambda path: path.unlink(),
    "a dangling link": lambda path: (path.unlink(), path.symlink_to(path.parent / "nowhere")),
    "a link to itself": lambda path: (path.unlink(), path.symlink_to(path)),
}
if os.name == "posix":
    REPLACEMENTS |= {
        "a pipe": make_fifo,
        "a link to the file": make_link,
        "a file that others can write": lambda path: path.chmod(0o666),
        "a device": lambda path: (path.unlink(), path.symlink_to("/dev/zero")),
        "a file without rights": lambda path: path.chmod(0),
    }


@pytest.mark.parametrize("kind", [*DAMAGES, *REPLACEMENTS])
def test_what_is_damaged_is_as_good_as_not_there(tmp_path, kind):
    store.write_code(tmp_path, TITLE, KEY, CODE)
    assert store.read_code(tmp_path, TITLE, KEY) == CODE
    path = only_file(tmp_path)
    if kind in DAMAGES:
        path.write_bytes(DAMAGES[kind](path.read_bytes()))
    else:
        REPLACEMENTS[kind](path)
    is_readable = kind == "a file without rights" and IS_ROOT
    assert store.read_code(tmp_path, TITLE, KEY) == (CODE if is_readable else None)
    store.write_code(tmp_path, TITLE, KEY, CODE)
    if kind == "a folder":  # it stays, with what is in it
        assert (path / "something").read_text() == "precious"
    else:
        assert store.read_code(tmp_path, TITLE, KEY) == CODE
    assert not list(tmp_path.glob(f"*{store.HALF_WRITTEN}"))


def test_every_bit_counts(tmp_path):
    """A changed bit of machine code would run."""
    store.write_code(tmp_path, TITLE, KEY, CODE)
    path, rng = only_file(tmp_path), np.random.default_rng(3)
    content = path.read_bytes()
    places = [*range(70), *map(int, rng.integers(70, len(content), 700))]
    for place in places:
        path.write_bytes(flip(content, place, 1 << rng.integers(8)))
        assert store.read_code(tmp_path, TITLE, KEY) is None, f"byte {place} of {len(content)} doesn't count"


def test_a_file_of_another_kernel_is_not_taken_for_this_one(tmp_path):
    """Somebody may have renamed it."""
    store.write_code(tmp_path, TITLE, KEY, CODE)
    path = only_file(tmp_path)
    for title, key in ((TITLE, b"another key"), ("clip.clip_faces", KEY), (TITLE, b"")):
        other = tmp_path / store.file_name(title, key)
        path.rename(other)
        found = store.read_code(tmp_path, title, key)
        assert found == (CODE if key == KEY else None)  # a title is for those who look into the folder
        other.rename(path)


def test_sizes_that_lie_are_read_no_further_than_the_file(tmp_path):
    """As a wrong program may write them, under a checksum that is right."""
    path = tmp_path / store.file_name(TITLE, KEY)
    for rest in (b"", b"\1", b"\xff\xff\xff\xff" + KEY, b"\0\0\0\0", (len(KEY) + 1).to_bytes(4, "little") + KEY):
        path.write_bytes(store.FORMAT + hashlib.sha256(rest).digest() + rest)
        assert not store.read_code(tmp_path, TITLE, KEY)


def test_a_huge_file_is_not_read(tmp_path):
    path = tmp_path / store.file_name(TITLE, KEY)
    path.touch()
    os.truncate(path, store.MOST_BYTES + 1)
    assert store.read_code(tmp_path, TITLE, KEY) is None


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO])
@pytest.mark.parametrize("call", ["open", "write", "replace"])
def test_a_disk_that_is_full_or_fails_is_done_without_and_told(tmp_path, monkeypatch, caplog, code, call):
    caplog.set_level("INFO", "rasterizer")

    def fail(*_given, **_options):
        raise OSError(code, os.strerror(code))

    class FullFile(io.FileIO):
        write = fail

    with monkeypatch.context() as patch:
        if call == "write":
            patch.setattr(store, "open", lambda number, _mode: FullFile(number, "wb"), raising=False)
        else:
            patch.setattr(os, call, fail)
        store.write_code(tmp_path, TITLE, KEY, CODE)
    (line,) = caplog.messages
    assert line.startswith(f"kernel {tmp_path}") and line.endswith(f"can't be kept ({os.strerror(code)})")
    assert not list(tmp_path.iterdir())
    store.write_code(tmp_path, TITLE, KEY, CODE)
    assert store.read_code(tmp_path, TITLE, KEY) == CODE


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


SIGNATURE = (("array", "float64", 1, "C"), "int64")


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
        own._replace(processors=(processor,)).keep(TITLE, SIGNATURE, processor.encode())
    here = own._replace(processors=("this one +all", "x86-64-v3", "x86-64-v2"))
    assert list(here.find(TITLE, SIGNATURE)) == [b"this one +all", b"x86-64-v3", b"x86-64-v2"]
    assert list(own._replace(processors=("unknown",)).find(TITLE, SIGNATURE)) == []


def test_a_store_without_a_folder_finds_and_keeps_nothing(tmp_path):
    nowhere = Store(is_used=True, processors=("any",))
    nowhere.keep(TITLE, SIGNATURE, CODE)
    assert list(nowhere.find(TITLE, SIGNATURE)) == [] and not nowhere.is_kept


def test_what_was_shipped_is_looked_into_first_and_never_written_to(tmp_path, own):
    shipped = Store.into(tmp_path / "shipped")
    shipped.keep(TITLE, SIGNATURE, b"shipped")
    both = own._replace(folders=(shipped.own, own.own))
    both.keep(TITLE, SIGNATURE, b"own")
    assert list(both.find(TITLE, SIGNATURE)) == [b"shipped", b"own"]
    assert list(shipped.find(TITLE, SIGNATURE)) == [b"shipped"]


@posix
def test_a_store_to_be_shipped_says_why_it_can_not_be_made(tmp_path):
    place = tmp_path / "open"
    place.mkdir()
    place.chmod(0o777)
    with pytest.raises(PermissionError, match=f"others can write to {place}"):
        Store.into(place)
    (tmp_path / "file").write_text("precious")
    with pytest.raises(OSError):
        Store.into(tmp_path / "file" / "below")


# ---------------------------------------------------------------- many processes


WRITES = f"""
import os, signal, sys
from pathlib import Path
from rasterizer.compiler import store

code = bytes(range(256)) * 4000
while True:
    store.write_code(Path(sys.argv[1]), {TITLE!r}, {KEY!r}, code)
    print("x", end="", flush=True)
"""


@pytest.mark.skipif(os.name != "posix", reason="a process that is killed")
def test_what_processes_write_at_once_is_read_whole_even_when_they_are_killed(tmp_path):
    """Three write the same file again and again, and are killed in the middle."""
    whole, n_read = bytes(range(256)) * 4000, 0
    for _ in range(2):
        writers = [start(WRITES, tmp_path, tmp_path) for _ in range(3)]
        assert all(writer.stdout.read(1) == "x" for writer in writers)
        for _ in range(60):
            assert store.read_code(tmp_path, TITLE, KEY) == whole
            n_read += 1
        for writer in writers:
            writer.kill()
            writer.communicate()
        assert store.read_code(tmp_path, TITLE, KEY) == whole, f"not whole after {n_read} reads"
