"""The reference of the command line, from the commands themselves."""

from collections.abc import Iterator
from typing import Any

Words = tuple[str, ...]


def command_tree() -> dict[Words, Any]:
    """Return every command and group of `race` by its words, without `race` itself."""
    import typer

    from race_server.cli.main import app

    tree: dict[Words, Any] = {}

    def visit(words: Words, command: Any) -> None:
        tree[words] = command
        for name, inner in getattr(command, "commands", {}).items():
            visit((*words, name), inner)

    visit((), typer.main.get_command(app))
    return tree


def options_of(command: Any) -> set[str]:
    """Return all spellings of a command's options."""
    spelled = {"-h", "--help"}
    for parameter in command.params:
        spelled |= {word for word in (*parameter.opts, *parameter.secondary_opts) if word[0] == "-"}
    return spelled


def commands_page(tree: dict[Words, Any]) -> str:
    """Return the page of all commands, their arguments and options."""
    return "\n".join(_chapters(tree))


def _chapters(tree: dict[Words, Any]) -> Iterator[str]:
    yield "# Commands\n"
    yield "Every command of `race`. `race COMMAND --help` prints the same.\n"
    for words, command in tree.items():
        if not words:
            continue
        yield f"({'-'.join(('race', *words))})=\n"
        yield f"{'#' * (1 + len(words))} race {' '.join(words)}\n"
        yield f"{_plain(command.help)}\n"
        arguments = [each for each in command.params if not each.opts[0].startswith("-")]
        options = [each for each in command.params if each.opts[0].startswith("-")]
        if arguments:
            yield "| argument | |\n|---|---|"
            yield "".join(
                f"| `{each.name.upper()}`{'' if each.required else ', may be left out'} "
                f"| {_plain(each.help)} |\n"
                for each in arguments
            )
        if options:
            yield "| option | | default |\n|---|---|---|"
            yield "".join(
                f"| {_spelling(each)} | {_plain(each.help)} | {_default(each)} |\n"
                for each in options
            )


def _spelling(option: Any) -> str:
    return ", ".join(f"`{name}`" for name in (*option.opts, *option.secondary_opts))


def _default(option: Any) -> str:
    value = option.default
    if option.required:
        return "needed"
    if callable(value) or value in (None, "", (), []):
        return ""
    if option.is_flag:
        return "on" if value else "off"
    return f"`{getattr(value, 'value', value)}`"


def _plain(text: str | None) -> str:
    """Return a help text as one cell of Markdown."""
    return " ".join((text or "").replace("|", "\\|").replace("<", "&lt;").split())
