"""Where compiled kernels are kept: where the environment asks for, nowhere that others can write to, and nothing that
isn't ours is removed."""

import importlib.util
import os
import shutil
import time
from types import SimpleNamespace

import pytest

from rasterizer.compiler import store
from rasterizer.compiler.store import Store

TITLE, KEY, CODE = "scan.scan", b"a key", bytes(range(256)) * 40
NAME = f"{store.PREFIX}0123456789abcdef"
OLD = 400 * 24 * 3600
IS_ROOT = hasattr(os, "geteuid") and os.geteuid() == 0
posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes are looked at on POSIX alone")


# ---------------------------------------------------------------- what the environment asks for


@pytest.fixture
def environment(tmp_path, monkeypatch):
    """An environment without settings, whose caches are in a folder of the test's."""
    for name in [name for name in os.environ if name.startswith(("NUMBA_", "RASTER_"))]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    monkeypatch.chdir(tmp_path)
    tmp_path.chmod(0o700)
    return monkeypatch


@pytest.fixture
def installed(environment, tmp_path):
    """The module as a package in a folder of the test's has it: kernels that were shipped are beside it."""
    place = tmp_path / "package" / "compiler" / "store.py"
    place.parent.mkdir(parents=True)
    shutil.copy(store.__file__, place)
    spec = importlib.util.spec_from_file_location("rasterizer.compiler.store_elsewhere", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert tmp_path / "package" / "kernels" == module.SHIPPED
    return module


def without_a_name(monkeypatch):
    """Let the system know nothing of the user, as in a container that runs under any number."""
    import pwd

    def nobody(_number):
        raise KeyError("no entry")

    monkeypatch.setattr(pwd, "getpwuid", nobody)


def test_the_store_is_below_the_users_caches(installed, tmp_path):
    found = installed.Store.of_process(True)
    assert found.own.parent == tmp_path / "caches" / "rasterizer" and found.folders == (found.own,)
    assert found.is_used and found.is_kept and found.reasons == () and found.processors


def test_a_folder_that_is_asked_for_is_the_only_one(installed, environment, tmp_path):
    shipped = installed.Store.into(installed.SHIPPED).own
    for own, numbas, expected in (
        ("a", None, "a"),
        (None, "b", "b"),
        ("a", "b", "a"),
        ("", "b", "b"),
        ("", "", "caches/rasterizer"),
    ):
        for name, value in (("RASTER_STORE", own), ("NUMBA_CACHE_DIR", numbas)):
            environment.delenv(name, raising=False)
            if value is not None:
                environment.setenv(name, str(tmp_path / value) if value else "")
        found = installed.Store.of_process(True)
        assert found.own.parent == tmp_path / expected, f"RASTER_STORE={own}, NUMBA_CACHE_DIR={numbas}: {found.own}"
        assert found.folders == ((shipped, found.own) if expected.startswith("caches") else (found.own,))


def test_words_for_the_store_are_taken_in_any_case_and_no_folder_has_their_name(environment, tmp_path):
    environment.chdir(tmp_path)
    environment.setenv("HOME", str(tmp_path / "home"))
    for asked, expected in (
        *((word, "off") for word in ("off", "OFF", " Off ", "no", "False", "0")),
        *((word, "caches/rasterizer") for word in ("on", "ON", "yes", "True", "1")),
        *((word, "refused") for word in ("of", "none", "disabled", "kernels")),
        ("~", "home"),
        ("~/kernels", "home/kernels"),
        ("./off", "off"),
    ):
        environment.setenv("RASTER_STORE", asked)
        found = Store.of_process(True)
        if expected == "refused":
            assert found.own is None and f"given {asked!r}" in found.reasons[0] and "on, off" in found.reasons[0]
        elif expected == "off" and os.path.dirname(asked) == "":
            assert (found.own, found.is_used) == (None, False), asked
        else:
            assert found.own.parent == tmp_path / expected, asked
        assert not {each.name for each in tmp_path.iterdir()} - {"home", "caches", "off"}
        assert (tmp_path / "off").exists() == (asked == "./off")


def test_where_numba_calls_the_kernels_nothing_is_kept(environment, tmp_path):
    for name, value, reason in (
        ("RASTER_STORE", "off", "RASTER_STORE is off"),
        ("NUMBA_BOUNDSCHECK", "1", "NUMBA_BOUNDSCHECK is set: kernels raise errors"),
    ):
        with environment.context() as patch:
            patch.setenv(name, value)
            found = Store.of_process(True)
        assert (found.folders, found.own, found.is_used) == ((), None, False) and found.reasons[0].startswith(reason)
    assert list(tmp_path.iterdir()) == []
    assert Store.of_process(False) == Store(reasons=("the JIT is switched off",))


def test_a_store_that_was_shipped_is_used_where_it_is_ours(installed, environment, tmp_path):
    """Not that of other sources, nor one that others can write to; it will do alone, where nothing can be written."""
    (installed.SHIPPED / NAME).mkdir(parents=True)
    found = installed.Store.of_process(True)
    assert found.folders == (found.own,), "shipped for other sources"
    shipped = installed.Store.into(installed.SHIPPED).own
    assert installed.Store.of_process(True).folders == (shipped, found.own)
    if os.name == "posix":
        shipped.chmod(0o777)
        found = installed.Store.of_process(True)
        assert found.folders == (found.own,) and f"others can write to {shipped}" in found.reasons[0]
        shipped.chmod(0o755)
        (tmp_path / "file").write_text("a file")
        without_a_name(environment)
        environment.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
        found = installed.Store.of_process(True)
        assert found.folders == (shipped,) and found.own is None and found.is_used and len(found.reasons) == 1


def test_using_a_store_keeps_it_young_and_sweeps_old_ones(environment, tmp_path):
    own = Store.of_process(True).own
    os.utime(own, (0, 0))
    old = make_old(own.parent / f"{store.PREFIX}00000000000000aa", f"a{store.SUFFIX}")
    assert Store.of_process(True).own == own
    age = time.time() - own.stat().st_mtime
    assert age < 3600 and not old.exists(), f"used a moment ago, and still {age:.0f} s old > 3600"


def test_a_store_to_be_shipped_says_why_it_can_not_be_made(environment, tmp_path):
    (tmp_path / "file").write_text("precious")
    with pytest.raises(OSError):
        Store.into(tmp_path / "file" / "below")
    if os.name == "posix":
        place = tmp_path / "open"
        place.mkdir()
        place.chmod(0o777)
        with pytest.raises(PermissionError, match=f"others can write to {place}"):
            Store.into(place)


# ---------------------------------------------------------------- what may be loaded


def test_a_new_folder_is_closed_to_others_and_found_again(tmp_path):
    for _ in range(2):
        folder, reasons = store.choose_folder([tmp_path / "a" / "b"], NAME)
        assert folder == tmp_path / "a" / "b" / NAME and not reasons
    if os.name == "posix":
        modes = {step.stat().st_mode & 0o777 for step in (folder, folder.parent, folder.parent.parent)}
        assert modes == {0o700}


@posix
def test_what_others_can_write_to_is_refused(tmp_path, monkeypatch):
    """A sticky folder will do above the folder, where nobody can move what isn't his; a group is others, unless one's
    own: of the user's name, with no other member."""
    import grp
    import pwd

    groups = {
        "another": ("users", []),
        "with others": ("me", ["me", "you"]),
        "own": ("me", []),
        "named": ("me", ["me"]),
    }
    monkeypatch.setattr(pwd, "getpwuid", lambda _number: SimpleNamespace(pw_name="me", pw_dir=str(tmp_path)))
    folder = tmp_path / "outer" / "inner" / NAME
    folder.mkdir(parents=True)
    for place in (folder, folder.parent, folder.parent.parent):
        for mode in (0o777, 0o707, 0o1777, 0o775):
            place.chmod(mode)
            for kind, (name, members) in groups.items():
                group = SimpleNamespace(gr_name=name, gr_mem=members)
                monkeypatch.setattr(grp, "getgrgid", lambda _number, group=group: group)
                found, reasons = store.choose_folder([folder.parent], NAME)
                is_safe = (mode == 0o1777 and place != folder) or (mode == 0o775 and kind in ("own", "named"))
                case = f"{place} with {mode:o}, a group of kind {kind}"
                assert found == (folder if is_safe else None), case
                assert is_safe or (len(reasons) == 1 and f"others can write to {place}" in reasons[0]), (case, reasons)
        place.chmod(0o700)


@posix
@pytest.mark.skipif(not IS_ROOT, reason="only root can give files away")
def test_what_belongs_to_somebody_else_is_refused(tmp_path):
    folder = tmp_path / "outer" / NAME
    folder.mkdir(parents=True)
    store.write_code(folder, TITLE, KEY, CODE)
    (file,) = folder.glob(f"*{store.SUFFIX}")
    os.chown(file, 12345, 12345)
    assert store.read_code(folder, TITLE, KEY) is None
    for place in (folder, folder.parent):
        os.chown(place, 12345, 12345)
        found, reasons = store.choose_folder([folder.parent], NAME)
        assert found is None and "belongs to another user" in reasons[0], place
        os.chown(place, os.geteuid(), 0)
    assert store.choose_folder([folder.parent], NAME)[0] == folder


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


def test_only_absolute_homes_count(monkeypatch, tmp_path):
    """Else a folder would be made, and code loaded, where the program happens to be started."""
    monkeypatch.chdir(tmp_path)
    for home in (None, "", "~", "relative", ".", "/nowhere/at/all"):
        for cache in (None, "", "relative", "./here", "~/.cache"):
            for name, value in (("HOME", home), ("XDG_CACHE_HOME", cache)):
                monkeypatch.delenv(name, raising=False)
                if value is not None:
                    monkeypatch.setenv(name, value)
            for folder in store.home_folders():
                is_absolute = folder.is_absolute() and tmp_path not in folder.parents
                assert is_absolute, f"HOME={home}, XDG_CACHE_HOME={cache}: {folder}"
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert store.home_folders()[0] == tmp_path / "home" / ".cache"


@posix
def test_a_user_without_a_home_or_a_name_makes_no_folder(tmp_path, monkeypatch):
    without_a_name(monkeypatch)
    monkeypatch.chdir(tmp_path)
    for name in ("HOME", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    assert store.home_folders() == []
    assert not list(tmp_path.iterdir())
    tmp_path.chmod(0o770)  # no group is his own
    assert "others can write" in store.find_distrust(tmp_path)


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
    kernel, prefix = f"scan.scan-0{store.SUFFIX}", f"{store.PREFIX}00000000000000"
    ours = make_old(tmp_path / f"{prefix}aa", kernel, f"x{store.HALF_WRITTEN}")
    others = [make_old(tmp_path / name, kernel) for name in (
        "elsewhere", "kernels-0123456789abcdef", f"{prefix}AD", f"{prefix}a", f"{prefix}aee",
        f"{store.PREFIX}{'z' * 16}",
    )]  # fmt: skip
    others.append(make_old(tmp_path / f"{prefix}ab", kernel, marker=None))
    others.append(make_old(tmp_path / f"{prefix}ac", kernel, marker=b"mine"))
    in_use = make_old(tmp_path / NAME, kernel)
    young = make_old(tmp_path / f"{prefix}af", kernel)
    os.utime(young, (time.time() - 20 * 24 * 3600,) * 2)
    thesis = make_old(tmp_path / "kernels-of-my-thesis", "thesis.tex")
    mixed = make_old(tmp_path / f"{prefix}b2", kernel, "thesis.tex")
    (tmp_path / f"{prefix}b0").symlink_to(tmp_path / "elsewhere")
    (tmp_path / f"{prefix}b1").write_text("a file")
    os.utime(tmp_path / f"{prefix}b1", (0, 0))
    store.remove_old(in_use)
    assert not ours.exists()
    for folder in (*others, in_use, young):
        assert (folder / kernel).exists(), f"{folder.name} is removed"
    for folder in (thesis, mixed):
        assert (folder / "thesis.tex").read_text() == "something", folder.name
    assert (tmp_path / f"{prefix}b0").is_symlink() and (tmp_path / f"{prefix}b1").read_text() == "a file"
