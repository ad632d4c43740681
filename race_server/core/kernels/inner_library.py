"""What a kernel leaves for other kernels to link in: code, but no machine code.

numba turns every function into machine code, with all that it calls, although only what Python
calls is ever run: of sixty kernels that are called by one another, the innermost is optimised and
translated in sixty of them. Here a kernel that only kernels call is kept as it was written for
LLVM; it is optimised once, inside of what Python calls.
"""

from typing import Any

from llvmlite import binding
from numba.core import caching, codegen, compiler

_Library: Any = codegen.JITCodeLibrary  # numba is untyped
_Compiler: Any = compiler.Compiler
_CacheImpl: Any = caching.CompileResultCacheImpl
_CompileResult: Any = compiler.CompileResult


class _NoEnvironments:
    """In place of a code generator that would tell machine code where its environment is."""

    @staticmethod
    def set_env(name: str, environment: object) -> None:
        """Do nothing: there is no machine code."""


class InnerLibrary(_Library):  # type: ignore[misc]
    """The code of one kernel and of all that it calls, to be linked into others."""

    @classmethod
    def loaded(cls, generator: Any, name: str, bitcode: bytes) -> "InnerLibrary":
        """Return what `serialize_using_object_code` has left on the disk."""
        library = cls(generator, name)
        library._final_module = binding.parse_bitcode(bitcode)
        library._finalize_final_module()
        return library

    @property
    def codegen(self) -> Any:
        """Whom numba asks to prepare machine code for its first call."""
        return _NoEnvironments

    def serialize_using_object_code(self) -> tuple[str, bytes]:
        """Return name and code: what the disk cache keeps."""
        self._ensure_finalized()
        return self.name, self._get_module_for_linking().as_bitcode()

    def get_pointer_to_function(self, name: str) -> int:
        """Return the null pointer: Python cannot call anything in here."""
        self._ensure_finalized()
        return 0

    def _optimize_final_module(self) -> None:
        """Inline what is called, and drop what is unused; the rest is left to those who link."""
        generator = self._codegen
        passes, builder = generator._module_pass_manager(
            loop_vectorize=False, slp_vectorize=False, opt=generator._opt_level, cost="cheap"
        )
        passes.run(self._final_module, builder)

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class InnerCompiler(_Compiler):  # type: ignore[misc]
    """Compiles a function into an `InnerLibrary`."""

    def compile_extra(self, function: Any) -> Any:
        """Compile a function."""
        generator = self.state.targetctx.codegen()
        self.state.library = InnerLibrary(generator, function.__qualname__)
        return super().compile_extra(function)


class InnerCacheImpl(_CacheImpl):  # type: ignore[misc]
    """Loads an `InnerLibrary` from the disk."""

    def rebuild(self, target_context: Any, payload: tuple[Any, ...]) -> Any:
        """Return what was compiled, from what numba makes of it for the disk."""
        code, description, environment, signature, objectmode, lifted, annotation, *rest = payload
        library = InnerLibrary.loaded(target_context.codegen(), *code)
        return _CompileResult(
            target_context=target_context,
            typing_context=target_context.typing_context,
            library=library,
            environment=environment,
            entry_point=target_context.get_executable(library, description, environment),
            fndesc=description,
            type_annotation=annotation,
            signature=signature,
            objectmode=objectmode,
            lifted=lifted,
            typing_error=None,
            call_helper=None,
            metadata=None,
            reload_init=rest[0],
            referenced_envs=rest[1],
        )
