"""Time per sample of the BSDF plugin ``pbrdf`` against Mitsuba's own ``pplastic`` in the same scene.

    python benchmarks/rendering.py [--size N] [--spp N] [--rounds R] [--quick] [--json FILE]

A sphere on a plane, both of the material that is measured, under an area light and a constant sky; paths of up to
five bounces without Russian roulette, so that every material traces the same number of rays. The polarised variant
renders Stokes vectors (``stokes`` around ``path``), the other one colours. ``pplastic`` is Mitsuba's polarised plastic,
written in C++, with the same roughness (α = √2 σ), index and about the same albedo; it has no average over facets.

Materials take turns in each round, warm, and times are minima over the rounds. Only ratios of one run mean anything.
``diffuse`` shows what the scene costs without a material. ``pbrdf`` runs with the accuracy that it takes by itself for
this paint, ``fast``, with ``default``, with the normalization ``visible``, and under ``volpath``, with which
``pbrdf render`` traces scenes whose light passes polarisers.

The script ends with status 1 if ``pbrdf`` takes more than 1.5 times as long as ``pplastic``, or with ``visible`` more
than 3 times as long as without.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

import pbrdf.rendering
from pbrdf.backend import llvm_version, thread_count

TARGET = 1.5
#: Of ``visible``, against ``pbrdf`` as it is.
VISIBLE_TARGET = 3.0
VARIANTS = ("llvm_ad_mono_polarized", "llvm_ad_rgb")
PAINT = pbrdf.load_paint("matte-white-thick").replace(a=0.45)
MATERIALS: dict[str, dict[str, Any]] = {
    "diffuse": {"type": "diffuse"},
    "pplastic": {
        "type": "pplastic",
        "alpha": math.sqrt(2.0) * PAINT.values["sigma"],
        "int_ior": PAINT.values["n"],
        "ext_ior": 1.0,
        "diffuse_reflectance": 0.5,
    },
    "pbrdf": pbrdf.rendering.bsdf_dict(PAINT),
    "pbrdf, visible": {**pbrdf.rendering.bsdf_dict(PAINT), "normalization": "visible"},
    "pbrdf, default": {**pbrdf.rendering.bsdf_dict(PAINT), "accuracy": "default"},
}
#: Row of ``pbrdf`` under another tracer.
VOLPATH = "pbrdf, volpath"


def load_scene(material: dict[str, Any], size: int, tracer: str = "path") -> Any:
    """The scene with one material, for the active variant."""
    import mitsuba as mi

    T = mi.ScalarTransform4f
    path = {"type": tracer, "max_depth": 6, "rr_depth": 100}
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "stokes", "nested": path} if mi.is_polarized else path,
            "sensor": {
                "type": "perspective",
                "fov": 35.0,
                "to_world": T().look_at([0.0, -5.0, 2.5], [0.0, 0.0, 0.8], [0.0, 0.0, 1.0]),
                "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}},
            },
            "sky": {"type": "constant", "radiance": 0.5},
            "lamp": {
                "type": "rectangle",
                "to_world": T().look_at([2.0, -2.0, 4.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
                "emitter": {"type": "area", "radiance": 10.0},
            },
            "sphere": {"type": "sphere", "center": [0.0, 0.0, 1.0], "bsdf": material},
            "plane": {"type": "rectangle", "to_world": T().scale(4.0), "bsdf": material},
        }
    )


def render(scene: Any, spp: int, seed: int) -> tuple[float, float]:
    """Render once; wall and processor time in seconds."""
    import drjit as dr
    import mitsuba as mi

    wall, processor = time.perf_counter(), time.process_time()
    image = mi.render(scene, spp=spp, seed=seed)
    dr.eval(image)
    dr.sync_thread()
    return time.perf_counter() - wall, time.process_time() - processor


def measure(variant: str, size: int, spp: int, rounds: int) -> dict[str, Any]:
    """Time all materials in one variant, in turns."""
    import mitsuba as mi

    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)
    scenes = {name: load_scene(material, size) for name, material in MATERIALS.items()}
    scenes[VOLPATH] = load_scene(MATERIALS["pbrdf"], size, "volpath")
    first = {name: render(scene, spp, 0)[0] for name, scene in scenes.items()}
    wall: dict[str, list[float]] = {name: [] for name in scenes}
    processor: dict[str, list[float]] = {name: [] for name in scenes}
    for round_ in range(1, rounds + 1):
        for name, scene in scenes.items():
            seconds = render(scene, spp, round_)
            wall[name].append(seconds[0])
            processor[name].append(seconds[1])

    samples = size * size * spp
    best = {name: min(values) for name, values in wall.items()}
    cpu = {name: min(values) for name, values in processor.items()}
    ratio = {name: best[name] / best["pplastic"] for name in best}
    return {
        "variant": variant,
        "samples": samples,
        "first_s": first,
        "wall_ns_a_sample": {name: 1e9 * value / samples for name, value in best.items()},
        "cpu_ns_a_sample": {name: 1e9 * value / samples for name, value in cpu.items()},
        "median_ns_a_sample": {name: 1e9 * float(np.median(v)) / samples for name, v in wall.items()},
        "ratio": ratio,
        "cpu_ratio": {name: cpu[name] / cpu["pplastic"] for name in cpu},
        "target": TARGET,
        "met": ratio["pbrdf"] <= TARGET,
        "visible_ratio": best["pbrdf, visible"] / best["pbrdf"],
        "visible_target": VISIBLE_TARGET,
        "visible_met": best["pbrdf, visible"] <= VISIBLE_TARGET * best["pbrdf"],
    }


def show(console: Console, result: dict[str, Any]) -> None:
    """Print a table for one variant."""
    table = Table(
        title=f"{result['variant']}: {result['samples']} samples a picture",
        title_justify="left",
        title_style="bold",
        box=SIMPLE_HEAD,
        padding=0,
    )
    table.add_column("", no_wrap=True, width=15)
    for column, width in (
        ("ns/sample", 10),
        ("median", 8),
        ("÷ pplastic", 11),
        ("cpu ÷", 8),
        ("first s", 8),
        ("aim", 14),
    ):
        table.add_column(column, justify="right", no_wrap=True, width=width)
    for name in result["ratio"]:
        aim = {
            "pbrdf": f"≤ {TARGET:g}x {'met' if result['met'] else 'missed'}",
            VOLPATH: f"{result['ratio'][VOLPATH] / result['ratio']['pbrdf']:.2f} pbrdf",
            "pbrdf, visible": f"{result['visible_ratio']:.1f} ≤ {VISIBLE_TARGET:g} pbrdf",
        }.get(name, "")
        table.add_row(
            name,
            f"{result['wall_ns_a_sample'][name]:.0f}",
            f"{result['median_ns_a_sample'][name]:.0f}",
            f"{result['ratio'][name]:.2f}",
            f"{result['cpu_ratio'][name]:.2f}",
            f"{result['first_s'][name]:.1f}",
            aim,
        )
    console.print(table)


def main() -> int:
    """Run the benchmark; returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--size", type=int, default=256, help="pixels a side (default 256)")
    parser.add_argument("--spp", type=int, default=64, help="samples a pixel (default 64)")
    parser.add_argument("--rounds", type=int, default=9, help="rounds over the materials (default 9)")
    parser.add_argument("--quick", action="store_true", help="a small picture, 3 rounds: does it run?")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all results to this file")
    options = parser.parse_args()
    size, spp, rounds = (64, 16, 3) if options.quick else (options.size, options.spp, options.rounds)
    if min(size, spp, rounds) < 1:
        parser.error("--size, --spp and --rounds must be at least 1")

    pbrdf.rendering.register()
    import mitsuba as mi

    console = Console()
    version = llvm_version()
    machine = {
        "threads": thread_count(),
        "mitsuba": mi.__version__,
        "llvm": ".".join(map(str, version)) if version else "unknown",
        "python": platform.python_version(),
    }
    console.print(", ".join(f"{key} {value}" for key, value in machine.items()), highlight=False)
    results = [measure(variant, size, spp, rounds) for variant in VARIANTS]
    for result in results:
        show(console, result)
    if options.json is not None:
        report = {"machine": machine, "results": results}
        options.json.write_text(json.dumps(report, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0 if all(result["met"] and result["visible_met"] for result in results) else 1


if __name__ == "__main__":
    sys.exit(main())
