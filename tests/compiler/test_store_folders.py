"""Check where compiled kernels are kept: where the environment asks for, nowhere that others can write to, and nothing
that isn't ours is removed."""

import os
import time
from pathlib import Path

import pytest

from rasterizer.compiler import store
from rasterizer.compiler.store import Store

TITLE, KEY, CODE = "scan.scan", b"a key", bytes(range(256)) * 40
NAME = f"{store.PREFIX}0123456789abcdef"
OLD = 400 * 24 * 3600
IS_ROOT = hasattr(os, "geteuid") and os.geteuid() == 0
posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes are looked at on POSIX alone")


def only_file(folder) -> Path:
    (path,) = folder.glob(f"*{store.SUFFIX}")
    return path


# ---------------------------------------------------------------- what the environment asks for


@pytest.fixture
def environment(tmp_path, monkeypatch):
    """An environment without settings, whose caches are in a folder of the test's."""
    for name in [name for name in os.environ if name.startswith(("NUMBA_", "RASTER_"))]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    monkeypatch.setattr(store, "SHIPPED", tmp_path / "shipped")
    monkeypatch.chdir(tmp_path)
    tmp_path.chmod(0o700)
    return monkeypatch


def test_the_store_is_below_the_users_caches(environment, tmp_path):
    found = Store.of_process(True)
    assert found.own.parent == tmp_path / "caches" / "rasterizer" and found.folders == (found.own,)
    assert found.is_used and found.is_kept and found.reasons == ()


@pytest.mark.parametrize("given, expected", [
    ({"RASTER_STORE": "a"}, "a"),
    ({"NUMBA_CACHE_DIR": "b"}, "b"),
    ({"RASTER_STORE": "a", "NUMBA_CACHE_DIR": "b"}, "a"),
    ({"RASTER_STORE": "", "NUMBA_CACHE_DIR": "b"}, "b"),
    ({"RASTER_STORE": "", "NUMBA_CACHE_DIR": ""}, "caches/rasterizer"),
])  # fmt: skip
def test_a_folder_that_is_asked_for_is_the_only_one(environment, tmp_path, given, expected):
    for name, value in given.items():
        environment.setenv(name, str(tmp_path / value) if value else "")
    shipped = Store.into(tmp_path / "shipped").own
    found = Store.of_process(True)
    assert found.own.parent == tmp_path / expected
    assert found.folders == ((shipped, found.own) if expected.startswith("caches") else (found.own,))


@pytest.mark.parametrize("given, reason", [
    ({"RASTER_STORE": "off"}, "RASTER_STORE is off"),
    ({"NUMBA_BOUNDSCHECK": "1"}, "NUMBA_BOUNDSCHECK is set: kernels raise errors"),
])  # fmt: skip
def test_where_numba_calls_the_kernels_nothing_is_kept(environment, tmp_path, given, reason):
    for name, value in given.items():
        environment.setenv(name, value)
    found = Store.of_process(True)
    assert (found.folders, found.own, found.is_used) == ((), None, False) and found.reasons[0].startswith(reason)
    assert list(tmp_path.iterdir()) == []
    assert Store.of_process(False).reasons == ("the JIT is switched off",)


def test_a_store_that_was_shipped_for_other_sources_is_not_looked_into(environment, tmp_path):
    other = tmp_path / "shipped" / NAME
    other.mkdir(parents=True)
    found = Store.of_process(True)
    assert other not in found.folders and found.folders == (found.own,)


@posix
def test_a_shipped_store_that_others_can_write_to_is_not_looked_into(environment, tmp_path):
    shipped = Store.into(tmp_path / "shipped").own
    shipped.chmod(0o777)
    found = Store.of_process(True)
    assert found.folders == (found.own,) and f"others can write to {shipped}" in found.reasons[0]


def test_a_shipped_store_is_used_where_nothing_can_be_written(environment, tmp_path):
    shipped = Store.into(tmp_path / "shipped").own
    (tmp_path / "caches").write_text("a file")
    environment.setattr(store, "home_folders", lambda: [tmp_path / "caches"])
    found = Store.of_process(True)
    assert found.folders == (shipped,) and found.own is None and found.is_used and len(found.reasons) == 1


def test_using_a_store_keeps_it_young_and_sweeps_old_ones(environment, tmp_path):
    own = Store.of_process(True).own
    os.utime(own, (0, 0))
    old = make_old(own.parent / f"{store.PREFIX}00000000000000aa", f"a{store.SUFFIX}")
    assert Store.of_process(True).own == own
    assert time.time() - own.stat().st_mtime < 3600 and not old.exists()


# ---------------------------------------------------------------- what may be loaded


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


# ---------------------------------------------------------------- what is removed


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
