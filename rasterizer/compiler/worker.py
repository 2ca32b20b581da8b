"""A process that compiles kernels and puts them into the store: what jobs.py starts.

It reads jobs from its standard input, a line each: the repr of (module, name of the function, signature). After each it
prints a line: "done", or why it could not. It ends with its input.
"""

import ast
import importlib
import sys

from . import internals, kernels


def main(folder: str) -> int:
    """Compile what standard input asks for, into the store's folder `folder`; return the exit code.

    2 tells that this process would use another store: its sources, versions or settings differ.
    """
    if str(kernels.STORE.own) != folder or not internals.IS_SEEN:
        return 2
    answers = sys.stdout
    sys.stdout = sys.stderr  # what others print is no answer
    for line in sys.stdin:
        module, name, signature = ast.literal_eval(line)
        try:
            function = getattr(importlib.import_module(module), name)
            function = getattr(function, "py_func", function)
            code = internals.compile_signature(function, signature)
            kernels.STORE.keep(kernels.title_of(function), signature, code.as_bytes())
            answer = "done"
        except Exception as fault:  # noqa: BLE001  whatever it is, who asked compiles this one himself and meets it
            answer = " ".join(f"{type(fault).__name__}: {fault}".split())
        print(answer, file=answers, flush=True)
    return 0
