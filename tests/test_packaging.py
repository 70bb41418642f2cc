"""What a release promises: extras hold what is imported, one version everywhere, workflows and hooks parse."""

from __future__ import annotations

import functools
import re
import shlex
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml

import pbrdf

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
#: Modules of distributions where these are called otherwise.
MODULES = {
    "axe-playwright-python": {"axe_playwright_python"},
    "dask": {"dask", "distributed"},
    "import-linter": {"importlinter", "grimp"},
    "karellen-llvm-core": set(),
    "pillow": {"PIL"},
    "pytest-xdist": {"xdist"},
    "python-calamine": {"python_calamine"},
    "pyyaml": {"yaml"},
    "scikit-learn": {"sklearn"},
}
#: Extras for those who work on the package.
FOR_DEVELOPERS = ("dev", "docs")


def modules(requirements):
    """Modules by distribution, of requirements as pyproject writes them."""
    names = [re.match(r"[\w-]+", requirement)[0] for requirement in requirements]
    return {name: MODULES.get(name, {name.replace("-", "_")}) for name in names}


@functools.cache
def imported(folder):
    """Top names of the modules of others that the Python files in a folder import."""
    text = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / folder).rglob("*.py"))
    found = re.findall(r"^ *(?:import (\w+)(?:$|[.,]| as )|from (\w+)[\w.]* import )", text, re.MULTILINE)
    skipped = re.findall(r"pytest\.importorskip\(\s*\"(\w+)", text)
    return (
        {name for pair in found for name in pair if name}.union(skipped) - sys.stdlib_module_names - {"pbrdf"}
    )


@pytest.fixture(scope="module")
def of_users():
    """Modules by distribution that users can have installed with the package."""
    extras = PROJECT["project"]["optional-dependencies"]
    asked = [r for name, extra in extras.items() if name not in FOR_DEVELOPERS for r in extra]
    return modules([*PROJECT["project"]["dependencies"], *asked])


def test_what_the_package_imports_is_declared(of_users):
    assert imported("src") <= set().union(*of_users.values())


def test_what_is_declared_is_imported(of_users):
    used = imported("src")
    assert [name for name, found in of_users.items() if found and not found & used] == []
    # no module: its library is looked for by the name of the distribution
    without = [name for name, found in of_users.items() if not found]
    backend = (ROOT / "src" / "pbrdf" / "backend.py").read_text(encoding="utf-8")
    assert without == ["karellen-llvm-core"]
    assert '"karellen-llvm-core"' in backend


@pytest.mark.parametrize("extra", FOR_DEVELOPERS)
def test_what_developers_install_is_used(extra):
    used = set().union(*map(imported, ("src", "tests", "benchmarks", "scripts", "docs")))
    files = [ROOT / "Makefile", *(ROOT / "docs").glob("*.py")]
    tools = " ".join(path.read_text(encoding="utf-8") for path in files)
    commands = {"import-linter": "lint-imports", "ipykernel": "myst_nb", "pytest-xdist": "-n auto"}
    asked = modules(PROJECT["project"]["optional-dependencies"].get(extra, []))
    idle = [
        name
        for name, found in asked.items()
        if not found & used
        and commands.get(name, name) not in tools
        and not any(module in tools for module in found)
    ]
    assert idle == []


def test_one_version_everywhere():
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    version, date = re.search(
        r"^## \[(\d+\.\d+\.\d+)\] - (\d{4}-\d{2}-\d{2})$", changelog, re.MULTILINE
    ).groups()
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert pbrdf.__version__ == version == citation["version"]
    assert citation["date-released"].isoformat() == date
    assert citation["license"] == PROJECT["project"]["license"]
    assert "## [Unreleased]" in changelog


def test_the_python_that_is_declared_is_tested():
    classified = {
        line.rpartition(" ")[2]
        for line in PROJECT["project"]["classifiers"]
        if re.search(r":: 3\.\d+$", line)
    }
    matrix = workflow("tests")["jobs"]["test"]["strategy"]["matrix"]
    assert set(matrix["python"]) == classified
    assert PROJECT["project"]["requires-python"] == f">={min(matrix['python'])}"
    assert {name.partition("-")[0] for name in matrix["os"]} == {"ubuntu", "macos", "windows"}


def workflow(name):
    return yaml.safe_load((ROOT / ".github" / "workflows" / f"{name}.yml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", ["tests", "release"])
def test_workflows_parse(name):
    content = workflow(name)
    # YAML 1.1 reads the key `on` as true
    assert set(content) >= {"name", True, "jobs", "permissions"}
    for job in content["jobs"].values():
        assert set(job.get("needs", "build").split()) <= set(content["jobs"])
        for step in job["steps"]:
            assert ("uses" in step) != ("run" in step)
            assert "@" in step.get("uses", "@")
            assert shlex.split(step.get("run", "true"), comments=True)


def test_the_built_wheel_is_tested_and_not_the_checkout():
    steps = [step.get("run", "") for step in workflow("tests")["jobs"]["test"]["steps"]]
    said = "\n".join(steps)
    assert "editable" not in said
    assert " -e " not in said
    assert "'site-packages' in pbrdf.__file__" in said
    wanted = re.search(r"\$\{wheel\}\[([\w,]+)\]", said)[1].split(",")
    assert set(wanted) == set(PROJECT["project"]["optional-dependencies"]) - set(FOR_DEVELOPERS)


def test_only_the_upload_may_ask_for_an_identity():
    jobs = workflow("release")["jobs"]
    assert [name for name, job in jobs.items() if "id-token" in job.get("permissions", {})] == ["publish"]
    assert workflow("release")[True] == {"push": {"tags": ["v*"]}}


def test_hooks_are_the_checks_of_make_lint():
    config = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))
    hooks = [hook for repo in config["repos"] for hook in repo["hooks"]]
    assert {repo["repo"] for repo in config["repos"]} == {"local"}
    assert {hook["language"] for hook in hooks} == {"system"}
    lint = re.search(
        r"^lint:.*\n((?:\t.*\n)+)", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE
    )[1]
    tools = {line.split("$(BIN)/")[1].split()[0] for line in lint.splitlines()}
    assert {hook["entry"].split()[0] for hook in hooks} == tools


def test_the_source_distribution_holds_what_its_tests_read():
    listed = PROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    assert [name for name in listed if not (ROOT / name).exists()] == []
    assert set(listed) >= {
        "src",
        "tests",
        ".github",
        ".pre-commit-config.yaml",
        "CITATION.cff",
        "CONTRIBUTING.md",
    }


@pytest.mark.slow
def test_the_wheel_holds_every_file_of_the_package(tmp_path):
    pytest.importorskip("hatchling", reason="the wheel is built by hatchling")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob(f"pbrdf-{pbrdf.__version__}-py3-none-any.whl")
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
    package = ROOT / "src" / "pbrdf"
    files = (path for path in package.rglob("*") if path.is_file() and path.suffix != ".pyc")
    assert packed == {path.relative_to(package.parent).as_posix() for path in files}
    assert {"pbrdf/py.typed", "pbrdf/explorer/page/index.html", "pbrdf/report/templates/page.html"} <= packed
