"""How many pixels a picture has while something moves: as many as can be drawn in time."""

DIVISORS = (1, 2, 4, 8)  # of the sides of the picture
BUDGET = 30.0  # milliseconds for a picture: 33 a second
_MARGIN = 1.25  # a picture may take that much longer before a smaller one is tried: times vary
_KEPT = 0.7  # share of what was known in a mean of times, so that one slow picture counts little


class Resolution:
    """Choose the size of pictures that are drawn while something moves.

    A picture of half the sides costs a quarter at the least, and as much at the most: transforming vertices doesn't get
    cheaper with fewer pixels. So a larger one is drawn only where four times the time of the smaller one is within the
    budget: then it can't be too slow, and sizes don't alternate.

    Parameters
    ----------
    budget : milliseconds that a picture may take, above 0
    """

    def __init__(self, budget: float = BUDGET) -> None:
        self._budget = budget
        self._level = 0  # in DIVISORS
        self._mean: float | None = None  # milliseconds of pictures of this size

    @property
    def divisor(self) -> int:
        """What the sides of the whole picture are divided by."""
        return DIVISORS[self._level]

    def size_of(self, size: tuple[int, int]) -> tuple[int, int]:
        """Return the (width, height) to draw, in pixels, for a picture of `size`."""
        width, height = (-(-side // self.divisor) for side in size)
        return width, height

    def note(self, milliseconds: float) -> None:
        """Take down how long a picture of this size has taken, and choose the next one's."""
        mean = milliseconds if self._mean is None else _KEPT * self._mean + (1.0 - _KEPT) * milliseconds
        self._mean = mean
        if mean > _MARGIN * self._budget and self._level + 1 < len(DIVISORS):
            self._level += 1
            self._mean = None
        elif 4.0 * mean <= self._budget and self._level > 0:
            self._level -= 1
            self._mean = None
