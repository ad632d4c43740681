"""The one way to a file of a picture: text in it is data, neither mathematics nor control."""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from race_server.errors import ScenarioError
from race_server.kept_file import check_place, write_file
from race_server.printable import printable

SUFFIXES = (".png", ".svg")
# Of drivers in their order, far enough apart for people who see few colours.
DRIVER_COLOURS = ("#1565c0", "#d84315", "#2e7d32", "#6a1b9a", "#00838f", "#f9a825")


def check_picture(path: Path, suffixes: Sequence[str] = SUFFIXES) -> None:
    """Check, before what is drawn is worked out, that a picture can be drawn into a file.

    Raises:
        ScenarioError: it has none of the suffixes, is a folder, or its folder does not exist.
    """
    if path.suffix.lower() not in suffixes:
        raise ScenarioError(f"{path}: write the picture as {' or '.join(suffixes)}")
    check_place(path)


def bare_axes(panel: Any) -> None:
    """Give a panel small figures, a faint grid, and no frame above and to the right."""
    panel.tick_params(labelsize=8)
    panel.grid(visible=True, alpha=0.25)
    for side in ("top", "right"):
        panel.spines[side].set_visible(False)


def save(figure: Any, path: Path, **options: Any) -> None:
    """Write a figure of matplotlib with all its texts as they are. options: of `savefig`.

    Matplotlib takes what stands between two `$` for a formula, and fails where it is none; an
    escape character makes an .svg file that no reader takes.

    Raises:
        OSError: the file cannot be written.
    """
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        text.set_parse_math(False)
        text.set_text("\n".join(map(printable, text.get_text().split("\n"))))
    kind = path.suffix[1:].lower() or "png"
    with warnings.catch_warnings():
        # A letter that the font lacks is a box in the picture: a title, or a name, in any script.
        warnings.filterwarnings("ignore", message="Glyph", category=UserWarning)
        write_file(path, lambda file: figure.savefig(file, format=kind, **options))


def save_and_close(figure: Any, path: Path, **options: Any) -> None:
    """Write a figure of pyplot, and let go of it. options: of `savefig`.

    Raises:
        ScenarioError: the file cannot be written.
    """
    from matplotlib import pyplot

    try:
        save(figure, path, **options)
    except (OSError, ValueError) as error:
        raise ScenarioError(f"{path} cannot be written: {error}") from error
    finally:
        pyplot.close(figure)
