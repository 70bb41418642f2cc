"""``pbrdf paints`` and ``pbrdf models``: what the package knows by name."""

from __future__ import annotations

import json

from pbrdf.cli.console import output_console
from pbrdf.cli.options import AsJson

__all__ = ["models", "paints"]

_SOURCE = "Zhang, Song, Zhao, Infrared and Laser Engineering 46(11), 1117002 (2017), Table 1"
_SCALE = "the amplitude a is on that paper's camera scale: these paints reflect more than they receive"


def paints(as_json: AsJson = False) -> None:
    """List the bundled paints: parameters of the double-Gauss model, and their source."""
    from rich.table import Table

    from pbrdf.data.paints import PAINTS, SCENE_ALBEDO, SCENE_PAINTS, WAVELENGTH, load_paint
    from pbrdf.models import DoubleGauss

    if as_json:
        content = {
            "source": _SOURCE,
            "wavelength_nm": WAVELENGTH,
            "note": _SCALE,
            "paints": {name: load_paint(name).to_dict() for name in PAINTS},
            "scene_albedo": SCENE_ALBEDO,
            "scene_paints": {name: load_paint(name).to_dict() for name in SCENE_PAINTS},
        }
        print(json.dumps(content, indent=2, ensure_ascii=False))
        return
    table = Table(box=None, pad_edge=False, title=None)
    table.add_column("paint")
    listed = [p for p in DoubleGauss.parameters if p.fitted]
    for p in listed:
        table.add_column(p.symbol, justify="right")
    for name in (*PAINTS, *SCENE_PAINTS):
        values = load_paint(name).values
        table.add_row(name, *(f"{values[p.name]:.4f}" for p in listed))
    console = output_console()
    console.print(table)
    console.print(f"\nModel double-gauss at {WAVELENGTH:g} nm. Source: {_SOURCE}; {_SCALE}.")
    console.print(
        f"For rendering, [bold]NAME-scene[/bold]: the same paint, with a such that it reflects "
        f"{100 * SCENE_ALBEDO:g} % under an even sky (a share of our choice); light from up to 85° is never sent back "
        "whole."
    )
    console.print(
        "Each name stands for the model in `pbrdf simulate`, `pbrdf plot` and `pbrdf render`; those of the paper also "
        "for a simulated measurement in `pbrdf fit` and `pbrdf check`."
    )


def models(as_json: AsJson = False) -> None:
    """List the models: their parameters with the bounds of a fit, and their options."""
    from pbrdf.models import MODELS
    from pbrdf.report.numbers import brief
    from pbrdf.report.printing import bare_table

    if as_json:
        content = {
            name: {
                "parameters": [
                    {
                        "name": p.name,
                        "unit": p.unit,
                        "description": p.description,
                        "lower": p.lower,
                        "upper": p.upper,
                        "default": p.default,
                        "fitted": p.fitted,
                    }
                    for p in model.parameters
                ],
                "options": {option: list(choices) for option, choices in model.options.items()},
            }
            for name, model in MODELS.items()
        }
        print(json.dumps(content, indent=2, ensure_ascii=False))
        return
    console = output_console()
    for name, model in MODELS.items():
        console.print(f"[bold]{name}[/bold]")
        table = bare_table()
        for title in ("  parameter", "meaning", "unit", "bounds of a fit", "if not fitted"):
            table.add_column(title)
        for p in model.parameters:
            fitted = f"{brief(p.lower)} … {brief(p.upper)}" + ("" if p.fitted else " with --free")
            table.add_row(f"  {p.name}", p.description, p.unit, fitted, brief(p.default))
        console.print(table)
        for option, choices in model.options.items():
            console.print(f"  --option {option}={'|'.join(choices)}", markup=False)
        console.print()
