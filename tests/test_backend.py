"""The Dr.Jit backend: choice, environment variables, where LLVM comes from."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import drjit as dr
import numpy as np
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
    """Run the code in a process of its own, which has not been told of any LLVM."""
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


@pytest.mark.parametrize(
    ("platform", "said"),
    [
        ("linux", ("karellen-llvm-core", "apt install", "libLLVM.so")),
        ("darwin", ("brew install llvm", "libLLVM.dylib")),
        ("win32", ("installer", "LLVM-C.dll")),
        ("freebsd14", ("apt install",)),
    ],
)
def test_what_to_install_is_that_of_the_platform(monkeypatch, platform, said):
    monkeypatch.setattr(backend, "_too_late", False)
    monkeypatch.setattr(sys, "platform", platform)
    hint = backend._hint()
    assert all(word in hint for word in (*said, "DRJIT_LIBLLVM_PATH", "17 or newer"))
    assert ("brew" in hint) == (platform == "darwin")


def test_importing_pbrdf_does_not_import_drjit():
    """The command line starts fast."""
    run = python("import sys, pbrdf; print('drjit' in sys.modules)")
    assert run.stdout.strip() == "False", run.stderr


PAINT = "; print(pbrdf.backend.llvm_version()[0], pbrdf.load_paint('white').mueller(0.5, 0.6, 3.0)[0, 0])"
FINDS_NOTHING = (
    "import os; os.environ['DRJIT_LIBLLVM_PATH'] = '/nonexistent'; import drjit; "
    "del os.environ['DRJIT_LIBLLVM_PATH']; assert not drjit.has_backend(drjit.JitBackend.LLVM)"
)
BUNDLED = backend.find_bundled_llvm()


@pytest.mark.skipif(BUNDLED is None, reason="the packaged LLVM is for Linux x86-64")
class TestDrJitImportedBefore:
    """``import drjit`` or ``import mitsuba`` stands above ``import pbrdf``, as in sorted imports."""

    def check(self, before, after="import pbrdf, pbrdf.backend"):
        pbrdf.set_backend("llvm")
        expected = pbrdf.load_paint("white").mueller(0.5, 0.6, 3.0)[0, 0]
        run = python(f"{before}; {after}{PAINT}", PBRDF_BACKEND="llvm")
        assert run.returncode == 0, run.stderr
        version, value = run.stdout.split()[-2:]
        assert int(version) >= backend.MINIMUM_LLVM
        assert float(value) == pytest.approx(expected, rel=1e-12)
        return run

    def test_with_what_this_machine_has(self):
        self.check("import drjit")

    def test_where_it_finds_nothing(self):
        self.check(FINDS_NOTHING)

    @pytest.mark.slow
    def test_mitsuba(self):
        pytest.importorskip("mitsuba")
        self.check("import mitsuba as mi")
        run = self.check(
            f"{FINDS_NOTHING}; import mitsuba as mi",
            "import pbrdf, pbrdf.backend; mi.set_variant('llvm_ad_mono_polarized'); import pbrdf.rendering; "
            "pbrdf.rendering.register(); print(mi.load_dict({'type': 'pbrdf', 'paint': 'white'}))",
        )
        assert "PaintedSurface[" in run.stdout

    @pytest.mark.slow
    def test_a_variant_is_active(self):
        pytest.importorskip("mitsuba")
        before = "import mitsuba as mi; mi.set_variant('llvm_ad_mono_polarized')"
        if python(before).returncode:
            pytest.skip("this machine has no LLVM of its own: Mitsuba itself refuses")
        run = self.check(
            before,
            "import numpy as np, pbrdf, pbrdf.backend, pbrdf.rendering; pbrdf.rendering.register(); "
            "s = mi.load_dict({'type': 'scene', 'integrator': {'type': 'path'}, 'light': {'type': 'constant'}, "
            "'ball': {'type': 'sphere', 'bsdf': {'type': 'pbrdf', 'paint': 'white'}}, "
            "'sensor': {'type': 'perspective', 'film': {'type': 'hdrfilm', 'width': 4, 'height': 4, "
            # what Mitsuba would say of another format goes to the same stream
            "'pixel_format': 'luminance'}}}); "
            "print(bool(np.isfinite(mi.render(s, spp=4)).all()))",
        )
        assert "True" in run.stdout

    def test_the_users_path_is_left_alone(self):
        code = (
            "import drjit, os, pbrdf\n"
            "try: pbrdf.get_backend()\n"
            "except pbrdf.BackendError as error: print(error)\n"
            "print(os.environ['DRJIT_LIBLLVM_PATH'])"
        )
        run = python(code, DRJIT_LIBLLVM_PATH="/nonexistent/mine.so", PBRDF_BACKEND="llvm")
        error, path = run.stdout.splitlines()
        assert "no usable LLVM on this machine. Install an LLVM" in error
        assert path == "/nonexistent/mine.so"

    def test_arrays_made_before_keep_working(self):
        """A restart of Dr.Jit: data, literals, expressions not yet evaluated, and derivatives."""
        code = (
            "import drjit as dr\n"
            "from pbrdf.drjit_core import look_for_llvm_again as again\n"
            "F = dr.llvm.ad.Float64\n"
            "x = F([1, 2, 3]); dr.enable_grad(x); y = x * F(2) + 1; i = dr.arange(dr.llvm.UInt32, 4)\n"
            "print(again(10 ** 6), again(1))\n"
            "z = y * x; dr.backward(z)\n"
            "print(x, y, z, i, dr.grad(x))\n"
        )
        run = python(code, DRJIT_LIBLLVM_PATH=str(BUNDLED))
        assert run.stdout.splitlines() == [
            "False True",
            "[1, 2, 3] [3, 5, 7] [3, 10, 21] [0, 1, 2, 3] [5, 9, 13]",
        ]
        assert (run.returncode, run.stderr) == (0, "")

    @pytest.mark.parametrize(
        "work",
        [
            "import drjit as dr; x = dr.llvm.Float([1, 2]) + 1; dr.eval(x)",
            "import mitsuba as mi; mi.set_variant('llvm_ad_rgb'); x = mi.load_dict({'type': 'diffuse'})",
        ],
        ids=["kernel", "scene object"],
    )
    def test_what_a_restart_would_destroy_is_kept(self, work):
        """The old LLVM stays, ``pbrdf`` refuses it and says what to do; what it made keeps working."""
        if "mitsuba" in work:
            pytest.importorskip("mitsuba")
        code = (
            f"{work}\n"
            "import os\n"
            "from unittest import mock\n"
            "del os.environ['DRJIT_LIBLLVM_PATH']\n"
            "with mock.patch('drjit.detail.llvm_version', lambda: (15, 0, 7)):\n"
            "    import pbrdf\n"
            "    try: pbrdf.get_backend()\n"
            "    except pbrdf.BackendError as error: print(error)\n"
            "print(x)\n"
        )
        run = python(code, DRJIT_LIBLLVM_PATH=str(BUNDLED), PBRDF_BACKEND="llvm")
        assert (run.returncode, run.stderr) == (0, "")
        error, value = run.stdout.split("\n", maxsplit=1)
        assert error == (
            "the LLVM that Dr.Jit loaded is version 15.0.7, too old. Dr.Jit was at work before pbrdf was imported "
            "and cannot change its LLVM any more: start Python again and import pbrdf first"
        )
        assert value.startswith(("[2, 3]", "SmoothDiffuse["))

    @pytest.mark.parametrize("library", ["libm.so.6", "nothing.so"])
    def test_a_core_library_of_another_kind(self, library):
        """Without the functions or the library known here Dr.Jit stays as it is, and the way out is named."""
        code = (
            f"{FINDS_NOTHING}\n"
            "from unittest import mock; import ctypes\n"
            "real = ctypes.CDLL\n"
            f"with mock.patch('ctypes.CDLL', lambda path: real({library!r})): import pbrdf\n"
            "try: pbrdf.get_backend()\n"
            "except pbrdf.BackendError as error: print(error)\n"
        )
        run = python(code, PBRDF_BACKEND="llvm")
        assert "no usable LLVM on this machine. Dr.Jit was at work before pbrdf was imported" in run.stdout

    def test_a_core_library_without_symbols(self):
        """Nothing is written where the symbol table does not tell the place."""
        code = (
            "import drjit, os, pbrdf.drjit_core as core\n"
            f"os.environ['DRJIT_LIBLLVM_PATH'] = {str(BUNDLED)!r}\n"
            "symbols, core._symbols = core._symbols, lambda elf: {}\n"
            "print(core.look_for_llvm_again(17))\n"
            "core._symbols = symbols\n"
            "print(core.look_for_llvm_again(17))\n"
        )
        run = python(code, DRJIT_LIBLLVM_PATH="/nonexistent")
        assert run.stdout.split() == ["False", "True"], run.stderr


@pytest.mark.parametrize("name", ["llvm", "cuda"])
def test_what_is_uploaded_may_be_a_view(name):
    """Columns, reversed and broadcast arrays and integers arrive as they are, by the way of either backend."""
    found = backend.Backend(name, backend.get_backend().module)
    table = np.arange(12.0).reshape(4, 3)
    for values in (table[:, 1], table[::-1, 0], np.broadcast_to(2.0, (4,)), np.empty(0)):
        assert found.upload(found.Float, values).numpy() == pytest.approx(values)
    assert found.upload(found.UInt32, np.flatnonzero(table[:, 0] > 3)).numpy().tolist() == [2, 3]
