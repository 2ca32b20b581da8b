"""The entry point of a kernel: machine code that takes a Python tuple of arguments apart and calls the kernel.

    object entry(tuple arguments, int64 table[])

It stands in the same object code as the kernel and needs nothing but Python's C interface, so that a kernel from the
store is called without numba. It compares every argument with the table (kernels.ArgumentTypes): its class, and of
an array the dtype, the number of axes, the layout and the alignment. Where one differs it returns NotImplemented, and
nothing has been called. Else it calls the kernel without the GIL and returns what that returns: None, a bool, a number,
or a tuple of these.

The arrays it hands over have no owner that numba knows of, and kernels count no references: the caller holds the
arguments for the whole call.
"""

from functools import reduce

from llvmlite import ir
from numba import types
from numba.core import cgutils

from . import layouts
from .layouts import COMMON, ERROR, NDARRAY, NONE, NOT_IMPLEMENTED
from .machine_code import ENTRY

_LONG, _INT, _BYTE, _BIT, _REAL = ir.IntType(64), ir.IntType(32), ir.IntType(8), ir.IntType(1), ir.DoubleType()
_OBJECT = _BYTE.as_pointer()
_FUNCTIONS = {
    "PyLong_AsLongLong": (_LONG, [_OBJECT]),
    "PyLong_AsUnsignedLongLongMask": (_LONG, [_OBJECT]),
    "PyFloat_AsDouble": (_REAL, [_OBJECT]),
    "PyObject_IsTrue": (_INT, [_OBJECT]),
    "PyErr_Occurred": (_OBJECT, []),
    "PyErr_Clear": (ir.VoidType(), []),
    "PyErr_SetString": (ir.VoidType(), [_OBJECT, _OBJECT]),
    "PyEval_SaveThread": (_OBJECT, []),
    "PyEval_RestoreThread": (ir.VoidType(), [_OBJECT]),
    "PyLong_FromLongLong": (_OBJECT, [_LONG]),
    "PyLong_FromUnsignedLongLong": (_OBJECT, [_LONG]),
    "PyFloat_FromDouble": (_OBJECT, [_REAL]),
    "PyBool_FromLong": (_OBJECT, [_LONG]),
    "PyTuple_New": (_OBJECT, [_LONG]),
    "PyTuple_SetItem": (_INT, [_OBJECT, _LONG, _OBJECT]),
    "Py_IncRef": (ir.VoidType(), [_OBJECT]),
}
FAILED = b"a kernel failed: it met an error that it can't raise\0"


class Unsupported(Exception):
    """A kernel that has no entry point: its result is of a type that none is made for."""


def build_entry_point(context, module, fndesc) -> None:
    """Add the entry point of a kernel to a module.

    Parameters
    ----------
    context : numba's target context
    module : llvmlite.ir.Module; the kernel is declared in it
    fndesc : what numba knows of the compiled kernel

    Raises Unsupported where the result is of a type that no entry point is made for.
    """
    callee = context.declare_function(module, fndesc)
    function = ir.Function(module, ir.FunctionType(_OBJECT, [_OBJECT, _LONG.as_pointer()]), ENTRY)
    builder = ir.IRBuilder(function.append_basic_block("entry"))
    reader = _Reader(context, builder, function)
    arguments = reader.read_items(function.args[0], fndesc.argtypes)
    thread = reader.call("PyEval_SaveThread")
    status, result = context.call_conv.call_function(
        builder, callee, fndesc.restype, fndesc.argtypes, arguments, attrs=("noinline",)
    )
    reader.call("PyEval_RestoreThread", thread)
    with builder.if_then(status.is_error, likely=False):
        text = cgutils.global_constant(
            module, "failed", ir.Constant(ir.ArrayType(_BYTE, len(FAILED)), bytearray(FAILED))
        )
        reader.call("PyErr_SetString", reader.common(ERROR), builder.bitcast(text, _OBJECT))
        builder.ret(ir.Constant(_OBJECT, None))
    builder.ret(reader.wrap(result, fndesc.restype))


def build_batch_entry_point(context, module, fndesc) -> None:
    """Add the entry point of a batch function to a module: void entry(void *batch, int64 n, void *coefficients)."""
    callee = context.declare_function(module, fndesc)
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [_LONG, _LONG, _LONG]), ENTRY)
    builder = ir.IRBuilder(function.append_basic_block("entry"))
    arguments = [
        builder.inttoptr(value, context.get_value_type(numba_type)) if isinstance(numba_type, types.CPointer) else value
        for value, numba_type in zip(function.args, fndesc.argtypes, strict=True)
    ]
    context.call_conv.call_function(builder, callee, fndesc.restype, fndesc.argtypes, arguments)
    builder.ret_void()


class _Reader:
    """Writes the instructions that take arguments apart; `slot` is where in the table the next one's type stands."""

    def __init__(self, context, builder, function):
        self._context, self._builder, self._table = context, builder, function.args[1]
        self._slot = len(COMMON)
        self._otherwise = function.append_basic_block("otherwise")
        with builder.goto_block(self._otherwise):
            none = self.common(NOT_IMPLEMENTED)
            self.call("Py_IncRef", none)
            builder.ret(none)

    def call(self, name, *arguments):
        """Call a function of Python's C interface."""
        result, arguments_types = _FUNCTIONS[name]
        function = cgutils.get_or_insert_function(self._builder.module, ir.FunctionType(result, arguments_types), name)
        return self._builder.call(function, arguments)

    def common(self, slot):
        """Load one of the objects COMMON from the table."""
        return self._builder.inttoptr(self._entry(slot), _OBJECT)

    def _entry(self, slot):
        return self._builder.load(self._builder.gep(self._table, [ir.Constant(_LONG, slot)]))

    def _next_entry(self):
        self._slot += 1
        return self._entry(self._slot - 1)

    def _load(self, thing, offset, llvm_type):
        """Load a value of an LLVM type that stands `offset` bytes behind the beginning of an object."""
        address = self._builder.gep(thing, [ir.Constant(_LONG, offset)])
        return self._builder.load(self._builder.bitcast(address, llvm_type.as_pointer()))

    def read_items(self, thing, numba_types) -> list:
        """Read the items of a tuple; leave where there are more or less of them."""
        self._expect(
            self._builder.icmp_signed(
                "==", self._load(thing, layouts.N_ITEM, _LONG), ir.Constant(_LONG, len(numba_types))
            )
        )
        return [
            self.read(self._load(thing, layouts.ITEMS + 8 * k, _OBJECT), numba_type)
            for k, numba_type in enumerate(numba_types)
        ]

    def _expect(self, condition):
        """Go on where a condition holds; else leave."""
        after = self._builder.append_basic_block()
        self._builder.cbranch(condition, after, self._otherwise)
        self._builder.position_at_end(after)

    def _expect_class(self, thing, entry):
        self._expect(self._builder.icmp_signed("==", self._load(thing, layouts.CLASS, _LONG), entry))

    def read(self, thing, numba_type):
        """Read an argument of one of numba's types; leave where it is of another."""
        if isinstance(numba_type, types.Array):
            return self._read_array(thing, numba_type)
        self._expect_class(thing, self._next_entry())
        if isinstance(numba_type, types.BaseTuple):
            return self._context.make_tuple(self._builder, numba_type, self.read_items(thing, tuple(numba_type)))
        return self._read_number(thing, numba_type)

    def _read_number(self, thing, numba_type):
        builder, llvm_type = self._builder, self._context.get_value_type(numba_type)
        if isinstance(numba_type, types.NoneType):
            return self._context.get_dummy_value()
        if isinstance(numba_type, types.Boolean):
            return builder.icmp_signed("!=", self.call("PyObject_IsTrue", thing), ir.Constant(_INT, 0))
        if isinstance(numba_type, types.Float):
            value = self.call("PyFloat_AsDouble", thing)
            return value if llvm_type == _REAL else builder.fptrunc(value, llvm_type)
        if numba_type.signed:
            value = self.call("PyLong_AsLongLong", thing)
            self._leave_on_error(builder.icmp_signed("==", value, ir.Constant(_LONG, -1)))
        else:
            value = self.call("PyLong_AsUnsignedLongLongMask", thing)
        return value if llvm_type == _LONG else builder.trunc(value, llvm_type)

    def _leave_on_error(self, is_suspect):
        """Leave where a number of Python's was too large for 64 bits; it is then of another signature."""
        builder = self._builder
        with builder.if_then(is_suspect, likely=False):
            error = builder.ptrtoint(self.call("PyErr_Occurred"), _LONG)
            with builder.if_then(builder.icmp_signed("!=", error, ir.Constant(_LONG, 0)), likely=False):
                self.call("PyErr_Clear")
                builder.branch(self._otherwise)

    def _read_array(self, thing, numba_type):
        builder, one = self._builder, ir.Constant(_LONG, 1)
        wanted = {
            "C": layouts.IS_ALIGNED | layouts.IS_C,
            "F": layouts.IS_ALIGNED | layouts.IS_F,
            "A": layouts.IS_ALIGNED,
        }[numba_type.layout]
        looked_at = layouts.IS_ALIGNED | layouts.IS_C | (0 if numba_type.layout == "C" else layouts.IS_F)
        kind = [ir.Constant(_INT, number) for number in (numba_type.ndim, looked_at, wanted)]
        self._expect(builder.call(self._is_array(), [thing, self._entry(NDARRAY), self._next_entry(), *kind]))
        shape, strides = (self._load(thing, offset, _LONG.as_pointer()) for offset in (layouts.SHAPE, layouts.STRIDES))
        axes = [ir.Constant(_LONG, k) for k in range(numba_type.ndim)]
        lengths = [builder.load(builder.gep(shape, [axis])) for axis in axes]
        steps = [builder.load(builder.gep(strides, [axis])) for axis in axes]
        n_item = one
        for length in lengths:
            n_item = builder.mul(n_item, length)
        array = self._context.make_array(numba_type)(self._context, builder)
        array.data = builder.bitcast(self._load(thing, layouts.DATA, _OBJECT), array.data.type)
        array.shape = cgutils.pack_array(builder, lengths, ty=_LONG)
        array.strides = cgutils.pack_array(builder, steps, ty=_LONG)
        array.nitems = n_item
        array.itemsize = ir.Constant(_LONG, self._context.get_abi_sizeof(self._context.get_data_type(numba_type.dtype)))
        array.meminfo, array.parent = (cgutils.get_null_value(field.type) for field in (array.meminfo, array.parent))
        return array._getvalue()

    def _is_array(self):
        """Return a function that tells whether an object is an array of a dtype, a number of axes and a layout. Kernels
        have dozens of arrays: instructions of its own for each would be a tenth of all that is optimised."""
        module, name = self._builder.module, "is_array"
        if name in module.globals:
            return module.globals[name]
        function = ir.Function(module, ir.FunctionType(_BIT, [_OBJECT, _LONG, _LONG, _INT, _INT, _INT]), name)
        function.attributes.add("noinline")
        thing, array_class, number, n_axis, looked_at, wanted = function.args
        outside, self._builder = self._builder, ir.IRBuilder(function.append_basic_block("entry"))
        builder = self._builder
        with builder.if_then(builder.icmp_signed("!=", self._load(thing, layouts.CLASS, _LONG), array_class)):
            builder.ret(ir.Constant(_BIT, 0))
        dtype = self._load(thing, layouts.DTYPE, _OBJECT)
        order = self._load(dtype, layouts.BYTE_ORDER, _BYTE)
        orders = [builder.icmp_signed("==", order, ir.Constant(_BYTE, ord(sign))) for sign in layouts.NATIVE_ORDERS]
        layout = builder.and_(self._load(thing, layouts.FLAGS, _INT), looked_at)
        tests = [
            reduce(builder.or_, orders),
            builder.icmp_signed("==", builder.sext(self._load(dtype, layouts.NUMBER, _INT), _LONG), number),
            builder.icmp_signed("==", self._load(thing, layouts.N_AXIS, _INT), n_axis),
            builder.icmp_signed("==", layout, wanted),
        ]
        builder.ret(reduce(builder.and_, tests))
        self._builder = outside
        return function

    def wrap(self, value, numba_type):
        """Make a Python object of a result."""
        builder = self._builder
        if isinstance(numba_type, types.NoneType):
            none = self.common(NONE)
            self.call("Py_IncRef", none)
            return none
        if isinstance(numba_type, types.Boolean):
            return self.call("PyBool_FromLong", builder.zext(value, _LONG))
        if isinstance(numba_type, types.Integer):
            extend = builder.sext if numba_type.signed else builder.zext
            wide = value if value.type == _LONG else extend(value, _LONG)
            return self.call("PyLong_FromLongLong" if numba_type.signed else "PyLong_FromUnsignedLongLong", wide)
        if isinstance(numba_type, types.Float):
            return self.call("PyFloat_FromDouble", value if value.type == _REAL else builder.fpext(value, _REAL))
        if type(numba_type) in (types.Tuple, types.UniTuple):
            items = self.call("PyTuple_New", ir.Constant(_LONG, len(numba_type)))
            for k, part in enumerate(numba_type):
                item = self.wrap(builder.extract_value(value, k), part)
                self.call("PyTuple_SetItem", items, ir.Constant(_LONG, k), item)
            return items
        raise Unsupported(f"a kernel that returns {numba_type}")
