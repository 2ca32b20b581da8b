"""Where compiled kernels are kept: where the environment asks for, nowhere that others can write to, and nothing that
isn't ours is removed."""

import importlib.util
import os
import shutil

import pytest

from rasterizer.compiler import store
from rasterizer.compiler.store import Store

NAME = f"{store.PREFIX}0123456789abcdef"
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


def test_the_store_is_off_or_a_folder(environment, tmp_path):
    environment.setenv("HOME", str(tmp_path / "home"))
    for asked, expected in (
        ("off", None),
        ("OFF", None),
        ("~", "home"),
        ("~/kernels", "home/kernels"),
        ("./off", "off"),
    ):
        environment.setenv("RASTER_STORE", asked)
        found = Store.of_process(True)
        if expected is None:
            assert (found.own, found.is_used) == (None, False), asked
        else:
            assert found.own.parent == tmp_path / expected, asked


def test_a_store_that_was_shipped_is_used_and_will_do_alone(installed, environment, tmp_path):
    """Not that of other sources; it may belong to anybody, as the package may."""
    (installed.SHIPPED / NAME).mkdir(parents=True)
    found = installed.Store.of_process(True)
    assert found.folders == (found.own,), "shipped for other sources"
    shipped = installed.Store.into(installed.SHIPPED).own
    assert installed.Store.of_process(True).folders == (shipped, found.own)
    (tmp_path / "file").write_text("a file")
    environment.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    found = installed.Store.of_process(True)
    assert found.folders == (shipped,) and found.own is None and found.is_used and len(found.reasons) == 1


def test_a_store_to_be_shipped_says_why_it_can_not_be_made(environment, tmp_path):
    (tmp_path / "file").write_text("precious")
    with pytest.raises(OSError):
        Store.into(tmp_path / "file" / "below")
    if os.name == "posix":
        own = tmp_path / "open" / store.shipped_name()
        own.mkdir(parents=True)
        own.chmod(0o777)
        with pytest.raises(PermissionError, match="others can write to it"):
            Store.into(own.parent)


# ---------------------------------------------------------------- what may be loaded


def test_a_new_folder_is_closed_to_others_and_found_again(tmp_path):
    folder = tmp_path / "a" / "b" / NAME
    for _ in range(2):
        store.make_folder(folder)
    assert folder.is_dir() and (os.name != "posix" or folder.stat().st_mode & 0o777 == 0o700)


@posix
def test_what_others_can_write_to_is_refused(tmp_path):
    folder = tmp_path / NAME
    folder.mkdir()
    for mode in (0o777, 0o707, 0o1777, 0o775):
        folder.chmod(mode)
        with pytest.raises(PermissionError, match="others can write to it"):
            store.make_folder(folder)
    folder.chmod(0o755)
    store.make_folder(folder)


@posix
@pytest.mark.skipif(not IS_ROOT, reason="only root can give files away")
def test_what_belongs_to_somebody_else_is_refused(tmp_path):
    folder = tmp_path / NAME
    folder.mkdir(mode=0o700)
    os.chown(folder, 12345, 12345)
    with pytest.raises(PermissionError, match="belongs to another user"):
        store.make_folder(folder)


def test_what_is_no_folder_is_refused_and_stays(tmp_path):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "file").write_text("precious")
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    for name in ("loop", "loop/below", "file", "file/below", "link", "x" * 300):
        with pytest.raises(OSError):
            store.make_folder(tmp_path / name)
    assert (tmp_path / "file").read_text() == "precious"


# ---------------------------------------------------------------- what is removed


def test_only_folders_of_ours_are_removed(tmp_path):
    kernel, prefix = f"scan.scan-0{store.SUFFIX}", f"{store.PREFIX}00000000000000"

    def make(name, *files):
        (tmp_path / name).mkdir()
        for file in files:
            (tmp_path / name / file).write_text("something")
        return tmp_path / name

    ours = [make(f"{prefix}aa", kernel, f"x{store.HALF_WRITTEN}"), make(NAME, kernel)]
    others = [make(name, kernel) for name in (
        "elsewhere", "kernels-0123456789abcdef", f"{prefix}AD", f"{prefix}a", f"{prefix}aee",
        f"{store.PREFIX}{'z' * 16}",
    )]  # fmt: skip
    (tmp_path / f"{prefix}b0").symlink_to(tmp_path / "elsewhere")
    (tmp_path / f"{prefix}b1").write_text("a file")
    assert store.list_folders(tmp_path) == sorted(ours)
    store.clear(tmp_path)
    assert not any(folder.exists() for folder in ours)
    assert all((folder / kernel).exists() for folder in others)
    assert (tmp_path / f"{prefix}b0").is_symlink() and (tmp_path / f"{prefix}b1").read_text() == "a file"
