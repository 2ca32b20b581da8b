"""What is drawn: a scene of meshes, lights, a camera and a background, as frozen dataclasses that check what they get.

A scene is data. It is made, checked and pickled without the compiler, and imports nothing that reads files or draws.
What it offers and higher layers do is loaded by name where it is called: `geometry` cuts the ears of concave polygons,
computes normals that are given as 0, and subdivides; `io` reads and writes scene files.

    scene               Scene: meshes, lights, a camera, a background, a depth cue
    mesh                Mesh: vertices, triangles and what belongs to them
    mesh_arrays         its arrays, checked
    foreign             meshes of trimesh, PyVista, VTK, Open3D and meshio
    of_gltf, of_mtl     what glTF and MTL say of surfaces, lights and cameras, in our terms
    triangulation       polygons cut into triangles
    material            Material, the reflection models, and the table of named materials
    texture             Texture, with its mipmaps
    lights              the types of light, their shadows, and ready-made sets
    camera              Camera: view, projection, OpenCV, one that goes round, and random ones
    framing             the smallest view that shows every vertex; which axis of a model points upwards, by its shape
    random_numbers      random numbers by a seed, the same everywhere
    color               what a person writes becomes linear RGB
    spectrum            Spectrum, with the standard observer and daylight, whose tables are cie_tables.txt
    arrays              arrays as callers give them, and as a scene keeps them
    validate            checks that the dataclasses share
"""
