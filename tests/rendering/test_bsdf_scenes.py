"""The BSDF plugin in scenes: properties, textures, spectra, XML, errors, and whole renderings."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from bsdf_helpers import LLVM, WAVELENGTHS, D, call, directions, interaction, light, use

import pbrdf
import pbrdf.rendering
from pbrdf import backend
from pbrdf.errors import BackendError, DataError, ModelError
from pbrdf.models import MODELS

PAINT = {"sigma": 0.0398, "n": 1.6207, "a": 0.9, "k": 1.2504, "b": 0.1827, "t": 0.6717}
TOLERANCE = 1e-4


def value(mi, bsdf, wi, wo, uv=(0.5, 0.5)):
    """f00 in 1/sr by channel, shape (N, channels)."""
    found = call(mi, bsdf.eval, wi, wo, uv=uv) / wo[:, 2].reshape(-1, *[1] * (3 if mi.is_polarized else 1))
    return found[..., 0, 0] if mi.is_polarized else found


def expected_value(wi, wo, **values):
    return pbrdf.DoubleGauss(**{**PAINT, **values}).mueller(*light(wi, wo))[:, 0, 0]


class TestDictionary:
    def test_model_there_and_back(self):
        """Numbers and options that differ from the defaults; κ = 0 is left out."""
        model = pbrdf.DoubleGauss(**PAINT, transmittance="amplitude")
        assert pbrdf.rendering.bsdf_dict(model) == {
            "type": "pbrdf",
            "model": "double-gauss",
            **PAINT,
            "transmittance": "amplitude",
        }
        metal = pbrdf.rendering.bsdf_dict(pbrdf.ReciprocalDoubleGauss(**PAINT, kappa=2.0))
        assert metal["model"] == "reciprocal-double-gauss" and metal["kappa"] == 2.0

    def test_every_model_is_there(self):
        mi = use("llvm_ad_mono")
        for name, cls in MODELS.items():
            assert name in str(mi.load_dict({"type": "pbrdf", "model": name})).replace(cls.__name__, name)

    def test_defaults_are_those_of_the_parameters(self):
        mi = use("llvm_ad_mono")
        wi, wo = directions(50, 80.0, 1), directions(50, 80.0, 2)
        values = {p.name: p.default for p in pbrdf.DoubleGauss.parameters}
        found = value(mi, mi.load_dict({"type": "pbrdf"}), wi, wo)
        np.testing.assert_allclose(found[:, 0], expected_value(wi, wo, **values), rtol=TOLERANCE)

    def test_paint_by_name_with_one_value_changed(self):
        mi = use("llvm_ad_mono")
        wi, wo = directions(50, 80.0, 1), directions(50, 80.0, 2)
        bsdf = mi.load_dict({"type": "pbrdf", "paint": "pearl-white", "a": 0.5})
        expected = pbrdf.load_paint("pearl-white").replace(a=0.5).mueller(*light(wi, wo))[:, 0, 0]
        np.testing.assert_allclose(value(mi, bsdf, wi, wo)[:, 0], expected, rtol=TOLERANCE)

    def test_model_file(self, tmp_path):
        mi = use("llvm_ad_mono")
        model = pbrdf.ReciprocalDoubleGauss(**PAINT, kappa=0.4, shadowing="smith")
        model.to_json(tmp_path / "paint.json")
        wi, wo = directions(50, 80.0, 1), directions(50, 80.0, 2)
        bsdf = mi.load_dict({"type": "pbrdf", "model_file": str(tmp_path / "paint.json")})
        expected = model.mueller(*light(wi, wo))[:, 0, 0]
        np.testing.assert_allclose(value(mi, bsdf, wi, wo)[:, 0], expected, rtol=TOLERANCE)

    def test_a_map_of_a_model_becomes_a_bitmap(self):
        mi = use("llvm_ad_mono")
        sigma = np.array([[0.03, 0.04, 0.05], [0.02, 0.06, 0.035]])
        described = pbrdf.rendering.bsdf_dict(pbrdf.DoubleGauss(**{**PAINT, "sigma": sigma}))
        bsdf = mi.load_dict({**described, "sigma": {**described["sigma"], "filter_type": "nearest"}})
        wi, wo = directions(20, 60.0, 1), directions(20, 60.0, 2)
        for (row, column), s in np.ndenumerate(sigma):
            found = value(mi, bsdf, wi, wo, uv=((column + 0.5) / 3, (row + 0.5) / 2))
            np.testing.assert_allclose(found[:, 0], expected_value(wi, wo, sigma=s), rtol=TOLERANCE)
        with pytest.raises(ModelError, match=r"sigma has the shape \(2,\)"):
            pbrdf.rendering.bsdf_dict(pbrdf.DoubleGauss(**{**PAINT, "sigma": [0.1, 0.2]}))


class TestTextures:
    @pytest.mark.slow
    @pytest.mark.parametrize("name", ["sigma", "n", "a", "k", "b", "t", "kappa"])
    def test_every_parameter_varies_over_the_surface(self, name):
        """A bitmap of four texels; the BRDF at each is that of the texel's number."""
        mi = use("llvm_ad_mono_polarized")
        numbers = (
            np.array([[0.02, 0.05], [0.1, 0.07]]) if name == "sigma" else np.array([[0.5, 0.9], [0.7, 0.6]])
        )
        if name == "n":
            numbers = numbers + 1.0
        texture = {
            "type": "bitmap",
            "bitmap": mi.Bitmap(numbers[..., None].astype(np.float32)),
            "raw": True,
            "filter_type": "nearest",
        }
        bsdf = mi.load_dict({"type": "pbrdf", **PAINT, name: texture, "accuracy": "default"})
        wi, wo = directions(400, 80.0, 1), directions(400, 80.0, 2)
        row, column = np.arange(400) % 2, np.arange(400) // 2 % 2
        found = value(mi, bsdf, wi, wo, uv=((column + 0.5) / 2, (row + 0.5) / 2))
        expected = expected_value(wi, wo, **{name: numbers[row, column]})
        np.testing.assert_allclose(found[:, 0], expected, rtol=TOLERANCE)

    @pytest.mark.slow
    @pytest.mark.parametrize("variant", ["llvm_ad_spectral", "llvm_ad_spectral_polarized", "scalar_spectral"])
    def test_spectra(self, variant):
        """Index, amplitude and extinction given over the wavelength, one value for each wavelength of a ray."""
        mi = use(variant)
        spectra = {
            "n": [(400.0, 1.7), (500.0, 1.62), (700.0, 1.5)],
            "a": [(400.0, 0.2), (520.0, 0.9), (700.0, 0.4)],
            "kappa": [(400.0, 0.0), (700.0, 0.3)],
        }
        given = {name: {"type": "spectrum", "value": nodes} for name, nodes in spectra.items()}
        bsdf = mi.load_dict({"type": "pbrdf", **PAINT, **given})
        wi, wo = directions(40, 80.0, 1), directions(40, 80.0, 2)
        found = value(mi, bsdf, wi, wo)
        for channel, wavelength in enumerate(WAVELENGTHS):
            values = {
                name: np.interp(wavelength, *zip(*nodes, strict=True)) for name, nodes in spectra.items()
            }
            np.testing.assert_allclose(found[:, channel], expected_value(wi, wo, **values), rtol=TOLERANCE)

    @pytest.mark.parametrize("variant", ["llvm_ad_rgb", "scalar_rgb"])
    def test_colours(self, variant):
        """Three numbers in the RGB variants are the parameters of the three channels."""
        mi = use(variant)
        a, n = [0.9, 0.5, 1.7], [1.6, 1.62, 1.65]
        bsdf = mi.load_dict(
            {"type": "pbrdf", **PAINT, "a": {"type": "rgb", "value": a}, "n": {"type": "rgb", "value": n}}
        )
        wi, wo = directions(40, 80.0, 1), directions(40, 80.0, 2)
        found = value(mi, bsdf, wi, wo)
        for channel in range(3):
            expected = expected_value(wi, wo, a=a[channel], n=n[channel])
            np.testing.assert_allclose(found[:, channel], expected, rtol=TOLERANCE)

    def test_samples_of_coloured_paint(self):
        """One direction serves all channels: the mean weight of each is the reflectance of its own paint."""
        mi = use("llvm_ad_rgb")
        a = [0.9, 0.2, 0.5]
        bsdf = mi.load_dict({"type": "pbrdf", **PAINT, "a": {"type": "rgb", "value": a}})
        wi = np.array([0.6, 0.0, 0.8])
        u = np.random.default_rng(1).random((3, 200_000)).astype(np.float32)
        si = interaction(mi, np.broadcast_to(wi, (200_000, 3)))
        ctx = mi.BSDFContext(mi.TransportMode.Importance)
        _, weight = bsdf.sample(ctx, si, mi.Float(u[0]), mi.Point2f(mi.Float(u[1]), mi.Float(u[2])))
        weight = np.array(weight)
        for channel in range(3):
            model = pbrdf.DoubleGauss(**{**PAINT, "a": a[channel]})
            expected = float(pbrdf.directional_hemispherical_reflectance(model, math.acos(0.8)))
            error = weight[channel].std() / 200_000**0.5
            assert abs(weight[channel].mean() - expected) < 4.0 * error + 2e-4 * expected

    def test_parameters_are_exposed_and_can_be_changed(self):
        mi = use("llvm_ad_mono")
        bsdf = mi.load_dict({"type": "pbrdf", **PAINT, "kappa": 0.2})
        parameters = mi.traverse(bsdf)
        assert set(parameters.keys()) == {f"{name}.value" for name in (*PAINT, "kappa")}
        assert all(
            parameters.flags(key) & mi.ParamFlags.NonDifferentiable == 0 for key in set(parameters.keys())
        )
        parameters["sigma.value"], parameters["kappa.value"] = mi.Float(0.05), mi.Float(0.9)
        parameters.update()
        wi, wo = directions(50, 80.0, 1), directions(50, 80.0, 2)
        expected = expected_value(wi, wo, sigma=0.05, kappa=0.9)
        np.testing.assert_allclose(value(mi, bsdf, wi, wo)[:, 0], expected, rtol=TOLERANCE)


class TestErrors:
    @pytest.mark.parametrize(
        ("properties", "message"),
        [
            ({"sigma": -0.1}, "sigma=-0.1 is outside its domain"),
            (
                {"t": 1.5},
                "t=1.5 is outside its domain: polarised share of the diffuse part must be within 0 … 1",
            ),
            ({"n": 0.8}, "n must be at least 1 where kappa is 0"),
            ({"sigma": "rough"}, "sigma='rough': give a number, a texture or a spectrum"),
            (
                {"roughness": 0.1},
                "unknown property 'roughness' of double-gauss: known are model, paint, model_file, s",
            ),
            (
                {"model": "triple-gauss"},
                "model 'triple-gauss' is unknown: choose one of double-gauss, reciprocal",
            ),
            ({"normalization": "plain"}, "normalization='plain': choose one of 'weighted', 'visible'"),
            (
                {"model": "reciprocal-double-gauss", "normalization": "weighted"},
                "unknown property 'normalization' of reciprocal-double-gauss",
            ),
            ({"normalization": "visible", "k": 0.3}, "normalization='visible' needs k > 1/3"),
            ({"paint": "black"}, "no bundled paint is named 'black'"),
            ({"paint": "white", "model_file": "x.json"}, "a paint and a model file are given: leave one out"),
            (
                {"paint": "white", "model": "reciprocal-double-gauss"},
                "the paint is of the model 'double-gauss'",
            ),
            ({"model_file": "missing.json"}, "missing.json: cannot be read as a model"),
            ({"t": {"type": "checkerboard", "color0": 0.5, "color1": 1.5}}, "t=1.5 at index (1,) is outside"),
        ],
    )
    def test_bad_properties(self, properties, message):
        mi = use("llvm_ad_mono")
        with pytest.raises(RuntimeError) as caught:
            mi.load_dict({"type": "pbrdf", **properties})
        assert message in str(caught.value)

    def test_a_colour_that_is_no_spectrum(self):
        mi = use("llvm_ad_spectral")
        with pytest.raises(RuntimeError, match="n: spectral variants turn an RGB value into a spectrum"):
            mi.load_dict({"type": "pbrdf", "n": {"type": "rgb", "value": [1.6, 1.6, 1.6]}})

    def test_python_raises_the_projects_errors(self):
        """Mitsuba wraps what a plugin raises; the reader itself raises the error that names the property."""
        mi = use("llvm_ad_mono")
        from pbrdf.rendering.properties import read_properties

        properties = mi.Properties()
        properties["t"] = 2.0
        with pytest.raises(ModelError, match="t=2 is outside its domain"):
            read_properties(properties)
        properties = mi.Properties()
        properties["paint"] = "black"
        with pytest.raises(DataError, match="no bundled paint"):
            read_properties(properties)

    def test_without_mitsuba(self, monkeypatch):
        monkeypatch.setitem(sys.modules, "mitsuba", None)
        with pytest.raises(BackendError, match=r"pip install 'pbrdf\[render\]'"):
            pbrdf.rendering.register()

    def test_an_llvm_that_aborts(self, monkeypatch):
        """An old LLVM of the user's choice, or one that Dr.Jit has worked with before pbrdf was imported."""
        use("llvm_ad_mono")
        monkeypatch.setattr(backend, "llvm_version", lambda: (15, 0, 6))
        with pytest.raises(BackendError, match=r"version 15\.0\.6, too old"):
            pbrdf.rendering.register()

    def test_a_map_needs_a_variant(self):
        code = (
            "import pbrdf, pbrdf.rendering as r\n"
            "try: r.bsdf_dict(pbrdf.DoubleGauss([[0.1, 0.2]], 1.6, 1, 1.2, 0, 0.5))\n"
            "except pbrdf.ModelError as e: print(e)\n"
        )
        pytest.importorskip("mitsuba")
        run = python(code)
        assert "call mitsuba.set_variant" in run.stdout, run.stderr


def python(code):
    source = str(Path(pbrdf.__file__).parents[1])
    return subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {source!r})\n{code}"],
        capture_output=True,
        text=True,
        timeout=120,
    )


class TestRegistration:
    def test_importing_does_not_import_mitsuba(self):
        run = python("import pbrdf.rendering as r; print(sys.modules.keys() & {'mitsuba', 'drjit'}, dir(r))")
        assert run.stdout.startswith("set()") and "register" in run.stdout, run.stderr

    def test_one_call_serves_every_later_variant(self):
        """``register`` may come before any variant is set, and twice."""
        pytest.importorskip("mitsuba")
        code = (
            "import pbrdf.rendering as r, mitsuba as mi\n"
            "r.register()\n"
            "for v in ('scalar_rgb', 'llvm_ad_mono', 'llvm_ad_rgb', 'llvm_ad_mono'):\n"
            "    mi.set_variant(v)\n"
            "    r.register()\n"
            "    print(mi.load_dict({'type': 'pbrdf'}))\n"
        )
        run = python(code)
        assert run.stdout.count("PaintedSurface[DoubleGauss(sigma=0.04") == 4, run.stderr


XML = """<scene version="3.0.0">
    <bsdf type="pbrdf" id="coat">
        <string name="model" value="double-gauss"/>
        <float name="sigma" value="0.0398"/>
        <float name="n" value="1.6207"/>
        <float name="a" value="0.9"/>
        <texture name="k" type="checkerboard"><float name="color0" value="1.2504"/><float name="color1" value="2"/>
        </texture>
        <float name="b" value="0.1827"/>
        <float name="t" value="0.6717"/>
        <string name="normalization" value="visible"/>
        <string name="accuracy" value="default"/>
    </bsdf>
    <shape type="sphere"><ref id="coat"/></shape>
</scene>"""


def test_xml():
    mi = use("llvm_ad_mono")
    bsdf = mi.load_string(XML).shapes()[0].bsdf()
    wi, wo = directions(50, 80.0, 1), directions(50, 80.0, 2)
    expected = pbrdf.DoubleGauss(**PAINT, normalization="visible").mueller(*light(wi, wo))[:, 0, 0]
    np.testing.assert_allclose(value(mi, bsdf, wi, wo, uv=(0.1, 0.1))[:, 0], expected, rtol=TOLERANCE)


def test_xml_beside_its_model_file(tmp_path):
    mi = use("llvm_ad_mono")
    pbrdf.DoubleGauss(**PAINT).to_json(tmp_path / "paint.json")
    scene = '<scene version="3.0.0"><bsdf type="pbrdf"><string name="model_file" value="paint.json"/></bsdf></scene>'
    (tmp_path / "scene.xml").write_text(scene)
    assert "sigma=0.0398" in str(mi.load_file(str(tmp_path / "scene.xml")))


def picture_of_a_plate(mi, bsdf, to_source):
    """A few pixels of a plate under distant natural light of irradiance 2, seen obliquely from afar."""
    T = mi.ScalarTransform4f
    integrator = {"type": "path", "max_depth": 3}
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "stokes", "nested": integrator} if mi.is_polarized else integrator,
            "sensor": {
                "type": "perspective",
                "fov": 0.05,
                "to_world": T().look_at([30.0, -40.0, 50.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
                "film": {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}},
            },
            "light": {"type": "directional", "direction": [-x for x in to_source], "irradiance": 2.0},
            "plate": {"type": "rectangle", "to_world": T().scale(50.0), "bsdf": bsdf},
        }
    )
    return np.array(mi.render(scene, spp=256, seed=1)).astype(float).mean((0, 1))


@pytest.mark.parametrize("variant", LLVM)
def test_rendered_plate(variant):
    """Radiance = f E_⊥ cosθ_i, and its Stokes vector in the camera's axes, through Mitsuba's whole pipeline.

    Camera axes: x to the side (s of the reflected light), V > 0 right circular, so S = D times that of the model.
    """
    mi = use(variant)
    mi.set_log_level(mi.LogLevel.Error)
    model = pbrdf.DoubleGauss(**PAINT)
    to_source = np.array([-0.5, 0.9, 1.1]) / np.linalg.norm([-0.5, 0.9, 1.1])
    view = np.array([30.0, -40.0, 50.0]) / np.linalg.norm([30.0, -40.0, 50.0])
    expected = D @ model.stokes(*light(view[None], to_source[None]))[0] * 2.0 * to_source[2]
    found = picture_of_a_plate(mi, pbrdf.rendering.bsdf_dict(model), to_source.tolist())
    # spectral variants: the colour of the illuminant and its noise; green is next to the luminance
    tolerance = 0.03 if mi.is_spectral else 1e-4
    assert found[1 if len(found) > 1 else 0] == pytest.approx(expected[0], rel=tolerance)
    if mi.is_polarized:  # three colours of each of S0 … S3, also in the mono variants
        stokes = found[-12:].reshape(4, 3)
        assert np.max(np.abs(expected[1:3] / expected[0])) > 0.1  # there is polarisation to see
        normalised = stokes[1:] / stokes[0]
        np.testing.assert_allclose(
            normalised, np.broadcast_to(expected[1:, None] / expected[0], (3, 3)), atol=2e-4
        )
