"""rasterizer/README.md: the triangle's numbers are real, the call tree and the folders name what there is."""

import ast
import re
import sys

import numpy as np
import pytest
from helpers.pages import blocks, chapters, text_of
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.cli.parser import COMMANDS

sys.path.insert(0, str(ROOT / "models"))
import follow_triangle

PAGE = "rasterizer/README.md"
PACKAGE = ROOT / "rasterizer"
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
CLOSE = 1e-5  # relative: another processor may round the last bit of a float otherwise


@pytest.fixture(scope="module")
def printed():
    return follow_triangle.follow()


def test_the_page_shows_the_numbers_of_the_script_in_order(printed):
    text, places = text_of(PAGE), []
    for stage, ours in printed.items():
        words = [NUMBER.sub("#", block) for block in blocks(PAGE, "text")]
        found = NUMBER.sub("#", ours + "\n")
        assert found in words, (
            f"{stage}: the page has no block with these words; run models/follow_triangle.py:\n{ours}"
        )
        shown = blocks(PAGE, "text")[words.index(found)]
        places.append(text.index(ours.splitlines()[0]))
        for here, there in zip(NUMBER.findall(ours), NUMBER.findall(shown), strict=True):
            # Bits and counts of a few digits are compared as text; long numbers may differ in their last bits.
            difference = abs(float(here) - float(there))
            assert difference <= CLOSE * abs(float(here)), f"{stage}: the script prints {here}, the page shows {there}"
    assert places == sorted(places) and set(printed) == set(follow_triangle.STAGES)


def test_the_followed_picture_is_the_one_that_render_draws(printed):
    assert "rz.render draws the same picture: True" in printed["resolve"]


def test_every_name_of_the_call_tree_is_defined_in_the_file_beside_it():
    (tree,) = re.findall(r"```text\n(.*?)```", chapters(PAGE)["The call tree"], re.DOTALL)
    lines = [re.fullmatch(r"[ │├└─]*((?:[\w.]+ )+) *([\w/]+\.py)(?: .*)?", line) for line in tree.splitlines()]
    assert lines and all(lines), tree
    for line in lines:
        source = (PACKAGE / line[2]).read_text()
        for name in line[1].split():
            last = name.rpartition(".")[2]
            assert re.search(rf"^\s*(?:def|class) {last}\b", source, re.MULTILINE), f"{line[2]} has no {name}"


def test_a_folder_says_of_each_of_its_files_what_it_holds():
    """In the first lines of its `__init__.py`, by the file's name without the suffix."""
    untold = []
    for folder in sorted(path.parent for path in PACKAGE.glob("*/__init__.py")):
        said = set(re.findall(r"\w+", ast.get_docstring(ast.parse((folder / "__init__.py").read_text())) or ""))
        files = {path.stem for path in folder.glob("*.py")} - {"__init__"}
        said |= set(COMMANDS) if folder.name == "cli" else set()  # a command is the file of its name
        untold += [f"{folder.name}/{name}.py" for name in sorted(files - said)]
    assert not untold, f"not named in the first lines of their folders' __init__.py: {untold}"


def test_the_table_of_folders_has_each_of_them():
    folders = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    named = re.findall(r"^\| `(\w+)/` \|", chapters(PAGE)["The folders"], re.MULTILINE)
    assert sorted(named) == sorted(folders)


def test_the_classes_that_extend_it_are_those_that_are_tested():
    for path in sorted((ROOT / "tests" / "project" / "extending").glob("*.py")):
        text = path.read_text(encoding="utf-8")
        (cls,) = [node for node in ast.parse(text).body if isinstance(node, ast.ClassDef)]
        source = "\n".join(text.splitlines()[cls.lineno - 1 : cls.end_lineno])
        assert source in text_of(PAGE), f"{PAGE} has another class {cls.name} than {path.name}"


def test_the_limits_that_the_page_states_are_those_of_the_code():
    from rasterizer import options
    from rasterizer.engine.depth_range import MAX_DEPTH_RATIO, NEAREST
    from rasterizer.engine.domains import EXACT
    from rasterizer.engine.reflections import min_sum
    from rasterizer.pipeline import scan, setup, transform, visibility
    from rasterizer.pipeline.power import grazing
    from rasterizer.scene.texture import MAX_IN_PICTURE, MAX_TEXELS
    from rasterizer.scene.validate import COORDINATE_LIMIT

    def power(base, exponent) -> str:
        return f"{base}{str(round(exponent)).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"

    single, double = (np.degrees(2 * np.arcsin(min_sum(is_double) / 2)) for is_double in (False, True))
    parallel = [power(2, np.log2(grazing(cosine))) for cosine in (1.0, np.float32(1.0))]
    said = " ".join(text_of(PAGE).split())
    for text in (
        f"It has {transform.DEPTH_BITS} bits",
        f"what an entry's {transform.DEPTH_BITS} bits",
        f"{setup.BLOCK} triangles side by side",
        f"{visibility.LEVEL_BITS} bits of the intensity",
        f"Boxes of up to {scan.MAX_WIDTH} samples across",
        f"agrees with the reference within {power(10, np.log10(EXACT))} of full scale",
        f"The default, 1/{1 / options.DEFAULT_TOLERANCE:.0f} in linear light",
        f"A light within {parallel[0]} rad of a surface ({parallel[1]} in float32)",
        f"within {single:.0f} degrees of that in float32, within {double:.0f} in float64",
        f"within ±{power(10, np.log10(COORDINATE_LIMIT))} units",
        f"at most {options.MAX_PIXELS} samples along an axis",
        f"met by {visibility.MAX_RECORDS / 1e6:.1f} million triangles",
        f"nearer than {power(2, np.log2(NEAREST))} of the furthest distance is clipped",
        f"further than {power(2, np.log2(MAX_DEPTH_RATIO))} times the nearest distance",
        f"up to {MAX_TEXELS} texels a side and {MAX_IN_PICTURE // 10**5 / 10} million in all",
    ):
        assert text in said, f"{PAGE} doesn't say {text!r}"


def test_a_quad_by_gouraud_differs_from_scan_line_interpolation_as_the_page_says():
    """Scan-line interpolation of the square's left and right edges, as the intensities 1/4, 3/4, 1/4, 3/4 go round."""
    value = np.array([0.25, 0.75, 0.25, 0.75])
    normals = np.stack([np.sqrt(1 - value**2), 0 * value, value], axis=1)
    square = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
    mesh = rz.Mesh(square, [[0, 1, 2, 3]], normals=normals, material=rz.Material(diffuse=1.0, specular=0.0))
    camera = rz.Camera.orthographic((0, 0, 5), (0, 0, 0), (0, 1, 0), height=2)
    scene = rz.Scene(mesh, rz.DirectionalLight((0, 0, -1)), camera)
    drawn = rz.render(scene, (64, 64), shading="gouraud", samples=1, outputs="color").color[..., 0]
    u = (np.arange(64) + 0.5) / 64
    left, right = value[3] + (value[0] - value[3]) * u, value[2] + (value[1] - value[2]) * u  # from the top row down
    scanned = left[:, None] + (right - left)[:, None] * u
    assert np.abs(drawn - scanned).max() == pytest.approx(0.25, abs=0.02) and "by up to 0.25" in text_of(PAGE)
    # Turned by 45 degrees, both edges have the same value in each row, up to 3/4 in the middle one.
    camera = rz.Camera.orthographic((0, 0, 5), (0, 0, 0), (1, 1, 0), height=3)
    drawn = rz.render(rz.Scene(mesh, scene.lights, camera), (65, 65), shading="gouraud", samples=1, outputs="color")
    assert 0.75 - drawn.color[32, 32, 0] == pytest.approx(0.5, abs=1e-3) and "by 0.5" in text_of(PAGE)


def test_the_rounding_of_the_increment_adds_up_as_the_page_says():
    """One triangle of 9 000 by 9 000 px, eight rows of it, whose intensity is linear on the screen."""
    size, value = (9000, 8), np.array([0.8, 0.656, 0.512])
    corners = np.array([[-1.0, -1.0, 0.0], [1.0, -0.9, 0.0], [-0.9, 1.0, 0.0]])
    normals = np.stack([np.sqrt(1 - value**2), 0 * value, value], axis=1)
    mesh = rz.Mesh(corners, [[0, 1, 2]], normals=normals, material=rz.Material(diffuse=1.0, specular=0.0))
    camera = rz.Camera.orthographic((0, 0, 5), (0, 0, 0), (0, 1, 0), height=2 * size[1] / size[0])
    scene = rz.Scene(mesh, rz.DirectionalLight((0, 0, -1)), camera)
    with rz.Renderer(scene, size, shading="gouraud", samples=1, outputs="color", tolerance=1 / 256) as renderer:
        frame = renderer.render()
        assert renderer.plan.paths.entries == 1, "it isn't drawn incrementally"
    x, y = np.meshgrid((np.arange(9000) + 0.5) / 4500 - 1, (3.5 - np.arange(8)) / 4500)
    weights = np.linalg.solve(
        np.vstack([corners[:, :2].T, np.ones(3)]), np.stack([x.ravel(), y.ravel(), x.ravel() ** 0])
    )
    error = np.abs(frame.color[..., 0].ravel() - value @ weights)[(frame.alpha > 0).ravel()].max()
    assert error == pytest.approx(3.8e-4, rel=0.02) and "3.8·10⁻⁴" in text_of(PAGE), error
