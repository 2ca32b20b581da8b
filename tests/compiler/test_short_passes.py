"""What numba does before the optimiser, as far as kernels need it: the results are those of plain Python, and little is
written for a first picture."""

import numba
import numpy as np
import pytest
from helpers.small_scenes import MODELS
from helpers.stores import EntryPoint, Pair

import rasterizer as rz
from rasterizer.compiler import internals, kernels
from rasterizer.compiler.kernels import index

# Instructions that are written for each kernel of a first picture of the teapot with four samples a pixel, as they were
# counted: for the optimiser they are work before any of it is useful, and the time to compile goes with them.
OF_MESHES = {
    "list_corners": 1047, "split_fans": 8853, "flag_inverted": 1206, "transform_range": 2697, "find_visible_in": 4018,
    "scatter": 869, "directional": 497, "phong": 1649, "resolve_averages": 10343,
}  # fmt: skip
BUDGETS = {
    "gouraud": OF_MESHES | {"light_points": 10128, "fill_means": 987, "scan": 17027, "shade_interpolated": 11206},
    "phong": OF_MESHES | {"find_shortest_normal": 2017, "scan": 17731, "shade_lit": 17724},
}
SLACK = 1.05
MEASURED_WITH = "0.68"  # other versions write more or less


@pytest.mark.skipif(not numba.__version__.startswith(MEASURED_WITH), reason=f"counted in numba {MEASURED_WITH}")
@pytest.mark.parametrize("shading", BUDGETS)
def test_a_first_picture_is_not_more_work_to_compile_than_it_was(shading, monkeypatch):
    counts, budgets = {}, BUDGETS[shading]
    scene = rz.load(MODELS / "teapot.obj")
    with rz.Renderer(scene, (640, 480), shading=shading, samples=4, outputs=("rgb",)) as renderer:
        needs = renderer._list_needs(None)

    def count(library):
        blocks = [block for function in library._final_module.functions for block in function.blocks]
        counts[name] = sum(1 for block in blocks for _ in block.instructions)
        raise Counted

    monkeypatch.setattr(internals.KernelLibrary, "_optimize_final_module", count)
    for function, signature in needs:
        name = function.__name__
        with pytest.raises(internals.NotStandalone, match="Counted"):
            internals.compile_signature(function, signature)
    assert counts.keys() == budgets.keys(), f"kernels {counts} != {budgets}"
    beyond = [f"{name}: {n} > {budgets[name]}" for name, n in counts.items() if n > SLACK * budgets[name]]
    assert not beyond, f"instructions {beyond}, of all {sum(counts.values())} > {sum(budgets.values())}"


class Counted(Exception):
    """Enough is known of a kernel."""


# ---------------------------------------------------------------- structures and items


def compiled(function, *arguments):
    """What a kernel returns, with its entry point."""
    return EntryPoint(function, arguments)(*arguments)


@kernels.helper
def mix(pair, k):
    """Read both arrays of a structure, and write one."""
    pair.second[k] = pair.first[1, k] + pair.first[np.uint32(0), k]
    return pair.second[k] - pair.first[1, 0]


def through_structures(pair, n):
    """Sum what a helper finds in a structure within a structure."""
    total = 0.0
    for k in range(index(n)):
        total += mix(pair.first, k)
    return total, pair.second


def test_structures_reach_helpers_as_they_are():
    outcomes = []
    for call in (compiled, lambda function, *arguments: function(*arguments)):
        arrays = Pair(np.arange(6.0).reshape(2, 3) ** 2, np.zeros(3))
        outcomes.append((call(through_structures, Pair(arrays, 7), 3), arrays.second.tolist()))
    assert outcomes[0] == outcomes[1] == ((28.0, 7), [9.0, 17.0, 29.0])


def reads_items(numbers, flags, k):
    """Items by indices of all kinds, also from the end."""
    last = numbers[-1] + numbers[2, 1 - k] if numbers.ndim == 9 else numbers[-1, -k]
    return last, numbers[index(k), 0], numbers[2, index(k)], flags[k], flags[-k], flags[index(1)]


def test_items_are_found_from_either_end():
    numbers, flags = np.arange(12, dtype=np.int16).reshape(3, 4), np.array([True, False, True])
    assert compiled(reads_items, numbers, flags, 1) == (11, 4, 9, False, True, False)


def writes_items(numbers, flags, k):
    """Numbers become what the array holds."""
    numbers[k, index(1)], numbers[index(0), index(k)] = 2.9, 7
    flags[index(0)], flags[-1] = 5, k > 9


def test_what_is_written_becomes_what_the_array_holds():
    numbers, flags = np.zeros((2, 3), np.int32), np.array([False, False, True])
    compiled(writes_items, numbers, flags, 1)
    assert numbers.tolist() == [[0, 7, 0], [0, 2, 0]] and flags.tolist() == [True, False, False]


def sets_variables(values, n):
    """Variables that are set once, before a loop, in it, on one way alone, and anew in each round."""
    first, total, seen = values[0], 0.0, 0.0
    for k in range(n):
        here = values[k]
        if here > first:
            twice = 2.0 * here
            total += twice
            if k > 2:
                seen = twice - first
        total += here
    before = total - first
    return before, seen, here


def test_variables_that_are_set_once_keep_their_values():
    values = np.array([3.0, 1.0, 5.0, 2.0, 9.0, 4.0])
    assert compiled(sets_variables, values, 6) == sets_variables(values, 6) == (57.0, 5.0, 4.0)


# ---------------------------------------------------------------- least and greatest


def finds_extremes(a, b, c, k):
    """Least and greatest of two, three and four numbers of several types, and of a tuple."""
    return min(a, b), max(a, b, c), min(b, a, k), max(a, b, c, k), min((a, b, c)), max(k, 3)


@pytest.mark.parametrize("numbers", [(1.5, np.nan, 2.5), (np.nan, 1.0, -2.0), (-0.0, 0.0, 0.0), (3.0, 2.0, 1.0)])
def test_the_least_and_the_greatest_number_are_those_of_python(numbers):
    """Also where one isn't a number, and of two zeros."""
    of_both = compiled(finds_extremes, *numbers, 2), finds_extremes(*numbers, 2)
    texts = [[repr(float(value)) for value in found] for found in of_both]
    assert texts[0] == texts[1]
