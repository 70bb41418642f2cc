"""Measured points with what a fit made of them, as the figures draw them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.report.dataset.points import Points, dolp_uncertainty, error_correlation, ratio_dolp
from pbrdf.report.dataset.quantities import Channel, polarised_quantities

if TYPE_CHECKING:
    from pbrdf.report.fit.subject import Report

__all__ = ["FittedPoints"]


@dataclass(frozen=True)
class FittedPoints:
    """What was measured, and the fitted model there.

    Attributes
    ----------
    measured
        The points.
    modelled
        Values of the model, shape (G,), by the name of the channel as in :attr:`Points.channels` and
        :attr:`Points.polarised`.
    held_out
        Whether the fit left the point out, shape (G,).
    diffuse
        Whether a stepwise fit used the point for its diffuse step, shape (G,); None without such a step.
    """

    measured: Points
    modelled: Mapping[str, np.ndarray]
    held_out: np.ndarray
    diffuse: np.ndarray | None = None

    @classmethod
    def from_report(cls, report: Report) -> FittedPoints:
        """The points of a fit."""
        comparison = report.result.comparison
        bare = Points.from_dataset(report.dataset)
        nothing = np.full(bare.theta_i.shape, np.nan)

        # Noise that the fit had to assume is no uncertainty of the measurement: no bars are drawn of it.
        stated = report.result.std_known or report.settings.get("noise") is not None

        def column(name: str) -> np.ndarray:
            known = name in comparison and (stated or not name.endswith("_std"))
            return comparison[name].values if known else nothing

        dolp = None
        if bare.dolp is not None:
            std = column("dolp_std")
            ratios = ("Q_over_I", "U_over_I", "m10_over_m00", "m20_over_m00")
            entries = {n: (column(f"{n}_measured"), column(f"{n}_std")) for n in ratios}
            if "dolp_std" not in comparison and (ratio := ratio_dolp(entries)) is not None:
                std = ratio.std
            elif "dolp_std" not in comparison and "I_std" in comparison:
                q, u = ("Q", "U") if "Q_std" in comparison else ("m10", "m20")
                std = dolp_uncertainty(
                    *(column(f"{name}_measured") for name in ("I", q, u)),
                    *(column(f"{name}_std") for name in ("I", q, u)),
                    correlation=None
                    if report.result.data.correlation is None
                    else error_correlation(report.dataset),
                )
            # where the angle was measured too, the fit has Q/I and U/I for it
            compared = column("dolp_measured")
            dolp = Channel(np.where(np.isnan(compared), bare.dolp.measured, compared), std)
        names = [str(n).removesuffix("_measured") for n in comparison if str(n).endswith("_measured")]
        polarised = polarised_quantities(
            {name: column(f"{name}_measured") for name in names},
            {name: column(f"{name}_std") for name in names},
        )
        modelled = polarised_quantities({name: column(f"{name}_modelled") for name in names})
        return cls(
            measured=replace(
                bare,
                intensity=Channel(column("I_measured"), column("I_std")),
                dolp=dolp,
                polarised=polarised,
            ),
            modelled={
                "intensity": column("I_modelled"),
                "dolp": column("dolp_modelled"),
                **{name: modelled[name].measured for name in polarised},
            },
            held_out=comparison["held_out"].values,
            diffuse=comparison["used_for_diffuse"].values if "used_for_diffuse" in comparison else None,
        )
