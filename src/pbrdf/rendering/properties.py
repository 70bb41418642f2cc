"""Properties of the BSDF plugin: from a scene description to a model and its textures, and back."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbrdf.data.paints import load_paint
from pbrdf.errors import ModelError
from pbrdf.models import MODELS, DoubleGauss, Model, load_model
from pbrdf.models.parameters import Parameter

__all__ = ["PLUGIN", "Paint", "bsdf_dict", "read_properties"]

#: Name of the plugin in scenes.
PLUGIN = "pbrdf"


class Paint(NamedTuple):
    """What a scene says of a painted surface.

    Attributes
    ----------
    model
        The model with its options; its values are those of the scene, an array of the least and the largest where
        a texture holds many.
    textures
        Mitsuba texture of every parameter by name; without those that vanish.
    """

    model: Model
    textures: dict[str, Any]


def bsdf_dict(model: Model) -> dict[str, Any]:
    """Describe a model as a dictionary for ``mitsuba.load_dict``, alone or as an entry of a scene.

    Parameters
    ----------
    model
        Any model. Numbers stay numbers; a two-dimensional array becomes a bitmap, its rows along v and its columns
        along u, for which a Mitsuba variant must be set. Options that are the model's default are left out.

    Raises
    ------
    ModelError
        If a parameter is an array of other than two dimensions.
    """
    described: dict[str, Any] = {"type": PLUGIN, "model": model.name}
    vanishing = [p.name for p in model.parameters if p.vanishing]
    for name, value in model.values.items():
        number = np.asarray(value, dtype=float)
        if name in vanishing and not number.any():
            continue
        if number.ndim == 0:
            described[name] = float(number)
        elif number.ndim == 2:
            described[name] = _bitmap(number)
        else:
            raise ModelError(
                f"{name} has the shape {number.shape}: a renderer takes numbers and maps of two dimensions"
            )
    for option, choice in model.chosen.items():
        if choice != model.options[option][0]:
            described[option] = choice
    return described


def _bitmap(values: np.ndarray) -> dict[str, Any]:
    import mitsuba as mi

    if mi.variant() is None:
        raise ModelError("a map of parameters becomes a Mitsuba bitmap: call mitsuba.set_variant(…) first")
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(np.ascontiguousarray(values[..., None], dtype=np.float32)),
        "raw": True,
    }


def read_properties(props: Any) -> Paint:
    """Read the properties of the plugin (docs/rendering.md).

    Parameters
    ----------
    props
        ``mitsuba.Properties``.

    Raises
    ------
    ModelError
        If a model, paint, property or choice is unknown, or a parameter is outside its domain.
    """
    given = props.keys()
    base = _base_model(props, given)
    cls = type(base) if base is not None else DoubleGauss
    if "model" in given:
        name = props["model"]
        if name not in MODELS:
            raise ModelError(f"model {name!r} is unknown: choose one of {', '.join(MODELS)}")
        if base is not None and name != base.name:
            raise ModelError(f"model={name!r}, but the paint is of the model {base.name!r}: leave one out")
        cls = MODELS[name]
    known = ["model", "paint", "model_file", *(p.name for p in cls.parameters), *cls.options]
    for name in given:
        if name not in known:
            raise ModelError(f"unknown property {name!r} of {cls.name}: known are {', '.join(known)}")

    textures, values = {}, {}
    for parameter in cls.parameters:
        texture, value = _texture(props, parameter, base)
        values[parameter.name] = value
        if texture is not None:
            textures[parameter.name] = texture
    chosen = {} if base is None else dict(base.chosen)
    chosen |= {option: props[option] for option in cls.options if option in given}
    model = cls.from_values(values, **chosen)
    if chosen.get("accuracy", "default") == "default" and "accuracy" not in given:
        model = model.for_rendering()
    # a width that has to be measured must be so now: where the renderer asks for it, kernels are being recorded
    model.lobe_width()
    return Paint(model, textures)


def _base_model(props: Any, given: list[str]) -> Model | None:
    """The model that the properties ``paint`` or ``model_file`` name."""
    if "paint" in given and "model_file" in given:
        raise ModelError("a paint and a model file are given: leave one out")
    if "paint" in given:
        return load_paint(props["paint"])
    if "model_file" in given:
        import mitsuba as mi

        # beside the scene file, as other files of a scene
        return load_model(str(mi.file_resolver().resolve(props["model_file"])))
    return None


def _texture(props: Any, parameter: Parameter, base: Model | None) -> tuple[Any, Any]:
    """Texture of a parameter (None for one that vanishes), and what is known of its values."""
    name = parameter.name
    if name not in props:
        default = parameter.default if base is None else base.values[name]
        if np.ndim(default):
            raise ModelError(f"{name} of the model is an array: give the plugin a bitmap of it instead")
        if parameter.vanishing and default == 0.0:
            return None, 0.0
        return props.get_unbounded_texture(name, float(default)), default
    value = props[name]
    if isinstance(value, str | bool):
        raise ModelError(f"{name}={value!r}: give a number, a texture or a spectrum")
    texture = props.get_unbounded_texture(name)
    return texture, _extent(parameter, value, texture)


def _extent(parameter: Parameter, value: Any, texture: Any) -> Any:
    """The number, or least and largest value of a texture; the default where they cannot be told."""
    import mitsuba as mi

    if isinstance(value, int | float):
        return float(value)
    if isinstance(value, mi.ScalarColor3d):
        numbers = np.ravel(value)
        if mi.is_spectral and (numbers.min() < 0.0 or numbers.max() > 1.0):
            raise ModelError(
                f"{parameter.name}: spectral variants turn an RGB value into a spectrum, for which it must lie "
                f"within 0 … 1; give a spectrum of wavelengths and values"
            )
    elif hasattr(value, "wavelengths"):
        numbers = np.ravel(value.values)
    else:
        numbers = _content(mi.traverse(texture), mi.is_spectral)
    return np.array([numbers.min(), numbers.max()]) if numbers.size else parameter.default


def _content(parameters: Any, spectral: bool) -> np.ndarray:
    """Numbers that a texture and those inside it hold, as far as they are values of the parameter."""
    found = [np.empty(0)]
    for key, content in parameters.items():
        last = key.rsplit(".", 1)[-1]
        if last == "data":
            numbers = np.asarray(content)
            # spectral variants hold coefficients of spectra in place of colours
            if not (spectral and numbers.shape[-1] == 3):
                found.append(np.ravel(numbers))
        elif last in ("value", "values"):
            numbers = np.ravel(content)
            if not (spectral and numbers.size == 3 and last == "value"):
                found.append(numbers)
    return np.concatenate(found)
