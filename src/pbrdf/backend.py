"""The Dr.Jit backend: which one, where its LLVM comes from, and its array types.

Dr.Jit compiles every formula at run time, through LLVM on the processor or through CUDA. The LLVM
shared library is looked for in this order:

1. the environment variable ``DRJIT_LIBLLVM_PATH``, if the user has set it;
2. the library of the PyPI package ``karellen-llvm-core`` (Linux x86-64), twice as fast here as Debian's 19;
3. whatever Dr.Jit finds on the system by itself.

Dr.Jit looks when it is imported. If that was before ``pbrdf``, and what it found is missing or too old, it is made to
look again (:mod:`pbrdf.drjit_core`), so the order of imports does not matter.

LLVM 15 and 16 abort the process on ``dr.minimum`` and LLVM 14 is refused by Dr.Jit, so a system library
older than 17 is refused here with a message instead. The environment variable ``PBRDF_BACKEND``
(``auto``, ``llvm`` or ``cuda``) or :func:`set_backend` choose the backend; ``auto`` takes CUDA if a device
is there, else LLVM.

With its flag ``FastMath``, which is set from the start, Dr.Jit 1.5 computes reciprocals and reciprocal roots of float64
on CUDA to a relative 1e-6, also where a derivative needs one. :func:`get_backend` takes the flag off in the threads in
which pbrdf computes on CUDA, and :func:`exact_reciprocals` does so for a while where it is a user's arrays.
"""

from __future__ import annotations

import importlib.metadata
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from pbrdf.errors import BackendError

__all__ = [
    "BACKENDS",
    "Backend",
    "check_llvm",
    "exact_reciprocals",
    "find_bundled_llvm",
    "get_backend",
    "llvm_version",
    "point_drjit_to_llvm",
    "set_backend",
    "thread_count",
]

BACKENDS = ("auto", "llvm", "cuda")
MINIMUM_LLVM = 17
ENVIRONMENT_VARIABLE = "PBRDF_BACKEND"
LIBRARY_VARIABLE = "DRJIT_LIBLLVM_PATH"

#: How LLVM is had, and which file it is where Dr.Jit does not find it by itself.
_INSTALL = {
    "linux": (
        "`pip install karellen-llvm-core` on x86-64, `apt install libllvm19` on Debian or Ubuntu",
        "libLLVM.so",
    ),
    "darwin": ("`brew install llvm`", "$(brew --prefix llvm)/lib/libLLVM.dylib"),
    "win32": ("the LLVM installer", r"C:\Program Files\LLVM\bin\LLVM-C.dll"),
}


@dataclass(frozen=True)
class Backend:
    """Array types of one Dr.Jit backend, double precision unless the name says otherwise.

    Attributes
    ----------
    name
        ``"llvm"`` or ``"cuda"``.
    Float, Float32, UInt32, Bool
        Differentiable Dr.Jit array types: float64, float32, uint32 and mask.
    module
        The Dr.Jit module that holds them, ``drjit.llvm.ad`` or ``drjit.cuda.ad``.
    """

    name: str
    module: ModuleType

    @property
    def Float(self) -> Any:
        return self.module.Float64

    @property
    def Float32(self) -> Any:
        return self.module.Float

    @property
    def UInt32(self) -> Any:
        return self.module.UInt32

    @property
    def Bool(self) -> Any:
        return self.module.Bool

    def upload(self, array_type: Any, values: Any) -> Any:
        """Copy a NumPy array into memory of Dr.Jit's own.

        A Dr.Jit array made from a NumPy array may share its memory, whose alignment is a matter of chance and
        part of the compiled kernel: without the copy the same kernel is compiled again and again.
        """
        import drjit as dr

        if self.name == "cuda":
            return array_type(values)
        owned = dr.empty(array_type, len(values))
        owned.numpy()[:] = values  # a view
        return owned


_chosen: str | None = None
_active: Backend | None = None
_too_late = False


def find_bundled_llvm() -> Path | None:
    """Return the path of the libLLVM that the package ``karellen-llvm-core`` installed, or None."""
    try:
        files = importlib.metadata.files("karellen-llvm-core") or []
    except importlib.metadata.PackageNotFoundError:
        return None
    candidates = [f for f in files if f.name == "libLLVM.so" or f.name.startswith("libLLVM-")]
    for candidate in sorted(candidates, key=lambda f: f.name != "libLLVM.so"):
        path = Path(str(candidate.locate())).resolve()
        if path.exists():
            return path
    return None


def set_backend(name: str) -> None:
    """Choose the backend for everything evaluated from now on.

    Parameters
    ----------
    name
        ``"auto"``, ``"llvm"`` or ``"cuda"``.

    Raises
    ------
    BackendError
        If the name is unknown.
    """
    global _chosen, _active
    if name not in BACKENDS:
        raise BackendError(f"unknown backend {name!r}: choose one of {', '.join(BACKENDS)}")
    _chosen, _active = name, None


def get_backend() -> Backend:
    """Return the active backend, starting Dr.Jit the first time.

    Where it is CUDA, the calling thread's flag ``FastMath`` of Dr.Jit is taken off.

    Raises
    ------
    BackendError
        If the backend asked for is not usable on this machine; the message says what to install.
    """
    global _active
    if _active is None:
        name = _chosen or os.environ.get(ENVIRONMENT_VARIABLE) or "auto"
        if name not in BACKENDS:
            raise BackendError(
                f"the environment variable {ENVIRONMENT_VARIABLE} is {name!r}: set it to one of "
                f"{', '.join(BACKENDS)}, or unset it"
            )
        _active = _start(name)
    if _active.name == "cuda":
        import drjit as dr

        dr.set_flag(dr.JitFlag.FastMath, False)
    return _active


@contextmanager
def exact_reciprocals(Float: Any) -> Iterator[None]:
    """Record formulas over `Float` such that reciprocals are as exact as the type, on CUDA too."""
    import drjit as dr

    if dr.backend_v(Float) == dr.JitBackend.CUDA and dr.type_v(Float) == dr.VarType.Float64:
        with dr.scoped_set_flag(dr.JitFlag.FastMath, False):
            yield
    else:
        yield


def point_drjit_to_llvm() -> None:
    """Set ``DRJIT_LIBLLVM_PATH`` to the packaged LLVM, unless the user has set it.

    Runs when ``pbrdf`` is imported. A Dr.Jit that was imported before looks for LLVM again.
    """
    global _too_late
    if LIBRARY_VARIABLE in os.environ or (bundled := find_bundled_llvm()) is None:
        return
    os.environ[LIBRARY_VARIABLE] = str(bundled)
    if "drjit" in sys.modules:
        from pbrdf.drjit_core import look_for_llvm_again

        _too_late = not look_for_llvm_again(MINIMUM_LLVM)


def _start(name: str) -> Backend:
    import drjit as dr

    if name in ("cuda", "auto") and dr.has_backend(dr.JitBackend.CUDA):
        import drjit.cuda.ad as module

        return Backend("cuda", module)
    if name == "cuda":
        raise BackendError(
            "the CUDA backend was asked for, but Dr.Jit finds no CUDA device or driver on this machine: "
            "choose the backend llvm, or install an NVIDIA driver"
        )
    if not dr.has_backend(dr.JitBackend.LLVM):
        raise BackendError(f"Dr.Jit finds no usable LLVM on this machine. {_hint()}")
    check_llvm()
    import drjit.llvm.ad as llvm_module

    return Backend("llvm", llvm_module)


def check_llvm() -> None:
    """Check the version of the LLVM that Dr.Jit has loaded.

    Raises
    ------
    BackendError
        If it is one that aborts the process.
    """
    version = llvm_version()
    if version is not None and version[0] < MINIMUM_LLVM:
        found = ".".join(map(str, version))
        raise BackendError(f"the LLVM that Dr.Jit loaded is version {found}, too old. {_hint()}")


def _hint() -> str:
    if _too_late:
        return (
            "Dr.Jit was at work before pbrdf was imported and cannot change its LLVM any more: "
            "start Python again and import pbrdf first"
        )
    how, file = _INSTALL.get(sys.platform, _INSTALL["linux"])
    return (
        f"Install an LLVM shared library of version {MINIMUM_LLVM} or newer: {how}. If it is not found then, set "
        f"{LIBRARY_VARIABLE} to its full path, {file}"
    )


def llvm_version() -> tuple[int, ...] | None:
    """Return the version of the LLVM that Dr.Jit has loaded, or None where it does not tell."""
    import drjit.detail as detail

    version = detail.llvm_version()
    return tuple(version) if version else None


def thread_count() -> int:
    """Return the number of worker threads that Dr.Jit's LLVM backend uses."""
    import drjit as dr

    return int(dr.thread_count())
