"""One build's side of ``versus.py``: does the work of a row when asked, and says what it took.

Started by ``versus.py`` with ``PYTHONPATH`` at the build's sources, once for each build; not for use by hand. Requests
and answers are lines of JSON on standard input and output (what the work itself prints goes to standard error). The
same file runs with both builds, so it uses only what both have: the front door, the command line, and from the build's
own ``benchmarks/`` the script ``fit.py``.

A request ``{"row": …, "do": "prepare" | "turn" | "result"}`` is answered with seconds by what was timed, wall and
processor time, or with the arrays that the builds are compared by, in a file of NumPy's.
"""

from __future__ import annotations

import importlib.util
import json
import math
import os
import shutil
import sys
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import pbrdf

#: Matte white, thick: the paper's Table 1.
PAINT = {"sigma": 0.0398, "n": 1.6207, "a": 1.5174, "k": 1.2504, "b": 0.1827, "t": 0.6717}
NAME = "matte-white-thick"
#: Directions of the check against accuracy ``high``.
CHECKED = 20_000
#: Parameters of which every group has its own in the rows of ``--split``: those of the body.
SPLIT = ("a", "k", "b", "t")

Times = dict[str, tuple[float, float]]


class Clock:
    """Wall and processor time of named pieces of work."""

    def __init__(self) -> None:
        self.times: Times = {}

    def __call__(self, name: str, work: Callable[[], Any]) -> Any:
        wall, processor = time.perf_counter(), time.process_time()
        result = work()
        self.times[name] = (time.perf_counter() - wall, time.process_time() - processor)
        return result


class Row:
    """One row of the table: what is made ready once, what is timed, what is compared."""

    def __init__(self, tree: Path, scratch: Path, quick: bool) -> None:
        self.tree, self.scratch, self.quick = tree, scratch, quick

    def turn(self, clock: Clock) -> None:
        raise NotImplementedError

    def result(self) -> dict[str, Any]:
        """Arrays that both builds must agree in."""
        return {}


class Evaluate(Row):
    """4 x 4 Mueller matrices of random directions, in and out as NumPy arrays."""

    sigma, accuracy, largest, wedge = PAINT["sigma"], "default", 1.3, False

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.model = pbrdf.DoubleGauss(**{**PAINT, "sigma": self.sigma}, accuracy=self.accuracy)
        count = 20_000 if self.quick else (100_000 if self.accuracy == "high" else 1_000_000)
        random = np.random.default_rng(20170711)
        theta = random.uniform(0.0, self.largest, (2, count))
        if self.wedge:
            # one ray, now this, now that one, beyond the zenith angle where the wedge begins to cut in
            limit = math.atan2(1.0, 4.5 * self.sigma)
            theta[random.integers(0, 2, count), np.arange(count)] = random.uniform(limit, self.largest, count)
        self.angles = (*theta, random.uniform(0.0, 2.0 * math.pi, count))

    def turn(self, clock: Clock) -> None:
        clock("mueller", lambda: self.model.mueller(*self.angles))

    def result(self) -> dict[str, Any]:
        few = [angle[:CHECKED] for angle in self.angles]
        return {
            "mueller": self.model.mueller(*few),
            "high": self.model.replace(accuracy="high").mueller(*few),
        }


class Sigma01(Evaluate):
    sigma = 0.1


class Sigma004(Evaluate):
    sigma = 0.04


class High(Evaluate):
    sigma, accuracy, wedge = 0.1, "high", True


class Render(Row):
    """Two materials in the scene of ``rendering.py``, one after the other."""

    def __init__(self, variant: str, *arguments: Any) -> None:
        super().__init__(*arguments)
        import mitsuba as mi

        from rendering import load_scene

        mi.set_variant(variant)
        mi.set_log_level(mi.LogLevel.Error)
        pbrdf.register_bsdf()
        self.variant = variant
        self.size, self.spp = (64, 16) if self.quick else (256, 16)
        self.scenes = {name: load_scene(material, self.size) for name, material in self.materials().items()}

    def materials(self) -> dict[str, Any]:
        raise NotImplementedError

    def render(self, scene: Any, spp: int) -> Any:
        import drjit as dr
        import mitsuba as mi

        image = mi.render(scene, spp=spp, seed=1)
        dr.eval(image)
        dr.sync_thread()
        return image

    def turn(self, clock: Clock) -> None:
        import mitsuba as mi

        mi.set_variant(self.variant)
        for name, scene in self.scenes.items():
            clock(name, lambda scene=scene: self.render(scene, self.spp))

    def result(self) -> dict[str, Any]:
        import mitsuba as mi

        mi.set_variant(self.variant)
        return {
            name: np.asarray(self.render(scene, self.spp)).mean(axis=(0, 1))
            for name, scene in self.scenes.items()
        }


class Visible(Render):
    """``visible`` and ``weighted`` as a scene gets them."""

    def materials(self) -> dict[str, Any]:
        paint = {name: value for name, value in PAINT.items() if name != "a"} | {"a": 0.45}
        return {
            name: pbrdf.bsdf_dict(pbrdf.DoubleGauss(**paint, normalization=name))
            for name in ("weighted", "visible")
        }


class Rough(Render):
    """σ = 0.1, with the average that the plugin takes by itself, and ``pplastic`` of the same roughness."""

    def materials(self) -> dict[str, Any]:
        paint = pbrdf.DoubleGauss(**{**PAINT, "sigma": 0.1, "a": 0.45})
        return {
            "pplastic": {
                "type": "pplastic",
                "alpha": math.sqrt(2.0) * 0.1,
                "int_ior": PAINT["n"],
                "ext_ior": 1.0,
                "diffuse_reflectance": 0.5,
            },
            "pbrdf": pbrdf.bsdf_dict(paint),
        }


class Batch(Row):
    """Fits of many data sets at once, as the build's own ``benchmarks/fit.py`` makes them."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        spec = importlib.util.spec_from_file_location("fit_of_the_build", self.tree / "benchmarks" / "fit.py")
        assert spec is not None and spec.loader is not None
        self.script = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(self.script)
        self.data = self.script.measurements(256 if self.quick else 4096)

    def turn(self, clock: Clock) -> None:
        self.found = clock("fits", lambda: self.script.fit_batch(self.data))[1]

    def result(self) -> dict[str, Any]:
        # all data sets measure one paint: the spread of the fits is the standard error of each
        return {"values": self.found, "standard errors": self.found.std(axis=0)}


def estimates(results: list[Any]) -> dict[str, Any]:
    """Values, standard errors and χ² of some fits."""
    kept = [e for result in results for e in result.estimates.values()]
    return {
        "values": np.array([e.value for e in kept], dtype=float),
        "standard errors": np.array([np.nan if e.std is None else e.std for e in kept], dtype=float),
        "chi2": np.array([result.goodness.chi2 for result in results]),
    }


class Intensity(Row):
    """One file of intensities, 1258 geometries in the plane of incidence and out of it, 64 starts."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        grid = (
            np.deg2rad([25.0, 50.0]),
            np.deg2rad(np.linspace(0.0, 72.0, 17)),
            np.linspace(0.0, 2.0 * math.pi, 37),
        )
        angles = [axis.ravel() for axis in np.meshgrid(*grid, indexing="ij")]
        intensity = pbrdf.load_paint(NAME).stokes(*angles)[:, 0]
        std = 0.02 * intensity
        noise = np.random.default_rng(12).standard_normal(intensity.size)
        self.data = pbrdf.make_dataset(*angles, quantity="brdf", I=intensity + std * noise, std={"I": std})
        self.starts = 8 if self.quick else 64

    def turn(self, clock: Clock) -> None:
        self.found = clock("fit", lambda: pbrdf.fit(self.data, starts=self.starts))

    def result(self) -> dict[str, Any]:
        return estimates([self.found])


class Split(Row):
    """Groups of 42 geometries that share the facets and have a body each, against as many fits of one group."""

    groups = 2

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        experiment = pbrdf.open_experiment(NAME)
        first = experiment.isel(geometry=np.flatnonzero(experiment["group"].values < 3))
        angles = [first[name].values for name in ("theta_i", "theta_r", "phi")]
        random = np.random.default_rng(3)
        self.alone, everything = [], []
        for _ in range(self.groups):
            a = PAINT["a"] * (1.0 + 0.1 * random.standard_normal())
            stokes = pbrdf.DoubleGauss(**{**PAINT, "a": a}).stokes(*angles)[:, :3]
            std = np.broadcast_to(0.01 * stokes[:, :1], stokes.shape)
            everything.append((stokes + std * random.standard_normal(stokes.shape), std))
            self.alone.append(self.dataset(angles, *everything[-1]))
        values, std = (np.concatenate(column) for column in zip(*everything, strict=True))
        tiled = [np.tile(angle, self.groups) for angle in angles]
        group = np.repeat(np.arange(self.groups), angles[0].size)
        self.together = self.dataset(tiled, values, std, group=group)
        self.starts = 8 if self.quick else 64

    @staticmethod
    def dataset(angles: list[Any], values: Any, std: Any, **more: Any) -> Any:
        columns = {name: values[:, i] for i, name in enumerate("IQU")}
        uncertainties = {name: std[:, i] for i, name in enumerate("IQU")}
        return pbrdf.make_dataset(*angles, quantity="brdf", **columns, std=uncertainties, **more)

    def turn(self, clock: Clock) -> None:
        split = dict.fromkeys(SPLIT, "group")
        clock("single fits", lambda: [pbrdf.fit(data, starts=self.starts) for data in self.alone])
        self.found = clock("split", lambda: pbrdf.fit(self.together, split=split, starts=self.starts))

    def result(self) -> dict[str, Any]:
        return estimates([self.found])


class Split8(Split):
    groups = 8


class Split20(Split):
    groups = 20


class Command(Row):
    """The command line in a process of its own, as ``pyproject.toml`` starts it."""

    options: tuple[str, ...] = ()
    empty_cache = False

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        project = tomllib.loads((self.tree / "pyproject.toml").read_text(encoding="utf-8"))
        module, function = project["project"]["scripts"]["pbrdf"].split(":")
        start = f"import sys; from {module} import {function}; sys.exit({function}())"
        self.output = self.scratch / "fit"
        self.command = [sys.executable, "-c", start, "fit", NAME, "--output", str(self.output), *self.options]

    def turn(self, clock: Clock) -> None:
        shutil.rmtree(self.output, ignore_errors=True)
        cache = self.scratch / "kernels"
        if self.empty_cache:
            shutil.rmtree(cache, ignore_errors=True)
        cache.mkdir(exist_ok=True)
        start = time.perf_counter()
        process = os.posix_spawn(
            self.command[0],
            self.command,
            {**os.environ, "DRJIT_CACHE_DIR": str(cache)},
            file_actions=[(os.POSIX_SPAWN_DUP2, 2, 1)],
        )
        _, status, used = os.wait4(process, 0)
        clock.times["pbrdf fit"] = (time.perf_counter() - start, used.ru_utime + used.ru_stime)
        if status != 0:
            raise RuntimeError(f"pbrdf fit ended with status {os.waitstatus_to_exitcode(status)}")

    def result(self) -> dict[str, Any]:
        told = json.loads((self.output / "fit.json").read_text(encoding="utf-8"))
        kept = [e for e in told["estimates"].values() if e["standard_error"] is not None]
        return {
            "values": np.array([e["value"] for e in kept]),
            "standard errors": np.array([e["standard_error"] for e in kept]),
            "chi2": np.array([told["goodness"]["chi2"]]),
        }


class CommandQuiet(Command):
    options = ("-q", "--no-figures")


class CommandFirst(Command):
    empty_cache = True


ROWS: dict[str, Callable[..., Row]] = {
    "sigma-0.1": Sigma01,
    "sigma-0.04": Sigma004,
    "high": High,
    "visible": lambda *arguments: Visible("llvm_ad_mono_polarized", *arguments),
    "visible-rgb": lambda *arguments: Visible("llvm_ad_rgb", *arguments),
    "fits": Batch,
    "intensity": Intensity,
    "split-2": Split,
    "split-8": Split8,
    "split-20": Split20,
    "command": Command,
    "command-quiet": CommandQuiet,
    "command-first": CommandFirst,
    "rough": lambda *arguments: Rough("llvm_ad_mono_polarized", *arguments),
    "rough-rgb": lambda *arguments: Rough("llvm_ad_rgb", *arguments),
}


def versions() -> dict[str, Any]:
    """What runs."""
    import drjit as dr

    from pbrdf.backend import llvm_version, thread_count

    backend = pbrdf.get_backend()
    return {
        "pbrdf": pbrdf.__version__,
        "backend": backend.name,
        "threads": thread_count(),
        "llvm": ".".join(map(str, llvm_version() or ())) or "unknown",
        "drjit": dr.__version__,
        "numpy": np.__version__,
    }


def main() -> None:
    """Answer requests until there are none."""
    tree, scratch, quick, threads = (
        Path(sys.argv[1]),
        Path(sys.argv[2]),
        sys.argv[3] == "quick",
        int(sys.argv[4]),
    )
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    home = Path(pbrdf.__file__).resolve()
    if not home.is_relative_to(tree.resolve()):
        raise RuntimeError(f"{home} is not of {tree}")
    if threads:
        import drjit as dr

        dr.set_thread_count(threads)
    rows: dict[str, Row] = {}
    for line in sys.stdin:
        request = json.loads(line)
        name, answer = request.get("row"), {}
        try:
            if request["do"] == "versions":
                answer = versions()
            elif request["do"] == "prepare":
                rows.clear()
                rows[name] = ROWS[name](tree, scratch, quick)
            elif request["do"] == "turn":
                clock = Clock()
                rows[name].turn(clock)
                answer = {"times": clock.times}
            elif request["do"] == "result":
                answer = {"file": str(scratch / f"{name}.npz")}
                np.savez(answer["file"], **rows[name].result())
        except Exception as error:
            answer = {"error": f"{type(error).__name__}: {error}"}
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
