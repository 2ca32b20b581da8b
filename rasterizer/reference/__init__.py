"""The judge: the same pictures in plain numpy float64 and Python integers, slowly, by code of its own.

It shares with the fast way the scene as it is loaded and checked, averaged normals and their creases
(geometry/normals.py), and the decision which polygons are convex (geometry/polygons.py).

    picture      which face each sample sees, layer behind layer; samples to pixels
    clip         near plane, limits of the screen
    light        where the illumination equation is evaluated, and the equation
    lamp         what arrives of each light
    shadow       rays to the lights
    tangent      along which directions materials are brushed
    reflection   the models of reflection
    texture      what a picture on the surface shows
"""

from .picture import Picture, coverage, render

__all__ = ["Picture", "coverage", "render"]
