"""Entry points: random arguments of every kind reach the kernel as they are, and none of another kind ever does."""

import gc
import sys
import threading
import time

import numpy as np
import pytest
from helpers.processes import at_once
from helpers.stores import EntryPoint, Other, Pair, bits_of

from rasterizer.compiler.kernels import ArgumentTypes, kernel

DTYPES = [np.dtype(f"{kind}{size}") for kind in "iu" for size in (1, 2, 4, 8)]
DTYPES += [np.dtype("?"), np.dtype("f4"), np.dtype("f8"), np.dtype("q"), np.dtype("Q")]
N_TREE = 40

# ---------------------------------------------------------------- random arguments


def random_kind(rng, depth=0):
    """A random kind of argument: (what it is, more about it)."""
    what = rng.choice(["array"] * 4 + ["scalar"] * 2 + ["int", "float", "bool", "none"] + ["tuple"] * (3 - depth))
    if what == "array":
        return what, (DTYPES[rng.integers(len(DTYPES))], int(rng.integers(0, 4)), str(rng.choice(list("CFA"))))
    if what == "scalar":
        return what, DTYPES[rng.integers(len(DTYPES))]
    if what == "tuple":
        cls = (tuple, Pair, Other)[rng.integers(3)]
        n_item = 2 if cls is not tuple else int(rng.integers(0, 4))
        return what, (cls, [random_kind(rng, depth + 1) for _ in range(n_item)])
    return str(what), None


def random_numbers(rng, dtype, shape):
    """Numbers of a dtype, large and small."""
    if dtype.kind == "f":
        return (rng.normal(size=shape) * 10.0 ** rng.integers(-3, 9, shape)).astype(dtype)
    return np.frombuffer(rng.bytes(int(np.prod(shape)) * dtype.itemsize), dtype).reshape(shape).copy()


def random_array(rng, dtype, n_axis, layout):
    shape = tuple(int(n) for n in rng.integers(0 if rng.random() < 0.03 else 2, 5, n_axis))
    if dtype.kind == "b":
        values = rng.integers(0, 2, shape).astype(bool)
    else:
        values = random_numbers(rng, dtype, shape)
    if layout == "F" and n_axis:
        values = np.asfortranarray(values)
    elif layout == "A" and n_axis:
        if rng.random() < 0.3 and values.size:
            return np.broadcast_to(values[..., :1], (*shape[:-1], 3))
        values = np.repeat(values, 2, axis=-1)[..., ::2] if rng.random() < 0.5 else np.flip(values)
    return values


def random_value(rng, kind):
    what, more = kind
    if what == "array":
        return random_array(rng, *more)
    if what == "scalar":
        return random_array(rng, more, 0, "C")[()]
    if what == "tuple":
        cls, kinds = more
        items = [random_value(rng, kind) for kind in kinds]
        return tuple(items) if cls is tuple else cls(*items)
    if what == "int":
        return int(rng.integers(-(2**63), 2**63 - 1, endpoint=True))
    return {"float": float(rng.normal()), "bool": bool(rng.random() < 0.5), "none": None}[what]


# ---------------------------------------------------------------- a kernel for them


def source_of(kinds) -> str:
    """The source of a kernel that returns sums of all that its arguments hold, each with a factor of its own."""
    lines, names = ["total, bits = 0.0, np.int64(0)"], [f"a{k}" for k in range(len(kinds))]
    waiting = list(zip(names, kinds, strict=True))
    while waiting:
        name, (what, more) = waiting.pop(0)
        factor = 1.0 + len(lines) / 64
        if what == "tuple":
            waiting += [(f"{name}[{k}]", kind) for k, kind in enumerate(more[1])]
            lines.append(f"total += {factor} * len({name})")
        elif what == "array":
            lines += sum_of_array(name, *more[:2], factor)
        elif what != "none":
            is_bool = what == "bool" or more == np.dtype("?")
            lines.append(f"total += {factor} * {as_float(name, is_bool)}")
            if what == "int" or (what == "scalar" and more.kind in "iu"):
                lines.append(f"bits = bits * 5 + np.int64({name})")
    body = "\n    ".join(lines)
    return f"def summed({', '.join(names)}):\n    {body}\n    return total, bits, {len(lines)}\n"


def as_float(name, is_bool) -> str:
    return f"(1.0 if {name} else 0.0)" if is_bool else f"float({name})"


def sum_of_array(name, dtype, n_axis, factor):
    yield f"total += {name}.size + {name}.itemsize * {factor} + {name}.ndim"
    yield from (f"total += {name}.strides[{k}] * {factor + k}" for k in range(n_axis))
    yield from (f"{'    ' * k}for i{k} in range({name}.shape[{k}]):" for k in range(n_axis))
    item = f"{name}[{''.join(f'i{k}, ' for k in range(n_axis)) or '()'}]"
    yield f"{'    ' * n_axis}total = 0.75 * total + {factor} * {as_float(item, dtype.kind == 'b')}"
    if dtype.kind in "iu":
        yield f"{'    ' * n_axis}bits = bits * 3 + np.int64({item})"


def kernel_of(kinds):
    space = {"np": np}
    exec(source_of(kinds), space)
    return space["summed"]


def by_python(function, values):
    with np.errstate(all="ignore"):
        total, bits, n_line = function(*values)
    return float(total), int(bits), n_line


def tell_apart(values) -> tuple:
    """What decides whether an entry point takes arguments."""
    types = ArgumentTypes(values)
    return types.signature, types.numbers


@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(k, marks=pytest.mark.nightly) for k in range(4, 60))])
def test_random_arguments_arrive_as_they_are_and_others_never(seed):
    """The same sums, to the bit, by the entry point and by Python; what is of another kind anywhere is not taken."""
    rng = np.random.default_rng(seed)
    kinds = [random_kind(rng) for _ in range(rng.integers(2, 6))]
    function, examples = kernel_of(kinds), tuple(random_value(rng, kind) for kind in kinds)
    entry, own = EntryPoint(function, examples), tell_apart(examples)
    many = [examples, *(tuple(random_value(rng, kind) for kind in kinds) for _ in range(N_TREE))]
    many += [replaced(examples, rng) for _ in range(200)]
    n_other = 0
    for values in many:
        found = entry(*values)
        if tell_apart(values) == own:
            assert bits_of(found) == bits_of(by_python(function, values)), source_of(kinds)
        else:
            n_other += 1
            assert found is NotImplemented, f"took {tell_apart(values)[0]}, compiled for {own[0]}"
    assert 120 < n_other < len(many) - 1, f"{n_other} of {len(many)} were of another kind"


# ---------------------------------------------------------------- arguments of another kind


def replaced(values, rng):
    """The same arguments but for one, somewhere inside, that is something else."""
    k = int(rng.integers(len(values)))
    if isinstance(values[k], tuple) and values[k] and rng.random() < 0.7:
        item = replaced(values[k], rng)
    else:
        item = random_value(rng, random_kind(rng))
    items = [*values[:k], item, *values[k + 1 :]]
    if type(values) is not tuple:
        return values._make(items)
    end = rng.random()
    return tuple(items) if end < 0.8 else tuple(items[:-1]) if end < 0.9 else (*items, None)


def bad_kinds(value):
    """What an argument may be mistaken for."""
    if isinstance(value, np.ndarray):
        yield from (value[None], value.tolist(), value.view(np.recarray), None, 0, value.dtype)
        yield value.astype(value.dtype.newbyteorder()) if value.dtype.itemsize > 1 else value.astype("U")
        yield value.astype(object)
        memory = np.zeros(value.nbytes + 1, np.uint8)[1:]
        yield memory.view(value.dtype).reshape(value.shape) if value.dtype.itemsize > 1 else value.astype(complex)
        yield np.repeat(value, 2, axis=-1)[..., ::2] if value.ndim else value[None]
        yield np.asfortranarray(value) if value.ndim > 1 else value.astype("S9")
    elif isinstance(value, tuple):
        yield from ([*value], (*value, None), value[:-1] if value else (1,), None, np.zeros(len(value)))
        yield from (cls(1, 2) for cls in (Pair, Other) if cls is not type(value))
    else:
        yield from (None if value is not None else 0, 1.5 if type(value) is not float else 1, "1", b"1", [value])
        yield from (np.zeros(()), np.int32(1) if type(value) is not np.int32 else np.int16(1), 2**64, -(2**63) - 1)


CASES = (
    (np.arange(6.0).reshape(2, 3), np.arange(5, dtype=np.int32), np.float32(2), 3, True, None),
    (Pair(1, (2.0, ())), Other(np.arange(3.0), Pair(np.uint8(3), None)), (1, 2)),
)


def test_nothing_of_another_kind_is_taken_anywhere():
    for values in CASES:
        entry = EntryPoint(first_of, (values,))
        assert entry(values) == 7
        assert entry() is entry(values, values) is NotImplemented
        taken = [bad for bad in spoiled(values) if entry(bad) is not NotImplemented]
        assert not taken, f"takes {taken[:3]}"


def first_of(values):
    return 7


def spoiled(values):
    """The tuple with each of its items, at any depth, replaced by each thing that it may be mistaken for."""
    for k, value in enumerate(values):
        inner = spoiled(value) if isinstance(value, tuple) else ()
        for item in [*bad_kinds(value), *inner]:
            items = [*values[:k], item, *values[k + 1 :]]
            yield tuple(items) if type(values) is tuple else values._make(items)


def total_of(values):
    total = 0.0
    for k in range(len(values)):
        total += values[k]
    return total


# ---------------------------------------------------------------- results


def fails(x):
    if x > 3:
        raise ValueError("too large")
    return x


def test_a_kernel_that_fails_raises_and_says_so():
    entry = EntryPoint(fails, (1,))
    assert entry(2) == 2
    with pytest.raises(RuntimeError, match="a kernel failed: it met an error that it can't raise"):
        entry(5)
    assert entry(3) == 3


# ---------------------------------------------------------------- references, threads


def give_all(values, pair, x):
    return values[0] * 1e9, (None, pair[0] + 10**12, np.uint64(2**63) + np.uint64(x)), x > 2, None


def counted_call(n_call):
    """Call a kernel often, also with what it doesn't take; return how many blocks of memory and references are new."""
    values, pair, large = np.arange(1000.0, 1003.0), Pair(10**15, None), 10**30
    entry = EntryPoint(give_all, (values, pair, 3))
    things = (values, pair, pair.first, large, values.dtype, Pair, NotImplemented, tuple)
    counts, blocks = [], []
    for _ in range(3):
        for _ in range(n_call):
            result = entry(values, pair, 3)
            entry(values, pair, large)
            entry(values, pair)
        assert result == (1e12, (None, 10**15 + 10**12, 2**63 + 3), True, None)
        del result
        gc.collect()
        counts.append([sys.getrefcount(thing) for thing in things])
        blocks.append(sys.getallocatedblocks())
    return np.subtract(counts[-1], counts[0]), blocks[-1] - blocks[0]


@pytest.mark.parametrize("n_call", [3_000, pytest.param(1_000_000, marks=pytest.mark.nightly)])
def test_references_and_memory_stay_as_they_are(n_call):
    references, n_block = counted_call(n_call)
    assert not references.any(), f"{references} references more after {2 * n_call} calls"
    assert n_block < 50, f"{n_block} blocks of memory more after {2 * n_call} calls"


def spin(n):
    total = 0.0
    for k in range(n):
        total += np.sqrt(k + total)
    return total


def test_other_threads_run_while_a_kernel_does(alone):
    entry, state = EntryPoint(spin, (1,)), []
    entry(10)

    def work():
        state.append("begun")
        entry(40_000_000)
        state.append("ended")

    thread = threading.Thread(target=work)
    thread.start()
    n_turn = 0
    while "ended" not in state:
        n_turn += "begun" in state
        time.sleep(0.001)
    thread.join()
    assert n_turn > 5, f"another thread had {n_turn} turns <= 5 while a kernel ran"


def test_threads_at_once_get_their_own_results():
    """Also where they meet the kernel for the first time together."""
    summed = kernel(total_of)
    values = [np.full(50 + k, k, (np.float64, np.int32)[k % 2]) for k in range(4)]
    found = at_once(lambda k: {summed(values[k]) for _ in range(1000)}, 4)
    assert found == [{float(k * (50 + k))} for k in range(4)]
