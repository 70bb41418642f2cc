"""The program of the process that fits for a page: jobs come in by its standard input, what it finds goes out.

It ends by itself when its input does, so when the server ends, however that happens.
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import sys
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.inversion.result import FitResult
    from pbrdf.models.base import Model

__all__ = ["found_by", "main"]

#: Steps of politeness: the sliders go first.
_NICE = 10
_OWN = "define a model of your own in a module that can be imported"


def found_by(job: dict[str, Any], tell: Callable[[dict[str, Any]], None]) -> dict[str, Any]:
    """Fit, and describe what was found as plain JSON.

    Parameters
    ----------
    job
        ``dataset``, ``model``, ``starts`` and other arguments of :func:`pbrdf.fit`.
    tell
        Told how far it is: starts that are done, of how many, and χ² of the model that it begins from.
    """
    from pbrdf.inversion.fit import fit

    arguments = dict(job)
    dataset, model = (arguments.pop(name) for name in ("dataset", "model"))
    here = _chi2(dataset, model, arguments)

    def progress(done: int, of: int) -> None:
        tell({"kind": "progress", "done": done, "of": of, "chi2": here})

    progress(0, arguments["starts"])
    return {**_described(fit(dataset, model, progress=progress, **arguments)), "chi2_before": here}


def _chi2(dataset: xr.Dataset, model: Model, arguments: dict[str, Any]) -> float | None:
    """χ² of the model as it is, of the points that are not held out."""
    import numpy as np

    from pbrdf.inversion.observations import Observations
    from pbrdf.inversion.problem import predict
    from pbrdf.inversion.unknowns import space_of

    data = Observations.from_dataset(dataset)
    if arguments["hold_out"] is not None:
        data = data.subset(~arguments["hold_out"].mask(dataset))
    fix, free = arguments["fix"], arguments["free"]
    space, begin = space_of(model, {}, fix, free, {}, {}, data)
    modelled = predict(
        space, space.to_unknowns(np.array([begin[p.name] for p in space.free])), data, data.channels
    )
    off = np.stack([modelled[name] for name in data.channels]) - data.values
    chi2 = float((np.einsum("ijg,jg->ig", data.whitening, off) ** 2).sum())
    return chi2 if np.isfinite(chi2) else None


def _described(result: FitResult) -> dict[str, Any]:
    from pbrdf.report.numbers import plain, with_error

    good = result.goodness
    described = {
        "kind": "found",
        "values": result.model.values,
        "settled": result.settled,
        "estimates": [
            {
                "name": name,
                "symbol": e.parameter.symbol,
                "unit": e.parameter.unit,
                "value": e.value,
                "std": e.std,
                "written": with_error(e.value, e.std),
                "verdict": e.verdict,
            }
            for name, e in result.estimates.items()
        ],
        "correlation": {
            "names": [str(name) for name in result.correlation["parameter"].values],
            "matrix": result.correlation.values,
        },
        "chi2": good.chi2,
        "reduced_chi2": good.reduced_chi2,
        "freedom": good.data - good.free,
        "count": good.data,
        "noise": result.noise,
        "verdict": result.verdict().sentence,
        "notes": result.notes,
        "starts": result.starts,
        "converged": result.converged,
        "optima": len(result.optima),
        "seconds": result.seconds,
        "held_out": None if result.hold_out is None else str(result.hold_out),
        "predicted": _errors(result, "predicted"),
        "fitted": _errors(result, "fitted"),
    }
    return plain(described)  # type: ignore[return-value]


def _errors(result: FitResult, kind: str) -> dict[str, Any] | None:
    found = getattr(result, kind).get("all")
    if found is None:
        return None
    return {
        "count": found.count,
        "intensity": found.intensity_median,
        "dolp": found.dolp_rms,
        "ratio": found.ratio_rms,
    }


def main() -> None:
    """Work off jobs until the input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C in the terminal is the server's
    if hasattr(os, "nice"):
        os.nice(_NICE)
    # what libraries print goes to the terminal, not among the answers
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)

    def tell(message: dict[str, Any]) -> None:
        pickle.dump(message, answers)
        answers.flush()

    jobs: queue.Queue[bytes] = queue.Queue()
    threading.Thread(target=_listen, args=(jobs,), daemon=True).start()
    import xarray  # noqa: F401

    import pbrdf.inversion.fit
    import pbrdf.report.numbers  # noqa: F401
    from pbrdf.errors import PbrdfError

    while True:
        content = jobs.get()
        try:
            # here, and not where it is heard: two threads that import the same modules may wait for each other
            job = pickle.loads(content)
        except (AttributeError, ImportError) as error:
            tell(
                {"kind": "error", "text": f"the process that fits does not know this model ({error}): {_OWN}"}
            )
            continue
        try:
            tell(found_by(job, tell))
        except PbrdfError as error:
            tell({"kind": "error", "text": str(error)})
        except Exception:
            import traceback

            traceback.print_exc()
            tell({"kind": "error", "text": "an error of the fit; the terminal says more"})


def _listen(jobs: queue.Queue[bytes]) -> None:
    try:
        while True:
            jobs.put(pickle.load(sys.stdin.buffer))
    finally:
        os._exit(0)


if __name__ == "__main__":
    main()
