"""What decides which machine code the compiler makes, told without loading the compiler.

Sources, versions, settings and processor: code from the store is used only where all of them are the same. The
processor may also be one of PROCESSOR_LEVELS, which many share: so a store can be shipped.
"""

import hashlib
import importlib.util
import os
import re
import sys
from pathlib import Path

import llvmlite
import llvmlite.binding as llvm
import numpy as np

from .. import choices

SEEN = (0, 61), (0, 68)  # the first and the last version of numba; each brings one version of llvmlite, 0.44 to 0.50

# Settings of numba that change the code that it makes; each is an environment variable, NUMBA_...
CODE_SETTINGS = (
    "BOUNDSCHECK", "CPU_FEATURES", "CPU_NAME", "DEBUGINFO", "DEBUG_NRT", "DISABLE_INTEL_SVML",
    "ENABLE_AVX", "ENABLE_PROFILING", "ENABLE_SYS_MONITORING", "EXTEND_VARIABLE_LIFETIMES", "FUNCTION_CACHE_SIZE",
    "LLVM_REFPRUNE_FLAGS", "LLVM_REFPRUNE_PASS", "LOOP_VECTORIZE", "NRT_STATS", "OPT", "SLP_VECTORIZE", "USING_SVML",
)  # fmt: skip

# Processors that code can be made for so that it runs on many: name and what they must be able to do.
# Source: x86-64 psABI, "Micro-Architecture Levels".
_V2 = ("cx16", "popcnt", "sahf", "sse3", "ssse3", "sse4.1", "sse4.2")
_V3 = (*_V2, "avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")
_V4 = (*_V3, "avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl")
PROCESSOR_LEVELS = dict(zip(reversed(choices.PROCESSOR_LEVELS), (_V4, _V3, _V2), strict=True))

_PACKAGE = Path(__file__).resolve().parents[1]
_KERNEL_FOLDERS = "compiler", "geometry", "pipeline"
_OTHER_KERNELS = ("io/obj_numbers.py",)
# Their changes change no machine code.
_WITHOUT_KERNELS = "fingerprint.py", "jobs.py", "store.py"


def numba_version() -> str:
    """Return the version of numba that is installed, without importing it; "" where there is none."""
    if "numba" in sys.modules:
        return sys.modules["numba"].__version__
    spec = importlib.util.find_spec("numba")
    if spec is None or spec.origin is None:
        return ""
    try:
        text = (Path(spec.origin).parent / "_version.py").read_text(encoding="utf-8")
    except OSError:
        text = ""
    found = re.search(r'"version":\s*"([^"]+)"', text)
    if found:
        return found[1]
    from importlib.metadata import version

    return version("numba")


def is_seen(version: str) -> bool:
    """Tell whether a version of numba, such as "0.68.1", is one that this package was tried with."""
    numbers = re.match(r"(\d+)\.(\d+)", version)
    return numbers is not None and SEEN[0] <= (int(numbers[1]), int(numbers[2])) <= SEEN[1]


def setting(name: str) -> str:
    """Return a setting of numba as the environment has it, "" where it is not set or 0."""
    value = os.environ.get(f"NUMBA_{name}", "").strip()
    return "" if value == "0" else value


def describe_compiler() -> str:
    """Say what decides, beside sources and processor, what code is made."""
    of_processor = "CPU_FEATURES", "CPU_NAME"  # the key of each kernel tells of them
    versions = numba_version(), llvmlite.__version__, np.__version__, sys.implementation.cache_tag
    settings = [(name, os.environ[f"NUMBA_{name}"]) for name in CODE_SETTINGS if os.environ.get(f"NUMBA_{name}")]
    settings = [setting for setting in settings if setting[0] not in of_processor]
    own = Path(".numba_config.yaml")  # numba reads it where the program is started
    return repr((versions, settings, own.read_bytes() if own.is_file() else b""))


def hash_sources() -> str:
    """Return 16 digits that change with every source that kernels are made of, and with the compiler."""
    digest = hashlib.sha256(describe_compiler().encode())
    paths = [str(_PACKAGE / name) for name in _OTHER_KERNELS]
    for folder in _KERNEL_FOLDERS:
        entries = sorted(os.scandir(_PACKAGE / folder), key=lambda entry: entry.name)
        paths += [each.path for each in entries if each.name.endswith(".py") and each.name not in _WITHOUT_KERNELS]
    for path in paths:
        with open(path, "rb", buffering=0) as file:
            digest.update(file.read())
    return digest.hexdigest()[:16]


def host_processor() -> str:
    """Return what code that is made here is made for: the processor's name and what it can do."""
    name = setting("CPU_NAME") or llvm.get_host_cpu_name()
    features = os.environ.get("NUMBA_CPU_FEATURES")
    if name in PROCESSOR_LEVELS and features == features_of(name):
        return name  # with any other features the code would not run on all of them
    return f"{name} {llvm.get_host_cpu_features().flatten() if features is None else features}"


def features_of(level: str) -> str:
    """Return what the processors of a level can do, as numba takes it."""
    return ",".join(f"+{feature}" for feature in PROCESSOR_LEVELS[level])


def usable_processors() -> tuple[str, ...]:
    """Return the processors whose code runs here: this one first, then the levels that it has reached.

    A processor that NUMBA_CPU_NAME names is the only one.
    """
    host = host_processor()
    if setting("CPU_NAME"):
        return (host,)
    features = llvm.get_host_cpu_features()
    levels = [name for name, needed in PROCESSOR_LEVELS.items() if all(features.get(need) for need in needed)]
    return (host, *(level for level in levels if level != host))
