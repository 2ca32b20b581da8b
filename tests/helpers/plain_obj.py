"""Read OBJ line by line in plain Python, as the judge of the reader by arrays; and make random files for both."""

import re
from typing import NamedTuple

KINDS = {"v": "vertex", "vt": "texture coordinate", "vn": "normal"}
LEAST = {"v": 3, "vt": 1, "vn": 3}
COLUMNS = {"v": 3, "vt": 2, "vn": 3}  # that a table has at least
COLORED = 6  # numbers of a vertex with a colour; where only some have one, -inf for each of the last three
NO_CORNER = "'{}' is not a corner of a face (v, v/vt, v//vn or v/vt/vn)"
# What damaged files have in place of numbers, and numbers that are written in unusual ways.
NUMBERS = (
    "0", "-0", "1e-3", "2.5E+2", "1.", ".5", "+3", "1e400", "-1e-400", "nan", "-nan(ind)", "inf", "-infinity",
    "1.#QNAN", "-1.#IND", "0.30000000000000004", "12345678901234567890", "9007199254740993", "0.1234567890123456",
    "123456789", "x", "1,5", "--1", "+-1", "1e", "0x1", "1.2.3", ".", "-", "+", "1_0", "1/2", "\u0663",
)  # fmt: skip
INDICES = ("0", "x", "1.5", "+1", "-", "99999999999999999999", "1_0", "000000001", "")


class Plain(NamedTuple):
    """What a file holds."""

    rows: dict  # keyword -> a list of numbers for each line
    faces: list  # (line, [[v, vt, vn] of each corner]) from 0, -1 = none
    fault: tuple | None  # number of the first line that is at fault, from 1, and why


def read(data: bytes) -> Plain:
    """Read a file, to its end even if lines are at fault."""
    lines = list(numbered_lines(data))
    words = {kind: [(n, line) for n, key, line in lines if key == kind] for kind in (*KINDS, "f")}
    total = {kind: len(words[kind]) for kind in KINDS}
    faults, rows = [], {}
    for kind in KINDS:
        lengths = [len(line) for _, line in words[kind]]
        width, rest = max(min(lengths, default=0), COLUMNS[kind]), [0.0]
        if kind == "v" and width < COLORED <= max(lengths, default=0):
            width, rest = COLORED, [-float("inf")] * 3
        rows[kind] = []
        for n, line in words[kind]:
            line = line[: width if len(line) >= width else COLUMNS[kind]]
            values = [number(word) for word in line]
            if None in values:
                faults.append((n, f"'{line[values.index(None)]}' is not a number"))
            elif len(line) < LEAST[kind]:
                faults.append((n, f"a {KINDS[kind]} has {len(line)} numbers, {LEAST[kind]} are needed"))
            rows[kind].append((values + rest)[:width])
    faces = []
    for place, line in words["f"]:
        so_far = {kind: sum(n < place for n, _ in words[kind]) for kind in KINDS}
        corners = [corner(word, so_far, total) for word in line]
        faults += [(place, each) for each in corners if isinstance(each, str)][:1]
        faces.append((place, corners))
    return Plain(rows, faces, min(faults, key=lambda fault: fault[0], default=None))


def numbered_lines(data):
    """Yield number, keyword and words of every line whose keyword is followed by a blank."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    begun, start = "", None
    for number_of_line, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), 1):
        start = start or number_of_line
        bare = line.rstrip(" \t\v\f")
        if bare.endswith("\\") and "#" not in line:
            begun += bare[:-1] + " "
            continue
        found = re.fullmatch(r"[ \t\v\f]*([^ \t\v\f]+)[ \t\v\f](.*)", begun + line, re.DOTALL)
        if found:
            rest = found[2].partition("#")[0]
            yield start, found[1], re.findall(r"[^ \t\v\f]+", rest)
        begun, start = "", None


def number(word):
    """Return the number that a word stands for, or None."""
    try:
        return float(word) if word.isascii() and "_" not in word else None
    except ValueError:
        return None


def corner(word, so_far, total):
    """Return the indices of a corner, or what is wrong with it."""
    indices = []
    for kind, piece in zip(KINDS, [*word.split("/"), "", ""], strict=False):
        if not re.fullmatch(r"[+-]?[0-9]{1,18}", piece) and (piece or kind == "v"):
            return NO_CORNER.format(word)
        given = int(piece or 0)
        index = max(so_far[kind] + given, -1) if given < 0 else given - 1
        if kind == "v" and given == 0:
            return "face refers to vertex 0, the first one is 1"
        if kind == "v" and index < 0:
            return f"face refers to vertex {given}, only {so_far['v']} stand before it"
        if index >= total[kind] and kind == "v":
            return f"face refers to vertex {given}, the file has {total[kind]}"
        index = -1 if index >= total[kind] else index
        indices.append(index)
    return indices


# --- random files ---------------------------------------------------------------------------------------------------


def make_file(random, is_damaged: bool) -> bytes:
    """Make an OBJ file of random lines, spelt in one of many ways.

    Parameters
    ----------
    random : random.Random
    is_damaged : whether some of its words are wrong
    """
    rate = random.choice([0.005, 0.02]) if is_damaged else 0.0
    form, is_mixed = random.choice(FORMS), random.random() < 0.3
    counts, lines, width = dict.fromkeys(KINDS, 0), [], random.choice([3, 3, 4, 6, 7])
    for _ in range(random.randrange(8, 60)):
        kind = random.choice(["v"] * 4 + ["vt", "vn"] + ["f"] * 4 + ["other"] * 2) if counts["v"] > 2 else "v"
        if kind in counts:
            n = {"v": width, "vt": random.choice([1, 2, 2, 3]), "vn": 3}[kind] - (random.random() < rate)
            lines.append(" ".join([kind, *(_number(random, rate) for _ in range(n + (random.random() < 0.03)))]))
            counts[kind] += 1
        elif kind == "f":
            words = []
            for _ in range(random.choice([3, 3, 3, 4, 5, 2])):
                form = random.choice(FORMS) if is_mixed else form
                words.append(form.format(*(_index(random, rate, count) for count in counts.values())))
            lines.append("f " + " ".join(words))
        else:
            lines.append(random.choice(OTHERS))
    return _spell(random, "\n".join(lines) + "\n")


FORMS = ("{0}", "{0}/{1}", "{0}//{2}", "{0}/{1}/{2}", "{0}/", "{0}//", "{0}/{1}/")
OTHERS = (
    "o a", "o", "o  two words ", "g x", "s 1", "s off", "s 99999999999", "usemtl a", "usemtl b#c", "# f 1 2 3", "", "v",
    "f", "p 1", "l 1 2", "vp 1 2", "hello", "#", "   ", "f ", "# c \\", "usemtl 1.#a",
)  # fmt: skip


def _number(random, rate):
    if random.random() < rate:
        return random.choice(NUMBERS)
    value = random.choice(
        [random.uniform(-9, 9), random.uniform(-1e-3, 1e-3), float(random.randrange(-(10**9), 10**9))]
    )
    return random.choice([f"{value:.{random.randrange(9)}f}", f"{value:g}", repr(value), f"{value:.3e}"])


def _index(random, rate, count):
    if random.random() < rate:
        return random.choice([*INDICES, str(count + 1), str(-count - 1)])
    if count == 0:
        return ""
    index = random.randrange(1, count + 1)
    return str(index if random.random() < 0.7 else index - count - 1)


def _spell(random, text) -> bytes:
    """Write a text in another way that means the same."""
    ways = (
        lambda: text.replace("\n", "\r\n"),
        lambda: text.replace("\n", "\r"),
        lambda: text.replace(" ", "\t"),
        lambda: text.replace("\n", "\n  "),
        lambda: "".join(
            random.choice((" \\\n", " \\ \t\n")) if letter == " " and random.random() < 0.2 else letter
            for letter in text
        ),
        lambda: "".join(
            f"{line} # f 1 2\n" if line[:2] in ("v ", "vt", "vn", "f ") else f"{line}\n" for line in text.split("\n")
        ),
        lambda: "\ufeff" + text,
        lambda: text.rstrip("\n"),
        lambda: "# Gr\u00fcn \u4e2d\n" + text,
    )
    way = random.randrange(2 * len(ways))
    if way == len(ways):
        return ("# Gr\u00fcn\n" + text).encode("latin-1", "replace")
    return (ways[way]() if way < len(ways) else text).encode()
