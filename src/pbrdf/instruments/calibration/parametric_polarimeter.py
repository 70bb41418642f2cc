"""The settings of a polarimeter as a vector of unknowns, and what its analyser vectors do when they change."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.analyzer_chain import AnalyzerChain
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter
from pbrdf.optics.elements import axis_rate, diattenuator, retardance_rate, retarder

__all__ = ["ParametricPolarimeter"]


class ParametricPolarimeter:
    """A polarimeter as a function of its settings: a vector of these, and its analyser vectors with derivatives."""

    _describe: Callable[[np.ndarray], dict[str, Any]]

    def __init__(self, nominal: Polarimeter, gain: str, shared: bool, start_gain: float) -> None:
        self.nominal = nominal.details
        if "turned" in self.nominal or not nominal.is_described:
            raise DataError(
                f"{nominal.name} is not made by its settings: calibrate its analyser vectors instead, or start from "
                "one made by lcvr, rotating_retarder, rotating_polarizer or division_of_focal_plane"
            )
        if gain not in ("common", "each", "fixed"):
            raise DataError(f"gain is {gain!r}: use common, each or fixed")
        self.names: list[str] = []
        self._start: list[float] = []
        self._low: list[float] = []
        self._high: list[float] = []
        self.rank: list[int] = []
        self._angular: list[bool] = []
        self.states = nominal.size
        count = {"common": 1, "each": self.states, "fixed": 0}[gain]
        numbered = [f"gain {nominal.states[j]}" for j in range(count)] if gain == "each" else ["gain"] * count
        self._gains = [self._add(name, start_gain, 0, low=0.0) for name in numbered]
        self._model: Callable[[np.ndarray], tuple[np.ndarray, dict[int, np.ndarray]]] = getattr(
            self, f"_{self.nominal['kind']}"
        )(nominal, shared)
        self._offset = self._add("offset", 0.0, 6)
        self.start = np.array(self._start)
        self.low, self.high = np.array(self._low), np.array(self._high)
        self.angular = np.array(self._angular)
        self.by_offset = np.zeros(len(self.names))
        self.by_offset[self._offset] = 1.0

    def _add(
        self,
        name: str,
        start: float,
        rank: int,
        *,
        low: float = -np.inf,
        high: float = np.inf,
        angle: bool = False,
    ) -> int:
        self.names.append(name)
        self._start.append(float(np.deg2rad(start)) if angle else float(start))
        self._low.append(low)
        self._high.append(high)
        self.rank.append(rank)
        self._angular.append(angle)
        return len(self.names) - 1

    def reasons(self, fixed: Sequence[str]) -> dict[str, str]:
        """The settings that the caller fixes."""
        found: dict[str, str] = {}
        for name in fixed:
            same = [n for n in self.names if n == name or n.startswith(f"{name} ")]
            if not same and name != "analyzer":
                raise DataError(f"no setting is called {name!r}; the settings are {', '.join(self.names)}")
            found |= dict.fromkeys(same, "fixed")
        return found

    def evaluate(self, x: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
        """Analyser vectors (N, 4) with their gain, offset, derivatives of the vectors (P, N, 4)."""
        W, parts = self._model(x)
        gains = np.ones(self.states)
        if self._gains:
            gains = np.broadcast_to(x[self._gains], (self.states,))
        rates = np.zeros((len(x), self.states, 4))
        for i, rate in parts.items():
            rates[i] = gains[:, None] * rate
        for j, i in enumerate(self._gains):
            where = slice(None) if len(self._gains) == 1 else slice(j, j + 1)
            rates[i, where] = W[where]
        return gains[:, None] * W, float(x[self._offset]), rates

    def described(self, x: np.ndarray) -> dict[str, Any]:
        """The settings as :func:`~pbrdf.instruments.polarimeter.polarimeter.from_settings` takes them, where it can."""
        return {**self.nominal, **self._describe(x)}

    # One method for each kind: adds its settings, returns the model (W, derivatives by index of the setting)

    def _lcvr(self, nominal: Polarimeter, shared: bool) -> Callable[..., Any]:
        table = np.array(self.nominal["retardances"], dtype=float)
        index = np.empty(table.shape, dtype=int)
        for k in range(table.shape[1]):
            seen: dict[float, int] = {}
            for j, delta in enumerate(table[:, k]):
                label = (
                    f"retardance {k + 1} at {delta:g}"
                    if shared
                    else f"retardance {k + 1} of {nominal.states[j]}"
                )
                if not shared or delta not in seen:
                    seen[delta] = self._add(label, delta, 1, angle=True)
                index[j, k] = seen[delta]
        d = self._add("diattenuation", self.nominal["diattenuation"], 2, low=0.0, high=1.0)
        axes = [self._add(f"axis {k + 1}", a, 4, angle=True) for k, a in enumerate(self.nominal["axes"])]
        analyzer = self._add("analyzer", self.nominal["analyzer"], 5, angle=True)

        def model(x: np.ndarray) -> tuple[np.ndarray, dict[int, np.ndarray]]:
            delta = x[index]
            elements = [retarder(x[a], delta[:, k]) for k, a in enumerate(axes)]
            chain = AnalyzerChain(diattenuator(x[analyzer], x[d])[0], elements)
            rates = _analyzer_rates(chain, x, analyzer, d)
            for k, a in enumerate(axes):
                rates[a] = chain.element_rate(k, axis_rate(elements[k]))
                rate = chain.element_rate(k, retardance_rate(x[a], delta[:, k]))
                for i in set(index[:, k].tolist()):
                    rates[i] = np.where((index[:, k] == i)[:, None], rate, 0.0)
            return chain.vectors, rates

        self._describe = lambda x: {
            "retardances": np.rad2deg(x[index]).tolist(),
            "axes": np.rad2deg(x[axes]).tolist(),
            "analyzer": float(np.rad2deg(x[analyzer])),
            "diattenuation": float(x[d]),
        }
        return model

    def _rotating_retarder(self, nominal: Polarimeter, shared: bool) -> Callable[..., Any]:
        angles = np.deg2rad(self.nominal["angles"])
        delta = self._add("retardance", self.nominal["retardance"], 1, angle=True)
        d = self._add("diattenuation", self.nominal["diattenuation"], 2, low=0.0, high=1.0)
        zero = self._add("zero", 0.0, 4, angle=True)
        analyzer = self._add("analyzer", self.nominal["analyzer"], 5, angle=True)

        def model(x: np.ndarray) -> tuple[np.ndarray, dict[int, np.ndarray]]:
            element = retarder(angles + x[zero], x[delta])
            chain = AnalyzerChain(diattenuator(x[analyzer], x[d])[0], [element])
            rates = _analyzer_rates(chain, x, analyzer, d)
            rates[zero] = chain.element_rate(0, axis_rate(element))
            rates[delta] = chain.element_rate(0, retardance_rate(angles + x[zero], x[delta]))
            return chain.vectors, rates

        self._describe = lambda x: {
            "angles": np.rad2deg(angles + x[zero]).tolist(),
            "retardance": float(np.rad2deg(x[delta])),
            "analyzer": float(np.rad2deg(x[analyzer])),
            "diattenuation": float(x[d]),
        }
        return model

    def _rotating_polarizer(self, nominal: Polarimeter, shared: bool) -> Callable[..., Any]:
        angles = np.deg2rad(self.nominal["angles"])
        d = self._add("diattenuation", self.nominal["diattenuation"], 2, low=0.0, high=1.0)
        zero = self._add("zero", 0.0, 4, angle=True)

        def model(x: np.ndarray) -> tuple[np.ndarray, dict[int, np.ndarray]]:
            rows, by_angle, by_diattenuation = _polarizers(angles + x[zero], x[d])
            return rows, {zero: by_angle, d: by_diattenuation}

        self._describe = lambda x: {
            "angles": np.rad2deg(angles + x[zero]).tolist(),
            "diattenuation": float(x[d]),
        }
        return model

    def _division_of_focal_plane(self, nominal: Polarimeter, shared: bool) -> Callable[..., Any]:
        layout = np.array(self.nominal["layout"], dtype=float)
        own = [f"diattenuation {name}" for name in nominal.states]
        d = [self._add(name, self.nominal["diattenuation"], 2, low=0.0, high=1.0) for name in own]
        axes = [
            self._add(f"axis {name}", a, 4, angle=True)
            for name, a in zip(nominal.states, layout.ravel(), strict=True)
        ]

        def model(x: np.ndarray) -> tuple[np.ndarray, dict[int, np.ndarray]]:
            rows, by_angle, by_diattenuation = _polarizers(x[axes], x[d])
            rates = {}
            for j in range(len(axes)):
                only = (np.arange(len(axes)) == j)[:, None]
                rates[axes[j]], rates[d[j]] = only * by_angle, only * by_diattenuation
            return rows, rates

        self._describe = lambda x: {
            "layout": np.rad2deg(x[axes]).reshape(layout.shape).tolist(),
            "diattenuation": float(np.mean(x[d])),
        }
        return model


def _polarizers(angles: np.ndarray, diattenuation: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First rows of polarisers (N, 4), and their derivatives by angle and by diattenuation, which is linear."""
    matrix = diattenuator(angles, diattenuation)
    linear = 0.5 * (diattenuator(angles, 1.0) - diattenuator(angles, -1.0))
    return matrix[..., 0, :], axis_rate(matrix)[..., 0, :], linear[..., 0, :]


def _analyzer_rates(chain: AnalyzerChain, x: np.ndarray, analyzer: int, d: int) -> dict[int, np.ndarray]:
    _, by_angle, by_diattenuation = _polarizers(x[analyzer], x[d])
    return {analyzer: chain.row_rate(by_angle), d: chain.row_rate(by_diattenuation)}
