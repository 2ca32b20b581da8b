"""One thing that fails doesn't stop the rest: failures are told, and counted for the exit code."""

from contextlib import contextmanager

from ..errors import error_of


class Failures(list):
    """The errors of a run, one for each model that failed.

    Parameters
    ----------
    messages : Messages
    is_json : whether each is also told as a line of JSON
    """

    def __init__(self, messages, is_json: bool = False):
        super().__init__()
        self._messages, self._is_json = messages, is_json

    @contextmanager
    def caught(self, model: str, size=None, is_stdout_taken: bool = False):
        """Tell what goes wrong inside the block, which is about one model, and go on.

        Parameters
        ----------
        model : path, for messages
        size : (width, height) of its picture, or None
        is_stdout_taken : whether a picture goes to stdout
        """
        try:
            yield
        except BrokenPipeError:
            raise
        except Exception as error:  # noqa: BLE001  whatever it is, one model that fails does not stop the rest
            at = f" at {size}" if size is not None and isinstance(error, MemoryError) else ""
            failure = error_of(f"{model}{at}", error)
            self.append(failure)
            self._messages.error(failure)
            if getattr(failure, "is_internal", False):
                self._messages.traceback(error.__cause__ if failure is error and error.__cause__ else error)
            if self._is_json:
                self._messages.record({"path": model, "error": str(failure)}, is_stdout_taken)
