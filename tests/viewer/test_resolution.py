"""The size of moving pictures: as large as there is time for, without alternating."""

import pytest

from rasterizer.viewer.resolution import BUDGET, DIVISORS, Resolution


def run(time_of, n=60) -> list[int]:
    """The divisors of pictures that take `time_of(divisor)` milliseconds."""
    resolution, found = Resolution(), []
    for _ in range(n):
        found.append(resolution.divisor)
        resolution.note(time_of(resolution.divisor))
    return found


def test_pictures_that_are_quick_stay_whole():
    assert set(run(lambda divisor: BUDGET)) == {1}


@pytest.mark.parametrize("whole", [2, 4, 8, 64])
def test_slow_pictures_become_smaller_until_they_are_in_time(whole):
    found = run(lambda divisor: whole * BUDGET / divisor**2)
    assert found[-1] == next((each for each in DIVISORS if whole / each**2 <= 1.25), DIVISORS[-1])


@pytest.mark.parametrize("of_vertices", [0, 10, 29, 31, 60])
def test_sizes_do_not_alternate_whatever_part_of_the_time_pixels_take(of_vertices):
    for of_pixels in (10, 50, 200, 1000):
        found = run(lambda divisor, p=of_pixels: of_vertices + p / divisor**2)
        assert len(set(found[20:])) == 1, found


def test_one_slow_picture_is_recovered_from():
    resolution = Resolution()
    for time in (5, 5, 500, 5, 5, 5, 5):
        resolution.note(time)
    assert resolution.divisor == 1


def test_a_smaller_picture_covers_the_whole_one_and_is_never_empty():
    resolution = Resolution()
    for _ in range(3):
        resolution.note(1e4)
    assert resolution.divisor == 8 and resolution.size_of((801, 1)) == (101, 1)
