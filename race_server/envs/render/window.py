"""A window on the screen that shows pictures."""

import importlib
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_server.errors import ScenarioError


class Window:
    """A window on the screen, opened by the first frame."""

    def __init__(self, title: str = "race") -> None:
        self._title = title
        self._pygame: Any = None
        self._screen: Any = None

    def show(self, frame: NDArray[np.uint8]) -> None:
        """Show an image (height, width, 3).

        Raises:
            ScenarioError: pygame is not installed.
        """
        height, width = frame.shape[:2]
        if self._pygame is None:
            self._open()
        if self._screen is None or self._screen.get_size() != (width, height):
            self._screen = self._pygame.display.set_mode((width, height))
        image = self._pygame.image.frombuffer(frame.tobytes(), (width, height), "RGB")
        self._screen.blit(image, (0, 0))
        self._pygame.display.flip()
        self._pygame.event.pump()

    def close(self) -> None:
        """Close the window; the next frame opens another one."""
        if self._pygame is not None:
            self._pygame.display.quit()
        self._pygame = self._screen = None

    def _open(self) -> None:
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        try:
            pygame: Any = importlib.import_module("pygame")
        except ImportError as error:
            raise ScenarioError(
                "rendering for people needs pygame: pip install pygame-ce, "
                'or use render_mode="rgb_array"'
            ) from error
        pygame.display.init()
        pygame.display.set_caption(self._title)
        self._pygame = pygame
