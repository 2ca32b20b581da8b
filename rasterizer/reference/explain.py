"""One pixel, explained: which surfaces its samples see, and what each light adds to them.

It does what picture.py does, with the same functions, for the samples of one pixel alone. Only the sum is taken apart:
the illumination equation is evaluated at the same points, and its terms are kept one by one.

Every share of light is linear RGB, as it comes out of its layer: textures, vertex colours, exposure and depth cue are
in it. So a layer's colour is the sum of its shares, and a sample's colour the sum of its layers' colours, each times
`visible`.
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
from .light import Contribution, Lighting, RayOrigins, ambient_light, as_rgb, contributions, materials_at
from .picture import Look, encode, in_range, lit_fragments, look_at, render, resolve, shared_points, spread_samples
from .shading import (
    Fragments,
    Points,
    corner_points,
    cue_factors,
    polygon_points,
    ring_faces,
    sample_normals,
    sample_points,
    sample_textures,
    world_positions,
)
from .surface import Surface
from .visibility import NO_KEY, Window, find_visible

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class LightShare:
    """What one light adds to a layer.

    Where the equation is evaluated at several points (the corners of a face with Gouraud's method, the cells of an area
    light), direction, n_dot_l, attenuation and unshadowed are means over them, weighted as the shares are.

    Attributes
    ----------
    index : number of the light in the scene
    kind : its type, as "point"
    direction : unit vector to the light, world
    n_dot_l : cosine of the angle between normal and direction; up to 0 the light is behind the surface and adds nothing
    attenuation : what distance and cone leave of the light, 1 = all
    unshadowed : part of the light that nothing keeps from a surface that faces it, 0 = in shadow
    diffuse, specular : linear RGB
    """

    index: int
    kind: str
    direction: Vector
    n_dot_l: float
    attenuation: float
    unshadowed: float
    diffuse: Vector
    specular: Vector


class EdgePoint(NamedTuple):
    """Where the row of a sample meets an edge of its triangle: Q on the left, R on the right.

    Attributes
    ----------
    edge : its two corners, out of 0, 1, 2
    share : how far the point lies from the first corner to the second, 0 to 1, in space
    intensity : linear RGB there: share times that of the second corner, and the rest times that of the first
    """

    edge: tuple[int, int]
    share: float
    intensity: Vector


class ScanLine(NamedTuple):
    """Two edges and a row, along which Gouraud's method comes to the intensity of a sample, I_P = v I_R + (1 - v) I_Q.

    Attributes
    ----------
    left, right : Q and R
    share : v, how far the sample lies from Q to R, 0 to 1, in space

    Source: Gouraud 1971, IEEE Trans. Comput. C-20(6), 623-629.
    """

    left: EdgePoint
    right: EdgePoint
    share: float


@dataclass(frozen=True)
class Layer:
    """A surface that a sample sees, and how it is lit.

    Attributes
    ----------
    face : index into the faces as loaded, as in `Frame.face`
    mesh, mesh_face, mesh_name : number of the mesh in the scene, index of the face in it, and the mesh's name
    material_index, material : number of the material in the mesh's palette, and the material
    depth : distance along the viewing axis, scene units
    weights : barycentric, perspective-correct, on the corners of the drawn triangle: of a convex polygon with more than
        three corners, two of them and its centre
    position, normal : world; the normal is a unit vector and looks to the viewer
    lit_at : where the illumination equation is evaluated, in words
    corners : with Gouraud's method linear RGB at the three corners; else empty. Texel, exposure and depth cue are those
        of the sample, so that their sum, each times its weight, and the depth cue are `color`
    scan_line : how they are interpolated along the row; None without corners, or where one lies behind the eye
    opacity : of the material, times that of the texel
    visible : part of this layer's colour that is seen: its opacity, times what the layers before it let through
    texel : linear RGB of the texture, 1 without one
    metallic, roughness : of the material, times what its textures say there; roughness along the tangent and across it
    ambient, emission : linear RGB
    lights : what each light adds; ambient lights are in `ambient`
    depth_cue : linear RGB that the depth cue puts in the place of light, which it weakens by as much
    color : linear RGB, the sum of all of these
    """

    face: int
    mesh: int
    mesh_face: int
    mesh_name: str
    material_index: int
    material: Material
    depth: float
    weights: Vector
    position: Vector
    normal: Vector
    lit_at: str
    corners: tuple[Vector, ...]
    scan_line: ScanLine | None
    opacity: float
    visible: float
    texel: Vector
    metallic: float
    roughness: tuple[float, float]
    ambient: Vector
    emission: Vector
    lights: tuple[LightShare, ...]
    depth_cue: Vector
    color: Vector


@dataclass(frozen=True)
class Sample:
    """One sample of a pixel; `str` writes it for a person.

    Attributes
    ----------
    x, y : where it lies, in px from the left and upper borders of the picture
    layers : the surfaces that it sees, the nearest first; empty where it sees none
    color : linear RGB, premultiplied: the sum of the layers' colours, each times `visible`
    alpha : the sum of the layers' `visible`
    """

    x: float
    y: float
    layers: tuple[Layer, ...]
    color: Vector
    alpha: float

    def __str__(self) -> str:
        return "\n".join(_describe_sample(self))


@dataclass(frozen=True)
class Explanation:
    """Why a pixel is what it is; `str` writes it for a person: of several samples the one that is nearest to the
    pixel's centre, of equally near ones the first.

    Attributes
    ----------
    x, y : column and row of the pixel
    size : (width, height) of the picture
    shading : "flat", "gouraud" or "phong"
    samples : the samples of the pixel, row by row
    background : linear RGB, or None = transparent
    linear : linear RGB of the pixel: the mean over its samples, over the background; without one not premultiplied
    alpha : of the pixel
    rgb : its 8-bit sRGB values
    path : how the renderer draws the nearest surface; None where nobody asked
    """

    x: int
    y: int
    size: tuple[int, int]
    shading: str
    samples: tuple[Sample, ...]
    background: Vector | None
    linear: Vector
    alpha: float
    rgb: tuple[int, int, int]
    path: str | None = None

    @property
    def layers(self) -> tuple[Layer, ...]:
        """The layers of the sample nearest to the pixel's centre; of equally near ones the first."""
        return self._nearest.layers

    @property
    def _nearest(self) -> Sample:
        return min(self.samples, key=lambda s: (s.x - self.x - 0.5) ** 2 + (s.y - self.y - 0.5) ** 2)

    def __str__(self) -> str:
        n = len(self.samples)
        width, height = self.size
        lines = [f"pixel ({self.x}, {self.y}) of {width} x {height}, {self.shading} shading, {counted(n, 'sample')}"]
        if self.path is not None:
            lines.append(f"drawn by: {self.path}")
        lines += _describe_sample(self._nearest)
        if n > 1:
            lines.append(f"the pixel's other samples: print(explanation.samples[k]), k from 0 to {n - 1}")
        lines.append("background: " + ("transparent" if self.background is None else _numbers(self.background)))
        mean = " (mean of the samples)" if n > 1 else ""
        code = "".join(f"{value:02x}" for value in self.rgb)
        lines.append(f"linear {_numbers(self.linear)}, alpha {self.alpha:.6g}{mean}; sRGB {self.rgb}, #{code}")
        return "\n".join(lines)

    __repr__ = __str__


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
    look = look_at(scene, options.size, options)
    found = _explain_samples(look, x, y, options.factor)
    return _sum_up(look, x, y, found)


# --- what its samples see ------------------------------------------------------------------------------------


def _sum_up(look: Look, x: int, y: int, samples: list[Sample]) -> Explanation:
    """Average the samples of a pixel, and bring the mean to 8 bits."""
    scene, options = look.scene, look.options
    square = options.factor, options.factor
    color = np.array([sample.color for sample in samples]).reshape(*square, 3)
    alpha = np.array([sample.alpha for sample in samples]).reshape(square)
    color, alpha = resolve(color, alpha, options.factor, scene.background)
    largest = None
    if options.color_range == "global":
        names = "shading", "samples", "antialias", "cull", "exposure", "spectral"
        settings = {name: getattr(options, name) for name in names}
        largest = float(render(scene, options.size, **settings).color.max())
    red, green, blue = (int(value) for value in encode(in_range(color, options.color_range, largest))[0, 0])
    background = None if scene.background is None else _vector(scene.background)
    linear, opaque = _vector(color[0, 0]), float(alpha[0, 0])
    return Explanation(x, y, options.size, look.shading, tuple(samples), background, linear, opaque, (red, green, blue))


def _checked_index(value: SupportsIndex, name: str, limit: int, what: str) -> int:
    """Return a whole number within 0..limit - 1."""
    if not is_whole(value, 0, limit - 1):
        legal = f"a whole number within 0..{limit - 1}, as the picture has {limit} {what}"
        raise SceneError(f"{name} must be {legal}; given {shown(value)}")
    return int(value)


def _explain_samples(look: Look, x: int, y: int, per_axis: int) -> list[Sample]:
    """Explain the per_axis² samples of a pixel, row by row."""
    raster, lighting = spread_samples(look, per_axis)
    window = Window(x * per_axis, y * per_axis, per_axis, per_axis)
    raster = raster.within(window)
    layers: list[list[list[Layer]]] = [[[] for _ in range(per_axis)] for _ in range(per_axis)]
    through = np.ones(window.shape)
    visible = find_visible(raster)
    points = shared_points(look, raster, lighting, per_axis)
    while len((fragments := lit_fragments(visible, raster, points)).face):
        for k in range(len(fragments.face)):
            one = fragments.part(slice(k, k + 1))
            at = one.rows[0] - window.top, one.columns[0] - window.left
            layer = _explain_layer(look, one, lighting, float(through[at]))
            layers[at[0]][at[1]].append(layer)
            through[at] *= 1.0 - layer.opacity
        is_open = (visible.piece >= 0) & (through > 0)
        visible = find_visible(raster, visible._replace(key=np.where(is_open, visible.key, NO_KEY)))
    return [
        _sample((window.left + column + 0.5) / per_axis, (window.top + row + 0.5) / per_axis, layers[row][column])
        for row, column in np.ndindex(window.shape)
    ]


def _sample(x: float, y: float, layers: list[Layer]) -> Sample:
    """Put the layers of a sample on each other."""
    color = sum((layer.visible * np.array(layer.color) for layer in layers), np.zeros(3))
    return Sample(x, y, tuple(layers), _vector(color), sum(layer.visible for layer in layers))


def _explain_layer(look: Look, fragment: Fragments, lighting: Lighting, through: float) -> Layer:
    """Explain what one sample sees: `fragment` has one row, and the layers before it let `through` of it pass."""
    surface, scene = look.surface, look.scene
    face = int(surface.loaded_faces(fragment.face)[0])
    mesh_idx = int(np.searchsorted(scene.face_offsets, face, side="right")) - 1
    mesh, mesh_face = scene.meshes[mesh_idx], face - int(scene.face_offsets[mesh_idx])
    material_idx = 0 if mesh.face_material is None else int(mesh.face_material[mesh_face])
    texel = sample_textures(surface, fragment, lighting)[0]
    opacity = float(lighting.materials["opacity"][surface.material[fragment.face[0]]] * texel[3])
    points, weights, lit_at = _evaluation_points(surface, fragment, lighting)
    cue = float(cue_factors(fragment.depth, lighting)[0])
    gain = 2.0**lighting.exposure * cue
    ambients = as_rgb(ambient_light(points.material, lighting), lighting) * points.albedo * texel[:3] * gain
    emissions = as_rgb(lighting.materials["emissive"][points.material], lighting) * gain
    ambient, emission = _blend(ambients, weights), _blend(emissions, weights)
    arguments = points.positions, points.normals, points.material, lighting, points.origins, points.tangents
    lit = list(contributions(*arguments, points.metals))
    lights = _explain_lights(points, weights, lighting, lit, texel[:3] * gain, gain)
    corners, scan_line = (), None
    if lighting.shading == "gouraud":
        corners = _corner_intensities(points, lighting, lit, texel[:3] * gain, gain, ambients + emissions)
        scan_line = _scan_line(fragment.weights[0], surface.corners[fragment.face[0]], np.array(corners), lighting)
    depth_cue = (1.0 - cue) * np.array(lighting.cue.color) if lighting.cue is not None else np.zeros(3)
    color = ambient + emission + depth_cue
    for light in lights:
        color = color + np.array(light.diffuse) + np.array(light.specular)
    brush = materials_at(points.material, lighting, points.metals)[0]
    normal = points.normals[0] if lighting.shading == "flat" else sample_normals(surface, fragment)[0]
    return Layer(
        face=face, mesh=mesh_idx, mesh_face=mesh_face, mesh_name=mesh.name, material_index=material_idx,
        material=mesh.palette[material_idx], depth=float(fragment.depth[0]), weights=_vector(fragment.weights[0]),
        position=_vector(world_positions(fragment, lighting)[0]), normal=_vector(normal), lit_at=lit_at,
        corners=corners, scan_line=scan_line, opacity=opacity, visible=through * opacity, texel=_vector(texel[:3]),
        metallic=float(brush["metallic"]),
        roughness=(float(brush["roughness"]), float(brush["across"])), ambient=_vector(ambient),
        emission=_vector(emission), lights=lights, depth_cue=_vector(depth_cue), color=_vector(color),
    )  # fmt: skip


def _evaluation_points(
    surface: Surface, fragment: Fragments, lighting: Lighting
) -> tuple[Points, NDArray[np.float64], str]:
    """Return the points at which the equation is evaluated for a sample, what each counts for (n,), and where they
    are."""
    if lighting.shading == "flat":
        return (
            polygon_points(surface, surface.polygon[fragment.face], lighting),
            np.ones(1),
            "at the polygon's centroid",
        )
    if lighting.shading == "phong":
        is_shared = fragment.lit_at is not None and tuple(fragment.lit_at[0]) != _own_position(fragment)
        where = "at a point that the pixel's samples share" if is_shared else "at the sample"
        return sample_points(surface, fragment, lighting), np.ones(1), where
    ring = -1 if surface.rings is None else int(surface.rings.of_face[fragment.face[0]])
    if ring < 0:
        points = corner_points(surface, fragment.face, fragment.side, slice(None))
        return points, fragment.weights[0], "at the corners of the face"
    faces, _, count = ring_faces(surface, np.array([ring]))
    ends = corner_points(surface, fragment.face, fragment.side, slice(0, 2))
    corners = corner_points(surface, faces, np.repeat(fragment.side, count), slice(0, 1))
    weights = np.concatenate([fragment.weights[0, :2], np.full(len(faces), fragment.weights[0, 2] / len(faces))])
    return _join(ends, corners), weights, "at the corners of the polygon, whose mean is its centre"


def _own_position(fragment: Fragments) -> tuple[float, float, float]:
    """Return where the sample of a fragment itself lies: row, column, depth."""
    return float(fragment.rows[0]), float(fragment.columns[0]), float(fragment.depth[0])


def _join(a: Points, b: Points) -> Points:
    """Return the points of two lists, one behind the other."""
    return Points(
        np.concatenate([a.positions, b.positions]),
        np.concatenate([a.normals, b.normals]),
        np.concatenate([a.material, b.material]),
        np.concatenate([a.albedo, b.albedo]),
        RayOrigins(
            np.concatenate([a.origins.points, b.origins.points]), np.concatenate([a.origins.owner, b.origins.owner])
        ),
        None if a.tangents is None or b.tangents is None else np.concatenate([a.tangents, b.tangents]),
    )


def _corner_intensities(
    points: Points, lighting: Lighting, lit: list[Contribution], diffuse_gain: NDArray, gain: float, unlit: NDArray
) -> tuple[Vector, ...]:
    """Return the intensities at the three corners of a drawn triangle: of its points, the third and those behind it are
    those round a polygon, whose mean is the centre's; `unlit` (n, 3) is what needs no light."""
    total = unlit
    for each in lit:
        diffuse, specular = as_rgb(each.diffuse, lighting), as_rgb(each.specular, lighting)
        total = total + diffuse * points.albedo * diffuse_gain + specular * gain
    return _vector(total[0]), _vector(total[1]), _vector(total[2:].mean(axis=0))


def _scan_line(weights: NDArray, corners: NDArray, intensities: NDArray, lighting: Lighting) -> ScanLine | None:
    """Return how the row of a sample runs through its triangle.

    A row shows what lies in one plane through the eye, y/w constant, or without perspective y constant. So of a point
    in space y - k w, or y - k, is affine in its weights on the corners, k that of the sample; on an edge it is 0 at a
    share that the corners' values tell.
    """
    x, y, w = to_eye(corners, lighting.view).T
    if not lighting.projection.is_perspective:
        w = np.ones(3)
    if min(w) <= 0.0:
        return None
    off = y - weights @ y / (weights @ w) * w
    met = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        if (off[a] > 0.0) != (off[b] > 0.0):
            point = np.zeros(3)
            point[b] = off[a] / (off[a] - off[b])
            point[a] = 1.0 - point[b]
            met.append((point, EdgePoint((a, b), float(point[b]), _vector(point @ intensities))))
    if len(met) < 2:  # the sample lies on a corner, or outside by a rounding
        return None
    (q, left), (r, right) = sorted(met, key=lambda each: each[0] @ x / (each[0] @ w))
    along = r - q
    length = float(along @ along)
    return ScanLine(left, right, float((weights - q) @ along) / length if length > 0.0 else 0.0)


def _explain_lights(
    points: Points, weights: NDArray, lighting: Lighting, lit: list[Contribution], diffuse_gain: NDArray, gain: float
) -> tuple[LightShare, ...]:
    """Return what each light adds, of what they add to the points; `diffuse_gain` (3,) and `gain` are what both parts
    of its light are multiplied by."""
    found: dict[int, list[Contribution]] = {}
    for each in lit:
        found.setdefault(each.lamp.index, []).append(each)
    shares = []
    for index, cells in found.items():
        # What is known of the light at (cell, point), weighted: the cells of an area light count alike.
        share = np.tile(weights / len(cells), len(cells))
        n_dot_l = np.concatenate([cell.n_dot_l for cell in cells])
        facing = float(share[n_dot_l > 0].sum())
        lit = float(share[np.concatenate([cell.is_lit for cell in cells])].sum())
        direction = _blend(np.concatenate([cell.light_dirs for cell in cells]), share)
        diffuse = sum(_blend(as_rgb(cell.diffuse, lighting) * points.albedo, weights) for cell in cells) * diffuse_gain
        specular = sum(_blend(as_rgb(cell.specular, lighting), weights) for cell in cells) * gain
        shares.append(
            LightShare(
                index=index,
                kind=light_type_of(lighting.lights[index]),
                direction=_vector(direction / max(float(np.linalg.norm(direction)), np.finfo(np.float64).tiny)),
                n_dot_l=float(share @ n_dot_l),
                attenuation=float(share @ np.concatenate([cell.attenuation for cell in cells])),
                unshadowed=lit / facing if facing > 0 else 1.0,
                diffuse=_vector(diffuse),
                specular=_vector(specular),
            )
        )
    return tuple(shares)


def _blend(values: NDArray, weights: NDArray) -> NDArray[np.float64]:
    """Return the weighted sum (k,) of values (n, k)."""
    return weights @ values


def _vector(values) -> Vector:
    """Return three numbers as floats."""
    a, b, c = (float(value) for value in values)
    return a, b, c


# --- the text that a person reads ----------------------------------------------------------------------------


def _describe_sample(sample: Sample) -> list[str]:
    """Return the lines about one sample."""
    where = f"sample at {sample.x:g}, {sample.y:g} px"
    if not sample.layers:
        return [f"{where}: nothing is seen here but the background"]
    n_layer = counted(len(sample.layers), "layer")
    lines = [f"{where}: {n_layer}, alpha {sample.alpha:.6g}, premultiplied {_numbers(sample.color)}"]
    for number, layer in enumerate(sample.layers, 1):
        lines += [f"  {line}" for line in _describe_layer(number, layer)]
    return lines


def _describe_layer(number: int, layer: Layer) -> list[str]:
    """Return the lines about one layer: what is seen, where it is, and what each light adds."""
    name = f" {layer.mesh_name!r}" if layer.mesh_name else ""
    material = f" {layer.material.name!r}" if layer.material.name else ""
    mesh = f"mesh {layer.mesh}{name}"
    lines = [
        f"{number}. face {layer.face}: face {layer.mesh_face} of {mesh}, material {layer.material_index}{material}",
        f"   {_describe_material(layer)}",
        f"   depth {layer.depth:.9g}, weights {_numbers(layer.weights)}",
        f"   position {_numbers(layer.position)}, normal {_numbers(layer.normal)}",
        f"   opacity {layer.opacity:.6g}, visible {layer.visible:.6g}, texel {_numbers(layer.texel)}",
        f"   lit {layer.lit_at}",
        *_describe_corners(layer),
        f"   {'ambient':<22}{_numbers(layer.ambient)}",
        f"   {'emission':<22}{_numbers(layer.emission)}",
    ]
    for light in layer.lights:
        lines += [
            f"   {f'{light.index} {light.kind}':<22}to {_numbers(light.direction)}, N.L {light.n_dot_l:.6g}, "
            f"attenuation {light.attenuation:.6g}, unshadowed {light.unshadowed:.6g}",
            f"   {'':<22}diffuse {_numbers(light.diffuse)}, specular {_numbers(light.specular)}",
        ]
    if any(layer.depth_cue):
        lines.append(f"   {'depth cue':<22}{_numbers(layer.depth_cue)}")
    return [*lines, f"   {'sum':<22}{_numbers(layer.color)}"]


def _describe_corners(layer: Layer) -> list[str]:
    """Return the lines about what Gouraud's method interpolates, in the letters of the textbooks."""
    if not layer.corners:
        return []
    names = "ABC"
    at = ", ".join(f"I_{name} {_light(corner)}" for name, corner in zip(names, layer.corners, strict=True))
    sum_of = " + ".join(f"{weight:.6g} I_{name}" for name, weight in zip(names, layer.weights, strict=True))
    color = _vector(np.array(layer.weights) @ np.array(layer.corners))
    lines = [f"   {'corners':<22}{at}", f"   {'':<22}I_P = {sum_of} = {_light(color)}"]
    if layer.scan_line is not None:
        ends = []
        for name, (edge, share, intensity) in zip("QR", layer.scan_line[:2], strict=True):
            a, b = (names[corner] for corner in edge)
            ends.append(f"I_{name} = {share:.6g} I_{b} + {1 - share:.6g} I_{a} = {_light(intensity)}")
        v = layer.scan_line.share
        lines += [f"   {'along the row':<22}{ends[0]}", f"   {'':<22}{ends[1]}"]
        lines.append(f"   {'':<22}I_P = {v:.6g} I_R + {1 - v:.6g} I_Q = {_light(color)}")
    return lines


def _light(color: Vector) -> str:
    """Return a colour, or one number where it is grey."""
    return f"{color[0]:.6g}" if color[0] == color[1] == color[2] else _numbers(color)


def _describe_material(layer: Layer) -> str:
    """Return the numbers of a layer's material that its reflection model uses, as they are there."""
    material = layer.material
    along, across = layer.roughness
    numbers = {key: getattr(material, key) for key in ("ambient", "diffuse", "specular", "emissive")}
    numbers |= {
        "lambert": {},
        "oren-nayar": {"roughness": along},
        "cook-torrance": {
            "roughness": along if along == across else layer.roughness,
            "fresnel": material.fresnel,
            "metallic": layer.metallic,
            "metal": material.metal_color,
        },
        "toon": {"shininess": material.shininess, "levels": material.levels},
    }.get(material.reflection, {"shininess": material.shininess})
    return f"reflection {material.reflection}: " + ", ".join(f"{key} {_shown(value)}" for key, value in numbers.items())


def _shown(value: object) -> str:
    """Return a number, three of them, or anything else as short text."""
    if isinstance(value, tuple):
        return _numbers(value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _numbers(values: tuple[float, ...]) -> str:
    """Return numbers in brackets, six digits each."""
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"
