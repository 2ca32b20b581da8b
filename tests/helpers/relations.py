"""A campaign beside the campaign: relations between pictures of random scenes that have everything together.

    export PYTHONPATH=.:tests
    python -m helpers.relations SEED INDEX          one scene, and which relations don't hold
    python -m helpers.relations SEED FIRST STOP     a range of scenes

Each relation tells a scene in another way and says what its picture must be: the same bytes; or where other sums are
rounded, the same within both stated bounds. No reference is asked but where a difference is found.
"""

import json
import sys
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
from PIL import Image

import rasterizer as rz
from helpers.against_reference import depth_resolution
from helpers.campaign import EDGES, LABELS, ROUNDED, all_clear, has_shadows, is_opaque, next_to_step
from helpers.campaign_scenes import Case, make_case, make_texture
from helpers.pinhole import unit
from rasterizer import reference
from rasterizer.choices import BUFFERS
from rasterizer.geometry.normals import split_creases

MAX_LIGHTS = 60  # cells of area lights count one by one; with more, a small picture takes a second
PIXELS = ("color", "alpha", "rgb")
ARRAYS = (*PIXELS, *BUFFERS)


class Twin(NamedTuple):
    """What another picture says about that of a scene."""

    arrays: dict  # by their names: what the scene's own picture should have
    frame: rz.Frame
    is_exact: bool = True  # the same bytes; else what bounds leave
    n_left_out: int = 0  # pixels, at most: on an edge, which belongs to what lies to its right in a mirror, too
    part: tuple = (slice(None), slice(None))  # rows and columns of the scene's own picture
    of: rz.Frame | None = None  # what it is compared with, if not the scene's own picture


# ── scenes that have everything ────────────────────────────────────────────────────────────────────────────


def make_full_case(seed: int, index: int) -> Case:
    """Make a scene of the campaign with more in it: an instance, a polygon that is clipped, glass, textures, shadows,
    vertex colours, edges, and four samples."""
    case, rng = make_case(seed, index), np.random.default_rng((seed, index, 1))
    scene, options, words = case.scene, dict(case.options), [case.words]

    def chance(share, word) -> bool:
        is_it = bool(rng.random() < share)
        words.extend([word] * is_it)
        return is_it

    meshes = list(scene.meshes)
    if chance(0.3, "textured") and meshes[0].material.texture is None and len(meshes[0].palette) == 1:
        corners = (meshes[0].n_face, 3, 2) if chance(0.5, "corners' uv") else (meshes[0].n_vertex, 2)
        meshes[0] = replace(meshes[0], uv=rng.normal(0.5, 2.0, corners))
        meshes[0] = replace(meshes[0], material=replace(meshes[0].material, texture=make_texture(rng)))
    if chance(0.3, "coloured") and meshes[0].face_colors is None:
        meshes[0] = replace(meshes[0], colors=rng.random((meshes[0].n_vertex, 3)))
    if chance(0.5, "instance"):
        extent = np.ptp(meshes[0].bounds, axis=0).max()
        moved = meshes[0].rotated(float(rng.uniform(0, 360)), "xyz"[rng.integers(3)])
        meshes.append(moved.translated(0.3 * extent * rng.normal(size=3)))
    if chance(0.4, "glass"):
        clear = replace(meshes[-1].material, opacity=float(rng.uniform(0.2, 0.9)))
        meshes[-1] = replace(meshes[-1], material=clear, materials=None, face_material=None)
    if chance(0.3, "clipped"):
        meshes.append(clipped_polygon(scene.camera, rng))
    shadow = rz.Shadow(32, int(rng.choice([1, 3]))) if chance(0.25, "shadows") and len(scene.lights) < 5 else None
    lights = [
        replace(light, shadow=light.shadow or shadow) if hasattr(light, "shadow") else light for light in scene.lights
    ]
    options["edges"] = EDGES[rng.integers(len(EDGES))] if chance(0.3, "edges") else ()
    options["edge_width"], options["edge_color"] = float(rng.uniform(0.5, 3)), tuple(rng.random(3))
    options["samples"] = 4 if chance(0.4, "4 samples") else 1
    size = (53, 41) if chance(0.1, "large") else case.size  # so that threads have bands of several rows
    options |= {"ground": True} if chance(0.06, "ground") else {}
    scene = replace(scene, meshes=meshes, lights=lights)
    return case._replace(scene=scene, size=size, options=options, words=" ".join(words))


def clipped_polygon(camera, rng) -> rz.Mesh:
    """A pentagon that reaches from before the eye to behind it, or round the eye where there is no perspective."""
    eye, right, up, forward = camera.view()
    length = np.linalg.norm(np.subtract(camera.target, camera.position))
    turn = 2 * np.pi * np.arange(5) / 5
    spread = length * rng.uniform(1, 3) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    middle = eye - rng.uniform(0.1, 1) * length * up
    corners = middle + spread[:, :1] * right + spread[:, 1:] * forward
    normals = unit(up + rng.normal(0, 0.2, (5, 3)))
    return rz.Mesh(corners, [[0, 1, 2, 3, 4]], normals=normals, material=rz.Material(diffuse=tuple(rng.random(3))))


def is_small(case) -> bool:
    """Tell whether a picture takes no time."""
    return sum(getattr(light, "n_cell", 1) for light in case.scene.lights) <= MAX_LIGHTS


# ── pictures ───────────────────────────────────────────────────────────────────────────────────────────────


def draw(case, **others) -> rz.Frame:
    """Draw a case with all outputs."""
    with rz.Renderer(case.scene, case.size, **arguments(case, **others)) as renderer:
        return renderer.render()


def arguments(case, **others) -> dict:
    """Options of a case's picture."""
    return {"outputs": ("color", *BUFFERS), "threads": 1} | case.options | others


def arrays_of(frame, names=ARRAYS) -> dict:
    """What a frame shows, by name."""
    return {name: getattr(frame, name) for name in names}


# ── relations: the same bytes ──────────────────────────────────────────────────────────────────────────────


def threads(case, rng, folder):
    """Any number of threads."""
    frame = draw(case, threads=int(rng.integers(2, 8)))
    return Twin(arrays_of(frame), frame)


def repeated(case, rng, folder):
    """The second picture of a Renderer, after that of another camera."""
    with rz.Renderer(case.scene, case.size, **arguments(case)) as renderer:
        renderer.render(rz.Camera.framing(case.scene, azimuth=float(rng.uniform(0, 360))))
        frame = renderer.render()
    return Twin(arrays_of(frame), frame)


def fewer_outputs(case, rng, folder):
    """Some outputs alone."""
    names = [str(name) for name in rng.choice(("color", "rgb", *BUFFERS), rng.integers(1, 4), replace=False)]
    frame = draw(case, outputs=names)
    return Twin(arrays_of(frame, [*names, *(("alpha",) if "color" in names else ())]), frame)


def called(case, rng, folder):
    """By `render`."""
    frame = rz.render(case.scene, case.size, **arguments(case))
    return Twin(arrays_of(frame), frame)


def saved(case, rng, folder):
    """From a scene file."""
    path = Path(folder) / "scene.json"
    frame = draw(case._replace(scene=rz.load(rz.save(case.scene, path))))
    return Twin(arrays_of(frame), frame)


def black_light(case, rng, folder):
    """With a light that gives none."""
    lights = list(case.scene.lights)
    lights.insert(int(rng.integers(len(lights) + 1)), rz.DirectionalLight(unit(rng.normal(size=3)), 0.0))
    frame = draw(case._replace(scene=replace(case.scene, lights=lights)))
    return Twin(arrays_of(frame), frame)


def without_area(case, rng, folder):
    """With a face without an area, last in a mesh."""
    mesh = case.scene.meshes[-1]
    if mesh.polygons is not None or case.options["edges"]:
        return None
    mesh = with_faces(mesh, [*range(mesh.n_face), int(rng.integers(mesh.n_face))])
    faces = mesh.faces.copy()
    faces[-1] = faces[-1, 0]
    frame = draw(with_meshes(case, [*case.scene.meshes[:-1], replace(mesh, faces=faces)]))
    return Twin(arrays_of(frame), frame)


def frozen(case, rng, folder):
    """With normals that are given as they are computed, and no vertex shared."""
    if not can_freeze(case):
        return None
    frame = draw(with_meshes(case, [unshared(freeze(mesh)) for mesh in case.scene.meshes]), edges=())
    return Twin(arrays_of(frame), frame, of=draw(case, edges=()))  # an edge that nobody shares is drawn from both sides


def split(case, rng, folder):
    """Every mesh as two. Shadow maps are fitted to the meshes' boxes, tangents are means over a mesh, and of halves no
    body is closed."""
    if not can_freeze(case) or case.options["edges"] or has_tangents(case) or has_shadows(case.scene):
        return None
    meshes = [*map(freeze, case.scene.meshes), corners_of(case.scene)]
    cull = {"cull": "none"} if case.options["cull"] == "auto" else {}
    frame = draw(with_meshes(case, [part for mesh in meshes for part in halves(mesh, rng)]), **cull)
    return Twin(arrays_of(frame, without("object", "material")), frame, of=draw(with_meshes(case, meshes), **cull))


def corners_of(scene) -> rz.Mesh:
    """Two small faces in opposite corners of a scene: of parts, the boxes together are smaller, and depths are fitted
    to these."""
    low, high = scene.bounds
    step = 0.01 * (high - low)
    vertices = [
        low,
        low + step * (1, 0, 0),
        low + step * (0, 1, 1),
        high,
        high - step * (1, 0, 0),
        high - step * (0, 1, 1),
    ]
    return rz.Mesh(vertices, [[0, 1, 2], [3, 4, 5]], polygons=[0, 0], material=rz.Material(diffuse=0.3))


def copies(case, rng, folder):
    """A model that a scene file places a second time, and a mesh that is moved."""
    turn = np.eye(4)
    turn[:3, :3] = rng.choice([-1.0, 1.0], 3) * np.eye(3)[rng.permutation(3)] * 2.0 ** int(rng.integers(-2, 3))
    mesh = case.scene.meshes[0]
    path = rz.save(replace(case.scene, meshes=mesh), Path(folder) / "placed.json")
    tables = json.loads(path.read_text())
    (table,) = tables["meshes"]
    tables["meshes"] = [table, table | {"transform": turn.tolist()}]
    path.write_text(json.dumps(tables))
    expected = draw(case._replace(scene=rz.load(path)))
    frame = draw(with_meshes(case, [mesh, mesh.transformed(turn)]))
    return Twin(arrays_of(frame), frame, of=expected)


def foreign(case, rng, folder):
    """A mesh of trimesh, and its file."""
    mesh = case.scene.meshes[0]
    if case.options["edges"]:
        return None
    made = trimesh_of(mesh, rng)
    kind = "glb" if made.visual.kind == "texture" else "ply"  # glTF's colours of vertices are linear
    path = Path(folder) / f"mesh.{kind}"
    path.write_bytes(made.export(file_type=kind))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what neither has
        meshes, of_file = ([*rz.load(source).meshes, *case.scene.meshes[1:]] for source in (made, path))
    frame = draw(with_meshes(case, meshes))
    return Twin(arrays_of(frame), frame, of=draw(with_meshes(case, of_file)))


def trimesh_of(mesh, rng) -> trimesh.Trimesh:
    """A Trimesh of the same shape, with normals, colours or a material of any kind, in numbers that files keep."""
    n_vertex, n_face, visual, words = mesh.n_vertex, mesh.n_face, trimesh.visual, {}
    kind = str(rng.choice(["plain", "colours", "colours of faces", "material", "texture"]))
    if rng.random() < 0.4:
        words["vertex_normals"] = np.vstack([np.eye(3), -np.eye(3)])[
            rng.integers(0, 6, n_vertex)
        ]  # exact, turned or not
    if kind == "colours":
        words["vertex_colors"] = rng.integers(0, 256, (n_vertex, 3), np.uint8)
    elif kind == "colours of faces":
        words["face_colors"] = rng.integers(0, 256, (n_face, 3), np.uint8)
    elif kind != "plain":

        def picture(n_channel):
            pixels = rng.integers(0, 256, (*rng.integers(1, 5, 2), n_channel), np.uint8)
            return Image.fromarray(pixels)

        factors = {"metallicFactor": float(rng.choice([0.0, 1.0, 0.5])), "roughnessFactor": float(rng.random())}
        factors["baseColorFactor"] = rng.integers(0, 256, 4, np.uint8)
        factors["alphaMode"] = str(rng.choice(["OPAQUE", "BLEND", "MASK"]))
        factors |= {"alphaCutoff": float(rng.random())} if factors["alphaMode"] == "MASK" else {}
        factors |= {"emissiveFactor": rng.random(3)} if rng.random() < 0.3 else {}
        if kind == "texture":
            factors["baseColorTexture"] = picture(int(rng.integers(3, 5)))
            factors |= {"metallicRoughnessTexture": picture(3)} if rng.random() < 0.4 else {}
        uv = rng.integers(-512, 513, (n_vertex, 2)) / 256.0
        words["visual"] = visual.TextureVisuals(uv=uv, material=visual.material.PBRMaterial(**factors))
    vertices = mesh.vertices.astype(np.float32).astype(float)
    return trimesh.Trimesh(vertices, mesh.faces.astype(int), process=False, **words)


def scaled(case, rng, folder):
    """In a unit that is a power of two times as long, with all lengths."""
    factor = 2.0 ** int(rng.integers(1, 13))  # towards usual units: depths are float32
    factor = factor if np.abs(case.scene.bounds).max() < 1.0 else 1.0 / factor
    scene, camera = case.scene, case.scene.camera
    lengths = {"position": 1, "target": 1, "height": 1, "near": 1, "far": 1}
    cue = scene.depth_cue
    scene = replace(
        scene,
        meshes=[replace(mesh, vertices=mesh.vertices * factor) for mesh in scene.meshes],
        lights=[times(light, factor, LIGHT_LENGTHS) for light in scene.lights],
        camera=times(camera, factor, lengths),
        depth_cue=cue and times(cue, factor, {"scale": 1, "start": 1}),
    )
    frame = draw(case._replace(scene=scene))
    arrays = arrays_of(frame)
    for name in ("depth", "position", "position_camera"):
        arrays[name] = (arrays[name] / factor).astype(np.float32)
    return Twin(arrays, frame)


LIGHT_LENGTHS = {"position": 1, "corner": 1, "edge_u": 1, "edge_v": 1, "range": 1}


def times(thing, factor, powers):
    """A light, camera or cue whose lengths are multiplied."""
    changes = {name: np.multiply(getattr(thing, name), factor) for name in powers if has(thing, name)}
    changes = {name: value.tolist() for name, value in changes.items()}
    if has(thing, "attenuation"):
        kc, kl, kq = thing.attenuation
        changes["attenuation"] = (kc, kl / factor, kq / factor**2)
    return replace(thing, **changes)


def has(thing, name) -> bool:
    """Tell whether something has a value of that name."""
    return getattr(thing, name, None) is not None


def finer(case, rng, folder):
    """The mean of a finer picture's samples."""
    n = round(case.options["samples"] ** 0.5)
    if n == 1 or case.options["edges"]:
        return None
    fine = draw(case._replace(size=(case.size[0] * n, case.size[1] * n)), samples=1, outputs="color")
    weights = blocks(fine.alpha[..., None].astype(float), n)
    means = blocks(fine.color * fine.alpha[..., None].astype(float), n) / np.maximum(weights, 1e-30)
    return Twin({"alpha": weights[..., 0], "color": means}, fine, False)


def blocks(values, n) -> np.ndarray:
    """Means of squares of n by n."""
    height, width = values.shape[0] // n, values.shape[1] // n
    return values.reshape(height, n, width, n, -1).mean(axis=(1, 3))


# ── relations: within both bounds ──────────────────────────────────────────────────────────────────────────


def face_order(case, rng, folder):
    """Polygons in another order: the same surfaces are seen, but where their depths are equal."""
    if "twins" in case.words or not can_freeze(case) or case.options["samples"] > 1:
        return None
    meshes, numbers, start = [], [], 0
    for mesh in map(freeze, case.scene.meshes):
        polygons = np.arange(mesh.n_face) if mesh.polygons is None else np.unique(mesh.polygons, return_inverse=True)[1]
        order = np.argsort(rng.permutation(polygons.max() + 1)[polygons], kind="stable")
        if (np.diff(polygons) < 0).any():  # polygons that others interrupt are drawn in another way
            order = np.arange(mesh.n_face)
        meshes.append(with_faces(mesh, order))
        numbers.append(start + order)
        start += mesh.n_face
    frame = draw(with_meshes(case, meshes))
    arrays = arrays_of(frame)
    table = np.append(np.concatenate(numbers), -1).astype(np.int32)
    arrays["face"] = table[frame.face]
    return Twin(arrays, frame, False)


def turned(case, rng, folder):
    """Turned by right angles or mirrored, the camera and all lights with it."""
    matrix = np.zeros((3, 3))
    matrix[range(3), rng.permutation(3)] = rng.choice([-1.0, 1.0], 3)
    turn, is_mirrored = np.eye(4), np.linalg.det(matrix) < 0
    turn[:3, :3] = matrix
    scene, camera = case.scene, case.scene.camera
    if np.linalg.norm(np.cross(camera.view().forward, camera.up)) < 1e-6:
        return None  # what is up is chosen by the world's axes then
    flip = np.diag([-1.0 if is_mirrored else 1.0, 1.0, 1.0])
    moved = {name: matrix @ getattr(camera, name) for name in ("position", "target", "up")}
    if is_mirrored and camera.intrinsics is not None:
        fx, fy, cx, cy = camera.intrinsics
        moved |= {"intrinsics": (fx, fy, camera.size[0] - 1 - cx, cy), "skew": -camera.skew}
    lights = [turned_light(light, flip if getattr(light, "attached", "") == "camera" else matrix)
              for light in scene.lights]  # fmt: skip
    meshes = [turned_mesh(mesh, turn) for mesh in scene.meshes]
    frame = draw(case._replace(scene=replace(scene, meshes=meshes, lights=lights, camera=replace(camera, **moved))))
    arrays = arrays_of(frame, without("barycentric", "normal_camera", "position_camera"))
    if is_mirrored:
        arrays = {name: array[:, ::-1] for name, array in arrays.items()}
    for name in ("normal", "position"):
        arrays[name] = arrays[name] @ matrix.astype(np.float32)
    return Twin(arrays, frame, False, n_left_out=2 if is_mirrored else 0)


def turned_light(light, matrix):
    """A light, its places and directions turned."""
    names = [name for name in ("position", "corner", "edge_u", "edge_v", "direction") if has(light, name)]
    return replace(light, **{name: matrix @ getattr(light, name) for name in names})


def turned_mesh(mesh, turn) -> rz.Mesh:
    """A mesh, the brush of its materials turned with it."""
    palette = [
        material if isinstance(material.tangent, str) else replace(material, tangent=turn[:3, :3] @ material.tangent)
        for material in mesh.palette
    ]
    more = {} if mesh.materials is None else {"materials": palette}
    return replace(mesh, material=palette[0], **more).transformed(turn)


def window(case, rng, folder):
    """A part of the picture, by a camera whose principal point is moved."""
    camera, (width, height) = case.scene.camera, case.size
    if camera.height is not None or case.options["color_range"] == "global":
        return None
    scale_x, scale_y, center_x, center_y, _, skew = camera.projection(case.size)
    left, top = int(rng.integers(0, width - 2)), int(rng.integers(0, height - 2))
    size = int(rng.integers(2, width - left + 1)), int(rng.integers(2, height - top + 1))
    middle = center_x - left - 0.5, center_y - top - 0.5  # OpenCV counts from the first pixel's centre
    lens = {"fov": None, "intrinsics": (scale_x, scale_y, *middle), "size": size, "skew": skew}
    frame = draw(case._replace(scene=replace(case.scene, camera=replace(camera, **lens)), size=size), edges=())
    whole = draw(case, edges=()) if case.options["edges"] else None  # what hides them is seen beside them
    return Twin(arrays_of(frame), frame, False, of=whole, part=(slice(top, top + size[1]), slice(left, left + size[0])))


def two_lights(case, rng, folder):
    """A light as two halves, the lights in another order."""
    lights = [case.scene.lights[k] for k in rng.permutation(len(case.scene.lights))]
    if not lights:
        return None
    light = lights.pop()
    half = light.color.scaled(0.5) if hasattr(light.color, "scaled") else np.multiply(light.color, 0.5)
    lights += [replace(light, color=half)] * 2
    frame = draw(case._replace(scene=replace(case.scene, lights=lights)))
    return Twin(arrays_of(frame), frame, False)


def exposed(case, rng, folder):
    """A power of two times the light, and so many stops less."""
    stops = int(rng.integers(-3, 4))

    def brighter(color):
        return color.scaled(2.0**stops) if hasattr(color, "scaled") else np.multiply(color, 2.0**stops)

    def lit(mesh):
        palette = [replace(material, emissive=brighter(material.emissive)) for material in mesh.palette]
        return replace(mesh, material=palette[0], **({} if mesh.materials is None else {"materials": palette}))

    lights = [replace(light, color=brighter(light.color)) for light in case.scene.lights]
    scene = replace(case.scene, lights=lights, meshes=[lit(mesh) for mesh in case.scene.meshes])
    frame = draw(case._replace(scene=scene), exposure=case.options["exposure"] - stops)
    return Twin(arrays_of(frame), frame, False)


RELATIONS = (
    threads, repeated, fewer_outputs, called, saved, black_light, without_area, frozen, split, copies, scaled,
    finer, face_order, turned, window, two_lights, exposed, foreign,
)  # fmt: skip
WITH_GROUND = (threads, repeated, fewer_outputs, called, saved)  # its soft shadow is that of this scene, seen from here


# ── meshes told in another way ─────────────────────────────────────────────────────────────────────────────


def with_meshes(case, meshes) -> Case:
    """The case with other meshes."""
    return case._replace(scene=replace(case.scene, meshes=meshes))


def without(*names) -> list:
    """The names of all arrays but some."""
    return [name for name in ARRAYS if name not in names]


def with_faces(mesh, chosen) -> rz.Mesh:
    """A mesh of some of the faces, in another order."""
    changes = {name: getattr(mesh, name)[chosen] for name in OF_FACES if has(mesh, name)}
    for name in ("normals", "colors", "uv"):
        if has(mesh, name) and getattr(mesh, name).ndim == 3:
            changes[name] = getattr(mesh, name)[chosen]
    return replace(mesh, **changes)


OF_FACES = ("faces", "face_colors", "polygons", "smoothing", "face_material")


def halves(mesh, rng) -> list:
    """A mesh as two, no polygon cut; or as it is, where it has one polygon, or one part has no area."""
    polygons = np.arange(mesh.n_face) if mesh.polygons is None else mesh.polygons
    starts = np.flatnonzero(np.diff(polygons)) + 1
    if len(starts) == 0 or len(starts) + 1 != len(np.unique(polygons)):
        return [mesh]
    cut = int(rng.choice(starts))
    try:
        return [with_faces(mesh, slice(None, cut)), with_faces(mesh, slice(cut, None))]
    except rz.ModelError:
        return [mesh]


def can_freeze(case) -> bool:
    """Tell whether normals may be given in place of a crease angle, which edges are drawn by, too."""
    return not case.options["edges"] or all(mesh.crease_angle is None for mesh in case.scene.meshes)


def has_tangents(case) -> bool:
    """Tell whether a surface is brushed along u."""
    return any(np.size(material.roughness) > 1 and material.tangent == "u" for material in case.scene.materials)


def freeze(mesh) -> rz.Mesh:
    """A mesh whose normals are given as they are computed."""
    if mesh.normals is not None and mesh.crease_angle is None:
        return mesh
    angle, smoothing = mesh.creases
    split_up = split_creases(mesh.vertices, mesh.faces, angle, mesh.weighting, smoothing)
    changes = {name: getattr(mesh, name)[split_up.source] for name in ("vertices", "colors", "uv")
               if has(mesh, name) and getattr(mesh, name).ndim == 2}  # fmt: skip
    return replace(mesh, faces=split_up.faces, normals=split_up.normals, crease_angle=None, **changes)


def unshared(mesh) -> rz.Mesh:
    """A mesh whose faces share no vertices; as it is where it has polygons, which are known by their corners."""
    if mesh.polygons is not None:
        return mesh
    changes = {name: getattr(mesh, name)[mesh.faces] for name in ("normals", "colors", "uv")
               if has(mesh, name) and getattr(mesh, name).ndim == 2}  # fmt: skip
    faces = np.arange(3 * mesh.n_face).reshape(-1, 3)
    return replace(mesh, vertices=mesh.vertices[mesh.faces].reshape(-1, 3), faces=faces, **changes)


# ── what is compared ───────────────────────────────────────────────────────────────────────────────────────


def find_faults(case, n_relation=None) -> list:
    """Draw a case and its twins; say which relations don't hold.

    Parameters
    ----------
    n_relation : how many relations, chosen by the case's number; None = all
    """
    frame, faults = draw(case), []
    n_relation = n_relation or len(RELATIONS)
    for k in range(n_relation):
        number = (case.index * n_relation + k) % len(RELATIONS)
        relation, rng = RELATIONS[number], np.random.default_rng((case.seed, case.index, number, 2))
        if "ground" in case.options and relation not in WITH_GROUND:
            continue
        with tempfile.TemporaryDirectory() as folder:
            twin = relation(case, rng, folder)
        found = [] if twin is None else check_twin(case, twin.of or frame, twin)
        faults += [f"{relation.__name__}: {fault}" for fault in found]
    return faults


def check_twin(case, frame, twin) -> list:
    """Say what of a twin is not as it should be."""
    wanted = {name: array[twin.part] for name, array in arrays_of(frame, twin.arrays).items()}
    if all(same_bytes(wanted[name], array) for name, array in twin.arrays.items()):
        return []
    if twin.is_exact and str(frame.stats.plan) == str(twin.frame.stats.plan):
        return [
            f"{(wanted[name] != array).sum()} values of {name} have other bytes"
            for name, array in twin.arrays.items()
            if not same_bytes(wanted[name], array)
        ]
    return check_bounds(case, frame, twin, wanted)


def same_bytes(one, other) -> bool:
    """Tell whether two arrays are alike to the last bit."""
    return one.dtype == other.dtype and one.tobytes() == np.ascontiguousarray(other).tobytes()


def check_bounds(case, frame, twin, wanted) -> list:
    """Say what of a twin leaves both stated bounds."""
    faults, arrays, stats = [], twin.arrays, (frame.stats, twin.frame.stats)
    is_same = np.ones(wanted["alpha"].shape, bool)
    if "face" in arrays:
        is_same = wanted["face"] == arrays["face"]
        if not is_same.all() and (~is_same & clear_centers(case)[twin.part]).sum() > twin.n_left_out:
            faults.append(f"{(~is_same).sum()} pixels show another face")
        is_same &= wanted["face"] >= 0
    is_clipped = any(each.clipped for each in stats)
    if is_clipped and "face" in wanted:  # of a face as narrow as a pixel nothing tells how far 1/512 px are
        is_same &= is_wide(wanted["face"], 0) & is_wide(wanted["face"], 1)
    for name in arrays.keys() - set(PIXELS):
        one, other = (np.nan_to_num(each[is_same].astype(float)) for each in (wanted[name], arrays[name]))
        most = 2.0 * bound_of(name, one)
        if is_clipped and name not in LABELS:
            most += 2.0 * rounding_of_corners(wanted[name], wanted.get("face", np.zeros(is_same.shape)))
        error = np.abs(one - other).max(initial=0.0)
        if error > most:
            faults.append(f"{name} is off by {error:.3g} > {most:.3g}")
    return faults + check_colors(case, twin, wanted, stats)


def is_wide(face, axis) -> np.ndarray:
    """Tell which pixels have a neighbour along an axis that shows the same face."""
    is_one = np.diff(face, axis=axis) == 0
    return np.insert(is_one, 0, False, axis) | np.insert(is_one, is_one.shape[axis], False, axis)


def rounding_of_corners(values, face) -> float:
    """How far the rounding of new corners to 1/256 px, by 1/512 px along each axis, may move what lies between them: as
    far as half of 1/256 of what neighbouring pixels of a face differ by, along both axes."""
    steps = 0.0
    for axis in range(2):
        is_one = np.diff(face, axis=axis) == 0
        steps += np.abs(np.nan_to_num(np.diff(values.astype(float), axis=axis)[is_one])).max(initial=0.0)
    return steps / 512.0


def bound_of(name, values) -> float:
    """How far a buffer may be off."""
    if name in (*LABELS, "face"):
        return 0.0
    if name in ("normal", "normal_camera"):
        return 2.0**-22
    return (1e-6 if name == "depth" else 2.0**-23) * np.abs(values).max(initial=0.0)


def check_colors(case, twin, wanted, stats) -> list:
    """Colours and alpha, next to no step and where it is clear what is seen. Shadows' edges move with their maps."""
    bounds = [each.error_bound for each in stats]
    if None in bounds or has_shadows(case.scene):
        return []
    most = sum(bounds) + 2 * ROUNDED * np.abs(wanted["color"])
    weights = [1.0, 1.0] if is_opaque(case.scene) else [each["alpha"][..., None] for each in (wanted, twin.arrays)]
    error = np.abs(wanted["color"] * weights[0] - twin.arrays["color"] * weights[1]) - most
    is_far = (error > 0).any(axis=-1) | (np.abs(wanted["alpha"] - twin.arrays["alpha"]) > 1e-6)
    if is_far.any():
        is_far &= (all_clear(case) & ~next_to_step(case, (*stats[0].steps, *stats[1].steps)))[twin.part]
    # Of an edge, rounding decides what hides it, and which face beside it looks away.
    n_allowed = twin.n_left_out + (2 + case.options["edge_width"] * max(is_far.shape) if case.options["edges"] else 0)
    if is_far.sum() <= n_allowed:
        return []
    return [f"{is_far.sum()} colours are off, by up to {error[is_far].max():.3g} more than both bounds"]


def clear_centers(case) -> np.ndarray:
    """Tell of which pixels (h, w) it is clear what is seen at their centres."""
    settings = {name: case.options[name] for name in ("shading", "cull", "exposure", "spectral")}
    with np.errstate(all="ignore"):
        expected = reference.render(case.scene, case.size, **settings)
    return expected.margin > depth_resolution(case.scene, case.size, expected.depth)


# ── the command line ───────────────────────────────────────────────────────────────────────────────────────


def report(case, faults) -> str:
    """What a person needs to see a fault again."""
    lines = "".join(f"\n    {fault}" for fault in faults)
    head = f"seed {case.seed}, scene {case.index}: {case.words}"
    return f"{head}{lines}\n    python -m helpers.relations {case.seed} {case.index}"


def main(seed, first, stop=None) -> int:
    """Check one scene or a range of them, from the command line."""
    n_fault = 0
    for index in range(first, first + 1 if stop is None else stop):
        case = make_full_case(seed, index)
        faults = find_faults(case) if is_small(case) else []
        n_fault += bool(faults)
        if faults or stop is None:
            print(report(case, faults), flush=True)
    return int(n_fault > 0)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
