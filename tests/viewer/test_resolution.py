"""The size of moving pictures: as large as there is time for, without alternating."""

from rasterizer.viewer.session import BUDGET, DIVISORS, Resolution


def run(time_of, n=60) -> list[int]:
    """The divisors of pictures that take `time_of(divisor)` milliseconds."""
    resolution, found = Resolution(), []
    for _ in range(n):
        found.append(resolution.divisor)
        resolution.note(time_of(resolution.divisor))
    return found


def test_pictures_that_are_quick_stay_whole():
    assert set(run(lambda divisor: BUDGET)) == {1}


def test_slow_pictures_become_smaller_until_they_are_in_time():
    for whole in (2, 4, 8, 64):
        found = run(lambda divisor, whole=whole: whole * BUDGET / divisor**2)
        expected = next((each for each in DIVISORS if whole / each**2 <= 1.25), DIVISORS[-1])
        assert found[-1] == expected, f"{whole} times the budget: divided by {found[-1]}, not {expected}"


def test_sizes_do_not_alternate_whatever_part_of_the_time_pixels_take():
    for of_vertices in (0, 10, 29, 31, 60):
        for of_pixels in (10, 50, 200, 1000):
            found = run(lambda divisor, v=of_vertices, p=of_pixels: v + p / divisor**2)
            assert len(set(found[20:])) == 1, f"{of_vertices} and {of_pixels} ms: {found}"


def test_a_larger_picture_is_tried_where_four_times_the_time_is_within_the_budget():
    for factor, level in ((0.24, 1), (0.26, 2)):
        resolution = Resolution()
        resolution.note(2 * BUDGET)
        resolution.note(factor * BUDGET)
        assert (got := resolution.divisor) == level, f"{factor}: {got} != {level}"


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
