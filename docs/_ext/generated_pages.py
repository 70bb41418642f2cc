"""Sphinx extension: the pages that follow from the package, written to ``docs/generated/`` before each build.

* ``commands.md``: every command with its options, asked of typer;
* ``api/``: the public names of :mod:`pbrdf` with their docstrings, a page for each group of its table of names;
* ``model-zoo.md``: every registered model with its parameters and the figure that ``pbrdf plot`` draws;
* ``benchmarks.md``: ``benchmarks/README.md``, its links as seen from there.

A file is written only where its text changes, so that a second build reads what has changed alone.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import re
from pathlib import Path
from typing import Any

BENCHMARKS = Path(__file__).parents[2] / "benchmarks" / "README.md"
#: Angle of incidence of the figures of models, degrees.
THETA_I = 45.0


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("builder-inited", lambda app: write_all(Path(app.srcdir) / "generated"))
    app.connect("source-read", _links_within)
    app.connect("autodoc-process-docstring", _bars_as_they_stand)
    return {"parallel_read_safe": True}


def write_all(folder: Path) -> None:
    """Write every generated page into `folder`."""
    write(folder / "commands.md", commands_page())
    for name, text in api_pages().items():
        write(folder / "api" / f"{name}.md", text)
    write(folder / "model-zoo.md", model_zoo(folder / "models"))
    write(folder / "benchmarks.md", benchmarks(BENCHMARKS))


def write(path: Path, text: str) -> None:
    """Write `text` where the file does not hold it already."""
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def benchmarks(page: Path) -> str:
    """The page of the benchmarks, from its own folder to ``generated``."""
    text = page.read_text(encoding="utf-8")
    return (
        text.replace("](../docs/", "](../")
        .replace("](figures/", "](../../benchmarks/figures/")
        .replace("](../src/", "](../../src/")
    )


def _links_within(app: Any, name: str, source: list[str]) -> None:
    """Turn links that lead out of ``docs`` into what the built pages have: a page, a file to load, or words."""
    here = (Path(app.srcdir) / name).parent

    def within(link: re.Match[str]) -> str:
        words, target = link.groups()
        path = (here / target.partition("#")[0]).resolve()
        if path == BENCHMARKS:
            return f"[{words}](/generated/benchmarks.md)"
        return words if path.is_dir() or path.suffix == ".md" else link.group()

    source[0] = re.sub(r"\[([^\[\]]*)\]\((\.\./[^()\s]*)\)", within, source[0])


def _bars_as_they_stand(app: Any, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    """|x| in a docstring is a modulus, not a substitution."""
    for i, line in enumerate(lines):
        pieces = line.split("`")
        pieces[::2] = [piece.replace("|", "\\|") for piece in pieces[::2]]
        lines[i] = "`".join(pieces)


# Commands


def commands_page() -> str:
    """Every command: what it is for, its arguments and its options, grouped as in its help."""
    import typer

    from pbrdf.cli.main import app

    group = typer.main.get_command(app)
    context = group.context_class(group, info_name="pbrdf")
    lines = [
        "# Commands",
        "",
        "As `pbrdf COMMAND --help` prints them. Angles are in degrees; exit code 0: done, 2: the input or an option "
        "is at fault, 3: a fit has not converged.",
        "",
        *_options(group, context, "Options before the command"),
    ]
    for command, inner in _commands(group, context):
        lines += _command(command, inner)
    return "\n".join(lines) + "\n"


def _commands(group: Any, context: Any) -> list[tuple[Any, Any]]:
    found = []
    for name in group.commands:
        command = group.commands[name]
        if getattr(command, "hidden", False):
            continue
        inner = command.context_class(command, info_name=name, parent=context)
        found.append((command, inner))
        if hasattr(command, "commands"):
            found += _commands(command, inner)
    return found


def _command(command: Any, context: Any) -> list[str]:
    # the help puts the names of the formats into the texts of the options
    with contextlib.redirect_stdout(io.StringIO()):
        command.get_help(context)
    usage = " ".join([context.command_path, *command.collect_usage_pieces(context)])
    level = "##" if len(context.command_path.split()) == 2 else "###"
    about = inspect.cleandoc(command.help or "")
    return [
        f"{level} {context.command_path}",
        "",
        f"    {usage}",
        "",
        _plain(about),
        "",
        *_options(command, context),
    ]


def _options(command: Any, context: Any, title: str = "") -> list[str]:
    panels: dict[str, list[str]] = {}
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if record is None:
            continue
        names, text = record
        if parameter.param_type_name == "argument":
            names = re.sub(r" <.*>$", "", names)
        panel = getattr(parameter, "rich_help_panel", None) or title
        # a panel of its own for what every command has would be all noise
        if "--help" not in parameter.opts:
            panels.setdefault(panel, []).extend([f"`{names}`", f": {_plain(text) or '–'}", ""])
    lines: list[str] = []
    for panel, entries in panels.items():
        lines += [*([f"**{panel}**", ""] if panel else []), *entries]
    return lines


def _plain(text: str) -> str:
    """A help text as Markdown: what stands in angle brackets outside of code is no HTML."""
    pieces = text.split("`")
    for i in range(0, len(pieces), 2):
        pieces[i] = pieces[i].replace("<", "&lt;").replace("*", "\\*")
    return "`".join(pieces)


# Python


def api_pages() -> dict[str, str]:
    """The public names by the groups that the comments of the package's table name; ``index`` lists the groups."""
    groups = _groups()
    pages = {}
    for title, names in groups.items():
        lines = [f"# {title[0].upper()}{title[1:]}", ""]
        for name in names:
            lines += [f"## {name}", "", "```{eval-rst}", *_directive(name), "```", ""]
        pages[_slug(title)] = "\n".join(lines)
    contents = "\n".join(pages)
    pages["index"] = (
        "# Python: the public names\n\nEverything a user needs stands at the front door: `import pbrdf`, then "
        f"`pbrdf.NAME`. Each name is loaded when first used.\n\n```{{toctree}}\n:maxdepth: 2\n\n{contents}\n```\n"
    )
    return pages


def _groups() -> dict[str, list[str]]:
    import pbrdf

    table = inspect.getsource(pbrdf).partition("_HOME = {")[2].partition("\n}")[0]
    groups: dict[str, list[str]] = {}
    for comment, name in re.findall(r'^    (?:# (.*)|"(\w+)":.*)$', table, re.MULTILINE):
        if comment:
            group = groups.setdefault(comment, [])
        else:
            group.append(name)
    known = {name for names in groups.values() for name in names}
    rest = [n for n in pbrdf.__all__ if n not in known and not n.startswith("__")]
    groups["backend and errors"] = rest
    return groups


def _directive(name: str) -> list[str]:
    import pbrdf

    value = getattr(pbrdf, name)
    if isinstance(value, type) and issubclass(value, Exception):
        return [f".. autoexception:: pbrdf.{name}"]
    if isinstance(value, type):
        return [f".. autoclass:: pbrdf.{name}", "   :members:"]
    if callable(value):
        return [f".. autofunction:: pbrdf.{name}"]
    if inspect.ismodule(value):
        return [f".. automodule:: {value.__name__}", "   :members:"]
    from sphinx.pycode import ModuleAnalyzer

    comments = ModuleAnalyzer.for_module(pbrdf._HOME[name]).find_attr_docs()
    return [f".. py:data:: pbrdf.{name}", "", *(f"   {line}" for line in comments["", name])]


def _slug(title: str) -> str:
    return re.sub(r"\W+", "-", title.lower()).strip("-")


# Models


def model_zoo(pictures: Path) -> str:
    """Every model: what it is, its parameters, and its figure, drawn into `pictures` where it is not there yet."""
    from pbrdf.models import MODELS
    from pbrdf.report.numbers import brief

    lines = [
        "# Model zoo",
        "",
        f"The {len(MODELS)} models that are registered, each with the figure that `pbrdf plot MODEL.json "
        f"--theta-i {THETA_I:g}` draws of it: intensity and degree of linear polarisation over the hemisphere, and "
        "both in the plane of incidence. Where they come from and what each was checked against: "
        "[facets](../models.md), [bodies](../models-bodies.md); numbers for programs: `pbrdf models --json`.",
        "",
    ]
    for name, model in MODELS.items():
        _draw(model, name, pictures / f"{name}.png")
        lines += [f"## {name}", "", _plain(_about(model)), "", f"![{name}](models/{name}.png)", ""]
        lines += [
            "| parameter | meaning | unit | bounds of a fit | if not fitted |",
            "| --- | --- | --- | --- | --- |",
        ]
        for p in model.parameters:
            held = "" if p.fitted else " with `--free`"
            bounds = f"{brief(p.lower)} … {brief(p.upper)}{held}"
            lines.append(
                f"| `{p.name}` {p.symbol} | {p.description} | {p.unit} | {bounds} | {brief(p.default)} |"
            )
        for option, choices in model.options.items():
            lines += ["", f"`--option {option}={'|'.join(choices)}`"]
        lines.append("")
    return "\n".join(lines)


def _about(model: Any) -> str:
    """The docstring of a class, as far as it is prose."""
    text = inspect.cleandoc(model.__doc__ or "")
    text = re.split(r"\n\n(?=Every parameter may|Parameters\n-|\.\. )", text)[0]
    return re.sub(r":\w+:`~?([^`]*)`", r"`\1`", text).replace("``", "`")


def _draw(model: Any, name: str, target: Path) -> None:
    if target.is_file():
        return
    from pbrdf.report.model.figure import model_figure
    from pbrdf.report.style import save_figure

    values = {p.name: p.default for p in model.parameters if p.fitted}
    target.parent.mkdir(parents=True, exist_ok=True)
    save_figure(model_figure(model(**values), THETA_I, name), target)
