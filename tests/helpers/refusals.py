"""What is refused, value by value: one test holds many, and its message begins with the one that is wrong."""

import re
from collections.abc import Callable, Iterable
from typing import Any


def assert_refused(call: Callable, cases: Iterable[tuple[Any, str]], error: type | tuple, start: str = "") -> None:
    """Call with each value: it must end in an error whose message holds the pattern beside the value.

    Parameters
    ----------
    cases : pairs of a value and a regular expression
    error : the class of the error, or several
    start : what each message begins with
    """
    for given, pattern in cases:
        name = repr(given)[:100]
        try:
            call(given)
        except error as fault:
            said = str(fault)
        except Exception as fault:
            raise AssertionError(f"{name}: {type(fault).__name__}, not a refusal: {fault}") from fault
        else:
            raise AssertionError(f"{name} is taken, not refused by {pattern!r}")
        assert said.startswith(start) and re.search(pattern, said), f"{name}: {said[:300]!r} is not {pattern!r}"
