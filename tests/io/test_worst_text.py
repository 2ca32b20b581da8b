"""A megabyte of the worst that each grammar allows: every reader ends soon, with little memory, in a picture or in an
error of the package."""

import struct
import subprocess
import sys
import time
import tracemalloc
import warnings
import zlib

import pytest

import rasterizer as rz

MB = 1_000_000
SECONDS, BYTES = 2.0, 300 * MB  # of this process's own time
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
DAE = '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
MESHES = '{"meshes":[{"vertices":[[0,0,0],[1,0,0],[0,1,0]],"faces":[[0,1,2]]}'
XAML = '<Model3DGroup xmlns="http://schemas.microsoft.com/winfx/2006/xaml/presentation">'


def many(text, size=None):
    """A text so often that it is a megabyte, or in each place its number."""
    n = MB // len(size or text)
    return text * n if size is None else "".join(text.format(k) for k in range(n))


def gltf(rest):
    return '{"asset":{"version":"2.0"},' + rest + "}"


CASES = {
    "obj": [
        "v " + many("1 ") + "\nf 1 2 3\n", TRIANGLE + "f " + many("1 "), TRIANGLE + "f " + many("1/"),
        TRIANGLE + many("f 1 2 3 \\\n"), TRIANGLE + " " * MB + "f 1 2 3\n", TRIANGLE + "mtllib " + many("a "),
        TRIANGLE + "mtllib " + many("a/") + "\nf 1 2 3", TRIANGLE + many("mtllib a.mtl\n") + "f 1 2 3",
        TRIANGLE + many("usemtl m{}\nf 1 2 3\n", " " * 40), TRIANGLE + many("o m{}\nf 1 2 3\n", " " * 20),
        TRIANGLE + many("g m{}\nf 1 2 3\n", " " * 20), TRIANGLE + "#" * MB, TRIANGLE + "\\" * MB, "v" * MB,
        TRIANGLE + "usemtl x" + " " * MB + "y\nf 1 2 3", TRIANGLE + " " * MB + "# c\nf 1 2 3", many("# \\\n"),
        TRIANGLE + "o " + " " * MB + "x\nf 1 2 3", TRIANGLE + "g" + " " * MB + "\nf 1 2 3", many("\\ "),
        TRIANGLE + "s " + " " * MB + "1\nf 1 2 3", TRIANGLE + "f 1 2 3" + " " * MB,
    ],
    "ply": [
        "ply\nformat ascii 1.0\ncomment TextureFile x" + " " * MB + "y\nelement vertex 0\nend_header\n",
        "ply\nformat ascii 1.0\n" + many("comment TextureFile x\n") + "element vertex 0\nend_header\n",
        "ply\nformat ascii 1.0\ncomment " + "\n" * MB + "element vertex 0\nend_header\n",
        "ply\nformat ascii 1.0\n" + many("comment  ") + "\nend_header\n", "ply\n" + many("end_heade"),
        "ply\nformat ascii 1.0\n" + many("element e{} 0\n", " " * 16) + "end_header\n",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar float x\nend_header\n" + many("3 "),
        "ply\n" + many("comment TextureFile\n") + "end_header\n", "ply\n" + many("comment TextureFile x \n "),
    ],
    "stl": ["solid " + many("a "), "solid a\n" + many("vertex 1 2 3\n"), "solid a\n" + many("facet normal "),
            "solid a\n" + many("endsolid a\nsolid a\n"), "solid" + " " * MB, many("solid\n"),
            "solid\n" + many("end "), many("solid x\n")],
    "off": ["OFF\n" + many("#\n") + "3 1 0\n", "OFF " + " " * MB + "3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2",
            "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n" + many("3 0 1 2 "), "OFF 1 1 1\n" + many("1 "), many("OFF "),
            many("\n ")],
    "dae": ["<COLLADA>" + many("<vcount "), "<COLLADA>" + many("<node>"), DAE + "<node>" * 70_000 + "</node>" * 70_000,
            "<COLLADA " + many('a{}="b" ', " " * 12) + "/>", DAE + "<asset>" + many("&amp;") + "</asset></COLLADA>",
            DAE + '<float_array id="f" count="3">' + many(" nan") + "</float_array></COLLADA>"],
    "gltf": [many('{"a":'), "[" * MB, gltf('"a":' + "1" * MB),
             gltf('"extensionsUsed":[' + many('"E{}",', " " * 9) + '""]'),
             gltf('"nodes":[' + many('{{"children":[{}]}},', " " * 20) + '{}],"scenes":[{"nodes":[0]}]'),
             gltf('"materials":[' + many("{},") + "{}]"), gltf('"buffers":[{"uri":"' + many("a/") + '"}]'),
             gltf('"buffers":[{"byteLength":3,"uri":"data:' + ";" * MB + '"}]'), gltf('"a":"' + many("\\u0041") + '"')],
    "xaml": [XAML + "<Model3DGroup>" * 33_000 + "</Model3DGroup>" * 33_000 + "</Model3DGroup>", XAML + many("<a>")],
    "json": [many('{"meshes":'), '{"meshes":[' + many("[") + "]", "{" + many('"k{}":1,', " " * 10) + '"k9":2}',
             "[" * MB, many('{"a":'), '{"meshes":[' + '{"a":' * 900 + "1" + "}" * 900 + "]}",
             MESHES + '],"up":' + "[" * 900 + "]" * 900 + "}",
             MESHES + '],"lights":[' + many('"studio",') + '""]}', '{"a":"' + many("\\n") + '"}',
             '{"meshes":[{"vertices":[' + many("[0,0,0],") + '[1,0,0]],"faces":[[0,1,2]]}]}'],
}  # fmt: skip


def seconds_of(call) -> float:
    """Call what may refuse, in a short message; return how long it took, of the process's time."""
    start = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            call()
        except rz.RasterizerError as fault:
            assert len(str(fault)) < 500, f"{str(fault)[:500]} …"
    return time.process_time() - start


def assert_soon(call, what):
    """Measure once more what took long: tracing memory takes time itself, and so does another's work."""
    tracemalloc.start()
    seconds, (_, peak) = seconds_of(call), tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < BYTES, f"{what}: {peak / MB:.0f} MB"
    seconds = seconds_of(call) if seconds > SECONDS else seconds
    assert seconds < SECONDS, f"{what}: {seconds:.1f} s"


@pytest.mark.parametrize("format", CASES)
def test_text_of_each_format(format):
    for text in CASES[format]:
        assert_soon(lambda text=text: rz.load(text.encode(), format=format), f"{format}: {text[:60]!r}")


@pytest.mark.parametrize("line", [
    "map_Kd " + "-clamp on " * 100_000 + "a.png", "map_Kd " + "a/" * 500_000, "map_Kd" + " " * MB + "a.png",
    "map_Kd " + "./" * 500_000,
    "map_Kd -o " + "1 " * 500_000, "Kd " + "1 " * 500_000, "newmtl " + "m" * MB, "Kd 1 1 1\n" * 100_000,
    "".join(f"newmtl m{k}\nKd 1 0 0\n" for k in range(40_000)), "map_Kd a.png\n" * 70_000,
    "".join(f"newmtl m{k}\nmap_Kd {k}.png\n" for k in range(35_000)),
])  # fmt: skip
def test_lines_of_materials(line, tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl a\n" + line)
    (tmp_path / "a.obj").write_text("mtllib a.mtl\n" + TRIANGLE + "vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n")
    assert_soon(lambda: rz.load(tmp_path / "a.obj"), line[:60])


def bmp(width, height, data, compression):
    """A picture of runs of 8 bits."""
    header = struct.pack("<IiiHHIIiiII", 40, width, height, 1, 8, compression, len(data), 1, 1, 256, 0)
    start = 14 + len(header) + 1024
    return b"BM" + struct.pack("<IHHI", start + len(data), 0, 0, start) + header + bytes(1024) + data


def tiff(width, height, tile, n_byte=64):
    """A picture of one tile, packed."""
    tags = {256: width, 257: height, 258: 8, 259: 8, 262: 1, 277: 1, 322: tile[0], 323: tile[1], 324: 8, 325: n_byte}
    data = zlib.compress(bytes(n_byte)).ljust(n_byte, b"\0")
    entries = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags.items())
    return b"II*\0" + struct.pack("<I", 8 + len(data)) + data + struct.pack("<H", len(tags)) + entries + bytes(4)


def png(width, height, data):
    def chunk(name, body):
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


PICTURES = {
    "tiles of 2 GB": tiff(16, 16, (32768, 65520)),
    "runs that skip": bmp(8000, 4000, b"\0\2\xff\xff" * 2250, 1),
    "runs": bmp(8000, 4000, b"\xff\0" * 4500, 1),
    "nothing packed": png(8000, 4000, zlib.compress(bytes(10))),
    "zeros packed": png(8000, 4000, zlib.compress(bytes(24_001 * 4000))),
}


@pytest.mark.parametrize("name", PICTURES)
def test_pictures(name, tmp_path):
    (tmp_path / "a.png").write_bytes(PICTURES[name])
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd a.png\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\n" + TRIANGLE + "vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n")
    code = f"import rasterizer as rz; rz.load({str(tmp_path / 'a.obj')!r})"
    limit = "import resource; resource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30)); " * (sys.platform == "linux")
    done = subprocess.run([sys.executable, "-c", limit + code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert_soon(lambda: rz.load(tmp_path / "a.obj"), name)
