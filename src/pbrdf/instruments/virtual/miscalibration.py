"""A real instrument for simulations: its analyser vectors are not quite those it is calibrated with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrdf.instruments.polarimeter.polarimeter import Polarimeter

__all__ = ["miscalibrated"]


def miscalibrated(
    polarimeter: Polarimeter, linear: float, circular: float, rng: np.random.Generator
) -> Polarimeter:
    """An instrument that, reduced as if it were `polarimeter`, reads polarised light wrong by the stated accuracy.

    Its analyser vectors are W (1 + E): the reduction with W gives (1 + E) S. The elements of E in the rows of Q and U
    are normal with the standard deviation linear/√2, in the row of V circular/√2, in the row of I 0. For fully
    polarised light the rms errors of Q/I, U/I and the degree of linear polarisation are then `linear`, and that of V/I
    is `circular`; for natural light they are smaller by √2.

    Parameters
    ----------
    polarimeter
        What the instrument is taken for.
    linear, circular
        Relative to the intensity, for example 0.01 and 0.05.
    rng
        Draws the errors; each call is another instrument.

    Returns
    -------
    Polarimeter
        The instrument as it is. Its errors are the same all over the field of view.
    """
    errors = rng.standard_normal((4, 4)) * (np.array([0.0, linear, linear, circular]) / np.sqrt(2.0))[:, None]
    return replace(
        polarimeter,
        analyzer=polarimeter.analyzer @ (np.eye(4) + errors),
        name=f"{polarimeter.name}, as it really is",
        accuracy=(0.0, 0.0),
        details={**polarimeter.details, "miscalibrated": [float(linear), float(circular)]},
    )
