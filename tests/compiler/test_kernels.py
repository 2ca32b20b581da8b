"""Kernels as the package calls them: from the store where it has them, else compiled and kept, else by numba; with the
same results, and with a word in the log where something went wrong."""

import hashlib
import sys
import time

import numpy as np
import pytest
from helpers.processes import at_once
from helpers.stores import LIGHT, TINY, Pair, kernels_with, run, split_file

from rasterizer import RasterizerError
from rasterizer.compiler import kernels, store
from rasterizer.geometry.normals import list_corners
from rasterizer.pipeline.reflection import lambert

COLUMN = ("array", "uint32", 1, "C")


def first_of(x):
    """What is compiled here."""
    return x[0] * 0.5


def measures(x):
    """What can be said of any array."""
    return x.size, x.itemsize, x.ndim


def doubles(batch, n, coefficients):
    """A batch function."""
    for k in range(n):
        batch[k] *= 2.0


# ---------------------------------------------------------------- calls


def test_one_kernel_takes_arguments_of_many_kinds_in_any_order(caplog):
    """Read-only arrays among them; two names of one integer are one signature."""
    caplog.set_level("INFO", "rasterizer")
    kernel, rng, values = kernels.kernel(measures), np.random.default_rng(1), np.arange(4.0)
    fixed = values.copy()
    fixed.flags.writeable = False
    many = [fixed, values, values[::2]]
    many += [np.arange(6.0).reshape(2, 3).T, np.array(3.0), np.zeros((2, 0)), *(np.arange(4).astype(c) for c in "lqf")]
    for _ in range(3):
        rng.shuffle(many)
        for each in many:
            assert kernel(each) == (each.size, each.itemsize, each.ndim), each.dtype
    assert caplog.messages == [] and len(kernel.signatures) == len(set(kernel.signatures)) == 7


def test_what_kernels_do_not_take_is_refused_before_and_after_a_call():
    kernel, given = kernels.kernel(first_of), np.arange(4.0, 9.0)
    for bad, kind in (
        (given.astype(">f8" if np.little_endian else "<f8"), TypeError),
        (np.zeros(41, np.uint8)[1:].view(float), TypeError),
        (np.array([1, "x"], object), TypeError),
        ([1.0, 2.0], TypeError),
        (2**63, OverflowError),
    ):
        for _ in range(2):
            with pytest.raises(kind, match="a kernel takes"):
                kernel(bad)
            assert kernel(given) == 2.0
    for arguments in ((), (given, 1)):
        with pytest.raises(TypeError):
            kernel(*arguments)
    with pytest.raises(TypeError, match="unexpected keyword"):
        kernel(x=given)


def allocates(n):
    """A kernel that numba has to call."""
    return np.ones(n).sum()


def first_item(pair):
    return pair.first


def test_a_kernel_that_needs_numba_is_called_by_it_and_that_is_told(caplog):
    from typing import NamedTuple

    class Hidden(NamedTuple):
        first: int

    caplog.set_level("INFO", "rasterizer")
    kernel = kernels.kernel(allocates)
    assert [kernel(3), kernel(4)] == [3.0, 4.0]
    (line,) = caplog.messages
    assert line.startswith("kernel test_kernels.allocates is left to numba: it allocates memory")
    caplog.clear()
    kernel = kernels.kernel(first_item)
    assert kernel(Pair(3, None)) == 3 and not caplog.messages
    assert kernel(Hidden(7)) == 7 and kernel(Pair(4, None)) == 4
    assert "left to numba: no class" in caplog.text and "Hidden" in caplog.text


# ---------------------------------------------------------------- without a store


def use(module) -> list:
    """Use a kernel and a batch function of the package as a new process would; return what is compiled for that."""
    told = []
    corners = np.array([2, 0, 2, 1], np.uint32)
    with module.noticing_compilation(lambda *notice: told.append(notice)):
        kernel = module.kernel(list_corners.py_func)
        assert kernel(corners, np.zeros(5, np.uint32), np.zeros(4, np.uint32)) == 2
        assert module.batch_function(lambert, np.float64).address
    return told


BOTH = [("list_corners", 0, 1), ("lambert", 0, 1)]


def test_without_a_store_numba_calls_kernels_with_the_same_results(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    without = kernels_with(monkeypatch, RASTER_STORE="off")
    assert not without.STORE.is_used and use(without) == [], "object code is compiled, and nobody needs it"
    assert without.kernel(first_of)(np.arange(5.0, 9.0)) == 2.5
    batch = np.arange(4.0)
    without.batch_function(doubles, np.float64)(batch.ctypes.data, 3, 0)
    assert batch.tolist() == [0, 2, 4, 3] and not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written_is_done_without(monkeypatch, tmp_path):
    place = tmp_path / "place"
    place.write_text("precious")
    for asked in (place, place / "below"):
        module = kernels_with(monkeypatch, RASTER_STORE=asked)
        assert module.STORE.own is None and len(module.STORE.reasons) == 1 and module.STORE.is_used
        with module.compiling_ahead(lambda: pytest.fail("asked what is needed, and there is no folder for it")):
            assert use(module) == BOTH
    assert place.read_text() == "precious"


def test_without_the_global_interpreter_lock_nothing_is_drawn(monkeypatch):
    """A free-threaded Python whose lock is on is like any other; where it is off, a line says how it is switched on."""
    monkeypatch.setattr(sys, "_is_gil_enabled", lambda: True, raising=False)
    assert kernels_with(monkeypatch).STORE.is_used
    monkeypatch.setattr(sys, "_is_gil_enabled", lambda: False)
    with pytest.raises(RasterizerError, match=r"PYTHON_GIL=1"):
        kernels_with(monkeypatch)


def test_with_the_jit_switched_off_kernels_are_plain_functions(monkeypatch):
    module = kernels_with(monkeypatch, NUMBA_DISABLE_JIT=1)
    assert not module.IS_COMPILING and not module.STORE.is_used
    with np.errstate(all="raise"):
        assert module.kernel(lambda a, b: a / b)(np.float64(1), np.float64(0)) == np.inf
    assert module.helper(first_of) is first_of
    say = module.by_type(lambda x: "single", lambda x: "double")
    assert [say(x) for x in (np.float32(1), np.zeros(2, "f4"), np.float64(1), 1.0)] == ["single"] * 2 + ["double"] * 2
    function = module.batch_function(doubles_plainly, np.float32)
    values, factor = np.arange(8, dtype="f4"), np.float32([2])
    assert isinstance(function, module.PlainBatchFunction)
    module.call_batch_function(np.int64(function.address), values.ctypes.data, np.uint64(3), factor.ctypes.data)
    function(values.ctypes.data, 1, factor.ctypes.data)
    assert values.tolist() == [0, 2, 4, 3, 4, 5, 6, 7]

    def fails(batch, n, coefficients):
        raise ValueError("in the batch function")

    with pytest.raises(ValueError, match="in the batch function"):  # a ctypes callback would only print it
        module.call_batch_function(module.batch_function(fails, np.float32).address, 0, 1, 0)


def doubles_plainly(batch, n, coefficients):
    values = np.ctypeslib.as_array(batch, (8,))
    for k in range(n):
        values[k] *= coefficients[0]


# ---------------------------------------------------------------- from the store


@pytest.fixture
def own(tmp_path, monkeypatch):
    """The module with a store of its own, and the files in it as they are when both were compiled."""
    tmp_path.chmod(0o700)
    monkeypatch.setenv("RASTER_STORE", str(tmp_path / "store"))  # for processes that it starts
    return kernels_with(monkeypatch, RASTER_STORE=tmp_path / "store")


def files_of(module) -> list:
    return sorted(module.STORE.own.glob(f"*{store.SUFFIX}"))


def again(monkeypatch, module):
    """The module as the next process has it, with the same store."""
    return kernels_with(monkeypatch, RASTER_STORE=module.STORE.own.parent)


def test_the_second_process_finds_what_the_first_has_left_and_needs_no_compiler(own, tmp_path):
    assert use(own) == BOTH
    assert {path.name.rpartition("-")[0] for path in files_of(own)} == {"normals.list_corners", "reflection.lambert"}
    told = run(TINY + LIGHT + "import sys; print('numba' in sys.modules)", tmp_path, RASTER_STORE=own.STORE.own.parent)
    assert told == "False", "numba is loaded"


def test_functions_from_outside_the_package_are_not_stored(own):
    """The folder is named after this package's sources: a user's function that changes would stay as it was."""
    own.kernel(first_of)(np.arange(5.0))
    assert own.batch_function(doubles, np.float64).address and not files_of(own)


def stored_under(key, code) -> bytes:
    """The content of a file whose checksum is right."""
    rest = len(key).to_bytes(4, "little") + key + code
    return store.FORMAT + hashlib.sha256(rest).digest() + rest


def change_code(change):
    """Change the code and make the checksum right again."""

    def rewrite(path):
        key, code = split_file(path.read_bytes())
        path.write_bytes(stored_under(key, change(code)))

    return rewrite


DAMAGES = {
    "cut off": lambda path: path.write_bytes(path.read_bytes()[:-7]),
    "right, but of a function that is nowhere": change_code(lambda code: code.replace(b"PyLong_From", b"PyLong_Fron")),
}


def test_kernels_are_compiled_again_where_theirs_are_damaged(own, monkeypatch, caplog):
    caplog.set_level("INFO", "rasterizer")
    assert use(own) == BOTH and use(again(monkeypatch, own)) == [] == caplog.messages
    corners, light = files_of(own)
    right = [path.read_bytes() for path in (corners, light)]
    for kind, damage in DAMAGES.items():
        damage(corners)
        caplog.clear()
        assert use(again(monkeypatch, own)) == BOTH[:1], f"{kind} is used"
        assert sum("compiled again" in line for line in caplog.messages) == 1, f"{kind}: {caplog.messages}"
        assert use(again(monkeypatch, own)) == [], f"{kind} stays"
    corners.write_bytes(right[1])
    light.write_bytes(right[0])
    assert use(again(monkeypatch, own)) == BOTH, "what was swapped is used"
    assert not list(own.STORE.own.glob(f"*{store.HALF_WRITTEN}"))


def test_threads_that_ask_at_once_get_the_same_batch_function(own):
    """Else one of them would be taken out of memory, while its address is in use."""
    told = []

    def ask(_):
        with own.noticing_compilation(lambda *notice: (told.append(notice), time.sleep(0.05))):
            return own.batch_function(doubles, np.float32).address

    assert len(set(at_once(ask, 4))) == 1 and told == [("doubles", 0, 1)]


# ---------------------------------------------------------------- what is compiled ahead


def test_what_is_missing_is_compiled_with_all_that_is_listed_once(own):
    """In other processes; it is told which kernel is begun, and the larger one goes first."""
    need, other = (list_corners.py_func, (COLUMN,) * 3), (lambert, ("batch function", "float64"))
    outside, is_listed = (doubles, other[1]), []
    assert own.missing_in(own.STORE, [other, need, outside, other]) == [other, need]
    with own.compiling_ahead(lambda: is_listed.append(1) or [other, need, outside]):
        (first, n_before, n_job), (second, n_done, _) = use(own)
        assert (first, second) == ("list_corners", "lambert") and 0 == n_before <= n_done <= 1 < n_job == 2
        assert own.kernel(first_of)(np.arange(4.0, 9.0)) == 2.0, "what is missing later is compiled where it is met"
    assert is_listed == [1] and own.missing_in(own.STORE, [need, other]) == []
    assert [path.name.rpartition("-")[0] for path in files_of(own)] == ["normals.list_corners", "reflection.lambert"]
