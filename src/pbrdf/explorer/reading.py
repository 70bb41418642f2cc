"""States that come from an address or a file: checked and completed before the page shows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pbrdf.errors import PbrdfError
from pbrdf.explorer.session import Emit
from pbrdf.explorer.state import read_state
from pbrdf.explorer.workspace import Workspace

__all__ = ["answer"]


def answer(request: Mapping[str, Any], buffers: Sequence[Any], workspace: Workspace, emit: Emit) -> None:
    """Answer with the ``state``, complete.

    Raises
    ------
    PbrdfError
        If it cannot be shown; says where it came ``from``.
    """
    try:
        state = read_state(request.get("state")).to_dict()
    except PbrdfError as error:
        raise PbrdfError(f"{str(request.get('from', 'the state'))[:200]}: {error}") from None
    emit({"type": "read_state", "id": request.get("id"), "state": state}, [])
