"""The models by name: those of the package, those that a program registers, and those of installed packages.

A package offers its models in the entry-point group ``pbrdf.models``::

    [project.entry-points."pbrdf.models"]
    my-model = "my_package.models:MyModel"
"""

from __future__ import annotations

import importlib.metadata
import os
import sys
import warnings
from collections.abc import Iterator, Mapping
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any, TypeVar

from pbrdf.errors import ModelError, PluginWarning
from pbrdf.files.plain_numbers import json_from_text
from pbrdf.models.base import Model

__all__ = ["ENTRY_POINTS", "MODELS", "Registry", "find_model", "load_model", "model_from_file", "register"]

ENTRY_POINTS = "pbrdf.models"

M = TypeVar("M", bound=type[Model])


def _place(model: type[Model]) -> str:
    return f"{model.__module__}.{model.__qualname__}"


class Registry(Mapping[str, type[Model]]):
    """Model classes by name, in the order of their registration; installed packages are asked at the first look."""

    def __init__(self) -> None:
        self._classes: dict[str, type[Model]] = {}
        self._asked = False

    def add(self, model: type[Model]) -> None:
        """Add a class; see :func:`register`."""
        name = getattr(model, "name", None)
        if not isinstance(name, str) or not name:
            raise ModelError(
                f"{model.__name__}: a model needs a name, a text that files and the command line use"
            )
        if model.kernel is Model.kernel:
            raise ModelError(f"{model.__name__}: a model needs a method kernel, its Mueller matrix")
        known = self._classes.get(name)
        # the same definition run again (a notebook's cell) replaces the former one
        if known is not None and _place(known) != _place(model):
            raise ModelError(
                f"{model.__name__}: the name {name!r} belongs to {_place(known)}: choose another"
            )
        self._classes[name] = model

    def __getitem__(self, name: str) -> type[Model]:
        if name not in self._classes:
            self._ask_packages()
        return self._classes[name]

    def __iter__(self) -> Iterator[str]:
        self._ask_packages()
        return iter(self._classes)

    def __len__(self) -> int:
        self._ask_packages()
        return len(self._classes)

    def _ask_packages(self) -> None:
        if self._asked:
            return
        self._asked = True
        for entry in importlib.metadata.entry_points(group=ENTRY_POINTS):
            # whatever another package does wrong, the other models must stay usable
            try:
                model = entry.load()
                if not (isinstance(model, type) and issubclass(model, Model)):
                    raise ModelError(f"{entry.value} is no pBRDF model")
                self.add(model)
            except Exception as error:
                warnings.warn(
                    f"the model {entry.name!r} of an installed package cannot be used ({entry.value}): {error}",
                    PluginWarning,
                    stacklevel=2,
                )


#: Every model by the name that files and the command line use.
MODELS = Registry()


def register(model: M) -> M:
    """Make a model known by its name: to fits, files, the command line and the renderer of this process.

    Parameters
    ----------
    model
        A subclass of :class:`Model`.

    Returns
    -------
    type
        The same class, so that ``@pbrdf.register`` can stand before its definition.

    Raises
    ------
    ModelError
        If it is no model, has no name or kernel, or its name is that of another class.
    """
    if not (isinstance(model, type) and issubclass(model, Model)):
        raise ModelError(f"{model!r} is no pBRDF model: derive a class from pbrdf.Model")
    MODELS.add(model)
    return model


def find_model(text: str) -> type[Model]:
    """A model by its name, or from a Python file as ``FILE.py:Class``.

    Raises
    ------
    ModelError
        If there is no such model, or the file cannot be used.
    """
    path, colon, class_name = text.rpartition(":")
    if colon and path.endswith(".py"):
        return model_from_file(Path(path), class_name)
    if text.endswith(".py"):
        raise ModelError(f"{text}: name the model's class as well, {text}:Class")
    if text not in MODELS:
        raise ModelError(
            f"unknown model {text!r}: known are {', '.join(MODELS)}; one of your own is given as FILE.py:Class"
        )
    return MODELS[text]


def model_from_file(path: Path, class_name: str) -> type[Model]:
    """Run a Python file and register the model that it defines.

    Raises
    ------
    ModelError
        If the file cannot be read or run, or defines no such model.
    """
    where = f"{path}:{class_name}"
    if not path.is_file():
        raise ModelError(f"{where}: there is no file {path}")
    resolved = path.resolve()
    # the same file gives the same module, so that a class is not defined twice
    name = f"pbrdf_model_{resolved.stem}_{abs(hash(str(resolved))):x}"
    module = sys.modules.get(name)
    if module is None:
        spec = spec_from_file_location(name, resolved)
        if spec is None or spec.loader is None:
            raise ModelError(f"{where}: {path} cannot be run as Python")
        module = module_from_spec(spec)
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except Exception as error:
            del sys.modules[name]
            raise ModelError(f"{where}: {path} cannot be run: {type(error).__name__}: {error}") from error
    model = getattr(module, class_name, None)
    defined = [
        n for n, v in vars(module).items() if isinstance(v, type) and issubclass(v, Model) and v is not Model
    ]
    if class_name not in defined or model is None:
        listed = f"it defines {', '.join(defined)}" if defined else "it defines none"
        raise ModelError(f"{where}: {path} defines no model {class_name}: {listed}")
    found: type[Model] = register(model)
    return found


def load_model(source: str | os.PathLike[str] | Mapping[str, Any]) -> Model:
    """Load a model from a JSON file, JSON text or the dictionary of :meth:`Model.to_dict`.

    Raises
    ------
    ModelError
        If the text is not JSON, or names an unknown model, parameter or option; the file is named.
    """
    where = ""
    if isinstance(source, Mapping):
        content: Any = source
    else:
        text = os.fspath(source)
        if not text.lstrip().startswith("{"):
            where = f"{text}: "
            try:
                text = Path(text).read_text(encoding="utf-8")
            except UnicodeDecodeError as error:
                raise ModelError(
                    f"{where}not a text file, so not a model; measurements become one by a fit (pbrdf fit FILE)"
                ) from error
            except OSError as error:
                raise ModelError(f"{where}cannot be read as a model: {error}") from error
        try:
            content = json_from_text(text)
        except ValueError as error:
            raise ModelError(f"{where}not JSON, {error}") from error
    if not isinstance(content, Mapping) or "model" not in content:
        raise ModelError(f'{where}not a model: the key "model" is missing')
    cls = MODELS.get(content["model"]) if isinstance(content["model"], str) else None
    if cls is None:
        raise ModelError(
            f"{where}unknown model {content['model']!r}: known are {', '.join(MODELS)}; make one of your own known "
            "with pbrdf.register, or before a command with pbrdf --model FILE.py:Class"
        )
    parameters, options = content.get("parameters"), content.get("options", {})
    if not isinstance(parameters, Mapping) or not isinstance(options, Mapping):
        raise ModelError(f'{where}"parameters" and "options" must be tables of name and value')
    names = [p.name for p in cls.parameters]
    for kind, given, known in (("parameter", parameters, names), ("option", options, list(cls.options))):
        for name in given:
            if name not in known:
                raise ModelError(
                    f"{where}unknown {kind} {name!r} of {cls.name}: known are {', '.join(known)}"
                )
    missing = [p.name for p in cls.parameters if p.fitted and p.name not in parameters]
    if missing:
        raise ModelError(f"{where}parameter {missing[0]!r} of {cls.name} is missing")
    values = {p.name: parameters.get(p.name, p.default) for p in cls.parameters}
    for name, value in values.items():
        if _has_truth(value):
            raise ModelError(f"{where}{name} is true or false, not a number")
    try:
        return cls.from_values(values, **options)
    except ModelError as error:
        raise ModelError(f"{where}{error}") from error


def _has_truth(value: Any) -> bool:
    """Whether there is a true or false among numbers, which Python would take for 1 or 0."""
    if isinstance(value, list):
        return any(map(_has_truth, value))
    return isinstance(value, bool)
