"""How far a surface bends, as an output buffer: one number a vertex, interpolated."""

import numpy as np

from rasterizer import registries


class Curvature(registries.CustomBuffer):
    """Gaussian curvature: what the angles of the faces round a vertex lack of a full turn, over a third of their area.

    Source: Meyer, Desbrun, Schröder & Barr 2003, VisMath III, 35-57, section 4. At a border the full turn is a half.
    """

    holds = "Gaussian curvature, 1/(scene unit)²"

    def values(self, mesh):
        corners, n = mesh.vertices[mesh.faces], len(mesh.vertices)
        sides = np.roll(corners, -1, axis=1) - corners  # from each corner to the next one
        lengths = np.linalg.norm(sides, axis=2)
        cosines = -(sides * np.roll(sides, 1, axis=1)).sum(axis=2) / (lengths * np.roll(lengths, 1, axis=1))
        areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
        edges = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
        edges, count = np.unique(edges, axis=0, return_counts=True)
        turn = np.full(n, 2 * np.pi)
        turn[edges[count == 1]] = np.pi
        angle = np.bincount(mesh.faces.ravel(), np.arccos(np.clip(cosines, -1, 1)).ravel(), n)
        area = np.bincount(mesh.faces.ravel(), np.repeat(areas, 3), n) / 3
        return (turn - angle) / np.where(area > 0, area, 1)

    def reference_values(self, mesh):
        """Vertex by vertex, with the angles by the arc tangent."""
        found = np.zeros(len(mesh.vertices))
        for vertex in range(len(found)):
            angle, area, ends = 0.0, 0.0, []
            for face in mesh.faces[(mesh.faces == vertex).any(axis=1)]:
                k = int(np.flatnonzero(face == vertex)[0])
                b, c = face[(k + 1) % 3], face[(k + 2) % 3]
                u, v = mesh.vertices[b] - mesh.vertices[vertex], mesh.vertices[c] - mesh.vertices[vertex]
                twice = np.linalg.norm(np.cross(u, v))
                angle, area, ends = angle + np.arctan2(twice, u @ v), area + twice / 6, [*ends, b, c]
            is_border = any(ends.count(end) == 1 for end in ends)
            found[vertex] = ((np.pi if is_border else 2 * np.pi) - angle) / area
        return found
