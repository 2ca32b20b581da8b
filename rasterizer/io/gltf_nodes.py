"""Lights and cameras of a glTF file, placed by the nodes that hold them.

A node's matrix is that of its parents times its own; a light shines and a camera looks down -z of its node, with +y up.

    KHR_lights_punctual   color · intensity is the intensity here, a plain number: candela (point, spot) and lux
                          (directional) are not converted; a white diffuse surface under 1 lux of directional light has
                          the value 1
    point, spot           get weaker with 1/d², also nearer than 1 (`amplify`), and end at `range` where the file has
                          one
    spot                  innerConeAngle and outerConeAngle in radians, half angles
    camera                perspective: yfov (radians, vertical), znear, zfar; orthographic: the picture is 2·ymag high;
                          aspectRatio and xmag are those of the picture that is asked for

Sources: Khronos, glTF 2.0 Specification, 2021, 3.5 and 3.10; KHR_lights_punctual.
"""

import math

import numpy as np

from ..errors import SceneError
from ..scene.camera import Camera
from ..scene.lights import DirectionalLight, PointLight, SpotLight
from .gltf_arrays import item
from .model_file import ModelFile

_LIGHTS = "KHR_lights_punctual"
_INVERSE_SQUARE = (0.0, 0.0, 1.0)


def read_lights_and_camera(model: ModelFile, tree: dict) -> tuple[tuple | None, Camera | None]:
    """Return the lights of a file's scene in the order of its nodes, and its first camera; None for what it hasn't.

    Parameters
    ----------
    model : ModelFile, for messages
    tree : dict, the file's JSON tree

    Raises
    ------
    ModelError : a light or camera that is not legal; the message names it
    TypeError, AttributeError, LookupError, ValueError : a tree that is none of glTF
    """
    nodes = tree.get("nodes", [])
    places = world_matrices(tree)
    sources = tree.get("extensions", {}).get(_LIGHTS, {}).get("lights", [])
    lights, camera = [], None
    for number, matrix in sorted(places.items(), key=lambda item: item[0]):
        node = nodes[number]
        light = node.get("extensions", {}).get(_LIGHTS, {}).get("light")
        if light is not None:
            lights.append(_made(model, "light", light, sources, _light, matrix))
        if camera is None and "camera" in node:
            camera = _made(model, "camera", node["camera"], tree.get("cameras", []), _camera, matrix)
    return tuple(lights) or None, camera


def world_matrices(tree: dict) -> dict[int, np.ndarray]:
    """Return world-from-node matrices (4, 4) float64 by the numbers of the nodes that the file's scene shows.

    A file without scenes shows all its nodes.
    """
    if tree.get("scenes"):
        roots = item(tree, "scenes", tree.get("scene", 0)).get("nodes", [])
    else:
        children = {child for node in tree.get("nodes", []) for child in node.get("children", [])}
        roots = [number for number in range(len(tree.get("nodes", []))) if number not in children]
    found, open_nodes = {}, [(number, np.eye(4)) for number in roots]
    while open_nodes:
        number, parent = open_nodes.pop()
        node = item(tree, "nodes", number)
        if number in found:  # not legal; the first place counts
            continue
        with np.errstate(all="ignore"):  # what is not finite is refused where something stands there
            found[number] = parent @ _own_matrix(node)
        open_nodes += [(child, found[number]) for child in node.get("children", [])]
    return found


def _own_matrix(node) -> np.ndarray:
    """Return a node's parent-from-node matrix: given as a whole, or as translation, rotation (x, y, z, w) and scale."""
    if "matrix" in node:
        return np.reshape(np.asarray(node["matrix"], np.float64), (4, 4)).T
    x, y, z, w = (float(value) for value in node.get("rotation", (0, 0, 0, 1)))
    length = math.sqrt(x * x + y * y + z * z + w * w) or 1.0
    x, y, z, w = x / length, y / length, z / length, w / length
    # Rotation by a unit quaternion: Shoemake 1985, Animating rotation with quaternion curves, SIGGRAPH.
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = turn * np.asarray(node.get("scale", (1, 1, 1)), np.float64)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def _made(model, kind, number, sources, make, matrix):
    """Make a light or camera; its faults become errors that name it."""
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < len(sources):
        raise model.error(f"a node refers to {kind} {number!r}; the file has {len(sources)}")
    source = sources[number]
    label = f"{kind} {number}" + (f" '{source['name']}'" if source.get("name") else "")
    try:
        return make(source, matrix)
    except KeyError as fault:
        raise model.error(f"{label}: {fault.args[0]} is missing") from fault
    except (SceneError, TypeError, ValueError) as fault:
        raise model.error(f"{label}: {fault}") from fault


def _light(source, matrix):
    """Make a light of its description and its node's matrix."""
    strength = source.get("intensity", 1.0)
    color = tuple(float(component) * float(strength) for component in source.get("color", (1.0, 1.0, 1.0)))
    way, place = tuple((-matrix[:3, 2]).tolist()), tuple(matrix[:3, 3].tolist())
    kind = source["type"]
    if kind == "directional":
        return DirectionalLight(way, color)
    fall = {"attenuation": _INVERSE_SQUARE, "amplify": True, "range": source.get("range")}
    if kind == "point":
        return PointLight(place, color, **fall)
    if kind == "spot":
        cone = source.get("spot", {})
        inner = math.degrees(float(cone.get("innerConeAngle", 0.0)))
        outer = float(cone.get("outerConeAngle", math.pi / 4))
        if np.float32(outer) == np.float32(math.pi / 2):  # float32 rounds the largest legal angle up
            outer = math.pi / 2
        outer = math.degrees(outer)
        return SpotLight(place, way, color, inner, outer, **fall)
    raise ValueError(f"its type must be directional, point or spot; given {kind!r}")


def _camera(source, matrix) -> Camera:
    """Make a camera of its description and its node's matrix, whose scale doesn't count."""
    eye, up, forward = matrix[:3, 3], matrix[:3, 1], -matrix[:3, 2]
    length = float(np.linalg.norm(forward))
    if not length > 0.0:
        raise ValueError("its node's matrix leaves it no direction")
    # A target about as far away as the eye is from the origin keeps every digit of the direction.
    target = eye + forward / length * max(1.0, float(np.abs(eye).max()))
    kind = source["type"]
    frame = {"position": eye.tolist(), "target": target.tolist(), "up": up.tolist()}
    if kind == "perspective":
        lens = source["perspective"]
        return Camera(fov=math.degrees(float(lens["yfov"])), near=lens["znear"], far=lens.get("zfar"), **frame)
    if kind == "orthographic":
        lens = source["orthographic"]
        return Camera(height=2.0 * float(lens["ymag"]), near=lens["znear"], far=lens["zfar"], **frame)
    raise ValueError(f"its type must be perspective or orthographic; given {kind!r}")
