"""Make the rendered pictures of the documentation: ``docs/images/{fender,spheres,pbsdf-vs-plugin,…}.png``.

Run it with: python scripts/make_render_pictures.py [NAME …]   (needs mitsuba; minutes)
"""

from __future__ import annotations

import importlib.util
import math
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import pbrdf
from pbrdf.rendering import bsdf_dict
from pbrdf.rendering.export import write_pbsdf
from pbrdf.rendering.picture import StokesPicture
from pbrdf.rendering.polarized_lamp import LampPolarization
from pbrdf.rendering.render import render_stokes
from pbrdf.rendering.scenes import make_scene, subject
from pbrdf.rendering.sky import Sky
from pbrdf.rendering.variant import start_mitsuba
from pbrdf.report.rendering.figure import stokes_figure
from pbrdf.report.style import new_figure, save_figure, styled

DOCS = Path(__file__).parents[1] / "docs"
#: Size of the pictures in the documentation, in that of the command's.
_SCALE = 0.5
#: A dark, smooth car paint, and a semi-gloss one.
GLOSSY = pbrdf.DoubleGauss(sigma=0.01, n=1.55, a=0.08, k=1.1, b=0.1, t=0.6)
SEMIGLOSS = pbrdf.DoubleGauss(sigma=0.06, n=1.6, a=0.3, k=1.2, b=0.2, t=0.6)


def scene(
    name: str, bsdfs: list[dict[str, Any]], size: tuple[int, int], zenith: float, azimuth: float
) -> Any:
    """One of the project's scenes under a clear sky; the sun's angles in degrees."""
    sky = Sky(math.radians(zenith), math.radians(azimuth))
    return make_scene(subject(name, bsdfs, size[0] / size[1]), "sky", size, sky=sky)


def fender(target: Path) -> None:
    """The fender of a car in dark paint."""
    picture = render_stokes(scene("fender", [bsdf_dict(GLOSSY)], (480, 320), 50.0, 215.0), spp=512)
    save_small(stokes_figure(picture, "σ = 0.01, n = 1.55, a = 0.08 under a clear sky"), target)


def spheres(target: Path) -> None:
    """Two paints side by side."""
    bsdfs = [bsdf_dict(GLOSSY), bsdf_dict(SEMIGLOSS)]
    picture = render_stokes(scene("sphere", bsdfs, (480, 300), 45.0, 235.0), spp=512)
    save_small(
        stokes_figure(picture, "glossy (σ = 0.01) and semi-gloss (σ = 0.06) under a clear sky"), target
    )


def pbsdf_vs_plugin(target: Path) -> None:
    """The plugin, and Mitsuba's own `measured_polarized` with the exported file."""
    size, spp = (150, 150), 1024
    with tempfile.TemporaryDirectory() as folder:
        export = write_pbsdf(SEMIGLOSS, Path(folder) / "paint.pbsdf")
        pictures = [
            render_stokes(scene("sphere", [bsdf], size, 45.0, 235.0), spp=spp, seed=seed)
            for seed, bsdf in enumerate((bsdf_dict(SEMIGLOSS), export.bsdf))
        ]
    save_small(comparison_figure(*pictures), target)


def comparison_figure(plugin: StokesPicture, file: StokesPicture) -> Any:
    """Intensity and DoLP of both pictures, and what differs, in standard errors."""
    error = np.hypot(plugin.std, file.std)
    known = error > 1e-9
    pull = np.where(known, (file.stokes - plugin.stokes) / np.where(known, error, 1.0), np.nan)
    pulls = pull[:3][known[:3]]
    with styled():
        figure = new_figure(8.6, 5.4)
        axes = figure.subplots(2, 3)
        top = float(np.percentile(plugin.stokes[0], 99.0))
        for column, (name, picture) in enumerate((("plugin", plugin), ("file in Mitsuba", file))):
            shown = axes[0, column].imshow((picture.stokes[0] / top).clip(0.0, 1.0) ** (1 / 2.2), cmap="gray")
            axes[0, column].set_title(f"{name}: intensity")
            dolp = axes[1, column].imshow(picture.dolp, cmap="viridis", vmin=0.0, vmax=0.6)
            axes[1, column].set_title(f"{name}: DoLP")
        for row, k in ((0, 0), (1, 1)):
            off = axes[row, 2].imshow(pull[k], cmap="RdBu_r", vmin=-5.0, vmax=5.0)
            axes[row, 2].set_title(f"difference of S{k}, in standard errors")
            figure.colorbar(off, ax=axes[row, 2], shrink=0.85)
        figure.colorbar(shown, ax=axes[0, 1], shrink=0.85, ticks=[]).set_label("radiance (display scale)")
        figure.colorbar(dolp, ax=axes[1, 1], shrink=0.85)
        for ax in axes.ravel():
            ax.set_xticks([])
            ax.set_yticks([])
            ax.grid(False)
            for spine in ax.spines.values():
                spine.set_visible(False)
        figure.suptitle(
            f"A .pbsdf file rendered by Mitsuba's measured_polarized, and the plugin: the differences of S0, S1, S2 "
            f"have the root mean square {np.sqrt(np.mean(np.clip(pulls, -10, 10) ** 2)):.2f}",
            fontsize=9.5,
        )
        return figure


def polarized_lamp(target: Path) -> None:
    """What a lamp's polariser does to the light that a panel mirrors, and circular light on a sphere."""

    def lit(name: str, lamp: LampPolarization) -> np.ndarray:
        what = subject(name, [bsdf_dict(SEMIGLOSS)])
        return render_stokes(make_scene(what, "area", (200, 200), polarization=lamp), spp=512).stokes

    level, upright = (lit("plate", LampPolarization(angle))[0] for angle in (0.0, 0.5 * math.pi))
    circular = lit("sphere", LampPolarization(0.0, -0.25 * math.pi, 0.5 * math.pi))
    top = float(np.percentile(level, 99.0))
    with styled():
        figure = new_figure(8.6, 3.0)
        axes = figure.subplots(1, 3)
        for ax, name, seen in ((axes[0], "0°", level), (axes[1], "90°", upright)):
            shown = ax.imshow((seen / top).clip(0.0, 1.0) ** (1 / 2.2), cmap="gray", vmin=0.0, vmax=1.0)
            ax.set_title(f"polariser of the lamp at {name}", fontsize=9.0)
        figure.colorbar(shown, ax=axes[1], shrink=0.8, ticks=[]).set_label("radiance (display scale)")
        with np.errstate(invalid="ignore"):
            shown = axes[2].imshow(circular[3] / circular[0], cmap="RdBu_r", vmin=-1.0, vmax=1.0)
        axes[2].set_title("left circular light: S3/S0", fontsize=9.0)
        figure.colorbar(shown, ax=axes[2], shrink=0.8)
        for ax in axes:
            ax.set_xticks([])
            ax.set_yticks([])
            ax.grid(False)
            for spine in ax.spines.values():
                spine.set_visible(False)
        save_small(figure, target)


def inverse_rendering(target: Path) -> None:
    """Convergence of the worked example."""
    spec = importlib.util.spec_from_file_location(
        "inverse_rendering", DOCS / "examples" / "inverse_rendering.py"
    )
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = example
    spec.loader.exec_module(example)
    history = example.recover()
    for name, values in history.values.items():
        print(f"{name}: {values[-1]:.5g}, true {example.TRUTH.values[name]:g}")
    example.draw(history, target)


def save_small(figure: Any, target: Path) -> None:
    """Save a figure smaller: a rendered picture's noise fills a PNG file."""
    from PIL import Image

    save_figure(figure, target)
    with Image.open(target) as image:
        size = round(image.width * _SCALE), round(image.height * _SCALE)
        small = image.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    small.save(target, optimize=True)


PICTURES: dict[str, Callable[[Path], None]] = {
    "fender": fender,
    "spheres": spheres,
    "pbsdf-vs-plugin": pbsdf_vs_plugin,
    "polarized-lamp": polarized_lamp,
    "inverse-rendering": inverse_rendering,
}


def main() -> None:
    """Make the pictures named on the command line, or all."""
    names = sys.argv[1:] or list(PICTURES)
    start_mitsuba()
    for name in names:
        target = DOCS / "images" / f"{name}.png"
        PICTURES[name](target)
        print(f"{target}: {target.stat().st_size / 1024:.0f} kB")


if __name__ == "__main__":
    main()
