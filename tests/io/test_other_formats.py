"""What is said of files that aren't what their names say, or that no reader takes."""

import gzip

import pytest
from helpers.model_bytes import GLB, box, exported, gltf_with

from rasterizer.errors import ModelError
from rasterizer.io.formats import FORMATS, names
from rasterizer.io.loader import load

STEP = b"ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('x'),'2;1');\n" + b"#1=POINT();\n" * 9
GOOD = {
    "obj": exported(box(), "obj"),
    "stl": exported(box(), "stl"),
    "ply": exported(box(), "ply"),
    "off": exported(box(), "off"),
    "glb": GLB,
    "gltf": gltf_with(lambda tree, primitive: None),
}


@pytest.mark.parametrize("format", [*names(is_scene=False)])
@pytest.mark.parametrize("content", sorted(GOOD))
def test_a_model_under_the_name_of_another_format_is_told(tmp_path, content, format):
    path = tmp_path / f"part.{format}"
    path.write_bytes(GOOD[content])
    if content == format:
        assert load(path).n_face == 12
        return
    with pytest.raises(ModelError, match=f"^{path}: .*; by its content it is {content}: --input-format {content}, or"):
        load(path)
    assert load(path, format=content).n_face == 12


@pytest.mark.parametrize("format", [*names(is_scene=False)])
@pytest.mark.parametrize(
    ("data", "hint"),
    [
        (
            b"version https://git-lfs.github.com/spec/v1\noid sha256:ab\nsize 123456\n",
            "a Git LFS pointer, .*git lfs pull",
        ),
        (b"<!DOCTYPE html>\n<html><body>Not Found</body></html>" + b" " * 99, "an HTML page, perhaps of a download"),
        (b"\n<HTML>" + b"x" * 200, "an HTML page"),
        (gzip.compress(GOOD["obj"]), "compressed: unpack it first"),
        (STEP, "a STEP file: .*export STL"),
        (b"Kaydara FBX Binary  \0" + b"\x1a\0" * 90, "an FBX file: export glTF"),
        (b"BLENDER-v280" + b"\0" * 200, "a Blender file"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".encode("utf-16"), "UTF-16: save it as UTF-8"),
        (b'<?xml version="1.0"?>\n<COLLADA xmlns="x">' + b" " * 99, "a COLLADA file"),
    ],
)
def test_what_is_no_model_is_told(tmp_path, format, data, hint):
    path = tmp_path / f"part.{format}"
    path.write_bytes(data)
    with pytest.raises(ModelError, match=hint) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}: ") and "by its content" not in str(caught.value)


@pytest.mark.parametrize(
    ("suffix", "hint"),
    [("STEP", "export STL, 3MF or OBJ"), ("fbx", "export glTF"), ("zip", "unpack it"), ("las", "a point cloud has no"),
     ("mtl", "give that one"), ("png", "outputs stand behind -o")],
)  # fmt: skip
def test_a_suffix_that_no_reader_takes_says_what_to_do(tmp_path, suffix, hint):
    with pytest.raises(ModelError, match=f"unknown format '{suffix.lower()}'; readable are .*; .*{hint}"):
        load(tmp_path / f"part.{suffix}")
    assert not set(FORMATS) & {suffix.lower()}


def test_a_good_file_with_another_fault_gets_no_hint(tmp_path):
    for format, data in GOOD.items():
        path = tmp_path / f"part.{format}"
        path.write_bytes(data[: len(data) // 2])
        try:
            load(path)
        except ModelError as fault:
            assert "by its content" not in str(fault) and "the file is" not in str(fault).replace("the file is cut", "")


def test_marks_of_text_files_are_read_over(tmp_path):
    """An editor on Windows may put a byte order mark before a text."""
    texts = {"obj": exported(box(), "obj"), "stl": exported(box(), "stl_ascii"), "off": exported(box(), "off")}
    texts["gltf"] = gltf_with(lambda tree, primitive: None)
    for format, data in texts.items():
        path = tmp_path / f"part.{format}"
        path.write_bytes(b"\xef\xbb\xbf" + data)
        assert load(path).n_face == 12
