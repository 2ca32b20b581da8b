"""What numba does to make a kernel's instructions, as far as kernels need it: a first picture waits for nothing else.

Two thirds of the time that a kernel takes to compile pass before the optimiser sees it: in numba's passes, each over
every function, and in writing, printing and reading instructions that the optimiser takes out again. Without
this module a first picture with an empty store takes 1.4 times the processor's time.

* `ShortPassManager` leaves out the passes for what kernels don't have, and what numba notes of each pass.
* A `Struct`, the type of a structure that a kernel is called with, is passed on to helpers as one value. Numba passes
  it field by field, each array in it as seven numbers: a helper of one line that gets two structures would begin with a
  hundred instructions that put them together, and each call of it with as many that take them apart.
* `ShortLower` reads and writes items of contiguous arrays where the array's description says. Numba copies the
  description to memory first, thirty instructions an item. Variables that are set once stay out of memory, too.
* `ShortNames` calls `min` and `max` what is spelled out here. Numba compiles a function for each type of arguments.
* `ShortTyping` remembers what operators make of which types. Numba looks for it at each sum and each product.

The names of numba that are used here are listed in internals.py.
"""

import collections
import operator

import numba.extending
from numba import types
from numba.core import analysis, compiler_machinery, ir, lowering, typed_passes
from numba.core.datamodel import models
from numba.cpython import builtins
from numba.np import arrayobj

# Passes for what no kernel has: `with`, closures and comprehensions, exceptions, functions that numba is to inline into
# its own form of the program, loops over tuples of several types, arithmetic with whole arrays, parallel loops.
NOT_NEEDED = frozenset((
    "WithLifting", "InlineClosureLikes", "RewriteDynamicRaises", "MakeFunctionToJitFunction", "InlineInlinables",
    "FindLiterallyCalls", "LiteralUnroll", "LiteralPropagationSubPipelinePass", "InlineOverloads", "NopythonRewrites",
    "DumpParforDiagnostics", "AnnotateTypes", "NoPythonSupportedFeatureValidation",
))  # fmt: skip


class ShortPassManager(compiler_machinery.PassManager):
    """The passes of a pipeline of numba's that are needed, one after the other."""

    def __init__(self, pipeline):
        super().__init__(pipeline.pipeline_name)
        steps = [step for step in pipeline.passes if step[0].__name__ not in NOT_NEEDED]
        passes = [step[0] for step in steps]
        steps[passes.index(typed_passes.NativeLowering)] = (ShortLowering, "write instructions")
        steps.insert(passes.index(typed_passes.NopythonTypeInference), (ShortNames, "name what is spelled out"))
        self.passes = steps

    def _runPass(self, index, pss, internal_state):
        """Run one of them. Numba also puts the function in order after each; the last one before instructions are
        written does that here."""
        pss.analysis = self._analysis
        pss.run_initialization(internal_state)
        pss.run_pass(internal_state)
        pss.run_finalizer(internal_state)


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


# ---------------------------------------------------------------- items of arrays


class ShortLower(lowering.Lower):
    """What writes instructions: numba's, but for items of contiguous arrays and variables that are set once."""

    def __init__(self, context, library, fndesc, *others, **named):
        # Loops become vector instructions only where what they write isn't taken for a table that they read. LLVM
        # takes arguments for other memory than its constants, but not what it finds in a structure.
        if not fndesc.inline:
            fndesc.argtypes = tuple(map(_in_parts, fndesc.argtypes))
        super().__init__(context, library, fndesc, *others, **named)

    def _find_singly_assigned_variable(self):
        """Note the variables that need no memory: those that are set once, before they are used, whatever happens.

        Numba finds those that one block alone uses.
        """
        super()._find_singly_assigned_variable()
        if self.func_ir.func_id.is_generator:
            return
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
        indices = [context.cast(builder, *pair, types.uintp) for pair in zip(items, index_types, strict=True)]
        number, shape = indices[0], model.get(builder, description, "shape") if is_several else None
        for axis in range(1, len(indices)):
            number = builder.add(builder.mul(number, builder.extract_value(shape, axis)), indices[axis])
        return builder.gep(model.get(builder, description, "data"), [number])


def _is_counted_from_start(index_type) -> bool:
    """Tell whether an index is never negative by its type: a negative one counts from an array's end."""
    if isinstance(index_type, types.IntegerLiteral):
        return index_type.literal_value >= 0
    return isinstance(index_type, types.Integer) and not index_type.signed


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
    """Numba's typing context, but that it remembers what operators make of which types: most of a kernel's statements
    are the same few sums and products."""

    _signatures = {}  # (operator, types) -> signature; kept for good, as numba keeps what it has of each operator

    def __init__(self, context):
        self._context = context

    def __getattr__(self, name):
        return getattr(self._context, name)

    def resolve_function_type(self, function, arguments, named):
        """Return the signature of a call."""
        is_operator = isinstance(function, types.Function) and function.typing_key in _OPERATORS
        if named or not is_operator:
            return self._context.resolve_function_type(function, arguments, named)
        known, call = self._signatures, (function, arguments)
        if call not in known:
            known[call] = self._context.resolve_function_type(function, arguments, named)
        return known[call]


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
