"""The Dr.Jit backend: choice, environment variables, where LLVM comes from."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import drjit as dr
import pytest

import pbrdf
from pbrdf import backend
from pbrdf.errors import BackendError

SOURCE = str(Path(pbrdf.__file__).parents[1])


@pytest.fixture(autouse=True)
def restored(monkeypatch):
    """Leave the process with the backend it had."""
    monkeypatch.setattr(backend, "_chosen", backend._chosen)
    monkeypatch.setattr(backend, "_active", backend._active)


def python(code, **environment):
    env = {k: v for k, v in os.environ.items() if k not in ("DRJIT_LIBLLVM_PATH", "PBRDF_BACKEND")}
    env["PYTHONPATH"] = SOURCE
    env.update(environment)
    return subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, timeout=120)


def test_the_active_backend_has_double_precision_types():
    found = backend.get_backend()
    assert found.name in ("llvm", "cuda") and found is backend.get_backend()
    assert dr.type_v(found.Float) == dr.VarType.Float64 and dr.is_diff_v(found.Float)
    assert dr.is_mask_v(found.Bool) and dr.type_v(found.UInt32) == dr.VarType.UInt32
    assert found.module.__name__.startswith("drjit.")


def test_llvm_is_recent_enough_and_has_threads():
    if backend.get_backend().name == "llvm":
        assert backend.llvm_version() >= (backend.MINIMUM_LLVM,)
    assert backend.thread_count() >= 1


def test_unknown_backend():
    with pytest.raises(BackendError, match=r"unknown backend 'opencl': choose one of auto, llvm, cuda"):
        backend.set_backend("opencl")


def test_set_backend_is_obeyed():
    backend.set_backend("llvm")
    assert backend.get_backend().name == "llvm"


def test_cuda_without_a_device():
    if dr.has_backend(dr.JitBackend.CUDA):
        pytest.skip("this machine has a CUDA device")
    backend.set_backend("cuda")
    with pytest.raises(BackendError, match=r"finds no CUDA device .* choose the backend llvm"):
        backend.get_backend()


def test_environment_variable_with_a_bad_name(monkeypatch):
    monkeypatch.setenv("PBRDF_BACKEND", "gpu")
    backend._chosen = backend._active = None
    with pytest.raises(BackendError, match=r"PBRDF_BACKEND is 'gpu': set it to one of auto, llvm, cuda"):
        backend.get_backend()


def test_environment_variable_is_obeyed_and_set_backend_wins(monkeypatch):
    monkeypatch.setenv("PBRDF_BACKEND", "llvm")
    backend._chosen = backend._active = None
    assert backend.get_backend().name == "llvm"
    monkeypatch.setenv("PBRDF_BACKEND", "nonsense")
    backend.set_backend("llvm")
    assert backend.get_backend().name == "llvm"


@pytest.mark.skipif(sys.platform != "linux", reason="the packaged LLVM is for Linux")
def test_packaged_llvm_is_found_and_taken():
    path = backend.find_bundled_llvm()
    assert path is not None and path.is_file() and "LLVM" in path.name
    run = python("import os, pbrdf; print(os.environ['DRJIT_LIBLLVM_PATH'])")
    assert run.stdout.strip() == str(path), run.stderr


def test_missing_package_is_no_error(monkeypatch):
    def nothing(name):
        raise backend.importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(backend.importlib.metadata, "files", nothing)
    assert backend.find_bundled_llvm() is None
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    backend.point_drjit_to_llvm()
    assert "DRJIT_LIBLLVM_PATH" not in os.environ


def test_the_users_llvm_path_is_respected():
    """A DRJIT_LIBLLVM_PATH that is set stays, even one that does not exist."""
    mine = "/nonexistent/libLLVM-mine.so"
    run = python("import os, pbrdf; print(os.environ['DRJIT_LIBLLVM_PATH'])", DRJIT_LIBLLVM_PATH=mine)
    assert run.stdout.strip() == mine, run.stderr


def test_a_users_llvm_path_that_does_not_work():
    code = (
        "from pbrdf.backend import set_backend, get_backend\n"
        "from pbrdf.errors import BackendError\n"
        "set_backend('llvm')\n"
        "try:\n    get_backend()\n    print('works')\n"
        "except BackendError as error:\n    print('BackendError', error)\n"
    )
    run = python(code, DRJIT_LIBLLVM_PATH="/nonexistent/libLLVM-mine.so")
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("BackendError") and "karellen-llvm-core" in run.stdout


def test_an_llvm_that_is_too_old(monkeypatch):
    monkeypatch.setattr(backend, "llvm_version", lambda: (15, 0, 6))
    monkeypatch.setattr(dr, "has_backend", lambda b: b == dr.JitBackend.LLVM)
    backend.set_backend("llvm")
    with pytest.raises(BackendError, match=r"version 15\.0\.6, too old.*version 17 or newer"):
        backend.get_backend()


def test_no_llvm_at_all(monkeypatch):
    monkeypatch.setattr(dr, "has_backend", lambda b: False)
    backend.set_backend("auto")
    with pytest.raises(BackendError, match=r"no usable LLVM on this machine\. Install an LLVM"):
        backend.get_backend()


def test_importing_pbrdf_does_not_import_drjit():
    """The command line starts fast, and drjit is imported after its LLVM is chosen."""
    run = python("import sys, pbrdf; print('drjit' in sys.modules)")
    assert run.stdout.strip() == "False", run.stderr
