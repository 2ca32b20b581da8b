"""Where compiled kernels are kept, and files that hold one each.

A kernel on disk is code that every later run executes. So what is compiled is kept in a folder that is the user's own
and that nobody else can write to, or not at all, and a file that another user has made is not read. On Windows nothing
of that is looked at: rights are not in a file's mode there, and folders of a user's profile are closed to others from
the start. Kernels that come with the package, in a folder beside its sources, are only read: who can write there could
as well change the sources.

A folder's name tells of the sources, the versions and the settings that its kernels were made with. A file holds a
checksum over all that follows, the key it was stored under, and the code. What is cut off, garbled, or of another
version, is as good as no file: the kernel is compiled again. What can't be written is done without.
"""

import contextlib
import errno
import hashlib
import logging
import os
import re
import shutil
import stat
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from . import fingerprint
from .layouts import are_layouts_known

PREFIX, SUFFIX, HALF_WRITTEN = "rasterizer-kernels-", ".kernel", ".kernel-part"
FORMAT = b"rasterizer kernel 1\n"
SHIPPED = Path(__file__).resolve().parents[1] / "kernels"  # what came with the package; read only

_log = logging.getLogger("rasterizer")


def make_folder(folder: Path, mode: int = 0o700) -> None:
    """Make a folder for kernels, unless it is there.

    Raises OSError where it can't be made or written to, isn't the user's, or others can write to it.
    """
    folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with contextlib.suppress(FileExistsError):
        folder.mkdir(mode=mode)
    status = os.lstat(folder)
    if not stat.S_ISDIR(status.st_mode):
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder))
    if os.name == "posix" and status.st_uid != os.geteuid():
        raise PermissionError(errno.EPERM, "it belongs to another user", str(folder))
    if os.name == "posix" and status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PermissionError(errno.EPERM, "others can write to it", str(folder))
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(folder))


def list_folders(base: Path) -> list[Path]:
    """List the folders of kernels below `base`, of this version and of others."""
    with contextlib.suppress(OSError), os.scandir(base) as entries:
        found = [each for each in entries if re.fullmatch(f"{PREFIX}[0-9a-f]{{16}}", each.name)]
        return sorted(Path(each.path) for each in found if each.is_dir(follow_symlinks=False))
    return []


def measure(folder: Path) -> tuple[int, int]:
    """Return how many kernels a folder holds, and how many bytes they take."""
    sizes = []
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith(SUFFIX):
                with contextlib.suppress(OSError):  # just removed by another process
                    sizes.append(entry.stat(follow_symlinks=False).st_size)
    return len(sizes), sum(sizes)


def clear(base: Path) -> None:
    """Remove the folders of kernels of all versions below `base`; raises OSError where one can't be removed."""
    for folder in list_folders(base):
        shutil.rmtree(folder)


def title_of(function: Callable) -> str:
    """Return a kernel's name as its file in the store has it: that of its module, and its own."""
    return f"{function.__module__.rpartition('.')[2]}.{function.__name__}"


def is_own(function: Callable) -> bool:
    """Tell whether a function is of this package: the name of a store's folder tells of no other sources."""
    return function.__module__.partition(".")[0] == __name__.partition(".")[0]


def read_code(path: Path, key: bytes, is_shipped: bool = False) -> bytes | None:
    """Return the code that was stored in a file under a key, or None where there is none, or none that can be used.

    is_shipped : it came with the package, which may belong to anybody
    """
    try:
        with open(path, "rb") as file:
            # The folders above the store's may be another user's, who could put one of his own in its place.
            if os.name == "posix" and not is_shipped and os.fstat(file.fileno()).st_uid != os.geteuid():
                raise PermissionError(errno.EPERM, "it belongs to another user", str(path))
            content = file.read()
    except FileNotFoundError:
        return None
    except OSError as fault:
        _log.info("kernel %s can't be read and is compiled again (%s)", path, fault.strerror or fault)
        return None
    checksum, rest = content[len(FORMAT) : len(FORMAT) + 32], memoryview(content)[len(FORMAT) + 32 :]
    if not content.startswith(FORMAT) or hashlib.sha256(rest).digest() != checksum:
        _log.info("kernel %s is damaged and is compiled again", path)
        return None
    size = int.from_bytes(rest[:4], "little")
    return bytes(rest[4 + size :]) if rest[4 : 4 + size] == key else None


def write_code(path: Path, key: bytes, code: bytes) -> None:
    """Store code under a key, whole or not at all; where that can't be done, nothing is stored."""
    rest = len(key).to_bytes(4, "little") + key + code
    part = path.parent / f"{os.urandom(8).hex()}{HALF_WRITTEN}"
    try:
        with open(
            os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o644), "wb"
        ) as file:
            file.write(FORMAT + hashlib.sha256(rest).digest() + rest)
        os.replace(part, path)
    except OSError as fault:
        _log.info("kernel %s can't be kept (%s)", path, fault.strerror or fault)
        with contextlib.suppress(OSError):
            os.unlink(part)


# ---------------------------------------------------------------- the store of this process


class Store(NamedTuple):
    """Where compiled kernels are looked for and kept.

    folders : where they are looked for: what came with the package, then the user's own
    own : the one that new ones are written to; None where there is none
    is_used : False where numba compiles and calls the kernels
    reasons : why there is no folder, or why numba calls them
    processors : those whose code runs here, the best one first
    """

    folders: tuple[Path, ...] = ()
    own: Path | None = None
    is_used: bool = False
    reasons: tuple[str, ...] = ()
    processors: tuple[str, ...] = ()

    @classmethod
    def of_process(cls, is_compiling: bool) -> "Store":
        """Return the store that the environment asks for.

        RASTER_STORE is "off", or the only folder; where it is not set, NUMBA_CACHE_DIR is that. A "~" in front is the
        user's home. Otherwise kernels are kept in the user's folder for caches, XDG_CACHE_HOME or ~/.cache; a folder in
        the package is looked into first.
        """
        word = os.environ.get("RASTER_STORE", "")
        asked = os.path.expanduser(word or os.environ.get("NUMBA_CACHE_DIR", ""))
        hindrance = ""
        if not is_compiling:
            hindrance = "the JIT is switched off"
        elif word.lower() == "off":
            hindrance = "RASTER_STORE is off"
        elif fingerprint.setting("BOUNDSCHECK"):
            hindrance = "NUMBA_BOUNDSCHECK is set: kernels raise errors, for which they need numba"
        elif not are_layouts_known():
            hindrance = "arrays look different in memory here"
        if hindrance:
            return cls(reasons=(hindrance,))
        own, reason = None, ""
        caches = os.environ.get("XDG_CACHE_HOME", "")
        caches = caches if os.path.isabs(caches) else os.path.join(os.path.expanduser("~"), ".cache")
        base = asked or os.path.join(caches, "rasterizer")
        if not asked and not os.path.isabs(base):  # it would depend on where the program is started
            reason = "there is no folder for caches: neither XDG_CACHE_HOME nor HOME is an absolute path"
        else:
            own = Path(os.path.realpath(base)) / own_name()
            try:
                make_folder(own)
            except OSError as fault:
                own, reason = None, f"{base}: it can't be written ({fault.strerror or fault})"
        shipped = SHIPPED / shipped_name() if SHIPPED.is_dir() and not asked else None
        folders = tuple(folder for folder in (shipped, own) if folder is not None and folder.is_dir())
        return cls(folders, own, True, (reason,) if reason else (), fingerprint.usable_processors())

    @property
    def is_kept(self) -> bool:
        """Tell whether what is compiled is kept for other processes."""
        return self.own is not None

    @classmethod
    def into(cls, folder: Path) -> "Store":
        """Return a store of its own in a folder, for others to read: with any versions that the package runs on.

        Raises OSError where the folder can't be made or written, or others can write to it.
        """
        own = Path(os.path.realpath(folder)) / shipped_name()
        make_folder(own, 0o755)
        return cls.at(own)

    @classmethod
    def at(cls, own: Path) -> "Store":
        """Return the store with a folder that another process has made, to keep what is compiled here.

        Raises RuntimeError where it is for other sources, versions or settings than this process's.
        """
        if own.name not in (own_name(), shipped_name()):
            raise RuntimeError(f"it would be kept in {own.parent / own_name()}")
        return cls((own,), own, True, (), fingerprint.usable_processors())

    def find(self, function: Callable, signature: tuple) -> bytes | None:
        """Return the code that was kept for a function and a signature and runs on this processor, the best one."""
        for folder in self.folders if is_own(function) else ():
            for processor in self.processors:
                path, key = _path_in(folder, function, signature, processor)
                code = read_code(path, key, is_shipped=folder != self.own)
                if code is not None:
                    return code
        return None

    def keep(self, function: Callable, signature: tuple, code: bytes) -> None:
        """Keep a code for a signature and this processor, where there is a folder for it and the function is ours."""
        if self.own is not None and is_own(function):
            path, key = _path_in(self.own, function, signature, self.processors[0])
            write_code(path, key, code)


def _path_in(folder, function, signature, processor) -> tuple[Path, bytes]:
    """Return the file for the code of a function, and the key that it is stored under there."""
    title = title_of(function)
    key = repr((title, signature, processor)).encode()
    return folder / f"{title}-{hashlib.sha256(key).hexdigest()[:16]}{SUFFIX}", key


def own_name() -> str:
    """Return the name of the folder with what is compiled by this process's versions."""
    return f"{PREFIX}{fingerprint.hash_sources(fingerprint.describe_compiler() + fingerprint.describe_layouts())}"


def shipped_name() -> str:
    """Return the name of a folder with what other versions may have compiled, and this process can call."""
    return f"{PREFIX}{fingerprint.hash_sources(fingerprint.describe_layouts())}"
