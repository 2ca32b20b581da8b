"""The reference: the same pictures in plain numpy float64 and Python integers, slowly, by code of its own.

It shares with the fast way the scene as it is loaded and checked, and with it the triangles that concave polygons are
cut into; nothing that is compiled. The modules in the order of a polygon's way:

    surface      the faces of a scene, corner by corner        creases, polygons, tangents    what their corners carry
    clip         near plane, limits of the screen
    cover        which samples a triangle covers
    visibility   which surface each sample sees, layer behind layer
    shading      where the illumination equation is evaluated
    light        the equation                                  materials, lamp, shadow, reflection, texture    its terms
    picture      layers put on each other; samples to pixels
    edges        drawn over it, on the surfaces that are seen
    explaining   one pixel, with the share of every light     explanation    what is said of it

vectors holds the vector algebra of all of them.
"""

from .picture import Picture, render
from .visibility import coverage

__all__ = ["Picture", "coverage", "render"]
