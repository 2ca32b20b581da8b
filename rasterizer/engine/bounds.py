"""How far a picture may be off: one page for float32, float64, and every output.

Exact is the evaluation of the same polygons, as they lie on the screen with vertices rounded to 1/256 px, in numbers
without end. u is the unit roundoff, 2^-24 in float32 and 2^-53 in float64. Errors of the first order are counted, all
with the worst sign; those of directions are angles, in radians.

A unit vector v·(1/√(v·v)) errs by 4.5 u of its length and u of its direction, beside what was rounded before:

    N       2 u: copied and scaled; between corners 7 u over the length of the mean: corners, two weights, products, two
            sums, and the sum of the weights
    L       2 u, and what positions turn it by: see below
    V       8 u: the ray through a sample errs by 7 u; skew makes u larger, by 2^-54·|skew|/scale
    N·L     6.5 u of N, 6.5 u of L, 3 u of the product: 16 u; with attenuation (5 u), coefficients and colours: LIT
    R - V   2·16 + 2·6.5 + 6.5 + 3 u of R, 12.5 u of V: 68 u
    N - H   13 u, and 20 u over |L + V|

Positions are relative to the eye. Those of samples err by 19 u of their distance from it, F at most (10 u of w, its
inverse, 7 u of the ray, a product), those of vertices by u, a light's by u of its own, which is F and the distance to
the surface at most. Depths are kept as those of a z-buffer, in float64: 42·2^-53 of F, and 2^-51 of the ratio of the
furthest depth to the nearest one. All that, over the distance d of the light from the nearest surface, turns L, and
changes the strength by twice that share of it, at most.

What one light adds to a material errs by the sum of

    diffuse     brightness · ((1 + s)·(turn of L and N) + s·20 u + light)
    highlight   height     · (rounding + slopes·(turns of L, of N) + light)
    light       (2 + slopes of cone and range)·turn, and 12 u times their steepness

with s of Oren-Nayar's formula (reflections.py). The table of highlights of height 1, n the exponent:

    model         height         rounding                        turn of N     turn of L      float32 up to about
    phong         1              (0.7 √n + 0.7)·68 u + 1.5 n u   1.4 √n + 1.4  0.7 √n + 0.7   n = 500
    blinn         1              the same with 53 u              0.7 √n + 0.7  1.4 √n + 1.4   n = 300
    ggx           W/(2 α³)       245 u                           7             9              α = 0.35
    beckmann      0.884 W/m³     1080 u                          46            29             m = 0.7
    normalised    (n + 2)/2 or Blinn's scale: as much more

That is float32, where |L + V| is MIN_SUM at least, and W(θ) what a mirror reflects there. The last column is for
lights of an intensity of 1 in all, a highlight of 1/2, F/d = 4 and the default tolerance: rounding takes half of it
then. What is far from the light for its distance from the eye, what cones and ranges make steep, and what is brighter,
asks for less sharp highlights, or float64.

Float32 is taken where all of this stays below half of the tolerance; the other half is for planes and entries, triangle
by triangle. In float64 it is next to nothing, and what counts is the rounding of a finished colour to float32: six
operations of 2^-24. So that EXACT is stated, or nothing, with the reason, where the sum is more than ROUNDED.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..pipeline.setup import DEPTH_PLANE_ROUNDING
from ..pipeline.transform import DEPTH_BITS, DEPTH_MARGIN, Screen, skew_stretch
from . import lights as light_table
from . import reflections as reflection_table
from .rounding import DOUBLE, SINGLE, Discontinuity, times
from .scene_tables import SceneTables, diffuse_shares

EXACT = 1e-6  # what is stated of float64
ROUNDED = 6e-7  # how far float64 may be off before it becomes float32, where EXACT is stated
MAX_LIGHT = 1024.0  # and the brightest that light may be without highlights
WRITTEN = 6 * SINGLE  # a pixel over a background, in float32, of its own intensity
# In units of u:
LIT, INTERPOLATED, ROUGH, CONE = 24, 7, 20, 12
NORMALS, POINTS, SAMPLES = 7, 2, 20  # interpolated normals; positions of vertices and samples, a light's included
# In units of 2^-53:
DEPTHS, RATIO = 42, 4  # of depths, and that times the furthest over the nearest one
# Shares:
MIN_SHARE = 2.0**-10  # a light nearer to a surface than this share of the scene's depth counts as on it
MIN_NORMAL = 2.0**-14  # an interpolated normal shorter than this counts as none


# ---------------------------------------------------------------- how bright a scene may be


class Brightness(NamedTuple):
    """How bright lights make materials, linear intensity, the largest of all channels, where nothing weakens them."""

    undirected: NDArray[np.float64]  # (n_material,): what needs no light with a direction: ambient and emissive
    diffuse: NDArray[np.float64]  # (n_material, n_light)
    specular: NDArray[np.float64]  # (n_material, n_light): highlights
    materials: tuple
    lights: tuple

    @property
    def of_materials(self) -> NDArray[np.float64]:
        """The largest intensity that any point of a material can have, (n_material,)."""
        with np.errstate(over="ignore"):  # infinite where no bound holds
            return self.undirected + (self.diffuse + self.specular).sum(axis=1)

    def texel_slopes(self, brightest: float) -> NDArray[np.float64]:
        """Return what an intensity of each material changes by, at most, where its texture changes by 1, (n_material,);
        `brightest` is the largest component of all textures, which is in what they reflect.

        Colours multiply what is reflected diffusely, and F0 of a metal; other highlights keep their light.
        """
        is_metal = np.array([reflection_table.is_metallic(material) for material in self.materials])
        with np.errstate(over="ignore"):
            metal = np.where(is_metal, self.specular.sum(axis=1), 0.0)
            return (self.undirected + self.diffuse.sum(axis=1) + metal) / brightest

    @property
    def turn_slopes(self) -> NDArray[np.float64]:
        """What an intensity of each material changes by, at most, for each radian that the normal turns, (n_material,);
        infinite where that has no limit. Of highlights beside their `discontinuities` in float32."""
        entries = [(reflection_table.entry_of(material), material) for material in self.materials]
        rough = np.array([entry.diffuse_slope(material) for entry, material in entries])
        slopes = np.array([entry.turn_slope(material, SINGLE) for entry, material in entries])
        weights = np.array([entry.weight(material, SINGLE) for entry, material in entries])
        of_lights = np.array([light_table.entry_of(light).normal_slope(light) for light in self.lights], float)
        changes = times(self.diffuse, 1.0 + rough[:, None] + of_lights)
        changes = changes + times(times(self.specular, weights[:, None]), slopes[:, None] + of_lights)
        return changes.sum(axis=1)

    def at(self, clearances: NDArray[np.float64]) -> "Brightness":
        """Return the same under lights that no lit point of a material comes nearer to than `clearances` (n_material,
        n_light)."""
        strengths = np.ones(clearances.shape)
        for i, light in enumerate(self.lights):
            strengths[:, i] = light_table.entry_of(light).strength(light, clearances[:, i])
        return self._replace(diffuse=times(self.diffuse, strengths), specular=times(self.specular, strengths))


def compute_brightness(tables: SceneTables, max_albedo: float) -> Brightness:
    """Compute how bright each light makes each material at most, where its strength is 1.

    Parameters
    ----------
    max_albedo : largest component of the colours that multiply what materials reflect, textures' included
    """
    materials, lights, products = tables.materials, tables.lights, tables.products
    undirected = np.array([max(m.ambient) * tables.ambient.max() * max_albedo + max(m.emissive) for m in materials])
    colors = np.array([max(light.color) for light in lights], float)
    diffuse = (np.array([max(m.diffuse) for m in materials]) * diffuse_shares(materials))[:, None] * colors
    specular = np.array([max(m.specular) for m in materials])[:, None] * colors
    if products is not None:
        undirected = np.abs(products.ambient).max(axis=1) * max_albedo + np.abs(products.emissive).max(axis=1)
        diffuse = np.abs(products.diffuse).max(axis=2)
        specular = np.maximum(np.abs(products.specular), np.abs(products.grazing)).max(axis=2)
        specular = specular + np.abs(products.metal).max(axis=2) * max_albedo
    else:  # W is 1 at most, but where F0 exceeds it
        specular = specular * np.array([brightest_weight(m, max_albedo) for m in materials])[:, None]
    heights = np.array([reflection_table.highlight_height(material) for material in materials])
    return Brightness(undirected, diffuse * max_albedo, specular * heights[:, None], materials, lights)


def brightest_weight(material: Any, max_albedo: float) -> float:
    """Return the largest W of a material, at least 1: F0 of a metal may exceed it, as colours and textures may."""
    if not reflection_table.is_metallic(material):
        return 1.0
    return max(1.0, 1.0 - material.metallic + material.metallic * max(material.metal_color) * max_albedo)


# ---------------------------------------------------------------- what rounding adds


class Distances(NamedTuple):
    """What a scene and a view say about the positions of lights and surfaces; lengths in scene units."""

    furthest: NDArray[np.float64]  # (n_material,): from the eye to any of its points
    clearances: NDArray[np.float64]  # (n_material, n_light): see `LightEntry.clearance`; infinite for parallel light
    shortest: float = 1.0  # the least length of a normal that is interpolated; 1 where none is
    is_lit_per_sample: bool = False
    ratio: float = 1.0  # of the furthest depth to the nearest one that is seen; 1 without perspective
    fading: float = 0.0  # how far off the share that depth cueing leaves of an intensity may be, in float32
    lean: float = 0.0  # of columns, by skew: |skew|/scale_x; 0 where no rays are asked for
    shadow_shift: float = 0.0  # how far float32 moves what shadows are asked for, see shadow_maps.py

    def kept(self, share: float = 1.0) -> "Distances":
        """Return the same without points that lie on a light, and normals that vanish: next to these nothing is
        bounded. `share` of what counts as next to them is left out."""
        least = np.maximum(share * MIN_SHARE * self.furthest, np.finfo(float).tiny)
        shortest = max(self.shortest, share * MIN_NORMAL)
        return self._replace(clearances=np.maximum(self.clearances, least[:, None]), shortest=shortest)


def rounding_errors(brightness: Brightness, distances: Distances, u: float, fades_to=0.0) -> NDArray[np.float64]:
    """Return what rounding adds to an intensity of each material at most, (n_material,): see the head of this page.

    Parameters
    ----------
    brightness : where nothing weakens the lights
    u : SINGLE or DOUBLE
    fades_to : the largest component of the colour of the depth cue
    """
    lights, materials = brightness.lights, brightness.materials
    # Float64 is right where float32 has lost all digits: a direction turns by 2 u·2^30 radians, more than there are.
    distances = distances.kept(2.0**-20 if u == SINGLE else 1.0)
    models = [(reflection_table.entry_of(material), material) for material in materials]
    entries = [(light_table.entry_of(light), light) for light in lights]
    weights = np.array([model.weight(material, u) for model, material in models])
    lit, fading = brightness.at(distances.clearances), distances.fading if u == SINGLE else 0.0
    lit = lit._replace(specular=lit.specular * weights[:, None])
    of_type, u = u, u + 0.5 * distances.lean * DOUBLE
    ratio, per_sample = RATIO * distances.ratio * DOUBLE, distances.is_lit_per_sample
    position = ((SAMPLES if per_sample else POINTS) * u + DEPTHS * DOUBLE + ratio) * distances.furthest
    normal = (NORMALS * u + ratio) / distances.shortest if per_sample else 0.0
    turns = np.where(np.isfinite(distances.clearances), position[:, None] / distances.clearances + u, 0.0)
    steep = np.array([entry.steepness(light) for entry, light in entries], float)
    slopes = np.array([entry.slope(light) for entry, light in entries], float)
    bends = np.array([entry.normal_slope(light) for entry, light in entries], float)
    of_light = times(2.0 + slopes, turns) + CONE * u * steep + times(bends, normal + 2.0 * u)
    # What rounding may carry across the edge of a sharp cone must stay within what counts as lying on it.
    edges = [[edge.near for edge in entry.discontinuities(light, of_type)] for entry, light in entries]
    near = np.array([min(of_one, default=np.inf) for of_one in edges], float)
    of_light = np.where(turns + CONE * u > near / 2.0, np.inf, of_light)
    n_term = len(lights) * (2 if any(reflection_table.count_terms(material) > 2 for material in materials) else 1)
    error = (u * (LIT + INTERPOLATED + n_term) + ratio + fading) * lit.of_materials + fading * fades_to
    for k, (model, material) in enumerate(models):
        rough, rounding = model.diffuse_slope(material), model.highlight_rounding(material, of_type) * u / of_type
        of_diffuse = (1.0 + rough) * (turns[k] + normal) + ROUGH * u * rough + of_light[k]
        of_highlight = rounding + model.light_slope(material, of_type) * turns[k] + of_light[k]
        of_highlight = of_highlight + model.turn_slope(material, of_type) * normal
        parts = times(lit.diffuse[k], np.minimum(of_diffuse, 1.0)) + times(lit.specular[k], np.minimum(of_highlight, 1))
        error[k] += parts.sum()
    return error


def position_shift(screen: Screen, furthest: float, is_lit_per_sample: bool) -> float:
    """Return how far beside its triangle a sample's point may lie, scene units: vertices are rounded to 1/256 px, so by
    √2/512 px at its depth at most; 0 where vertices or centroids are lit."""
    if not is_lit_per_sample:
        return 0.0
    deepest = furthest if screen.is_perspective else 1.0
    return deepest * math.sqrt(2.0) / 512.0 / min(screen.scale_x, screen.scale_y) * skew_stretch(screen)


def furthest_over_nearest(screen: Screen, furthest: float) -> float:
    """Return how many times as far as the nearest depth that a z-buffer has room for the furthest point is; 1 without
    perspective.

    Parameters
    ----------
    furthest : distance of the furthest point from the eye, scene units
    """
    if screen.z_scale == 0.0 or not screen.is_perspective:
        return 1.0
    return max(1.0, min(furthest, screen.far) * (DEPTH_MARGIN - screen.z_offset) / screen.z_scale)


# ---------------------------------------------------------------- discontinuities


def list_discontinuities(plan: Any, distances: Distances) -> tuple[Discontinuity, ...]:
    """List where what a frame shows jumps, and how near to each of them its bound doesn't hold: those of materials,
    then those of lights, of textures and shadows, and of positions."""
    u = SINGLE if plan.dtype == np.float32 else DOUBLE
    found: list[Discontinuity] = []
    for material, is_lit in zip(plan.materials, plan.is_lit, strict=True):
        found += reflection_table.entry_of(material).discontinuities(material, u) if is_lit.any() else ()
    for light in plan.reflected_lights:
        found += light_table.entry_of(light).discontinuities(light, u)
    found += _shadow_edges(plan, distances)
    if any(texture.filter == "nearest" for material in plan.materials for texture in material.textures):
        found.append(Discontinuity("the border between texels that are not blended", 2.0**-20, "texels"))
    least = MIN_SHARE * distances.furthest
    is_near = ((distances.clearances < least[:, None]) & plan.is_lit).any(axis=1)
    if is_near.any():
        found.append(Discontinuity("a light on a surface", float(least[is_near].max()), "scene units"))
    if distances.is_lit_per_sample and distances.shortest < MIN_NORMAL:
        found.append(Discontinuity("an interpolated normal without length", MIN_NORMAL, "of its length"))
    return tuple(dict.fromkeys(found))  # each cause once


def _shadow_edges(plan, distances) -> list[Discontinuity]:
    """The edges of shadows, whose exact ones are those of rays from the lights.

    A point is compared with texels whose centres lie within half the filter of it, along each axis of the map; the
    map's vertices are rounded to a 512th of a texel, float32 moves a point by `shadow_shift`. So what rises from the
    surface towards the light, as a wall does from a floor, hides that much of it. What lies before the surface by less
    than its depth changes over a texel isn't seen; nor what a normal offset carries the point across
    (pipeline/shadow_lookup.py); nor what lies nearer than the map's depths are rounded to.
    """
    shadows = [light_table.shadow_of(light) for light in plan.reflected_lights]
    shadows = [shadow for shadow in shadows if shadow is not None]
    if not shadows:
        return []
    half = (max(shadow.filter for shadow in shadows) + 1) / 2
    found = [Discontinuity("the edge of a shadow, or a fold towards its light", half, "texels of the shadow map")]
    if plan.dtype == np.float32:
        shift = distances.shadow_shift
        found.append(Discontinuity("the edge of a shadow in float32", shift, "scene units beside that"))
    cause, depth = "what casts a shadow next to the surface", "times what the surface's depth changes by over a texel"
    found.append(Discontinuity(cause, 1.0, f"{depth}, and its normal offset"))
    units = max(shadow.size + shadow.filter for shadow in shadows) + DEPTH_PLANE_ROUNDING  # as in shadow_maps.py
    rounding = units * 2.0**-DEPTH_BITS
    return [*found, Discontinuity(cause, rounding, "of the range of the map's depths, or of their inverses")]


# ---------------------------------------------------------------- outputs

STEEPEST, MAX_LEVELS = 12.92 * 255.0, 255  # levels of 8 bits for an intensity of 1, of the sRGB curve at black
# Of the largest number that corners have: 2^-24 where float64 becomes float32, and as much for what the ratio of depths
# leaves of float64. A mean of normals may be short, so that more is left: twice as much.
INTERPOLATED_BOUND, NORMAL_BOUND = 2.0**-23, 2.0**-22
MAX_RATIO = 2.0**26  # of the furthest to the nearest depth, where these are stated: RATIO·2^-53·2^26 = 2^-25


class ShadowBound(NamedTuple):
    """What the shadow maps of a type of light add to a bound: next to an edge of a shadow there is none.

    Parameters
    ----------
    light : type, such as "spot"; the cells of an area light are point lights
    texel : the largest side of a texel, scene units, on a surface that faces the light, where the scene is furthest
        from it; on one that is turned away from it, as much longer as it is seen shorter from there
    near : how near to an edge of a shadow the bound of the colours doesn't hold, scene units along each side of a
        texel, on such a surface
    """

    light: str
    texel: float
    near: float


class FilterBound(NamedTuple):
    """What a texture filter may add: how far its picture may be from one of the texture averaged over each pixel.

    Parameters
    ----------
    filter : "nearest", "bilinear" or "trilinear"
    most : linear intensity. Each filter shows a mean of texels; so does the average
    near : texels; next to the border between texels that are not blended, the bound of the colours doesn't hold. 0
        where they are blended
    """

    filter: str
    most: float
    near: float


class ErrorBounds(NamedTuple):
    """The largest error of each output of one frame; None for those that were not asked for, or of which none is
    stated.

    All but `shadows` and `filters` are errors against the exact evaluation of the same faces at the same samples. A
    polygon that is clipped, at the near plane or far beside
    the picture, may cover samples outside of itself, by the rounding of its new corners to 1/256 px: what is seen
    edge-on has other depths there, and no bound of `depth` and `interpolated` holds.

    Parameters
    ----------
    color : linear intensity where 1 is white; the same number as `Stats.error_bound`. Premultiplied, where surfaces let
        light through and there is no background
    rgb : levels of 8 bits, an integer; of pixels whose alpha is 1
    depth : scene units, at most anywhere in the picture
    depth_share : the same as a share of the depth itself; infinite without perspective where depths may be 0
    normal : of each component of the unit vector
    interpolated : of "uv", "barycentric", "position" and the like, as a share of the largest number that the corners
        have
    face : 0, exact: where two surfaces lie further apart than (columns + rows of both triangles' boxes)/2 + 80 units of
        the z-buffer, a unit being a 2^38th of 1.04 times the range; but for faces that are seen nearly edge-on, and
        within 1/512 px of an outline, see pipeline/setup.py. Of faces in one plane either may be seen
    shadows : tuple of ShadowBound, one for each type of light that casts shadows: what is no part of `color`
    filters : tuple of FilterBound, one for each filter in use: likewise
    """

    color: float | None = None
    rgb: int | None = None
    depth: float | None = None
    depth_share: float | None = None
    normal: float | None = None
    interpolated: float | None = None
    face: int | None = None
    shadows: tuple[ShadowBound, ...] = ()
    filters: tuple[FilterBound, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Return what is stated as names and plain numbers; what is infinite as None."""
        stated = {name: value for name, value in self._asdict().items() if value is not None and value != ()}
        return {
            name: [{key: _finite(v) for key, v in note._asdict().items()} for note in value]
            if isinstance(value, tuple)
            else _finite(value)
            for name, value in stated.items()
        }


def _finite(value):
    """Return None for a number that isn't finite: JSON has none."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def bound_levels(error: float | None, color_range: str) -> int | None:
    """Return how many levels of 8 bits an error of a linear intensity moves a byte at most.

    Two numbers that lie d levels apart are rounded to levels that lie ⌈d⌉ apart at most. Where colours are divided by
    the largest one of the picture or the pixel, M >= 1, both M and the colour c <= M err by e of themselves: (c + e)/(M
    - e) - c/M is less than 2 e/(1 - e).
    """
    if error is None:
        return None
    if color_range != "clamp":
        error = 2.0 * error / (1.0 - error) if error < 1.0 else math.inf
    return min(math.ceil(STEEPEST * error), MAX_LEVELS) if math.isfinite(error) else MAX_LEVELS


def bound_buffers(names, screen: Screen, furthest: float, nearest: float, shortest: float) -> dict[str, Any]:
    """Return the bounds of exact buffers, by the fields of `ErrorBounds`.

    Parameters
    ----------
    names : of the buffers
    furthest : distance of the furthest point from the eye, scene units
    nearest : the least depth of the boxes round the meshes, scene units
    shortest : the least length of a mean of a face's normals; 1 for flat shading
    """
    found: dict[str, Any] = {"face": 0} if "face" in names else {}
    ratio, least = furthest_over_nearest(screen, furthest), max(nearest, screen.near)
    if "depth" in names and screen.is_perspective:
        found["depth_share"] = SINGLE + DEPTHS * DOUBLE * ratio
        found["depth"] = found["depth_share"] * furthest
    elif "depth" in names:
        found["depth"] = (SINGLE + DEPTHS * DOUBLE) * furthest
        rounding = SINGLE + DEPTHS * DOUBLE * furthest / least if least > 0.0 else math.inf
        found["depth_share"] = rounding
    if not {"uv", "barycentric", "position", "position_camera"}.isdisjoint(names) and ratio <= MAX_RATIO:
        found["interpolated"] = INTERPOLATED_BOUND
    is_long = ratio / max(shortest, MIN_NORMAL) <= MAX_RATIO
    if not {"normal", "normal_camera"}.isdisjoint(names) and is_long:
        found["normal"] = NORMAL_BOUND
    return found


def bound_filters(plan: Any) -> tuple[FilterBound, ...]:
    """Return what the filters of a plan's textures may add: all that a texture can change of an intensity."""
    found: dict[str, float] = {}
    for material, bound in zip(plan.materials, plan.brightness.at(plan.clearances).of_materials.tolist(), strict=True):
        for texture in material.textures:
            found[texture.filter] = max(found.get(texture.filter, 0.0), bound)
    return tuple(FilterBound(name, found[name], 2.0**-20 if name == "nearest" else 0.0) for name in sorted(found))


def furthest_of(bounds: np.ndarray, eye: np.ndarray) -> float:
    """Return the distance of the furthest corner of the box round all boxes, scene units, from the eye.

    Parameters
    ----------
    bounds : (n_mesh, 2, 3) float64, world space
    """
    return math.hypot(*np.abs(bounds - eye).max(axis=(0, 1)).tolist())
