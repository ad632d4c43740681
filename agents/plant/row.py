"""One line of a table of what was measured, against what is asked."""

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Row:
    """A figure, what it was before, and its bar."""

    measured: str
    unit: str
    figure: float
    least: float | None = None  # the bar, from below
    most: float | None = None  # … and from above
    before: float | None = None  # the same without what was built for it
    note: str = ""

    @property
    def ok(self) -> bool:
        """Whether the figure is within its bars."""
        above = self.least is None or self.figure >= self.least
        return above and (self.most is None or self.figure <= self.most)

    def document(self) -> dict[str, Any]:
        """Return the line for a document."""
        return {**asdict(self), "ok": self.ok}

    @property
    def bar(self) -> str:
        """The bars as text."""
        if self.least is None:
            return f"≤ {self.most:g}"
        return f"≥ {self.least:g}" if self.most is None else f"{self.least:g} … {self.most:g}"

    @property
    def fault(self) -> str:
        """What is wrong where the bar is missed."""
        return f"{self.measured}: {self.figure:.3g} {self.unit}, asked {self.bar}"
