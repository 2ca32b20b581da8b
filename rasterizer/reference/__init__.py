"""The reference: the same pictures in plain numpy float64 and Python integers, slowly, by code of its own.

It shares with the fast path the scene as it is loaded and checked, and with it the triangles that concave polygons are
cut into; nothing that is compiled. The modules in the order in which a polygon passes through them:

    surface      the faces of a scene, corner by corner            normals    of the corners, up to the creases
    closed       the sides of faces that nobody outside sees
    clip         near plane, limits of the screen, its grid
    visibility   which surface each sample sees, layer behind layer
    textures     what a texture shows at a point                 cut_outs   where a face is not there
    shading      where the illumination equation is evaluated
    light        the equation                                      lamp, shadow, reflection    its terms
    picture      layers put on each other; samples to pixels       buffers    of the nearest surface
    edges        drawn over it, on the surfaces that are seen
    explain      one pixel, with the share of every light, in words

vectors holds the vector algebra of all of them.
"""

from .picture import Picture, render
from .visibility import coverage

__all__ = ["Picture", "coverage", "render"]
