"""MTL files: materials, textures, and what is said where a line is doubtful or a picture is missing."""

import warnings

import numpy as np
import pytest
from PIL import Image

from rasterizer.io.loader import load
from rasterizer.scene.material import Material
from rasterizer.scene.texture import Texture

POINTS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\n"
TEXTURED = POINTS + "usemtl a\nf 1/1 2/2 3/3\n"
PIXELS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [90, 90, 90]]], np.uint8)
ALPHA = np.array([[0, 51], [128, 255]], np.uint8)


@pytest.fixture
def folder(tmp_path):
    pictures = {"wood": PIXELS, "leaf": np.dstack([PIXELS, ALPHA]), "mask": ALPHA, "large": np.zeros((3, 3), np.uint8)}
    for name, pixels in pictures.items():
        Image.fromarray(pixels).save(tmp_path / f"{name}.png")
    return tmp_path


def load_obj(folder, mtl, text=TEXTURED, **options):
    """Load a model with a material file; return its mesh, and what was warned of behind the name of the file."""
    (folder / "m.mtl").write_text(mtl)
    (folder / "model.obj").write_text("mtllib m.mtl\n" + text)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        (mesh,) = load(folder / "model.obj", **options).meshes
    return mesh, [str(each.message).removeprefix(f"{folder}/") for each in caught]


def material_of(folder, lines, **options) -> Material:
    """The material of a file without any fault."""
    mesh, warned = load_obj(folder, "newmtl a\n" + lines, **options)
    assert not warned, f"{lines!r}: {warned}"
    return mesh.material


def test_materials(folder):
    for lines, expected in (
        ("Kd 0.001 0.5 1", Material(diffuse=(0.001, 0.5, 1), specular=0)),
        ("Kd 0.5", Material(diffuse=0.5, specular=0)),
        ("Ka 0.1 0.2 0.3\nKd 1 0 0", Material(ambient=(0.1, 0.2, 0.3), diffuse=(1, 0, 0), specular=0)),
        ("Ka 0 0 0\nKd 0.5 0 0", Material(diffuse=(0.5, 0, 0), specular=0)),  # what no lamp reaches isn't black
        ("Ka 1 1 1\nKd 1 1 1", Material(ambient=1, diffuse=1, specular=0)),
        ("Ka 1 1 1\nKd 0.5 0 0", Material(diffuse=(0.5, 0, 0), specular=0)),  # beside a colour it is as that
        ("Kd 1 1 1\nKs 0.3 0.3 0.3\nNs 96.5", Material(diffuse=1, specular=0.3, shininess=96.5)),
        ("Kd 1 1 1\nKs 1 1 1\nillum 1", Material(diffuse=1, specular=0)),
        ("Ka 1 1 1\nKd 0.5 0 0\nKs 1 1 1\nKe 0 0 2\nillum 0",
         Material(ambient=0, diffuse=0, specular=0, emissive=(0.5, 0, 2))),
        ("Kd 0 0 0\nKe 1 2 3", Material(diffuse=0, specular=0, emissive=(1.0, 2, 3))),
        ("d 0.25", Material(specular=0, opacity=0.25)),
        ("Tr 0.25", Material(specular=0, opacity=0.75)),
        ("Tr 0.25\nd 1", Material(specular=0)),
        ("d -halo 0.5", Material(specular=0, opacity=0.5)),
        ("  KD\t0.5 0.5 0.5 # grey", Material(diffuse=0.5, specular=0)),
        ("", Material(specular=0)),
        *((f"Kd 1 1 1\nillum {k}", Material(diffuse=1, specular=0)) for k in (4, 6, 7, 9)),  # glass without d is opaque
    ):  # fmt: skip
        material = material_of(folder, lines)
        assert material.name == "a"
        for field in ("ambient", "diffuse", "specular", "shininess", "emissive", "opacity"):
            found, wanted = getattr(material, field), getattr(expected, field)
            assert found == wanted, f"{lines!r}: {field} {found} != {wanted}"
    xyz = material_of(folder, "Kd xyz 0.475235 0.5 0.544415").diffuse
    assert np.allclose(xyz, 0.5, atol=1e-4), xyz


def test_doubtful_lines_are_drawn_sensibly_and_warned_of(folder):
    plain = Material()
    for lines, field, expected, said in (
        ("Tr 1.0", "opacity", 1.0, "2: Tr 1 of 'a' is taken as its opacity"),
        ("Tr 1.5", "opacity", 1.0, "2: an opacity of 1.5 of 'a' is beyond 1"),
        ("d 7", "opacity", 1.0, "2: an opacity of 7 of 'a' is beyond 1"),
        ("Kd 1 0 0\nd 0", "opacity", 0.0, "3: the material 'a' is invisible: opacity 0"),
        ("Ks 1 1 1\nNs 0", "specular", (0, 0, 0), "3: Ns 0 would spread the highlight of 'a'"),
        ("Ns 0.25\nKs 1 1 1", "specular", (0, 0, 0), "2: Ns 0.25 would spread"),
        ("Ks 1 1 1\nNs 1e11", "shininess", 1e6, "3: Ns 1e+11 of 'a' is beyond 1e+06"),
        ("Ns -5\nKs 1 1 1", "shininess", plain.shininess, "2: 'Ns' takes a number"),
        ("Ns nan", "shininess", plain.shininess, "2: 'Ns' takes a number"),
        ("Ns", "shininess", plain.shininess, "2: 'Ns' takes a number"),
        ("d inf", "opacity", 1.0, "2: 'd' takes a number"),
        ("Kd red", "diffuse", plain.diffuse, "2: 'Kd' takes numbers"),
        ("Kd -1 0 0", "diffuse", plain.diffuse, "2: 'Kd' takes numbers"),
        ("Kd -1e-7 0.5 0", "diffuse", (0, 0.5, 0), "2: 'Kd -1e-7 0.5 0' is a hair below 0"),
        ("Kd nan 0 0", "diffuse", plain.diffuse, "2: 'Kd' takes numbers"),
        ("Kd 255 51 0", "diffuse", (1, 0.2, 0), "2: 'Kd 255 51 0' reads as bytes"),
        ("Kd 2.5 1 0", "diffuse", (1, 0.4, 0), "2: 'Kd 2.5 1 0' would reflect more light than there is"),
        ("Kd 0.5 0.25", "diffuse", (0.5, 0.25, 0.5), "2: 'Kd 0.5 0.25': a colour of two numbers"),
        ("Kd spectral x.rfl 1", "diffuse", plain.diffuse, "2: 'Kd spectral x.rfl 1': the spectral form"),
        ("Kd 0.5\nillum 42", "diffuse", (0.5,) * 3, "3: illum 42 is none of 0..10"),
    ):
        mesh, warned = load_obj(folder, "newmtl a\n" + lines)
        assert any(text.startswith(f"m.mtl:{said}") for text in warned), f"{lines!r}: {warned}"
        assert getattr(mesh.material, field) == expected, f"{lines!r}: {getattr(mesh.material, field)} != {expected}"
    _, warned = load_obj(folder, "newmtl a\n" + "Kd red\n" * 500)
    assert len(warned) == 20 and "not 'red'" in warned[0] and warned[-1].endswith("which is left out")
    _, warned = load_obj(folder, "newmtl a\nKd 1 0 0\nnewmtl unused\nd 0\nKd red")
    assert not warned, "materials that nobody uses"


def test_what_tr_means_is_found_in_the_file(folder):
    text = TEXTURED.replace("usemtl a", "usemtl b\nf 1/1 2/2 3/3\nusemtl a")
    for mtl, expected in (
        ("newmtl a\nTr 0.25\nnewmtl b\nTr 0", [0.75, 1]),
        ("newmtl a\nTr 1\nnewmtl b\nTr 0.25", [1, 0.25]),  # MeshLab's
        ("newmtl a\nTr 1\nnewmtl b\nTr 0", [1, 1]),
        ("# Converted by Meshlab Group\nnewmtl a\nTr 0.25\nnewmtl b\nTr 0.5", [0.25, 0.5]),
        ("newmtl a\nTr 0.25\nd 0.25\nnewmtl b\nTr 0.125", [0.25, 0.125]),
        ("newmtl a\nTr 0.25\nd 0.75\nnewmtl b\nTr 0.125", [0.75, 0.875]),
        ("newmtl a\nTr 0\nd 1\nnewmtl b\nTr 1", [1, 1]),
        ("newmtl a\nTr 0.5\nd 0.5\nnewmtl b\nTr 0.125", [0.5, 0.875]),
    ):
        mesh, _ = load_obj(folder, mtl + "\n", text)
        found = [each.opacity for each in sorted(mesh.palette, key=lambda each: each.name)]
        assert found == expected, f"{mtl!r}: {found} != {expected}"


# --- what a map does ----------------------------------------------------------------------------------------


def test_map_kd_is_the_texture_and_multiplies_kd(folder):
    material = material_of(folder, "Kd 0.8 0.4 0.2\nKa 0.1 0.1 0.1\nmap_Kd wood.png")
    np.testing.assert_array_equal(material.texture.image, Texture(PIXELS).image)
    assert material.diffuse == (0.8, 0.4, 0.2) and material.ambient == (0.1, 0.1, 0.1)
    assert material.texture.name.endswith("wood.png") and material.texture.wrap == ("repeat", "repeat")
    facts = []
    mesh, _ = load_obj(folder, "newmtl a\nmap_Kd wood.png", log=facts.append)
    assert mesh.material.diffuse == mesh.material.ambient == (1.0, 1.0, 1.0), "without Kd the picture is the colour"
    assert mesh.uv.tolist() == [[0, 0], [1, 0], [1, 1]], "v points up in OBJ as it does here"
    assert "1 face, 1 material, 1 texture, no file normals" in facts[-1]
    assert material_of(folder, "map_Kd wood.png\nKd 0.5").diffuse == (0.5, 0.5, 0.5)


def test_alpha_is_the_pictures_own_or_the_grey_of_map_d_undecoded(folder):
    own = ("map_Kd leaf.png", "map_Kd leaf.png\nmap_d leaf.png", "map_d leaf.png\nmap_Kd leaf.png")
    for lines in (*own, "d 0.5\nmap_Kd wood.png\nmap_d mask.png", "Kd 0.5 0 0\nmap_d mask.png"):
        material = material_of(folder, lines)
        np.testing.assert_array_equal(material.texture.image[..., 3], (ALPHA / 255).astype(np.float32), err_msg=lines)
        plain = Texture(PIXELS).image if "map_Kd" in lines else np.ones((2, 2, 4))
        np.testing.assert_array_equal(material.texture.image[..., :3], plain[..., :3], err_msg=lines)
        assert material.opacity == (0.5 if lines.startswith("d ") else 1.0), lines
    mean = material_of(folder, "map_d wood.png").texture.image[..., 3]
    np.testing.assert_allclose(mean, [[1 / 3, 1 / 3], [1 / 3, 90 / 255]], rtol=1e-6)


def test_what_is_left_out_is_reported(folder):
    facts = []
    material = material_of(folder, "Kd 1 1 1\nKs 1 1 1\nillum 0\nmap_Kd wood.png", log=facts.append)
    assert material.diffuse == (1, 1, 1) and material.specular == (0, 0, 0) and material.emissive == (0, 0, 0)
    _, said = load_obj(folder, "newmtl a\nmap_Bump bumps.png\nbump b.png\nmap_Ks shine.png\nnewmtl unused\nbump c.png")
    assert [text.partition(": ")[2] for text in said] == [
        f"the texture '{name}.png' ({key}) is not drawn"
        for name, key in (("bumps", "map_bump"), ("b", "bump"), ("shine", "map_ks"))
    ]
    material_of(folder, "Ka 1 1 1\nKd 0.5 0 0", log=facts.append)
    material = material_of(folder, "Ka 0 0 0\nKd 1 0 0\nnewmtl other\nKa 0.1 0 0", log=facts.append)
    assert material.ambient == (0, 0, 0), "a file that has other ambient coefficients means it"
    for words in [("illum 0", ""), ("m.mtl:2: 'Ka 1 1 1'", "")]:
        assert sum(all(word in fact for word in words) for fact in facts) == 1, (words, facts)


def test_options_of_maps(folder):
    for name in ("my wood.png", "7"):  # the second could be a number of the option before it
        (folder / name).write_bytes((folder / "wood.png").read_bytes())
    for line, wrap, n_fact, warned in (
        ("map_Kd -clamp on wood.png", "clamp", 0, ()),
        ("map_Kd -clamp off wood.png", "repeat", 0, ()),
        ("map_Kd -s 2 2 2 -o 0.5 -clamp on wood.png", "clamp", 0, ()),
        ("map_Kd wood.png -s 2 2 2 -clamp on", "clamp", 0, ()),
        ("map_Kd my wood.png -mm 0 0.5", "repeat", 0, ("-mm 0 0.5",)),
        ("map_Kd -s 1 1 wood.png", "repeat", 0, ()),
        ("map_Kd -s 1 1 7", "repeat", 0, ()),
        ("map_Kd -colorspace sRGB wood.png", "repeat", 0, ()),
        ("map_Kd wood.png -colorspace linear", "repeat", 0, ("-colorspace linear",)),
        ("map_Kd -mm 0 1 -blendu on -bm 3 wood.png", "repeat", 3, ()),
        ("map_Kd -t 0 0 0 my  wood.png", "repeat", 1, ()),
        ("MAP_KD\twood.png", "repeat", 0, ()),
        ("map_Kd -mm 0 0.5 wood.png", "repeat", 0, ("-mm 0 0.5",)),
    ):
        facts = []
        mesh, said = load_obj(folder, "newmtl a\n" + line, log=facts.append)
        assert said == [f"m.mtl:2: the option '{option}' of map_kd is not applied" for option in warned], line
        assert mesh.material.texture.wrap == (wrap, wrap), f"{line}: {mesh.material.texture.wrap} != {(wrap, wrap)}"
        assert sum("is not applied" in fact for fact in facts) == n_fact, line
        assert all("m.mtl:2: the option '-" in fact for fact in facts[:n_fact]), line


def test_scale_and_offset_move_the_coordinates_of_their_faces(folder):
    for lines, expected in (
        ("map_Kd -s 2 4 -o 0.5 wood.png", [[0.5, 0], [2.5, 0], [2.5, 4]]),
        ("map_Kd wood.png -o 1 2", [[1, 2], [2, 2], [2, 3]]),
        ("map_d -s 3 mask.png", [[0, 0], [3, 0], [3, 1]]),
        ("map_Kd wood.png\nmap_d -s 3 mask.png", [[0, 0], [1, 0], [1, 1]]),  # one texture: it is laid as the colour
    ):
        text = TEXTURED + "usemtl b\nf 1/1 3/3 4/1\n"
        unused = "newmtl c\nmap_Kd -s 9 wood.png"
        mesh, said = load_obj(folder, f"newmtl a\n{lines}\nnewmtl b\nmap_Kd wood.png\n{unused}", text)
        uv = mesh.uv[mesh.faces] if mesh.uv.ndim == 2 else mesh.uv
        assert not said and uv[0].tolist() == expected and uv[1].tolist() == [[0, 0], [1, 1], [0, 0]], lines


def test_map_d_of_another_size_is_resized(folder):
    for name, color, shape in (("large", "wood", (3, 3)), ("mask", "huge", (4, 6))):
        Image.fromarray(np.full((4, 6, 3), 90, np.uint8)).save(folder / "huge.png")
        texture = material_of(folder, f"map_Kd {color}.png\nmap_d {name}.png").texture
        assert texture.shape == shape and texture.has_alpha, name
    assert texture.image[..., 3].min() == 0.0 and texture.image[..., 3].max() == 1.0
    np.testing.assert_allclose(texture.image[..., :3], texture.image[0, 0, 0])


def test_other_words_of_maps(folder):
    mesh, said = load_obj(folder, "newmtl a\nmap_Ka wood.png")
    assert mesh.material.texture is not None and "map_Ka and no map_Kd" in said[0] and len(said) == 1
    assert material_of(folder, "map_Ka leaf.png\nmap_Kd wood.png").texture.name.endswith("wood.png")
    mesh, said = load_obj(folder, "newmtl a\nKd 1 0 0\nmap_Kd")
    assert mesh.material.diffuse == (1, 0, 0) and said == ["m.mtl:3: map_kd names no picture; the line is left out"]


def test_how_a_name_may_be_written(folder):
    (folder / "tex").mkdir()
    (folder / "tex" / "wood.png").write_bytes((folder / "wood.png").read_bytes())
    names = ["tex/wood.png", "tex\\wood.png", '"wood.png"', '"tex/wood.png"', "TEX/Wood.PNG", "C:\\art\\wood.png"]
    for name in (*names, "/home/ann/Wood.png"):
        assert material_of(folder, f"map_Kd {name}").texture is not None, name
    (folder / "wood.png").unlink()  # names are relative to the material file
    (folder / "tex" / "m.mtl").write_text("newmtl a\nmap_Kd wood.png\n")
    (folder / "model.obj").write_text("mtllib tex/m.mtl\n" + TEXTURED)
    assert load(folder / "model.obj").meshes[0].material.texture is not None


def test_a_picture_is_read_once_and_textures_are_shared(folder):
    maps = {"a": "wood.png", "b": "./wood.png", "c": "-clamp on wood.png", "d": "gone.png"}
    lines = "".join(f"newmtl {name}\nmap_Kd {rest}\n" for name, rest in maps.items())
    uses = "".join(f"usemtl {name}\nf 1/1 2/2 3/3\n" for name in "bc")
    mesh, warned = load_obj(folder, lines, TEXTURED + uses)
    a, b, c = (material.texture for material in mesh.palette)
    assert a is b and c is not a and not warned, "the picture of a material that isn't used is not looked for"
    (folder / "bad.png").write_bytes(b"no picture")
    lines = "newmtl a\nmap_Kd bad.png\nnewmtl b\nmap_Kd bad.png\n"
    assert len(load_obj(folder, lines, TEXTURED + "usemtl b\nf 1/1 2/2 3/3\n")[1]) == 1


def test_faces_without_coordinates_are_drawn_plain(folder):
    mesh, (warned,) = load_obj(folder, "newmtl a\nmap_Kd wood.png", POINTS + "o box\nusemtl a\nf 1 2 3\n")
    assert "mesh 'box' has no texture coordinates; " in warned and " of its material 'a'" in warned
    assert mesh.material.texture is None
    text = POINTS + "o box\nusemtl b\nf 1 2 3\nusemtl a\nf 1/1 2/2 3/3\nf 1/1 3/3 4\nusemtl b\nf 2 3 4\n"
    mesh, (warned,) = load_obj(folder, "newmtl a\nKd 0.5\nmap_Kd wood.png\nnewmtl b\n", text)
    assert "1 face of mesh 'box' without texture coordinates, with the material 'a'" in warned
    has_texture = [mesh.palette[number].texture is not None for number in mesh.face_material]
    assert has_texture == [False, True, False, False]
    assert [mesh.palette[number].name for number in mesh.face_material] == ["b", "a", "a", "b"]
    assert mesh.palette[mesh.face_material[2]].diffuse == (0.5, 0.5, 0.5)
    quad = "v 0 1 0\nusemtl a\nf 1/1 2/2 3/3 5\nf 1/1 2/2 3/3\n"  # one triangle of the first has them, one hasn't
    mesh, _ = load_obj(folder, "newmtl a\nmap_Kd wood.png", POINTS + quad)
    assert [mesh.palette[number].texture is not None for number in mesh.face_material] == [False, False, True]
