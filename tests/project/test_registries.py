"""Register a light and a reflection model that the package doesn't have, and walk everything that must know them.

What is not registered is an error everywhere, whose message lists what is.
"""

import subprocess
import sys
from dataclasses import dataclass, replace

import numpy as np
import pytest
from helpers.against_reference import assert_matches_reference, compare_with_reference
from helpers.command import CUBE
from helpers.pinhole import QUAD, SHADINGS, octasphere
from helpers.raster import ROOT
from helpers.toy_extensions import Minnaert, SlabLight, add_minnaert, add_slab
from project.extending import hemisphere_light

import rasterizer as rz
from rasterizer import reference, registries
from rasterizer.cli import main
from rasterizer.engine import lights as light_table
from rasterizer.engine import reflections as reflection_table
from rasterizer.options import DEFAULT_TOLERANCE
from rasterizer.reference.lamp import LAMP_TYPES
from rasterizer.reference.reflection import REFERENCE_MODELS
from rasterizer.scene.lights import LIGHT_TYPES, Attenuation, Color, Vector, light_type_of
from rasterizer.scene.material import REFLECTION_MODELS

SIZE = (64, 48)
CAMERA = rz.Camera.perspective((2.5, 1.5, 3), fov=45)
BUILT_IN = [list(table) for table in (LIGHT_TYPES, REFLECTION_MODELS)]
TABLES = (LIGHT_TYPES, light_table.LIGHT_TABLE, LAMP_TYPES)
MODEL_TABLES = (REFLECTION_MODELS, reflection_table.REFLECTION_TABLE, REFERENCE_MODELS)


@pytest.fixture
def toys():
    """Both are registered while a test runs."""
    with add_slab(), add_minnaert():
        yield


@dataclass(frozen=True)
class Stranger:
    """Looks like a light, and is none."""

    position: Vector = (1.0, 2.0, 3.0)
    direction: Vector = (0.0, 0.0, -1.0)
    color: Color = (1.0, 1.0, 1.0)
    attenuation: Attenuation = (1.0, 0.0, 0.0)
    attached: str = "world"
    amplify: bool = False
    range: float | None = None
    shadow: rz.Shadow | None = None


@dataclass(frozen=True)
class Subclass(rz.PointLight):
    """A point light that may shine in another way."""


def moon(**fields):
    """A material of the model."""
    return rz.Material(reflection="minnaert", diffuse=0.7, specular=0.3, **fields)


def scene_of(material, *lights, floor=False):
    """A ball, and a floor under it."""
    meshes = [rz.Mesh(*octasphere(2), material=material)]
    if floor:
        meshes.append(rz.Mesh(np.array([(-3, -1.2, 3), (3, -1.2, 3), (3, -1.2, -3), (-3, -1.2, -3)], float), QUAD))
    return rz.Scene(meshes, lights, CAMERA)


def slab_light(**fields):
    """A slab light across the ball."""
    across = {"direction": (-1, -2, -1.5), "position": (0.2, 0.1, 0), "width": 0.8, "color": 0.9}
    return SlabLight(**across | fields)


# ---------------------------------------------------------------- what is registered is drawn


def test_the_picture_is_the_references(toys):
    """Each shading, tolerance and material with each group of lights once."""
    materials = moon(), rz.Material(), rz.Material(reflection="blinn", shininess=9)
    lights = rz.AmbientLight(0.1), slab_light(), rz.PointLight((3, 2, 1), 0.4, "1/(d+1)")
    groups = lights, lights[1:2], [slab_light(attached="camera", position=(0, 0, -3.5), direction=(1, -1, -1))]
    for k, (shading, tolerance) in enumerate(zip(SHADINGS, (0.01, DEFAULT_TOLERANCE, 0.0), strict=True)):
        for j, lit in enumerate(groups):
            scene = scene_of(materials[(j + k) % 3], *lit)
            frame = rz.render(scene, SIZE, shading=shading, tolerance=tolerance, samples=1)
            error = compare_with_reference(scene, SIZE, shading=shading, tolerance=tolerance).color
            case = f"{shading}, material {(j + k) % 3}, lights {j}: {error:.3g}"
            assert error <= 1e-6 and np.ptp(frame.color) > 0.1, case
            assert frame.stats.error_bound is None and "SlabLight" in " ".join(s.cause for s in frame.stats.steps), case


def test_it_casts_shadows(toys):
    scene = scene_of(moon(), slab_light(width=3, shadow=True), rz.AmbientLight(0.1), floor=True)
    settings = {"shading": "phong", "tolerance": 0}
    lit = rz.render(replace(scene, lights=[slab_light(width=3), rz.AmbientLight(0.1)]), SIZE, samples=1, **settings)
    frame = rz.render(scene, SIZE, samples=1, **settings)
    assert (frame.color < lit.color - 0.1).sum() > 100, "no shadow of the ball on the floor"
    assert_matches_reference(scene, SIZE, 1e-5, far=0.06, **settings)  # pixels at the shadow's edge


# ---------------------------------------------------------------- what is not registered is an error


def listed(names, text) -> bool:
    """Tell whether a message lists all built-in types."""
    return all(name in text for name in names)


CLASSES = [cls.__name__ for cls in LIGHT_TYPES.values()]


def test_a_stranger_is_no_light_of_a_scene():
    for light in (Stranger(), Subclass((1, 2, 3)), slab_light(), "sun"):
        for make in (
            lambda light: scene_of(rz.Material(), rz.AmbientLight(), light),
            lambda light: rz.illuminate((0, 0, 0), (0, 0, 1), rz.Material(), light, viewer=(0, 0, 1)),
            light_type_of,
            light_table.entry_of,
            reference.lamp.lamp_type_of,
        ):
            with pytest.raises(rz.SceneError) as fault:
                make(light)
            assert listed(CLASSES, str(fault.value)), fault.value


def test_what_is_taken_back_is_refused():
    with add_slab(), add_minnaert():
        scenes = scene_of(rz.Material(), slab_light()), scene_of(moon(), rz.AmbientLight())
    for scene, names, word in zip(scenes, (CLASSES, BUILT_IN[1]), ("SlabLight", "minnaert"), strict=True):
        with pytest.raises(rz.SceneError) as fault:
            rz.render(scene, SIZE, samples=1, shading="gouraud")
        assert listed(names, str(fault.value)) and word in str(fault.value), fault.value


def test_shadows_of_a_light_without_a_beam_are_refused():
    class Beamless(SlabLight):
        beam = None

    with pytest.raises(rz.SceneError, match="needs a beam"):
        registries.add_light("slab", Beamless)


# ---------------------------------------------------------------- registering


def test_all_tables_have_the_same_words():
    assert list(map(list, TABLES)) == [BUILT_IN[0]] * 3
    assert list(map(set, MODEL_TABLES)) == [set(BUILT_IN[1])] * 3


def test_a_registration_is_undone_by_its_block_by_an_error_or_by_hand():
    with add_slab(), add_minnaert():
        assert [table for table in TABLES if "slab" not in table] == []
        assert [table for table in MODEL_TABLES if "minnaert" not in table] == []
    kept = add_slab()
    assert light_type_of(slab_light()) == "slab" and kept.word == "slab"
    kept.remove()
    kept.remove()
    with pytest.raises(ZeroDivisionError), add_slab():
        _ = 1 / 0
    test_all_tables_have_the_same_words()


def test_words_that_are_taken_or_no_words_are_refused_and_nothing_is_entered():
    for word in ("point", "ambient", "Slab", "2d", "a b", "", None, 3):
        with pytest.raises(rz.SceneError, match="already; taken are ambient|small letters, digits and hyphens"):
            registries.add_light(word, SlabLight)
        word = "toon" if word in ("point", "ambient") else word
        with pytest.raises(rz.SceneError, match="already; taken are phong|small letters, digits and hyphens"):
            registries.add_reflection(word, Minnaert)
    test_all_tables_have_the_same_words()


# ---------------------------------------------------------------- what disagrees is refused


class Darker(hemisphere_light.HemisphereLight):
    """The formula says something else than the reference."""

    @staticmethod
    def share(normal, position, up):
        return 0.49 + 0.49 * (normal[0] * up[0] + normal[1] * up[1] + normal[2] * up[2])


class Colder(hemisphere_light.HemisphereLight):
    """Both halves have one colour."""

    def parts(self):
        return (self,)


class Hasty(SlabLight):
    """It reads a position, and says that it needs none."""

    needs_position = False


class Uncompiled(hemisphere_light.HemisphereLight):
    """The formula is none that can be compiled."""

    @staticmethod
    def share(normal, position, up):
        return normal.nothing


def test_lights_that_disagree_are_refused_with_the_place():
    for cls, match in (
        (
            Darker,
            r"disagree at the point \(.*\) with the normal \(.*\) of Darker\(.*ambient share is .* by the engine",
        ),
        (Colder, "ambient share is"),
        (Hasty, "light that arrives is .*nan.* by the engine"),
        (Uncompiled, "share can't be compiled for float64"),
    ):
        with pytest.raises(rz.SceneError, match=match):
            registries.add_light("odd", cls)
    test_all_tables_have_the_same_words()


class Cancelling(registries.CustomReflection):
    """Its formula equals its reference in float64, and in no type with fewer digits."""

    needs_view = has_highlight = False

    @staticmethod
    def reflect(normal, light_dir, view_dir, coefficients):
        large = coefficients.shininess**4
        cos = normal[0] * light_dir[0] + normal[1] * light_dir[1] + normal[2] * light_dir[2]
        return (cos + large) - large, 0.0

    def reference(self, materials, normals, light_dirs, view_dirs):
        return (normals * light_dirs).sum(axis=1), np.zeros(len(normals))


def test_formulas_are_compared_in_float64_as_they_are_evaluated():
    with registries.add_reflection("cancelling", Cancelling):
        pass


def test_models_that_disagree_are_refused_with_the_place():
    class Brighter(Minnaert):
        def reference(self, *arguments):
            diffuse, specular = super().reference(*arguments)
            return diffuse, 1.01 * specular

    for cls, match in ((Brighter, r"disagree at N = .*, L = .*, V = .*: D and S are .* by the engine"),):
        with pytest.raises(rz.SceneError, match=match):
            registries.add_reflection("odd", cls)
    test_all_tables_have_the_same_words()


# ---------------------------------------------------------------- light that depends on the normal


def test_a_hemisphere_light_is_the_references_in_every_shading():
    """Each shading with colours, grey, spectra; textured, transparent, several samples; also beside other lights."""
    ball = octasphere(2)
    globe = rz.load(ROOT / "models" / "globe.obj").meshes[0]
    gold = rz.Material(fresnel=(1.0, 0.8, 0.3), ambient=(0.9, 0.5, 0.2), specular=0.8)
    glass = rz.Material(opacity=0.5, ambient=0.4)
    with registries.add_light("hemisphere", hemisphere_light.HemisphereLight), add_minnaert():
        colored = hemisphere_light.HemisphereLight("#9cf", "#630", up=(0.2, 1, 0.1))
        grey = hemisphere_light.HemisphereLight(0.9, 0.2)
        spectral = hemisphere_light.HemisphereLight(rz.Spectrum.flat(0.7), 0.1)
        point = rz.PointLight((2, 3, 2), 0.5)
        cases = [
            (rz.Mesh(*ball), [grey], {}, 1),
            (rz.Mesh(*ball, material=gold), [colored, point], {}, 3),
            (globe, [grey, point], {"samples": 4}, 3),
            (rz.Mesh(*ball, material=glass), [colored], {"exposure": 1.0}, 3),
            (rz.Mesh(*ball, material=moon(ambient=0.3)), [spectral, point], {}, 3),
            (rz.Mesh(*ball, material=rz.Material(reflection="toon")), [grey], {"tolerance": 0.0}, 1),
        ]
        for k, (mesh, lights, settings, n_channel) in enumerate(cases):
            for shading in SHADINGS if k == 0 else [SHADINGS[k % 3]]:
                scene = rz.Scene([mesh], lights, CAMERA)
                with rz.Renderer(scene, SIZE, shading=shading, **{"samples": 1} | settings) as renderer:
                    frame, plan = renderer.render(), renderer.plan
                slow = {name: value for name, value in settings.items() if name != "tolerance"}
                expected = reference.render(scene, SIZE, shading=shading, **slow)
                error = np.abs(frame.color - expected.color).max()
                case = f"case {k}, {shading}: {error:.3g}"
                assert error <= 2e-3 and np.ptp(frame.color) > 0.1, case
                assert plan.channels == n_channel and frame.stats.error_bound is None, case


def test_a_hemisphere_light_is_explained_and_illuminates():
    material = rz.Material(ambient=(0.5, 0.4, 0.3), diffuse=0.9)
    with registries.add_light("hemisphere", hemisphere_light.HemisphereLight):
        light = hemisphere_light.HemisphereLight((0.2, 0.4, 0.8), 0.1)
        normals = np.array([(0, 1, 0), (0, -1, 0), (1, 0, 0), (0, 0, -1)], float)
        found = rz.illuminate(np.zeros(3), normals, material, light, viewer=(0, 0, 5))
        sky = np.array([1, 0, 0.5, 0.5])[:, None]
        expected = (sky * light.color + (1 - sky) * light.ground) * material.ambient
        assert np.abs(found - expected).max() < 1e-15
        turned = rz.illuminate(np.zeros(3), normals, material, light, viewer=(0, 0, 5), two_sided=True)
        assert np.abs(turned - expected).max() < 1e-15  # (0, 0, -1) becomes (0, 0, 1), which faces as much of the sky
        scene = rz.Scene([rz.Mesh(*octasphere(2), material=material)], [light], CAMERA)
        said = rz.explain(scene, 32, 24, size=SIZE, shading="phong", samples=1)
        frame = rz.render(scene, SIZE, shading="phong", samples=1)
    rows = dict(said.rows)
    assert rows["0 hemisphere"].startswith("to (0, 0, 0), N.L 1,")
    assert np.abs(np.array(rows["0 diffuse"]) - frame.color[24, 32]).max() < 1e-6 and not any(rows["0 specular"])


def test_a_program_with_a_light_of_its_own_is_the_command_line(tmp_path):
    """The example of the guide, as one would run it."""
    out = tmp_path / "cube.npy"
    argv = ["render", str(CUBE), "--light", "hemisphere:color=#9cf,ground=#630,up=0/0/1", "-s", "24x16", "-o", str(out)]
    subprocess.run([sys.executable, hemisphere_light.__file__, *argv, "-q"], check=True, timeout=300)
    with registries.add_light("hemisphere", hemisphere_light.HemisphereLight):
        light = hemisphere_light.HemisphereLight("#9cf", "#630", (0, 0, 1))
        path = rz.save(replace(rz.load(CUBE), lights=[light]), tmp_path / "scene.json")
        assert rz.load(path).lights == (light,)
        assert main(["render", str(path), "-s", "24x16", "-o", str(tmp_path / "again.npy"), "-q"]) == 0
    assert np.ptp(np.load(out)) > 0.1 and np.load(out).shape == (16, 24, 3)


# ---------------------------------------------------------------- what can't be registered


def test_what_can_not_be_a_light_is_refused():
    @dataclass(frozen=True)
    class Unreadable(SlabLight):
        where: dict = None

    @dataclass(frozen=True)
    class Colorless(registries.CustomLight):
        width: float = 1.0

    @dataclass(frozen=True)
    class Mute(registries.CustomLight):
        color: Color = 1.0

    for cls in (Stranger(), int, type("Plain", (), {}), rz.Shadow, registries.CustomLight):
        with pytest.raises(rz.SceneError, match="a class that derives from CustomLight is needed"):
            registries.add_light("odd", cls)
    for cls, match in (
        (Colorless, "must be a dataclass with a field color"),
        (Unreadable, "Unreadable.where must be annotated with"),
        (Mute, "Mute must have one of the static methods share and arrival"),
    ):
        with pytest.raises(rz.SceneError, match=match):
            registries.add_light("odd", cls)
    with pytest.raises(rz.SceneError, match="a class that derives from CustomReflection is needed"):
        registries.add_reflection("odd", SlabLight)
