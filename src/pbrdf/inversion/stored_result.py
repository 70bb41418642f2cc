"""A fit in one file, to be taken up again: netCDF for the arrays, JSON in its attribute ``fit`` for the rest.

Numbers come back bit for bit. The arrays over geometries, starts and parameters are variables of the root group; the
comparison of measured and modelled values is the group ``comparison``, the data set as it was given the group ``data``.
Angles are in radians but for those of the data set, which is stored as in a file of its own.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.data.formats.stored import from_stored, to_stored
from pbrdf.data.origin import Origin, origin_of, remember
from pbrdf.errors import DataError, ModelError
from pbrdf.files.atomic import require_whole
from pbrdf.files.netcdf_files import load_netcdf, write_netcdf_file
from pbrdf.inversion.estimates import DistinctOptimum, Estimate
from pbrdf.inversion.holdout import HoldOut, Prediction
from pbrdf.inversion.observations import Observations
from pbrdf.inversion.problem import Space, Term
from pbrdf.inversion.result import FitResult
from pbrdf.inversion.statistics import Goodness
from pbrdf.inversion.strategy import Stage
from pbrdf.models import find_model, load_model
from pbrdf.models.parameters import Parameter

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["FILE_NAME", "FORMAT", "load_fit", "read_result", "write_result"]

#: Name of the file in the folder of a fit.
FILE_NAME = "fit.nc"

#: Version of the file's layout.
FORMAT = 1
#: Arrays of the observations, with their dimensions; those that may be None are left out then.
_OBSERVED = {
    "theta_i": ("geometry",),
    "theta_r": ("geometry",),
    "phi": ("geometry",),
    "values": ("channel", "geometry"),
    "std": ("channel", "geometry"),
    "group": ("geometry",),
    "wavelength": ("geometry",),
    "scale": ("geometry",),
    "correlation": ("geometry", "channel", "other_channel"),
}
_STARTS = {"start_values": ("start", "free"), "end_values": ("start", "free"), "chi2_by_start": ("start",)}


def write_result(result: FitResult, path: Path) -> None:
    """Write a fit; the file must be one that no other is replaced by until it is complete."""
    import xarray as xr

    data = result.data
    columns: dict[str, Any] = {
        name: (dims, getattr(data, name))
        for name, dims in _OBSERVED.items()
        if getattr(data, name) is not None
    }
    columns |= {name: (dims, getattr(result, name)) for name, dims in _STARTS.items()}
    columns["unknowns"] = ("free", result.unknowns)
    columns["information"] = (("free", "other_free"), result.information)
    columns["correlation_of_parameters"] = (("inside", "other_inside"), result.correlation.values)
    arrays = xr.Dataset(columns, coords={"channel": list(data.channels), "free": result.space.names})
    arrays.attrs = {
        "title": f"{result.model.name} fitted",
        "fit": json.dumps(_record(result), ensure_ascii=False),
        "read_from": json.dumps(_read_from(result.dataset), ensure_ascii=False),
    }
    comparison = result.comparison.copy()
    for name in [str(n) for n in comparison.data_vars if comparison[n].dtype == bool]:
        comparison[name] = comparison[name].astype(np.int8).assign_attrs(flag="1 is true")
    write_netcdf_file(path, {"/": arrays, "comparison": comparison, "data": to_stored(result.dataset)})


def _read_from(dataset: xr.Dataset) -> dict[str, Any]:
    """What of the file of the data is shown with a fit."""
    origin = origin_of(dataset) or Origin(())
    return {"meanings": origin.meanings, "remarks": origin.remarks, "dropped": origin.dropped}


def _origin(read_from: Mapping[str, Any]) -> Origin:
    meanings = tuple((str(name), str(meaning)) for name, meaning in read_from["meanings"])
    return Origin(
        (), {}, meanings, tuple(map(str, read_from["remarks"])), {}, tuple(map(str, read_from["dropped"]))
    )


def load_fit(folder: str | os.PathLike[str]) -> FitResult:
    """Bring back a fit that :meth:`FitResult.save` or ``pbrdf fit`` wrote.

    Parameters
    ----------
    folder
        The folder of the fit, or the file ``fit.nc`` in it.

    Returns
    -------
    FitResult
        As it was, bit for bit: it can be profiled, drawn, and predict again.

    Raises
    ------
    DataError
        If there is no fit, the file cannot be read, or files of another fit are mixed with those of this one.
    ModelError
        If it is of a model that is not known here: register it first.
    """
    path = Path(folder)
    if path.is_dir():
        require_whole(path)
        path /= FILE_NAME
    if not path.is_file():
        raise DataError(f"{path}: there is no such file; give the folder that a fit was saved in")
    return read_result(path)


def read_result(path: Path) -> FitResult:
    """Read what :func:`write_result` wrote.

    Raises
    ------
    DataError
        If the file cannot be read or is not that of a fit.
    ModelError
        If it is of a model that is not known here.
    """
    arrays, comparison, dataset = load_netcdf(
        path, ("/", "comparison", "data"), kind="a fit", decode_times=False
    )
    try:
        record = json.loads(arrays.attrs["fit"])
        if record["format"] != FORMAT:
            raise DataError(
                f"{path}: the fit is stored in format {record['format']}, this version reads format {FORMAT}: fit again"
            )
        measured = from_stored(dataset, path)
        remember(measured, _origin(json.loads(arrays.attrs["read_from"])))
        return _result(record, arrays, comparison, measured)
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from error
    except DataError:
        raise
    except Exception as error:  # a record of another shape fails anywhere
        reason = " ".join(str(error).split()) or type(error).__name__
        raise DataError(f"{path}: this is not the file of a fit, or a damaged one: {reason}") from error


def _record(result: FitResult) -> dict[str, Any]:
    space = result.space
    return {
        "format": FORMAT,
        "model": result.model.to_dict(),
        "space": {
            "model": space.model.name,
            "options": dict(space.options),
            "free": [asdict(p) for p in space.free],
            "fixed": dict(space.fixed),
            "lower": space.lower.tolist(),
            "upper": space.upper.tolist(),
            "terms": [{**asdict(t), "label": _plain(t.label)} for t in space.terms],
            "loss": space.loss,
            "by_wavelength": {name: list(table.items()) for name, table in space.by_wavelength.items()},
            "sources": dict(space.sources),
        },
        "observations": {
            "channels": list(result.data.channels),
            "illumination": list(result.data.illumination),
            "std_known": result.data.std_known,
        },
        "estimates": {name: asdict(e) for name, e in result.estimates.items()},
        "correlated": [str(n) for n in result.correlation["parameter"].values],
        "goodness": asdict(result.goodness),
        "optima": [asdict(o) for o in result.optima],
        "starts": result.starts,
        "converged": result.converged,
        "settled": result.settled,
        "fitted": {region: asdict(errors) for region, errors in result.fitted.items()},
        "predicted": {region: asdict(errors) for region, errors in result.predicted.items()},
        "noise": result.noise,
        "hold_out": None if result.hold_out is None else asdict(result.hold_out),
        "notes": result.notes,
        "stages": [asdict(stage) for stage in result.stages],
        "seconds": result.seconds,
        "flags": [str(n) for n in result.comparison.data_vars if result.comparison[n].dtype == bool],
    }


def _plain(label: Any) -> Any:
    return label.item() if isinstance(label, np.generic) else label


def _result(
    record: Mapping[str, Any], arrays: xr.Dataset, comparison: xr.Dataset, dataset: xr.Dataset
) -> FitResult:
    import xarray as xr

    for name in record["flags"]:
        comparison[name] = (comparison[name].dims, comparison[name].values.astype(bool))
    described = record["space"]
    space = Space(
        model=find_model(described["model"]),
        options=described["options"],
        free=tuple(_parameter(p) for p in described["free"]),
        fixed=described["fixed"],
        lower=np.array(described["lower"]),
        upper=np.array(described["upper"]),
        terms=tuple(Term(**{**t, "prior": _pair(t["prior"])}) for t in described["terms"]),
        loss=described["loss"],
        by_wavelength={name: dict(table) for name, table in described.get("by_wavelength", {}).items()},
        sources=described.get("sources", {}),
    )
    observed = record["observations"]
    columns: dict[str, Any] = {name: arrays[name].values if name in arrays else None for name in _OBSERVED}
    data = Observations(
        **columns,
        channels=tuple(observed["channels"]),
        illumination=tuple(observed["illumination"]),
        std_known=observed["std_known"],
    )
    names = record["correlated"]
    correlation = xr.DataArray(
        arrays["correlation_of_parameters"].values,
        dims=("parameter", "other"),
        coords={"parameter": names, "other": names},
        name="correlation",
    )
    hold_out = record["hold_out"]
    return FitResult(
        dataset=dataset,
        model=load_model(record["model"]),
        estimates={
            name: Estimate(**{**e, "parameter": _parameter(e["parameter"])})
            for name, e in record["estimates"].items()
        },
        goodness=Goodness(**record["goodness"]),
        comparison=comparison,
        space=space,
        data=data,
        unknowns=arrays["unknowns"].values,
        information=arrays["information"].values,
        correlation=correlation,
        optima=[DistinctOptimum(**o) for o in record["optima"]],
        starts=record["starts"],
        converged=record["converged"],
        settled=record.get("settled", True),
        fitted={region: Prediction(**errors) for region, errors in record["fitted"].items()},
        predicted={region: Prediction(**errors) for region, errors in record["predicted"].items()},
        noise=record["noise"],
        hold_out=None if hold_out is None else HoldOut(hold_out["kind"], tuple(hold_out["values"])),
        notes=record["notes"],
        stages=[Stage(**{**stage, "free": tuple(stage["free"])}) for stage in record["stages"]],
        seconds=record["seconds"],
        **{name: arrays[name].values for name in _STARTS},
    )


def _parameter(described: Mapping[str, Any]) -> Parameter:
    return Parameter(**{**described, "domain": _pair(described["domain"])})


def _pair(pair: list[float] | None) -> Any:
    return None if pair is None else tuple(pair)
