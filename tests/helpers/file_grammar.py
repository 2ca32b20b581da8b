"""Grammars of the files that are read: one a format, which writes a sound file, or one with hostile numbers, counts
that lie, tables that refer to anything, and bytes that are cut.

    name, files = make_case("glb", 17)            # the same files each time

`GRAMMARS` holds a function a format. It gets a `Draw`, which is asked for every number, count and word: it answers with
what is given, or now and then with something else; how often, is drawn once a case. A case whose `Draw` is sound never
does, and its file must be read.
"""

import base64
import io
import json
import struct
import zipfile
import zlib
from copy import deepcopy
from functools import cache
from random import Random

import numpy as np
from lxml import etree
from PIL import Image

from helpers.model_bytes import COLORED_THREEMF, THREEMF, threemf, zipped
from helpers.other_models import INSTANCE, NODES, PICTURED, PRODUCT, RED, REP, SHOWN, XAML, dae, threedxml
from rasterizer.io.model_file import FEW

RATES = (0.0, 0.003, 0.003, 0.01, 0.01, 0.03, 0.1, 0.3)  # how often a case's answers are hostile
_WORDS_OF_ASCII = """
    -1 0 -0 -0.0 1 2 3 255 256 65535 65536 2147483647 2147483648 4294967295 4294967296 -2147483649 9223372036854775807
    9223372036854775808 18446744073709551616 1e30 -1e39 1e308 -1e308 1e309 1e400 1e-320 5e-324 1e-46 1e999999999
    3.4028235e38 3.4028236e38 nan -nan NaN nan(ind) inf -inf Infinity 1.#INF -1.#IND + - . e5 1e 1e+ +-1 --1 1.2.3 1,5
    0x10 0x1p3 007 1_0 1d5 1f 1/0 a # \\ " true None"""
WORDS = (  # in the place of numbers that are text
    *_WORDS_OF_ASCII.split(), "", "9" * 400, "-" + "9" * 5000, "0." + "0" * 330 + "1", "0.1" + "0" * 900 + "1",
    "\u0663", "\uff11", "\u22121", "\u00a01", "1\0", "1\0002", "\ufeff1", "\x851", "\ud800",
)  # fmt: skip
VALUES = (  # in the place of values of JSON
    None, True, False, -1, 0, 1, 2, 3, 7, -0.0, 2**31 - 1, 2**31, 2**32 - 1, 2**32, 2**63, 2**64, -(2**31) - 1, 10**20,
    10**400, 0.5, 1.0, -1.5, 1e308, -1e308, 1e39, 1e-320, 5e-324, float("inf"), -float("inf"), float("nan"), "", "a",
    "1", "nan", "../x", "/dev/zero", ".", "wood.png", "data:;base64,AAAA", "data:,", "\ud800", "a" * 300, "\0", [], [0],
    [[]], [[0, 1, 2]], [[0.0, 0.0, 0.0]] * 3, {}, {"a": 1}, [None], [1e308] * 3, [10**400] * 3, [float("nan")] * 3,
)  # fmt: skip
REALS = (
    float("nan"), float("inf"), -float("inf"), 3.4e38, -3.4e38, 1e39, 1e308, 1e-320, 1e-45, -0.0, 0.0, 1.0, -1.0, 1e20,
    1e15, 2.0**31, 2.0**53, 1e-10,
)  # fmt: skip
PICTURE = "wood.png"


class Draw(Random):
    """The answers of one case.

    Parameters
    ----------
    seed : text or number
    rate : how often an answer is hostile; None = one of RATES
    """

    def __new__(cls, seed, rate=None):
        """Make one; `Random` takes no more than a seed."""
        return super().__new__(cls)

    def __init__(self, seed, rate=None):
        super().__init__(seed)
        self.rate = self.choice(RATES) if rate is None else rate

    @property
    def is_odd(self) -> bool:
        """Whether this answer is hostile."""
        return self.rate > 0.0 and self.random() < self.rate

    def some(self, choices, least=0) -> list:
        """Return some of the choices, in their order."""
        choices = list(choices)
        kept = set(self.sample(range(len(choices)), self.randint(min(least, len(choices)), len(choices))))
        return [each for k, each in enumerate(choices) if k in kept]

    def word(self, value) -> str:
        """Return a number as text."""
        return self.choice(WORDS) if self.is_odd else f"{value:.6g}" if isinstance(value, float) else str(value)

    def words(self, *values) -> str:
        """Return numbers as text, now and then too few or too many."""
        found = [self.word(value) for value in values]
        if self.is_odd:
            found = found[: self.randrange(len(found) + 1)] + [self.choice(WORDS)] * self.choice((0, 0, 1, 2, 9))
        return self.choice(("  ", "\t", " ", "\x0b", ",")).join(found) if self.is_odd else " ".join(found)

    def real(self, value=None) -> float:
        """Return a number; None = any of a few."""
        value = self.choice((-1.0, 0.0, 0.25, 0.5, 1.0, 1.5, 2.0)) if value is None else value
        return self.choice(REALS) if self.is_odd else value

    def count(self, n, bits=64) -> int:
        """Return how many there are, or a lie; within so many bits without a sign."""
        if not self.is_odd:
            return n
        top = 2**bits
        large = top - 1, top // 2, top // 2 - 1, top // max(n, 1), 65535, 2**24
        return self.choice((0, 1, 2, n - 1, n + 1, 2 * n, n + 255, *large)) % top

    def index(self, n) -> int:
        """Return a number below n, or one that isn't."""
        if self.is_odd:
            return self.choice((n, n + 1, -1, -n, -n - 1, 2**31 - 1, 2**31, -(2**31), 2**32 - 1, 2**63))
        return self.randrange(max(n, 1))

    def either(self, words) -> str:
        """Return one of the words of a text; a dot is an empty one."""
        word = self.choice(words.split())
        return "" if word == "." else word

    def pack(self, code, *values) -> bytes:
        """Return numbers as `struct` packs them; counts may lie, reals be hostile; whole ones are cut to size."""
        found = b""
        for letter, value in zip(code[1:], values, strict=True):
            if letter in "fd":
                value = self.real(value)
                with np.errstate(all="ignore"):
                    found += np.array(value, code[0] + {"f": "f4", "d": "f8"}[letter]).tobytes()
            else:
                size = struct.calcsize(code[0] + letter)
                value = self.count(value % 2 ** (8 * size), 8 * size)
                found += value.to_bytes(size, "little" if code[0] == "<" else "big")
        return found

    def cut(self, data: bytes) -> bytes:
        """Return bytes, now and then with some damage."""
        return damaged(self, data) if data and self.is_odd else data

    def json(self, tree):
        """Return a tree of JSON, with some values changed unless the case is sound."""
        return changed(self, tree) if self.rate and self.random() < 0.6 else tree


# --- ways to damage -------------------------------------------------------------------------------------------------


def damaged(draw, data) -> bytes:
    """Return bytes with one to four faults."""
    data = bytearray(data)
    for _ in range(draw.randint(1, 4)):
        at, length = draw.randrange(len(data) + 1), draw.randint(1, 11)
        match draw.randrange(9):
            case 0:
                del data[at:]
            case 1:
                del data[at : at + length]
            case 2 if at < len(data):
                data[at] ^= 1 << draw.randrange(8)
            case 3:
                number = draw.choice([-1, 0, 1, 2**31 - 1, 2**16, 2**31, 2**24])
                data[at : at + 4] = struct.pack("<q", number)[:4]
            case 4:
                start = draw.randrange(len(data) + 1)
                data[at:at] = data[start : start + 8 * length]
            case 5:
                data[at:at] = draw.randbytes(length)
            case 6:
                data[at : at + 8] = struct.pack("<d", draw.choice([np.nan, np.inf, 1e300, -1e-310, 0.0]))
            case _:
                _other_word(draw, data)
    return bytes(data)


def _other_word(draw, data) -> None:
    """Put another number or word in place of one that is written as text."""
    words = [i for i, (a, b) in enumerate(zip(b" " + data, data, strict=False)) if a in b" \n/,[:" and b not in b" \n"]
    if words:
        end = start = draw.choice(words)
        while end < len(data) and data[end] not in b" \n/,]}":
            end += 1
        data[start:end] = draw.choice(WORDS).encode("utf-8", "surrogatepass")


def changed(draw, tree):
    """Return a tree of JSON with one to three values replaced, repeated or taken out."""
    tree = deepcopy(tree)
    for _ in range(draw.randint(1, 3)):
        places = list(_places(tree))
        if not places:
            break
        holder, key = draw.choice(places)
        match draw.randrange(7):
            case 0:
                del holder[key]
            case 1 if isinstance(holder, list):
                holder.insert(key, holder[key])
            case 2 if isinstance(holder[key], (int, float)) and not isinstance(holder[key], bool):
                holder[key] = holder[key] * draw.choice([-1, 2, 1000]) + draw.randint(-1, 1)
            case 3:
                other, name = draw.choice(places)
                is_there = name in (other if isinstance(other, dict) else range(len(other)))
                holder[key] = deepcopy(other[name]) if is_there else 0
            case 4 if isinstance(holder, dict):
                holder[draw.choice([each for _, each in places if isinstance(each, str)])] = holder.pop(key)
            case _:
                holder[key] = deepcopy(draw.choice(VALUES))
    return tree


def _places(tree):
    for key in list(tree) if isinstance(tree, dict) else range(len(tree)) if isinstance(tree, list) else ():
        yield tree, key
        yield from _places(tree[key])


def xml(draw, text) -> bytes:
    """Return a document of XML; unless the case is sound, with elements that are gone, twice or elsewhere, and with
    attributes and numbers that are others."""
    data = text.encode()
    if not draw.rate or draw.random() < 0.1:
        return draw.cut(data)
    root = etree.fromstring(data)
    for _ in range(draw.randint(1, 4)):
        every = [each for each in root.iter() if isinstance(each.tag, str)]
        one, other = draw.choice(every), draw.choice(every)
        keys = [(each, key) for each in every for key in each.attrib]
        if not keys:
            break
        holder, key = draw.choice(keys)
        match draw.randrange(10):
            case 0 if one is not root:
                one.getparent().remove(one)
            case 1 if one is not root:
                one.addnext(etree.fromstring(etree.tostring(one)))
            case 2 if one is not other and one not in other.iterancestors() and one is not root:
                other.append(one)
            case 3:
                del holder.attrib[key]
            case 4:
                source, name = draw.choice(keys)
                holder.set(key, source.get(name))
            case 5:
                one.tag = other.tag
            case 6 | 7:
                holder.set(key, _xml_words(draw, holder.get(key)))
            case _:
                texts = [each for each in every if (each.text or "").strip()]
                if texts:
                    one = draw.choice(texts)
                    one.text = _xml_words(draw, one.text)
    return draw.cut(etree.tostring(root, encoding="UTF-8", xml_declaration=draw.random() < 0.5))


def _xml_words(draw, text) -> str:
    """Return a text of XML in which a word is another."""
    words = text.split() or [""]
    word = "".join(letter for letter in draw.choice(WORDS) if letter >= " " and not "\ud800" <= letter <= "\udfff")
    at = draw.randrange(len(words))
    words[at : at + draw.choice((1, 1, 1, 2, 0))] = [word] * draw.choice((1, 1, 1, 3))
    return " ".join(words)


# --- pictures -------------------------------------------------------------------------------------------------------


@cache
def picture(format="PNG", mode="RGB", size=(5, 3), **options) -> bytes:
    """Return a small picture."""
    stream = io.BytesIO()
    pixels = np.random.default_rng(3).integers(0, 256, (size[1], size[0], 4), dtype=np.uint8)
    Image.fromarray(pixels).convert(mode).save(stream, format, **options)
    return stream.getvalue()


def _size(draw) -> tuple[int, int]:
    return draw.choice(((5, 3), (1, 1), (8, 8), (17, 2), (3, 33)))


def _png(draw) -> bytes:
    width, height = _size(draw)
    kind, depth = map(int, draw.either("2.8 6.8 0.8 4.8 0.16 2.16 3.8 3.4 0.1 3.1 6.16").split("."))
    n = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[kind]
    row = (width * n * depth + 7) // 8
    lines = b"".join(bytes([draw.count(draw.randrange(5), 8)]) + draw.randbytes(row) for _ in range(height))
    if kind == 3:  # indices that the palette has
        lines = bytes(height * (1 + row))
    chunks = [(b"IHDR", draw.pack(">IIBBBBB", width, height, depth, kind, 0, 0, 0))]
    if kind == 3 or draw.random() < 0.1:
        chunks.append((b"PLTE", draw.randbytes(3 * min(draw.count(2**depth, 9), 300))))
    text = b"a\0\0" + zlib.compress(b"b")
    others = {
        b"gAMA": b"\0\0\1\1",
        b"zTXt": text,
        b"iCCP": text,
        b"pHYs": bytes(9),
        b"eXIf": b"MM\0*",
        b"acTL": bytes(8),
    }
    others |= {b"fcTL": bytes(26), b"cHRM": bytes(32), b"abcd": b"", b"tRNS": draw.randbytes(draw.choice((1, 2, 6)))}
    chunks += [each for each in others.items() if draw.rate and draw.random() < 0.1]
    data = draw.cut(zlib.compress(lines[: draw.count(len(lines), 24)] + bytes(draw.choice((0, 0, 9)))))
    cut = draw.randrange(len(data) + 1)
    chunks += [(b"IDAT", data[:cut]), (b"IDAT", data[cut:]), (b"IEND", b"")]
    if draw.is_odd:
        chunks.insert(draw.randrange(len(chunks)), draw.choice(chunks))
    if draw.is_odd:
        chunks.pop(draw.randrange(len(chunks)))
    found = b"\x89PNG\r\n\x1a\n"
    for name, content in chunks:
        check = draw.cut(struct.pack(">I", zlib.crc32(name + content)))
        found += draw.pack(">I", len(content)) + name + content + check
    return found


def _jpeg(draw) -> bytes:
    """A JPEG picture of whose segments some are gone, twice, elsewhere, or hold other bytes."""
    mode = draw.choice(("RGB", "L", "CMYK"))
    data = picture("JPEG", mode, _size(draw), progressive=draw.random() < 0.5, quality=draw.choice((20, 95)))
    segments, at = [], 2
    while data[at + 1] != 0xDA:
        end = at + 2 + int.from_bytes(data[at + 2 : at + 4], "big")
        segments.append(data[at:end])
        at = end
    segments.append(data[at:])
    if draw.is_odd:
        segments.insert(draw.randrange(len(segments)), draw.choice(segments))
    if draw.is_odd:
        segments.pop(draw.randrange(len(segments)))
    if draw.is_odd:
        draw.shuffle(segments)
    extra = b"\xff\xee\0\x0eAdobe\0d\0\0\0\0\1", b"\xff\xdd\0\4\0\1", b"\xff\xe1\0\x0aExif\0\0MM"
    segments = [each for each in extra if draw.is_odd] + segments
    return data[:2] + b"".join(_spoiled(draw, each, range(1, min(len(each), 60))) for each in segments)


def _spoiled(draw, data, places) -> bytes:
    """Return bytes of which some at the given places are others."""
    data = bytearray(data)
    for place in places:
        if draw.is_odd and place < len(data):
            data[place] = draw.choice((0, 1, 2, 3, 8, 16, 127, 128, 255, draw.randrange(256)))
    return draw.cut(bytes(data))


def _bmp(draw) -> bytes:
    """A BMP picture: bits of every depth, palettes, masks, and runs."""
    width, height = _size(draw)
    bits, packing = draw.choice(((24, 0), (32, 0), (8, 0), (8, 1), (4, 0), (4, 2), (1, 0), (16, 0), (16, 3), (32, 3)))
    row = (width * bits + 31) // 32 * 4
    body = draw.randbytes(row * height)
    n_color = 0 if bits > 8 else draw.choice((0, 2**bits))
    if packing in (1, 2):  # runs, then lines and an end; or anything
        runs = [(width, draw.randrange(2**bits)), (0, 0)] * height
        odd = (0, 2), (0, draw.randrange(256)), (255, 1), (0, 1)
        runs = [draw.choice(odd) if draw.is_odd else run for run in runs]
        body = b"".join(map(bytes, runs)) + b"\0\1"
    masks = draw.pack("<III", 0xF800, 0x7E0, 0x1F) if packing == 3 else b""
    if packing == 3 and bits == 32:
        masks = draw.pack("<III", 0xFF0000, 0xFF00, 0xFF)
    palette = draw.randbytes(4 * (2**bits if bits <= 8 else 0))
    height = draw.choice((height, -height)) if packing == 0 else height
    sizes = 40, width, height, 1, bits, packing, len(body), 2835, 2835, n_color, 0
    head = draw.pack("<IIIHHIIIIII", *sizes)
    start = 14 + len(head) + len(masks) + len(palette)
    return b"BM" + draw.pack("<IHHI", start + len(body), 0, 0, start) + head + masks + palette + draw.cut(body)


def _tga(draw) -> bytes:
    width, height = _size(draw)
    kind, bits = draw.choice(((2, 24), (2, 32), (3, 8), (10, 24), (10, 32), (11, 8), (1, 8), (9, 8), (2, 16)))
    n = bits // 8
    body = draw.randbytes(width * height * n)
    if kind > 8:
        body = b"".join(bytes([127 + min(draw.count(width, 7), 128)]) + draw.randbytes(n) for _ in range(height))
    palette = draw.randbytes(3 * 256) if kind in (1, 9) else b""
    has = bool(palette)
    flags = draw.choice((0, 32)) | (8 if bits == 32 else 0)
    head = draw.pack("<BBBHHBHHHHBB", 0, has, kind, 0, 256 * has, 24 * has, 0, 0, width, height, bits, flags)
    return head + palette + draw.cut(body)


def _gif(draw) -> bytes:
    data = picture("GIF", draw.choice(("P", "L")), _size(draw))
    return _spoiled(draw, data, [*range(6, 13), *range(len(data) - 60, len(data))])


def _webp(draw) -> bytes:
    data = picture("WEBP", draw.choice(("RGB", "RGBA")), _size(draw), lossless=draw.random() < 0.5)
    return _spoiled(draw, data, range(4, min(len(data), 48)))


def _tiff(draw) -> bytes:
    """A TIFF picture: strips or tiles, of several depths, packings and planes."""
    width, height = _size(draw)
    kinds = "3.8.2 1.8.1 1.8.0 4.8.2 1.16.1 1.8.3 1.1.1 3.8.6 4.8.5"
    n, bits, meaning = map(int, draw.either(kinds).split("."))
    packing = draw.choice((1, 1, 8, 32773, 5, 32946, 7))
    is_tiled, order = draw.random() < 0.4, draw.choice("<>")
    if not draw.rate:
        packing, meaning = draw.choice((1, 8)), {6: 2}.get(meaning, meaning)
    n_row = 16 if is_tiled else height
    body = draw.randbytes((((16 if is_tiled else width) * n * bits + 7) // 8) * n_row)
    if packing in (8, 32946):
        body = zlib.compress(body)
    n_tile = -(-width // 16) * -(-height // 16) if is_tiled else 1
    tags = [(256, 3, [width]), (257, 3, [height]), (258, 3, [bits] * n), (259, 3, [packing])]
    tags += [(262, 3, [meaning]), (277, 3, [n])]
    tags += [(322, 3, [16]), (323, 3, [16])] if is_tiled else [(278, 3, [height])]
    tags += [(324 if is_tiled else 273, 4, [8] * n_tile), (325 if is_tiled else 279, 4, [len(body)] * n_tile)]
    if n == 4 and meaning == 2:
        tags.append((338, 3, [2]))
    if meaning == 3:
        tags.append((320, 3, [257 * k for k in range(256)] * 3))
    if draw.rate:
        odd = {284: [2], 317: [2], 339: [3], 274: [6], 254: [1], 266: [2], 347: [1, 2], 530: [2, 2]}
        tags += [(tag, 7 if tag == 347 else 3, values) for tag, values in odd.items() if draw.random() < 0.1]
    heads, more, start = b"", b"", 8 + len(body)
    tags.sort()
    room = start + 2 + 12 * len(tags) + 4
    for tag, type, values in tags:
        size = {3: 2, 4: 4, 7: 1}[type]
        values = [draw.count(value, 8 * size) for value in values]
        content = b"".join(value.to_bytes(size, "little" if order == "<" else "big") for value in values)
        if len(content) > 4:
            more, content = more + content, struct.pack(order + "I", room + len(more))
        heads += draw.pack(order + "HHI", tag, type, len(values)) + content.ljust(4, b"\0")
    head = (b"II*\0" if order == "<" else b"MM\0*") + draw.pack(order + "I", start)
    return draw.cut(head + body + draw.pack(order + "H", len(tags)) + heads + draw.pack(order + "I", 0) + more)


def _other_picture(draw) -> bytes:
    """A picture of a format that isn't read, or that another one is taken for."""
    heads = (
        b"DDS |\0\0\0", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 2\n", b"v/1\1\2\0\0\0", b"8BPS\0\1",
        b"P6 2 2 255\n", b"P7\n", b"<svg/>", b"%!PS-Adobe", b"\xff\x0a", b"\0\0\0\x20ftypavif", b"PF\n2 2\n-1\n",
        b"RIFF\4\0\0\0WEBP", b"GIF89a", b"BM", b"\xff\xd8\xff", b"II*\0", b"",
    )  # fmt: skip
    return draw.choice(heads) + draw.randbytes(draw.choice((0, 4, 60)))


PICTURES = (_png, _png, _jpeg, _bmp, _tga, _gif, _webp, _tiff, _tiff, _other_picture)


def some_picture(draw) -> bytes:
    """Return a picture of any format that is read, or of none."""
    return draw.choice(PICTURES[: None if draw.rate else -1])(draw)


def inside(draw) -> bytes:
    """Return the picture of a file that is about other things."""
    return some_picture(draw) if draw.is_odd or draw.random() < 0.1 else picture()


# --- models of text -------------------------------------------------------------------------------------------------

OBJ = b"""mtllib a.mtl
o first
v 0 0 0
v 1 0 0 1 0 0
v 1 1 0
v 0 1 0.5
vn 0 0 1
vt 0 0
vt 1 0
vt 1 1
usemtl a
s 1
f 1/1/1 2/2/1 3/3/1
f 1/1 3/3 4/2
o second
g part
usemtl b
f -1 -2 -3 -4
f 1//1 2//1 4//1
s off
f 2 3 4
"""
MTL = (
    b"newmtl a\nKa 1 1 1\nKd 0.5 0.6 0.7\nKs 0.2 0.2 0.2\nNs 30\nd 0.9\nmap_Kd -clamp on wood.png\nmap_d wood.png\n"
    b"newmtl b\nillum 0\nTr 0.2\nKe 0 1 0\n"
)


def _points(draw, n) -> list[tuple[float, float, float]]:
    """Return points of which no three lie on a line, near the unit sphere."""
    return [tuple(draw.uniform(-1, 1) for _ in range(3)) for _ in range(n)]


def _text(draw, lines, filler=" \n") -> bytes:
    """Return lines, now and then some of them gone, twice or elsewhere, or with other ends; some with so many blanks
    that compiled code reads them."""
    lines = list(lines)
    if filler and draw.random() < 0.05:
        lines[-1] += draw.choice(filler) * FEW
    for _ in range(sum(draw.is_odd for _ in lines)):
        at = draw.randrange(len(lines) + 1)
        lines[at : at + draw.randrange(2)] = draw.choice(([], lines[at : at + 1] * 2, [draw.choice(lines or [""])]))
    end = draw.choice(("\r\n", "\r", "\n\n", " \\\n", "\n\t", "\x0b", "\u2028")) if draw.is_odd else "\n"
    start = "\ufeff" if draw.is_odd else ""
    encoding = draw.choice(("utf-16", "latin-1", "utf-8")) if draw.is_odd else "utf-8"
    errors = "replace" if encoding == "latin-1" else "surrogatepass"
    return draw.cut((start + end.join(lines) + end).encode(encoding, errors))


_OBJ_LINES = (
    "usemtl a", "usemtl b", "usemtl none", "o x", "g y z", "s 1", "s off", "l 1 2", "p 1", "f 1 2 \\\n3", "#",
)  # fmt: skip
_ODD_OBJ_LINES = (
    "vp 0.5", "curv 0 1 1 2", "surf 0 1 0 1 1 2", "mtllib b.mtl a.mtl", "mtllib", "usemtl", "f", "v", "call x", "\\",
    "maplib x", "f 1/2/3/4 2 3",
)  # fmt: skip


def _obj(draw):
    n, lines = draw.randint(4, 9), ["# c", "mtllib a.mtl"]
    n_uv, n_normal = draw.randint(0, 4), draw.randint(0, 3)
    is_colored, wide = draw.random() < 0.2, draw.random() < 0.1
    for point in _points(draw, n):
        lines.append("v " + draw.words(*point, *((0.5, 0.2, 1.0) if is_colored else (1.0,) if wide else ())))
    lines += ["vt " + draw.words(*(draw.random() for _ in range(draw.randint(1, 3)))) for _ in range(n_uv)]
    lines += ["vn " + draw.words(*(draw.uniform(-1, 1) for _ in range(3))) for _ in range(n_normal)]

    def corner(k):
        parts = [draw.word(draw.choice((k + 1, k - n)))]
        if n_uv and draw.random() < 0.7:
            parts.append(draw.word(1 + draw.index(n_uv)))
        if n_normal and draw.random() < 0.7:
            parts += [""] * (2 - len(parts)) + [draw.word(1 + draw.index(n_normal))]
        return "/".join(parts)

    for _ in range(draw.randint(1, 8)):
        m = min(n, draw.choice((3, 3, 3, 4, 5)))
        corners = (
            [draw.index(n) for _ in range(draw.choice((0, 1, 2, 60)))] if draw.is_odd else draw.sample(range(n), m)
        )
        lines.append("f " + " ".join(map(corner, corners)))
        lines += [draw.choice((*_OBJ_LINES, f"s {draw.word(3)}"))] * (draw.random() < 0.4)
    odd = _ODD_OBJ_LINES
    lines += [draw.choice(odd)] if draw.is_odd else []
    return "m.obj", {"m.obj": _text(draw, lines), "a.mtl": MTL, PICTURE: inside(draw)}


_MAP_NAMES = (
    PICTURE, "WOOD.PNG", "no.png", "./wood.png", ".\\wood.png", '"wood.png"', "../wood.png", "/dev/zero", "", "a b.png",
    ".",
)  # fmt: skip
_MAP_OPTIONS = (
    "-clamp on", "-s {} {}", "-o {} {} {}", "-bm {}", "-mm {} {}", "-t {}", "-texres {}", "-blendu off", "-imfchan r",
    "-type sphere", "-cc on", "-boost {}", "-colorspace srgb",
)  # fmt: skip
_MAP_KEYS = "map_Kd map_Kd map_d map_Ks map_Bump bump disp decal refl norm map_Ka map_Pr map_aat"
_ODD_MTL_LINES = "Kd spectral a.rfl 1", "Kd xyz 0.1 0.2 0.3", "newmtl", "map_Kd", "Kd", "xyz"


def _mtl(draw):
    def line():
        if draw.random() < 0.3:
            options = draw.sample(_MAP_OPTIONS, draw.choice((0, 0, 1, 3)))
            said = [option.format(*(draw.word(draw.random()) for _ in range(3))) for option in options]
            name = draw.choice(_MAP_NAMES) if draw.is_odd or draw.random() < 0.1 else PICTURE
            return " ".join([draw.either(_MAP_KEYS), *said, name])
        key = draw.either("Ka Kd Ks Ke Tf Ns d Tr Ni illum Pr Pm sharpness")
        values = [draw.random() for _ in range(3 if key in ("Ka", "Kd", "Ks", "Ke", "Tf") else 1)]
        values = [draw.randrange(11)] if key == "illum" else values
        return f"{key.upper() if draw.is_odd else key} {draw.words(*values)}"

    lines = []
    for name in ("a", "b", draw.choice(("a", "c", "a b", ""))):
        lines += [f"newmtl {name}", *(line() for _ in range(draw.randint(0, 9)))]
        lines += [draw.choice(_ODD_MTL_LINES)] if draw.is_odd else []
    return "m.obj", {"m.obj": OBJ, "a.mtl": _text(draw, lines, ""), PICTURE: inside(draw)}


_PLY_TYPES = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f",
    "float64": "d", "int64": "q", "uint64": "Q",
}  # fmt: skip
_PLY_PROPERTIES = "nx,ny,nz red,green,blue red,green,blue,alpha s,t u,v texture_u,texture_v quality r,g,b"


def _ply(draw):
    """Elements of any properties; their rows as the header says, unless it lies."""
    form = draw.choice(("ascii", "binary_little_endian", "binary_big_endian"))
    order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[form]
    n = draw.randint(4, 8)
    wholes, reals = ("uchar", "int", "uint", "ushort", "int32", "uint8"), ("float", "double", "float32")
    vertex = [(name, draw.choice(reals)) for name in "xyz"]
    for names in draw.sample(_PLY_PROPERTIES.split(), draw.randint(0, 3)):
        kind = draw.either("uchar uchar float ushort") if "r" in names[:2] else draw.choice(reals)
        there = [name for name, _ in vertex] if not draw.rate else ()
        vertex += [(name, kind) for name in names.split(",") if name not in there]
    face = [(draw.either("vertex_indices vertex_index"), draw.choice(wholes), draw.either("uchar int uint8"))]
    wedges = draw.random() < 0.3
    face += [("texcoord", "float", "uchar"), ("texnumber", "int")] if wedges else []
    face += [(name, "uchar") for name in ("red", "green", "blue")] if draw.random() < 0.3 else []
    face += [("flags", draw.choice(wholes), "uchar")] if draw.random() < 0.1 else []
    elements = [["vertex", n, vertex], ["face", draw.randint(1, 6), face]]
    if draw.random() < 0.2:
        elements.append(["tristrips", draw.randint(1, 2), [("vertex_indices", "int", "int")]])
    if draw.random() < 0.2:
        elements.append(["edge", 2, [("vertex1", "int"), ("vertex2", "int")]])
    if draw.random() < 0.1:
        elements.insert(draw.randrange(len(elements)), ["range_grid", 3, [("a", "short"), ("b", "int", "uchar")]])
    if draw.is_odd:
        elements.append(draw.choice(elements))
    if draw.is_odd:
        draw.shuffle(elements)
    if draw.is_odd:
        properties = draw.choice(elements)[2]
        odd = (
            draw.either("x red vertex_indices ."),
            draw.choice((*_PLY_TYPES, "int7", "")),
            draw.either("float uchar char"),
        )
        properties[draw.randrange(len(properties))] = odd[: draw.choice((2, 3))]
    head, body, lines = ["ply", f"format {form} {draw.word(1.0)}", "comment TextureFile wood.png"], b"", []
    points = iter(_points(draw, n))
    for name, n_row, properties in elements:
        head.append(f"element {name} {draw.word(draw.count(n_row))}")
        for each, kind, *count in properties:
            head.append(f"property list {count[0]} {kind} {each}" if count else f"property {kind} {each}")
        for _ in range(n_row):
            point = iter(next(points, (0, 0, 0))) if name == "vertex" else iter(())
            m, row = draw.choice((3, 3, 4, 5)), []
            corners = draw.sample(range(n), min(m, n))
            for each, kind, *count in properties:
                letter, items = _PLY_TYPES.get(kind, "i"), [0, 1]
                if not count and letter in "fd":
                    row.append((letter, next(point, draw.random())))
                elif not count:
                    row.append((letter, draw.randrange(2 if each == "texnumber" else 128)))
                else:
                    if each.startswith("vertex"):
                        items = [draw.index(n) if draw.is_odd else value for value in corners]
                    elif each == "texcoord":
                        items = [draw.random() for _ in range(2 * len(corners))]
                    row.append((_PLY_TYPES.get(count[0], "B"), draw.count(len(items), 7)))
                    row += [(letter, value) for value in items]
            if order:
                for letter, value in row:
                    body += draw.pack(order + letter, value if letter in "fd" else int(value))
            else:
                lines.append(draw.words(*(value for _, value in row)))
    head.append("end_header")
    if order:
        data = draw.cut("\n".join([*head, ""]).encode("utf-8", "surrogatepass")) + draw.cut(body)
        return "m.ply", {"m.ply": data, PICTURE: inside(draw)}
    return "m.ply", {"m.ply": _text(draw, head + lines), PICTURE: inside(draw)}


def _stl(draw):
    n = draw.randint(1, 6)
    corners = [_points(draw, 3) for _ in range(n)]
    if draw.random() < 0.5:
        head = draw.choice((b"", b"solid x", b"COLOR=abcd", b"COLOR=\1\2\3\4", b"\xff" * 80)).ljust(80, b"\0")[:80]
        rows = [(0.0, 0.0, 1.0, *sum(face, ()), draw.randrange(2**16)) for face in corners]
        body = b"".join(draw.pack("<" + 12 * "f" + "H", *row) for row in rows)
        return "m.stl", {"m.stl": draw.cut(head + draw.pack("<I", n) + body)}
    lines = []
    for name, faces in (("a b", corners[: n // 2]), ("", corners[n // 2 :])):
        lines.append(f"solid {name}")
        for face in faces:
            points = [f"  vertex {draw.words(*point)}" for point in face]
            lines += [f"facet normal {draw.words(0.0, 0.0, 1.0)}", " outer loop", *points, " endloop", "endfacet"]
        lines.append(f"endsolid {name}")
    for k, line in enumerate(lines):
        if draw.is_odd:
            lines[k] = draw.choice((line.upper(), line.replace("end", "end "), line + " vertex 1 2 3", line[:5]))
    return "m.stl", {"m.stl": _text(draw, lines)}


def _off(draw):
    n, n_face = draw.randint(4, 8), draw.randint(1, 6)
    has_uv, has_color, has_normal, has_w = (draw.random() < 0.25 for _ in range(4))
    head = "ST" * has_uv + "C" * has_color + "N" * has_normal + "4" * has_w + "OFF"
    if draw.is_odd:
        head = draw.choice(("nOFF 4", "4nOFF", "OFF BINARY", "CSTOFF", "off", "", "OFFX", "STCN4OFF", "COFF"))
    counts = draw.words(draw.count(n), draw.count(n_face), 0)
    lines = [f"{head} {counts}"] if draw.random() < 0.2 else [head, "# c", counts]
    for point in _points(draw, n):
        more = [1.0] * has_w + [0.0, 0.0, 1.0] * has_normal + [0.5, 0.2, 1.0, 1.0] * has_color + [0.5, 0.25] * has_uv
        lines.append(draw.words(*point, *more))
    for _ in range(n_face):
        m = min(n, draw.choice((3, 3, 4, 5)))
        corners = [draw.index(n) if draw.is_odd else k for k in draw.sample(range(n), m)]
        color = draw.choice(((), (), (), (255, 0, 9), (0.5, 0.5, 0.5), (1, 2, 3, 4), (7,)))
        lines.append(draw.words(draw.count(m), *corners, *color))
    return "m.off", {"m.off": _text(draw, lines)}


# --- glTF -----------------------------------------------------------------------------------------------------------

_COMPONENTS = {"b": 5120, "B": 5121, "h": 5122, "H": 5123, "I": 5125, "f": 5126}
_LIGHT = "KHR_lights_punctual"
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def _gltf_tree(draw):
    """Return the tree of a glTF file, the bytes of its buffer, and its picture."""
    data, tree = bytearray(), {"asset": {"version": "2.0"}, "bufferViews": [], "accessors": []}

    def view(content, **more):
        data.extend(bytes(-len(data) % 4))
        tree["bufferViews"].append({"buffer": 0, "byteOffset": len(data), "byteLength": len(content)} | more)
        data.extend(content)
        return len(tree["bufferViews"]) - 1

    def accessor(rows, letter, **more):
        width, pad = len(rows[0]), draw.choice((0, 0, 0, 4, 12)) if len(rows[0]) < 16 else 0
        size = struct.calcsize(letter) * width
        gap = -size % 4 if size + pad > 4 or pad else 0
        content = b"".join(draw.pack("<" + letter * width, *row) + bytes(pad + gap) for row in rows)
        stride = {"byteStride": size + pad + gap} if pad + gap else {}
        made = {"bufferView": view(content, **stride), "componentType": _COMPONENTS[letter], "count": len(rows)} | more
        made["type"] = _TYPES[width]
        if draw.random() < 0.1 and letter == "f":
            k = draw.index(len(rows)) % 256
            values = draw.pack("<" + "f" * width, *rows[k % len(rows)])
            indices = {"bufferView": view(bytes([k])), "componentType": 5121}
            made["sparse"] = {"count": 1, "indices": indices, "values": {"bufferView": view(values)}}
        tree["accessors"].append(made)
        return len(tree["accessors"]) - 1

    n, meshes = draw.randint(3, 8), []
    for _ in range(draw.randint(1, 2)):
        points = _points(draw, n)
        if draw.random() < 0.1:
            position = accessor([[int(100 * x) for x in row] for row in points], "h", normalized=draw.random() < 0.5)
        else:
            position = accessor(points, "f")
        attributes = {"POSITION": position}
        if draw.random() < 0.5:
            attributes["NORMAL"] = accessor([(0.0, 0.0, 1.0)] * n, "f")
        for k in range(draw.choice((0, 1, 1, 2))):
            letter = draw.choice("fBH")
            rows = [(0.5, draw.random()) if letter == "f" else (0, draw.randrange(256)) for _ in range(n)]
            is_part = letter != "f" and draw.random() < 0.7
            attributes[f"TEXCOORD_{k}"] = accessor(rows, letter, **{"normalized": True} if is_part else {})
        if draw.random() < 0.3:
            letter, width = draw.choice("fBH"), draw.choice((3, 4))
            attributes["COLOR_0"] = accessor([[1.0 if letter == "f" else 200] * width] * n, letter)
        if draw.random() < 0.4:
            joints = [[draw.index(2) % 256 for _ in range(4)] for _ in range(n)]
            attributes["JOINTS_0"] = accessor(joints, draw.choice("BH"))
            attributes["WEIGHTS_0"] = accessor([(0.5, 0.5, 0.0, 0.0)] * n, "f")
        if draw.random() < 0.1:
            attributes["_HEAT"] = accessor([(draw.random(),)] * n, "f")
        primitive = {"attributes": attributes}
        if draw.random() < 0.7:
            indices = [(draw.index(n),) if draw.is_odd else (k % n,) for k in range(3 * draw.randint(1, 6))]
            primitive["indices"] = accessor(indices, draw.choice("BHI"))
        mode = draw.choice((4, 4, 4, 4, 4, 5, 5, 6, 6, 0, 1, 3) if draw.rate else (4, 5, 6))
        primitive |= {"mode": mode} if mode != 4 or draw.random() < 0.5 else {}
        primitive |= {"material": draw.randrange(3)} if draw.random() < 0.8 else {}
        mesh = {"primitives": [primitive]}
        if draw.random() < 0.3:
            primitive["targets"] = [{"POSITION": accessor([(0.1, 0.0, 0.1)] * n, "f")} for _ in range(2)]
            mesh["weights"] = [draw.real(0.5), 0.25]
        meshes.append(mesh)
    is_inside, content = draw.random() < 0.6, inside(draw)
    if is_inside and draw.random() < 0.5:
        image = {"uri": f"data:image/png;base64,{base64.b64encode(content).decode()}"}
    else:
        image = {"bufferView": view(content), "mimeType": "image/png"} if is_inside else {"uri": PICTURE}
    use = {"index": 0} | ({"texCoord": draw.randrange(2)} if draw.random() < 0.2 else {})
    if draw.random() < 0.2:
        change = {"offset": [draw.real(), draw.real()], "rotation": draw.real(), "scale": [2.0, draw.real(1.0)]}
        use["extensions"] = {"KHR_texture_transform": change}
    glossy = {"diffuseFactor": [1, 0, 0, 1], "specularFactor": [0.2, 0.1, 0], "glossinessFactor": draw.real(0.5)}
    extensions = {
        "ior": {"ior": 1.4}, "specular": {"specularFactor": 0.5, "specularColorFactor": [1, 0.5, 0.2]}, "unlit": {},
        "emissive_strength": {"emissiveStrength": draw.real(2.0)}, "clearcoat": {"clearcoatFactor": 1},
        "pbrSpecularGlossiness": glossy | {"diffuseTexture": use, "specularGlossinessTexture": use},
    }  # fmt: skip
    surface = {"metallicFactor": draw.real(0.5), "roughnessFactor": draw.real(0.5)}
    surface["baseColorFactor"] = [draw.real(0.5), 0.5, 1, draw.real(1.0)]
    tree["materials"] = []
    for _ in range(3):
        textures = [each for each in ("baseColorTexture", "metallicRoughnessTexture") if draw.random() < 0.5]
        material = {"pbrMetallicRoughness": surface | dict.fromkeys(textures, use), "name": "a", "doubleSided": True}
        material |= {"alphaMode": draw.either("OPAQUE MASK BLEND"), "alphaCutoff": draw.real(0.25)}
        material["emissiveFactor"] = [0, 0.1, draw.real(0.0)]
        material["extensions"] = {
            f"KHR_materials_{name}": extensions[name] for name in extensions if draw.random() < 0.15
        }
        material |= {"normalTexture": use} if draw.random() < 0.1 else {}
        tree["materials"].append(material)
    sampler = {"wrapS": draw.choice((33071, 10497)), "minFilter": draw.choice((9728, 9729, 9987))}
    tree |= {"meshes": meshes, "images": [image], "textures": [{"source": 0, "sampler": 0}], "samplers": [sampler]}
    light = {"intensity": draw.real(2.0), "color": [1, 0.5, draw.real(0.0)]}
    tree["extensions"] = {_LIGHT: {"lights": [light | {"type": kind} for kind in ("directional", "point", "spot")]}}
    lens = {"type": "perspective", "perspective": {"yfov": draw.real(0.8), "znear": 0.1, "aspectRatio": 1.5}}
    flat = {"type": "orthographic", "orthographic": {"xmag": 2.0, "ymag": draw.real(2.0), "znear": 0.01, "zfar": 50}}
    tree["cameras"] = [draw.choice((lens, flat))]
    turned = {"scale": [1, 2, draw.real(1.0)], "rotation": [0, 0, draw.real(0.5), 1], "children": [2, 3]}
    nodes = [{"mesh": 0, "translation": [0.0, draw.real(0.0), 0.0]}, turned]
    nodes.append({"mesh": len(meshes) - 1, "matrix": [*np.eye(4).ravel()[:12].tolist(), draw.real(0.5), 0, 0, 1]})
    nodes.append({"translation": [0, 1, 0]})
    if draw.random() < 0.5:
        nodes.append({"extensions": {_LIGHT: {"light": draw.randrange(3)}}, "translation": [0, 2, 3]})
    nodes += [{"camera": 0, "translation": [0, 0, 9]}] * (draw.random() < 0.3)
    if draw.random() < 0.4:
        nodes[2]["skin"] = 0
        joints = [draw.choice((1, 3)), 3]
        tree["skins"] = [{"joints": joints, "inverseBindMatrices": accessor([np.eye(4).ravel().tolist()] * 2, "f")}]
    if draw.random() < 0.1:
        nodes[0]["weights"] = [draw.real(1.0), 0]
    tree |= {"nodes": nodes, "scenes": [{"nodes": [k for k in range(len(nodes)) if k not in (2, 3)]}], "scene": 0}
    if draw.rate and draw.random() < 0.03:
        names = "KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_mesh_quantization", "X"
        tree |= {"extensionsRequired": draw.some(names), "extensionsUsed": draw.some(names)}
    tree["buffers"] = [{"byteLength": len(data)}]
    return tree, bytes(data), content


def _gltf(draw):
    tree, data, content = _gltf_tree(draw)
    if draw.random() < 0.7:
        tree["buffers"][0]["uri"] = "data:;base64," + base64.b64encode(data).decode()
    else:
        odd = "../a.bin /dev/zero b.bin . a%2ebin data:,%41 http://a/b data:;base64,A"
        tree["buffers"][0]["uri"] = draw.either(odd) if draw.is_odd else "a.bin"
    text = draw.cut(json.dumps(draw.json(tree)).encode())
    return "m.gltf", {"m.gltf": text, PICTURE: content, "a.bin": draw.cut(data)}


def _glb(draw):
    tree, data, content = _gltf_tree(draw)
    text = json.dumps(draw.json(tree)).encode()
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    chunks = draw.pack("<II", len(text), 0x4E4F534A) + text + draw.pack("<II", len(data), 0x004E4942) + data
    return "m.glb", {"m.glb": draw.cut(draw.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks), PICTURE: content}


# --- XML and packed files -------------------------------------------------------------------------------------------


def _packed(draw, files) -> bytes:
    """Return a zip file; now and then members are gone, twice, or differently packed, and its directory lies."""
    files = dict(files)
    if draw.is_odd:
        del files[draw.choice(list(files))]
    methods = (zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA, zipfile.ZIP_STORED) if draw.is_odd else (zipfile.ZIP_DEFLATED,)
    return draw.cut(zipped(files, draw.choice(methods)))


def _members(data) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def _3mf(draw):
    text = xml(draw, draw.choice((THREEMF, COLORED_THREEMF)))
    files = _members(threemf(text, **{"3D/a.png": inside(draw)}))
    if draw.is_odd:
        name = draw.choice(("[Content_Types].xml", "_rels/.rels", "3D/_rels/3dmodel.model.rels"))
        files[name] = xml(Draw(draw.random(), 1.0), files[name].decode())
    return "m.3mf", {"m.3mf": _packed(draw, files)}


_MORE_DAE = """
<library_geometries><geometry id="h"><mesh><source id="hp"><float_array id="hpa" count="12">0 0 0 2 0 0 2 1 0 0 1
0</float_array><technique_common><accessor source="#hpa" count="4" stride="3"><param name="X" type="float"/><param
name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source><vertices id="hv"><input
semantic="POSITION" source="#hp"/></vertices><triangles count="2" material="m"><input semantic="VERTEX" source="#hv"
offset="0"/><p>0 1 2 0 2 3</p></triangles><polygons count="1"><input semantic="VERTEX" source="#hv" offset="0"/><p>0 1
2 3</p></polygons><lines count="1"><input semantic="VERTEX" source="#hv" offset="0"/><p>0
1</p></lines></mesh></geometry> </library_geometries><library_controllers><controller id="k"><skin
source="#h"><bind_shape_matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</bind_shape_matrix><source id="kj"><Name_array id="kja"
count="1">n</Name_array><technique_common><accessor source="#kja" count="1" stride="1"><param name="JOINT"
type="name"/></accessor></technique_common></source><source id="kb"><float_array id="kba" count="16">1 0 0 0 0 1 0 0 0
0 1 0 0 0 0 1</float_array><technique_common><accessor source="#kba" count="1" stride="16"><param name="TRANSFORM"
type="float4x4"/></accessor></technique_common></source> <source id="kw"><float_array id="kwa"
count="1">1</float_array><technique_common><accessor source="#kwa" count="1" stride="1"><param name="WEIGHT"
type="float"/></accessor></technique_common></source><joints><input semantic="JOINT" source="#kj"/><input
semantic="INV_BIND_MATRIX" source="#kb"/></joints><vertex_weights count="4"><input semantic="JOINT" source="#kj"
offset="0"/><input semantic="WEIGHT" source="#kw" offset="1"/><vcount>1 1 1 1</vcount><v>0 0 0 0 0 0 0 0</v>
</vertex_weights></skin></controller></library_controllers>
""".replace("\n", " ")
_MOVES = [f"<{word}</{word.partition('>')[0]}>" for word in (
    "matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "rotate>0 0 1 30", "lookat>0 0 5 0 0 0 0 1 0", "scale>1 2 1",
    "translate>1 0 0", "skew>20 1 0 0 0 1 0",
)]  # fmt: skip


def _dae_text(draw) -> str:
    shown = draw.choice((SHOWN, '<instance_geometry url="#h"/>', '<instance_controller url="#k"/>', SHOWN))
    nodes = f'<node id="x">{"".join(draw.some(_MOVES))}{shown}</node>' if draw.random() < 0.6 else NODES
    axis = draw.choice(("<up_axis>Z_UP</up_axis>", "<up_axis>Y_UP</up_axis>", "<up_axis>X_UP</up_axis>", ""))
    return dae(nodes, diffuse=draw.choice((PICTURED, RED)), more=_MORE_DAE, asset=axis)


def _dae(draw):
    return "m.dae", {"m.dae": xml(draw, _dae_text(draw)), PICTURE: inside(draw)}


def _zae(draw):
    return "m.zae", {"m.zae": _packed(draw, {"a.dae": xml(draw, _dae_text(draw)), PICTURE: inside(draw)})}


def _3dxml(draw):
    instances = "".join(INSTANCE.format(id=5 + k, above=1, below=2, x=3 * k) for k in range(draw.randint(1, 3)))
    texts = {"p.3dxml": PRODUCT.format(instances=instances), "a.3DRep": REP}
    name = draw.choice(list(texts))
    texts[name] = xml(draw, texts[name])
    return "m.3dxml", {"m.3dxml": _packed(draw, _members(threedxml(instances, **texts)))}


def _xaml(draw):
    return "m.xaml", {"m.xaml": xml(draw, XAML)}


# --- scenes, arrays and cameras -------------------------------------------------------------------------------------

TRIANGLE = {
    "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "faces": [[0, 1, 2], [0, 2, 3]],
    "uv": [[0, 0], [1, 0], [0, 1], [1, 1]],
}  # fmt: skip
_MATERIALS = {
    "a": {"diffuse": "red", "texture": {"file": PICTURE, "filter": "nearest", "wrap": ["clamp", "mirror"]},
    "opacity": 0.5},
    "b": {"diffuse": [0.1, 0.2, 0.3], "reflection": "cook-torrance", "roughness": 0.3, "fresnel": 0.1,
    "shininess": 5.5},
}  # fmt: skip
_LIGHTS = [
    "studio",
    {"kind": "spot", "position": [0, 0, 5], "direction": [0, 0, -1], "inner": 5, "outer": 30, "exponent": 2,
     "attenuation": "1/(d+3)", "range": 50, "amplify": True},
    {"kind": "area", "corner": [1, 1, 3], "edge_u": [1, 0, 0], "edge_v": [0, 1, 0], "resolution": [2, 2],
     "shadow": {"size": 16, "filter": 3}},
    {"kind": "point", "position": [1, 2, 3], "color": {"wavelengths": [400, 500, 700], "values": [1, 0.5, 0.2]}},
    {"kind": "directional", "direction": [0, -1, -1], "color": 0.5}, {"kind": "ambient", "color": [0.1, 0.1, 0.1]},
]  # fmt: skip
_MESHES = [
    TRIANGLE | {"normals": [[0, 0, 1]] * 4, "polygons": [0, 1], "smoothing": [1, 2], "material": "a", "name": "t",
                "transform": {"scale": 1, "rotate": {"axis": [0, 0, 1], "angle": 3}, "translate": [0, 0, 1]}},
    TRIANGLE | {"materials": ["a", "b"], "face_material": [0, 1], "face_colors": [[1, 0, 0], [0, 1, 0]],
    "crease_angle": 20},
    {"arrays": "a.npz", "mesh": 0, "material": {"texture": {"arrays": "a.npz", "texture": 0}}},
    {"file": "part.obj", "transform": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], "material": "b"},
]  # fmt: skip
_CAMERAS = (
    {"azimuth": 20, "elevation": 30, "fov": 30, "margin": 0.1}, {"view": "iso", "zoom": 1.5},
    {"view": "front", "ortho": True}, {"eye": [3, 2, 5], "target": [0, 0.5, 0], "fov": 40},
    {"position": [0, 0, 9], "target": [0, 0, 0], "fov": 40, "near": 0.1, "far": 50},
    {"position": [0, 0, 9], "target": [0, 0, 0], "height": 4},
)  # fmt: skip
_WORDS = {
    "background": "white", "up": "z", "depth_cue": {"scale": 0.5, "start": 1, "color": [0.5, 0.5, 0.5]}, "subdivide": 1,
    "crease_angle": 30, "weighting": "angle", "color": "red", "reflection": "blinn", "drop_bad_faces": True,
    "shadows": {"size": 16, "filter": 3},
}  # fmt: skip
_OPTIONS = {"shading": "phong", "size": [16, 12], "samples": 1, "exposure": 0.5, "color_range": "local"}


@cache
def arrays() -> dict[str, np.ndarray]:
    """Return the arrays of a mesh and a texture."""
    return {
        "mesh0_vertices": np.array(TRIANGLE["vertices"], float), "mesh0_faces": np.array(TRIANGLE["faces"], np.uint32),
        "mesh0_uv": np.array(TRIANGLE["uv"], float), "texture0": np.random.default_rng(5).random((4, 4, 3)),
    }  # fmt: skip


def npz(arrays, compress=False) -> bytes:
    """Return the arrays as an .npz file."""
    stream = io.BytesIO()
    (np.savez_compressed if compress else np.savez)(stream, **arrays)
    return stream.getvalue()


def _json(draw):
    scene = {"meshes": draw.some(_MESHES, 1), "materials": _MATERIALS, "lights": draw.some(_LIGHTS, 1)}
    scene |= {"camera": draw.choice(_CAMERAS), "options": _OPTIONS}
    scene |= {key: value for key, value in _WORDS.items() if draw.random() < 0.15}
    files = {"a.npz": npz(arrays()), PICTURE: inside(draw), "part.obj": OBJ, "a.mtl": MTL}
    return "m.json", files | {"m.json": draw.cut(json.dumps(draw.json(scene)).encode())}


def npy(draw, array) -> bytes:
    """Return an array as a .npy file, whose head may say anything."""
    descr = array.dtype.str
    if draw.is_odd:
        descr = draw.either(
            "<f8 >f8 <f4 <f2 <c8 <U4 |S3 |V8 |O <M8[s] |b1 <i8 <u4 <f16 >i2 . [('a','<f8')] <U0 |V0 |S99999"
        )
    odd = 0, 1, -1, 2**31, 2**63, 2**64, 10**30, 1.5, "a", True
    shape = tuple(draw.choice((*odd, n + 1, n * n)) if draw.is_odd else n for n in array.shape)
    shape = draw.choice((shape + (1,), shape[:-1], [*shape], None, (), (0,) * 70)) if draw.is_odd else shape
    table = {"descr": descr, "fortran_order": draw.choice((True, 0, None)) if draw.is_odd else False, "shape": shape}
    text = draw.cut(repr(table).encode() + b" " * draw.choice((1, 40)) + b"\n")
    version = draw.choice((2, 3, 9)) if draw.is_odd else 1
    length = draw.pack("<H" if version == 1 else "<I", len(text))
    return b"\x93NUMPY" + bytes([version, 0]) + length + text + draw.cut(array.tobytes())


def _npz(draw):
    scene = {"meshes": [_MESHES[2]]}
    found = {name: array.astype(draw.choice("fdiIHe")) if draw.is_odd else array for name, array in arrays().items()}
    if draw.random() < 0.1 and draw.rate:
        data = damaged(draw, npz(found, draw.random() < 0.5))
    else:
        data = _packed(draw, {f"{name}.npy": npy(draw, array) for name, array in found.items()})
    return "m.json", {"m.json": json.dumps(scene).encode(), "a.npz": data}


def _npy(draw):
    """Scalars in a .npy file, for the model beside it."""
    values = np.array([draw.real() for _ in range(8)])
    values[0] = 0.25  # a range needs one
    values = values.astype(draw.either("f8 f4 i4") if not draw.rate else "f8")
    return "s.npy", {"s.npy": npy(draw, values), "part.obj": OBJ, "a.mtl": MTL}


def _texture(draw):
    """A picture, and a file of one of the formats that show it."""
    if draw.rate:
        draw.rate = max(draw.rate, 0.01)
    data = draw.cut(some_picture(draw))
    quiet = Draw(draw.random(), 0.0)
    while True:
        name, files = draw.choice((_obj, _mtl, _ply, _gltf, _glb, _dae, _zae, _3mf, _json))(quiet)
        old = picture()
        found = {each: content.replace(old, data) if each == PICTURE else content for each, content in files.items()}
        if name == "m.gltf":
            start = b"image/png;base64,"
            found[name] = files[name].replace(start + base64.b64encode(old), start + base64.b64encode(data))
        elif name in ("m.zae", "m.3mf"):
            members = _members(files[name])
            found[name] = zipped({each: data if content == old else content for each, content in members.items()})
        if found != files or data == old:
            return name, found


_NERF_LENSES = (
    {"fl_x": 20.0, "fl_y": 21.0, "cx": 8.0, "cy": 6.0}, {"camera_angle_x": 0.8},
    {"camera_angle_x": 0.8, "k1": 0, "p2": 0.0},
)  # fmt: skip
_COLMAP_MODELS = "PINHOLE.4.0 SIMPLE_PINHOLE.3.0 OPENCV.4.4 RADIAL.3.2 SIMPLE_RADIAL.3.1 FULL_OPENCV.4.8"
_POSE = [[1, 0, 0, 0], [0, 0.6, -0.8, -4], [0, 0.8, 0.6, 3], [0, 0, 0, 1]]


def _cameras(draw):
    """The camera of a scene file, or one alone; those of NeRF; those of COLMAP, as text or in bytes."""
    kind = draw.choice(("json", "nerf", "colmap"))
    if kind == "json":
        tree = draw.choice(_CAMERAS)
        tree = draw.choice((tree, {"camera": tree}, {"meshes": [], "camera": tree}))
        return "camera.json", {"camera.json": draw.cut(json.dumps(draw.json(tree)).encode())}
    if kind == "nerf":
        lens = {"w": 16, "h": 12} | draw.choice(_NERF_LENSES)
        frames = [{"file_path": f"a/{k}", "transform_matrix": _POSE} for k in range(draw.randint(1, 3))]
        frames[0] |= lens if draw.random() < 0.2 else {}
        text = draw.cut(json.dumps(draw.json(lens | {"frames": frames})).encode())
        return "transforms.json", {"transforms.json": text}
    lenses, images = ["# CAMERA_ID ..."], ["# IMAGE_ID ..."]
    for k in range(1, 3):
        model, n, more = draw.either(_COLMAP_MODELS).split(".")
        values = [20.0, 8.0, 6.0] if n == "3" else [20.0, 21.0, 8.0, 6.0]
        name = draw.choice(("THIN_PRISM_FISHEYE", "FOV", "", "pinhole")) if draw.is_odd else model
        lenses.append(f"{draw.word(k)} {name} {draw.words(16, 12, *values, *[0.0] * int(more))}")
        images += [f"{k} {draw.words(0.9, 0.1, -0.2, 0.3, 0.0, 0.0, 5.0, k)} a b{k}.png", draw.words(1.0, 2.0, -1)]
    files = {"cameras.txt": _text(draw, lenses, ""), "images.txt": _text(draw, images, "")}
    if draw.is_odd:
        del files[draw.choice(list(files))]
    return "", files


GRAMMARS = {
    "obj": _obj, "mtl": _mtl, "ply": _ply, "stl": _stl, "off": _off, "gltf": _gltf, "glb": _glb, "3mf": _3mf,
    "dae": _dae, "zae": _zae, "3dxml": _3dxml, "xaml": _xaml, "pictures": _texture, "json": _json, "npz": _npz,
    "npy": _npy, "cameras": _cameras,
}  # fmt: skip


def make_case(format, seed) -> tuple[str, dict[str, bytes], bool]:
    """Return the name of the file that is read, "" for a folder, the bytes of all files by name, and whether they are
    sound."""
    draw = Draw(f"{format} {seed}")
    name, files = GRAMMARS[format](draw)
    return name, files, draw.rate == 0.0
