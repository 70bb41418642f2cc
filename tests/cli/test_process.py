"""What only a process of its own shows: imports, exit codes, streams, environment."""

import importlib.metadata
import os
import subprocess
import sys
from importlib import resources
from pathlib import Path

import pytest

import pbrdf

COMMAND = "from pbrdf.cli.main import main; main()"
HEAVY = {
    "matplotlib",
    "jinja2",
    "scipy",
    "xarray",
    "drjit",
    "dask",
    "pandas",
    "h5py",
    "mitsuba",
    "rich.progress",
}


def process(*arguments, cwd: Path, **environment: str) -> subprocess.CompletedProcess:
    """Run the command in a process of its own."""
    return subprocess.run(
        [sys.executable, "-c", COMMAND, *map(str, arguments)],
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "code",
    [
        "import pbrdf",
        "import pbrdf.cli.main",
        "import pbrdf.cli.main as m; m.app(['--help'], standalone_mode=False)",
        "import pbrdf.cli.main as m; m.app(['fit', '--help'], standalone_mode=False)",
    ],
)
def test_help_and_import_load_nothing_heavy(code):
    code += f"; import sys; sys.stderr.write(' '.join(sorted({HEAVY!r} & set(sys.modules))))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    assert done.stderr == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "left_out"),
    [
        (["fit", "white", "--starts", "1", "-q", "--no-figures", "-o", "out"], set()),
        (["check", "paint.csv"], {"h5py", "jinja2", "rich"}),
    ],
)
def test_commands_load_only_what_they_need(tmp_path, arguments, left_out):
    """Each of these takes as long to load as the fit itself."""
    file = resources.files("pbrdf.data") / "experiment" / "white.csv"
    (tmp_path / "paint.csv").write_bytes(file.read_bytes())
    left_out = {*left_out, "matplotlib", "scipy", "h5netcdf", "PIL", "rich.progress", "mitsuba"}
    code = (
        f"import pbrdf.cli.main as m; m.app({arguments!r}, standalone_mode=False); "
        f"import sys; sys.stderr.write(' '.join(sorted({left_out!r} & set(sys.modules))))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stderr) == (0, "")
    if arguments[0] == "fit":
        assert done.stdout == "out\n"
        assert not list((tmp_path / "out").glob("*.png"))
        assert "No figures were drawn" in (tmp_path / "out" / "index.html").read_text(encoding="utf-8")


def test_the_entry_point_is_main():
    (entry,) = importlib.metadata.entry_points(group="console_scripts", name="pbrdf")
    from pbrdf.cli.main import main

    assert entry.load() is main


def test_version(tmp_path):
    assert process("--version", cwd=tmp_path).stdout == f"pbrdf {pbrdf.__version__}\n"


@pytest.mark.slow
def test_a_mistake_is_one_line_and_code_2(tmp_path):
    done = process("check", "nothing.csv", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "pbrdf: error: nothing.csv: there is no such file\n"


@pytest.mark.slow
def test_without_llvm_the_doctor_says_what_to_install(tmp_path):
    done = process("doctor", cwd=tmp_path, DRJIT_LIBLLVM_PATH="/nonexistent", PBRDF_BACKEND="llvm")
    assert done.returncode == 1
    assert "pip install karellen-llvm-core" in done.stderr
    assert "Dr.Jit" in done.stdout
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_without_llvm_a_fit_says_what_to_install(tmp_path):
    done = process("fit", "white", cwd=tmp_path, DRJIT_LIBLLVM_PATH="/nonexistent", PBRDF_BACKEND="llvm")
    assert done.returncode == 2
    assert "pip install karellen-llvm-core" in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_an_unknown_backend_in_the_environment_is_named(tmp_path):
    done = process("doctor", cwd=tmp_path, PBRDF_BACKEND="opencl")
    assert done.returncode == 1
    assert "PBRDF_BACKEND" in done.stderr


@pytest.mark.slow
def test_output_that_an_old_code_page_lacks_is_replaced(tmp_path):
    done = process("paints", cwd=tmp_path, PYTHONIOENCODING="ascii")
    assert done.returncode == 0
    assert "pearl-white" in done.stdout


@pytest.mark.slow
def test_a_reader_that_cannot_be_loaded_is_one_line_and_stops_nothing(tmp_path):
    (tmp_path / "guest-1.0.dist-info").mkdir()
    (tmp_path / "guest-1.0.dist-info" / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: guest\nVersion: 1\n"
    )
    (tmp_path / "guest-1.0.dist-info" / "entry_points.txt").write_text(
        "[pbrdf.readers]\nbad = no_module:R\n[pbrdf.models]\nworse = no_module:M\n"
    )
    (tmp_path / "data.csv").write_text("theta_i,theta_r,brdf\n30,30,0.5\n")
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = process("check", "data.csv", cwd=tmp_path, PYTHONPATH=path)
    assert done.returncode == 0
    assert done.stderr.startswith(
        "pbrdf: the reader 'bad' of the package guest cannot be loaded (ModuleNotFound"
    )
    assert done.stderr.count("\n") == 1
    done = process("check", "white", cwd=tmp_path, PYTHONPATH=path)
    assert done.returncode == 0 and done.stderr == "", (
        "the format of a bundled paint is known: no reader is asked"
    )
    done = process("models", cwd=tmp_path, PYTHONPATH=path)
    assert done.returncode == 0 and "double-gauss" in done.stdout
    assert done.stderr.startswith(
        "pbrdf: the model 'worse' of an installed package cannot be used (no_module:M)"
    )
    assert done.stderr.count("\n") == 1
