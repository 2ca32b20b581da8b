"""How far a surface bends, as an output buffer: one number a vertex, interpolated."""

import numpy as np

from rasterizer import registries


class Curvature(registries.CustomBuffer):
    """The angle that the faces round a vertex lack of a full turn: the Gaussian curvature, summed up round it."""

    holds = "angle defect, radians"

    def values(self, mesh):
        corners = mesh.vertices[mesh.faces]
        u, v = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
        cosines = (u * v).sum(axis=2) / np.linalg.norm(u, axis=2) / np.linalg.norm(v, axis=2)
        angles = np.arccos(np.clip(cosines, -1, 1))
        return 2 * np.pi - np.bincount(mesh.faces.ravel(), angles.ravel(), len(mesh.vertices))

    def reference_values(self, mesh):  # in another way: face by face, by the arc tangent
        found = np.full(len(mesh.vertices), 2 * np.pi)
        for face in mesh.faces:
            for k in range(3):
                a, b, c = mesh.vertices[np.roll(face, -k)]
                found[face[k]] -= np.arctan2(np.linalg.norm(np.cross(b - a, c - a)), (b - a) @ (c - a))
        return found
