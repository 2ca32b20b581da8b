"""One pixel, explained: which surfaces its samples see, and what each light adds to them, as rows of label and value.

It does what picture.py does, with the same functions, for the samples of one pixel alone. Only the sum is taken apart:
the illumination equation is evaluated at the same points, and its terms are kept one by one.

Every share of light is linear RGB, as it comes out of its layer: textures, vertex colours, exposure and depth cue are
in it. So a layer's sum is that of its shares, and a sample's colour the sum of its layers' sums, each times `visible`.

The rows of a layer, which is a surface that the sample sees:

    layer K       the face as loaded, as in `Frame.face`; its mesh, its index there, and the material in the palette
    reflection    the numbers of the material that its reflection model uses, with what its textures say there
    depth         distance along the viewing axis, scene units
    weights       barycentric, perspective-correct, on the corners of the triangle
    position, normal    world; the normal is a unit vector and looks to the viewer
    opacity       of the material, times that of the texel
    visible       part of this layer's colour that is seen: its opacity, times what the layers before it let through
    texel         linear RGB of the texture, 1 without one
    lit           where the illumination equation is evaluated
    I_A, I_B, I_C, I_Q, I_R, I_P    what Gouraud's method interpolates: linear RGB at the three corners; where the row
                  of the sample meets the left and the right edge; at the sample. Texel, exposure and depth cue are
                  those of the sample. Gouraud 1971, IEEE Trans. Comput. C-20(6), 623-629
    ambient, emission   linear RGB
    N point, N diffuse, N specular    what the light N of the scene adds, and how. Where the equation is evaluated at
                  several points (corners, the cells of an area light) these are means, weighted as the shares are:
                  the unit vector to the light; N.L, up to 0 where the light is behind the surface; what distance and
                  cone leave of it; and the part that nothing keeps from a surface that faces it, 0 = in shadow
    depth cue     linear RGB that the depth cue puts in the place of light, which it weakens by as much
    sum           linear RGB of all of these
"""

from dataclasses import dataclass
from typing import NamedTuple, SupportsIndex

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError, counted, shown
from ..options import Options
from ..scene.lights import light_type_of
from ..scene.material import Material
from ..scene.scene import Scene
from ..scene.validate import is_whole
from .clip import to_eye
from .light import Contribution, Lighting, Points, ambient_light, as_rgb, contributions, materials_at
from .picture import PictureInputs, encode, gather_inputs, in_range, render, resolve, spread_samples
from .shading import (
    Fragments,
    corner_points,
    cue_factors,
    opacity_of,
    polygon_points,
    sample_normals,
    sample_points,
    sample_textures,
    world_positions,
)
from .surface import Surface
from .visibility import NO_KEY, Window, find_visible, gather_fragments

Vector = tuple[float, float, float]
Row = tuple[str, str | float | tuple[float, ...]]


@dataclass(frozen=True)
class Rows:
    """Rows of label and value; `str` writes them for a person, a line each.

    Attributes
    ----------
    rows : pairs of text, and a number, several numbers, or words
    """

    rows: tuple[Row, ...]

    def __str__(self) -> str:
        return "\n".join(f"{label:<24}{_shown(value)}" for label, value in self.rows)

    __repr__ = __str__


@dataclass(frozen=True, repr=False)
class Explanation(Rows):
    """Why a pixel is what it is; `str` writes it for a person.

    Attributes
    ----------
    rows : the pixel; all about the sample that is nearest to its centre, of equally near ones the first; a row about
        each other sample; and the pixel's value: "linear" over the background, without one not premultiplied, "alpha",
        "sRGB" and "code"
    samples : all about each sample of the pixel, row by row
    """

    samples: tuple[Rows, ...]


def explain(scene: Scene, x: int, y: int, options: Options) -> Explanation:
    """Explain a pixel of a picture: what its samples see, and what each light adds, as the reference computes it.

    Parameters
    ----------
    scene : Scene
    x, y : column and row of the pixel, from the upper left, whole numbers
    options : of the picture; tolerance, outputs and threads have no effect here. With several samples each of them is
        explained, and the pixel's value is their mean. The colour range "global" takes the largest value of the whole
        picture, which is then drawn, slowly

    Returns
    -------
    Explanation

    Raises
    ------
    SceneError : a pixel outside the picture
    """
    width, height = options.size
    x, y = _checked_index(x, "x", width, "columns"), _checked_index(y, "y", height, "rows")
    inputs = gather_inputs(scene, options.size, options)
    return _sum_up(inputs, x, y, _explain_samples(inputs, x, y, options.factor))


# --- what its samples see ------------------------------------------------------------------------------------


class _Layer(NamedTuple):
    """A surface that a sample sees, and how it is lit."""

    rows: list[Row]
    visible: float
    color: NDArray[np.float64]  # (3,) linear RGB


class _Sample(NamedTuple):
    """What one sample sees."""

    x: float  # px from the left and upper borders of the picture
    y: float
    layers: list[_Layer]  # the nearest first


def _sum_up(inputs: PictureInputs, x: int, y: int, samples: list[_Sample]) -> Explanation:
    """Average the samples of a pixel, and bring the mean to 8 bits."""
    scene, options = inputs.scene, inputs.options
    square = options.factor, options.factor
    color = np.array([_color_of(sample) for sample in samples]).reshape(*square, 3)
    alpha = np.array([sum(layer.visible for layer in sample.layers) for sample in samples]).reshape(square)
    color, alpha = resolve(color, alpha, options.factor, scene.background)
    largest = None
    if options.color_range == "global":
        names = "shading", "samples", "cull", "exposure", "spectral"
        settings = {name: getattr(options, name) for name in names}
        largest = float(render(scene, options.size, **settings).color.max())
    code = encode(in_range(color, options.color_range, largest))[0, 0].tolist()
    of_samples = [_rows_of(sample) for sample in samples]
    nearest = min(range(len(samples)), key=lambda k: (samples[k].x - x - 0.5) ** 2 + (samples[k].y - y - 0.5) ** 2)
    (width, height), n = options.size, len(samples)
    what = f"of {width} x {height}, {inputs.shading} shading, " + (f"the mean of {n} samples" if n > 1 else "1 sample")
    rows = [
        (f"pixel ({x}, {y})", what),
        *of_samples[nearest],
        *(rows[0] for k, rows in enumerate(of_samples) if k != nearest),
        ("background", "transparent" if scene.background is None else _vector(scene.background)),
        ("linear", _vector(color[0, 0])),
        ("alpha", float(alpha[0, 0])),
        ("sRGB", tuple(code)),
        ("code", "#" + "".join(f"{value:02x}" for value in code)),
    ]
    return Explanation(tuple(rows), tuple(Rows(tuple(each)) for each in of_samples))


def _rows_of(sample: _Sample) -> list[Row]:
    """Return the rows of a sample: one about itself, and those of its layers."""
    where, layers = f"at {sample.x:g}, {sample.y:g} px", sample.layers
    if not layers:
        return [("sample", f"{where}: nothing is seen here but the background")]
    alpha, color = sum(layer.visible for layer in layers), _vector(_color_of(sample))
    what = f"{where}: {counted(len(layers), 'layer')}, alpha {alpha:.6g}, premultiplied {_shown(color)}"
    numbered = [
        (f"layer {k}" if label == "layer" else label, value)
        for k, layer in enumerate(layers, 1)
        for label, value in layer.rows
    ]
    return [("sample", what), *numbered]


def _color_of(sample: _Sample) -> NDArray[np.float64]:
    """Put the layers of a sample on each other: linear RGB (3,), premultiplied."""
    return sum((layer.visible * layer.color for layer in sample.layers), np.zeros(3))


def _checked_index(value: SupportsIndex, name: str, limit: int, what: str) -> int:
    """Return a whole number within 0..limit - 1."""
    if not is_whole(value, 0, limit - 1):
        legal = f"a whole number within 0..{limit - 1}, as the picture has {limit} {what}"
        raise SceneError(f"{name} must be {legal}; given {shown(value)}")
    return int(value)


def _explain_samples(inputs: PictureInputs, x: int, y: int, per_axis: int) -> list[_Sample]:
    """Explain the per_axis² samples of a pixel, row by row."""
    raster, lighting = spread_samples(inputs, per_axis)
    window = Window(x * per_axis, y * per_axis, per_axis, per_axis)
    raster = raster.within(window)
    layers: dict[tuple[int, int], list[_Layer]] = {at: [] for at in np.ndindex(per_axis, per_axis)}
    through = np.ones(window.shape)
    visible = find_visible(raster)
    while len((fragments := gather_fragments(visible, raster)).face):
        for k in range(len(fragments.face)):
            one = fragments.part(slice(k, k + 1))
            at = int(one.rows[0]) - window.top, int(one.columns[0]) - window.left
            texels = sample_textures(inputs.surface, one, lighting)
            opacity = float(opacity_of(inputs.surface, one, lighting, texels)[0])
            layers[at].append(_explain_layer(inputs, one, lighting, opacity, float(through[at]) * opacity))
            through[at] *= 1.0 - opacity
        is_open = (visible.piece >= 0) & (through > 0)
        visible = find_visible(raster, visible._replace(key=np.where(is_open, visible.key, NO_KEY)))
    return [
        _Sample((window.left + column + 0.5) / per_axis, (window.top + row + 0.5) / per_axis, layers[row, column])
        for row, column in layers
    ]


def _explain_layer(
    inputs: PictureInputs, fragment: Fragments, lighting: Lighting, opacity: float, visible: float
) -> _Layer:
    """Explain what one sample sees: `fragment` has one row, and `visible` of its colour is seen."""
    surface = inputs.surface
    texel = sample_textures(surface, fragment, lighting)[0, :3]
    points, weights, lit_at = _evaluation_points(surface, fragment, lighting)
    cue = float(cue_factors(fragment.depth, lighting)[0])
    gain = 2.0**lighting.exposure * cue
    ambients = as_rgb(ambient_light(points.material, lighting), lighting) * points.albedo * texel * gain
    emissions = as_rgb(lighting.materials["emissive"][points.material], lighting) * gain
    ambient, emission = weights @ ambients, weights @ emissions
    lit = list(contributions(points, lighting))
    lights, light = _explain_lights(points, weights, lighting, lit, texel * gain, gain)
    corners: list[Row] = []
    if lighting.shading == "gouraud":
        at_corners = _corner_intensities(points, lighting, lit, texel * gain, gain, ambients + emissions)
        corners = _explain_corners(fragment.weights[0], surface.corners[fragment.face[0]], at_corners, lighting)
    depth_cue = (1.0 - cue) * np.array(lighting.cue.color) if lighting.cue is not None else np.zeros(3)
    color = ambient + emission + depth_cue + light
    normal = points.normals[0] if lighting.shading == "flat" else sample_normals(surface, fragment)[0]
    face, material = _names_of(inputs.scene, int(fragment.face[0]))
    brush = materials_at(points, lighting)[0]
    rows: list[Row] = [
        ("layer", face),
        ("reflection", _describe_material(material, brush)),
        ("depth", float(fragment.depth[0])),
        ("weights", _vector(fragment.weights[0])),
        ("position", _vector(world_positions(fragment, lighting)[0])),
        ("normal", _vector(normal)),
        ("opacity", opacity),
        ("visible", visible),
        ("texel", _vector(texel)),
        ("lit", lit_at),
        *corners,
        ("ambient", _vector(ambient)),
        ("emission", _vector(emission)),
        *lights,
        *([("depth cue", _vector(depth_cue))] if depth_cue.any() else []),
        ("sum", _vector(color)),
    ]
    return _Layer(rows, visible, color)


def _names_of(scene: Scene, face: int) -> tuple[str, Material]:
    """Return in words which face of which mesh a face as loaded is, and its material."""
    mesh_idx = int(np.searchsorted(scene.face_offsets, face, side="right")) - 1
    mesh, mesh_face = scene.meshes[mesh_idx], face - int(scene.face_offsets[mesh_idx])
    material_idx = 0 if mesh.face_material is None else int(mesh.face_material[mesh_face])
    material = mesh.palette[material_idx]
    names = [f" {name!r}" if name else "" for name in (mesh.name, material.name)]
    of_mesh = f"face {mesh_face} of mesh {mesh_idx}{names[0]}"
    return f"face {face}: {of_mesh}, material {material_idx}{names[1]}", material


def _evaluation_points(
    surface: Surface, fragment: Fragments, lighting: Lighting
) -> tuple[Points, NDArray[np.float64], str]:
    """Return the points at which the equation is evaluated for a sample, what each counts for (n,), and where they
    are."""
    if lighting.shading == "flat":
        points = polygon_points(surface, surface.polygon[fragment.face], lighting)
        return points, np.ones(1), "at the polygon's centroid"
    if lighting.shading == "phong":
        return sample_points(surface, fragment, lighting), np.ones(1), "at the sample"
    points = corner_points(surface, fragment.face, fragment.side)
    return points, fragment.weights[0], "at the corners of the face"


def _corner_intensities(
    points: Points, lighting: Lighting, lit: list[Contribution], diffuse_gain: NDArray, gain: float, unlit: NDArray
) -> NDArray[np.float64]:
    """Return the intensities (3, 3) at the corners of a triangle; `unlit` (3, 3) is what needs no light."""
    total = unlit
    for each in lit:
        diffuse, specular = as_rgb(each.diffuse, lighting), as_rgb(each.specular, lighting)
        total = total + diffuse * points.albedo * diffuse_gain + specular * gain
    return total


def _explain_corners(weights: NDArray, corners: NDArray, intensities: NDArray, lighting: Lighting) -> list[Row]:
    """Return how Gouraud's method comes to the intensity of a sample, in the letters of the textbooks: from the corners
    (3, 3) of its triangle, world space, and along its row, I_P = v I_R + (1 - v) I_Q.

    A row shows what lies in one plane through the eye, y/w constant, or without perspective y constant. So of a point
    in space y - k w, or y - k, is affine in its weights on the corners, k that of the sample; on an edge it is 0 at a
    share that the corners' values tell. Without the rows of Q and R where a corner lies behind the eye.
    """
    names = "I_A", "I_B", "I_C"
    color = _light(weights @ intensities)
    total = " + ".join(f"{weight:.6g} {name}" for name, weight in zip(names, weights, strict=True))
    rows: list[Row] = [(name, _vector(at)) for name, at in zip(names, intensities, strict=True)]
    rows.append(("I_P", f"{total} = {color}"))
    x, y, w = to_eye(corners, lighting.view).T
    if not lighting.projection.is_perspective:
        w = np.ones(3)
    if min(w) <= 0.0:
        return rows
    off = y - weights @ y / (weights @ w) * w
    met = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        if (off[a] > 0.0) != (off[b] > 0.0):
            point = np.zeros(3)
            point[b] = off[a] / (off[a] - off[b])
            point[a] = 1.0 - point[b]
            sum_of = f"{point[b]:.6g} {names[b]} + {point[a]:.6g} {names[a]}"
            met.append((point, f"{sum_of} = {_light(point @ intensities)}"))
    if len(met) < 2:  # the sample lies on a corner, or outside by a rounding
        return rows
    (q, left), (r, right) = sorted(met, key=lambda each: each[0] @ x / (each[0] @ w))
    along = r - q
    length = float(along @ along)
    v = float((weights - q) @ along) / length if length > 0.0 else 0.0
    in_row = f"{v:.6g} I_R + {1 - v:.6g} I_Q = {color}"
    return [*rows, ("I_Q, left in the row", left), ("I_R, right in the row", right), ("I_P, between them", in_row)]


def _explain_lights(
    points: Points, weights: NDArray, lighting: Lighting, lit: list[Contribution], diffuse_gain: NDArray, gain: float
) -> tuple[list[Row], NDArray[np.float64]]:
    """Return what each light adds, of what they add to the points, and the sum (3,); `diffuse_gain` (3,) and `gain` are
    what both parts of its light are multiplied by."""
    found: dict[int, list[Contribution]] = {}
    for each in lit:
        found.setdefault(each.lamp.index, []).append(each)
    rows: list[Row] = []
    total = np.zeros(3)
    for index, cells in found.items():
        # What is known of the light at (cell, point), weighted: the cells of an area light count alike.
        share = np.tile(weights / len(cells), len(cells))
        n_dot_l = np.concatenate([cell.n_dot_l for cell in cells])
        facing = float(share[n_dot_l > 0].sum())
        lit = float(share[np.concatenate([cell.is_lit for cell in cells])].sum())
        to_light = share @ np.concatenate([cell.light_dirs for cell in cells])
        to_light /= max(float(np.linalg.norm(to_light)), np.finfo(np.float64).tiny)
        attenuation = share @ np.concatenate([cell.attenuation for cell in cells])
        diffuse = sum(weights @ (as_rgb(cell.diffuse, lighting) * points.albedo) for cell in cells) * diffuse_gain
        specular = sum(weights @ as_rgb(cell.specular, lighting) for cell in cells) * gain
        how = f"N.L {share @ n_dot_l:.6g}, attenuation {attenuation:.6g}"
        how += f", unshadowed {lit / facing if facing > 0 else 1.0:.6g}"
        rows += [
            (f"{index} {light_type_of(lighting.lights[index])}", f"to {_shown(_vector(to_light))}, {how}"),
            (f"{index} diffuse", _vector(diffuse)),
            (f"{index} specular", _vector(specular)),
        ]
        total += diffuse + specular
    return rows, total


def _vector(values) -> Vector:
    """Return three numbers as floats."""
    a, b, c = (float(value) for value in values)
    return a, b, c


# --- the text that a person reads ----------------------------------------------------------------------------


def _describe_material(material: Material, brush: np.void) -> str:
    """Return the numbers of a material that its reflection model uses, as they are there; `brush` is the reference's
    record of it, with what its textures say."""
    along, across = float(brush["roughness"]), float(brush["across"])  # along the tangent, and across it
    numbers = {key: getattr(material, key) for key in ("ambient", "diffuse", "specular", "emissive")}
    numbers |= {
        "lambert": {},
        "oren-nayar": {"roughness": along},
        "cook-torrance": {
            "roughness": along if along == across else (along, across),
            "fresnel": material.fresnel,
            "metallic": float(brush["metallic"]),
            "metal": material.metal_color,
        },
        "toon": {"shininess": material.shininess, "levels": material.levels},
    }.get(material.reflection, {"shininess": material.shininess})
    numbers |= {"numbers": material.numbers} if material.numbers else {}
    return f"{material.reflection}: " + ", ".join(f"{key} {_shown(value)}" for key, value in numbers.items())


def _light(color: NDArray) -> str:
    """Return a colour, or one number where it is grey."""
    return f"{color[0]:.6g}" if color[0] == color[1] == color[2] else _shown(_vector(color))


def _shown(value: object) -> str:
    """Return a number, several in brackets, or anything else as text; six digits, or nine of one number alone."""
    if isinstance(value, tuple):
        return "(" + ", ".join(f"{part:.6g}" for part in value) + ")"
    return f"{value:.9g}" if isinstance(value, float) else str(value)
