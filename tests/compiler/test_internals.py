"""Try each use of what numba doesn't document, alone, in the version that is installed; and do without in others."""

import ast
import gc
import os
import re
import threading

import numba
import numpy as np
import pytest
from helpers.raster import ROOT
from helpers.stores import TINY, EntryPoint, Pair, run, start

from rasterizer.compiler import internals, kernels
from rasterizer.compiler.object_file import read_names

ARRAY = ("array", "float64", 1, "C")


def halves(x):
    """What is compiled here."""
    return x.sum() * 0.5


# ---------------------------------------------------------------- which modules


def test_no_other_module_touches_the_compiler():
    """Else a new version would have to be tried everywhere, and it would be loaded where it isn't needed."""
    own = {
        "rasterizer/compiler/internals.py",
        "rasterizer/compiler/intrinsics.py",
        "rasterizer/compiler/texel_intrinsics.py",
        "rasterizer/compiler/vectors.py",
        "rasterizer/compiler/entry_points.py",
        "rasterizer/compiler/short_passes.py",
    }
    strangers = {}
    for path in sorted((ROOT / "rasterizer").rglob("*.py")):
        name = path.relative_to(ROOT).as_posix()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            modules = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            modules += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if name not in own and any(re.match(r"numba|llvmlite\.ir", module) for module in modules):
                strangers.setdefault(name, []).append(node.lineno)
    assert not strangers, f"import the compiler: {strangers}"


def test_all_the_names_of_numba_that_are_used_are_listed():
    text = internals.__doc__
    files = "internals.py", "entry_points.py", "short_passes.py"
    source = "".join((ROOT / "rasterizer/compiler" / name).read_text() for name in files)
    used = set(re.findall(r"^\s*from numba\.core(?:\.\w+)? import (.*)$", source, re.MULTILINE))
    names = {name.strip() for line in used for name in line.split(",")}
    missing = {name for name in names - {"CompilerBase", "DefaultPassBuilder"} if name not in text}
    assert names and not missing, f"{missing} are not in the table"


# ---------------------------------------------------------------- object code


def test_object_code_defines_an_entry_and_needs_what_it_says():
    code = internals.compile_kernel(halves, (ARRAY,))
    defined, needed = read_names(code.content)
    assert "entry" in defined and needed - {"_GLOBAL_OFFSET_TABLE_"} <= {*code.needs, "memset", "memcpy"}
    assert all(name.startswith("Py") for name in code.needs), code.needs
    code = internals.compile_batch_function(doubles, "float32")
    assert "entry" in read_names(code.content)[0] and code.needs == ()


def doubles(batch, n, coefficients):
    """A batch function."""
    for k in range(n):
        batch[k] *= coefficients[0]


def test_compiling_loads_nothing_and_makes_no_entry_for_python():
    """KernelLibrary, no_cpython_wrapper, no_cfunc_wrapper."""
    defined, _ = read_names(internals.compile_kernel(halves, (ARRAY,)).content)
    assert not [name for name in defined if "cpython" in name or "cfunc" in name], defined


def allocates(n):
    return np.zeros(n).sum()


def prints(n):
    print(n)


def gives_complex(n):
    return 1j * n


def gives_pair(n):
    return Pair(n, n)


def gives_array(n, values=None):
    return values


def gives_none_or_number(n):
    if n > 3:
        return None
    return n


@pytest.mark.parametrize("function, reason", [
    (allocates, "it allocates memory"),
    (prints, "it calls numba_gil_ensure"),
    (gives_complex, "a kernel that returns complex128"),
    (gives_pair, "a kernel that returns Pair"),
    (gives_none_or_number, "a kernel that returns OptionalType"),
])  # fmt: skip
def test_what_needs_numba_is_left_to_it_and_says_why(function, reason):
    with pytest.raises(internals.NotStandalone, match=reason):
        internals.compile_kernel(function, ("int64",))


def test_arrays_are_no_results():
    with pytest.raises(internals.NotStandalone, match="a kernel that returns array"):
        internals.compile_kernel(gives_array, ("int64", ARRAY))


@pytest.mark.parametrize("name", ["nowhere.at_all:Thing", "collections:Nothing", "collections:x.<locals>.Thing"])
def test_a_class_that_is_not_found_is_left_to_numba(name):
    with pytest.raises(internals.NotStandalone, match="no class"):
        internals.compile_kernel(gives_array, ("int64", ("tuple", name, ())))


@pytest.mark.parametrize("is_collecting", [True, False])
def test_garbage_is_collected_after_compiling_as_before(is_collecting):
    was_collecting = gc.isenabled()
    try:
        (gc.enable if is_collecting else gc.disable)()
        internals.compile_kernel(halves, (ARRAY,))
        with pytest.raises(internals.NotStandalone):
            internals.compile_kernel(allocates, ("int64",))
        assert gc.isenabled() == is_collecting
    finally:
        (gc.enable if was_collecting else gc.disable)()


def test_numba_knows_every_part_of_a_signature():
    pair = ("tuple", f"{Pair.__module__}:Pair", ("float32", ("tuple", "", ("none", "bool"))))
    found = internals.type_of_part(pair)
    assert found.instance_class is Pair and found.types[0] == numba.float32
    assert found.types[1] == numba.types.Tuple((numba.none, numba.boolean))
    assert internals.type_of_part(("array", "uint8", 3, "A")) == numba.types.Array(numba.uint8, 3, "A")


# ---------------------------------------------------------------- what kernels call


@kernels.helper
def thrice(x):
    """A helper."""
    return 3.0 * x


def through_helper(values):
    """A loop that calls a helper."""
    return thrice(values[0]) + thrice(values[1])


def through_kernel(values):
    """A kernel that calls another."""
    return called_kernel(values, 2.0) + called_kernel(values, 3.0)


@kernels.kernel
def called_kernel(values, factor):
    return values[0] * factor


def choose_by_type(x):
    return say_float if isinstance(x, numba.types.Float) else say_other


def say_float(x):
    return 1


def say_other(x):
    return 2


@kernels.choice(choose_by_type)
def say_kind(x):
    """Tell floats from others."""
    return 1 if isinstance(x, float) else 2


def through_choice(values, n):
    return say_kind(values[0]), say_kind(n)


def test_helpers_are_inlined():
    """forceinline: HelperLibrary, insert_user_function."""
    values = np.array([2.0, 3.0])
    assert EntryPoint(through_helper, (values,))(values) == 15.0 == through_helper(values)
    defined, needed = read_names(internals.compile_kernel(through_helper, (ARRAY,)).content)
    called = [name for name in defined | needed if "thrice" in name and "NumbaEnv" not in name]
    assert not called, "a helper is called, not inlined"


def test_a_kernel_calls_another():
    values = np.array([2.0, 3.0])
    assert EntryPoint(through_kernel, (values,))(values) == 10.0 == through_kernel(values)


def test_a_choice_is_made_by_types():
    assert EntryPoint(through_choice, (np.zeros(1), 1))(np.zeros(1), 1) == (1, 2) == through_choice([0.0], 1)


def test_helpers_are_known_to_kernels_that_numba_calls():
    assert internals.compile_by_numba(through_helper)(np.array([2.0, 3.0])) == 15.0


def divides(a, b):
    return a / b


def test_dividing_by_zero_is_silent_both_ways():
    """error_model="numpy"."""
    for divide in (EntryPoint(divides, (1.0, 2.0)), internals.compile_by_numba(divides), kernels.kernel(divides)):
        assert divide(1.0, 0.0) == np.inf and np.isnan(divide(0.0, 0.0))


# ---------------------------------------------------------------- forks


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
@pytest.mark.parametrize("lock", [internals.global_compiler_lock, kernels._turn], ids=["numba's", "ours"])
def test_a_fork_waits_until_nothing_is_compiled(lock):
    """A child that inherited a lock locked would wait for it for ever."""
    held, order = threading.Event(), []

    def hold():
        with lock:
            held.set()
            held_long_enough.wait(0.3)
            order.append("released")

    held_long_enough = threading.Event()
    other = threading.Thread(target=hold)
    other.start()
    held.wait()
    child = os.fork()
    if child == 0:
        with lock:
            os._exit(7)
    order.append("forked")
    _, status = os.waitpid(child, 0)
    other.join()
    assert order == ["released", "forked"] and os.waitstatus_to_exitcode(status) == 7


# ---------------------------------------------------------------- versions that were not seen

UNSEEN = "import numba\nnumba.__version__ = '0.99.0'\n"


def told_by(program, tmp_path, **variables) -> str:
    """Run a program with a version that was not seen; return what it printed. One line complains."""
    with start(UNSEEN + program, tmp_path, **variables) as process:
        out, complaint = process.communicate()
    assert process.returncode == 0, complaint[-1500:]
    assert complaint.count("\n") == 1 and "numba 0.99.0 is not among the versions" in complaint, complaint
    return out.strip()


def test_a_version_that_was_not_seen_calls_kernels_itself_and_keeps_nothing(tmp_path):
    program = TINY + "print(STORE.is_used, STORE.own, STORE.reasons)"
    told = told_by(program, tmp_path, RASTER_STORE=tmp_path / "kernels")
    assert told == "False None ('numba 0.99.0 is newer or older than the versions that were tried',)"
    assert not (tmp_path / "kernels").exists()


@pytest.mark.slow
def test_a_version_that_was_not_seen_draws_the_same(tmp_path):
    """Only what is documented is used there, also by vector instructions and batch functions."""
    told = run(DRAWS, tmp_path, RASTER_STORE=kernels.STORE.own.parent)
    assert len(told) == 64 and told_by(DRAWS, tmp_path) == told


DRAWS = """
import hashlib
from helpers.small_scenes import draw

digest = hashlib.sha256()
for shading in ("flat", "phong"):
    for name, values in sorted(draw("many lights", shading).items()):
        digest.update(values.tobytes())
print(digest.hexdigest())
"""


def test_a_version_that_was_not_seen_is_told_by_the_program(tmp_path):
    """`warmup` can't keep anything, and says why."""
    program = (
        "import numba, sys\nnumba.__version__ = '0.60.0'\nfrom rasterizer.cli import main\nsys.exit(main(['warmup']))"
    )
    with start(program, tmp_path, RASTER_STORE=tmp_path / "kernels") as process:
        out, complaint = process.communicate()
    assert process.returncode == 4 and out == ""
    assert "numba 0.60.0 is newer or older than the versions that were tried" in complaint, complaint
