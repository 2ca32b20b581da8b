"""Which files may be read, and how they are written: the one place where this is decided.

What a person names (an argument of `load`, of `Texture`, of the command line) may be any file, pipe or link that ends.
What a
*file* names is found by these rules, whatever its format: material libraries (MTL), textures, buffers and images, and
the models and arrays of scene files:

    where      at or below the folder of the file that the person named; links are followed first, so that none leads
               out of it
    refused    absolute paths, `..` that leave that folder, schemes such as http: or file: (but data: in glTF)
    what       regular files only; a pipe, device or folder is never opened
    how much   as many bytes as the format says (a glTF buffer's byteLength), else the whole file
    capitals   need not agree where no other file has the name; a backslash counts as a slash (OBJ and MTL)
    paths      of the author's machine (OBJ and MTL): where nothing is, or may be read, the last part is looked for in
               the folder

`allow_outside=True` of `load`, or `--allow-outside`, removes the first two for local files. What a refused file holds
is in no message.

Files are written whole or not at all: first hidden beside their places, then renamed. A file that is protected against
writing is refused, though its folder may be written.
"""

import contextlib
import os
import stat
import threading
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ..errors import ModelError, OutputError, SceneError, cut, shown

_SCHEME_LENGTH = 2  # letters before a colon from which on they are a scheme; a single one is a drive
LONG = 1 << 22  # bytes of a file that is worth reading in parts


class OutsideError(ValueError):
    """A file names another that it may not read."""


class Folder:
    """Find and read the files that a file names; see the rules above.

    Parameters
    ----------
    path : where the names are relative to; None = nothing may be read, as for a model given as bytes
    root : Path that must hold what is read; None = `path`
    allow_outside : bool, whether files elsewhere may be read too
    read : list to which the paths (text) of all files that are read are added
    """

    def __init__(self, path, root=None, allow_outside: bool = False, read: list | None = None):
        self.path = None if path is None else Path(path)
        self.root = self.path if root is None else Path(root)
        self.allow_outside = allow_outside
        self.read = [] if read is None else read
        self._listings = {}

    def below(self, path) -> "Folder":
        """Return the same rules for names that are relative to another folder within."""
        return Folder(path, self.root, self.allow_outside, self.read)

    def check(self, path) -> Path:
        """Return the path of a file that may be read.

        Raises
        ------
        OutsideError : it lies elsewhere, or is no regular file
        OSError, ValueError : there is none, or no file can have this name
        """
        real = Path(os.path.realpath(path, strict=True))
        if not self.allow_outside and not real.is_relative_to(os.path.realpath(self.root)):
            where = "lies outside the folder of the file that names it"
            raise OutsideError(f"{where}; --allow-outside, or allow_outside=True, reads it")
        if not stat.S_ISREG(os.stat(real).st_mode):
            raise OutsideError("is no regular file")
        return Path(path)

    def find(self, name: str) -> Path:
        """Return the path of a file by its name, relative to the folder; raises what `check` does."""
        if self.path is None:
            raise OutsideError("was named by a file that was given without a folder")
        head = name.partition(":")[0]
        has_scheme = ":" in name and len(head) >= _SCHEME_LENGTH and head.replace("+", "").replace("-", "").isalnum()
        if has_scheme and not (self.path / name).is_file():
            raise OutsideError(f"is no file, but has the scheme {head[:20]}:")
        if not self.allow_outside and os.path.isabs(name):
            raise OutsideError("is an absolute path; --allow-outside, or allow_outside=True, reads it")
        return self.check(self.path / name)

    def find_alike(self, name: str) -> Path:
        """Return the path of a file as OBJ and MTL name it: as written, whatever its capitals, or just its last part.

        Raises OutsideError where a file of this name is there, but may not be read; FileNotFoundError where none is.
        """
        if self.path is None:
            raise FileNotFoundError("no folder")
        name, refusal = name.replace("\\", "/"), None
        plain = name[1:-1] if len(name) > 2 and name[0] == name[-1] == '"' else name  # some exporters write quotes
        for wanted in dict.fromkeys((name, plain, plain.rsplit("/", 1)[-1])):
            for spell in (self.path.joinpath, self._whatever_capitals):
                try:
                    path = self.check(spell(wanted))
                    if self.allow_outside or not os.path.isabs(wanted):
                        return path
                    raise OutsideError("is an absolute path; --allow-outside, or allow_outside=True, reads it")
                except OutsideError as fault:
                    refusal = refusal or fault
                except OSError:
                    continue
        raise refusal or FileNotFoundError("no such file")

    def _whatever_capitals(self, name: str) -> Path:
        """Return a path below the folder, with the capitals of the files that are there; OSError where none can be."""
        found = self.path
        for word in name.split("/"):
            if word in ("", "."):
                continue
            if not found.is_dir():  # or its path is too long for the system, of which Python 3.14 makes no error
                raise FileNotFoundError("no such folder")
            if word == ".." or (found / word).exists():
                found = found / word
                continue
            if found not in self._listings:  # many names may be missing
                names = sorted((entry.name for entry in found.iterdir()), reverse=True)
                self._listings[found] = {each.lower(): each for each in names}
            found = found / self._listings[found].get(word.lower(), word)
        return found

    def read_bytes(self, path, max_bytes: int | None = None) -> bytes:
        """Return the bytes of a file that `find` has returned, up to `max_bytes`; raises what `check` does."""
        with open(self.check(path), "rb") as stream:
            self.read.append(str(path))
            return stream.read(-1 if max_bytes is None else max_bytes)


# A file as a caller gives it: its path, an open one, or its bytes.


def name_of(source, otherwise: str = "model") -> str:
    """Return what messages call a file; `otherwise` where it has no name."""
    label = source if isinstance(source, (str, os.PathLike)) else getattr(source, "name", None)
    return str(Path(os.fsdecode(label))) if isinstance(label, (str, os.PathLike)) and label else otherwise


def read_source(source, name: str, no_text: str = "") -> bytes:
    """Return all bytes of a file. A path may be that of a pipe, but not of a device, which may have no end.

    Parameters
    ----------
    source : path, bytes, or file object
    name : what messages call it
    no_text : name of its format where that is no text, so that it can't have been opened as text

    Raises
    ------
    ModelError : it can't be read
    """
    if isinstance(source, (bytes, bytearray, memoryview)):
        return bytes(source)
    try:
        if hasattr(source, "read"):
            data = source.read()
        else:
            with open(os.fsdecode(source), "rb") as stream:
                mode = os.fstat(stream.fileno()).st_mode
                if stat.S_ISCHR(mode) or stat.S_ISBLK(mode):
                    raise OSError("it is a device")
                data = stream.read()
    except FileNotFoundError:
        raise ModelError(f"{name}: no such file") from None
    except IsADirectoryError:
        raise ModelError(f"{name}: is a folder, not a file") from None
    except (OSError, ValueError, TypeError) as fault:
        raise ModelError(f"{name}: can't be read ({getattr(fault, 'strerror', None) or fault})") from fault
    if isinstance(data, str):
        if no_text:
            raise ModelError(f"{name}: {no_text} is no text; open the file with mode 'rb'")
        return data.encode("utf-8", "surrogateescape")
    if not isinstance(data, (bytes, bytearray)):
        raise ModelError(f"{name}: reading the file object gives {type(data).__name__}, not bytes or text")
    return bytes(data)


class LongFile:
    """The bytes of a regular file, read where they are asked for: it has a length and slices, as bytes have.

    It isn't mapped into memory: who makes a mapped file shorter ends the process that reads it.
    """

    def __init__(self, stream, name: str):
        self._stream, self._name, self._length = stream, name, os.fstat(stream.fileno()).st_size
        self._lock = threading.Lock()  # threads share the place that is read next

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, part: slice) -> bytes:
        begin, end, _ = part.indices(self._length)
        try:
            with self._lock:
                self._stream.seek(begin)
                data = self._stream.read(end - begin)
        except OSError as fault:
            raise ModelError(f"{self._name}: can't be read ({fault.strerror or fault})") from fault
        if len(data) != end - begin:
            raise ModelError(f"{self._name}: can't be read (it became shorter meanwhile)")
        return data


@contextlib.contextmanager
def opened_source(source, name: str, no_text: str = "", in_parts: bool = False) -> Iterator[bytes | LongFile]:
    """Give a block what `read_source` returns; where a file is to be read in parts, and its path is given, a `LongFile`
    if it has LONG bytes or more."""
    path = Path(os.fsdecode(source)) if in_parts and isinstance(source, (str, os.PathLike)) else None
    if path is None or not path.is_file() or path.stat().st_size < LONG:
        yield read_source(source, name, no_text)
        return
    with contextlib.ExitStack() as opened:
        try:
            stream = opened.enter_context(open(path, "rb"))
        except OSError as fault:
            raise ModelError(f"{name}: can't be read ({fault.strerror or fault})") from fault
        yield LongFile(stream, name)


def unpack(data: bytes, max_bytes: int) -> dict[str, bytes]:
    """Return the members of a zip file by name. What comes out of it is counted: a directory may say anything.

    Parameters
    ----------
    data : the file
    max_bytes : bytes that all members may have together

    Raises
    ------
    ValueError : members that are encrypted, packed by another method than deflate (whose decoder has no limit), or
        together too long
    zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError : a damaged file
    """
    import zipfile
    from io import BytesIO

    found, left = {}, max_bytes
    with zipfile.ZipFile(BytesIO(data)) as archive:
        for member in archive.infolist():
            with open_member(archive, member) as stream:
                found[member.filename] = stream.read(left + 1)
            left -= len(found[member.filename])
            if left < 0:
                raise ValueError(f"it unpacks to more than {max_bytes} bytes, the most for a file of its size")
    return found


def open_member(archive, member):
    """Return a stream of a member of a `ZipFile`; ValueError where it is encrypted, or packed otherwise than by
    deflate."""
    name = cut(member.filename, 80)
    if member.flag_bits & 1:
        raise ValueError(f"'{name}' in it is encrypted")
    if member.compress_type not in (0, 8):  # stored and deflated: the others unpack without a limit
        raise ValueError(f"'{name}' in it is packed by method {member.compress_type}, not by deflate")
    return archive.open(member)


def identity_of(path) -> tuple[int, int] | None:
    """Return what tells a file from all others, whatever name or link leads to it; None where there is none."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino


def are_same(path: str, other: str) -> bool:
    """Tell whether two paths are those of one file, by whatever names or links; also where there is none yet."""
    identity = identity_of(path)
    if identity is not None and identity == identity_of(other):
        return True
    return os.path.realpath(path) == os.path.realpath(other)


def refuse_inputs(outputs: Iterable[str], inputs: Mapping[tuple[int, int] | None, str]) -> None:
    """Refuse outputs that are files which are read, by whatever name or link: OutputError names both.

    inputs : paths of the files, by what `identity_of` says of them
    """
    for output in outputs:
        identity = identity_of(output)
        if identity is not None and identity in inputs:
            raise OutputError(f"can't write {output}: it is {inputs[identity]}, which is read; give another name")


def write_outputs(contents: Mapping[str, bytes], inputs: Mapping[tuple[int, int] | None, str]) -> None:
    """Write the files of a picture as `write_all` does, and make their folders; what `refuse_inputs` refuses isn't
    written."""
    refuse_inputs(contents, inputs)
    for output in contents:
        make_folder_of(output)
    write_all(contents)


def write_whole(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file beside its place and move it there, so that nobody ever sees half of it.

    A link keeps its name and gets a new target. A file that is protected against writing is refused. Devices and pipes
    can't be replaced: they are written as they are.

    Raises OutputError where it can't be written.
    """
    write_all({os.fspath(path): content})


def write_all(contents: Mapping[str, bytes]) -> None:
    """Write files by their paths, all of them or none, as `write_whole` does; OutputError names the one that fails.

    They are first hidden in the folders of their places, then moved there in turn.
    """
    hidden: list[tuple[str, str, str]] = []  # a file that waits, its place, and the path that leads there
    path = ""
    try:
        for path, content in contents.items():
            place = place_of(path)
            if os.path.isfile(place) and not (os.stat(place).st_mode & 0o222 and os.access(place, os.W_OK)):
                # for the superuser the mode counts, too
                raise PermissionError(13, "the file that is there is protected against writing")
            if os.path.exists(place) and not os.path.isfile(place):
                with open(place, "wb") as stream:  # a device or pipe
                    stream.write(content)
                continue
            hidden.append((os.path.join(os.path.dirname(place), f".raster-{os.urandom(8).hex()}"), place, path))
            with open(hidden[-1][0], "xb") as stream:
                stream.write(content)
        for name, place, path in hidden:  # noqa: B007  the error names it
            os.replace(name, place)
    except OSError as error:
        folder = os.path.dirname(os.path.realpath(path))
        reason = (error.strerror or str(error)) if os.path.isdir(folder) else f"there is no folder {folder}"
        raise OutputError(f"can't write {path}: {reason}") from error
    finally:  # also after an interrupt
        for name, *_ in hidden:
            if os.path.lexists(name):
                os.unlink(name)


def place_of(output: str) -> str:
    """Return where a file is written, its path without links; OutputError for a name that no file can have."""
    try:
        return os.path.realpath(output)
    except ValueError as error:
        raise OutputError(f"can't write {shown(output)}: {error}") from error


def checked_path(path: Any, what: str = "manifest") -> str:
    """Return the path of a file or folder as text; SceneError for what is none."""
    if not isinstance(path, (str, os.PathLike)) or not isinstance(os.fspath(path), str) or not os.fspath(path):
        raise SceneError(f"{what} must be a path; given {shown(path)}")
    return str(os.fspath(path))


def make_folder_of(output: str) -> None:
    """Make the folder that a file goes to; OutputError where that can't be done."""
    try:
        os.makedirs(os.path.dirname(place_of(output)), exist_ok=True)
    except OSError as fault:
        reason = fault.strerror or fault
        raise OutputError(f"can't write {output}: its folder can't be made: {reason}") from fault
