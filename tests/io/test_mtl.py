"""Tests of textures in MTL files: which picture, how it is laid, and what is said where it can't be."""

import warnings
from contextlib import nullcontext

import numpy as np
import pytest
from PIL import Image

from rasterizer.io import mtl
from rasterizer.io.loader import load
from rasterizer.scene.material import Material
from rasterizer.scene.texture import Texture

POINTS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\n"
TEXTURED = POINTS + "usemtl a\nf 1/1 2/2 3/3\n"
PIXELS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [90, 90, 90]]], np.uint8)
ALPHA = np.array([[0, 51], [128, 255]], np.uint8)


@pytest.fixture
def folder(tmp_path):
    Image.fromarray(PIXELS).save(tmp_path / "wood.png")
    Image.fromarray(np.dstack([PIXELS, ALPHA])).save(tmp_path / "leaf.png")
    Image.fromarray(ALPHA).save(tmp_path / "mask.png")
    Image.fromarray(np.zeros((3, 3), np.uint8)).save(tmp_path / "large.png")
    return tmp_path


def write_obj(folder, mtl, text=TEXTURED):
    """Write a model with a material file, and return its path."""
    (folder / "m.mtl").write_text(mtl)
    (folder / "model.obj").write_text("mtllib m.mtl\n" + text)
    return folder / "model.obj"


def load_obj(folder, mtl, text=TEXTURED, **options):
    """Load a model with a material file; a warning is an error."""
    write_obj(folder, mtl, text)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return load(folder / "model.obj", **options)


def material_of(folder, lines, **options) -> Material:
    return load_obj(folder, "newmtl a\n" + lines, **options).meshes[0].material


# --- what a map does ----------------------------------------------------------------------------------------


def test_map_kd_is_the_texture_and_multiplies_kd(folder):
    material = material_of(folder, "Kd 0.8 0.4 0.2\nKa 0.1 0.1 0.1\nmap_Kd wood.png")
    np.testing.assert_array_equal(material.texture.image, Texture(PIXELS).image)
    assert material.diffuse == (0.8, 0.4, 0.2) and material.ambient == (0.1, 0.1, 0.1)
    assert material.texture.name.endswith("wood.png") and material.texture.wrap == ("repeat", "repeat")


def test_without_kd_the_picture_is_the_colour(folder):
    material = material_of(folder, "map_Kd wood.png")
    assert material.diffuse == material.ambient == (1.0, 1.0, 1.0)
    assert material_of(folder, "map_Kd wood.png\nKd 0.5").diffuse == (0.5, 0.5, 0.5)


@pytest.mark.parametrize(
    "lines", ["map_Kd leaf.png", "map_Kd leaf.png\nmap_d leaf.png", "map_d leaf.png\nmap_Kd leaf.png"]
)
def test_the_pictures_own_alpha(folder, lines):
    texture = material_of(folder, lines).texture
    np.testing.assert_array_equal(texture.image[..., 3], (ALPHA / 255).astype(np.float32))


def test_map_d_gives_its_grey_undecoded(folder):
    material = material_of(folder, "d 0.5\nmap_Kd wood.png\nmap_d mask.png")
    np.testing.assert_array_equal(material.texture.image[..., 3], (ALPHA / 255).astype(np.float32))
    np.testing.assert_array_equal(material.texture.image[..., :3], Texture(PIXELS).image[..., :3])
    assert material.opacity == 0.5


def test_map_d_alone_leaves_the_colour(folder):
    material = material_of(folder, "Kd 0.5 0 0\nmap_d mask.png")
    assert (material.texture.image[..., :3] == 1.0).all() and material.diffuse == (0.5, 0, 0)
    np.testing.assert_array_equal(material.texture.image[..., 3], (ALPHA / 255).astype(np.float32))
    mean = material_of(folder, "map_d wood.png").texture.image[..., 3]
    np.testing.assert_allclose(mean, [[1 / 3, 1 / 3], [1 / 3, 90 / 255]], rtol=1e-6)


def test_map_d_of_another_size_is_reported(folder):
    facts = []
    texture = material_of(folder, "map_Kd wood.png\nmap_d large.png", log=facts.append).texture
    assert not texture.has_alpha and any("'large.png'" in fact and "another size" in fact for fact in facts)


def test_illum_0_with_a_texture_is_lit_and_reported(folder):
    facts = []
    material = material_of(folder, "Kd 1 1 1\nKs 1 1 1\nillum 0\nmap_Kd wood.png", log=facts.append)
    assert material.diffuse == (1, 1, 1) and material.specular == (0, 0, 0) and material.emissive == (0, 0, 0)
    assert any("illum 0" in fact for fact in facts)


@pytest.mark.parametrize("model", [4, 6, 7, 9])
def test_glass_without_d_is_opaque(folder, model):
    assert material_of(folder, f"Kd 1 1 1\nillum {model}").opacity == 1.0


def test_the_first_texel_is_the_upper_left_one(folder):
    """v points up in OBJ as it does here, so coordinates stay as they are."""
    (mesh,) = load_obj(folder, "newmtl a\nmap_Kd wood.png").meshes
    assert mesh.uv.tolist() == [[0, 0], [1, 0], [1, 1]]


# --- options and names --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "wrap", "n_fact", "warned"),
    [
        ("map_Kd -clamp on wood.png", "clamp", 0, ()),
        ("map_Kd -clamp off wood.png", "repeat", 0, ()),
        ("map_Kd -s 2 2 2 -o 0.5 -clamp on wood.png", "clamp", 0, ("-o 0.5", "-s 2 2 2")),
        ("map_Kd -s 1 1 wood.png", "repeat", 1, ()),
        ("map_Kd -mm 0 1 -blendu on -bm 3 wood.png", "repeat", 3, ()),
        ("map_Kd -t 0 0 0 my  wood.png", "repeat", 1, ()),
        ("MAP_KD\twood.png", "repeat", 0, ()),
        ("map_Kd -mm 0 0.5 wood.png", "repeat", 0, ("-mm 0 0.5",)),
    ],
)
def test_options(folder, line, wrap, n_fact, warned):
    (folder / "my wood.png").write_bytes((folder / "wood.png").read_bytes())
    facts = []
    with pytest.warns(UserWarning) if warned else nullcontext([]) as caught:
        texture = load(write_obj(folder, "newmtl a\n" + line), log=facts.append).meshes[0].material.texture
    texts = [str(each.message).partition(": ")[2] for each in caught]
    assert texts == [f"the option '{option}' of map_kd is not applied" for option in warned]
    assert texture.wrap == (wrap, wrap)
    assert sum("is not applied" in fact for fact in facts) == n_fact
    assert all("m.mtl:2: the option '-" in fact for fact in facts[:n_fact])


def test_a_picture_whose_name_is_a_number(folder):
    (folder / "7").write_bytes((folder / "wood.png").read_bytes())
    assert material_of(folder, "map_Kd -s 1 1 7").texture is not None


@pytest.mark.parametrize(
    "name",
    [
        "tex/wood.png",
        "tex\\wood.png",
        '"wood.png"',
        '"tex/wood.png"',
        "TEX/Wood.PNG",
        "C:\\art\\wood.png",
        "/home/ann/Wood.png",
    ],
)
def test_how_a_name_may_be_written(folder, name):
    (folder / "tex").mkdir()
    (folder / "tex" / "wood.png").write_bytes((folder / "wood.png").read_bytes())
    assert material_of(folder, f"map_Kd {name}").texture is not None


def test_names_are_relative_to_the_material_file(folder):
    (folder / "sub").mkdir()
    (folder / "wood.png").rename(folder / "sub" / "wood.png")
    (folder / "sub" / "m.mtl").write_text("newmtl a\nmap_Kd wood.png\n")
    (folder / "model.obj").write_text("mtllib sub/m.mtl\n" + TEXTURED)
    assert load(folder / "model.obj").meshes[0].material.texture is not None


def test_other_maps_are_reported(folder):
    facts = []
    material = material_of(folder, "map_Bump bumps.png\nbump b.png\nmap_Ks shine.png", log=facts.append)
    assert material.texture is None
    for name in ("'bumps.png'", "'b.png'", "'shine.png'"):
        assert sum(name in fact and "not drawn" in fact for fact in facts) == 1


# --- sharing ------------------------------------------------------------------------------------------------


def test_a_picture_is_read_once_and_textures_are_shared(folder, monkeypatch):
    reads = []
    monkeypatch.setattr(
        mtl, "read_picture", lambda source, name, budget: reads.append(name.rpartition("/")[2]) or PIXELS
    )
    maps = {"a": "wood.png", "b": "./wood.png", "c": "-clamp on wood.png", "d": "leaf.png"}
    lines = "".join(f"newmtl {name}\nmap_Kd {rest}\n" for name, rest in maps.items())
    text = TEXTURED + "".join(f"usemtl {name}\nf 1/1 2/2 3/3\n" for name in "bc")
    (mesh,) = load_obj(folder, lines, text).meshes
    a, b, c = (material.texture for material in mesh.palette)
    assert a is b and c is not a
    assert reads == ["wood.png"]  # nor is the picture read of a material that isn't used


# --- what is missing ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["gone.png", "m.mtl", "a\0b.png"])
def test_a_missing_or_broken_picture_is_warned_of(folder, name):
    with pytest.raises(UserWarning, match=rf"m\.mtl: texture '{name}' of material 'a'.* keeps its plain colour"):
        material_of(folder, f"Kd 0.5 0 0\nmap_Kd {name}")
    with pytest.warns(UserWarning, match="plain colour"):
        (mesh,) = load(folder / "model.obj").meshes
    assert mesh.material.texture is None and mesh.material.diffuse == (0.5, 0, 0)


def test_a_missing_picture_leaves_the_default_colour(folder):
    with pytest.raises(UserWarning, match="plain colour"):
        load_obj(folder, "newmtl a\nmap_Kd gone.png")
    with pytest.warns(UserWarning):
        assert load(folder / "model.obj").meshes[0].material.diffuse == Material().diffuse


def test_a_missing_picture_that_many_use_is_read_but_once(folder):
    (folder / "bad.png").write_bytes(b"no picture")
    lines = "newmtl a\nmap_Kd bad.png\nnewmtl b\nmap_Kd bad.png\n"
    (folder / "m.mtl").write_text(lines)
    (folder / "model.obj").write_text("mtllib m.mtl\n" + TEXTURED + "usemtl b\nf 1/1 2/2 3/3\n")
    with pytest.warns(UserWarning, match="bad.png") as caught:
        load(folder / "model.obj")
    assert len(caught) == 1


def test_a_picture_that_is_too_large(folder):
    Image.fromarray(np.zeros((1, 2**14 + 1), np.uint8)).save(folder / "wide.png")
    with pytest.raises(UserWarning, match=r"wide\.png: .*16384 texels"):
        material_of(folder, "map_Kd wide.png")


def test_no_coordinates_at_all(folder):
    with pytest.raises(UserWarning, match="mesh 'box' has no texture coordinates; .* of its material 'a'"):
        load_obj(folder, "newmtl a\nmap_Kd wood.png", POINTS + "o box\nusemtl a\nf 1 2 3\n")
    with pytest.warns(UserWarning):
        assert load(folder / "model.obj").meshes[0].material.texture is None


def test_faces_without_coordinates_are_drawn_plain(folder):
    text = POINTS + "o box\nusemtl b\nf 1 2 3\nusemtl a\nf 1/1 2/2 3/3\nf 1/1 3/3 4\nusemtl b\nf 2 3 4\n"
    with pytest.raises(UserWarning, match="1 face of mesh 'box' without texture coordinates, with the material 'a'"):
        load_obj(folder, "newmtl a\nKd 0.5\nmap_Kd wood.png\nnewmtl b\n", text)
    with pytest.warns(UserWarning):
        (mesh,) = load(folder / "model.obj").meshes
    has_texture = [mesh.palette[number].texture is not None for number in mesh.face_material]
    assert has_texture == [False, True, False, False]
    assert [mesh.palette[number].name for number in mesh.face_material] == ["b", "a", "a", "b"]
    assert mesh.palette[mesh.face_material[2]].diffuse == (0.5, 0.5, 0.5)


def test_facts_count_textures(folder):
    facts = []
    material_of(folder, "map_Kd wood.png", log=facts.append)
    assert "1 face, 1 material, 1 texture, no file normals" in facts[-1]


# --- what exporters write, and what they mean -----------------------------------------------------------------


def doubtful_material_of(folder, lines) -> Material:
    (folder / "m.mtl").write_text("newmtl a\n" + lines)
    (folder / "model.obj").write_text("mtllib m.mtl\n" + TEXTURED)
    return load(folder / "model.obj").meshes[0].material


@pytest.mark.parametrize(
    ("lines", "field", "expected", "said"),
    [
        ("Tr 1.0", "opacity", 1.0, "2: Tr 1 of 'a' is taken as its opacity"),
        ("Tr 1.5", "opacity", 1.0, "2: an opacity of 1.5 of 'a' is beyond 1"),
        ("d 7", "opacity", 1.0, "2: an opacity of 7 of 'a' is beyond 1"),
        ("Kd 1 0 0\nd 0", "opacity", 0.0, "3: the material 'a' is invisible: opacity 0"),
        ("Ks 1 1 1\nNs 0", "specular", (0, 0, 0), "3: Ns 0 would spread the highlight of 'a'"),
        ("Ns 0.25\nKs 1 1 1", "specular", (0, 0, 0), "2: Ns 0.25 would spread"),
        ("Ks 1 1 1\nNs 1e11", "shininess", 1e6, r"3: Ns 1e\+11 of 'a' is beyond 1e\+06"),
        ("Ns -5\nKs 1 1 1", "shininess", Material().shininess, "2: 'Ns' takes a number"),
        ("Ns nan", "shininess", Material().shininess, "2: 'Ns' takes a number"),
        ("Ns", "shininess", Material().shininess, "2: 'Ns' takes a number .* not ''"),
        ("d inf", "opacity", 1.0, "2: 'd' takes a number"),
        ("Kd red", "diffuse", Material().diffuse, "2: 'Kd' takes numbers .* not 'red'"),
        ("Kd -1 0 0", "diffuse", Material().diffuse, "2: 'Kd' takes numbers"),
        ("Kd nan 0 0", "diffuse", Material().diffuse, "2: 'Kd' takes numbers"),
        ("Kd 255 51 0", "diffuse", (1, 0.2, 0), "2: 'Kd 255 51 0' reads as bytes"),
        ("Kd 2.5 1 0", "diffuse", (1, 0.4, 0), "2: 'Kd 2.5 1 0' would reflect more light than there is"),
        ("Kd 0.5 0.25", "diffuse", (0.5, 0.25, 0.5), "2: 'Kd 0.5 0.25': a colour of two numbers"),
        ("Kd spectral x.rfl 1", "diffuse", Material().diffuse, "2: 'Kd spectral x.rfl 1': the spectral form"),
        ("Kd 0.5\nillum 42", "diffuse", (0.5,) * 3, "3: illum 42 is none of 0..10"),
    ],
)
def test_doubtful_lines_are_drawn_sensibly_and_warned_of(folder, lines, field, expected, said):
    with pytest.warns(UserWarning, match=rf"m\.mtl:{said}"):
        material = doubtful_material_of(folder, lines)
    assert getattr(material, field) == expected


@pytest.mark.parametrize(
    ("mtl", "opacities"),
    [
        ("newmtl a\nTr 0.25\nnewmtl b\nTr 0", [0.75, 1]),
        ("newmtl a\nTr 1\nnewmtl b\nTr 0.25", [1, 0.25]),  # MeshLab's
        ("newmtl a\nTr 1\nnewmtl b\nTr 0", [1, 1]),
        ("# Converted by Meshlab Group\nnewmtl a\nTr 0.25\nnewmtl b\nTr 0.5", [0.25, 0.5]),
        ("newmtl a\nTr 0.25\nd 0.25\nnewmtl b\nTr 0.125", [0.25, 0.125]),
        ("newmtl a\nTr 0.25\nd 0.75\nnewmtl b\nTr 0.125", [0.75, 0.875]),
        ("newmtl a\nTr 0\nd 1\nnewmtl b\nTr 1", [1, 1]),
        ("newmtl a\nTr 0.5\nd 0.5\nnewmtl b\nTr 0.125", [0.5, 0.875]),
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_what_tr_means_is_found_in_the_file(folder, mtl, opacities):
    (folder / "m.mtl").write_text(mtl + "\n")
    (folder / "model.obj").write_text(
        "mtllib m.mtl\n" + TEXTURED.replace("usemtl a", "usemtl b\nf 1/1 2/2 3/3\nusemtl a")
    )
    palette = load(folder / "model.obj").meshes[0].palette
    assert [each.opacity for each in sorted(palette, key=lambda each: each.name)] == opacities


def test_xyz_colours_are_converted(folder):
    assert np.allclose(material_of(folder, "Kd xyz 0.475235 0.5 0.544415").diffuse, 0.5, atol=1e-4)


def test_an_ambient_1_beside_a_colour_is_as_the_colour(folder):
    facts = []
    assert material_of(folder, "Ka 1 1 1\nKd 0.5 0 0", log=facts.append).ambient == (0.5, 0, 0)
    assert any("m.mtl:2: 'Ka 1 1 1'" in fact for fact in facts)
    assert material_of(folder, "Ka 0 0 0\nKd 0.5 0 0").ambient == (0, 0, 0)
    assert material_of(folder, "Ka 1 1 1\nKd 1 1 1").ambient == (1, 1, 1)


def test_many_doubtful_lines_are_counted(folder):
    with pytest.warns(UserWarning) as caught:
        doubtful_material_of(folder, "Kd red\n" * 500)
    assert len(caught) == 20 and str(caught[-1].message).endswith("(and 480 lines more)")


def test_materials_that_nobody_uses_are_not_warned_of(folder, recwarn):
    material_of(folder, "Kd 1 0 0\nnewmtl unused\nd 0\nKd red")
    assert not [each for each in recwarn if "m.mtl" in str(each.message)]
