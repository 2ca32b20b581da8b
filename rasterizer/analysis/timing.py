"""How times are measured: calls take turns, and the machine is described.

Other work on a machine lengthens everything that is measured meanwhile. So calls that are compared take turns, round by
round, and what is trusted are their ratios.
"""

import os
import platform
from collections.abc import Callable, Hashable, Mapping
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..cores import n_core

MIN_ROUNDS = 3
Name = TypeVar("Name", bound=Hashable)


def take_turns(
    calls: Mapping[Name, Callable[[], Any]], seconds: float, max_rounds: int
) -> dict[Name, tuple[NDArray[np.float64], list]]:
    """Call functions in turns, round by round, so that a disturbance hits all of them alike.

    Parameters
    ----------
    calls : name -> function without arguments
    seconds : time limit for all of them together; at least MIN_ROUNDS rounds are made
    max_rounds : at most so many rounds

    Returns
    -------
    name -> (milliseconds (n_round,) float64, list of the `.stats` of what the calls returned, or of None)
    """
    times, stats = {name: [] for name in calls}, {name: [] for name in calls}  # type: ignore[var-annotated]
    start, n_round = perf_counter(), 0
    while n_round < MIN_ROUNDS or (n_round < max_rounds and perf_counter() - start < seconds):
        for name, call in calls.items():
            before = perf_counter()
            result = call()
            times[name].append(1000.0 * (perf_counter() - before))
            stats[name].append(getattr(result, "stats", None))
            del result  # its arrays are given back before the next call asks for some
        n_round += 1
    return {name: (np.array(times[name]), stats[name]) for name in calls}


def describe_machine() -> dict[str, Any]:
    """Describe the machine: processor, cores that this process may use, system, versions; and its load average, None
    where the system doesn't tell."""
    load = round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None
    return {"cpu": _cpu_name(), "cores": n_core(), "system": platform.platform(terse=True),
            "python": platform.python_version(), **{name: version(name) for name in ("numpy", "numba", "llvmlite")},
            "rasterizer": __version__, "load": load}  # fmt: skip


def _cpu_name() -> str:
    """The processor's model name."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
