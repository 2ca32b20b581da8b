"""Kernels that tests compile for themselves, and processes with a store of their own."""

import ctypes
import importlib.util
import os
import re
import subprocess
import sys
from typing import NamedTuple

import numpy as np

from helpers.raster import ROOT
from rasterizer.compiler import internals, kernels
from rasterizer.compiler.kernels import ArgumentTypes
from rasterizer.compiler.machine_code import LoadedCode
from rasterizer.compiler.store import FORMAT

# The kernel and the batch function of the package that take the least time to compile.
TINY = """
import numpy as np
from rasterizer.compiler import kernels
from rasterizer.compiler.kernels import STORE
from rasterizer.geometry.normals import list_corners

corners = np.array([2, 0, 2, 1], np.uint32)
assert list_corners(corners, np.zeros(5, np.uint32), np.zeros(4, np.uint32)) == 2
"""
LIGHT = """
from rasterizer.pipeline.reflection import lambert
assert kernels.batch_function(lambert, np.float64).address
"""


class Pair(NamedTuple):
    """A class of tuples that kernels take."""

    first: object
    second: object


class Other(NamedTuple):
    """Another one with the same fields."""

    first: object
    second: object


class EntryPoint:
    """The entry point of a kernel for arguments like `examples`, called without what a Kernel does around it."""

    def __init__(self, function, examples):
        self._types = ArgumentTypes(examples)
        self._loaded = LoadedCode(internals.compile_signature(function, self._types.signature))
        self._call = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.py_object, ctypes.c_void_p)(self._loaded.address)

    def __call__(self, *arguments):
        return self._call(arguments, self._types.address)


def kernels_with(monkeypatch, **variables):
    """Return the module of decorators once more, as a process in which these variables are set has it: with a store of
    its own. Kernels that it decorates are no others' kernels."""
    with monkeypatch.context() as patch:  # no longer: numba reads its settings again whenever it compiles
        for name, value in variables.items():
            patch.setenv(name, str(value))
        spec = importlib.util.spec_from_file_location("rasterizer.compiler.kernels_again", kernels.__file__)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    return module


def environment_with(**variables) -> dict:
    """Return an environment without any setting of kernels, and with variables; None takes one away."""
    own = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA_", "RASTER_"))}
    own |= {"PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tests'}"} | variables
    return {name: str(value) for name, value in own.items() if value is not None}


def start(program: str, cwd, *arguments, **variables) -> subprocess.Popen:
    """Start a program in a process of its own."""
    command = [sys.executable, "-c", program, *map(str, arguments)]
    pipe, environment = subprocess.PIPE, environment_with(**variables)
    return subprocess.Popen(command, env=environment, cwd=cwd, stdin=pipe, stdout=pipe, stderr=pipe, text=True)


def run(program: str, cwd, *arguments, **variables) -> str:
    """Run a program that complains of nothing, but may say that it compiles; return what it printed."""
    with start(program, cwd, *arguments, **variables) as process:
        out, complaint = process.communicate()
    assert process.returncode == 0, f"ended with {process.returncode}: {complaint[-1500:]}"
    assert re.fullmatch(r"(rasterizer: compiling .*\n)*", complaint), complaint
    return out.strip()


def split_file(content: bytes) -> tuple[bytes, bytes]:
    """Return the key and the code that a file of the store has."""
    rest = content[len(FORMAT) + 32 :]
    size = int.from_bytes(rest[:4], "little")
    return rest[4 : 4 + size], rest[4 + size :]


def bits_of(value):
    """Return a result as what can be compared to the bit, with the classes of its numbers."""
    if isinstance(value, tuple):
        return tuple(map(bits_of, value))
    return type(value), np.float64(value).tobytes() if isinstance(value, float) else value
