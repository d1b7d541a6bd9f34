"""A compiler of functions that only compiled functions call: LLVM IR for them, no machine code.

numba optimises each function and makes machine code of it, then does both again in every function
that calls it. The code of a function that Python cannot enter never runs. Without it the first
impact of rig-rom compiles in 0.78 of the processor time (54 functions, of which six become machine
code; `benchmarks/compile.py`), and marches as fast.
"""

from numba import _dynfunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import LoweringPass, PassManager, register_pass
from numba.core.typed_passes import NativeLowering


class IRLibrary(JITCodeLibrary):
    """The IR of a function and of all that it calls, for callers to link.

    Its functions one by one are optimised, which costs less than it saves in the callers; the whole
    is not.
    """

    def _optimize_final_module(self) -> None:
        """Nothing: callers optimise what they link."""

    def _finalize_final_module(self) -> None:
        """No machine code."""
        self._finalized = True


@register_pass(mutates_CFG=False, analysis_only=False)
class LoweringToIR(LoweringPass):
    """numba's lowering, which stops before machine code."""

    _name = "lowering_to_ir"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state) -> bool:
        """Lower the function, and let callers find it."""
        state.library = IRLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        NativeLowering().run_pass(state)
        lowered = state["cr"]

        # callers find a compiled function by its entry from Python: one that leads nowhere
        described, name = lowered.fndesc, lowered.fndesc.qualname
        module, kept_alive = described.lookup_module(), (state.library,)
        entry = _dynfunc.make_function(module, name, name, 0, lowered.env, kept_alive)
        state.targetctx.insert_user_function(entry, described, [state.library])
        state["cr"] = lowered._replace(cfunc=entry)
        return True


class InnerCompiler(CompilerBase):
    """numba's passes with `LoweringToIR` in place of its own lowering."""

    def define_pipelines(self) -> list[PassManager]:
        """The one pipeline: a function that numba cannot compile raises its error."""
        usual = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes = PassManager("ir")
        for chosen, description in usual.passes:
            lowers = chosen is NativeLowering
            passes.add_pass(LoweringToIR if lowers else chosen, description)
        passes.finalize()
        return [passes]
