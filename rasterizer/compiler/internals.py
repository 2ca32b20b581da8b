"""What the package uses of numba beyond what numba's manual promises; loaded only where something is compiled.

Each of these may change in any version without notice. All were seen to work in the versions fingerprint.SEEN, which
are those that setup.cfg admits; tests/compiler/test_internals.py tries each one alone in the version that is installed.

    name in numba (0.61 to 0.68)                       used for
    -------------------------------------------------- -----------------------------------------------------------
    core.compiler, compiler_machinery, typed_passes    a pipeline of our own (its interface is in the manual)
    core.codegen.JITCodeLibrary: _optimize_functions,  object code without loading it, and helpers that are
      _optimize_final_module, _finalize_final_module,    optimised once, inside the kernel that they are inlined
      _finalize_dynamic_globals, _final_module,          into
      _codegen._tm, _codegen._module_pass_manager
    flags.no_compile, .forceinline,                    the same
      target context .insert_user_function
    core.compiler_machinery.PassManager._runPass,      less to compile (short_passes.py): passes that
      core.analysis, core.ir, core.lowering.Lower,       aren't needed are left out, what was inferred isn't
      core.datamodel.models.TupleModel, np.arrayobj,     inferred again, and instructions that the optimiser
      core.cgutils, untyped_passes.DeadBranchPrune,      takes out again aren't written
      core.analysis.dead_branch_prune,
      typed_passes.NativeLowering,
      cpython.builtins.do_minmax, state.typingctx
    core.codegen: CodeLibrary.finalize,                the same: each helper is linked into a kernel once
      _get_module_for_linking, _linking_libraries
    njit(forceinline=, no_cpython_wrapper=,            inlining, and less to compile
      no_cfunc_wrapper=)
    njit(_nrt=)                                        kernels that don't allocate and count no references
    context.declare_function, .call_conv, .make_array, entry points (entry_points.py)
      .make_tuple, core.cgutils
    registry.cpu_target                                the type of what is compiled when a kernel asks for it
    core.errors.NumbaError                             what is left to numba
    core.cgutils; typed pointers of llvmlite.ir        vector instructions (pipeline/intrinsics.py)
"""

import contextvars
import gc
import importlib
import os
import sys
from collections.abc import Callable
from ctypes import CDLL, pythonapi

import numba
import numba.extending
import numpy as np
from llvmlite import ir
from llvmlite.binding import Linkage
from numba import types
from numba.core import cgutils, codegen, compiler_machinery
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.errors import NumbaError
from numba.core.registry import cpu_target

from . import entry_points
from .machine_code import ENTRY
from .short_passes import ShortLowering, ShortPassManager, Struct

_DOCUMENTED = {"nogil": True, "error_model": "numpy"}
_OPTIONS = _DOCUMENTED | {"_nrt": False}
_SYSTEM = CDLL(None if os.name == "posix" else "ucrtbase")  # the process, with the C library in it
# Options of njit for what Python never calls through numba: no wrappers are made.
_UNWRAPPED = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
# A call that isn't inlined pushes every field of the structures that are passed.
_INLINED = {"error_model": "numpy", "forceinline": True}


class NotStandalone(Exception):
    """A kernel whose machine code can't be used without numba, and why."""


# ---------------------------------------------------------------- what numba compiles when it meets a name in a kernel


# Whether what is compiled in this context counts references to arrays. What calls and what is called must agree: a
# caller that counts gives up what a function returns, which one that doesn't count never took.
_counts = contextvars.ContextVar("counts", default=True)


def is_counting() -> bool:
    """Tell whether what is compiled now counts references, as all does but object code of kernels."""
    return _counts.get()


def compile_helper(function: Callable):
    """Return a function that kernels call, as numba has it; inlined wherever it is called."""
    if is_counting():
        return numba.njit(**_DOCUMENTED)(function)
    return numba.njit(forceinline=True, pipeline_class=HelperCompiler, **_UNWRAPPED, **_OPTIONS)(function)


def compile_by_type(function: Callable, choose: Callable):
    """Return a function that is compiled differently for different types: `choose` gets the types and returns the plain
    function that is called in its place (kernels.by_type)."""

    def chosen(*arguments):  # one for callers that count references, and one for others
        return function(*arguments)

    options = _INLINED
    if not is_counting():
        options = _OPTIONS | _UNWRAPPED | {"forceinline": True, "pipeline_class": HelperCompiler}
    numba.extending.overload(chosen, jit_options=options, strict=False)(choose)
    return chosen


def compile_intrinsic(function: Callable, name: str):
    """Return a function whose instructions are written by another one (kernels.spelled_out)."""
    module = importlib.import_module(f"{function.__module__.rpartition('.')[0]}.intrinsics")
    return numba.extending.intrinsic(getattr(module, name))


def compile_by_numba(function: Callable):
    """Return a kernel as `numba.njit` makes it."""
    return numba.njit(**_DOCUMENTED)(function)


def compile_callback(function: Callable, dtype):
    """Return a batch function as `numba.cfunc` makes it."""
    return numba.cfunc(_batch_signature(dtype), error_model="numpy", nopython=True)(function)


def type_of(thing):
    """Return numba's type of something that it has compiled."""
    context = cpu_target.typing_context
    context.refresh()
    return context.resolve_value_type(thing)


# ---------------------------------------------------------------- arrays and calls by address


@numba.extending.intrinsic
def build_array(typing_context, pointer, shape):
    """Build `kernels.as_array`: the struct of an array that nobody owns, at a pointer."""
    numba_type = types.Array(pointer.dtype, len(shape), "C")

    def generate(context, builder, signature, arguments):
        array = context.make_array(numba_type)(context, builder)
        lengths = cgutils.unpack_tuple(builder, arguments[1])
        step = ir.Constant(ir.IntType(64), context.get_abi_sizeof(context.get_data_type(numba_type.dtype)))
        steps, n_item = [], ir.Constant(ir.IntType(64), 1)
        for length in reversed(lengths):
            steps.append(builder.mul(n_item, step))
            n_item = builder.mul(n_item, length)
        array.data, array.itemsize, array.nitems = arguments[0], step, n_item
        array.shape = cgutils.pack_array(builder, lengths)
        array.strides = cgutils.pack_array(builder, steps[::-1])
        array.meminfo, array.parent = (cgutils.get_null_value(x.type) for x in (array.meminfo, array.parent))
        return array._getvalue()

    return numba_type(pointer, shape), generate


@numba.extending.intrinsic
def build_call(typing_context, address, batch, n, coefficients):
    """Build `kernels.call_batch_function`: a call through a pointer to a function."""
    signature = types.void(types.intp, types.intp, types.intp, types.intp)

    def generate(context, builder, _signature, arguments):
        whole = ir.IntType(64)
        function_type = ir.FunctionType(ir.VoidType(), [whole, whole, whole])
        builder.call(builder.inttoptr(arguments[0], function_type.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    return signature, generate


# ---------------------------------------------------------------- object code


def compile_signature(function: Callable, signature: tuple) -> bytes:
    """Compile a kernel for a signature (kernels.py), or a batch function for ("batch function", dtype).

    Returns
    -------
    bytes, as machine_code.py loads them

    Raises NotStandalone where the code would need numba's runtime: it allocates, raises or prints; and where a class of
    the signature is not found by its name.
    """
    if signature[:1] == ("batch function",):
        argument_types, pipeline = _batch_signature(signature[1]).args, BatchFunctionCompiler
    else:
        argument_types, pipeline = tuple(map(type_of_part, signature)), KernelCompiler
    dispatcher = numba.njit(pipeline_class=pipeline, **_UNWRAPPED, **_OPTIONS)(function)
    was_collecting = gc.isenabled()
    token = _counts.set(False)
    gc.disable()  # the compiler makes a million objects that all live on: looking for garbage takes time
    try:
        dispatcher.compile(argument_types)
        (result,) = dispatcher.overloads.values()
    except entry_points.Unsupported as reason:
        raise NotStandalone(str(reason)) from None
    except NumbaError as fault:  # where it is no fault of the runtime's absence, numba tells it to the caller
        raise NotStandalone("it allocates memory, or numba can't compile it") from fault
    except Exception as fault:  # numba's own faults are of any class; then numba.njit compiles it
        raise NotStandalone(f"numba {numba.__version__}: {type(fault).__name__}: {fault}") from fault
    finally:
        _counts.reset(token)
        if was_collecting:
            gc.enable()
    library = result.library
    strange = [name for name in library.undefined if not _is_of_system(name)]
    if strange:
        raise NotStandalone(f"it calls {', '.join(strange)}")
    return " ".join(library.undefined).encode() + b"\n" + library.object_code


def _is_of_system(name: str) -> bool:
    """Tell whether a function is one of the C library, its mathematics, or Python's C interface; numba's own aren't."""
    return hasattr(pythonapi if name.startswith("Py") else _SYSTEM, name)


def _batch_signature(dtype):
    pointer = types.CPointer(numba.from_dtype(np.dtype(dtype)))
    return types.void(pointer, types.intp, pointer)


def class_of(name: str) -> type:
    """Return the class of a tuple from its name in a signature.

    Raises ImportError or AttributeError where there is none.
    """
    module, _, path = name.partition(":")
    __import__(module)
    found = sys.modules[module]
    for step in path.split("."):
        found = getattr(found, step)
    return found


def type_of_part(part):
    """Return numba's type of a part of a signature."""
    if part == "none":
        return types.none
    if isinstance(part, str):
        return numba.from_dtype(np.dtype(part))
    if part[0] == "array":
        _, dtype, n_axis, layout = part
        return types.Array(numba.from_dtype(np.dtype(dtype)), n_axis, layout)
    _, name, items = part
    try:
        found = class_of(name) if name else None
    except (ImportError, AttributeError) as fault:
        raise NotStandalone(f"no class {name} ({fault})") from fault
    argument_types = tuple(map(type_of_part, items))
    numba_type = types.BaseTuple.from_types(argument_types, found)
    return Struct(argument_types, found) if type(numba_type) is types.NamedTuple else numba_type


class HelperLibrary(codegen.JITCodeLibrary):
    """The instructions of a helper, as they are written: they are optimised where they are inlined."""

    def finalize(self):
        """Leave what it calls to the kernel, where each helper is needed once."""
        self._finalized = True

    def _optimize_functions(self, ll_module):
        ll_module.data_layout = self._codegen._data_layout

    def _get_module_for_linking(self):
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.external:
                function.linkage = Linkage.linkonce_odr
        return self._final_module


class KernelLibrary(HelperLibrary):
    """The instructions of a kernel, which become an object file; nothing is loaded into this process.

    object_code : the content of the file · undefined : the functions that it calls and doesn't hold
    """

    object_code, undefined = b"", ()

    def finalize(self):
        """Put all that it calls into one module, and make object code of it."""
        reached = {}  # in the order in which they are met
        waiting = [*self._linking_libraries]
        while waiting:
            library = waiting.pop(0)
            if library not in reached:
                reached[library] = True
                waiting += library._linking_libraries if isinstance(library, HelperLibrary) else ()
        self._linking_libraries = [*reached]
        codegen.JITCodeLibrary.finalize(self)

    def _optimize_final_module(self):
        # Nothing but the entry point is called from elsewhere.
        for function in self._final_module.functions:
            if not function.is_declaration and function.name != ENTRY:
                function.linkage = Linkage.internal
        # Numba's cheap run before this one is for counting references, which kernels don't.
        made = self._codegen._module_pass_manager()
        if isinstance(made, tuple):
            manager, builder = made
            manager.run(self._final_module, builder)
        else:  # before numba 0.62
            made.run(self._final_module)

    def _finalize_final_module(self):
        self._finalize_dynamic_globals()
        self._finalized = True
        functions = self._final_module.functions
        names = {f.name for f in functions if f.is_declaration and not f.name.startswith("llvm.")}
        self.undefined = tuple(sorted(names))
        self.object_code = self._codegen._tm.emit_object(self._final_module)


_register = compiler_machinery.register_pass(mutates_CFG=False, analysis_only=False)


@_register
class _BeginHelper(compiler_machinery.LoweringPass):
    """Before instructions are written: say into what."""

    _name, library = "rasterizer_begin_helper", HelperLibrary

    def __init__(self):
        super().__init__()

    def run_pass(self, state):
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True  # no entry for Python
        return True


@_register
class _BeginKernel(_BeginHelper):
    _name, library = "rasterizer_begin_kernel", KernelLibrary


@_register
class _FinishHelper(compiler_machinery.LoweringPass):
    """After instructions were written: make the function known to kernels that call it."""

    _name = "rasterizer_finish_helper"

    def __init__(self):
        super().__init__()

    def run_pass(self, state):
        lowered, context = state["cr"], state.targetctx
        self.add_entry_point(context, state.library, lowered.fndesc)
        state.library._ensure_finalized()
        token = object().__reduce__  # numba wants a built-in function; it is never called
        context.insert_user_function(token, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=token)
        return True

    def add_entry_point(self, context, library, fndesc):
        """Helpers have none."""


@_register
class _FinishKernel(_FinishHelper):
    _name = "rasterizer_finish_kernel"
    build = staticmethod(entry_points.build_entry_point)

    def add_entry_point(self, context, library, fndesc):
        module = library.create_ir_module("entry")
        self.build(context, module, fndesc)
        library.add_ir_module(module)


@_register
class _FinishBatchFunction(_FinishKernel):
    _name = "rasterizer_finish_batch_function"
    build = staticmethod(entry_points.build_batch_entry_point)


class HelperCompiler(CompilerBase):
    """Numba's pipeline, but for where the instructions go."""

    begin, finish = _BeginHelper, _FinishHelper

    def define_pipelines(self):
        """Return the one pipeline."""
        pipeline = ShortPassManager(DefaultPassBuilder.define_nopython_pipeline(self.state))
        lowering = [step for step, _ in pipeline.passes].index(ShortLowering)
        pipeline.passes.insert(lowering, (self.begin, "choose where instructions go"))
        pipeline.add_pass_after(self.finish, ShortLowering)
        pipeline.finalize()
        return [pipeline]


class KernelCompiler(HelperCompiler):
    """For kernels, with an entry point."""

    begin, finish = _BeginKernel, _FinishKernel


class BatchFunctionCompiler(HelperCompiler):
    """For batch functions, with theirs."""

    begin, finish = _BeginKernel, _FinishBatchFunction
