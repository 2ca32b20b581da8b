"""Read the objects of an OBJ file that is sound, triangle by triangle, as the naive twin of the reader."""

import numpy as np

from rasterizer.scene.triangulation import cut_polygons


def naive_read(text):
    """Read OBJ text line by line; return for each object its name and the points, normals ... of its triangles."""
    v, vn, vt, parts = [], [], [], {}
    material, group, part_name = "", 0, (0, "")
    for line in text.splitlines():
        key, *words = line.split()
        if key == "v":
            v.append([float(word) for word in words])
        elif key == "vn":
            vn.append([float(word) for word in words])
        elif key == "vt":
            vt.append([float(word) for word in words])
        elif key == "o":
            part_name = (part_name[0] + 1, words[0])
        elif key == "usemtl":
            material = words[0]
        elif key == "s":
            group = 0 if words[0] == "off" else int(words[0])
        elif key == "f":
            empty = {"points": [], "normals": [], "uv": [], "groups": [], "polygons": [], "materials": [], "n": 0}
            part = parts.setdefault(part_name, empty)
            corners = [naive_corner(word, v, vt, vn) for word in words]
            points = np.array([corner[0] for corner in corners], float)
            places = np.arange(len(words))
            cut = cut_polygons(points, places, [len(words)]).of_corners(places).tolist()
            for triangle in cut:
                part["points"].append([corners[k][0] for k in triangle])
                part["normals"].append([corners[k][1] for k in triangle])
                part["uv"].append([corners[k][2] for k in triangle])
                part["materials"].append(material)
                part["groups"].append(group)
                part["polygons"].append(part["n"])
            part["n"] += 1
    return [(name, part) for (_, name), part in parts.items()]


def naive_corner(word, v, vt, vn):
    indices = [int(index) if index else 0 for index in (word + "//").split("/")[:3]]
    point = v[indices[0] - 1 if indices[0] > 0 else indices[0]]
    normal = vn[indices[2] - 1 if indices[2] > 0 else indices[2]] if indices[2] else None
    uv = vt[indices[1] - 1 if indices[1] > 0 else indices[1]][:2] if indices[1] else None
    return point, normal, uv
