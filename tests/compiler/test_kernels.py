"""Kernels as the package calls them: from the store where it has them, else compiled and kept, else by numba; with the
same results, and with a word in the log where something went wrong."""

import errno
import os
import pickle
import sys
import threading
import time

import numpy as np
import pytest
from helpers.stores import LIGHT, TINY, EntryPoint, Pair, run, split_file

from rasterizer.cli.messages import NORMAL, QUIET, VERBOSE, Messages, compilation_shown
from rasterizer.compiler import internals, kernels, store
from rasterizer.compiler.store import Store
from rasterizer.geometry import creases
from rasterizer.pipeline.reflection import lambert

DAY = 24 * 3600
COMPILED = "import sys; print('numba' in sys.modules)"
IS_ROOT = hasattr(os, "geteuid") and os.geteuid() == 0
posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes are looked at on POSIX alone")


def halves(x):
    """What is compiled here."""
    return x.sum() * 0.5


def doubles(batch, n, coefficients):
    """A batch function."""
    for k in range(n):
        batch[k] *= 2.0


# ---------------------------------------------------------------- calls


def test_a_kernel_is_called_like_its_plain_function():
    kernel = kernels.kernel(halves)
    assert kernel(np.arange(5.0)) == 5.0 == kernel.py_func(np.arange(5.0))
    assert kernel.__name__ == "halves" and kernel.__doc__ == halves.__doc__ and kernel.py_func is halves


def test_one_kernel_takes_arguments_of_many_kinds_in_any_order(caplog):
    caplog.set_level("INFO", "rasterizer")
    kernel, rng = kernels.kernel(halves), np.random.default_rng(1)
    many = [np.arange(4).astype(dtype) for dtype in "bhilqBHILQfd?"]
    many += [np.arange(4.0)[::2], np.arange(6.0).reshape(2, 3).T, np.array(3.0), np.zeros((2, 0)), np.zeros((2, 0))[1]]
    for _ in range(3):
        rng.shuffle(many)
        for values in many:
            assert kernel(values) == values.sum() * 0.5, values.dtype
    assert caplog.messages == []


@kernels.helper
def parts_of(pair):
    """Arrays out of arrays, as a tuple: those who count references must agree on whose they are."""
    return Pair(pair.first[1:], pair.second), pair.first


def sum_of_parts(pair):
    """What a kernel does with them."""
    (first, second), third = parts_of(pair)
    return first.sum() + second.sum() + third.sum()


@pytest.mark.parametrize("is_stored", [True, False])
def test_arrays_that_helpers_return_are_given_back_as_often_as_they_were_taken(monkeypatch, is_stored):
    monkeypatch.setattr(kernels, "STORE", kernels.STORE._replace(is_used=is_stored))
    kernel, pair = kernels.kernel(sum_of_parts), Pair(np.arange(5.0), np.arange(3.0))
    assert kernel(pair) == 23.0
    counts = [sys.getrefcount(values) for values in pair]
    for _ in range(1000):
        kernel(pair)
    assert [sys.getrefcount(values) for values in pair] == counts
    other = kernels.kernel(sum_of_parts)  # the same helper, in the other way, in the same process
    monkeypatch.setattr(kernels, "STORE", kernels.STORE._replace(is_used=not is_stored))
    assert {other(pair) for _ in range(1000)} == {23.0}
    assert [sys.getrefcount(values) for values in pair] == counts


def test_subclasses_and_read_only_arrays_are_taken(tmp_path):
    kernel, values = kernels.kernel(halves), np.arange(5.0)
    values.tofile(tmp_path / "values")
    mapped = np.memmap(tmp_path / "values", np.float64, "r")
    fixed = np.arange(5.0)
    fixed.flags.writeable = False
    for _ in range(2):
        assert kernel(mapped) == kernel(fixed) == kernel(values.view(np.recarray)) == kernel(values) == 5.0


@pytest.mark.parametrize("values, kind", [
    (np.arange(5.0).astype(">f8" if np.little_endian else "<f8"), TypeError),
    (np.zeros(41, np.uint8)[1:].view(float), TypeError),
    (np.array([1, "x"], object), TypeError),
    ([1.0, 2.0], TypeError),
    (2**63, OverflowError),
])  # fmt: skip
def test_what_kernels_do_not_take_is_refused_before_and_after_a_call(values, kind):
    kernel = kernels.kernel(halves)
    for _ in range(2):
        with pytest.raises(kind, match="a kernel takes"):
            kernel(values)
        assert kernel(np.arange(5.0)) == 5.0


def test_a_wrong_number_of_arguments_is_refused():
    kernel = kernels.kernel(halves)
    assert kernel(np.arange(5.0)) == 5.0
    for arguments in ((), (np.arange(5.0), 1)):
        with pytest.raises(TypeError):
            kernel(*arguments)
    with pytest.raises(TypeError, match="unexpected keyword"):
        kernel(x=np.arange(5.0))


def allocates(n):
    """A kernel that numba has to call."""
    return np.ones(n).sum()


def first_of(pair):
    return pair.first


def test_a_kernel_that_needs_numba_is_called_by_it_and_that_is_told(caplog):
    caplog.set_level("INFO", "rasterizer")
    kernel = kernels.kernel(allocates)
    assert [kernel(3), kernel(np.int32(4)), kernel(5)] == [3.0, 4.0, 5.0]
    (line,) = caplog.messages
    assert line.startswith("kernel test_kernels.allocates is left to numba: it allocates memory")


def test_a_class_that_has_no_name_is_left_to_numba(caplog):
    from typing import NamedTuple

    class Hidden(NamedTuple):
        first: int

    caplog.set_level("INFO", "rasterizer")
    kernel = kernels.kernel(first_of)
    assert kernel(Pair(3, None)) == 3 and not caplog.messages
    assert kernel(Hidden(7)) == 7 and kernel(Pair(4, None)) == 4
    assert "left to numba: no class" in caplog.text and "Hidden" in caplog.text


def test_what_an_entry_point_does_not_know_is_left_to_numba(monkeypatch, caplog):
    caplog.set_level("INFO", "rasterizer")
    kernel = kernels.kernel(halves)
    monkeypatch.setattr(kernel, "_find_entry_point", lambda _signature: lambda _arguments, _table: NotImplemented)
    assert [kernel(np.arange(5.0)) for _ in range(3)] == [5.0] * 3
    (line,) = caplog.messages
    assert "left to numba: its entry point doesn't know" in line


def test_faults_of_a_kernels_source_are_raised_as_numba_tells_them():
    def adds_text(x):
        return x + "text"

    with pytest.raises(Exception, match="Cannot unify|No implementation|unsupported|Invalid use") as caught:
        kernels.kernel(adds_text)(1)
    assert type(caught.value).__module__.startswith("numba")


def test_batch_functions_are_made_once_for_each_dtype():
    function = kernels.batch_function(doubles, np.float64)
    assert function is kernels.batch_function(doubles, np.float64) is not kernels.batch_function(doubles, np.float32)
    batch = np.arange(4.0)
    function(batch.ctypes.data, 3, 0)
    assert batch.tolist() == [0, 2, 4, 3]


# ---------------------------------------------------------------- by numba


@pytest.fixture
def without_store(monkeypatch):
    """As RASTER_STORE=off has it."""
    monkeypatch.setattr(kernels, "STORE", Store(reasons=("RASTER_STORE is off",)))


def test_without_a_store_numba_calls_kernels_with_the_same_results(without_store, monkeypatch):
    monkeypatch.setattr(internals, "compile_signature", None)  # it would fail
    kernel = kernels.kernel(halves)
    assert kernel(np.arange(5.0)) == 5.0 == kernel(np.arange(5))
    function = kernels.BatchFunction(doubles, np.float64)
    batch = np.arange(4.0)
    function(batch.ctypes.data, 3, 0)
    assert batch.tolist() == [0, 2, 4, 3]


@pytest.mark.parametrize("value", ["off", "a folder"])
def test_nothing_is_stored_where_it_is_off(tmp_path, value):
    asked = "off" if value == "off" else tmp_path / "store"
    told = run(TINY + LIGHT + "print(STORE.is_used, STORE.is_kept, STORE.own is None)", tmp_path, RASTER_STORE=asked)
    assert told == ("False False True" if value == "off" else "True True False")
    assert len(list(tmp_path.rglob(f"*{store.SUFFIX}"))) == (0 if value == "off" else 2)


@pytest.mark.parametrize("variables", [{"NUMBA_BOUNDSCHECK": 1}, {"NUMBA_DISABLE_JIT": 1}])
def test_settings_that_kernels_of_the_store_cannot_keep_turn_it_off(tmp_path, variables):
    told = run(TINY + "print(STORE.is_used)", tmp_path, RASTER_STORE=tmp_path / "store", **variables)
    assert told == "False" and not (tmp_path / "store").exists()


# ---------------------------------------------------------------- from the store


def test_the_second_process_finds_what_the_first_has_left_and_needs_no_compiler(tmp_path):
    folder, program = tmp_path / "made" / "when needed", TINY + LIGHT + COMPILED
    assert run(program, tmp_path, RASTER_STORE=folder) == "True"
    titles = {path.name.rpartition("-")[0] for path in folder.rglob(f"*{store.SUFFIX}")}
    assert titles == {"creases.list_corners", "reflection.lambert"}
    assert run(program, tmp_path, RASTER_STORE=folder) == "False"
    assert run("import numba\nnumba.njit = None\n" + program, tmp_path, RASTER_STORE=folder) == "True"


def test_a_package_that_cannot_be_written_uses_the_users_caches(tmp_path):
    told = TINY + "print(STORE.own.parent)"
    home, cache = tmp_path / "home", tmp_path / "cache"
    assert run(told, tmp_path, HOME=home, XDG_CACHE_HOME="") == str(home / ".cache" / "rasterizer")
    assert run(told, tmp_path, XDG_CACHE_HOME=cache) == str(cache / "rasterizer")
    assert list((cache / "rasterizer").rglob(f"*{store.SUFFIX}"))


def unwritable(tmp_path, kind):
    """A place in which no folder can be made, or in which nothing can be written by anybody but root."""
    place = tmp_path / "place"
    if kind == "a read-only folder":
        place.mkdir(mode=0o500)
        return place
    place.write_text("precious")
    return place if kind == "a file" else place / "below"


@pytest.mark.parametrize("kind", ["a file", "below a file", "a read-only folder"])
def test_a_folder_that_cannot_be_written_is_done_without(tmp_path, kind):
    place = unwritable(tmp_path, kind)
    told = run(TINY + LIGHT + "print(STORE.own, len(STORE.reasons))", tmp_path, RASTER_STORE=place)
    if kind == "a read-only folder" and os.access(place, os.W_OK):
        assert told.startswith(str(place)) and told.endswith("0")  # root may write everywhere
    else:
        assert told == "None 1"
    if place.is_file():
        assert place.read_text() == "precious"


def test_nothing_writable_at_all(tmp_path):
    program = "import os, pwd\nos.environ.pop('HOME')\n"
    program += "pwd.getpwuid = {}.__getitem__\n"  # nobody has an entry
    (tmp_path / "file").write_text("")
    program += TINY + "print(STORE.own)"
    assert run(program, tmp_path, XDG_CACHE_HOME=tmp_path / "file") == "None"
    assert run(program, tmp_path, XDG_CACHE_HOME="relative") == "None"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_caller_keeps_a_cache_folder_of_his_own(tmp_path):
    """Neither the setting nor his functions may land where ours are, and ours not with his."""
    his, ours = tmp_path / "his", tmp_path / "ours"
    (tmp_path / "his_own.py").write_text("import numba\n\n@numba.njit(cache=True)\ndef twice(x):\n    return 2 * x\n")
    program = f"""
import sys
import numba
sys.path.insert(0, {str(tmp_path)!r})
numba.config.CACHE_DIR = {str(his)!r}
{TINY}{LIGHT}
assert numba.config.CACHE_DIR == {str(his)!r}
import his_own
assert his_own.twice(4) == 8
print(STORE.own.parent)
"""
    assert run(program, tmp_path, NUMBA_CACHE_DIR=ours) == str(ours)
    ends = ("nbi", store.SUFFIX[1:])
    made = {
        folder.name: {path.name.split("-")[0] for end in ends for path in folder.rglob(f"*.{end}")}
        for folder in (his, ours)
    }
    assert made["his"] == {"his_own.twice"}
    assert made["ours"] == {"creases.list_corners", "reflection.lambert"}


@pytest.mark.parametrize("value", [None, "", "somewhere"])
def test_importing_leaves_the_setting_as_it_was(tmp_path, value):
    variables = {} if value is None else {"NUMBA_CACHE_DIR": tmp_path / value if value else ""}
    program = "import numba\nbefore = numba.config.CACHE_DIR\n" + TINY + "assert numba.config.CACHE_DIR == before\n"
    run(program, tmp_path, XDG_CACHE_HOME=tmp_path / "caches", **variables)


def test_functions_from_outside_the_package_are_not_stored(tmp_path, monkeypatch):
    """The folder is named after this package's sources: a user's function that changes would stay as it was."""
    tmp_path.chmod(0o700)
    monkeypatch.setattr(kernels, "STORE", Store.into(tmp_path))
    kernels.kernel(halves)(np.arange(5.0))
    kernels.BatchFunction(doubles, np.float64)
    assert not list(tmp_path.rglob(f"*{store.SUFFIX}"))


def test_using_kernels_keeps_them_young(tmp_path):
    """Folders are removed by age: one that is used every day must not look as old as its first day."""
    folder = run(TINY + "print(STORE.own)", tmp_path, RASTER_STORE=tmp_path / "store")
    os.utime(folder, (0, 0))
    assert run(TINY + "print(STORE.own)", tmp_path, RASTER_STORE=tmp_path / "store") == folder
    age = (time.time() - os.stat(folder).st_mtime) / DAY
    assert age < 1, f"used a moment ago, and still {age:.0f} days old > 1"


# ---------------------------------------------------------------- damage


@pytest.fixture
def own_store(tmp_path, monkeypatch):
    """A store in which this file's functions are kept, too."""
    tmp_path.chmod(0o700)
    found = Store.into(tmp_path / "store")
    monkeypatch.setattr(kernels, "STORE", found)
    monkeypatch.setattr(kernels, "__name__", __name__)
    return found


def compiled_and_used(monkeypatch) -> int:
    """Use a kernel and a batch function as a new process would; return how many had to be compiled."""
    n_compiled, compile_signature = [], internals.compile_signature
    with monkeypatch.context() as patch:
        patch.setattr(internals, "compile_signature", lambda *job: n_compiled.append(1) or compile_signature(*job))
        kernel, function = kernels.kernel(halves), kernels.BatchFunction(doubles, np.float64)
        assert kernel(np.arange(5.0)) == 5.0
        batch = np.arange(4.0)
        function(batch.ctypes.data, 4, 0)
    assert batch.tolist() == [0, 2, 4, 6]
    return len(n_compiled)


def stored_under(key, code) -> bytes:
    """The content of a file whose checksum is right."""
    import hashlib

    rest = len(key).to_bytes(4, "little") + key + code
    return store.FORMAT + hashlib.sha256(rest).digest() + rest


def swap(paths):
    first, second = (path.read_bytes() for path in paths)
    paths[0].write_bytes(second)
    paths[1].write_bytes(first)


def change_each(change):
    """Change the content of every file."""

    def damage(paths):
        for path in paths:
            path.write_bytes(change(path.read_bytes()))

    return damage


def change_code(change):
    """Change the code and make the checksum right again."""

    def rewrite(content):
        key, code = split_file(content)
        return stored_under(key, change(code))

    return change_each(rewrite)


DAMAGES = {
    "cut off": change_each(lambda content: content[:-7]),
    "empty": change_each(lambda content: b""),
    "a bit flipped": change_each(lambda content: content[:-9] + bytes([content[-9] ^ 4]) + content[-8:]),
    "swapped": swap,
    "folders": lambda paths: [(path.unlink(), path.mkdir()) for path in paths],
    "right, but a pickle": change_code(lambda code: pickle.dumps(42)),
    "right, but no names": change_code(lambda code: b"\xff\xfe" + code),
    "right, but nothing": change_code(lambda code: b""),
    "right, but cut off": change_code(lambda code: code[: len(code) // 2]),
    "right, but of a function that is nowhere": change_code(lambda code: b"nowhere_at_all " + code),
    "right, but garbage": change_code(lambda code: np.random.default_rng(1).bytes(len(code))),
}
if os.name == "posix":
    DAMAGES |= {
        "pipes": lambda paths: [(path.unlink(), os.mkfifo(path)) for path in paths],
        "that others can write": lambda paths: [path.chmod(0o666) for path in paths],
        "links": lambda paths: [path.symlink_to(path.rename(path.with_suffix(".moved"))) for path in paths],
    }


@pytest.mark.parametrize("kind", DAMAGES)
def test_kernels_are_compiled_again_where_theirs_are_damaged(own_store, monkeypatch, caplog, kind):
    assert compiled_and_used(monkeypatch) == 2 and compiled_and_used(monkeypatch) == 0
    paths = sorted(own_store.own.glob(f"*{store.SUFFIX}"))
    assert len(paths) == 2
    DAMAGES[kind](paths)
    caplog.set_level("INFO", "rasterizer")
    assert compiled_and_used(monkeypatch) == 2
    n_told = sum("compiled again" in line for line in caplog.messages)
    assert n_told == (0 if kind == "swapped" else 2), caplog.messages
    caplog.clear()
    assert compiled_and_used(monkeypatch) == (2 if kind == "folders" else 0)
    assert not list(own_store.own.glob(f"*{store.HALF_WRITTEN}"))


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS])
def test_a_disk_that_is_full_costs_no_picture(own_store, monkeypatch, caplog, code):
    def fail(*_given, **_options):
        raise OSError(code, os.strerror(code))

    caplog.set_level("INFO", "rasterizer")
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", fail)
        assert compiled_and_used(patch) == 2
    assert sum("can't be kept" in line for line in caplog.messages) == 2
    assert compiled_and_used(monkeypatch) == 2 and compiled_and_used(monkeypatch) == 0


@posix
@pytest.mark.parametrize("most", [0, 100, 3_000])
def test_a_limit_on_the_size_of_files_breaks_nothing(tmp_path, most):
    """The limit of the system stands for a full disk: here a kernel doesn't fit, a batch function may."""
    program = f"import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, ({most}, {most}))\n" + TINY + LIGHT
    for _ in range(2):
        run(program, tmp_path, RASTER_STORE=tmp_path / "kernels")
    (folder,) = (tmp_path / "kernels").iterdir()
    assert not list(folder.glob(f"*{store.HALF_WRITTEN}"))
    assert all(path.stat().st_size <= most for path in folder.iterdir())


@pytest.mark.parametrize("level", [QUIET, NORMAL, VERBOSE])
def test_damage_is_told_in_a_line_where_details_are_asked_for(own_store, monkeypatch, capsys, level):
    compiled_and_used(monkeypatch)
    for path in own_store.own.glob(f"*{store.SUFFIX}"):
        path.write_bytes(path.read_bytes()[:-7])
    monkeypatch.setattr(kernels, "STORE", own_store._replace(reasons=("/shared: others can write to it",)))
    with compilation_shown(Messages(level)):
        compiled_and_used(monkeypatch)
    lines = capsys.readouterr().err.splitlines()
    assert sum("is damaged and is compiled again" in line for line in lines) == (2 if level == VERBOSE else 0)
    assert sum("the store of kernels: /shared: others" in line for line in lines) == (1 if level == VERBOSE else 0)
    assert sum("compiling kernels for the first time" in line for line in lines) == (0 if level == QUIET else 2)


def test_code_for_another_processor_is_compiled_again(own_store, monkeypatch):
    assert compiled_and_used(monkeypatch) == 2
    monkeypatch.setattr(kernels, "STORE", own_store._replace(processors=("another",)))
    assert compiled_and_used(monkeypatch) == 2


def test_threads_that_ask_at_once_get_the_same_batch_function(own_store, monkeypatch):
    """Else one of them would be taken out of memory, while its address is in use."""
    made, function = [], lambda batch, n, coefficients: None
    begun = threading.Barrier(4)

    class Slow(kernels.BatchFunction):
        def __init__(self, *given):
            time.sleep(0.05)
            self.address = len(made)
            made.append(self)

    monkeypatch.setattr(kernels, "BatchFunction", Slow)
    found = []

    def ask():
        begun.wait()
        found.append(kernels.batch_function(function, np.float32).address)

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [0] * 4 and len(made) == 1


# ---------------------------------------------------------------- what is noted and compiled ahead


def test_needs_are_noted_while_python_runs_the_kernels():
    kernel = kernels.kernel(halves)
    with kernels.noting_needs() as needs:
        assert kernel(np.arange(5.0)) == 5.0 and type(kernel(np.arange(5))) is float
        function = kernels.batch_function(doubles, np.float32)
    assert list(needs) == [
        (halves, (("array", "float64", 1, "C"),)),
        (halves, (("array", "int64", 1, "C"),)),
        (doubles, ("batch function", "float32")),
    ]
    assert isinstance(function, kernels.PlainBatchFunction) and not kernel._entries
    assert kernel(np.arange(5.0)) == 5.0 and len(kernel._entries) == 1


def test_what_is_missing_is_compiled_with_the_other_needs_once(own_store, monkeypatch):
    seen = []
    need = (halves, (("array", "float64", 1, "C"),)), (doubles, ("batch function", "float64"))

    def compile_into(target, jobs):
        seen.append((target, jobs))
        for function, signature in jobs:
            target.keep(
                kernels.title_of(function), signature, internals.compile_signature(function, signature).as_bytes()
            )

    monkeypatch.setattr(kernels, "compile_into", compile_into)
    kernel, is_listed = kernels.kernel(halves), []
    with kernels.compiling_ahead(lambda: is_listed.append(1) or {need[1]: True}):
        assert kernel(np.arange(5.0)) == 5.0
        kernels.BatchFunction(doubles, np.float64)
        assert kernels.kernel(halves)(np.arange(5)) == 5.0
    assert seen == [(own_store, [need[0], need[1]])] and is_listed == [1]
    assert kernels.missing_in(own_store, dict.fromkeys(need)) == []


def test_nothing_is_compiled_ahead_without_a_folder_for_it(monkeypatch):
    monkeypatch.setattr(kernels, "STORE", Store(is_used=True))
    with kernels.compiling_ahead(lambda: pytest.fail("asked what is needed")):
        assert kernels.kernel(halves)(np.arange(5.0)) == 5.0


def test_a_notice_tells_what_is_compiled_here(own_store, monkeypatch):
    told = []
    with kernels.noticing_compilation(lambda *notice: told.append(notice)):
        compiled_and_used(monkeypatch)
        compiled_and_used(monkeypatch)
    compiled_and_used(monkeypatch)
    assert told == [("doubles", 0, 1), ("halves", 0, 1)]


def test_entry_points_of_one_signature_are_shared():
    """Two names of one dtype are two tables for one machine code."""
    kernel = kernels.kernel(halves)
    for code in ("l", "q"):
        assert kernel(np.arange(5).astype(code)) == 5.0
    assert len(kernel._loaded) == 1 and 1 <= len(kernel._entries) <= 2
    assert EntryPoint(halves, (np.arange(5.0),))(np.arange(5.0)) == 5.0 and sys.modules["numba"]


def test_a_kernel_that_is_needed_while_its_needs_are_listed_stays_in_memory(own_store, monkeypatch):
    """What lists the needs calls the same kernel, which is loaded by then; the caller gets that one, and no other."""
    made = []
    load = kernels.LoadedCode
    monkeypatch.setattr(kernels, "LoadedCode", lambda *given: made.append(load(*given)) or made[-1])
    corners = np.array([2, 0, 2, 1], np.uint32)

    def call():
        return list_corners(corners, np.zeros(5, np.uint32), np.zeros(4, np.uint32))

    list_corners = kernels.Kernel(creases.list_corners.py_func)
    with kernels.compiling_ahead(lambda: {} if call() else {}):
        assert call() == 2
    kept = [loaded for _, loaded in list_corners._loaded.values()]
    (entry_point, _), *_ = list_corners._loaded.values()
    assert kept == [made[0]] and all(entry is entry_point for entry, _ in list_corners._entries)
    tables = {table.address for _, table in list_corners._known.values()}
    assert {address for _, address in list_corners._entries} == tables, "as the tables that entry points read"
    assert [call() for _ in range(9)] == [2] * 9


def test_a_batch_function_that_is_needed_while_its_needs_are_listed_stays_in_memory(own_store, monkeypatch):
    """As a kernel: both ask for one function, and its address is that of code in memory."""
    monkeypatch.setattr(kernels, "_batch_functions", {})
    inner = []

    def list_needs():
        inner.append(kernels.batch_function(lambert, np.float64))
        return {}

    with kernels.compiling_ahead(list_needs):
        outer = kernels.batch_function(lambert, np.float64)
    assert inner == [outer] and inner[0].address == outer.address
