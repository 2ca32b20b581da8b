"""Small models as the bytes of files, for the tests of loading."""

import base64
import json

import trimesh

PLY_HEADER = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face {n_face}
property list uchar int vertex_indices
{face_properties}end_header
0 0 0
1 0 0
1 1 0
0 1 0
"""


def box():
    return trimesh.creation.box(extents=(1, 2, 3))


def exported(geometry, format, **options) -> bytes:
    data = geometry.export(file_type=format, **options)
    return data.encode() if isinstance(data, str) else data


def embedded_gltf(scene) -> dict:
    """Return the tree of a glTF file that holds its own buffers."""
    files = scene.export(file_type="gltf")
    tree = json.loads(files["model.gltf"])
    for buffer in tree["buffers"]:
        data = base64.b64encode(files[buffer["uri"]]).decode()
        buffer["uri"] = f"data:application/octet-stream;base64,{data}"
    return tree


def gltf_with(change) -> bytes:
    """Return a glTF box whose tree has been changed."""
    tree = embedded_gltf(trimesh.Scene(box()))
    change(tree, tree["meshes"][0]["primitives"][0])
    return json.dumps(tree).encode()


GLB = exported(trimesh.Scene(box()), "glb", include_normals=False)
