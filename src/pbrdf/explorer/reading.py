"""States and models that come from an address or a file: checked and completed before the page shows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pbrdf.errors import PbrdfError
from pbrdf.explorer.session import Emit
from pbrdf.explorer.state import read_layer, read_state
from pbrdf.explorer.workspace import Workspace

__all__ = ["answer"]


def answer(request: Mapping[str, Any], buffers: Sequence[Any], workspace: Workspace, emit: Emit) -> None:
    """Answer with the whole ``state``, or with the ``layer`` of the request's ``model``.

    Raises
    ------
    PbrdfError
        If they cannot be shown; says where they came from.
    """
    try:
        if "model" in request:
            content = {"layer": read_layer(request["model"], "model").to_dict()}
        else:
            content = {"state": read_state(request.get("state")).to_dict()}
    except PbrdfError as error:
        raise PbrdfError(f"{str(request.get('from', 'the state'))[:200]}: {error}") from None
    emit({"type": "read_state", "id": request.get("id"), **content}, [])
