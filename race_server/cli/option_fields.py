"""Commands whose options are the fields of a frozen dataclass, and the words for them.

A long list of options stands in one dataclass; several commands may share it, and a command that
starts another one gets the words of its command line from the same fields.
"""

import inspect
from collections.abc import Callable, Iterator
from dataclasses import MISSING, fields, is_dataclass
from functools import wraps
from typing import Any, get_args, get_type_hints

from typer.models import OptionInfo


def expand_options(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command that has an option for each field of its dataclass parameters.

    A field is declared as a parameter is: `name: Annotated[type, typer.Option(...)] = default`.
    """
    hints = get_type_hints(command, include_extras=True)
    forms: dict[str, Any] = {name: hint for name, hint in hints.items() if is_dataclass(hint)}
    parameters: list[inspect.Parameter] = []
    for parameter in inspect.signature(command).parameters.values():
        if parameter.name in forms:
            parameters += _parameters_of(forms[parameter.name])
        else:
            parameters.append(
                parameter.replace(
                    annotation=hints[parameter.name], kind=inspect.Parameter.KEYWORD_ONLY
                )
            )

    @wraps(command)
    def run(**given: Any) -> None:
        for name, form in forms.items():
            own = {field.name for field in fields(form)} & given.keys()
            given[name] = form(**{key: given.pop(key) for key in own})
        command(**given)

    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {one.name: one.annotation for one in parameters}
    return run


def _parameters_of(form: Any) -> Iterator[inspect.Parameter]:
    hints = get_type_hints(form, include_extras=True)
    for field in fields(form):
        yield inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=inspect.Parameter.empty if field.default is MISSING else field.default,
            annotation=hints[field.name],
        )


def argv_of(options: Any) -> list[str]:
    """Return the words of a command line for the fields that differ from their defaults."""
    hints = get_type_hints(type(options), include_extras=True)
    words: list[str] = []
    for field in fields(options):
        value = getattr(options, field.name)
        if value == field.default:
            continue
        yes, no = _flags(field.name, hints[field.name])
        if isinstance(value, bool):
            words.append(yes if value else no)
        else:
            for one in value if isinstance(value, list) else [value]:
                words += [yes, str(one)]
    return words


def _flags(name: str, hint: Any) -> tuple[str, str]:
    """Return the option of a field, and the one that switches it off."""
    info = next(one for one in get_args(hint) if isinstance(one, OptionInfo))
    # The first name in `typer.Option("--name", ...)` is called the default there.
    declared = (info.default, *(info.param_decls or ()))
    names = [one for one in declared if isinstance(one, str) and one.startswith("--")]
    yes, _, no = (names[0] if names else f"--{name.replace('_', '-')}").partition("/")
    return yes, no or f"--no-{yes.removeprefix('--')}"
