"""What numba does to make a kernel's instructions, as far as kernels need it: a first picture waits for nothing else.

Two thirds of the time that a kernel takes to compile pass before the optimiser sees it: in numba's passes, each over
every function, and in writing, printing and reading instructions that the optimiser takes out again.

* `ShortPassManager` leaves out the passes for what kernels don't have, and what numba notes of each pass.
* `ShortBranches` leaves out what stands where an argument is None, if it isn't. Numba leaves out the other side alone.
* A `Struct`, the type of a structure that a kernel is called with, is passed on to helpers as one value. Numba passes
  it field by field, each array in it as seven numbers: a helper of one line that gets two structures would begin with a
  hundred instructions that put them together, and each call of it with as many that take them apart.
* `ShortLower` reads and writes items of contiguous arrays where the array's description says, and takes no index for
  one that counts from the end. Numba tests each, and copies the description to memory first, thirty instructions an
  item. Variables that are set once stay out of memory, too. What an operation or a call is of was inferred before:
  numba infers it again. Ranges, and items of structures, take as few instructions.
* `ShortNames` calls `min` and `max` what is spelled out here. Numba compiles a function for each type of arguments.
* `ShortTyping` remembers what operators make of which types. Numba looks for it at each sum and each product. It
  remembers what all calls in a function make, as numba infers types until nothing changes: at least twice.

The names of numba that are used here are listed in internals.py.
"""

import collections
import operator
from typing import NamedTuple

import llvmlite.ir
import numba.extending
from numba import types
from numba.core import (
    analysis,
    cgutils,
    compiler_machinery,
    ir,
    lowering,
    typed_passes,
    untyped_passes,
)
from numba.core.datamodel import models
from numba.cpython import builtins
from numba.np import arrayobj

# Passes for what no kernel has: `with`, closures and comprehensions, exceptions, functions that numba is to inline into
# its own form of the program, loops over tuples of several types, arithmetic with whole arrays, parallel loops.
NOT_NEEDED = frozenset((
    "WithLifting", "InlineClosureLikes", "RewriteDynamicRaises", "MakeFunctionToJitFunction", "InlineInlinables",
    "FindLiterallyCalls", "LiteralUnroll", "LiteralPropagationSubPipelinePass", "InlineOverloads", "NopythonRewrites",
    "DumpParforDiagnostics", "AnnotateTypes", "NoPythonSupportedFeatureValidation",
    "IRProcessing", "IRLegalization",  # when variables end, for who counts references
))  # fmt: skip


class ShortPassManager(compiler_machinery.PassManager):
    """The passes of a pipeline of numba's that are needed, one after the other."""

    def __init__(self, pipeline):
        super().__init__(pipeline.pipeline_name)
        steps = [step for step in pipeline.passes if step[0].__name__ not in NOT_NEEDED]
        passes = [step[0] for step in steps]
        steps[passes.index(typed_passes.NativeLowering)] = (ShortLowering, "write instructions")
        steps[passes.index(untyped_passes.DeadBranchPrune)] = (ShortBranches, "leave out what can't be reached")
        steps.insert(passes.index(typed_passes.NopythonTypeInference), (ShortNames, "name what is spelled out"))
        self.passes = steps

    def _runPass(self, index, pss, internal_state):
        """Run one of them. Numba also puts the function in order after each; the last one before instructions are
        written does that here."""
        pss.analysis = self._analysis
        pss.run_initialization(internal_state)
        pss.run_pass(internal_state)
        pss.run_finalizer(internal_state)


class _Thing(NamedTuple):
    """The type of an argument that isn't None, as numba has the types of literals."""

    literal_type: types.Type


@compiler_machinery.register_pass(mutates_CFG=True, analysis_only=False)
class ShortBranches(untyped_passes.DeadBranchPrune):
    """The pass that leaves out branches for arguments that are None, or aren't."""

    _name = "rasterizer_short_branches"

    def run_pass(self, state):
        """Leave them out; tell whether anything may be changed."""
        is_open = types.NoneType, types.Omitted, types.Optional
        known = [each if isinstance(each, is_open) else _Thing(each) for each in state.args]
        analysis.dead_branch_prune(state.func_ir, known)
        return True


# ---------------------------------------------------------------- structures


class Struct(types.NamedTuple):
    """The type of a structure that a kernel is called with."""


@models.register_default(Struct)
class StructModel(models.TupleModel):
    """How a `Struct` is represented: as any tuple, but one value as an argument."""

    def get_argument_type(self):
        """Return LLVM's type of an argument."""
        return self.get_value_type()

    def as_argument(self, builder, value):
        """Return what is passed on for a value."""
        return value

    def from_argument(self, builder, value):
        """Return the value of what was passed on."""
        return value


def _in_parts(struct):
    """Return the type of a structure, with the same values, that is passed field by field: a kernel's arguments are."""
    is_struct = type(struct) is Struct
    return types.NamedTuple([_in_parts(item) for item in struct], struct.instance_class) if is_struct else struct


# ---------------------------------------------------------------- instructions


class ShortLower(lowering.Lower):
    """What writes instructions: numba's, but for what kernels mostly consist of."""

    def __init__(self, context, library, fndesc, *others, **named):
        # Loops become vector instructions only where what they write isn't taken for a table that they read. LLVM
        # takes arguments for other memory than its constants, but not what it finds in a structure.
        if not fndesc.inline:
            fndesc.argtypes = tuple(map(_in_parts, fndesc.argtypes))
        self._ranges = {}
        super().__init__(context, library, fndesc, *others, **named)

    def _find_singly_assigned_variable(self):
        """Note the variables that need no memory: those that are set once, before they are used, whatever happens.

        Numba finds those that one block alone uses.
        """
        self._singly_assigned_vars, self._blk_local_varmap = set(), {}
        blocks, in_memory = self.func_ir.blocks, lowering.must_use_alloca(self.func_ir.blocks)
        uses, dominators = analysis.compute_use_defs(blocks), analysis.compute_cfg_from_blocks(blocks).dominators()
        n_set = collections.Counter(one.target.name for block in blocks.values() for one in block.find_insts(ir.Assign))
        set_in = {name: label for label, names in uses.defmap.items() for name in names}
        users = collections.defaultdict(list)
        for label, names in uses.usemap.items():
            for name in names:
                users[name].append(label)
        for name, label in set_in.items():
            # Blocks are written in the order of their labels.
            if n_set[name] == 1 and name not in in_memory:
                if all(label in dominators[user] and label < user for user in users[name]):
                    self._singly_assigned_vars.add(name)

    def pre_block(self, block):
        """Begin a block: with nothing to do, as kernels catch no exceptions."""

    def lower_block(self, block):
        """Write the statements of a block. Where one can't be written, numba.njit says which."""
        for statement in block.body:
            self.loc = statement.loc
            self.lower_inst(statement)

    def storevar(self, value, name, argidx=None):
        """Store a value into a variable; nobody counts references to what was in it."""
        if name in self._singly_assigned_vars:
            self._blk_local_varmap[name] = value
        else:
            self.builder.store(value, self.getvar(name))

    def lower_assign(self, ty, inst):
        """Write what is assigned; functions, modules and classes are nothing."""
        if isinstance(inst.value, (ir.Global, ir.FreeVar)) and isinstance(ty, types.Opaque):
            return self.context.get_dummy_value()
        return super().lower_assign(ty, inst)

    def lower_expr(self, resty, expr):
        """Write an expression."""
        read = _READERS.get(expr.op)
        value = read and read(self, resty, expr)
        return super().lower_expr(resty, expr) if value is None else value

    def _operands(self, variables, numba_types):
        return [self._cast_var(variable, each) for variable, each in zip(variables, numba_types, strict=True)]

    def _struct_of(self, numba_type, *items):
        """Put a structure together."""
        struct = llvmlite.ir.Constant(self.context.get_value_type(numba_type), llvmlite.ir.Undefined)
        for k, item in enumerate(items):
            struct = self.builder.insert_value(struct, item, k)
        return struct

    # ------------------------------------------------ numbers

    def lower_binop(self, resty, expr, op):
        """Write an operation. Numba infers its types once more, four times, to find constants among the operands."""
        context, signature = self.context, self.fndesc.calltypes[expr]
        if op in _POWERS or not _are_numbers(signature.args):
            return super().lower_binop(resty, expr, op)
        if (op, signature) not in _OPERATIONS:
            function = context.typing_context.resolve_value_type(op)
            _OPERATIONS[op, signature] = function, function.get_call_type(context.typing_context, signature.args, {})
        operation = context.get_function(*_OPERATIONS[op, signature])
        value = operation(self.builder, self._operands((expr.lhs, expr.rhs), signature.args))
        return context.cast(self.builder, value, signature.return_type, resty)

    def lower_call(self, resty, expr):
        """Write a call: that of a number's class is a cast, that of range a structure of its ends."""
        function, signature = self.typeof(expr.func.name), self.fndesc.calltypes[expr]
        if expr.kws or expr.vararg or not _are_numbers(signature.args):
            return super().lower_call(resty, expr)
        is_truth = getattr(function, "typing_key", None) is bool and signature.args == (types.boolean,)
        if is_truth or (isinstance(function, types.NumberClass) and len(signature.args) == 1):
            (value,) = self._operands(expr.args, signature.args)
            value = self.context.cast(self.builder, value, signature.args[0], signature.return_type)
            return self.context.cast(self.builder, value, signature.return_type, resty)
        if isinstance(resty, types.RangeType) and len(signature.args) < 3:
            *start, stop = self._operands(expr.args, signature.args)
            ends = start[0] if start else stop.type(0), stop, stop.type(1)
            found = self._struct_of(resty, *ends)
            self._ranges[id(found)] = found, ends  # with it: its number stays its own
            return found
        return super().lower_call(resty, expr)

    # ------------------------------------------------ ranges and structures

    def _read_iterator(self, resty, expr):
        """Write what begins a loop over a range of steps of 1: where the next number stands, and how many are left."""
        builder, (_, ends) = self.builder, self._ranges.get(id(self.loadvar(expr.value.name)), (None, None))
        if ends is None:
            return None
        start, stop, step = ends
        following, left = (cgutils.alloca_once(builder, start.type) for _ in range(2))
        n = builder.sub(stop, start)
        builder.store(start, following)
        builder.store(builder.select(builder.icmp_signed(">", n, n.type(0)), n, n.type(0)), left)
        return self._struct_of(resty, following, stop, step, left)

    def _read_next(self, resty, expr):
        """Write what a loop over a range does at each turn: its number, and whether there was one left."""
        builder = self.builder
        if not isinstance(self.typeof(expr.value.name), types.RangeIteratorType):
            return None
        iterator = self.loadvar(expr.value.name)
        following, step, left = (builder.extract_value(iterator, k) for k in (0, 2, 3))
        value, n = builder.load(following), builder.load(left)
        builder.store(builder.add(value, step), following)
        builder.store(builder.sub(n, n.type(1)), left)
        return self._struct_of(resty, value, builder.icmp_signed(">", n, n.type(0)))

    def _read_first(self, _resty, expr):
        return self.builder.extract_value(self.loadvar(expr.value.name), 0)

    def _read_second(self, _resty, expr):
        return self.builder.extract_value(self.loadvar(expr.value.name), 1)

    def _read_field(self, resty, expr):
        struct = self.typeof(expr.value.name)
        if not isinstance(struct, types.BaseNamedTuple) or expr.attr not in struct.fields:
            return None
        return self._read_item_of(resty, expr, struct.fields.index(expr.attr))

    def _read_item(self, resty, expr):
        struct = self.typeof(expr.value.name)
        if not isinstance(struct, types.BaseTuple) or type(expr.index) is not int:
            return None
        return self._read_item_of(resty, expr, range(len(struct))[expr.index])

    def _read_item_of(self, resty, expr, k):
        item = self.builder.extract_value(self.loadvar(expr.value.name), k)
        return self.context.cast(self.builder, item, self.typeof(expr.value.name).types[k], resty)

    # ------------------------------------------------ arrays

    def lower_getitem(self, resty, expr, value, index, signature):
        """Write what reads an item."""
        array_type, address = signature.args[0], self._address_of(value, index, signature)
        if address is None:
            return super().lower_getitem(resty, expr, value, index, signature)
        item = arrayobj.load_item(self.context, self.builder, array_type, address)
        return self.context.cast(self.builder, item, array_type.dtype, resty)

    def lower_setitem(self, target_var, index_var, value_var, signature):
        """Write what changes an item."""
        array_type, address = signature.args[0], self._address_of(target_var, index_var, signature)
        if address is None:
            return super().lower_setitem(target_var, index_var, value_var, signature)
        value = self.loadvar(value_var.name)
        value = self.context.cast(self.builder, value, self.typeof(value_var.name), array_type.dtype)
        return arrayobj.store_item(self.context, self.builder, array_type, value, address)

    def _address_of(self, array, index, signature):
        """Return the address of an item; None where numba has to find it."""
        array_type, index_type, context = self.typeof(array.name), self.typeof(index.name), self.context
        is_several = isinstance(index_type, types.BaseTuple)
        index_types = tuple(index_type) if is_several else (index_type,)
        if context.enable_boundscheck or not isinstance(array_type, types.Array) or array_type != signature.args[0]:
            return None
        if array_type.layout != "C" or not len(index_types) == array_type.ndim > 0:
            return None
        if not all(map(_is_counted_from_start, index_types)):
            return None
        builder, model = self.builder, context.data_model_manager[array_type]
        description, items = self.loadvar(array.name), self.loadvar(index.name)
        items = [builder.extract_value(items, k) for k in range(len(index_types))] if is_several else [items]
        indices = [context.cast(builder, *pair, types.intp) for pair in zip(items, index_types, strict=True)]
        number, shape = indices[0], model.get(builder, description, "shape") if is_several else None
        for axis in range(1, len(indices)):
            number = builder.add(builder.mul(number, builder.extract_value(shape, axis)), indices[axis])
        return builder.gep(model.get(builder, description, "data"), [number])


_READERS = {
    "getattr": ShortLower._read_field, "static_getitem": ShortLower._read_item, "pair_first": ShortLower._read_first,
    "pair_second": ShortLower._read_second, "getiter": ShortLower._read_iterator, "iternext": ShortLower._read_next,
}  # fmt: skip
_POWERS = operator.pow, operator.ipow  # of whole exponents numba makes products
_OPERATIONS = {}  # (operator, types) -> what numba has for them; kept for good, as numba does


def _are_numbers(numba_types) -> bool:
    return all(isinstance(each, (types.Number, types.Boolean)) for each in numba_types)


def _is_counted_from_start(index_type) -> bool:
    """Tell whether an index is one that kernels count from an array's start: all are but numbers below 0."""
    return isinstance(index_type, types.Integer) and getattr(index_type, "literal_value", 0) >= 0


@compiler_machinery.register_pass(mutates_CFG=False, analysis_only=False)
class ShortLowering(typed_passes.NativeLowering):
    """The pass that writes instructions."""

    _name = "rasterizer_short_lowering"

    @property
    def lowering_class(self):
        """What writes them."""
        return ShortLower


# ---------------------------------------------------------------- operators


class ShortTyping:
    """Numba's typing context of one function, but that it remembers what calls make of which types: most of a kernel's
    statements are the same few sums and products."""

    _of_operators = {}  # (operator, types) -> signature; kept for good, as numba keeps what it has of each operator

    _of_constants = {}  # (class, constant) -> type

    def __init__(self, context):
        self._context = context
        self._of_function = {}  # (called, types) -> signature; (type, name of an attribute) -> type

    def __getattr__(self, name):
        return getattr(self._context, name)

    def resolve_function_type(self, function, arguments, named):
        """Return the signature of a call."""
        if isinstance(
            function, types.Dispatcher
        ):  # numba compiles a helper anew for every number that it is called with
            arguments = tuple(map(types.unliteral, arguments))
        if named:
            return self._context.resolve_function_type(function, arguments, named)
        is_operator = isinstance(function, types.Function) and function.typing_key in _OPERATORS
        known = self._of_operators if is_operator else self._of_function
        call = function, arguments
        if call not in known:
            known[call] = self._context.resolve_function_type(function, arguments, named)
        return known[call]

    def resolve_value_type(self, value):
        """Return the type of a constant."""
        if type(value) not in _CONSTANTS:
            return self._context.resolve_value_type(value)
        constant = type(value), value
        if constant not in self._of_constants:
            self._of_constants[constant] = self._context.resolve_value_type(value)
        return self._of_constants[constant]

    def resolve_getattr(self, numba_type, name):
        """Return the type of an attribute."""
        if (numba_type, name) not in self._of_function:
            self._of_function[numba_type, name] = self._context.resolve_getattr(numba_type, name)
        return self._of_function[numba_type, name]


_CONSTANTS = frozenset((int, float, bool, type(operator.add)))  # classes; of operators the type is looked for longest
_OPERATORS = frozenset(thing for thing in vars(operator).values() if isinstance(thing, type(operator.add)))

# ---------------------------------------------------------------- least and greatest numbers


def _spell_out(compare):
    """Return how the first of some numbers that `compare` prefers is found, as numba finds it, of 2, 3 and 4."""

    def choose(typing_context, *numba_types):
        common = typing_context.unify_types(*numba_types)
        if common is None or not all(isinstance(numba_type, types.Number) for numba_type in numba_types):
            return None

        def generate(context, builder, signature, arguments):
            found = builtins.do_minmax(context, builder, list(signature.args), arguments, compare)
            return context.cast(builder, found, common, signature.return_type)

        return common(*numba_types), generate

    return {
        2: numba.extending.intrinsic(lambda typing_context, a, b: choose(typing_context, a, b)),
        3: numba.extending.intrinsic(lambda typing_context, a, b, c: choose(typing_context, a, b, c)),
        4: numba.extending.intrinsic(lambda typing_context, a, b, c, d: choose(typing_context, a, b, c, d)),
    }


SPELLED_OUT = {min: _spell_out(operator.lt), max: _spell_out(operator.gt)}


@compiler_machinery.register_pass(mutates_CFG=False, analysis_only=False)
class ShortNames(compiler_machinery.FunctionPass):
    """The pass that lets `min` and `max` be what is spelled out here."""

    _name = "rasterizer_short_names"

    def __init__(self):
        super().__init__()

    def run_pass(self, state):
        """Change what is called; tell whether anything was."""
        state.typingctx = ShortTyping(state.typingctx)
        blocks, n_changed = state.func_ir.blocks.values(), 0
        named = {
            assignment.target.name: assignment
            for block in blocks
            for assignment in block.find_insts(ir.Assign)
            if isinstance(assignment.value, ir.Global)
            and any(assignment.value.value is function for function in SPELLED_OUT)
        }
        for block in blocks:
            for call in block.find_exprs("call"):
                assignment = named.get(call.func.name)
                if assignment is not None and len(call.args) in (2, 3, 4) and not call.kws and call.vararg is None:
                    name = assignment.value
                    assignment.value = ir.Global(name.name, SPELLED_OUT[name.value][len(call.args)], name.loc)
                    n_changed += 1
        return n_changed > 0
