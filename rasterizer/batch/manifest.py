"""The manifest of a batch: a file of JSON lines, one a picture, in the order of the tasks.

While pictures are drawn, lines are added to FILE.partial, as they come. At the end they are put in order into FILE, and
FILE.partial goes away. So a batch that was interrupted, however that happened, keeps what it knew; when it goes on, a
picture that is left out has the line that one of both files has for it.
"""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

from ..errors import OutputError, SceneError, cut
from ..io.files import are_same, checked_path, make_folder_of, write_whole

FIRST = b'{"index":'  # what a manifest begins with


class Manifest:
    """Write the manifest of a batch; what is no manifest is never replaced by one.

    Parameters
    ----------
    path : of the file
    is_resumed : whether lines of pictures that are left out are kept; else the file is made anew
    """

    def __init__(self, path: str | os.PathLike[str], is_resumed: bool) -> None:
        self.path = os.fspath(path)
        self._partial = f"{self.path}.partial"
        self._is_resumed = is_resumed
        self._known: dict[str, dict[str, Any]] = {}  # lines of before, by the first file of each
        self._places: dict[int, tuple[int, int]] = {}  # where each line is in the partial file, and how long
        self._stream: Any = None

    def open(self) -> None:
        """Read what is known from before; raises OutputError where the file can't be written, or is no manifest."""
        make_folder_of(self.path)
        for path in (self.path, self._partial):
            if os.path.isdir(path) or not _may_be_replaced(path):
                raise OutputError(f"can't write {path}: something else is there, no manifest")
        for path in (self.path, self._partial) if self._is_resumed else ():
            for line in _lines_of(path):
                self._known[next(iter(line["files"].values()))] = line
        try:
            self._stream = open(self._partial, "ab+")  # noqa: SIM115
            _lock(self._stream)
            if not self._is_resumed:
                self._stream.truncate(0)
            self._stream.write(b"\n" if self._stream.seek(0, os.SEEK_END) else b"")  # the last line may be torn
        except OSError as fault:
            raise OutputError(f"can't write {self._partial}: {fault.strerror or fault}") from fault

    def is_one_of(self, path: str) -> bool:
        """Tell whether a path is that of one of its files."""
        return are_same(path, self.path) or are_same(path, self._partial)

    def relative(self, files: dict[str, str]) -> dict[str, str]:
        """Return paths as the manifest has them: as seen from its folder, with slashes."""
        return {name: as_seen_from(self.path, path) for name, path in files.items()}

    def keep(self, index: int, files: dict[str, str]) -> bool:
        """Take over the line of a picture that is left out; False where there is none of these files. Which arrays they
        hold is known to the line alone where a scene file says it."""
        paths = list(self.relative(files).values())
        line = self._known.get(paths[0])
        if line is None or {*line["files"].values()} != {*paths}:
            return False
        self._add(line | {"index": index})
        return True

    def add(self, index: int, files: dict[str, str], said: dict[str, Any], category: Any = None) -> None:
        """Add the line of a picture that was drawn."""
        named = zip(said["objects"], categories_of(said, category), strict=True)
        objects = [{"name": each["name"], "category": name} | each for each, name in named]
        self._add({"index": index, "files": self.relative(files)} | said | {"objects": objects})

    def _add(self, line: dict[str, Any]) -> None:
        text = json.dumps(line, separators=(",", ":"), default=_plain).encode() + b"\n"
        try:
            self._places[line["index"]] = self._stream.seek(0, os.SEEK_END), len(text)
            self._stream.write(text)
            self._stream.flush()
        except OSError as fault:
            raise OutputError(f"can't write {self._partial}: {fault.strerror or fault}") from fault

    def finish(self) -> None:
        """Put the lines in order, if there are any; raises OutputError."""
        found = []
        for _, (start, length) in sorted(self._places.items()):
            self._stream.seek(start)
            found.append(self._stream.read(length))
        if found:
            write_whole(self.path, b"".join(found))
        self.close()
        with suppress(FileNotFoundError):
            os.unlink(self._partial)

    def close(self) -> None:
        """Close the partial file, which stays."""
        if self._stream is not None:
            self._stream.close()


def _lock(stream: Any) -> None:
    """Keep a file for this batch until it is closed; OSError where another one has it. Systems without such locks have
    none."""
    with suppress(ImportError):
        import fcntl

        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise OSError("another batch is writing it") from None


def _may_be_replaced(path: str) -> bool:
    """Tell whether a path is that of a manifest, be it torn or empty; of a device or a pipe; or of nothing."""
    try:
        if not os.path.isfile(path):
            return True
        with open(path, "rb") as stream:
            found = stream.read(len(FIRST))
    except OSError as fault:
        raise OutputError(f"can't write {path}: {fault.strerror or fault}") from fault
    return FIRST.startswith(found)


def as_seen_from(file: str, path: str | os.PathLike[str]) -> str:
    """Return a path as one is written in a file: relative to its folder, with slashes; whole where that can't be."""
    try:
        path = os.path.relpath(path, os.path.dirname(os.path.abspath(file)))
    except ValueError:  # on another drive
        path = os.path.abspath(path)
    return os.fspath(path).replace(os.sep, "/")


def read_manifest(path: str | os.PathLike[str]) -> list[dict[str, Any]]:
    """Return the lines of a manifest, in their order; SceneError where it is none."""
    path = checked_path(path)
    try:
        with open(path, "rb") as stream:
            lines = [json.loads(line) for line in stream]
    except (OSError, ValueError) as fault:
        raise SceneError(f"{cut(path)} is no manifest: {getattr(fault, 'strerror', None) or cut(fault)}") from fault
    if not lines or not all(map(_is_line, lines)):
        raise SceneError(
            f"{cut(path)} is no manifest: lines must be JSON objects as render_many(manifest=) writes them"
        )
    return lines


def depth_scale(files: dict[str, str], scale: Any) -> Any:
    """Return what a manifest says of the depth: scene units of 1 in its file, where that is PNG.

    Parameters
    ----------
    files : paths by the names of arrays
    scale : that is asked for; None = the default; "auto" is known to who draws alone
    """
    from ..io.array_files import DEFAULT_SCALE

    if not files.get("depth", "").lower().endswith(".png"):
        return None
    return DEFAULT_SCALE if scale is None else scale if scale == "auto" else float(scale)


def categories_of(line: dict[str, Any], category: str | Mapping[str, str] | None = None) -> list[str]:
    """Return the category of each object of a line: the one given, text or by the mesh's name; else the one that the
    line has; else a file of one mesh is a category by its own name, and each of several meshes by the mesh's."""
    stem = "model" if line["model"] is None else os.path.splitext(os.path.basename(line["model"]))[0]
    is_one = len(line["objects"]) == 1 and line["model"] is not None
    found = []
    for k, each in enumerate(line["objects"]):
        own = stem if is_one else each["name"] or f"{stem}-{k}"
        given = category.get(each["name"]) if isinstance(category, Mapping) else category
        found.append(given or each.get("category") or own)
    return found


def _lines_of(path: str) -> Iterator[dict[str, Any]]:
    """Yield the lines that a file has, but for what is torn; none where there is no file."""
    try:
        with open(path, "rb") as stream:
            for text in stream:
                try:
                    line = json.loads(text)
                except ValueError:
                    continue
                if _is_line(line):
                    yield line
    except FileNotFoundError:
        return
    except OSError as fault:
        raise OutputError(f"can't read {path}: {fault.strerror or fault}") from fault


def _plain(value: Any) -> Any:
    """Return what JSON can say of a value that isn't Python's own."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


def _is_line(line: object) -> bool:
    return isinstance(line, dict) and isinstance(line.get("files"), dict) and bool(line["files"])
