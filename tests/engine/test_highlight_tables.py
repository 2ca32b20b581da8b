"""Check the tables of highlights against what each material's entry says."""

import numpy as np
import pytest

import rasterizer as rz
from rasterizer.engine.highlight_tables import LEAST_SUMS, HighlightTables
from rasterizer.engine.reflection_table import entry_of
from rasterizer.engine.rounding import DOUBLE, SINGLE

MATERIALS = (
    rz.Material(specular=0.4, shininess=30),
    rz.Material(specular=0.4, shininess=0.5, reflection="blinn"),
    rz.Material(specular=0.4, roughness=0.2, reflection="cook-torrance"),
    rz.Material(specular=0.0),
    rz.Material(specular=0.4, reflection="toon"),
)


@pytest.mark.parametrize("u", [SINGLE, DOUBLE])
def test_tables_hold_what_the_entries_say(u):
    rng, tables = np.random.default_rng(1), HighlightTables(MATERIALS)
    sums = rng.choice(LEAST_SUMS, (len(MATERIALS), 40))
    found = tables.look_up(u, sums)
    for m, material in enumerate(MATERIALS):
        expected = entry_of(material).highlight_bounds(material, u, sums[m])
        for name, values, wanted in zip(found._fields, found, expected, strict=True):
            is_dull = max(material.specular) == 0
            assert np.array_equal(values[m], np.zeros(40) if is_dull else wanted), (name, material)


def test_values_between_two_places_are_rounded_to_the_safe_side():
    tables = HighlightTables(MATERIALS)
    sums = np.random.default_rng(2).uniform(0, 2, (len(MATERIALS), 100))
    found, exact = tables.look_up(SINGLE, sums), tables.look_up(SINGLE, np.floor(8 * sums) / 8)
    for values, wanted in zip(found, exact, strict=True):
        assert np.array_equal(values, wanted)
    for m, material in enumerate(MATERIALS[:3]):
        own = entry_of(material).highlight_bounds(material, SINGLE, sums[m])
        assert (found.roundings[m] >= own.roundings * (1 - 1e-12)).all()
        assert (found.light_slopes[m] >= own.light_slopes * (1 - 1e-12)).all()
