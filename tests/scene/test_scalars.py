"""Scalar fields: a value has the colour of the colormap, wherever the value comes from; and the figure round them."""

import json
import warnings

import numpy as np
import pytest
from helpers.refusals import assert_refused
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

import rasterizer as rz
from rasterizer.choices import BUFFERS
from rasterizer.cli import main
from rasterizer.figures import ticks_of
from rasterizer.scene.scalars import NO_VALUE, colors_of

SIZE = (80, 60)
GRID = np.array([(x, y, 0.0) for y in range(9) for x in range(13)])
QUADS = np.array([(13 * y + x, 13 * y + x + 1, 13 * y + x + 14, 13 * y + x + 13) for y in range(8) for x in range(12)])
BRIGHT = {"lights": rz.AmbientLight(1.0), "material": {"ambient": 1.0, "specular": 0.0}}
SIDE = rz.Camera.perspective((9.0, -4.0, 12.0), (6.0, 4.0, 0.0))
RED_TO_BLUE = np.array([(255, 0, 0), (120, 120, 120), (0, 0, 255)], np.uint8)


def draw(source, size=SIZE, **words):
    return rz.render(
        source, size, **{"camera": SIDE, "samples": 1, "outputs": ("color", "face", "position")} | BRIGHT | words
    )


def colored(values, low, high, colors):
    """The colours of values, by the rule itself."""
    t = (values - low) / (high - low)
    return colors[np.clip(np.floor(t * len(colors)), 0, len(colors) - 1).astype(int)]


def worst(found, expected):
    return int(np.abs(found.astype(int) - expected).max())


@pytest.mark.parametrize("shading", ["flat", "gouraud", "phong"])
@pytest.mark.parametrize("cmap", ["viridis", RED_TO_BLUE.tolist(), RED_TO_BLUE / 255.0])
def test_a_face_has_the_colour_of_its_value(shading, cmap):
    values = np.random.default_rng(0).uniform(-3.0, 5.0, len(QUADS))
    mesh = rz.Mesh(GRID, QUADS)
    colors = colors_of(cmap)
    for clim in (None, (-1.0, 2.5)):
        frame = draw(mesh, shading=shading, scalars=values, cmap=cmap, clim=clim)
        is_there = frame.face >= 0
        of_pixels = values[mesh.polygons[frame.face[is_there]]]
        low, high = clim or (values.min(), values.max())
        assert worst(frame.rgb[is_there], colored(of_pixels, low, high, colors)) <= 1
    column = draw(mesh, shading=shading, scalars=values[:, None].tolist(), cmap=cmap, clim=clim)
    assert column.rgba.tobytes() == frame.rgba.tobytes()
    by_triangle = draw(mesh, shading=shading, scalars=values[mesh.polygons], cmap=cmap, clim=clim)
    assert by_triangle.rgba.tobytes() == frame.rgba.tobytes()


@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("cmap", ["viridis", RED_TO_BLUE])
def test_values_are_interpolated_and_then_coloured(samples, cmap):
    """A field that is linear in space: its value at each pixel is that of the point which the pixel shows."""
    slope = np.array([0.3, -0.7, 0.0])
    frame = draw(rz.Mesh(GRID, QUADS), scalars=GRID @ slope, cmap=cmap, samples=samples)
    is_there = (frame.face >= 0) & (frame.alpha == 1.0)
    values = frame.position[is_there].astype(float) @ slope
    low, high = (GRID @ slope).min(), (GRID @ slope).max()
    reach = 1e-6 if samples == 1 else 0.08  # of a pixel's samples
    near = [colored(values + shift, low, high, colors_of(cmap)).astype(int) for shift in np.linspace(-reach, reach, 9)]
    found = frame.rgb[is_there].astype(int)
    assert (found >= np.min(near, axis=0) - 2).all() and (found <= np.max(near, axis=0) + 2).all()


def test_faces_without_a_value_are_grey_and_values_beyond_have_the_colours_of_the_ends():
    values = np.arange(len(QUADS), dtype=float)
    values[[5, 17]] = np.nan, np.inf
    frame = draw(rz.Mesh(GRID, QUADS), shading="flat", scalars=values, clim=(40, 50))
    polygon = rz.Mesh(GRID, QUADS).polygons[frame.face]
    for which, color in (((5, 17), NO_VALUE), ((0, 39), colors_of("viridis")[0]), ((51, 95), colors_of("viridis")[-1])):
        for number in which:
            assert worst(frame.rgb[(frame.face >= 0) & (polygon == number)], np.array(color)) <= 1
    at_vertices = GRID[:, 0].copy()
    at_vertices[40] = np.nan
    frame = draw(rz.Mesh(GRID, QUADS), scalars=at_vertices)
    mesh = rz.Mesh(GRID, QUADS)
    is_bare = (mesh.faces == 40).any(axis=1)[frame.face] & (frame.face >= 0)
    assert is_bare.any() and worst(frame.rgb[is_bare], np.array(NO_VALUE)) <= 1


def test_one_value_and_many_meshes():
    grid, other = rz.Mesh(GRID, QUADS), rz.Mesh(GRID + (0, 0, 1), QUADS)
    middle = draw(grid, scalars=np.full(len(GRID), -3.0))
    assert worst(middle.rgb[middle.face >= 0], colors_of("viridis")[128]) <= 1
    values = np.concatenate([GRID[:, 0], GRID[:, 0] + 20.0])  # one range for both
    both = draw(rz.Scene([grid, other]), scalars=values, cmap=RED_TO_BLUE)
    alone = draw(grid, scalars=values[: len(GRID)], cmap=RED_TO_BLUE, clim=(0.0, 32.0))
    below = (both.face >= 0) & (both.face < grid.n_face) & (alone.face == both.face)
    assert below.sum() > 50 and worst(both.rgb[below], alone.rgb[below]) == 0


# --- the same field from wherever it comes ----------------------------------------------------------------------------

FIELD = np.sin(GRID[:, 0]) * GRID[:, 1]
OF_FACES = np.cos(np.arange(len(QUADS)))


def ply_file(path):
    """Write the grid with its field, a float a vertex and a double a face."""
    head = "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
    head += "property double heat\nelement face {}\nproperty list uchar int vertex_indices\nproperty double load\n"
    lines = [f"{x} {y} {z} {value!r}" for (x, y, z), value in zip(GRID.tolist(), FIELD.tolist(), strict=True)]
    lines += [f"4 {' '.join(map(str, q))} {v!r}" for q, v in zip(QUADS.tolist(), OF_FACES.tolist(), strict=True)]
    path.write_text(head.format(len(GRID), len(QUADS)) + "end_header\n" + "\n".join(lines))
    return path


def test_arrays_names_files_and_the_shell_show_one_picture(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    ply = ply_file(tmp_path / "grid.ply")
    np.save(tmp_path / "heat.npy", FIELD)
    for name, values in (("heat", FIELD), ("load", OF_FACES)):
        words = {"cmap": "magma", "clim": (-2, 3)}
        expected = rz.render(rz.Mesh(GRID, QUADS), SIZE, scalars=values, **words)
        assert np.ptp(expected.rgb[expected.alpha > 0], axis=0).max() > 60
        found = {"by its name": rz.render(ply, SIZE, scalars=name, **words)}
        found["of a scene"] = rz.render(rz.load(ply, scalars=name, **words), SIZE)
        table = {"meshes": [{"file": "grid.ply"}], "scalars": name, "cmap": "magma", "clim": [-2, 3]}
        (tmp_path / "scene.json").write_text(json.dumps(table))
        found["of a scene file"] = rz.render(tmp_path / "scene.json", SIZE)
        numbers = {"vertices": GRID.tolist(), "faces": QUADS.tolist(), "scalars": values.tolist()}
        (tmp_path / "scene.json").write_text(json.dumps(table | {"meshes": [numbers], "scalars": None}))
        found["of numbers in a scene file"] = rz.render(tmp_path / "scene.json", SIZE)
        for how, frame in found.items():
            assert frame.rgba.tobytes() == expected.rgba.tobytes(), (name, how)
        flags = ["-s", "80x60", "--cmap", "magma", "--clim=-2,3", "--scalars"]
        for source in (name, "heat.npy") if name == "heat" else (name,):
            assert main(["render", "grid.ply", "-o", "shell.png", *flags, source]) == 0
            assert np.array_equal(np.asarray(Image.open("shell.png").convert("RGBA")), expected.rgba), source
    assert main(["render", "grid.ply", "-o", "bar.png", *flags, "heat", "--colorbar"]) == 0
    assert Image.open("bar.png").width > SIZE[0]
    capsys.readouterr()
    rgb = ["--array", "rgb", "-o", "rgb.png"]
    assert main(["render", "grid.ply", *flags, "heat", "--colorbar", *rgb]) == 0
    assert Image.open("rgb.png").size == Image.open("bar.png").size
    assert main(["render", "grid.ply", *flags, "heat", "--colorbar", "--array", "depth"]) == 2
    assert main(["render", "grid.ply", "--array", "depth", "--format", "png", "--scale", "0.1", "-s", "8"]) == 0
    assert main(["render", "grid.ply", "--array", "depth", "--array", "uv", "--format", "npz", "-s", "8"]) == 0
    assert Image.open("grid.png").mode.startswith("I") and len(np.load("grid.npz").files) == 2
    capsys.readouterr()
    for wrong in (
        ["--scalars", "vertex_indices"],
        ["--scalars", "cold"],
        ["--scalars", "no.npy"],
        ["--scalars", "heat", "--clim", "3"],
        ["--colorbar"],
    ):
        assert main(["render", "grid.ply", "-o", "x.png", *wrong]) in (2, 3), wrong
        assert "Traceback" not in capsys.readouterr().err


def test_models_of_a_scene_file_share_one_range(tmp_path):
    ply_file(tmp_path / "grid.ply")
    moved = {"file": "grid.ply", "transform": {"translate": [0, 0, 2]}}
    numbers = {"vertices": GRID.tolist(), "faces": QUADS.tolist(), "scalars": (10 * FIELD).tolist()}
    table = {"meshes": [moved, numbers], "scalars": "heat", "lights": [{"kind": "ambient", "color": 1.0}]}
    (tmp_path / "scene.json").write_text(json.dumps(table))
    frame = rz.render(tmp_path / "scene.json", SIZE)
    scene = rz.Scene([rz.Mesh(GRID + (0, 0, 2), QUADS), rz.Mesh(GRID, QUADS)], rz.AmbientLight(1.0))
    expected = rz.render(scene, SIZE, scalars=np.concatenate([FIELD, 10 * FIELD]))
    assert worst(frame.rgba, expected.rgba) <= 4 and (frame.rgba != expected.rgba).any(axis=2).mean() < 0.05
    bars = frame.with_colorbar("heat"), expected.with_colorbar("heat")
    assert np.array_equal(*(bar.rgba[:, SIZE[0] :] for bar in bars))


def test_libraries_bring_theirs(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    faces = rz.Mesh(GRID, QUADS).faces
    expected = rz.render(rz.Mesh(GRID, faces), SIZE, scalars=FIELD)
    mesh = trimesh.Trimesh(GRID, faces, process=False)
    assert rz.render(mesh, SIZE, scalars=FIELD).rgba.tobytes() == expected.rgba.tobytes()
    mesh.vertex_attributes["heat"] = FIELD
    assert rz.render(mesh, SIZE, scalars="heat").rgba.tobytes() == expected.rgba.tobytes()
    mesh.vertex_attributes["_HEAT"] = FIELD.astype(np.float32)
    mesh.export(tmp_path / "grid.glb")
    rounded = rz.render(rz.Mesh(GRID, faces), SIZE, scalars=FIELD.astype(np.float32))
    assert rz.render(tmp_path / "grid.glb", SIZE, scalars="_HEAT").rgba.tobytes() == rounded.rgba.tobytes()


def test_active_scalars_of_pyvista_are_shown_unasked():
    pyvista = pytest.importorskip("pyvista")
    data = pyvista.PolyData.from_regular_faces(GRID, QUADS)
    bare = rz.render(data, SIZE)
    data["heat"] = FIELD
    expected = rz.render(rz.Mesh(GRID, QUADS), SIZE, scalars=FIELD)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert rz.render(data, SIZE).rgba.tobytes() == expected.rgba.tobytes() != bare.rgba.tobytes()
        data.cell_data["load"] = OF_FACES
        by_face = rz.render(rz.Mesh(GRID, QUADS), SIZE, scalars=OF_FACES, cmap="magma")
        assert rz.render(data, SIZE, scalars="load", cmap="magma").rgba.tobytes() == by_face.rgba.tobytes()
        grid = pyvista.ImageData(dimensions=(5, 6, 7))
        grid["x"] = grid.points[:, 0]
        blocks = pyvista.MultiBlock([grid, grid.translate((6.0, 0, 0))])
        assert rz.render(blocks, SIZE).with_colorbar().width > SIZE[0]
        assert np.ptp(rz.render(grid, SIZE, **BRIGHT).rgb[..., 0]) > 100
    assert (
        rz.render(data, SIZE, color="red").rgba[..., 2].max() == rz.render(data, SIZE, color="red").rgba[..., 1].max()
    )


def test_what_is_no_scalar_field_is_refused():
    mesh = rz.Mesh(GRID, QUADS)
    cases = [
        ({"scalars": np.zeros(7)}, "117 vertices"),
        ({"scalars": GRID}, "shape"),
        ({"scalars": {"a": 1}}, "a name"),
        ({"scalars": "heat"}, "none by a name"),
        ({"scalars": np.full(len(GRID), np.nan)}, "finite"),
        ({"scalars": FIELD, "clim": (2, 2)}, "clim"),
        ({"scalars": FIELD, "clim": 3}, "clim"),
        ({"scalars": FIELD, "clim": (-1e308, 1e308)}, "clim"),
        ({"scalars": np.where(np.arange(len(GRID)) % 2, 1e308, -1e308)}, "give clim"),
        ({"scalars": FIELD, "clim": (0, np.nan)}, "clim"),
        ({"scalars": FIELD, "cmap": "no such map"}, "cmap"),
        ({"scalars": FIELD, "cmap": np.zeros((0, 3))}, "cmap"),
        ({"scalars": FIELD, "cmap": np.full((4, 3), 200.0)}, "0..1"),
        ({"scalars": FIELD, "clim": (0.0, 1e-320)}, "narrow"),
        ({"scalars": FIELD, "color": "red"}, "one of scalars and color"),
        ({"scalar": FIELD}, "did you mean scalars"),
    ]
    assert_refused(lambda words: rz.render(mesh, SIZE, **words), cases, rz.RasterizerError)
    with pytest.raises(rz.SceneError, match="scalars"):
        rz.render(mesh, SIZE).with_colorbar()


# --- the figure -------------------------------------------------------------------------------------------------------


def test_a_colour_bar_shows_the_colours_from_below_to_above():
    frame = draw(rz.Mesh(GRID, QUADS), (320, 240), scalars=FIELD, background="white")
    figure = frame.with_colorbar("heat")
    assert np.array_equal(figure.rgba[:, :320], frame.rgba) and figure.height == 240 and figure.width > 340
    colors = colors_of("viridis").astype(int)
    is_bar = [(np.abs(column[:, None, :3].astype(int) - colors).max(axis=2) == 0).any(axis=1) for column in
              figure.rgba[:, 320:].swapaxes(0, 1)]  # fmt: skip
    column = int(np.argmax([each.sum() for each in is_bar]))
    assert is_bar[column].sum() > 100
    shown = figure.rgba[:, 320 + column, :3].astype(int)[is_bar[column]]
    index = np.array([np.abs(colors - color).sum(axis=1).argmin() for color in shown])
    assert (np.diff(index) <= 0).all() and index[0] > 250 and index[-1] < 5


@given(st.floats(-1e12, 1e12), st.floats(1e-9, 1e12), st.integers(1, 12))
@settings(max_examples=200, deadline=None)
def test_ticks_are_round_and_lie_within(low, width, n):
    high = low + width
    if not low < high or width < 1e-6 * abs(low):
        return
    values, texts = ticks_of(low, high, n)
    step = values[1] - values[0] if len(values) > 1 else width
    assert len(values) <= n + 1
    for value, text in zip(values, texts, strict=True):
        assert low - 1e-6 * width <= value <= high + 1e-6 * width
        assert abs(float(text) - value) <= 0.011 * step, (text, value)
    assert len(set(texts)) == len(texts)


def test_every_buffer_is_a_picture_and_dots_an_inch_are_one_number(tmp_path):
    frame = rz.render(rz.Mesh(GRID, QUADS, uv=GRID[:, :2]), SIZE, outputs=("color", *BUFFERS))
    is_there = frame.mask
    for name in BUFFERS:
        image = np.asarray(frame.to_pil(name))
        assert image.shape == (60, 80, 4) and image.dtype == np.uint8, name
        if name != "mask":
            assert np.array_equal(image[..., 3] > 0, is_there), name
        if name in ("depth", "face", "normal", "uv", "barycentric", "position"):
            assert len(np.unique(image[is_there].reshape(-1, 4), axis=0)) > (1 if name.startswith("normal") else 20) - 1
    depth = np.asarray(frame.to_pil("depth"))[..., 0][is_there].astype(int)
    order = np.argsort(frame.depth[is_there])
    assert depth[order[0]] > depth[order[-1]] and (np.diff(depth[order]) <= 0).all()
    frame.save(tmp_path / "a.png", dpi=300)
    assert round(Image.open(tmp_path / "a.png").info["dpi"][0]) == 300
    cases = [({"dpi": "many"}, "dpi"), ({"dpi": 0}, "dpi"), ({"array": "deep"}, "array")]
    assert_refused(lambda words: frame.save(tmp_path / "b.png", **words), cases, rz.SceneError)
    with pytest.raises(rz.SceneError, match="array"):
        frame.to_pil("deep")
    with pytest.raises(rz.SceneError, match="label"):
        draw(rz.Mesh(GRID, QUADS), scalars=FIELD).with_colorbar(5)
