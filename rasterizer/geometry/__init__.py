"""What is computed of a mesh: concave polygons cut, vertices split at creases, normals, edges, subdivision.

It knows arrays, and neither scenes nor files.

    weld, equal_rows    equal vertices are joined, so that normals have no seams; equal rows of arrays
    normals             normals of polygons and vertices, averaged up to the creases
    ears                concave polygons cut into triangles
    edges               the edges of polygons: creases, borders, silhouettes
    closed              closed bodies, and which side of their triangles looks inwards
    surfaces            what is measured of the triangles once: areas, planes, distances to lights
    subdivide           every triangle becomes four
    vectors             vector algebra on tuples, for compiled code
"""
