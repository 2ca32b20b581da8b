"""What is drawn: a scene of meshes, lights, a camera and a background, as frozen dataclasses that check what they get.

A scene is data. It is made, checked and pickled without the compiler, and imports nothing that reads files or draws.
What it offers and higher layers do is loaded by name where it is called: `geometry` cuts the ears of concave polygons,
computes normals that are given as 0, and subdivides; `io` reads and writes scene files.
"""
