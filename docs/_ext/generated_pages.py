"""Parts of pages that are made from the code: keys of files, commands, targets.

A page asks for one by a line such as `<!-- generated: lattice-file -->`.
"""

from __future__ import annotations

import inspect
import re
from typing import Any

import click

Schema = dict[str, Any]

_MARK = re.compile(r"^<!-- generated: ([a-z-]+) -->$", flags=re.MULTILINE)
_KINDS = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true, false"}
_BOUNDS = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}

_VALUES = {"PATH": "FILE", "FLOAT RANGE": "NUMBER", "INTEGER RANGE": "NUMBER"}


def lattice_file() -> str:
    """Every key of the lattice file, from its JSON Schema."""
    from ffdcli.lattice.file.spec import json_schema

    schema = json_schema()
    edits = [ref["$ref"] for ref in schema["properties"]["edits"]["items"]["oneOf"]]
    wrappers = {ref.rpartition("/")[2]: schema["$defs"][ref.rpartition("/")[2]] for ref in edits}
    parts = ["## Keys\n", _table(schema), "## Edits\n"]
    used: list[str] = []
    for wrapper in wrappers.values():
        ((name, edit),) = wrapper["properties"].items()
        parts.append(f"(edit-{name})=\n### {name}\n")
        if "$ref" in edit:
            model = edit["$ref"].rpartition("/")[2]
            used.append(model)
            parts.append(f"{schema['$defs'][model]['description']}\n")
            parts.append(_table(schema["$defs"][model]))
        else:
            parts.append(f"{wrapper['description']}\n")
            parts.append(f"Value: {_kind(edit)}. {_clean(edit['description'])}\n")
    parts.append("## Values with keys\n")
    rest = {name: model for name, model in schema["$defs"].items() if name not in wrappers}
    parts += [_section(name, model) for name, model in rest.items() if name not in used]
    return "\n".join(parts)


def jobs_file() -> str:
    """Every key of the jobs file, from its JSON Schema."""
    from ffdcli.batch.spec import json_schema

    schema = json_schema()
    parts = ["## Keys\n", _table(schema)]
    parts += [_section(name, model) for name, model in schema["$defs"].items()]
    return "\n".join(parts)


def _section(name: str, model: Schema) -> str:
    return (
        f"(keys-{name.lower()})=\n### {name}\n\n{model.get('description', '')}\n\n{_table(model)}"
    )


def _table(model: Schema) -> str:
    rows = ["| key | value | default | |", "|---|---|---|---|"]
    for key, value in model["properties"].items():
        default = "required" if key in model.get("required", []) else _default(value)
        words = _clean(value.get("description", ""))
        rows.append(f"| `{key}` | {_kind(value)} | {default} | {words} |")
    return "\n".join(rows) + "\n"


def _default(value: Schema) -> str:
    default = value.get("default")
    if default is None or isinstance(default, dict):
        return "-"
    text = str(default).lower() if isinstance(default, bool) else str(default)
    return f"`{text}`".replace("'", "")


def _kind(value: Schema) -> str:
    """What may be written, in words."""
    if "$ref" in value:
        name = value["$ref"].rpartition("/")[2]
        return f"[{name}](#keys-{name.lower()})"
    for several in ("anyOf", "oneOf"):
        if several in value:
            if {"$ref": "#/$defs/Near"} in value[several]:
                return "[selector](#selectors)"
            kinds = [_kind(kind) for kind in value[several] if kind.get("type") != "null"]
            return " or ".join(dict.fromkeys(kinds))
    if "const" in value or "enum" in value:
        choices = value.get("enum", [value.get("const")])
        return ", ".join(f"`{choice}`" for choice in choices)
    kind = value.get("type")
    if kind == "array" or isinstance(kind, list):
        return _list(value)
    bounds = [f"{sign} {value[name]:g}" for name, sign in _BOUNDS.items() if name in value]
    return " ".join([_KINDS.get(kind, "mapping"), *bounds])


def _list(value: Schema) -> str:
    if "prefixItems" in value:
        kinds = [_kind(kind) for kind in value["prefixItems"]]
        if len(set(kinds)) == 1:
            return f"list of {len(kinds)}: {kinds[0]}"
        return f"list: {', '.join(kinds)}"
    items = value.get("items", {})
    if len(items.get("oneOf", ())) > 5:
        return "list of [edits](#edits)"
    return f"list of {_kind(items)}" if items else "list"


def _clean(text: str) -> str:
    return _code(re.sub(r"([|*$])", r"\\\1", text.replace("\n", " ")))


def _code(text: str) -> str:
    """Options in a text as code, so that their dashes stay as they are."""
    return re.sub(
        r"`[^`]*`|(?<!\w)--[a-z][\w-]*",
        lambda found: found[0] if found[0].startswith("`") else f"`{found[0]}`",
        text,
    )


def commands() -> str:
    """Every command with its arguments and options, from click."""
    from ffdcli.cli.main import main

    parts = []
    for name in main.list_commands(click.Context(main)):
        command = main.get_command(click.Context(main), name)
        context = click.Context(command, info_name=f"ffd {name}")
        usage = " ".join(command.collect_usage_pieces(context))
        parts.append(f"## ffd {name}\n\n```text\nffd {name} {usage}\n```\n")
        parts.append(f"{_code(inspect.cleandoc(command.help))}\n")
        parts.append("| option | |\n|---|---|")
        for option in command.get_params(context):
            if isinstance(option, click.Option):
                parts.append(f"| {_option(option, context)} | {_help(option)} |")
        parts.append("")
    return "\n".join(parts)


def _option(option: click.Option, context: click.Context) -> str:
    names = ", ".join(f"`{name}`" for name in (*option.opts, *option.secondary_opts))
    if option.is_flag or option.is_eager:
        return names
    if isinstance(option.type, click.Choice):
        return f"{names}: {', '.join(f'`{choice}`' for choice in option.type.choices)}"
    metavar = option.make_metavar(context)
    return f"{names} {_VALUES.get(metavar, metavar)}"


def _help(option: click.Option) -> str:
    shown = option.show_default and option.default is not None
    default = f" [default: {option.default}]" if shown else ""
    needed = " [required]" if option.required else ""
    return _clean(f"{option.help or ''}{default}{needed}")


def targets() -> str:
    """What `--target` chooses for each receiver."""
    from ffdcli.brep.occ.targets import TARGETS

    rows = [
        "| `--target` | STEP schema | STEP pcurves | IGES | highest degree with `--tolerance` |",
        "|---|---|---|---|---|",
    ]
    iges = {"brep": "solids", "faces": "trimmed surfaces"}
    for target in TARGETS.values():
        choices = (
            f"`{target.name}`",
            target.schema.upper(),
            "yes" if target.pcurves else "no",
            iges[target.iges_mode],
            str(target.max_degree or "any"),
        )
        rows.append(f"| {' | '.join(choices)} |")
    return "\n".join(rows) + "\n"


PARTS = {
    "commands": commands,
    "jobs-file": jobs_file,
    "lattice-file": lattice_file,
    "targets": targets,
}


def _fill(_app: Any, _page: str, source: list[str]) -> None:
    source[0] = _MARK.sub(lambda mark: PARTS[mark.group(1)](), source[0])


def setup(app: Any) -> dict[str, bool]:
    """Fill the marks when a page is read."""
    app.connect("source-read", _fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
