"""Foreign meshes: a mesh in the memory of another library, and the file that the library writes of it, give one
picture. Arrays of other libraries: by stand-ins with the same protocols, and by torch where it is."""

import warnings

import numpy as np
import pytest
from helpers.small_scenes import MODELS
from PIL import Image

import rasterizer as rz

# A box without seams, whose numbers are exact in every file.
VERTICES = np.array([(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 1.5)])
QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
FACES = np.concatenate([QUADS[:, :3], QUADS[:, [0, 2, 3]]])
UV = np.array([(0.125 * k, 0.25 * (k % 4)) for k in range(8)])
NORMALS = VERTICES - (0.5, 1, 0.75)
NORMALS /= np.linalg.norm(NORMALS, axis=1)[:, None]
COLORS = np.array([(20 * k, 255 - 20 * k, 100 + 15 * (k % 3)) for k in range(12)], np.uint8)
PIXELS = np.random.default_rng(0).integers(0, 255, (16, 16, 3), np.uint8)
TURNED = np.array([[0, -1, 0, 1], [1, 0, 0, 0.5], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def picture(source, **words):
    """Return the bytes of a picture of one or several sources, and the texts of what was warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        frame = rz.render(rz.load(source), (60, 48), **words)
    return frame.rgba.tobytes(), [str(each.message) for each in caught if each.category is UserWarning]


def of_files(paths, **words):
    return picture([mesh for path in paths for mesh in rz.load(path).meshes], **words)


# --- each library, with what a mesh may have ------------------------------------------------------------------------


def trimesh_rows():
    trimesh = pytest.importorskip("trimesh")
    visual, image = trimesh.visual, Image.fromarray(PIXELS)

    def mesh(**words):
        return trimesh.Trimesh(VERTICES, FACES, process=False, **words)

    def scene(*geometry):
        made = trimesh.Scene()
        for k, each in enumerate(geometry):
            made.add_geometry(each, geom_name=f"g{k}", transform=TURNED.copy() if k else np.eye(4))
        return made

    def textured(material):
        return mesh(visual=visual.TextureVisuals(uv=UV, material=material))

    grey = visual.material.SimpleMaterial(
        image=image, diffuse=[255] * 3, ambient=[255] * 3, specular=[51] * 3, glossiness=20.0
    )
    red = visual.material.SimpleMaterial(diffuse=[204, 51, 0], ambient=[51] * 3, specular=[255] * 3, glossiness=5.0)
    metal = visual.material.PBRMaterial(
        baseColorFactor=[204, 102, 51, 255], metallicFactor=0.75, roughnessFactor=0.5, emissiveFactor=[0, 0, 0.25]
    )
    glass = visual.material.PBRMaterial(baseColorFactor=[51, 255, 51, 102], alphaMode="BLEND", roughnessFactor=0.5)
    both = visual.material.PBRMaterial(
        baseColorTexture=image, metallicRoughnessTexture=image, metallicFactor=1.0, roughnessFactor=1.0
    )
    cut_out = visual.material.PBRMaterial(
        baseColorTexture=Image.fromarray(np.dstack([PIXELS, PIXELS[..., 0]])), alphaMode="MASK", alphaCutoff=0.5
    )
    return {
        "plain": (mesh(), "ply"),
        "plain stl": (mesh(), "stl"),
        "normals": (mesh(vertex_normals=NORMALS), "ply"),
        "colours a vertex": (mesh(vertex_colors=COLORS[:8]), "ply"),
        "colours a face": (mesh(face_colors=COLORS), "ply"),
        "texture": (textured(grey), "obj"),
        "material": (textured(red), "obj"),
        "metal": (textured(metal), "glb"),
        "glass": (textured(glass), "glb"),
        "textures of metal": (textured(both), "glb"),
        "cut-out": (textured(cut_out), "glb"),
        "transform": (scene(textured(metal), mesh()), "glb"),
        "several": (scene(textured(glass), textured(both), textured(metal)), "glb"),
    }, lambda source, path: source.export(path)


def open3d_rows():
    o3d = pytest.importorskip("open3d", exc_type=ImportError)

    def vector(rows):  # a copy: trimesh may have made the rows read-only
        return o3d.utility.Vector3dVector(np.array(rows))

    def mesh(**words):
        made = o3d.geometry.TriangleMesh(vector(VERTICES), o3d.utility.Vector3iVector(FACES))
        for key, value in words.items():
            setattr(made, key, value)
        return made

    image = o3d.geometry.Image(np.ascontiguousarray(PIXELS))
    laid = {"triangle_uvs": o3d.utility.Vector2dVector(UV[FACES].reshape(-1, 2)), "textures": [image]}
    laid |= {"triangle_material_ids": o3d.utility.IntVector([0] * len(FACES))}
    tensor = o3d.t.geometry.TriangleMesh
    return {
        "plain": (mesh(), "ply"),
        "normals": (mesh(vertex_normals=vector(NORMALS)), "ply"),
        "colours a vertex": (mesh(vertex_colors=vector(COLORS[:8] / 255.0)), "ply"),
        "texture": (mesh(**laid), "obj"),
        "transform": (mesh().transform(TURNED.copy()), "ply"),
        "plain tensors": (tensor.from_legacy(mesh()), "ply"),
        "normals of tensors": (tensor.from_legacy(mesh(vertex_normals=vector(NORMALS))), "ply"),
        "colours of tensors": (tensor.from_legacy(mesh(vertex_colors=vector(COLORS[:8] / 255.0))), "ply"),
    }, lambda source, path: (o3d.t.io if isinstance(source, tensor) else o3d.io).write_triangle_mesh(str(path), source)


def pyvista_rows():
    pyvista = pytest.importorskip("pyvista")

    def mesh(faces=FACES, **arrays):
        made = pyvista.PolyData(VERTICES, np.insert(faces, 0, faces.shape[1], axis=1).ravel())
        for key, value in arrays.items():
            (made.cell_data if len(value) == len(faces) else made.point_data)[key] = value
        return made

    def save(source, path):
        source.save(path, recompute_normals=False, texture="RGB" if "RGB" in source.array_names else None)

    laid, normal = mesh(), mesh()
    laid.active_texture_coordinates = UV.astype(np.float32)
    normal.point_data.active_normals = NORMALS.astype(np.float32)
    blocks = pyvista.MultiBlock({"a": mesh(), "b": mesh(QUADS).translate((2, 0, 0))})
    return (
        {
            "plain": (mesh(), "ply"),
            "plain stl": (mesh(), "stl"),
            "polygons": (mesh(QUADS), "ply"),
            "normals": (normal, "ply"),
            "colours a vertex": (mesh(RGB=COLORS[:8]), "ply"),
            "texture coordinates": (laid, "ply"),
            "transform": (mesh().transform(TURNED.copy(), inplace=False), "ply"),
            "several": (blocks, "ply"),
        },
        lambda source, path: (
            [save(block, path.with_name(f"{k}.ply")) for k, block in enumerate(source)]
            if source is blocks
            else save(source, path)
        ),
    )


def meshio_rows():
    meshio = pytest.importorskip("meshio")
    colors = {name: COLORS[:8, k].copy() for k, name in enumerate(("red", "green", "blue"))}

    def mesh(*cells, **words):
        return meshio.Mesh(VERTICES, list(cells) or [("triangle", FACES)], **words)

    return {
        "plain": (mesh(), "ply"),
        "plain obj": (mesh(), "obj"),
        "polygons": (mesh(("quad", QUADS)), "ply"),
        "two kinds": (mesh(("quad", QUADS[:4]), ("triangle", FACES[[4, 10, 5, 11]])), "obj"),
        "normals": (mesh(point_data={name: NORMALS[:, k].copy() for k, name in enumerate(("nx", "ny", "nz"))}), "ply"),
        "colours a vertex": (mesh(point_data=colors), "ply"),
    }, lambda source, path: source.write(path)


@pytest.mark.parametrize("rows_of", [trimesh_rows, open3d_rows, pyvista_rows, meshio_rows])
def test_a_mesh_in_memory_and_its_file_give_one_picture(tmp_path, rows_of):
    rows, save = rows_of()
    faults = {}
    for name, (source, suffix) in rows.items():
        folder = tmp_path / name
        folder.mkdir()
        save(source, folder / f"mesh.{suffix}")
        files = sorted(folder.glob(f"*.{suffix}"))
        words = {"material": {"texture": PIXELS}} if name == "texture coordinates" else {}
        for shading in ("flat", "phong"):
            found, expected = picture(source, shading=shading, **words), of_files(files, shading=shading, **words)
            if found != (expected[0], []):
                levels = [np.frombuffer(each[0], np.uint8).astype(int) for each in (found, expected)]
                faults[name, shading] = np.abs(levels[0] - levels[1]).max(), found[1], expected[1]
    assert not faults


# --- what has no file of its own --------------------------------------------------------------------------------------


def test_what_is_loaded_looks_as_its_file(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    for name in ("knot.ply", "gear.stl", "glass.obj", "table.obj"):
        assert picture(trimesh.load(MODELS / name)) == picture(MODELS / name), name
    colored = trimesh.Trimesh(VERTICES, FACES, process=False, vertex_colors=COLORS[:8])
    colored.export(tmp_path / "colors.glb")  # where they are linear
    for options in ({}, {"force": "mesh"}):
        assert picture(trimesh.load(tmp_path / "colors.glb", **options)) == picture(tmp_path / "colors.glb")
    laid = trimesh.Trimesh(VERTICES, FACES, process=False, visual=trimesh.visual.TextureVisuals(uv=UV))
    assert picture(laid) == picture(rz.Mesh(VERTICES, FACES))  # of no material trimesh makes one of its own
    mesh = rz.load(trimesh.load(MODELS / "globe.obj")).meshes[0]  # whose quads trimesh has cut along other diagonals
    (expected,) = rz.load(MODELS / "globe.obj").meshes
    assert np.array_equal(mesh.material.texture.encoded, expected.material.texture.encoded)
    assert repr(mesh.material.diffuse) == repr(expected.material.diffuse) and mesh.n_vertex == expected.n_vertex
    scene = trimesh.load(MODELS / "still_life.obj")
    assert [mesh.name for mesh in rz.load(scene).meshes] == list(scene.geometry)
    assert rz.Scene(scene).n_face == rz.load(MODELS / "still_life.obj").n_face


def test_normals_and_lights_that_trimesh_makes_when_they_are_looked_at_do_not_count():
    trimesh = pytest.importorskip("trimesh")
    turn = trimesh.transformations.rotation_matrix(0.4, (1, 2, 3))
    for make in (trimesh.creation.box, trimesh.creation.icosphere, trimesh.creation.torus):
        looked_at, other = (make(*(3, 1) if make is trimesh.creation.torus else ()) for _ in range(2))
        assert looked_at.vertex_normals is not None
        assert picture(looked_at) == picture(other)
        assert picture(looked_at.apply_transform(turn)) == picture(other.apply_transform(turn))
    given = trimesh.Trimesh(VERTICES, FACES, vertex_normals=NORMALS, process=False)
    assert picture(given) == picture(rz.Mesh(VERTICES, FACES, NORMALS)) != picture(rz.Mesh(VERTICES, FACES))
    scenes = [trimesh.Scene([given]) for _ in range(2)]
    assert scenes[0].lights and scenes[0].camera
    assert picture(scenes[0]) == picture(scenes[1])


def test_the_lights_and_the_camera_of_a_trimesh_scene():
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene([trimesh.Trimesh(VERTICES, FACES, process=False)])
    lighting, place = trimesh.scene.lighting, trimesh.transformations.translation_matrix((0, 0, 5.0))
    scene.lights = [
        lighting.PointLight(name="p", color=[255, 0, 0], intensity=9.0),
        lighting.DirectionalLight(name="d", color=[51, 51, 51], intensity=1.0),
        lighting.SpotLight(name="s", color=[255] * 3, intensity=2.0, outerConeAngle=0.5),
    ]
    for light in scene.lights:
        scene.graph[light.name] = place
    scene.camera = trimesh.scene.Camera(name="c", fov=(60, 45))
    scene.camera_transform = place
    loaded = rz.load(scene, camera="file")
    point, directional, spot = loaded.lights
    assert point.position == (0, 0, 5) and point.color == (9, 0, 0) and directional.color == (0.2,) * 3
    assert directional.direction == (0, 0, -1) and spot.outer == pytest.approx(np.degrees(0.5))
    assert loaded.camera.position == (0, 0, 5) and loaded.camera.fov == pytest.approx(45)
    assert rz.load(scene).camera is None


def test_what_can_not_be_taken_is_one_warning():
    trimesh = pytest.importorskip("trimesh")
    visual = trimesh.visual
    image = Image.fromarray(PIXELS)
    material = visual.material.PBRMaterial(normalTexture=image, emissiveTexture=image, baseColorTexture=image)
    mesh = trimesh.Trimesh(VERTICES, FACES, process=False, visual=visual.TextureVisuals(material=material))
    faint = trimesh.Trimesh(VERTICES, FACES, process=False, vertex_colors=[[255, 0, 0, 9]] * 8)
    (text,) = picture([mesh, faint])[1]
    for what in ("normal textures", "emissive textures", "texture coordinates", "alpha"):
        assert what in text
    with pytest.warns(UserWarning, match="alpha"):
        mesh = rz.Mesh(VERTICES, FACES, colors=np.full((8, 4), 9, np.uint8))
    assert picture(mesh.translated((1, 2, 3)))[1] == []


def test_what_has_no_faces_is_refused_and_what_are_several_meshes_is_none():
    trimesh = pytest.importorskip("trimesh")
    for source in (trimesh.PointCloud(VERTICES), trimesh.Scene(), trimesh.load_path(VERTICES[:2])):
        with pytest.raises(rz.ModelError, match="faces"):
            rz.render(source, 8)
    with pytest.raises(rz.ModelError, match="several meshes"):
        rz.Mesh.from_any(trimesh.Scene())


def test_objects_of_vtk_and_pyvista():
    pyvista = pytest.importorskip("pyvista")
    from vtkmodules.vtkFiltersSources import vtkCubeSource

    source = vtkCubeSource()
    source.Update()
    assert picture(source.GetOutput()) == picture(pyvista.wrap(source.GetOutput())) != picture(rz.Mesh(VERTICES, FACES))
    box = pyvista.PolyData(VERTICES, np.insert(FACES, 0, 3, axis=1).ravel())
    assert picture(box.cast_to_unstructured_grid()) == picture(box) == picture((VERTICES, FACES))
    assert picture(pyvista.ImageData(dimensions=(3, 3, 3)))[1] == []
    box.cell_data["RGB"] = COLORS
    assert picture(box) == picture(rz.Mesh(VERTICES, FACES, face_colors=COLORS))
    box.cell_data.clear()
    box.point_data["heat"] = np.arange(8.0)
    box.set_active_scalars("heat")
    assert picture(box)[1] == []
    texture = rz.Texture(pyvista.Texture(PIXELS))
    assert np.array_equal(texture.encoded[::-1], PIXELS) or np.array_equal(texture.encoded, PIXELS)
    for points in (pyvista.PolyData(VERTICES), pyvista.MultiBlock(), pyvista.Line()):
        with pytest.raises(rz.ModelError, match="faces"):
            rz.render(points, 8)


def test_materials_of_open3d():
    o3d = pytest.importorskip("open3d", exc_type=ImportError)
    vector, gold = o3d.utility.Vector3dVector, (0.75, 0.5, 0.25, 1.0)
    legacy = o3d.geometry.TriangleMesh(vector(VERTICES), o3d.utility.Vector3iVector(FACES))
    found = o3d.t.geometry.TriangleMesh.from_legacy(legacy)
    found.material.set_default_properties()
    found.material.vector_properties["base_color"] = np.array(gold, np.float32)
    found.material.scalar_properties["metallic"] = 1.0
    model, record = o3d.visualization.rendering.TriangleMeshModel(), o3d.visualization.rendering.MaterialRecord()
    record.base_color, record.base_metallic = gold, 1.0
    model.meshes = [o3d.visualization.rendering.TriangleMeshModel.MeshInfo(legacy, "box", 0)]
    model.materials = [record]
    for source in (found, model):
        (mesh,) = rz.load(source).meshes
        assert mesh.material.reflection == "cook-torrance" and mesh.material.fresnel == pytest.approx(gold[:3])
    assert rz.load(model).meshes[0].name == "box"
    with pytest.raises(rz.ModelError, match="faces"):
        rz.render(o3d.geometry.PointCloud(vector(VERTICES)), 8)


def test_cells_of_meshio_that_are_no_faces():
    meshio = pytest.importorskip("meshio")
    line, tetra = ("line", [[0, 1]]), ("tetra", [[0, 1, 2, 4]])
    assert picture(meshio.Mesh(VERTICES, [line, ("triangle", FACES)]))[1] == [
        "not drawn of the mesh given: cells of line"
    ]
    with pytest.raises(rz.ModelError, match="faces.*tetra"):
        rz.render(meshio.Mesh(VERTICES, [tetra]), 8)


# --- arrays -----------------------------------------------------------------------------------------------------------

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]])


class Shared:
    """An array that knows DLPack alone."""

    def __init__(self, values, fault=None):
        self._array, self._fault = np.array(values), fault

    def __dlpack__(self, **options):
        if self._fault is not None:
            raise self._fault
        return self._array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self._array.__dlpack_device__()


class Tensor(Shared):
    """An array that knows numpy's protocol, too, as torch's do."""

    ndim, shape = 2, (5, 3)

    def __array__(self, dtype=None, copy=None):
        if self._fault is not None:
            raise self._fault
        return self._array


def test_arrays_of_other_libraries_are_read():
    triangles = [[0, 1, 2], [0, 2, 3]]
    for kind in (Shared, Tensor):
        assert picture((kind(CORNERS), kind(triangles))) == picture((CORNERS, triangles))
    image = np.linspace(0, 1, 48).reshape(4, 4, 3)
    assert np.array_equal(rz.Texture(Shared(image)).image, rz.Texture(image).image)
    position, color = np.array([3.0, 4.0, 5.0]), np.array([0.5, 0.25, 1.0])
    assert rz.PointLight(Shared(position), Shared(color)) == rz.PointLight(position, color)
    moved = rz.Mesh(CORNERS, triangles).transformed(Tensor(np.diag([2.0, 2, 2, 1])))
    assert moved.bounds[1].tolist() == [2, 2, 0]


def test_arrays_that_numpy_can_not_read_are_refused_with_what_to_do():
    needs_gradient = RuntimeError(
        "Can't call numpy() on Tensor that requires grad. Use tensor.detach().numpy() instead."
    )
    on_gpu = TypeError("can't convert cuda:0 device type tensor to numpy. Use Tensor.cpu() first.")
    for tensor in (Tensor(CORNERS, needs_gradient), Tensor(CORNERS, on_gpu), Shared(CORNERS, BufferError("cuda"))):
        for call in (
            lambda given: rz.render((given, [[0, 1, 2]]), 8),
            lambda given: rz.Mesh(CORNERS, given),
            lambda given: rz.Mesh(CORNERS, [[0, 1, 2]], colors=given),
            rz.Texture,
        ):
            with pytest.raises(
                rz.SceneError, match=r"numpy can't read this .*give x.detach\(\).cpu\(\).numpy"
            ) as caught:
                call(tensor)
            assert len(str(caught.value)) < 300


def test_tensors_of_torch_itself():
    torch = pytest.importorskip("torch")
    assert picture((torch.tensor(CORNERS), torch.tensor([[0, 1, 2]]))) == picture((CORNERS, [[0, 1, 2]]))
    with pytest.raises(rz.SceneError, match="detach"):
        rz.render((torch.tensor(CORNERS, requires_grad=True), [[0, 1, 2]]), 8)


def test_the_shape_says_of_a_file_and_of_what_is_loaded_from_it_which_axis_points_upwards(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    trimesh.load(MODELS / "cone.obj").export(tmp_path / "cone.stl")
    for source in (tmp_path / "cone.stl", trimesh.load(tmp_path / "cone.stl")):
        with pytest.warns(UserWarning, match="up='y'"):
            lying = rz.render(source, 32)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            standing = rz.render(source, 32, up="y")
            rz.render(source, 32, eye=(5, 5, 5))
        assert lying.rgba.tobytes() != standing.rgba.tobytes()
