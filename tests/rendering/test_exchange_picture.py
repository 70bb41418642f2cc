"""A ``.pbsdf`` file in plain Mitsuba, without this package, shows the picture that the plugin shows."""

import json
import math
import subprocess
import sys

import numpy as np
import pytest

import pbrdf
import pbrdf.rendering
from pbrdf.rendering.export import write_pbsdf
from pbrdf.rendering.render import render_stokes
from pbrdf.rendering.scenes import Camera

pytestmark = pytest.mark.slow

PAINT = pbrdf.DoubleGauss(sigma=0.1, n=1.6, a=0.3, k=1.2, b=0.3, t=0.6)
CAMERA = Camera((0.0, -3.0, 1.1), (0.0, 0.0, 0.45), math.radians(24.0))
SIZE, SPP, DEPTH, PASSES = 64, 256, 4, 16

#: What someone without this package would run: it knows Mitsuba and the file alone.
PLAIN = """
import json, sys
import numpy as np
import mitsuba as mi
mi.set_variant("llvm_ad_mono_polarized")
given = json.loads(sys.argv[1])
scene = given["scene"]
scene["sensor"]["to_world"] = mi.ScalarTransform4f().look_at(**given["view"])
scene["lamp"]["to_world"] = mi.ScalarTransform4f().look_at(**given["lamp"])
scene["ground"]["to_world"] = mi.ScalarTransform4f().scale(20.0)
loaded = mi.load_dict(scene)
stokes = {"type": "stokes", "nested": {"type": "path", "max_depth": given["depth"]}}
integrator = mi.load_dict(stokes)
passes = [
    np.array(mi.render(loaded, integrator=integrator, spp=given["spp"], seed=1000 + i))
    for i in range(given["passes"])
]
assert "pbrdf" not in sys.modules
np.save(given["output"], np.stack(passes))
"""


def description(bsdf):
    """The scene in numbers and text; transforms are added where it is loaded."""
    return {
        "scene": {
            "type": "scene",
            "sensor": {
                "type": "perspective",
                "fov": math.degrees(CAMERA.field_of_view),
                "film": {
                    "type": "hdrfilm",
                    "width": SIZE,
                    "height": SIZE,
                    "pixel_format": "luminance",
                    "rfilter": {"type": "box"},
                },
            },
            "ball": {"type": "sphere", "center": [0.0, 0.0, 0.5], "radius": 0.5, "bsdf": bsdf},
            "ground": {
                "type": "disk",
                "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.2}},
            },
            "lamp": {
                "type": "rectangle",
                "emitter": {"type": "area", "radiance": {"type": "uniform", "value": 4.0}},
            },
            "sky": {"type": "constant", "radiance": {"type": "uniform", "value": 0.05}},
        },
        "view": {"origin": CAMERA.origin, "target": CAMERA.target, "up": [0.0, 0.0, 1.0]},
        "lamp": {"origin": [-3.0, -3.0, 3.5], "target": [0.0, 0.0, 0.5], "up": [0.0, 0.0, 1.0]},
    }


def with_the_plugin(mi, paint):
    given = description(pbrdf.rendering.bsdf_dict(paint))
    scene = given["scene"]
    for name, view in (("sensor", given["view"]), ("lamp", given["lamp"])):
        scene[name]["to_world"] = mi.ScalarTransform4f().look_at(**{k: list(v) for k, v in view.items()})
    scene["ground"]["to_world"] = mi.ScalarTransform4f().scale(20.0)
    return render_stokes(mi.load_dict(scene), spp=SPP, depth=DEPTH)


def in_plain_mitsuba(bsdf, folder):
    """Mean and standard error over the passes, in this project's sign of V, shape (4, rows, columns) each."""
    output = folder / "plain.npy"
    given = description(bsdf) | {
        "depth": DEPTH,
        "spp": SPP // PASSES,
        "passes": PASSES,
        "output": str(output),
    }
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", PLAIN, json.dumps(given)],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    # a luminance, then S0 … S3 three times each
    passes = np.moveaxis(np.load(output)[..., 1::3].astype(float), -1, 1)
    passes[:, 3] *= -1.0
    return passes.mean(0), passes.std(0, ddof=1) / math.sqrt(PASSES)


def test_plain_mitsuba_shows_the_same_picture(mitsuba, tmp_path):
    export = write_pbsdf(PAINT, tmp_path / "paint.pbsdf")
    assert export.accurate
    plain, plain_error = in_plain_mitsuba(export.bsdf, tmp_path)
    picture = with_the_plugin(mitsuba, PAINT)
    error = np.hypot(picture.std, plain_error)
    difference = plain - picture.stokes
    # the table's own error is 1 % of f00 at most places; beyond 85° it has no nodes
    assert (np.abs(difference) < 4.0 * error + 0.01 * picture.stokes[0]).mean() > 0.998

    # noise averages out over patches of 8 × 8 pixels, a difference of the materials does not
    def patches(values):
        return values.reshape(4, SIZE // 8, 8, SIZE // 8, 8).mean((2, 4))

    scale = patches(picture.stokes)[:1]
    noise = np.sqrt(patches(error**2)) / 8.0
    assert (np.abs(patches(difference)) < 4.0 * noise + 0.004 * scale).all()
    # and pulls are those of noise: neither larger nor, by an error too pessimistic, much smaller
    seen = (error > 1e-4 * picture.stokes[0].max()) & (np.arange(4) < 3)[:, None, None]
    pull = np.clip(difference[seen] / error[seen], -5.0, 5.0)
    assert 0.9 < np.sqrt(np.mean(pull**2)) < 1.25

    # the comparison would have noticed another paint
    other = with_the_plugin(mitsuba, PAINT.replace(n=1.5))
    off = np.abs(patches(plain - other.stokes))
    assert not (off < 4.0 * noise + 0.004 * scale).all()
