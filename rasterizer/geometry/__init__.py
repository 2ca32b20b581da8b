"""From meshes to points and triangles: polygons cut, vertices split at creases, normals, edges, subdivision.

It knows scenes and arrays, and no files. `points.gather_geometry` is what pictures are drawn from.
"""
