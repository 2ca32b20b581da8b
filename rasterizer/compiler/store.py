"""Where compiled kernels are kept, and files that hold one each.

A kernel on disk is code that every later run executes. So it is read only from a folder that nobody else can write to:

    folder, and every folder above it    belongs to the user who runs the program, or to root, and others can't write to
                                         it; above the folder itself, a sticky one like /tmp will do: there nobody can
                                         move what isn't his
    file                                 a regular one, not a link, of the same owners, that others can't write to

Writing by a group counts as writing by others, unless the group is the user's own: of his name, with no other member.
Links are followed first, so that what is looked at is what is used. On Windows nothing is looked at: rights are not in
a file's mode there, and folders of a user's profile are closed to others from the start.

A file holds a checksum over all that follows, the key it was stored under, and the code. What is cut off, garbled, or
of another version, is as good as no file: the kernel is compiled again. What can't be written is done without.
"""

import contextlib
import errno
import hashlib
import logging
import os
import stat
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from . import fingerprint
from .signatures import are_layouts_known

PREFIX, SUFFIX, HALF_WRITTEN = "rasterizer-kernels-", ".kernel", ".kernel-part"
MARKER, MARK = "of-rasterizer", b"Compiled kernels of rasterizer. This folder may be removed at any time.\n"
FORMAT = b"rasterizer kernel 1\n"
MAX_BYTES = 2**28  # of a file: kernels have less than a thousandth of it
SHIPPED = Path(__file__).resolve().parents[1] / "kernels"  # what came with the package; read only
MONTH = 30 * 24 * 3600  # seconds
_OFF, _ON = {"off", "no", "false", "0"}, {"on", "yes", "true", "1"}  # RASTER_STORE, in any case

_log = logging.getLogger("rasterizer")


def choose_folder(candidates, name: str) -> tuple[Path | None, list[str]]:
    """Return the first of the folders `candidates` below which a folder `name` is, or can be made, that only the user
    can write to, with that name; None where there is none. Also why those before it won't do.

    Folders that are missing are made, closed to everybody else.
    """
    reasons = []
    for candidate in candidates:
        try:
            base = Path(os.path.realpath(candidate))
            reason = find_distrust(next(step for step in (base, *base.parents) if os.path.lexists(step)), is_above=True)
            if not reason:
                folder = base / name
                for step in (*reversed(folder.parents), folder):
                    with contextlib.suppress(FileExistsError):
                        step.mkdir(mode=0o700)
                folder = Path(os.path.realpath(folder))
                reason = find_distrust(folder)
            if not reason:
                if not os.access(folder, os.W_OK | os.X_OK):
                    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
                _mark(folder)
                return folder, reasons
        except (OSError, ValueError) as fault:  # ValueError: a name with a null character
            reason = f"it can't be written ({getattr(fault, 'strerror', None) or fault})"
        reasons.append(f"{candidate}: {reason}")
    return None, reasons


def find_distrust(folder: Path, is_above: bool = False) -> str:
    """Say why code may not be kept in a folder, which exists and has no links in its path; nothing where it may.

    `is_above` tells that the folder is only one above it.
    """
    if os.name != "posix":
        return ""
    for step in (folder, *folder.parents):
        status = os.lstat(step)
        if status.st_uid not in (os.geteuid(), 0):
            return f"{step} belongs to another user"
        is_sticky = bool(status.st_mode & stat.S_ISVTX) and (is_above or step != folder)
        if _is_open_to_others(status) and not is_sticky:
            return f"others can write to {step}"
    return ""


def _is_open_to_others(status) -> bool:
    """Tell whether anybody but the owner can write."""
    if status.st_mode & stat.S_IWOTH:
        return True
    return bool(status.st_mode & stat.S_IWGRP) and not _is_private_group(status.st_gid)


def _is_private_group(number) -> bool:
    """Tell whether a group is the user's own: many systems make one for every user, and let it write."""
    import grp
    import pwd

    try:
        user, group = pwd.getpwuid(os.geteuid()).pw_name, grp.getgrgid(number)
    except KeyError:  # containers have users without names
        return False
    return group.gr_name == user and set(group.gr_mem) <= {user}


def home_folders() -> list[Path]:
    """Return where the user's caches may be: XDG_CACHE_HOME, else .cache in HOME, else in the home that the system
    knows of.

    Only absolute names count: others would depend on the folder that the program is started in.
    """
    asked, home = os.environ.get("XDG_CACHE_HOME", ""), os.path.expanduser("~")
    names = [asked] if os.path.isabs(asked) else [os.path.join(home, ".cache")]
    if os.name == "posix":
        import pwd

        with contextlib.suppress(KeyError):
            names.append(os.path.join(pwd.getpwuid(os.geteuid()).pw_dir, ".cache"))
    return [Path(name) for name in dict.fromkeys(names) if os.path.isabs(name)]


def _mark(folder: Path) -> None:
    """Say whose folder it is, and that it is in use: its age counts from now."""
    with contextlib.suppress(OSError):  # a full disk: then the folder is never removed
        if not (folder / MARKER).exists():
            (folder / MARKER).write_bytes(MARK)
        os.utime(folder)


def remove_old(folder: Path) -> None:
    """Remove the kernels of other versions beside `folder` that nobody has used for a month.

    Only a folder with exactly such a name and with the marker in it, never a link, and of it only files with names of
    ours.
    """
    with contextlib.suppress(OSError), os.scandir(folder.parent) as entries:
        for entry in entries:
            with contextlib.suppress(OSError):  # somebody else's, or just removed by another process
                if entry.name != folder.name and time.time() - entry.stat().st_mtime > MONTH and _is_ours(entry):
                    _empty(Path(entry.path))


def list_folders(base: Path) -> list[Path]:
    """List the folders of kernels below `base`, of this version and of others; only folders that this module made."""
    found = []
    with contextlib.suppress(OSError), os.scandir(base) as entries:
        for entry in entries:
            with contextlib.suppress(OSError):  # just removed by another process
                if _is_ours(entry):
                    found.append(Path(entry.path))
    return sorted(found)


def measure(folder: Path) -> tuple[int, int]:
    """Return how many kernels a folder holds, and how many bytes they take."""
    sizes = []
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith(SUFFIX):
                with contextlib.suppress(OSError):
                    sizes.append(entry.stat(follow_symlinks=False).st_size)
    return len(sizes), sum(sizes)


def clear(base: Path) -> None:
    """Remove the kernels of all versions below `base`, and nothing else; raises OSError where one can't be removed."""
    for folder in list_folders(base):
        _empty(folder)


def _is_ours(entry) -> bool:
    """Tell whether an entry of a folder is a folder that this module has made."""
    digits = entry.name.removeprefix(PREFIX)
    is_named = entry.name.startswith(PREFIX) and len(digits) == 16 and set(digits) <= set("0123456789abcdef")
    if not is_named or not entry.is_dir(follow_symlinks=False):
        return False
    marker = Path(entry.path) / MARKER
    return stat.S_ISREG(os.lstat(marker).st_mode) and marker.read_bytes() == MARK


def _empty(folder: Path) -> None:
    """Remove a folder of ours; it stays where there is anything else in it."""
    for name in os.listdir(folder):
        if name.endswith((SUFFIX, HALF_WRITTEN)):
            os.unlink(folder / name)
    if os.listdir(folder) == [MARKER]:
        os.unlink(folder / MARKER)
        os.rmdir(folder)


def title_of(function: Callable) -> str:
    """Return a kernel's name as its file in the store has it: that of its module, and its own."""
    return f"{function.__module__.rpartition('.')[2]}.{function.__name__}"


def file_name(title: str, key: bytes) -> str:
    """The name of the file that holds the kernel with this key."""
    return f"{title}-{hashlib.sha256(key).hexdigest()[:16]}{SUFFIX}"


def read_code(folder: Path, title: str, key: bytes) -> bytes | None:
    """Return the code that was stored under a key, or None where there is none, or none that can be used."""
    path = folder / file_name(title, key)
    try:
        content = _read_own(path)
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


def _read_own(path: Path) -> bytes:
    """Read a regular file that nobody else can have written; OSError for anything else."""
    flags = os.O_RDONLY | sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY", "O_CLOEXEC"))
    with open(os.open(path, flags), "rb") as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode) or status.st_size > MAX_BYTES:
            raise OSError(f"{path} is not a file with a kernel")
        if os.name == "posix" and (status.st_uid not in (os.geteuid(), 0) or _is_open_to_others(status)):
            raise OSError(f"others may have written {path}")
        return file.read()


def write_code(folder: Path, title: str, key: bytes, code: bytes) -> None:
    """Store code under a key, whole or not at all; where that can't be done, nothing is stored."""
    rest = len(key).to_bytes(4, "little") + key + code
    path, part = folder / file_name(title, key), folder / f"{os.urandom(8).hex()}{HALF_WRITTEN}"
    try:
        with open(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644), "wb") as file:
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
    reasons : why folders, or all of it, won't do
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

        RASTER_STORE is "off", "on" (as if it were not set), or the path of the only folder, with a separator in it;
        NUMBA_CACHE_DIR is the only folder, too, where RASTER_STORE is not set. A "~" in front is the user's home.
        Otherwise the user's folder for caches is taken, and a folder in the package is looked into first.
        """
        word = os.environ.get("RASTER_STORE", "").strip()
        is_off, is_on = word.lower() in _OFF, word.lower() in _ON
        asked = os.path.expanduser(("" if is_on else word) or os.environ.get("NUMBA_CACHE_DIR", ""))
        reason = _find_hindrance(is_off) if is_compiling else "the JIT is switched off"
        if reason:
            return cls(reasons=(reason,))
        name = own_name()
        candidates = [Path(asked)] if asked else [folder / "rasterizer" for folder in home_folders()]
        shipped = SHIPPED / shipped_name() if SHIPPED.is_dir() else None
        version = fingerprint.numba_version()
        if version and not fingerprint.is_seen(version):
            candidates, wrong = [], [f"numba {version} is newer or older than the versions that were tried"]
        elif word and not (is_on or word.startswith("~") or os.path.dirname(word)):
            candidates, wrong = [], [f"RASTER_STORE must be on, off, or a path such as ./{word}; given {word[:60]!r}"]
        else:
            wrong = []
        own, reasons = choose_folder(candidates, name)
        reasons = wrong + reasons
        if own is not None:
            remove_old(own)
        folders = [shipped] if not asked and shipped and shipped.is_dir() and not _distrust_of(shipped, reasons) else []
        found = (*folders, *([own] if own else []))
        return cls(found, own, True, tuple(reasons), fingerprint.usable_processors())

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
        own.mkdir(mode=0o755, parents=True, exist_ok=True)
        reason = find_distrust(own)
        if not reason and not os.access(own, os.W_OK | os.X_OK):
            reason = os.strerror(errno.EACCES)
        if reason:
            raise PermissionError(errno.EACCES, reason, str(own))
        _mark(own)
        return cls.at(own)

    @classmethod
    def at(cls, own: Path) -> "Store":
        """Return the store with a folder that another process has made, to keep what is compiled here.

        Raises RuntimeError where it is for other sources, versions or settings than this process's.
        """
        if own.name not in (own_name(), shipped_name()):
            raise RuntimeError(f"it would be kept in {own.parent / own_name()}")
        return cls((own,), own, True, (), fingerprint.usable_processors())

    def find(self, title: str, signature: tuple):
        """Yield the codes that were kept for a signature and run on this processor, the best one first."""
        for folder in self.folders:
            for processor in self.processors:
                code = read_code(folder, title, _key(title, signature, processor))
                if code is not None:
                    yield code

    def keep(self, title: str, signature: tuple, code: bytes) -> None:
        """Keep a code for a signature and this processor, where there is a folder for it."""
        if self.own is not None:
            write_code(self.own, title, _key(title, signature, self.processors[0]), code)


def own_name() -> str:
    """Return the name of the folder with what is compiled by this process's versions."""
    return f"{PREFIX}{fingerprint.hash_sources(fingerprint.describe_compiler())}"


def shipped_name() -> str:
    """Return the name of a folder with what other versions may have compiled, and this process can call."""
    return f"{PREFIX}{fingerprint.hash_sources(fingerprint.describe_layouts())}"


def _key(title: str, signature: tuple, processor: str) -> bytes:
    return repr((title, signature, processor)).encode()


def _find_hindrance(is_off: bool) -> str:
    """Say why numba compiles and calls the kernels in this process; nothing where the store does."""
    if is_off:
        return "RASTER_STORE is off"
    if fingerprint.setting("BOUNDSCHECK"):
        return "NUMBA_BOUNDSCHECK is set: kernels raise errors, for which they need numba"
    return "" if are_layouts_known() else "arrays look different in memory here"


def _distrust_of(folder: Path, reasons: list) -> str:
    """Say why code in a folder that is there may not be used, also in the list of reasons."""
    reason = find_distrust(Path(os.path.realpath(folder)))
    if reason:
        reasons.append(f"{folder}: {reason}")
    return reason
