"""How long each stage of a picture takes."""

from time import perf_counter


class Clock:
    """Milliseconds of each stage, in order."""

    def __init__(self) -> None:
        self.milliseconds: dict[str, float] = {}
        self._last = perf_counter()

    def lap(self, stage: str) -> None:
        """Add the time since the last lap to a stage."""
        now = perf_counter()
        self.milliseconds[stage] = self.milliseconds.get(stage, 0.0) + 1000.0 * (now - self._last)
        self._last = now
