"""Check what is kept of compiled kernels: nothing that is damaged is loaded or ends a run, no code comes from where
others can write, and nothing that isn't ours is removed."""

import errno
import os
import pickle
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.raster import ROOT

from rasterizer.cli.messages import NORMAL, QUIET, VERBOSE, Messages, compiling_announced
from rasterizer.compiler import kernels, store

TITLE, KEY, CODE = "scan.scan", b"a key", bytes(range(256)) * 40
NAME = f"{store.PREFIX}0123456789abcdef"
OLD = 400 * 24 * 3600
IS_ROOT = hasattr(os, "geteuid") and os.geteuid() == 0
posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes are looked at on POSIX alone")


def halves(x):
    """What is compiled here."""
    return x.sum() * 0.5


def doubles(rows, n, params):
    """A batch function."""
    for k in range(n):
        rows[k] *= 2.0


def only_file(folder) -> Path:
    (path,) = folder.glob(f"*{store.SUFFIX}")
    return path


# ── damaged files ───────────────────────────────────────────────────────────────────────────────────────


def flip(content, place):
    """Change one bit."""
    return content[:place] + bytes([content[place] ^ 16]) + content[place + 1 :]


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
    for place in rng.integers(0, len(content), 300):
        path.write_bytes(flip(content, int(place)))
        assert store.read_code(tmp_path, TITLE, KEY) is None, f"byte {place} of {len(content)} doesn't count"


def compiled_and_used(folder, monkeypatch):
    """Compile a kernel and a batch function anew, use both; return how many were found on disk."""
    monkeypatch.setattr(kernels, "CACHE_FOLDER", folder)
    monkeypatch.setattr(kernels, "__name__", __name__)  # functions of other packages are not kept
    kernel, row = kernels.kernel(halves), kernels.batch_function.__wrapped__(doubles, np.float64)
    assert kernel(np.arange(5.0)) == 5.0
    rows = np.arange(4.0)
    row.ctypes(rows.ctypes.data_as(row.ctypes.argtypes[0]), 4, rows.ctypes.data_as(row.ctypes.argtypes[0]))
    assert rows.tolist() == [0, 2, 4, 6]
    return sum(kernel.stats.cache_hits.values()) + row.cache_hits


@pytest.mark.parametrize("kind", [*DAMAGES, *REPLACEMENTS, "right, but no kernel", "right, but of an unknown module"])
def test_kernels_and_batch_functions_are_compiled_again_where_theirs_are_damaged(tmp_path, monkeypatch, kind):
    assert compiled_and_used(tmp_path, monkeypatch) == 0
    paths = list(tmp_path.glob(f"*{store.SUFFIX}"))
    assert compiled_and_used(tmp_path, monkeypatch) == len(paths) == 2
    read = store.read_code
    if kind.startswith("right, but"):  # what the checksum can't tell
        code = pickle.dumps(42) if kind.endswith("kernel") else b"cnowhere\nnobody\n."
        monkeypatch.setattr(store, "read_code", lambda *given: code if read(*given) else None)
        assert compiled_and_used(tmp_path, monkeypatch) == 0
        return
    for path in paths:
        if kind in DAMAGES:
            path.write_bytes(DAMAGES[kind](path.read_bytes()))
        else:
            REPLACEMENTS[kind](path)
    is_readable = kind == "a file without rights" and IS_ROOT
    assert compiled_and_used(tmp_path, monkeypatch) == (2 if is_readable else 0)
    assert compiled_and_used(tmp_path, monkeypatch) == (0 if kind == "a folder" else 2)


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO])
@pytest.mark.parametrize("call", ["open", "replace"])
def test_a_disk_that_is_full_or_fails_is_done_without(tmp_path, monkeypatch, code, call):
    def fail(*_given, **_options):
        raise OSError(code, os.strerror(code))

    with monkeypatch.context() as patch:
        patch.setattr(store.tempfile if call == "open" else os, "mkstemp" if call == "open" else "replace", fail)
        assert compiled_and_used(tmp_path, patch) == 0
        assert not list(tmp_path.iterdir())
    assert compiled_and_used(tmp_path, monkeypatch) == 0 and compiled_and_used(tmp_path, monkeypatch) == 2


def run(program, cwd, **variables):
    """Run a program with a cache of its own; None takes a variable away."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")} | {"PYTHONPATH": str(ROOT)}
    environment = {k: str(v) for k, v in (environment | variables).items() if v is not None}
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, env=environment, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and not done.stderr, done.stderr[-1500:]
    return done.stdout.strip()


@posix
@pytest.mark.parametrize("most", [0, 100, 20_000])
def test_a_limit_on_the_size_of_files_breaks_nothing(tmp_path, most):
    """The limit of the system stands for a full disk: here a kernel doesn't fit, a batch function may."""
    program = f"""
import resource
resource.setrlimit(resource.RLIMIT_FSIZE, ({most}, {most}))
import numpy as np
from rasterizer.compiler import kernels
from rasterizer.pipeline.light_kinds import LIGHT_FUNCTIONS
from rasterizer.geometry.surfaces import compute_clearance

corners = np.array([(0.0, 3.0, 0.0), (0.0, 0.0, 4.0), (0.0, 0.0, 0.0)])
assert 97 < compute_clearance(corners, np.array([[0], [1], [2]], np.uint32), 101.0, 0.0, 0.0) < 100
assert kernels.batch_function(LIGHT_FUNCTIONS["directional"].evaluate, np.float32).address
"""
    for _ in range(2):
        run(program, tmp_path, NUMBA_CACHE_DIR=tmp_path / "kernels")
    (folder,) = (tmp_path / "kernels").iterdir()
    assert not list(folder.glob(f"*{store.HALF_WRITTEN}"))
    assert all(path.stat().st_size <= most for path in folder.iterdir())


@pytest.mark.parametrize("level", [QUIET, NORMAL, VERBOSE])
def test_damage_is_told_in_a_line_where_details_are_asked_for(tmp_path, monkeypatch, capsys, level):
    compiled_and_used(tmp_path, monkeypatch)
    for path in tmp_path.glob(f"*{store.SUFFIX}"):
        path.write_bytes(path.read_bytes()[:-7])
    monkeypatch.setattr(kernels, "CACHE_REASONS", ["/shared: others can write to it"])
    with compiling_announced(Messages(level)):
        compiled_and_used(tmp_path, monkeypatch)
    lines = capsys.readouterr().err.splitlines()
    assert sum("is damaged and is compiled again" in line for line in lines) == (2 if level == VERBOSE else 0)
    assert sum("no kernels are kept in /shared: others" in line for line in lines) == (1 if level == VERBOSE else 0)
    assert len(lines) == {QUIET: 0, NORMAL: 1, VERBOSE: 4}[level]


# ── what may be loaded ──────────────────────────────────────────────────────────────────────────────────


def test_settings_that_change_code_have_kernels_of_their_own(tmp_path):
    """Above all bounds checks: kernels without them would be loaded, and the check would check nothing."""
    program = "from rasterizer.compiler import kernels; print(kernels.CACHE_FOLDER.name)"
    settings = [
        {},
        {"NUMBA_BOUNDSCHECK": 1},
        {"NUMBA_OPT": 0},
        {"NUMBA_CPU_NAME": "generic"},
        {"NUMBA_LOOP_VECTORIZE": 0},
    ]
    settings += [{"NUMBA_CPU_FEATURES": ""}, {"NUMBA_DEBUGINFO": 1}, {"NUMBA_ENABLE_AVX": 0}]
    names = [run(program, tmp_path, NUMBA_CACHE_DIR=tmp_path / "kernels", **given) for given in settings]
    assert len(set(names)) == len(names), names
    assert run(program, tmp_path, NUMBA_CACHE_DIR=tmp_path / "kernels", NUMBA_NUM_THREADS=1) == names[0]


def test_a_new_folder_is_closed_to_others_and_found_again(tmp_path):
    for _ in range(2):
        folder, reasons = store.choose_folder([tmp_path / "a" / "b"], NAME)
        assert folder == tmp_path / "a" / "b" / NAME and not reasons
    if os.name == "posix":
        assert all(step.stat().st_mode & 0o777 == 0o700 for step in (folder, folder.parent, folder.parent.parent))


@posix
@pytest.mark.parametrize("level", ["the folder", "the one above", "two above"])
@pytest.mark.parametrize("mode", [0o777, 0o707, 0o1777, 0o775])
def test_what_others_can_write_to_is_refused(tmp_path, monkeypatch, level, mode):
    """A sticky folder will do above the folder, where nobody can move what isn't his; a group is others, unless one's
    own."""
    folder = tmp_path / "outer" / "inner" / NAME
    folder.mkdir(parents=True)
    place = {"the folder": folder, "the one above": folder.parent, "two above": folder.parent.parent}[level]
    place.chmod(mode)
    for is_private in (False, True):
        monkeypatch.setattr(store, "_is_private_group", lambda _number, is_private=is_private: is_private)
        found, reasons = store.choose_folder([folder.parent], NAME)
        is_safe = (mode == 0o1777 and level != "the folder") or (mode == 0o775 and is_private)
        assert found == (folder if is_safe else None)
        assert is_safe or (len(reasons) == 1 and f"others can write to {place}" in reasons[0]), reasons


@posix
@pytest.mark.skipif(not IS_ROOT, reason="only root can give files away")
@pytest.mark.parametrize("level", ["the folder", "the one above", "the file"])
def test_what_belongs_to_somebody_else_is_refused(tmp_path, level):
    folder = tmp_path / "outer" / NAME
    folder.mkdir(parents=True)
    store.write_code(folder, TITLE, KEY, CODE)
    os.chown({"the folder": folder, "the one above": folder.parent, "the file": only_file(folder)}[level], 12345, 12345)
    if level == "the file":
        assert store.read_code(folder, TITLE, KEY) is None
        return
    found, reasons = store.choose_folder([folder.parent], NAME)
    assert found is None and "belongs to another user" in reasons[0]


@posix
def test_nothing_is_made_where_others_can_write(tmp_path):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    assert store.choose_folder([shared / "deep" / "er"], NAME)[0] is None
    assert not list(shared.iterdir())
    shared.chmod(0o1777)  # as /tmp: what is made there is one's own, and closed
    folder, _ = store.choose_folder([shared / "deep"], NAME)
    assert folder == shared / "deep" / NAME and (shared / "deep").stat().st_mode & 0o777 == 0o700


@posix
def test_links_are_followed_before_anything_is_looked_at(tmp_path):
    open_to_all, own = tmp_path / "open", tmp_path / "own"
    open_to_all.mkdir()
    own.mkdir(mode=0o700)
    (own / "link").symlink_to(open_to_all)
    (own / NAME).symlink_to(open_to_all)
    open_to_all.chmod(0o777)
    assert store.choose_folder([own / "link"], NAME)[0] is None
    assert store.choose_folder([own], NAME)[0] is None
    open_to_all.chmod(0o700)
    assert store.choose_folder([own / "link"], NAME)[0] == open_to_all / NAME


def test_strange_names_of_folders_are_no_fault(tmp_path):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "file").write_text("precious")
    names = [tmp_path / "loop", tmp_path / "file", tmp_path / "file" / "x", "x" * 300, tmp_path / ("y" * 300), "nul\0l"]
    folder, reasons = store.choose_folder([*names, tmp_path / "good"], NAME)
    assert folder == tmp_path / "good" / NAME and len(reasons) == len(names)
    assert (tmp_path / "file").read_text() == "precious"


@pytest.mark.parametrize("home", [None, "", "~", "relative", ".", "/nowhere/at/all"])
@pytest.mark.parametrize("cache", [None, "", "relative", "./here", "~/.cache"])
def test_only_absolute_homes_count(monkeypatch, tmp_path, home, cache):
    """Else a folder would be made, and code loaded, where the program happens to be started."""
    monkeypatch.chdir(tmp_path)
    for name, value in (("HOME", home), ("XDG_CACHE_HOME", cache)):
        monkeypatch.delenv(name, raising=False)
        if value is not None:
            monkeypatch.setenv(name, value)
    assert all(folder.is_absolute() and tmp_path not in folder.parents for folder in store.home_folders())


@posix
def test_a_user_without_a_home_or_a_name_makes_no_folder(tmp_path, monkeypatch):
    """As in a container that runs under any number."""
    import pwd

    def nobody(_number):
        raise KeyError("no entry")

    monkeypatch.setattr(pwd, "getpwuid", nobody)
    monkeypatch.chdir(tmp_path)
    for name in ("HOME", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    assert store.home_folders() == []
    assert not store._is_private_group(0)
    assert not list(tmp_path.iterdir())


# ── what is removed ─────────────────────────────────────────────────────────────────────────────────────


def make_old(folder, *names, marker=store.MARK):
    """A folder that nobody has used for a year."""
    folder.mkdir()
    for name in names:
        (folder / name).write_text("something")
    if marker is not None:
        (folder / store.MARKER).write_bytes(marker)
    then = time.time() - OLD
    os.utime(folder, (then, then))
    return folder


def test_only_folders_of_ours_are_removed(tmp_path):
    kernel = f"scan.scan-0{store.SUFFIX}"
    ours = make_old(tmp_path / f"{store.PREFIX}00000000000000aa", kernel, f"x{store.HALF_WRITTEN}")
    elsewhere = make_old(tmp_path / "elsewhere", kernel)
    kept = [
        make_old(tmp_path / "kernels-0123456789abcdef", kernel),
        make_old(tmp_path / "kernels-of-my-thesis", "thesis.tex"),
        make_old(tmp_path / f"{store.PREFIX}00000000000000ab", kernel, marker=None),
        make_old(tmp_path / f"{store.PREFIX}00000000000000ac", kernel, marker=b"mine"),
        make_old(tmp_path / f"{store.PREFIX}00000000000000AD", kernel),
        make_old(tmp_path / f"{store.PREFIX}00000000000000a", kernel),
        make_old(tmp_path / f"{store.PREFIX}00000000000000aee", kernel),
        make_old(tmp_path / f"{store.PREFIX}zzzzzzzzzzzzzzzz", kernel),
        elsewhere,
    ]
    young = tmp_path / f"{store.PREFIX}00000000000000af"
    make_old(young, kernel)
    os.utime(young)
    link = tmp_path / f"{store.PREFIX}00000000000000b0"
    link.symlink_to(elsewhere)
    file = tmp_path / f"{store.PREFIX}00000000000000b1"
    file.write_text("a file")
    os.utime(file, (0, 0))
    mixed = make_old(tmp_path / f"{store.PREFIX}00000000000000b2", kernel, "thesis.tex")
    store.remove_old(tmp_path / NAME)
    assert not ours.exists()
    assert all(
        len(list(folder.iterdir())) >= 1 and (folder / kernel).exists() for folder in [*kept[2:], kept[0], young]
    )
    assert (kept[1] / "thesis.tex").exists() and link.is_symlink() and file.read_text() == "a file"
    assert (mixed / "thesis.tex").read_text() == "something"


def test_the_folder_in_use_is_never_removed(tmp_path):
    folder = make_old(tmp_path / NAME, f"a{store.SUFFIX}")
    store.remove_old(folder)
    assert (folder / f"a{store.SUFFIX}").exists()
