import subprocess
import sys

import pytest

from pbrdf.cli.reproduce import _noise
from pbrdf.errors import PbrdfError

pytestmark = pytest.mark.slow

SMALL = ("--starts", 4, "--patch", 4)


def test_the_paper_is_reproduced(run, tmp_path):
    result = run("reproduce", "-o", "out", *SMALL)
    assert "SIMULATED data: the paper published no raw data" in result.stdout
    assert "13 of 14 statements about the model hold; #10 fails" in result.stdout
    assert "open out/index.html" in result.stdout
    assert "3 matte white, thick" in result.stdout
    assert "…" not in result.stdout
    assert (tmp_path / "out" / "index.html").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_options_reach_the_experiment(run, tmp_path, monkeypatch):
    """The quiet form prints the page's name; the settings are those of the command line."""
    from pbrdf.reproduction import run as module

    seen = []

    def reproduce(options, progress):
        seen.append(options)

    monkeypatch.setattr(module, "reproduce", reproduce)
    monkeypatch.setattr(module, "write_reproduction", lambda found, folder, progress: [folder / "index.html"])
    arguments = [
        "--bits",
        8,
        "--noise",
        "linear=2%,read=30,stability=0",
        "--positions",
        "30,50,70",
        "--seed",
        3,
    ]
    arguments += ["--source-radius", 2, "--calibration-error", "fixed", "--exposure", "each", "--starts", 5]
    assert run("reproduce", "-q", *arguments).stdout == "reproduction/index.html\n"
    (options,) = seen
    assert (options.bits, options.seed, options.starts) == (8, 3, 5)
    assert (options.linear, options.circular, options.read_noise, options.stability) == (
        0.02,
        0.05,
        30.0,
        0.0,
    )
    assert (options.calibration_error, options.exposure) == ("fixed", "each")
    assert "Ψ = 30°, 50°, 70°" in options.in_words()
    assert "source of 2° radius" in options.in_words()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--positions", "60,80"], "positions: give three bistatic angles that ascend"),
        (["--positions", "60,eighty,100"], "--positions: 'eighty' is not a number"),
        (["--positions", "60,80,170"], "from 20° to 140°"),
        (["--noise", "linear"], "--noise 'linear': give linear, circular, read, stability"),
        (["--noise", "blue=1"], "--noise 'blue=1'"),
        (["--noise", "linear=much"], "--noise linear: 'much' is not a number"),
        (["--noise", "linear=-1%"], "accuracy"),
        (["--noise", "read=-3"], "read_noise"),
        (["--calibration-error", "always"], "calibration error 'always'"),
        (["--exposure", "long"], "exposure 'long'"),
        (["--source-radius", "60"], "angular radius"),
    ],
)
def test_what_makes_no_experiment_is_refused(refused, arguments, message):
    assert message in refused("reproduce", *arguments)


def test_a_folder_that_cannot_be_made_is_refused_at_once(run, tmp_path):
    (tmp_path / "taken").write_text("")
    assert "there is a file of that name" in run("reproduce", "-o", "taken", code=2).stderr


def test_noise_may_be_stated_as_percentage_or_number():
    assert _noise("linear=1%, circular=0.05,read=20") == {
        "linear": 0.01,
        "circular": 0.05,
        "read_noise": 20.0,
    }
    assert _noise(None) == {}
    with pytest.raises(PbrdfError):
        _noise("read")


def test_the_help_loads_nothing_heavy():
    code = (
        "import sys, pbrdf.cli.main as m; m.app(['reproduce', '--help'], standalone_mode=False); "
        "sys.exit(bool({'numpy', 'xarray', 'matplotlib', 'drjit', 'scipy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    assert "--positions" in done.stdout
