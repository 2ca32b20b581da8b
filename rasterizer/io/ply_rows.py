"""Read the header and the rows of a PLY file.

In: the bytes of the file. Out: for each element its properties as columns of numbers; lists as `List`.
"""

from array import array
from typing import NamedTuple

import numpy as np

from ..scene.arrays import distinct
from .text_numbers import numbers_in

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
MOST_PROPERTIES = 256  # of an element, and elements of a file
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


class Property(NamedTuple):
    """A property of an element: a number in each row, or a list."""

    name: str
    type: str  # numpy's, without the order of bytes
    count_type: str | None  # of a list's length; None where it is no list


class Element(NamedTuple):
    """An element of the header: so many rows of the same properties."""

    name: str
    n_row: int
    properties: list
    line: int  # of the header


class List(NamedTuple):
    """A property that is a list in each row."""

    counts: np.ndarray  # (n_row,) int64
    items: np.ndarray  # all rows' items, one behind the other


def read_header(model):
    """Return the order of bytes, the elements, where the data begins, and how many lines the header has."""
    end = model.data.find(b"end_header")
    if end < 0:
        raise model.error("the PLY header has no 'end_header'")
    head = model.data[:end].decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")
    order, elements = None, []
    for line, text in enumerate(head.split("\n"), 1):
        words = text.split()
        key = words[0].lower() if words else ""
        try:
            if key == "format":
                order = _ORDERS[words[1]]
            elif key == "element":
                elements.append(Element(words[1], int(words[2]), [], line))
            elif key == "property" and words[1] == "list":
                elements[-1].properties.append(Property(words[4], _TYPES[words[3]], _TYPES[words[2]]))
            elif key == "property":
                elements[-1].properties.append(Property(words[2], _TYPES[words[1]], None))
        except (IndexError, KeyError, ValueError):
            raise model.error(f"'{text.strip()[:60]}' is not a line of a PLY header", line) from None
        properties = elements[-1].properties if key == "property" else []
        if max(len(elements), len(properties)) > MOST_PROPERTIES:
            raise model.error(f"more than {MOST_PROPERTIES} elements or properties", line)
        if len({each.name for each in properties}) < len(properties):
            raise model.error(f"the property '{properties[-1].name}' is there twice", line)
        if elements and elements[-1].n_row < 0:
            raise model.error(f"{elements[-1].n_row} {elements[-1].name} lines; none is the least", line)
    if order is None:
        raise model.error("the PLY header has no line 'format'")
    start = end + len(b"end_header")
    while start < len(model.data) and model.data[start] in b" \t":
        start += 1
    start += 2 if model.data[start : start + 2] == b"\r\n" else 1
    return order, elements, start, head.count("\n") + 1


def _promised(model, element, n_found):
    """The error where an element has fewer rows than the header says."""
    text = f"the header promises {element.n_row} {element.name} lines, the file has {n_found}"
    return model.error(text, element.line)


class Text:
    """The rows of an ASCII file, one number after the other, whatever the lines."""

    def __init__(self, model, elements, start, n_line):
        self.model, self.elements, self.n_line = model, elements, n_line
        self.text = model.data[start:].decode("latin-1")
        self.numbers = numbers_in(self.text)
        if self.numbers is None:
            self._name_fault()
        self.at = 0

    def element(self, element) -> dict:
        """Return the columns of the next element by name."""
        n, properties = element.n_row, element.properties
        if not properties:
            return {}
        left = len(self.numbers) - self.at
        if n * len(properties) > left:  # a list has at least its length
            raise _promised(self.model, element, left // max(len(properties), 1))
        if all(each.count_type is None for each in properties):
            rows = self.numbers[self.at : self.at + n * len(properties)].reshape(n, -1)
            self.at += rows.size
            return {each.name: rows[:, k] for k, each in enumerate(properties)}
        return _walk(self, element, self._even_rows(element))

    def _even_rows(self, element):
        """Return the columns of rows whose lists are all as long as those of the first; None where they are not."""
        columns, width = [], 0
        for each in element.properties:
            if each.count_type is None:
                columns.append((each, slice(width, width + 1)))
                width += 1
                continue
            if element.n_row == 0 or self.at + width >= len(self.numbers):
                return None
            length = self.numbers[self.at + width]
            if not 0 <= length <= len(self.numbers):
                return None
            columns.append((each, slice(width, width + 1 + int(length))))
            width += 1 + int(length)
        if element.n_row * width > len(self.numbers) - self.at:
            return None
        rows = self.numbers[self.at : self.at + element.n_row * width].reshape(element.n_row, width)
        found = {}
        for each, column in columns:
            if each.count_type is None:
                found[each.name] = rows[:, column.start]
            elif (rows[:, column.start] != column.stop - column.start - 1).any():
                return None
            else:
                counts = np.full(element.n_row, column.stop - column.start - 1)
                found[each.name] = List(counts, rows[:, column.start + 1 : column.stop].ravel())
        self.at += rows.size
        return found

    def number(self, _type):
        """Return the next number; IndexError where there is none."""
        self.at += 1
        if self.at > len(self.numbers):
            raise IndexError
        return self.numbers[self.at - 1]

    def several(self, _type, n):
        """Return the next n numbers; IndexError where there are fewer."""
        if not (0 <= n <= len(self.numbers) - self.at and n == int(n)):  # nan compares as false
            raise IndexError
        self.at += int(n)
        return self.numbers[self.at - int(n) : self.at]

    def line_of(self, name, row) -> int | None:
        """The number of the line of an element's row, if every row has a line."""
        before = 0
        for element in self.elements:
            if element.name == name:
                break
            before += element.n_row
        lines = [number for number, line in enumerate(self.text.splitlines(), self.n_line + 1) if line.split()]
        return lines[before + row] if before + row < len(lines) else None

    def fault(self, element, row):
        """The error for a row that ends too early, or whose list has no legal length."""
        if self.at >= len(self.numbers):
            return _promised(self.model, element, row)
        line = self.line_of(element.name, row)
        return self.model.error(
            f"{element.name} {row}: {self.numbers[self.at - 1]:g} is not how long its list is", line
        )

    def _name_fault(self):
        """Raise the error for the first word that is no number."""
        for number, line in enumerate(self.text.splitlines(), self.n_line + 1):
            for word in line.split():
                try:
                    float(word)
                except ValueError:
                    raise self.model.error(f"'{word[:40]}' is not a number", number) from None
        raise self.model.error("holds something that is no number")


class Bytes:
    """The rows of a binary file."""

    def __init__(self, model, start, order):
        self.model, self.at, self.order = model, start, order
        self.data = model.data

    def element(self, element) -> dict:
        """Return the columns of the next element by name."""
        if not element.properties:
            return {}
        least = sum(np.dtype(each.count_type or each.type).itemsize for each in element.properties)
        if element.n_row * least > len(self.data) - self.at:
            found = max(len(self.data) - self.at, 0) // max(least, 1)
            raise self.model.error(
                f"binary PLY of another length than its header says: {element.n_row} {element.name} rows promised, "
                f"room for at most {found}",
                element.line,
            )
        even = self._even_rows(element)
        lengths = [each.count_type for each in element.properties if each.count_type is not None]
        if even is None and len(lengths) == 1 and lengths[0][0] != "f":
            return self._rows_of_one_list(element)
        return _walk(self, element, even)

    def _rows_of_one_list(self, element):
        """Return the columns of rows with one list, whatever its length: where each row begins is found row by row, the
        rest for all rows at once."""
        kinds = [np.dtype(self.order + (each.count_type or each.type)) for each in element.properties]
        number = next(k for k, each in enumerate(element.properties) if each.count_type is not None)
        one = element.properties[number]
        item = np.dtype(self.order + one.type)
        before = sum(kind.itemsize for kind in kinds[:number])
        starts, counts = self._list_starts(element, before, kinds, item.itemsize)
        places = {}
        for k, kind in enumerate(kinds):
            behind = counts * item.itemsize if k > number else 0
            places[k] = starts + sum(each.itemsize for each in kinds[:k]) + behind, kind
        found = {
            each.name: self._gather(*places[k], 1).reshape(-1)
            for k, each in enumerate(element.properties)
            if k != number
        }
        items = np.empty(int(counts.sum()), item)
        first = np.cumsum(counts) - counts
        for count in distinct(counts).tolist():
            rows = np.flatnonzero(counts == count)
            begins = starts[rows] + before + kinds[number].itemsize
            items[first[rows, None] + np.arange(count)] = self._gather(begins, item, count)
        return found | {one.name: List(counts, items)}

    def _list_starts(self, element, before, kinds, item_size):
        """Return where each row of one list begins, and how long its list is, both (n_row,) int64."""
        count_kind = kinds[next(k for k, each in enumerate(element.properties) if each.count_type is not None)]
        fixed, at, data = sum(kind.itemsize for kind in kinds), self.at, self.data
        size, signed = count_kind.itemsize, count_kind.kind == "i"
        order = "big" if self.order == ">" else "little"
        starts, counts = array("q"), array("q")
        for row in range(element.n_row):
            place = at + before
            count = data[place] if size == 1 and place < len(data) and not signed else None
            if count is None:
                count = int.from_bytes(data[place : place + size], order, signed=signed)
            if not 0 <= count <= (len(data) - at - fixed) // item_size:
                raise self.fault(element, row)
            starts.append(at)
            counts.append(count)
            at += fixed + count * item_size
        self.at = at
        return np.frombuffer(starts, np.int64), np.frombuffer(counts, np.int64)

    def _gather(self, begins, kind, n) -> np.ndarray:
        """Return n numbers of a kind from each of some places on, (n_place, n)."""
        if len(begins) < n * kind.itemsize:
            rows = [np.frombuffer(self.data, kind, n, begin) for begin in begins.tolist()]
            return np.stack(rows) if rows else np.empty((0, n), kind)
        letters = np.frombuffer(self.data, np.uint8)
        columns = np.empty((len(begins), n * kind.itemsize), np.uint8)
        for k in range(n * kind.itemsize):
            columns[:, k] = letters[begins + k]
        return columns.view(kind) if n else np.empty((len(begins), 0), kind)

    def _even_rows(self, element):
        """Return the columns of rows whose lists are all as long as those of the first; None where they are not."""
        fields, at = [], self.at
        for number, each in enumerate(element.properties):
            kind = np.dtype(self.order + each.type)
            if each.count_type is not None:
                count_kind = np.dtype(self.order + each.count_type)
                if element.n_row == 0 or at + count_kind.itemsize > len(self.data):
                    return None
                length = int(np.frombuffer(self.data, count_kind, 1, at)[0])
                if not 0 <= length <= len(self.data):
                    return None
                fields += [(f"n{number}", count_kind), (f"p{number}", kind, (length,))]
                at += count_kind.itemsize + length * kind.itemsize
            else:
                fields.append((f"p{number}", kind))
                at += kind.itemsize
        rows = np.dtype(fields)
        if element.n_row * rows.itemsize > len(self.data) - self.at:
            return None
        table = np.frombuffer(self.data, rows, element.n_row, self.at)
        found = {}
        for number, each in enumerate(element.properties):
            column = table[f"p{number}"]
            if each.count_type is None:
                found[each.name] = column
                continue
            if (table[f"n{number}"] != column.shape[1]).any():
                return None
            found[each.name] = List(np.full(element.n_row, column.shape[1]), column.ravel())
        self.at += element.n_row * rows.itemsize
        return found

    def number(self, kind):
        """Return the next number; IndexError where there is none."""
        return self.several(kind, 1)[0]

    def several(self, kind, n):
        """Return the next n numbers; IndexError where there are fewer."""
        kind = np.dtype(self.order + kind)
        if not 0 <= n <= (len(self.data) - self.at) // kind.itemsize:
            raise IndexError
        numbers = np.frombuffer(self.data, kind, int(n), self.at)
        self.at += int(n) * kind.itemsize
        return numbers

    def line_of(self, _name, _row):
        """A binary file has no lines."""
        return

    def fault(self, element, row):
        """The error for a row that ends too early."""
        text = (
            f"binary PLY of another length than its header says: it ends in {element.name} row {row} of {element.n_row}"
        )
        return self.model.error(text, element.line)


def _walk(source, element, even):
    """Return the columns of an element row by row, where its lists differ in length; `even` if they were found not
    to."""
    if even is not None:
        return even
    scalars = {each.name: [] for each in element.properties if each.count_type is None}
    lists = {each.name: ([], []) for each in element.properties if each.count_type is not None}
    for row in range(element.n_row):
        try:
            for each in element.properties:
                if each.count_type is None:
                    scalars[each.name].append(source.number(each.type))
                else:
                    items = source.several(each.type, source.number(each.count_type))
                    lists[each.name][0].append(len(items))
                    lists[each.name][1].append(items)
        except IndexError:
            raise source.fault(element, row) from None
    columns = {name: np.array(values) for name, values in scalars.items()}
    return columns | {
        name: List(np.array(counts, np.int64), np.concatenate(items) if items else np.empty(0))
        for name, (counts, items) in lists.items()
    }
