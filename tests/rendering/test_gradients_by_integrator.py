"""Derivatives of S0 … S3 by every parameter of a paint, under every integrator that docs/inverse-rendering.md names.

Two balls that light each other stand under a polarised sky and a lamp: every component is there, directions are drawn
by the lights and by the paint, and paths reflect twice. Before `volpath` stands a retarder, through which `path` does
not see.

The differences are those of two pictures of one seed whose samples are drawn by one technique, that of the paint in the
middle: both follow the same paths, and only the integrand differs. Without that a million samples would leave some
percent of noise. The gradients come from the plugin as it is: samples or densities that carry derivatives would show.
"""

from __future__ import annotations

import functools
import math
import re
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from bsdf_helpers import plugin, use

import pbrdf
from pbrdf.models import MODELS
from pbrdf.rendering.scenes import Camera
from pbrdf.rendering.sky import Sky
from pbrdf.rendering.sky_emitter import register_sky, sky_dict

DOCS = Path(__file__).parents[2] / "docs"
#: Rows of the page's table: whether inside `stokes`, the integrator, the components and the modes.
ROWS = re.findall(
    r"^\| (`stokes` around )?`(\w+)`[^|]*\| (S0|S0 … S3), ([^|]*) \|",
    (DOCS / "inverse-rendering.md").read_text(encoding="utf-8"),
    re.MULTILINE,
)
DOCUMENTED = {f"stokes {name}" if polarised else name: modes for polarised, name, _, modes in ROWS}

PAINTS = {
    "double-gauss": pbrdf.DoubleGauss(
        sigma=0.15, n=1.6, kappa=0.6, a=0.6, k=1.2, b=0.3, t=0.6, accuracy="fast"
    ),
    "ggx-lambert": MODELS["ggx-lambert"](roughness=0.3, n=1.6, kappa=0.6, strength=0.8, albedo=0.4),
}
CASES = [
    (integrator, mode, name)
    for integrator, modes in DOCUMENTED.items()
    for mode in modes.split(" and ")
    for name in PAINTS
    # the longest kernels only once
    if (integrator, name) != ("stokes volpath", "ggx-lambert")
]
SIZE, SAMPLES, SEED = 8, 64, 7
#: Half of the relative step of the differences.
STEP = 0.01


def _retarder(mi):
    place = mi.ScalarTransform4f().look_at([0.15, -1.7, 0.6], [0.0, -3.0, 1.0], [0.0, 0.0, 1.0])
    return {
        "type": "rectangle",
        "to_world": place,
        "bsdf": {"type": "retarder", "theta": 20.0, "delta": 70.0},
    }


class Rendering:
    """The scene in one paint, whose parameters can be set.

    Directions are changes of parameters by name; those that are missing stay.
    """

    def __init__(self, integrator, described, values):
        kind = integrator.removeprefix("stokes ")
        polarised = kind != integrator
        self.mi = mi = use("llvm_ad_mono_polarized" if polarised else "llvm_ad_rgb")
        register_sky()
        tracer = {"type": kind} if kind == "direct" else {"type": kind, "max_depth": 3}
        self.integrator = mi.load_dict({"type": "stokes", "nested": tracer} if polarised else tracer)
        # after the luminance every component stands three times
        self.channels = [1, 4, 7, 10] if polarised else [0]
        self.values = values
        bsdf = described(mi)
        place = mi.ScalarTransform4f().look_at([-2.0, -2.0, 2.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0])
        # what `path` does not see through stands in front of the camera
        plate = {} if kind != "volpath" else {"plate": _retarder(mi)}
        self.scene = mi.load_dict(
            {
                **plate,
                "type": "scene",
                "sensor": Camera((0.0, -3.0, 1.0), (0.35, 0.0, 0.0), math.radians(30.0)).to_dict(SIZE, SIZE),
                "sky": sky_dict(Sky(math.radians(50.0), math.radians(-60.0)), 1e3),
                "lamp": {
                    "type": "rectangle",
                    "to_world": place @ mi.ScalarTransform4f().scale(0.5),
                    "emitter": {"type": "area", "radiance": 1.0},
                },
                "ball": {"type": "sphere", "radius": 0.5, "bsdf": bsdf},
                "other": {"type": "sphere", "radius": 0.5, "center": [0.9, 0.3, -0.1], "bsdf": bsdf},
            }
        )
        self.parameters = mi.traverse(self.scene)

    def _set(self, values):
        for key in self.parameters.keys():  # noqa: SIM118
            name = key.removesuffix(".value").rpartition("bsdf.")[2]
            if name in values:
                self.parameters[key] = values[name]
        self.parameters.update()

    def _components(self, image):
        """Shape (components, rows, columns)."""
        return np.moveaxis(np.asarray(image)[:, :, self.channels].astype(float), 2, 0)

    def difference(self, direction, cls):
        """Derivative of the picture along a direction; samples of the model class are drawn as in the middle."""
        import drjit as dr

        mi = self.mi
        middle = {name: mi.Float(value) for name, value in self.values.items()}
        width, albedos = cls.lobe_width, cls.albedos

        def middle_width(model, values=None):
            return width(model, None if values is None else middle)

        def middle_albedos(model, cosine, values):
            return albedos(model, cosine, middle)

        pair = []
        with (
            mock.patch.object(cls, "lobe_width", middle_width),
            mock.patch.object(cls, "albedos", middle_albedos),
        ):
            for step in (STEP, -STEP):
                moved = {name: x + step * direction.get(name, 0.0) for name, x in self.values.items()}
                self._set({name: dr.opaque(mi.Float, x) for name, x in moved.items()})
                image = mi.render(self.scene, integrator=self.integrator, spp=SAMPLES, seed=SEED)
                pair.append(self._components(image))
        return (pair[0] - pair[1]) / (2.0 * STEP)

    def _attached(self):
        """Parameters with derivatives, and their picture; Mitsuba draws a gradient with a seed of its own."""
        import drjit as dr

        values = {name: dr.opaque(self.mi.Float, x) for name, x in self.values.items()}
        dr.enable_grad(*values.values())
        self._set(values)
        given = {"integrator": self.integrator, "spp": SAMPLES, "seed": 1, "seed_grad": SEED}
        return values, self.mi.render(self.scene, self.parameters, **given)

    def forward(self, direction):
        """Derivative of the picture along a direction."""
        import drjit as dr

        values, image = self._attached()
        for name, value in values.items():
            dr.set_grad(value, dr.opaque(self.mi.Float, direction.get(name, 0.0)))
        return self._components(dr.forward_to(image))

    def reverse(self, weights):
        """Derivative of the components' weighted sum by each parameter."""
        import drjit as dr

        values, image = self._attached()
        by_channel = np.zeros(image.shape)
        by_channel[:, :, self.channels] = np.moveaxis(weights, 0, 2)
        dr.backward(dr.sum((self.mi.TensorXf(by_channel) * image).array))
        return {name: float(dr.grad(value)[0]) for name, value in values.items()}


def rendering_of(integrator, paint, **changes):
    return Rendering(integrator, lambda mi: plugin(mi, paint, **changes), paint.values)


@functools.cache
def differences(integrator, name):
    """Derivative of the picture by each parameter of a paint, times the parameter."""
    paint = PAINTS[name]
    rendering = rendering_of(integrator, paint)
    return {p: rendering.difference({p: value}, type(paint)) for p, value in paint.values.items()}


def check_forward(rendering, direction, expected):
    """Each component's picture within 0.1 %; one that is black is measured by S0."""
    found = rendering.forward(direction)
    for i, (f, e) in enumerate(zip(found, expected, strict=True)):
        allowed = 1e-3 * np.linalg.norm(e) + 1e-6 * np.linalg.norm(expected[0])
        assert np.linalg.norm(f - e) < allowed, f"S{i} by {', '.join(direction)}"


def check_reverse(rendering, direction, expected):
    """Weights with which each component that is not black gives 1: 0.2 % too much in one of them would be seen."""
    squares = (expected**2).sum((1, 2), keepdims=True)
    there = squares > 1e-12 * squares[0]
    gradient = rendering.reverse(np.where(there, expected / np.where(there, squares, 1.0), 0.0))
    found = sum(gradient[name] * change for name, change in direction.items())
    assert found == pytest.approx(there.sum(), abs=0.002), ", ".join(direction)


CHECKS = {"forward": check_forward, "reverse": check_reverse}


@pytest.mark.slow
@pytest.mark.parametrize(("integrator", "mode", "name"), CASES)
def test_derivatives_by_every_parameter_are_differences(integrator, mode, name):
    expected = differences(integrator, name)
    rendering = rendering_of(integrator, PAINTS[name])
    for parameter, value in PAINTS[name].values.items():
        CHECKS[mode](rendering, {parameter: value}, expected[parameter])


@pytest.mark.slow
@pytest.mark.parametrize("changes", [{"accuracy": "default"}, {}], ids=["default", "as it comes"])
def test_loops_over_the_facets_have_both_derivatives(changes):
    """Along one direction in all parameters; where the loop ends does not depend on them."""
    paint = PAINTS["double-gauss"].replace(accuracy="default", sigma=0.1)
    rendering = Rendering(
        "stokes direct",
        lambda mi: mi.load_dict({**pbrdf.rendering.bsdf_dict(paint), **changes}),
        paint.values,
    )
    direction = dict(paint.values)
    expected = rendering.difference(direction, type(paint))
    check_forward(rendering, direction, expected)
    check_reverse(rendering, direction, expected)


@pytest.mark.slow
def test_every_component_has_something_to_compare():
    for picture in differences("stokes path", "double-gauss").values():
        sizes = np.linalg.norm(picture, axis=(1, 2))
        assert (sizes > 1e-5 * sizes[0]).all() and sizes[0] > 0.0


def test_integrators_of_the_documentation_are_those_of_the_table():
    pages = [path.read_text(encoding="utf-8") for path in [*DOCS.rglob("*.md"), *DOCS.rglob("*.py")]]
    nested = {name for page in pages for name in re.findall(r'"nested": \{"type": "(\w+)"', page)}
    assert nested and {f"stokes {name}" for name in nested} <= set(DOCUMENTED)
    assert {mode for _, mode, _ in CASES} == set(CHECKS)
