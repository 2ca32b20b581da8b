"""`raster warmup`: compile the kernels of all pictures that were recorded."""

import os
from pathlib import Path
from time import perf_counter

from ..choices import PROCESSOR_LEVELS
from ..errors import OutputError
from .flags import add_messages
from .messages import compilation_shown

_EXAMPLES = """\
examples:
  raster warmup
  raster warmup --into kernels --cpu x86-64-v3    a store for other machines
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster warmup [options]"
    parser.description = "Compile the kernels of all shading methods and keep them on disk."
    parser.epilog = _EXAMPLES
    parser.add_argument(
        "--into",
        metavar="FOLDER",
        help="make a store that can be shipped: it is found where FOLDER is the installed package's folder `kernels` "
        "(default: the user's own store, which raster doctor names)",
    )
    parser.add_argument(
        "--cpu", choices=PROCESSOR_LEVELS, help="the processors that the code is for (default: this machine's)"
    )
    add_messages(parser)


def run(_request, messages, *, into, cpu) -> tuple[list, int]:
    """Compile all kernels, on all cores, and put them into the store.

    Raises OutputError where there is no folder for them, and says why. Nothing else fails.
    """
    from ..compiler import fingerprint, kernels
    from ..engine.recorded_kernels import list_all_kernels

    start = perf_counter()
    if cpu is not None:  # processes that compile inherit it
        features = fingerprint.features_of(cpu)
        os.environ.update(NUMBA_CPU_NAME=cpu, NUMBA_CPU_FEATURES=features)
    store = kernels.STORE if into is None else _store_in(into)
    if store.own is None:
        reasons = "; ".join(store.reasons) or "there is no folder for them"
        raise OutputError(f"compiled kernels can't be kept: {reasons}; RASTER_STORE names another folder")
    if missing := kernels.missing_in(store, list_all_kernels()):
        _fill(store, missing, messages)
    text = "ready" if missing else "were ready already"
    messages.notice(f"kernels {text} after {perf_counter() - start:.1f} s, in {store.own}")
    return [], 0


def _fill(store, missing, messages) -> None:
    """Compile kernels that the store lacks."""
    from ..compiler import kernels

    with compilation_shown(messages):
        kernels.compile_into(store, missing)
    if failed := kernels.missing_in(store, missing):
        names = ", ".join(sorted({function.__name__ for function, _ in failed}))
        raise OutputError(f"not all kernels could be compiled into {store.own}: {names} (-v says why)")


def _store_in(folder):
    from ..compiler.store import Store

    try:
        return Store.into(Path(folder))
    except OSError as fault:
        raise OutputError(f"no store can be made in {folder}: {fault.strerror or fault}") from fault
