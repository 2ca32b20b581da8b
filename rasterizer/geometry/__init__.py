"""From meshes to points and triangles: concave polygons cut, vertices split at creases, normals, edges, subdivision.

It knows meshes and arrays, and no files.

    weld, equal_rows    equal vertices are joined, so that normals have no seams; equal rows of arrays
    points              all meshes of a scene as one set of arrays: what pictures are drawn from
    normals             normals of polygons and vertices, averaged up to the creases
    ears                concave polygons cut into triangles
    edges               the edges of polygons: creases, borders, silhouettes
    closed              closed bodies, and which side of their triangles looks inwards
    surfaces            what is measured of the triangles once: areas, planes, distances to lights
    subdivide           every triangle becomes four
    vectors             vector algebra on tuples, for compiled code
"""
