"""What all who draw for a batch have in common: units of work, and what becomes of them.

A crew takes a unit by `submit`, and `wait` returns the next one that has an outcome, in any order:

    Done(value)       what the unit's function returned
    Died(how)         the process that worked on it ended; who else was at work isn't concerned
    Failed(error)     it could not be sent there or back, or the function raised
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple, Protocol


class SharedObject:
    """Something large that many units need: it goes to each process once.

    Parameters
    ----------
    value : what is shared; not changed any more
    key : text that tells it from all others of the crew
    """

    def __init__(self, value: Any, key: str) -> None:
        self.value: Any = value
        self.key: str = key
        self.sent: Any = None  # what a crew keeps of it: its bytes, or its name on the machines it was sent to


class Unit:
    """A piece of work: a function of a module, and what it is called with.

    Parameters
    ----------
    function : called as function(argument, value of `shared`, kept); `kept` is a dict that stays with a process
    argument : what can be pickled
    shared : SharedObject, or None
    """

    def __init__(self, function: Callable[..., Any], argument: Any, shared: SharedObject | None = None) -> None:
        self.function: Callable[..., Any] = function
        self.argument: Any = argument
        self.shared: SharedObject | None = shared
        self.note: Any = None  # the caller's own; it isn't sent
        self.n_lost = 0  # how often it had to be sent again because of others


class Done(NamedTuple):
    """The function has returned."""

    value: Any


class Died(NamedTuple):
    """The process that worked on it has ended."""

    how: str


class Failed(NamedTuple):
    """Nothing came back, but for an error."""

    error: Exception


class Crew(Protocol):
    """Who draws."""

    is_here: bool  # whether it sees the files that this process sees

    @property
    def n_slot(self) -> int:
        """How many units it should have at a time."""

    @property
    def n_running(self) -> int:
        """How many it has."""

    def submit(self, unit: Unit) -> None:
        """Give it a unit."""

    def wait(self) -> tuple[Unit, Done | Died | Failed]:
        """Wait for the next unit that has an outcome."""

    def close(self) -> None:
        """Give up what is running, and end what was started."""


def work_through(
    crew: Crew, units: Iterable[Any], follow_up: Callable[[Unit, Done | Died | Failed], list[Unit]]
) -> Iterator[tuple[Any, Done | Died | Failed | None]]:
    """Keep a crew at work; yield (unit, outcome) as units are done, in any order.

    Parameters
    ----------
    units : are taken as there is room for them; what is no Unit is passed on as (it, None)
    follow_up : returns the units that take the place of one, after its outcome; none: the outcome is passed on
    """
    source, again, is_exhausted = iter(units), deque[Unit](), False
    while True:
        while crew.n_running < crew.n_slot and (again or not is_exhausted):
            unit = again.popleft() if again else next(source, None)
            if isinstance(unit, Unit):
                crew.submit(unit)
            elif unit is None:
                is_exhausted = True
            else:
                yield unit, None
        if not crew.n_running:
            return
        done, outcome = crew.wait()
        instead = follow_up(done, outcome)
        again.extend(instead)
        if not instead:
            yield done, outcome
