"""``pbrdf doctor``: what this machine computes with, and whether it computes right."""

from __future__ import annotations

import os
import sys

import typer

from pbrdf.cli.console import fail
from pbrdf.cli.options import Backend
from pbrdf.errors import BackendError

__all__ = ["doctor"]

#: Exit code where something is broken on this machine.
BROKEN = 1


def doctor(backend: Backend = None) -> None:
    """Show the backend, its LLVM and threads, and check the physics in a second.

    The exit code is 1 if there is no usable backend or a check fails.
    """
    import importlib.metadata
    import platform

    from pbrdf.backend import set_backend
    from pbrdf.version import __version__

    rows = [
        ("pbrdf", __version__),
        ("Python", f"{platform.python_version()} on {platform.system()} {platform.machine()}"),
        ("Dr.Jit", importlib.metadata.version("drjit")),
    ]
    problem = None
    try:
        if backend is not None:
            set_backend(backend)
        rows += _backend_rows()
    except BackendError as error:
        problem = error
    for name, value in rows:
        print(f"{name:12s}{value}")
    if problem is not None:
        fail(str(problem))
        raise typer.Exit(BROKEN)

    from pbrdf.cli.selfcheck import run_checks

    print()
    results = run_checks()
    for check in results:
        print(f"{'✓' if check.passed else '✗'} {check.name}: {check.detail}")
    failed = sum(not check.passed for check in results)
    if failed:
        sys.stdout.flush()
        fail(f"{failed} of {len(results)} checks failed: do not trust results from this machine; report this")
        raise typer.Exit(BROKEN)
    print("\nAll is well.")


def _backend_rows() -> list[tuple[str, str]]:
    """What is known of the backend; raises BackendError if there is none to use."""
    import drjit as dr

    from pbrdf.backend import LIBRARY_VARIABLE, get_backend, llvm_version, thread_count

    name = get_backend().name
    cuda = "present" if dr.has_backend(dr.JitBackend.CUDA) else "not present"
    rows = [("Backend", name), ("CUDA", cuda)]
    if dr.has_backend(dr.JitBackend.LLVM):
        version = llvm_version()
        number = ".".join(map(str, version)) if version else "of unknown version"
        rows.append(
            ("LLVM", f"{number}, {os.environ.get(LIBRARY_VARIABLE, 'found by Dr.Jit on the system')}")
        )
        rows.append(("Threads", str(thread_count())))
    return rows
