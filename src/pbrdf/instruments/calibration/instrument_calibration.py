"""Calibration of an instrument from frames of known light: the way from files to an instrument that reduces with it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.calibration.analyzer_calibration import (
    Accuracy,
    Calibration,
    accuracy_of,
    calibrate,
    reduced_inputs,
)
from pbrdf.instruments.calibration.cell_means import CellMeans, cell_means_of_frames
from pbrdf.instruments.calibration.input_table import InputTable
from pbrdf.instruments.calibration.settings_calibration import ModelCalibration, calibrate_model
from pbrdf.instruments.frames.frames import Frames
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter
from pbrdf.instruments.polarimeter.stokes_solution import solve_stokes
from pbrdf.instruments.reduction.regions import Region

__all__ = ["InstrumentCalibration", "calibrate_instrument"]

#: A residual of more than this share of the mean reading is no error of an instrument.
_CONTRADICTION = 0.1
#: Analyser vectors further than this share of w_I from the nominal ones are probably those of another instrument.
_OTHER_INSTRUMENT = 0.3
#: An instrument turned by less, radians, is no reason for a word.
_WORTH_A_WORD = np.deg2rad(0.3)
#: Bytes that a map may take while it is calibrated.
_MOST_MEMORY = 4e9


@dataclass(frozen=True, eq=False)
class InstrumentCalibration:
    """A calibrated instrument beside the nominal one.

    Attributes
    ----------
    instrument
        To reduce with. Its accuracy is that at the inputs held out with the uncertainty of the light itself
        (:attr:`.InputTable.accuracy`) added in squares.
        Its analyser vectors have the mean transmittance of the nominal ones (fitted settings: of the
        settings), so that Stokes parameters stay in digital numbers.
    nominal
        What it was taken for, with as many cells as the calibration.
    calibration
        In the same units: `inputs` and `calibration.found` are in digital numbers.
    inputs
        The known light, in digital numbers.
    readings
        What was read.
    nominal_found
        Stokes vectors that the nominal instrument finds, shape (4, K, ...).
    nominal_accuracy
        Its errors at the same inputs as `calibration.accuracy`; None without any.
    level
        Digital numbers of the intensity 1 of the table.
    """

    instrument: Instrument
    nominal: Polarimeter
    calibration: Calibration | ModelCalibration
    inputs: InputTable
    readings: CellMeans
    nominal_found: np.ndarray
    nominal_accuracy: Accuracy | None
    level: float

    @property
    def warnings(self) -> list[str]:
        """What a user should know before using the instrument, one sentence each."""
        found, S = self.calibration, self.inputs.stokes[:, list(self.calibration.held_out)]
        said = []
        if found.residual > _CONTRADICTION:
            said.append(
                f"the readings contradict the table of inputs by {100 * found.residual:.0f} % of their mean: are "
                "series mixed up?"
            )
        elif self.difference.max() > _OTHER_INSTRUMENT:
            said.append(
                f"the analyser vectors are {100 * self.difference.max():.0f} % of w_I away from the nominal ones: is "
                "the order of the states right, are angles counted from x towards y, and left and right not exchanged?"
            )
        if found.accuracy is None:
            said.append(
                "no input could be held out: nothing verifies the calibration, and the nominal accuracy is kept"
            )
        elif self.instrument.polarimeter.determined[3] and not (abs(S[3]) > 0.5 * S[0]).any():
            said.append("no circular input was held out: the circular accuracy is that at light without V")
        turn = self.common_turn
        if not self.inputs.ratio_std.any() and abs(turn) > _WORTH_A_WORD:
            said.append(
                f"the instrument found is the nominal one turned by {math.degrees(turn):.2g}°: its own axes, or the "
                "zero of the polariser before it? An error that all inputs share is not in the accuracy (1° makes "
                "2.5 % of Q and U): state how well the light is known in a column angle_std_deg"
            )
        return said

    @property
    def noise(self) -> tuple[float, float]:
        """Rms errors that the noise of the readings alone makes, linear and circular; NaN where nothing is known.

        Much for single pixels: there it hides how accurate the calibration is.
        """
        out = [k for k in self.calibration.held_out if self.inputs.stokes[0, k] > 0.0]
        S = self.inputs.stokes
        squares = []
        for k in out:
            _, covariance = solve_stokes(
                np.maximum(self.readings.intensities[:, k], 0.0),
                self.readings.variance[:, k],
                self.instrument.polarimeter.analyzer,
                weighted=False,
            )
            # of Q/I, U/I and V/I: those of Q, U and V and of I, which they share
            slopes = np.concatenate([-S[1:, k : k + 1] / S[0, k], np.eye(3)], axis=1) / S[0, k]
            known = np.isfinite(covariance[0, 0])
            squares.append(
                np.einsum("ia,ab...,ib->i...", slopes, np.nan_to_num(covariance), slopes)[:, known]
            )
        if not squares:
            return (np.nan, np.nan)
        mean = np.concatenate([s.reshape(3, -1) for s in squares], axis=1).mean(axis=1)
        circular = float(np.sqrt(mean[2])) if self.instrument.polarimeter.determined[3] else np.nan
        return float(np.sqrt(mean[:2].mean())), circular

    @property
    def difference(self) -> np.ndarray:
        """Rms difference of analyser vectors and nominal ones: w_I, w_Q and w_U together, w_V, over the mean w_I."""
        nominal = self.nominal.analyzer
        apart = (self.instrument.polarimeter.analyzer - nominal) / nominal[..., 0].mean()
        return np.array([np.sqrt(np.mean(apart[..., part] ** 2)) for part in ([0], [1, 2], [3])])

    @property
    def common_turn(self) -> float:
        """Radians by which the instrument found is the nominal one turned about its axis; 0 if it is not just turned.

        Inputs whose zero is off by an angle make such an instrument, and so does one that is mounted so.
        """
        nominal, found = (p.mean_analyzer[:, 1:3] for p in (self.nominal, self.instrument.polarimeter))
        before, after = (w[:, 0] + 1j * w[:, 1] for w in (nominal, found))
        overlap = np.vdot(before, after)
        turned = before * np.exp(1j * np.angle(overlap))
        rest, apart = np.linalg.norm(after - turned), np.linalg.norm(after - before)
        return float(0.5 * np.angle(overlap)) if rest < 0.25 * apart else 0.0


def calibrate_instrument(
    frames: Frames,
    instrument: Instrument,
    inputs: InputTable,
    *,
    held_out: Sequence[str] | Literal["each"] = "each",
    cells: tuple[int, int] | None = (1, 1),
    components: str | None = None,
    parametric: bool = False,
    gain: Literal["common", "each"] = "common",
    fixed: Sequence[str] = ("analyzer",),
    regions: Sequence[Region] = (),
    dark_level: float = 0.0,
    progress: Callable[[int, int], None] | None = None,
) -> InstrumentCalibration:
    """Calibrate an instrument with frames of known light.

    Parameters
    ----------
    frames, instrument
        What was read, and the nominal instrument.
    inputs
        The light of each series, in any order.
    held_out
        Series that only verify; or ``"each"``: each in turn.
    cells
        Rows and columns of cells that the field is divided into; None: each pixel.
    components
        ``"IQUV"`` or ``"IQU"``; by default what the nominal instrument measures.
    parametric
        Fit the settings of the nominal instrument
        (:func:`~pbrdf.instruments.calibration.settings_calibration.calibrate_model`) instead of its analyser
        vectors. A black level that the inputs tell goes into the detector's offset.
    gain, fixed
        Of such a fit.
    regions, dark_level, progress
        See :func:`pbrdf.instruments.calibration.cell_means.cell_means_of_frames`.

    Raises
    ------
    DataError
        If frames, instrument and inputs do not fit each other, or the inputs do not determine the instrument.
    FitError
        If the fit of the settings does not converge.
    """
    filters = instrument.polarimeter.filters
    if filters is not None and (filters.only is None or len(filters.places[filters.only]) > 1):
        raise DataError(
            f"{instrument.polarimeter.name}: each colour is calibrated for itself, since each sees light through other "
            'polarisers: set color = "R" in [polarimeter], then the others (greens = "apart" gives G1 and G2)'
        )
    table = inputs.rows(frames.names)
    out: Sequence[int] | Literal["each"] = "each"
    if not isinstance(held_out, str):
        unknown = [name for name in held_out if name not in frames.names]
        if unknown:
            raise DataError(
                f"held out: there is no series {unknown[0]!r}; there are {', '.join(frames.names)}"
            )
        out = [frames.names.index(name) for name in held_out]
    if parametric and cells != (1, 1):
        raise DataError("settings are fitted for the whole field of view, not for a map")
    polarimeter = instrument.polarimeter
    if components is None:
        components = "IQUV" if polarimeter.determined[3] else "IQU"
    shape = (frames.rows, frames.columns) if cells is None else cells
    _require_memory(shape, polarimeter.size, len(table.names))
    instrument = _with_flat_transmittance(instrument)
    readings = cell_means_of_frames(
        frames,
        instrument,
        table.stokes[0] > 0.0,
        cells=cells,
        regions=regions,
        dark_level=dark_level,
        progress=progress,
    )
    read = readings.intensities
    nominal = _in_cells(polarimeter, shape)
    through = nominal.analyzer[..., 0].mean()
    mean = read if read.ndim == 2 else np.nanmean(read, axis=(2, 3))
    first = calibrate(mean, table.stokes, held_out=() if out == "each" else out, components=components)
    level = float(first.polarimeter.analyzer[:, 0].mean() / through)
    if not level > 0.0:
        raise DataError(
            "the frames do not grow brighter with the light of the inputs: are the series mixed up?"
        )
    found: Calibration | ModelCalibration
    detector, S = instrument.detector, table.stokes * level
    if parametric:
        found, S, offset = _fitted(nominal, read, S, gain, fixed, out, instrument)
        level = float(S[0].max() / table.stokes[0].max())
        detector = replace(detector, offset=detector.offset + offset)
        read = read - offset
    else:
        found = calibrate(
            read,
            S,
            held_out=out,
            components=components,
            states=polarimeter.states,
            name=f"{polarimeter.name}, calibrated",
            mosaic=polarimeter.mosaic,
        )
    made = found.polarimeter
    made = replace(made, filters=filters)
    shown = polarimeter.accuracy if found.accuracy is None else made.accuracy
    known = table.accuracy
    made = made.with_accuracy(
        math.hypot(shown[0], known[0]), math.hypot(shown[1], known[1] * made.determined[3])
    )
    seen = np.stack([reduced_inputs(nominal.analyzer, read[:, k]) for k in range(S.shape[1])], axis=1)
    return InstrumentCalibration(
        instrument=replace(instrument, polarimeter=made, detector=detector),
        nominal=nominal,
        calibration=found,
        inputs=InputTable(table.names, S, table.ratio_std),
        readings=readings,
        nominal_found=seen,
        nominal_accuracy=accuracy_of(seen, S, found.held_out),
        level=level,
    )


def _fitted(
    nominal: Polarimeter,
    read: np.ndarray,
    S: np.ndarray,
    gain: Literal["common", "each"],
    fixed: Sequence[str],
    out: Any,
    instrument: Instrument,
) -> tuple[ModelCalibration, np.ndarray, float]:
    """Fitted settings with a gain of 1, the inputs in its unit, and the black level above that of the instrument."""
    # a dark frame, where there is one, is the black level
    held = (*fixed, "offset") if "dark_frame" in instrument.frames else tuple(fixed)
    only = () if out == "each" else out
    made = calibrate_model(nominal, read, S, gain=gain, fixed=held, held_out=only)
    if instrument.detector.offset + made.value("offset") < 0.0:
        held = (*held, "offset")
        made = calibrate_model(nominal, read, S, gain=gain, fixed=held, held_out=only)
    if gain == "common":
        # the unit of the inputs in which the settings alone are the analyser vectors
        S = S * made.value("gain")
    made = calibrate_model(nominal, read, S, gain=gain, fixed=held, held_out=out)
    if gain == "common":
        exact = made.polarimeter.analyzer / made.value("gain")
        made = replace(made, polarimeter=replace(made.polarimeter, analyzer=exact))
    return made, S, made.value("offset")


def _in_cells(polarimeter: Polarimeter, shape: tuple[int, int]) -> Polarimeter:
    """The nominal instrument with one set of analyser vectors, or a map of these cells."""
    if shape == (1, 1):
        return replace(polarimeter, analyzer=polarimeter.mean_analyzer)
    if polarimeter.is_map:
        return replace(polarimeter, analyzer=polarimeter.spread(*shape))
    return replace(polarimeter, analyzer=np.tile(polarimeter.analyzer, (*shape, 1, 1)))


def _with_flat_transmittance(instrument: Instrument) -> Instrument:
    """A mosaic's flat field divides by the transmittance of the states: that which the calibration rests on is kept."""
    frames, polarimeter = instrument.frames, instrument.polarimeter
    if polarimeter.mosaic is None or "flat_field" not in frames or "flat_transmittance" in frames:
        return instrument
    through = polarimeter.mean_analyzer[:, 0]
    return replace(instrument, frames={**frames, "flat_transmittance": through.tolist()})


def _require_memory(shape: tuple[int, int], states: int, inputs: int) -> None:
    need = 8.0 * shape[0] * shape[1] * (3 * states * inputs + 8 * inputs + 60 * states)
    if need > _MOST_MEMORY:
        raise DataError(
            f"a map of {shape[0]} × {shape[1]} cells takes about {need / 1e9:.0f} GB while it is calibrated: divide "
            "the field into fewer cells"
        )
