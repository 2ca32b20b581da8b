"""The look of pictures where no flag asks for another: a model on a tabletop.

A grey that is dark enough for highlights to be seen, a key light that casts shadows, and a ground that shows nothing
but a soft shadow. What a file says of its materials, lights and background stays as it is.
"""

from dataclasses import replace

from ..scene.material import Material
from ..scene.scene import Scene

NEUTRAL = 0.5  # the default material's diffuse reflection coefficient


def wants_tabletop(arguments) -> bool:
    """Tell whether models that bring no lights are put on the tabletop."""
    if arguments.preset is not None:
        return arguments.preset == "tabletop"
    return not arguments.lights and arguments.default_preset == "tabletop"


def with_neutral_grey(scene: Scene) -> Scene:
    """Return a scene that is darker where its file names no material."""
    return replace(scene, meshes=tuple(_neutral(mesh) for mesh in scene.meshes))


def _neutral(mesh):
    """The mesh, with a darker grey where its file names no material; of a material that a library didn't have, the
    name is kept."""
    default = Material()
    grey = replace(default, diffuse=NEUTRAL, ambient=NEUTRAL)
    palette = [
        replace(grey, name=material.name) if material == replace(default, name=material.name) else material
        for material in mesh.palette
    ]
    if palette == list(mesh.palette):
        return mesh
    return replace(mesh, material=palette[0], **({} if mesh.materials is None else {"materials": tuple(palette)}))
