"""What `explain` says about a pixel: frozen records, and the text that a person reads.

Every share of light is linear RGB, as it comes out of its layer: textures, vertex colours, exposure and depth cue are
in it. So a layer's colour is the sum of its shares, and a sample's colour the sum of its layers' colours, each times
`visible`.
"""

from dataclasses import dataclass

from ..errors import counted
from ..scene.material import Material

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class LightShare:
    """What one light adds to a layer.

    Where the equation is evaluated at several points (the corners of a face with Gouraud's method, the cells of an area
    light), direction, n_dot_l, attenuation and unshadowed are means over them, weighted as the shares are.

    Attributes
    ----------
    index : number of the light in the scene
    kind : its class, as "PointLight"
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
    opacity : of the material, times that of the texel
    visible : part of this layer's colour that is seen: its opacity, times what the layers before it let through
    texel : linear RGB of the texture, 1 without one
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
    opacity: float
    visible: float
    texel: Vector
    ambient: Vector
    emission: Vector
    lights: tuple[LightShare, ...]
    depth_cue: Vector
    color: Vector


@dataclass(frozen=True)
class Sample:
    """One sample of a pixel.

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


@dataclass(frozen=True)
class Explanation:
    """Why a pixel is what it is; `str` writes it for a person.

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
    way : how the fast way draws the nearest surface; None where nobody asked
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
    way: str | None = None

    @property
    def layers(self) -> tuple[Layer, ...]:
        """The layers of the sample nearest to the pixel's centre; of equally near ones the first."""
        return min(self.samples, key=lambda s: (s.x - self.x - 0.5) ** 2 + (s.y - self.y - 0.5) ** 2).layers

    def __str__(self) -> str:
        n = len(self.samples)
        width, height = self.size
        lines = [f"pixel ({self.x}, {self.y}) of {width} x {height}, {self.shading} shading, {counted(n, 'sample')}"]
        if self.way is not None:
            lines.append(f"drawn by: {self.way}")
        for sample in self.samples:
            lines += _describe_sample(sample)
        lines.append("background: " + ("transparent" if self.background is None else _numbers(self.background)))
        mean = " (mean of the samples)" if n > 1 else ""
        code = "".join(f"{value:02x}" for value in self.rgb)
        lines.append(f"linear {_numbers(self.linear)}, alpha {self.alpha:.6g}{mean}; sRGB {self.rgb}, #{code}")
        return "\n".join(lines)

    __repr__ = __str__


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
        f"   {_describe_material(layer.material)}",
        f"   depth {layer.depth:.9g}, weights {_numbers(layer.weights)}",
        f"   position {_numbers(layer.position)}, normal {_numbers(layer.normal)}",
        f"   opacity {layer.opacity:.6g}, visible {layer.visible:.6g}, texel {_numbers(layer.texel)}",
        f"   lit {layer.lit_at}",
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


def _describe_material(material: Material) -> str:
    """Return the numbers of a material that its reflection model uses."""
    numbers = {key: getattr(material, key) for key in ("ambient", "diffuse", "specular", "emissive")}
    numbers |= {
        "lambert": {},
        "oren-nayar": {"roughness": material.roughness},
        "cook-torrance": {"roughness": material.roughness, "fresnel": material.fresnel},
        "toon": {"shininess": material.shininess, "levels": material.levels},
    }.get(material.reflection, {"shininess": material.shininess})
    return f"{material.reflection}: " + ", ".join(f"{key} {_shown(value)}" for key, value in numbers.items())


def _shown(value: object) -> str:
    """Return a number, three of them, or anything else as short text."""
    if isinstance(value, tuple):
        return _numbers(value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _numbers(values: tuple[float, ...]) -> str:
    """Return numbers in brackets, six digits each."""
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"
