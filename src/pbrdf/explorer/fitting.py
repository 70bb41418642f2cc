"""Requests of the page for fits: from where the sliders stand, with the points that are switched on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pbrdf.explorer.fit_process import process_of
from pbrdf.explorer.points import chosen_data
from pbrdf.explorer.session import Emit
from pbrdf.explorer.state import State, StateError, read_state
from pbrdf.explorer.workspace import Workspace

__all__ = ["answer", "job_of"]

#: Starts of a fit: by default, and at most.
STARTS, MOST_STARTS = 16, 256
_PLACE = "settings.fit"


def answer(request: dict[str, Any], buffers: Any, workspace: Workspace, emit: Emit) -> None:
    """Begin the fit of ``{"type": "fit", "state": …}``, or end the one that is running at ``cancel_fit``.

    Answers ``fit_started``, then any number of ``fit_progress``, at last ``fitted``, ``fit_cancelled`` or an error.

    Raises
    ------
    StateError
        If there is nothing to fit or to cancel, or another fit is running.
    """
    number = request.get("id")
    process = process_of(workspace)
    if request["type"] == "cancel_fit":
        if not process.cancel():
            raise StateError(_PLACE, "no fit is running")
        return
    state = read_state(request.get("state"))
    job = job_of(state, workspace)
    fitted = {"layer": state.active, "name": state.shown.name, "model": state.shown.model.name}

    def tell(message: dict[str, Any]) -> None:
        kind = message.pop("kind")
        if kind == "error":
            emit({"type": "error", "id": number, "about": "fit", "place": _PLACE, **message}, [])
        elif kind == "found":
            emit({"type": "fitted", "id": number, **fitted, **message}, [])
        else:
            emit({"type": f"fit_{kind}", "id": number, **message}, [])

    if process.busy:
        raise StateError(_PLACE, "a fit is running: wait for it, or cancel it")
    emit({"type": "fit_started", "id": number}, [])
    process.start(job, tell)


def job_of(state: State, workspace: Workspace) -> dict[str, Any]:
    """Arguments of :func:`pbrdf.fit` that a state asks for.

    Raises
    ------
    StateError
        If it asks for no fit.
    """
    choice = chosen_data(state, workspace)
    if choice is None:
        raise StateError(_PLACE, "open measured data first: there is nothing to fit")
    settings = state.settings.get("fit", {})
    model = state.shown.model
    held, free = (_names(settings, key) for key in ("held", "free"))
    return {
        "dataset": choice.used,
        "model": model,
        "starts": _starts(settings),
        "fix": {p.name: model.values[p.name] for p in model.parameters if p.name in held},
        "free": [p.name for p in model.parameters if p.name in free and not p.fitted and p.name not in held],
        "hold_out": choice.held_out,
    }


def _starts(settings: Mapping[str, Any]) -> int:
    starts = settings.get("starts", STARTS)
    if isinstance(starts, bool) or not isinstance(starts, int) or not 1 <= starts <= MOST_STARTS:
        raise StateError(f"{_PLACE}.starts", f"the starts should be a whole number from 1 to {MOST_STARTS}")
    return starts


def _names(settings: Mapping[str, Any], key: str) -> Sequence[str]:
    """Parameters that are named; those of other models count when these are fitted."""
    names = settings.get(key, [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise StateError(f"{_PLACE}.{key}", "the parameters should be a list of names")
    return names
