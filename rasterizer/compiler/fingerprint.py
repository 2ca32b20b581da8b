"""What decides which machine code the compiler makes, told without loading the compiler.

Sources, versions, settings and processor: code from the store is used only where all of them are the same. A store that
is shipped is right for other versions, too: its code calls nothing of theirs. Its processor is one of PROCESSOR_LEVELS,
which many share.
"""

import hashlib
import importlib.util
import os
import platform
import re
import sys
from contextlib import suppress
from pathlib import Path

import llvmlite
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
# Source: x86-64 psABI, "Micro-Architecture Levels". LLVM calls "generic" what is the least of any architecture.
_V2 = ("cx16", "popcnt", "sahf", "sse3", "ssse3", "sse4.1", "sse4.2")
_V3 = (*_V2, "avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")
PROCESSOR_LEVELS = dict(zip(reversed(choices.PROCESSOR_LEVELS), (_V3, _V2, ()), strict=True))

# What Linux calls otherwise than LLVM.
_OF_LINUX = {"abm": "lzcnt", "bmi1": "bmi", "lahf_lm": "sahf", "pni": "sse3", "sse4_1": "sse4.1", "sse4_2": "sse4.2"}

_PACKAGE = Path(__file__).resolve().parents[1]
_KERNEL_FOLDERS = "compiler", "geometry", "pipeline"
_OTHER_KERNELS = ("io/text_kernels.py",)
# Their changes change no machine code.
_WITHOUT_KERNELS = "fingerprint.py", "jobs.py", "machine_code.py", "store.py"


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


def describe_settings() -> str:
    """Say what the user asks of the compiler, but for the processor: the key of each kernel tells of that."""
    names = [name for name in CODE_SETTINGS if name not in ("CPU_FEATURES", "CPU_NAME")]
    settings = [(name, os.environ[f"NUMBA_{name}"]) for name in names if os.environ.get(f"NUMBA_{name}")]
    own = Path(".numba_config.yaml")  # numba reads it where the program is started
    return repr((settings, own.read_bytes() if own.is_file() else b""))


def describe_compiler() -> str:
    """Say which versions decide what code is made here."""
    return repr((numba_version(), llvmlite.__version__, np.__version__, sys.implementation.cache_tag))


def describe_layouts() -> str:
    """Say what code takes for granted of the machine and of Python's objects, whichever versions have made it."""
    return repr((platform.machine(), object.__basicsize__, tuple.__basicsize__))


def hash_sources(beside: str) -> str:
    """Return 16 digits that change with every source that kernels are made of, with settings, and with a text."""
    digest = hashlib.sha256(f"{describe_settings()}{beside}".encode())
    paths = [str(_PACKAGE / name) for name in _OTHER_KERNELS]
    for folder in _KERNEL_FOLDERS:
        entries = sorted(os.scandir(_PACKAGE / folder), key=lambda entry: entry.name)
        paths += [each.path for each in entries if each.name.endswith(".py") and each.name not in _WITHOUT_KERNELS]
    for path in paths:
        with open(path, "rb", buffering=0) as file:
            digest.update(file.read())
    return digest.hexdigest()[:16]


def read_processor() -> tuple[str, list[str]]:
    """Return a name of this processor, which no other has that LLVM would make other code for, and what it can do.

    Linux tells both for x86-64; elsewhere LLVM is loaded, and asked.
    """
    with suppress(OSError, LookupError):
        if sys.platform == "linux" and platform.machine() == "x86_64":
            with open("/proc/cpuinfo", "rb", buffering=0) as file:
                lines = file.read(2**14).decode(errors="replace").partition("\n\n")[0].splitlines()
            told = {key.strip(): value.split() for key, _, value in (line.partition(":") for line in lines)}
            names = [
                word for key in ("vendor_id", "cpu family", "model", "stepping", "model name") for word in told[key]
            ]
            return "-".join(names), sorted(_OF_LINUX.get(flag, flag) for flag in told["flags"])
    import llvmlite.binding as llvm

    return llvm.get_host_cpu_name(), sorted(name for name, is_there in llvm.get_host_cpu_features().items() if is_there)


def features_of(level: str) -> str:
    """Return what the processors of a level can do, as numba takes it."""
    return ",".join(f"+{feature}" for feature in PROCESSOR_LEVELS[level])


def usable_processors() -> tuple[str, ...]:
    """Return the processors whose code runs here: what code that is made here is made for, the processor's name and
    what it can do, and then the levels that it has reached.

    A processor that NUMBA_CPU_NAME names is the only one.
    """
    name, can_do = read_processor()
    asked, features = setting("CPU_NAME"), os.environ.get("NUMBA_CPU_FEATURES")
    host = f"{asked or name} {','.join(can_do) if features is None else features}"
    if asked:
        # With any other features than a level's the code would not run on all of its processors.
        return (asked if asked in PROCESSOR_LEVELS and features == features_of(asked) else host,)
    return (host, *(level for level, needed in PROCESSOR_LEVELS.items() if set(needed) <= set(can_do)))
