"""Inverse rendering: roughness and refractive index of a painted ball from three polarised pictures.

The pictures (intensity and linear polarisation under three lamps, one after another) are rendered from a paint that the
search does not know. It renders the ball with a guess, compares, and follows the gradient that the path tracer gives
through the BSDF plugin, with Adam. docs/inverse-rendering.md explains the steps.

Run it with: python docs/examples/inverse_rendering.py [FIGURE.png]
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import pbrdf
from pbrdf.rendering.scenes import Camera

#: Accuracy "fast" averages over few facets without a loop: gradients take the least time.
TRUTH = pbrdf.DoubleGauss(sigma=0.05, n=1.65, a=0.3, k=1.2, b=0.2, t=0.6, accuracy="fast")
GUESS = TRUTH.replace(sigma=0.09, n=1.4)
CAMERA = Camera((0.0, -3.0, 0.0), (0.0, 0.0, 0.0), math.radians(21.0))
LAMPS = ((2.0, -3.0, 1.5), (-3.0, -1.5, 1.0), (0.5, -2.0, 3.0))
#: Step sizes of Adam: about a hundredth of what each parameter may change.
STEPS = {"sigma": 0.0015, "n": 0.012}
BOUNDS = {"sigma": (0.01, 0.3), "n": (1.1, 3.0)}


@dataclass
class History:
    """Loss and parameters after each step; the first entry is the guess."""

    loss: list[float]
    values: dict[str, list[float]]


def ball(mi: Any, paint: pbrdf.Model, lamp: tuple[float, float, float], size: int) -> Any:
    """A painted ball under one lamp."""
    return mi.load_dict(
        {
            "type": "scene",
            "sensor": CAMERA.to_dict(size, size),
            "ball": {"type": "sphere", "radius": 0.5, "bsdf": pbrdf.bsdf_dict(paint)},
            "lamp": {
                "type": "point",
                "position": list(lamp),
                "intensity": {"type": "uniform", "value": 10.0},
            },
        }
    )


def stokes_of(image: Any) -> tuple[Any, Any, Any]:
    """S0, S1, S2 of what the `stokes` integrator returns: a luminance, then each component three times."""
    return image[:, :, 1], image[:, :, 4], image[:, :, 7]


def recover(size: int = 64, iterations: int = 120, spp: int = 16) -> History:
    """Search for the paint of the pictures."""
    import drjit as dr

    mi = pbrdf.start_mitsuba()
    # nothing but the ball is there to reflect: `direct` follows all paths, and has the smallest kernels. Never `prb`
    # here: inside `stokes` its S1 … S3 are wrong
    integrator = mi.load_dict({"type": "stokes", "nested": {"type": "direct"}})
    pictures = []
    for i, lamp in enumerate(LAMPS):
        image = mi.render(ball(mi, TRUTH, lamp, size), integrator=integrator, spp=8 * spp, seed=9000 + i)
        pictures.append([dr.detach(component) for component in stokes_of(image)])

    scenes = [ball(mi, GUESS, lamp, size) for lamp in LAMPS]
    parameters = [mi.traverse(scene) for scene in scenes]
    optimiser = mi.ad.Adam(lr=1.0, beta_1=0.8)
    for name in STEPS:
        optimiser[name] = mi.Float(GUESS.values[name])
    optimiser.set_learning_rate(STEPS)

    history = History([], {name: [GUESS.values[name]] for name in STEPS})
    for iteration in range(iterations):
        loss = mi.Float(0.0)
        for i, (scene, params, picture) in enumerate(zip(scenes, parameters, pictures, strict=True)):
            for name in STEPS:
                params[f"ball.bsdf.{name}.value"] = optimiser[name]
            params.update()
            seed = iteration * len(LAMPS) + i
            image = mi.render(scene, params, integrator=integrator, spp=spp, seed=seed)
            # relative to the root of the brightness, so that the highlight does not decide alone
            weight = 1.0 / (picture[0] + 0.02)
            for seen, wanted in zip(stokes_of(image), picture, strict=True):
                loss += dr.sum((weight * dr.square(seen - wanted)).array) / size**2
        dr.backward(loss)
        optimiser.step()
        # the steps get shorter towards the end: the noise of the pictures is not followed
        fade = 0.5 + 0.5 * math.cos(math.pi * (iteration + 1) / iterations)
        optimiser.set_learning_rate({name: step * (0.02 + 0.98 * fade) for name, step in STEPS.items()})
        for name, (low, high) in BOUNDS.items():
            optimiser[name] = dr.clip(optimiser[name], low, high)
            history.values[name].append(float(optimiser[name][0]))
        history.loss.append(float(loss[0]))
    return history


def draw(history: History, path: Path) -> None:
    """Parameters and loss against the iteration."""
    from pbrdf.report.style import BLUE, GREY, new_figure, save_figure, styled

    with styled():
        figure = new_figure(9.6, 3.1)
        axes = figure.subplots(1, 3)
        for ax, (name, label) in zip(
            axes, {"sigma": "slope standard deviation σ", "n": "refractive index n"}.items(), strict=False
        ):
            ax.plot(history.values[name], color=BLUE, label="recovered")
            ax.axhline(TRUTH.values[name], color=GREY, linestyle="--", label="true")
            ax.set_ylabel(label)
            ax.legend(frameon=False)
        axes[2].plot(np.arange(len(history.loss)), history.loss, color=BLUE)
        axes[2].set_yscale("log")
        axes[2].set_ylabel("loss (arbitrary units)")
        for ax in axes:
            ax.set_xlabel("iteration")
        figure.suptitle("σ and n of a painted ball from three rendered pictures of S0, S1, S2", fontsize=10.5)
        save_figure(figure, path)


def main() -> None:
    """Recover the paint, print it and draw how."""
    history = recover()
    for name, values in history.values.items():
        truth = TRUTH.values[name]
        print(
            f"{name}: {values[0]:.4g} -> {values[-1]:.5g}, true {truth:g} ({values[-1] / truth - 1.0:+.2%})"
        )
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "inverse-rendering.png")
    draw(history, path)
    print(path)


if __name__ == "__main__":
    main()
