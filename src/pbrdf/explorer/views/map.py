"""A map of parameters or of materials: what can be chosen of it, and what it says of a pixel.

The picture itself is asked for apart (:mod:`pbrdf.explorer.maps`), by a page that does not have it yet: it stays as it
is while models move.
"""

from __future__ import annotations

from typing import Any

from pbrdf.explorer.state import State
from pbrdf.explorer.workspace import Workspace

__all__ = ["draw"]


def draw(state: State, workspace: Workspace, dragging: bool) -> tuple[dict[str, Any], list[memoryview]]:
    """The open maps, what is chosen of one, and the chosen pixel; no buffers.

    Raises
    ------
    StateError
        If the settings name what is not there.
    """
    # a page without maps does not wait for what they need
    from pbrdf.explorer.map_pixels import data_in_words
    from pbrdf.explorer.maps import chosen_map, variables_of

    maps = [name for name, _ in workspace.maps]
    chosen = chosen_map(state, workspace)
    if chosen is None:
        return {"maps": maps}, []
    sizes = chosen.dataset.sizes
    header = {
        "maps": maps,
        "name": chosen.name,
        "variables": [[v.name, v.group, v.text] for v in variables_of(chosen.dataset)],
        "variable": chosen.variable.name,
        "dims": list(chosen.dims),
        "size": list(chosen.size),
        "place": [[dim, index, sizes[dim]] for dim, index in chosen.place.items()],
        "region": list(chosen.region),
        "step": chosen.step,
        "key": chosen.key,
        "left": chosen.left,
        "has_models": chosen.is_of_parameters,
        "pixel": None,
        "no_data": data_in_words(chosen.name, workspace),
    }
    if chosen.pixel is not None:
        header["pixel"] = chosen.described_pixel(workspace)
    return header, []
