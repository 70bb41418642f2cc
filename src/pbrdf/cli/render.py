"""``pbrdf render``: a painted scene as the picture of a polarisation camera."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pbrdf.cli.console import progress_bar, warn
from pbrdf.cli.options import NoProgressBar, model_argument, output_option, seed_option
from pbrdf.cli.values import number, require_folder_of
from pbrdf.errors import PbrdfError

if TYPE_CHECKING:
    from pbrdf.models import Model
    from pbrdf.rendering.picture import StokesPicture
    from pbrdf.rendering.polarized_lamp import LampPolarization

__all__ = ["render"]

_MOST_ACROSS = 16_384


def render(
    models: Annotated[
        list[str] | None,
        model_argument(
            "Models' JSON files, folders of fits, or bundled paints: one object each (on the fender: one piece)."
        ),
    ] = None,
    scene: Annotated[
        str, typer.Option(help="sphere, plate, fender, or a Mitsuba scene FILE.xml.")
    ] = "sphere",
    wavelength: Annotated[
        str | None,
        typer.Option(
            help="One in nm, or three for a picture in colour: each object then takes a model for each, in this order, "
            "or one fit with parameters of each wavelength.",
            metavar="NM[,NM,NM]",
        ),
    ] = None,
    albedo: Annotated[
        float | None,
        typer.Option(
            help="Scale each model to reflect this share of an even sky's light: for fits to a camera's counts.",
            show_default="the models' own amplitudes",
        ),
    ] = None,
    light: Annotated[
        str | None,
        typer.Option(help="point, area, sky, constant, or envmap:FILE.", show_default="sky"),
    ] = None,
    sun_zenith: Annotated[
        float | None,
        typer.Option(help="Zenith angle of the sun or the lamp.", show_default="by scene", min=0.0, max=88.0),
    ] = None,
    sun_azimuth: Annotated[
        float | None,
        typer.Option(
            help="Its azimuth: 0 on the right of the picture, 90 beyond the object, 270 behind the camera.",
            show_default="by scene",
            min=-360.0,
            max=360.0,
        ),
    ] = None,
    lamp_polarizer: Annotated[
        float | None,
        typer.Option(
            help="A polariser before the lamp, at this angle for who looks into it: 0 horizontal, counterclockwise.",
            metavar="ANGLE",
        ),
    ] = None,
    lamp_retarder: Annotated[
        str | None,
        typer.Option(
            help="A retarder behind that polariser: its fast axis, counted alike, and its retardance. -45,90 behind a "
            "polariser at 0: left circular.",
            metavar="ANGLE,RETARDANCE",
        ),
    ] = None,
    max_dolp: Annotated[
        float | None,
        typer.Option(help="DoLP of the sky at 90° from the sun.", show_default="0.8", min=0.0, max=1.0),
    ] = None,
    optical_depth: Annotated[
        float | None,
        typer.Option(help="Optical depth of the air that scatters.", show_default="0.2", min=0.0, max=10.0),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(
            help="Width and height in pixels.", metavar="WIDTHxHEIGHT", show_default="512x512, or the file's"
        ),
    ] = None,
    spp: Annotated[int, typer.Option(help="Samples per pixel.", min=1)] = 256,
    depth: Annotated[int, typer.Option(help="Reflections of a path at most, plus one; -1 for no limit.")] = 8,
    polarizer: Annotated[
        list[float] | None,
        typer.Option(
            help="Also the view through a polariser at this angle, 0 horizontal, counterclockwise (repeatable).",
            metavar="ANGLE",
        ),
    ] = None,
    seed: Annotated[int, seed_option("Seed of the samples.")] = 0,
    variant: Annotated[
        str, typer.Option(help="Polarised variant of Mitsuba, e.g. cuda_ad_mono_polarized.")
    ] = "llvm_ad_mono_polarized",
    output: Annotated[
        Path | None,
        output_option("A folder, or FILE.exr: then one figure beside it.", show_default="<scene>-render"),
    ] = None,
    quiet: NoProgressBar = False,
) -> None:
    """Render painted objects as a polarisation camera sees them: S0 … S3, DoLP and AoLP.

    A sphere under a clear sky: `pbrdf render white-scene`

    A fit to a camera's counts: `pbrdf render paint-fit --albedo 0.6`

    Two paints, seen through a polariser: `pbrdf render white-scene pearl-white-scene --scene plate --polarizer 90`

    In colour: `pbrdf render blue.json green.json red.json --wavelength 450,550,650`
    """
    from pbrdf.cli.wavelengths import painted_with
    from pbrdf.files.atomic import require_writable_folder

    sources = models or []
    own = not scene.endswith(".xml")
    if own and not sources:
        raise PbrdfError(
            "name at least one model to paint with: a JSON file, the folder of a fit, or a bundled paint"
        )
    shape = _size(size)
    named = {
        "--light": light,
        "--sun-zenith": sun_zenith,
        "--sun-azimuth": sun_azimuth,
        "--lamp-polarizer": lamp_polarizer,
        "--lamp-retarder": lamp_retarder,
        "--max-dolp": max_dolp,
        "--optical-depth": optical_depth,
    }
    given = [name for name, value in named.items() if value is not None]
    if not own and given:
        raise PbrdfError(f"{scene} brings its own lights: leave {given[0]} out")
    lamp = light or "sky"
    if lamp != "sky" and (max_dolp is not None or optical_depth is not None):
        raise PbrdfError(f"--{'max-dolp' if max_dolp is not None else 'optical-depth'} is for --light sky")
    if not _has_direction(lamp) and (sun_zenith is not None or sun_azimuth is not None):
        raise PbrdfError(f"--light {lamp} has no direction: leave --sun-zenith and --sun-azimuth out")
    before_lamp = _before_lamp(lamp, lamp_polarizer, lamp_retarder)
    for angle in polarizer or ():
        if not math.isfinite(angle):
            raise PbrdfError("--polarizer: give an angle in degrees")
    colours = _wavelengths(wavelength)
    target = output or Path(f"{Path(scene).stem}-render")
    if target.suffix.lower() != ".exr":
        require_writable_folder(target)
    elif len(colours) > 1:
        raise PbrdfError(f"--output {target}: a picture in colour is several files; give a folder")
    else:
        require_folder_of(target)
    # of each object, and in that of each wavelength
    painted = painted_with(sources, colours)
    if albedo is not None:
        from pbrdf.models.reflectance import with_albedo

        if len(colours) > 1:
            raise PbrdfError("--albedo would make every colour alike: leave it or --wavelength out")
        painted = [(source, [with_albedo(model, albedo) for model in its]) for source, its in painted]
    for source, models_of_one in painted:
        for model in models_of_one:
            _warn_of_gain(source, model)

    from pbrdf.rendering import bsdf_dict
    from pbrdf.rendering.render import render_stokes
    from pbrdf.rendering.scenes import load_scene_file
    from pbrdf.rendering.variant import start_mitsuba

    mitsuba = start_mitsuba(variant)
    # what it warns of (a film's format, say) is settled by this command
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    title = ", ".join(Path(source).name for source in sources) or Path(scene).name
    notes = {"models": title, "scene": scene, "light": lamp if own else "of the scene", "variant": variant}
    if before_lamp is not None:
        notes["before the lamp"] = str(before_lamp)
    pictures: list[StokesPicture] = []
    for place, nm in enumerate(colours):
        coats = [bsdf_dict(models_of_one[place]) for _, models_of_one in painted]
        if own:
            air = {"max_dolp": max_dolp, "optical_depth": optical_depth}
            stage = _stage(
                scene, coats, lamp, before_lamp, shape or (512, 512), sun_zenith, sun_azimuth, air, nm
            )
        else:
            stage = load_scene_file(Path(scene), coats, shape)
        at = "" if nm is None else f" at {nm:g} nm"
        with progress_bar(f"Rendering {scene}{at}", quiet) as progress:
            picture = render_stokes(stage, spp=spp, depth=depth, seed=seed, progress=progress)
        stated: dict[str, float] = {} if nm is None else {"wavelength": nm}
        pictures.append(replace(picture, attrs={**picture.attrs, **notes, **stated}))
    angles = [math.radians(a) for a in polarizer or ()]
    if len(pictures) > 1:
        written = _write_colours(pictures, target, title, angles)
    else:
        written = _write(pictures[0], target, title, angles)
    for picture in pictures:
        _tell(picture)
    for path in written:
        print(path)


def _has_direction(light: str) -> bool:
    """Whether a light of this name comes from somewhere."""
    return light != "constant" and not light.startswith("envmap:")


def _before_lamp(light: str, polarizer: float | None, retarder: str | None) -> LampPolarization | None:
    """What stands before the lamp."""
    from pbrdf.rendering.lights import LAMPS
    from pbrdf.rendering.polarized_lamp import LampPolarization

    if polarizer is None:
        if retarder is not None:
            raise PbrdfError("--lamp-retarder: it does nothing to natural light; give --lamp-polarizer too")
        return None
    if light not in LAMPS:
        raise PbrdfError(f"--lamp-polarizer is for --light {' or '.join(LAMPS)}")
    if not math.isfinite(polarizer):
        raise PbrdfError("--lamp-polarizer: give an angle in degrees")
    angles = [] if retarder is None else [number(part, "--lamp-retarder") for part in retarder.split(",")]
    if len(angles) not in (0, 2):
        raise PbrdfError(
            f"--lamp-retarder {retarder}: give the angle of its fast axis and its retardance, for example -45,90"
        )
    return LampPolarization(math.radians(polarizer), *map(math.radians, angles))


def _wavelengths(text: str | None) -> list[float | None]:
    """Those of the pictures to render; one without a wavelength if none is given."""
    if text is None:
        return [None]
    found = [number(part, "--wavelength") for part in text.split(",")]
    if len(found) not in (1, 3) or min(found) <= 0.0 or len(set(found)) != len(found):
        raise PbrdfError(
            f"--wavelength {text}: give one in nm, or three different ones, for example 450,550,650"
        )
    return list(found)


def _size(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    match = re.fullmatch(r"\s*([0-9]{1,6})\s*[xX×]\s*([0-9]{1,6})\s*", text)
    if match is None:
        raise PbrdfError(f"--size {text!r}: give WIDTHxHEIGHT, for example 512x512")
    width, height = int(match[1]), int(match[2])
    if not (1 <= width <= _MOST_ACROSS and 1 <= height <= _MOST_ACROSS):
        raise PbrdfError(f"--size {text}: width and height go from 1 to {_MOST_ACROSS}")
    return width, height


def _warn_of_gain(source: str, model: Model) -> None:
    """Say so if a paint gives off more light than it gets: its amplitude is on a camera's scale, not on a BRDF's."""
    import numpy as np

    from pbrdf.cli.sources import is_paint
    from pbrdf.models.reflectance import directional_hemispherical_reflectance

    if any(np.ndim(value) for value in model.values.values()):
        return
    reflectance = float(directional_hemispherical_reflectance(model, math.radians(30.0)))
    if reflectance > 1.0:
        warn(
            f"{source} reflects {reflectance:.2f} of the light it gets: its amplitude a is on the scale of the camera "
            "that measured it; "
            + (f"render {source}-scene, or " if is_paint(source) else "")
            + "give --albedo, or compare no brightness with other things in the scene"
        )


def _stage(
    scene: str,
    coats: Sequence[Any],
    light: str,
    before_lamp: LampPolarization | None,
    size: tuple[int, int],
    zenith: float | None,
    azimuth: float | None,
    air: dict[str, float | None],
    wavelength: float | None,
) -> Any:
    """A scene of the project's own; the optical depth is that at 550 nm, λ⁻⁴ as of air (Rayleigh) elsewhere."""
    from pbrdf.rendering.scenes import make_scene, subject
    from pbrdf.rendering.sky import Sky

    what = subject(scene, coats, size[0] / size[1])
    direction = (
        what.light[0] if zenith is None else math.radians(zenith),
        what.light[1] if azimuth is None else math.radians(azimuth),
    )
    sky = Sky(*direction, **{name: value for name, value in air.items() if value is not None})
    if wavelength is not None:
        sky = replace(sky, optical_depth=sky.optical_depth * (550.0 / wavelength) ** 4)
    return make_scene(what, light, size, direction=direction, sky=sky, polarization=before_lamp)


def _write(picture: StokesPicture, target: Path, title: str, polarizers: list[float]) -> list[Path]:
    """Write the picture's files; returns them."""
    from pbrdf.files.atomic import atomic_folder
    from pbrdf.rendering.picture import polarizer_name, write_exr
    from pbrdf.report.rendering.figure import channel_figure, polarizer_figure, stokes_figure
    from pbrdf.report.style import save_figure

    if target.suffix.lower() == ".exr":
        write_exr(picture, target, polarizers)
        figure = target.with_suffix(".png")
        save_figure(stokes_figure(picture, title), figure)
        return [target, figure]
    figures = {"stokes": stokes_figure(picture, title)}
    figures |= {name: channel_figure(picture, name, title) for name in ("s0", "dolp", "aolp")}
    figures |= {polarizer_name(angle): polarizer_figure(picture, angle, title) for angle in polarizers}
    with atomic_folder(target, fill=True) as folder:
        write_exr(picture, folder / "stokes.exr", polarizers)
        for name, drawn in figures.items():
            save_figure(drawn, folder / f"{name}.png")
    return [target / name for name in ("stokes.exr", *(f"{name}.png" for name in figures))]


def _write_colours(
    pictures: Sequence[StokesPicture], target: Path, title: str, polarizers: list[float]
) -> list[Path]:
    """Write a file and a figure for each wavelength, and a picture in colour; returns them."""
    from pbrdf.files.atomic import atomic_folder
    from pbrdf.rendering.picture import write_exr
    from pbrdf.report.rendering.figure import colour_figure, stokes_figure
    from pbrdf.report.style import save_figure

    names = []
    with atomic_folder(target, fill=True) as folder:
        for picture in pictures:
            nm = f"{picture.attrs['wavelength']:g}"
            write_exr(picture, folder / f"stokes_{nm}.exr", polarizers)
            save_figure(stokes_figure(picture, f"{title}, {nm} nm"), folder / f"stokes_{nm}.png")
            names += [f"stokes_{nm}.exr", f"stokes_{nm}.png"]
        save_figure(colour_figure(pictures, title), folder / "rgb.png")
    return [target / name for name in (*names, "rgb.png")]


def _tell(picture: StokesPicture) -> None:
    """Warn of pixels without a number and say how noisy the picture is."""
    import numpy as np

    lost = int((~np.isfinite(picture.stokes[0])).sum())
    if lost:
        warn(f"{lost} pixels hold no number: a material of the scene has returned none")
    lit = picture.stokes[0] > 0.0
    if lit.any() and np.isfinite(picture.std).any():
        noise = float(np.median(picture.std[0][lit] / picture.stokes[0][lit]))
        print(f"Standard error of S0, median over the lit pixels: {100.0 * noise:.2g} %")
