"""Try each use of what numba doesn't document, alone, in the version that is installed; and do without in others."""

import ast
import configparser
import gc
import importlib.util
import os
import re
import subprocess
import sys
import threading

import numba
import numpy as np
import pytest
from helpers.raster import ROOT

from rasterizer.compiler import internals, kernels, store


def halves(x):
    """What is compiled here."""
    return x.sum() * 0.5


def doubles(rows, n, params):
    """A batch function."""
    values = numba.carray(rows, (8,))
    for k in range(n):
        values[k] *= params[0]


def compiled(folder):
    """Compile `halves` anew."""
    return internals.keep_on_disk(numba.njit(halves), folder)


# ── which versions, and which modules ───────────────────────────────────────────────────────────────────


def test_the_versions_that_may_be_installed_are_those_that_were_seen():
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg")
    (line,) = re.findall(r"^numba.*$", setup["options"]["install_requires"], re.MULTILINE)
    (first, last) = internals.SEEN
    assert line == f"numba>={first[0]}.{first[1]},<{last[0]}.{last[1] + 1}"
    assert internals.IS_SEEN and internals.is_seen(numba.__version__)


@pytest.mark.parametrize("version", ["0.61.0", "0.61.2", "0.65.0rc1", "0.68.1", "0.68.9+4.gabc"])
def test_versions_that_were_seen(version):
    assert internals.is_seen(version)


@pytest.mark.parametrize("version", ["0.60.9", "0.69.0", "0.69.0dev0", "0.100.0", "1.61.0", "1.0", "0+unknown", ""])
def test_versions_that_were_not_seen(version):
    assert not internals.is_seen(version)


def test_no_other_module_touches_the_insides_of_numba_or_llvmlite():
    """Else a new version would have to be tried everywhere."""
    own = {"rasterizer/compiler/internals.py", "rasterizer/compiler/simd_ops.py"}
    strangers = {}
    for path in sorted((ROOT / "rasterizer").rglob("*.py")):
        name = path.relative_to(ROOT).as_posix()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            modules = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            modules += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if name not in own and any(re.match(r"numba\.core|numba\.np|llvmlite", module) for module in modules):
                strangers.setdefault(name, []).append(node.lineno)
    assert not strangers, f"import internals of the compiler: {strangers}"


# ── machine code on disk ────────────────────────────────────────────────────────────────────────────────


def test_machine_code_goes_to_a_file_and_comes_back(tmp_path):
    """Dispatcher._cache, NullCache, CompileResult._rebuild and ._reduce, serialize.dumps."""
    first, second = compiled(tmp_path), compiled(tmp_path)
    assert first(np.arange(5.0)) == 5.0 and sum(first.stats.cache_hits.values()) == 0
    assert len(list(tmp_path.glob(f"*{store.SUFFIX}"))) == 1
    assert second(np.arange(5.0)) == 5.0 and sum(second.stats.cache_hits.values()) == 1
    assert second.stats.cache_path == str(tmp_path)


def test_a_callback_goes_to_a_file_and_comes_back(tmp_path):
    """CFunc._cache, sigutils."""
    real = numba.types.CPointer(numba.float64)
    signature = numba.types.void(real, numba.types.intp, real)
    for n_hit in (0, 1):
        callback = internals.compile_callback(doubles, signature, tmp_path)
        values, factor = np.arange(8.0), np.array([2.0])
        pointer = callback.ctypes.argtypes[0]
        callback.ctypes(values.ctypes.data_as(pointer), 3, factor.ctypes.data_as(pointer))
        assert values.tolist() == [0, 2, 4, 3, 4, 5, 6, 7] and callback.cache_hits == n_hit


def test_the_processor_is_part_of_what_a_file_is_found_by(tmp_path):
    """codegen().magic_tuple()."""

    class OtherProcessor:
        def magic_tuple(self):
            return ("a triple", "another processor", "+features")

    files = internals.KernelFiles(halves, tmp_path)
    function = compiled(None)
    function(np.arange(5.0))
    (result,) = function.overloads.values()
    here = result.library.codegen
    assert len(here.magic_tuple()) == 3 and all(isinstance(part, str) for part in here.magic_tuple())
    assert files._key("()", here) != files._key("()", OtherProcessor())


@pytest.mark.parametrize("name", internals.CODE_SETTINGS)
def test_every_setting_that_changes_code_changes_what_describes_the_compiler(name, monkeypatch):
    before = internals.describe_compiler()
    monkeypatch.setattr(numba.config, name, "something else", raising=False)
    assert internals.describe_compiler() != before


def test_most_settings_are_known_to_this_version():
    """One that was renamed would no longer be seen to change."""
    unknown = [name for name in internals.CODE_SETTINGS if not hasattr(numba.config, name)]
    optional = {"ENABLE_SYS_MONITORING", "EXTEND_VARIABLE_LIFETIMES", "USING_SVML"}  # not in every version
    assert set(unknown) <= optional, f"{unknown} are no settings of numba {numba.__version__}"


# ── the compiler at work ────────────────────────────────────────────────────────────────────────────────


def test_the_compiler_is_watched_and_the_disk_is_not(tmp_path):
    """core.event."""
    seen = []
    with internals.watch_compiling(lambda: seen.append(1)):
        compiled(tmp_path)(np.arange(5.0))
        assert seen
        seen.clear()
        assert compiled(tmp_path)(np.arange(5.0)) == 5.0 and not seen
    compiled(None)(np.arange(5.0))
    assert not seen, "told after the block"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_fork_waits_until_nothing_is_compiled():
    """global_compiler_lock: a child that inherited it locked would wait for it for ever."""
    held, order = threading.Event(), []

    def hold():
        with internals.global_compiler_lock:
            held.set()
            held_long_enough.wait(0.3)
            order.append("released")

    held_long_enough = threading.Event()
    other = threading.Thread(target=hold)
    other.start()
    held.wait()
    child = os.fork()
    if child == 0:
        with internals.global_compiler_lock:
            os._exit(7)
    order.append("forked")
    _, status = os.waitpid(child, 0)
    other.join()
    assert order == ["released", "forked"] and os.waitstatus_to_exitcode(status) == 7


# ── what kernels are made of ────────────────────────────────────────────────────────────────────────────


@kernels.helper
def thrice(x):
    """A helper."""
    return 3.0 * x


@numba.njit
def through_helper(x):
    """A loop that calls a helper."""
    return thrice(x) + thrice(x + 1.0)


@numba.njit
def through_borrow(values, n):
    """Slice a borrowed array in a loop."""
    values, total = kernels.borrow(values), 0.0
    for k in range(n):
        part = values[k : k + 2]
        total += part[0] * part[1]
    return total, values


@numba.njit
def through_address(address, values, n, params):
    """Call a batch function."""
    kernels.call_batch_function(address, values.ctypes.data, n, params.ctypes.data)


def test_helpers_are_inlined_and_have_no_entry_for_python():
    """forceinline, no_cpython_wrapper, no_cfunc_wrapper."""
    assert through_helper(2.0) == 15.0
    (code,) = through_helper.inspect_llvm().values()
    assert not re.search(r"call [^\n]*thrice", code), "a helper is called, not inlined"
    alone = numba.njit(**internals.INLINED)(thrice.py_func)
    alone.compile((numba.float64,))
    (code,) = alone.inspect_llvm().values()
    assert "thrice" in code and "cpython" not in code and "cfunc" not in code


def test_a_borrowed_array_is_the_array_and_counts_no_references():
    """context.make_array, meminfo, parent."""
    values = np.arange(6.0)
    before = sys.getrefcount(values)
    total, again = through_borrow(values, 3)
    assert total == 0 * 1 + 1 * 2 + 2 * 3
    assert again.ctypes.data == values.ctypes.data and again.shape == values.shape
    del again
    gc.collect()
    assert sys.getrefcount(values) == before and values.tolist() == list(range(6))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_batch_function_is_called_by_its_address(dtype):
    values, factor = np.arange(8, dtype=dtype), np.array([2], dtype)
    through_address(kernels.batch_function(doubles, dtype).address, values, 3, factor)
    assert values.tolist() == [0, 2, 4, 3, 4, 5, 6, 7]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_batch_function_is_called_by_its_address_without_the_jit(monkeypatch, dtype):
    monkeypatch.setattr(kernels, "IS_COMPILING", False)
    function = kernels.batch_function.__wrapped__(doubles, dtype)
    assert isinstance(function, kernels.PlainBatchFunction)
    values, factor = np.arange(8, dtype=dtype), np.array([2], dtype)
    call, addresses = call_batch_function_without_the_jit(monkeypatch), np.array([function.address], np.int64)
    call(addresses[0], values.ctypes.data, np.uint64(3), factor.ctypes.data)
    assert values.tolist() == [0, 2, 4, 3, 4, 5, 6, 7]


def call_batch_function_without_the_jit(monkeypatch):
    """`call_batch_function` as it is where nothing is compiled."""
    monkeypatch.setattr(internals, "IS_COMPILING", False)
    spec = importlib.util.spec_from_file_location("rasterizer.compiler.kernels_again", kernels.__file__)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.call_batch_function


def test_a_fault_in_a_batch_function_is_raised_without_the_jit(monkeypatch):
    """A ctypes callback would only print it."""

    def fails(rows, n, params):
        raise ValueError("in the batch function")

    monkeypatch.setattr(kernels, "IS_COMPILING", False)
    function = kernels.batch_function.__wrapped__(fails, np.float32)
    call = call_batch_function_without_the_jit(monkeypatch)
    with pytest.raises(ValueError, match="in the batch function"):
        call(function.address, 0, 1, 0)


def plain_sum(a, b):
    """Add."""
    return a + b


def build_difference(typing_context, a, b):
    """Spell out something else than `plain_sum`, so that it is seen which of them runs."""

    def generate(_context, builder, _signature, arguments):
        return builder.sub(*arguments)

    return numba.int64(numba.int64, numba.int64), generate


@pytest.mark.parametrize(
    "is_compiling, is_seen, is_documented, expected",
    [(True, True, False, 3), (True, False, False, 7), (True, False, True, 3), (False, True, True, 7)],
)
def test_instructions_stand_in_for_a_plain_function_only_where_they_are_known(
    monkeypatch, is_compiling, is_seen, is_documented, expected
):
    monkeypatch.setattr(internals, "IS_COMPILING", is_compiling)
    monkeypatch.setattr(internals, "IS_SEEN", is_seen)
    chosen = internals.lowered_by(build_difference, is_documented)(plain_sum)
    if is_compiling:
        assert numba.njit(lambda a, b: chosen(a, b))(5, 2) == expected
    else:
        assert chosen(5, 2) == expected


# ── versions that were not seen ─────────────────────────────────────────────────────────────────────────

DRAWS = """
import hashlib
import numpy as np
import rasterizer as rz
from rasterizer.compiler import kernels

vertices = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
mesh = rz.Mesh(vertices, [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)], crease_angle=60)
scene = rz.Scene([mesh], camera=rz.Camera.framing(mesh))
digest = hashlib.sha256()
for shading in ("flat", "phong"):
    frame = rz.render(scene, (40, 30), shading=shading, outputs=("color", "depth", "face"))
    for values in (frame.color, frame.depth, frame.face):
        digest.update(values.tobytes())
"""


def told_by(program, tmp_path, **variables):
    """Run a program with a cache folder of its own; return what it printed, and what it complained of."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path / "kernels")} | variables
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout.strip(), done.stderr


@pytest.mark.slow
def test_a_version_that_was_not_seen_draws_the_same_and_keeps_nothing_on_disk(tmp_path):
    """Only what is documented is used there: the same pictures, compiled in every run, and one line that says so."""
    unseen = "import numba\nnumba.__version__ = '0.99.0'\n"
    tail = "print(digest.hexdigest(), kernels.CACHE_FOLDER, len(kernels.CACHE_REASONS))"
    told, complaint = told_by(unseen + DRAWS + tail, tmp_path)
    space = {}
    exec(DRAWS, space)
    assert told == f"{space['digest'].hexdigest()} None 1"
    assert complaint.count("\n") == 1 and "numba 0.99.0 is not among the versions" in complaint, complaint
    assert not (tmp_path / "kernels").exists()


def test_a_version_that_was_not_seen_is_told_by_the_program(tmp_path):
    """`warmup` can't keep anything, and says why."""
    program = (
        "import numba, sys\nnumba.__version__ = '0.60.0'\n"
        "from rasterizer.cli import main\nassert main(['warmup']) == 4\n"
    )
    _, complaint = told_by(program, tmp_path)
    assert "numba 0.60.0 is newer or older than the versions that were tried" in complaint, complaint
