"""Polarimetric reflectance of coatings, from measurement to scene.

Everything a user needs stands here by name and is loaded when first used::

    import pbrdf

    paint = pbrdf.DoubleGauss(sigma=0.04, n=1.62, a=1.5, k=1.25, b=0.2, t=0.67)
    paint.mueller(theta_i, theta_r, phi)          # 4 x 4 Mueller matrices, 1/sr
    result = pbrdf.fit(pbrdf.read("paint.csv"))   # parameters with their uncertainty

``dir(pbrdf)`` lists the names, ``help(pbrdf.fit)`` explains one.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from pbrdf.backend import get_backend, point_drjit_to_llvm, set_backend
from pbrdf.errors import BackendError, DataError, FitError, ModelError, PbrdfError
from pbrdf.presentation import provide_presenter
from pbrdf.version import __version__

if TYPE_CHECKING:
    from pbrdf.data import check, convert, make_dataset, read, validate, write
    from pbrdf.data.paints import PAINTS, load_paint, open_experiment
    from pbrdf.data.readers import register_reader
    from pbrdf.data.refractive_index import refractive_index
    from pbrdf.explorer.explore import explore
    from pbrdf.identification.class_map import identify_map
    from pbrdf.identification.identify import identify
    from pbrdf.identification.labelled import calibrate_library
    from pbrdf.identification.library import Library, bundled_library, read_library
    from pbrdf.identification.material import material_from_fits, material_from_model
    from pbrdf.identification.telling_apart import next_measurement
    from pbrdf.instruments.calibration.instrument_calibration import calibrate_instrument
    from pbrdf.instruments.goniometer.protocols import Protocol
    from pbrdf.instruments.pixel_geometry.geometries import as_geometries
    from pbrdf.instruments.pixel_geometry.labels import read_labels
    from pbrdf.instruments.pixel_geometry.map_dataset import map_dataset
    from pbrdf.instruments.pixel_geometry.text_form import parse_pixel_geometry
    from pbrdf.instruments.polarimeter.detector import Detector
    from pbrdf.instruments.polarimeter.instrument import Instrument
    from pbrdf.instruments.polarimeter.instrument_files import load_instrument, save_instrument
    from pbrdf.instruments.polarimeter.merit import merit
    from pbrdf.instruments.polarimeter.polarimeter import (
        Polarimeter,
        division_of_focal_plane,
        lcvr,
        rotating_polarizer,
        rotating_retarder,
    )
    from pbrdf.instruments.polarimeter.polarization_errors import polarization
    from pbrdf.instruments.polarimeter.presets import preset
    from pbrdf.instruments.polarimeter.retardance_sets import retardance_set
    from pbrdf.instruments.reduction.goniometric_datasets import goniometric_datasets
    from pbrdf.instruments.reduction.reduce import reduce
    from pbrdf.instruments.reduction.stokes_image import reduce_frames
    from pbrdf.instruments.virtual.experiment import VirtualExperiment
    from pbrdf.inversion import (
        FitResult,
        HoldOut,
        NoiseModel,
        Nuisance,
        cross_validate,
        error_analysis,
        fit,
        plausibility,
    )
    from pbrdf.inversion.bootstrap import bootstrap
    from pbrdf.inversion.contour import contour
    from pbrdf.inversion.identifiability import identifiability
    from pbrdf.inversion.map_store import open_map
    from pbrdf.inversion.model_comparison import compare_models as compare
    from pbrdf.inversion.parameter_map import MapFit, fit_map
    from pbrdf.inversion.profile import profile
    from pbrdf.inversion.stored_result import load_fit
    from pbrdf.models import (
        DoubleGauss,
        Model,
        Option,
        Parameter,
        ReciprocalDoubleGauss,
        load_model,
        register,
    )
    from pbrdf.models.reflectance import directional_hemispherical_reflectance
    from pbrdf.optics.decomposition import lu_chipman
    from pbrdf.optics.mueller import cloude_entropy, coherency_eigenvalues, depolarization_index
    from pbrdf.optics.stokes import aolp, docp, dolp, dop, ellipticity
    from pbrdf.planning.plan import plan
    from pbrdf.rendering.bsdf import register as register_bsdf
    from pbrdf.rendering.export import write_merl, write_pbsdf
    from pbrdf.rendering.properties import bsdf_dict
    from pbrdf.rendering.render import render_stokes
    from pbrdf.rendering.variant import start_mitsuba

# name: where it is, as module, or module:name where it has another name there
_HOME = {
    # models and the bundled paints
    "DoubleGauss": "pbrdf.models",
    "ReciprocalDoubleGauss": "pbrdf.models",
    "Model": "pbrdf.models",
    "Parameter": "pbrdf.models",
    "Option": "pbrdf.models",
    "register": "pbrdf.models",
    "load_model": "pbrdf.models",
    "load_paint": "pbrdf.data.paints",
    "PAINTS": "pbrdf.data.paints",
    "refractive_index": "pbrdf.data.refractive_index",
    # Stokes parameters and Mueller matrices
    "dop": "pbrdf.optics.stokes",
    "dolp": "pbrdf.optics.stokes",
    "docp": "pbrdf.optics.stokes",
    "aolp": "pbrdf.optics.stokes",
    "ellipticity": "pbrdf.optics.stokes",
    "coherency_eigenvalues": "pbrdf.optics.mueller",
    "cloude_entropy": "pbrdf.optics.mueller",
    "depolarization_index": "pbrdf.optics.mueller",
    "lu_chipman": "pbrdf.optics.decomposition",
    # data sets
    "read": "pbrdf.data",
    "write": "pbrdf.data",
    "register_reader": "pbrdf.data.readers",
    "make_dataset": "pbrdf.data",
    "check": "pbrdf.data",
    "validate": "pbrdf.data",
    "open_experiment": "pbrdf.data.paints",
    # what other programs give, in our convention
    "convert": "pbrdf.data",
    # fit
    "fit": "pbrdf.inversion",
    "FitResult": "pbrdf.inversion",
    "fit_map": "pbrdf.inversion.parameter_map",
    "MapFit": "pbrdf.inversion.parameter_map",
    "NoiseModel": "pbrdf.inversion",
    "Nuisance": "pbrdf.inversion",
    "HoldOut": "pbrdf.inversion",
    "load_fit": "pbrdf.inversion.stored_result",
    "open_map": "pbrdf.inversion.map_store",
    # how far to trust a fit
    "profile": "pbrdf.inversion.profile",
    "contour": "pbrdf.inversion.contour",
    "bootstrap": "pbrdf.inversion.bootstrap",
    "identifiability": "pbrdf.inversion.identifiability",
    "cross_validate": "pbrdf.inversion",
    "compare": "pbrdf.inversion.model_comparison:compare_models",
    "error_analysis": "pbrdf.inversion",
    "plausibility": "pbrdf.inversion",
    "directional_hemispherical_reflectance": "pbrdf.models.reflectance",
    # all of it in a browser or a notebook
    "explore": "pbrdf.explorer.explore",
    # which material it is
    "identify": "pbrdf.identification.identify",
    "identify_map": "pbrdf.identification.class_map",
    "calibrate_library": "pbrdf.identification.labelled",
    "Library": "pbrdf.identification.library",
    "read_library": "pbrdf.identification.library",
    "bundled_library": "pbrdf.identification.library",
    "material_from_fits": "pbrdf.identification.material",
    "material_from_model": "pbrdf.identification.material",
    "next_measurement": "pbrdf.identification.telling_apart",
    # polarimeters and their calibration
    "Instrument": "pbrdf.instruments.polarimeter.instrument",
    "load_instrument": "pbrdf.instruments.polarimeter.instrument_files",
    "save_instrument": "pbrdf.instruments.polarimeter.instrument_files",
    "preset": "pbrdf.instruments.polarimeter.presets",
    "Detector": "pbrdf.instruments.polarimeter.detector",
    "Polarimeter": "pbrdf.instruments.polarimeter.polarimeter",
    "lcvr": "pbrdf.instruments.polarimeter.polarimeter",
    "retardance_set": "pbrdf.instruments.polarimeter.retardance_sets",
    "rotating_retarder": "pbrdf.instruments.polarimeter.polarimeter",
    "rotating_polarizer": "pbrdf.instruments.polarimeter.polarimeter",
    "division_of_focal_plane": "pbrdf.instruments.polarimeter.polarimeter",
    "merit": "pbrdf.instruments.polarimeter.merit",
    "calibrate_instrument": "pbrdf.instruments.calibration.instrument_calibration",
    # frames to Stokes parameters to data sets
    "reduce_frames": "pbrdf.instruments.reduction.stokes_image",
    "reduce": "pbrdf.instruments.reduction.reduce",
    "goniometric_datasets": "pbrdf.instruments.reduction.goniometric_datasets",
    "polarization": "pbrdf.instruments.polarimeter.polarization_errors",
    # the pixels of a picture as geometries
    "parse_pixel_geometry": "pbrdf.instruments.pixel_geometry.text_form",
    "map_dataset": "pbrdf.instruments.pixel_geometry.map_dataset",
    "as_geometries": "pbrdf.instruments.pixel_geometry.geometries",
    "read_labels": "pbrdf.instruments.pixel_geometry.labels",
    # goniometer: what to measure, and the measurement simulated
    "Protocol": "pbrdf.instruments.goniometer.protocols",
    "plan": "pbrdf.planning.plan",
    "VirtualExperiment": "pbrdf.instruments.virtual.experiment",
    # scenes
    "start_mitsuba": "pbrdf.rendering.variant",
    "register_bsdf": "pbrdf.rendering.bsdf:register",
    "bsdf_dict": "pbrdf.rendering.properties",
    "render_stokes": "pbrdf.rendering.render",
    "write_pbsdf": "pbrdf.rendering.export",
    "write_merl": "pbrdf.rendering.export",
}

__all__ = [
    "PAINTS",
    "BackendError",
    "DataError",
    "Detector",
    "DoubleGauss",
    "FitError",
    "FitResult",
    "HoldOut",
    "Instrument",
    "Library",
    "MapFit",
    "Model",
    "ModelError",
    "NoiseModel",
    "Nuisance",
    "Option",
    "Parameter",
    "PbrdfError",
    "Polarimeter",
    "Protocol",
    "ReciprocalDoubleGauss",
    "VirtualExperiment",
    "__version__",
    "aolp",
    "as_geometries",
    "bootstrap",
    "bsdf_dict",
    "bundled_library",
    "calibrate_instrument",
    "calibrate_library",
    "check",
    "cloude_entropy",
    "coherency_eigenvalues",
    "compare",
    "contour",
    "convert",
    "cross_validate",
    "depolarization_index",
    "directional_hemispherical_reflectance",
    "division_of_focal_plane",
    "docp",
    "dolp",
    "dop",
    "ellipticity",
    "error_analysis",
    "explore",
    "fit",
    "fit_map",
    "get_backend",
    "goniometric_datasets",
    "identifiability",
    "identify",
    "identify_map",
    "lcvr",
    "load_fit",
    "load_instrument",
    "load_model",
    "load_paint",
    "lu_chipman",
    "make_dataset",
    "map_dataset",
    "material_from_fits",
    "material_from_model",
    "merit",
    "next_measurement",
    "open_experiment",
    "open_map",
    "parse_pixel_geometry",
    "plan",
    "plausibility",
    "polarization",
    "preset",
    "profile",
    "read",
    "read_labels",
    "read_library",
    "reduce",
    "reduce_frames",
    "refractive_index",
    "register",
    "register_bsdf",
    "register_reader",
    "render_stokes",
    "retardance_set",
    "rotating_polarizer",
    "rotating_retarder",
    "save_instrument",
    "set_backend",
    "start_mitsuba",
    "validate",
    "write",
    "write_merl",
    "write_pbsdf",
]

point_drjit_to_llvm()
provide_presenter("comparison", lambda: importlib.import_module("pbrdf.report.comparison.presenter"))
provide_presenter("fit", lambda: importlib.import_module("pbrdf.report.fit.presenter"))
provide_presenter("identification", lambda: importlib.import_module("pbrdf.report.identification.presenter"))


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'pbrdf' has no attribute {name!r}")
    module, _, own_name = _HOME[name].partition(":")
    value = getattr(importlib.import_module(module), own_name or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
