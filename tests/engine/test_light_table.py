"""Check what the engine's table says of each kind of light: beams, strengths, slopes, coefficients."""

from dataclasses import replace

import numpy as np
import pytest

import rasterizer as rz
from rasterizer.engine.lights import LIGHT_TABLE, entry_of, is_black, to_world, world_position
from rasterizer.pipeline import lights as pipeline
from rasterizer.scene.lights import LIGHT_TYPES

VIEW = rz.Camera.perspective((3, 1, 2), (0, 0, 0), up=(0, 0, 1)).view()
AXES = np.stack([VIEW.right, VIEW.up, -VIEW.forward])
WAY = (0.6, 0.0, -0.8)
LIGHTS = {
    "directional": rz.DirectionalLight(WAY),
    "point": rz.PointLight((1, 2, 3), attenuation=(0.2, 0.1, 0.05), amplify=True, range=8),
    "spot": rz.SpotLight((1, 2, 3), WAY, inner=20, outer=40, exponent=2),
}


def test_every_kind_of_light_has_an_entry_and_stands_for_lights_with_a_function():
    made = {**LIGHTS, "ambient": rz.AmbientLight(), "area": rz.AreaLight((0, 0, 0), (1, 0, 0), (0, 1, 0))}
    assert set(made) == set(LIGHT_TYPES) == set(LIGHT_TABLE)
    for kind, light in made.items():
        entry = entry_of(light)
        assert entry is LIGHT_TABLE[kind]
        parts = entry.expand(light)
        assert len(parts) == {"ambient": 0, "area": 16}.get(kind, 1) and entry.is_ambient == (kind == "ambient")
        for part in parts:
            assert callable(entry_of(part).function(part))


@pytest.mark.parametrize("attached", ["world", "camera"])
def test_beams_and_vectors_are_those_of_the_world(attached):
    axes, eye = (AXES, VIEW.eye) if attached == "camera" else (np.eye(3), np.zeros(3))
    lights = {kind: replace(light, attached=attached) for kind, light in LIGHTS.items()}
    beams = {kind: entry_of(light).beam(light, VIEW) for kind, light in lights.items()}
    way, place = np.array(WAY) @ axes, eye + np.array((1, 2, 3)) @ axes
    found = {(kind, name): getattr(beam, name) for kind, beam in beams.items() for name in ("axis", "origin")}
    assert found.pop(("directional", "origin")) is None and found.pop(("point", "axis")) is None
    for (kind, name), vector in found.items():
        assert vector == pytest.approx(way if name == "axis" else place, abs=1e-15), f"the {name} of a {kind} light"
    spreads = [beams[kind].spread for kind in LIGHTS]
    assert spreads == [0.0, np.inf, pytest.approx(np.tan(np.radians(40)))]
    assert to_world(lights["spot"].direction, lights["spot"], VIEW) == pytest.approx(way)
    assert world_position(lights["point"], VIEW) == pytest.approx(place)
    wide = replace(lights["spot"], outer=90.0)
    assert entry_of(wide).beam(wide, VIEW).spread == np.inf


ATTENUATIONS = [
    (1, 0, 0),
    (0, 0, 1),
    (0, 1, 0),
    (0.3, 0, 0.2),
    (0.5, 0.3, 0.4),
    (0.9, 0.5, 0),
    (1, 0.1, 0),
    (2, 0.1, 3),
]


def test_no_light_is_stronger_than_the_table_says():
    """1/(kc + kl d + kq d²) from a clearance on; at most 1, where a light may not amplify."""
    for attenuation in ATTENUATIONS:
        constant, linear, quadratic = attenuation
        for clearance in (0.0, 0.05, 1.0, 3.0, np.inf):
            d = clearance + np.concatenate([[0.0], np.geomspace(1e-6, 1e6, 2000)])
            with np.errstate(divide="ignore"):
                total = constant + (linear * d if linear else 0.0) + (quadratic * d * d if quadratic else 0.0)
                largest = (1 / (total + np.zeros(len(d)))).max()
            free = rz.PointLight((0, 0, 0), attenuation=attenuation, amplify=True)
            found = entry_of(free).strength(free, clearance)
            assert found == pytest.approx(largest, rel=1e-12), f"{attenuation}, from {clearance}: {found}"
            kept = replace(free, amplify=False)
            assert entry_of(kept).strength(kept, clearance) == pytest.approx(min(largest, 1.0), rel=1e-12)
    ended = rz.PointLight((0, 0, 0), range=2.0)
    assert entry_of(ended).strength(ended, 1.9) == 1.0 and entry_of(ended).strength(ended, 2.1) == 0.0


def test_black_is_no_light():
    dark = rz.PointLight((0, 0, 0), 0.0)
    assert is_black(dark) and not is_black(rz.PointLight((0, 0, 0), 1e-9))
    assert not is_black(replace(dark, attenuation=(0, 0, 1), amplify=True)), "0 times infinity is no number"


def test_only_sharp_cones_have_steps():
    sharp = replace(LIGHTS["spot"], inner=40.0)
    (step,) = entry_of(sharp).steps(sharp, True)
    assert step.cause == "the edge of a sharp spot light" and step.near > 2.0**-24
    assert entry_of(sharp).limits(sharp).reason == "a sharp spot light"
    assert not any(entry_of(light).steps(light, True) for light in LIGHTS.values())
    assert entry_of(sharp).limits(sharp).steepness == 2.0, "beside the step the exponent alone counts"
    steep = replace(LIGHTS["spot"], inner=40.0 - 1e-5)
    assert entry_of(steep).steps(steep, True) and entry_of(steep).limits(steep).steepness < 1e3


def test_the_strength_is_no_steeper_than_the_table_says():
    """A spot light's strength along a circle about it, by differences."""
    for inner, outer, exponent, falloff in (
        (5, 30, 0, 1), (5, 8, 0, 1), (10, 60, 3, 1), (10, 60, 30, 1), (0, 90, 0.5, 2), (0, 90, 2, 2), (0, 40, 300, 1),
        (20, 40, 12, 0.7),
    ):  # fmt: skip
        light = rz.SpotLight((0, 0, 0), (0, 0, -1), 1.0, inner, outer, exponent, falloff=falloff)
        angles = np.radians(np.linspace(0, 95, 20_001))
        points = np.stack([np.sin(angles), 0 * angles, -np.cos(angles)], axis=1)
        white = rz.Material(diffuse=1, specular=0, ambient=0)
        strength = rz.illuminate(points, -points, white, light, toward_viewer=(0, 0, 1))[:, 0]
        slope, case = np.abs(np.diff(strength)).max() / (angles[1] - angles[0]), (inner, outer, exponent, falloff)
        of_cone, steepness, _ = entry_of(light).limits(light)
        assert 0.02 * steepness < slope <= steepness, f"cone {case}: {slope:.4g} > {steepness:.4g}, or far below"
        if falloff >= 1 <= exponent or exponent == 0:
            assert 0.3 * of_cone < slope <= of_cone, f"cone {case}: {slope:.4g} > {of_cone:.4g}, or far below"


def test_a_huge_exponent_is_written_as_a_number_of_the_type():
    light = replace(LIGHTS["spot"], exponent=1e300)
    for dtype, written in ((np.float32, float(np.finfo(np.float32).max)), (np.float64, 1e300)):
        row = np.zeros(pipeline.N_LIGHT_COEFFICIENT)
        entry_of(light).write(row, light, VIEW, np.dtype(dtype))
        assert row[pipeline.CONE_EXPONENT] == written
