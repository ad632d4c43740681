"""The document of a drill."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Finding:
    """One act that was tried, with its outcome."""

    act: str
    expected: str
    seen: str
    ok: bool


@dataclass(frozen=True)
class SmallDrill:
    """The small size of a drill, for `race drill all`: its module names one as `SMALL`."""

    options: str  # after `race drill NAME`
    seconds: float  # that it takes on two cores, about
    figure: str  # of its document, the main one; PART.FIGURE of a part


def document_of(faults: Sequence[str], **figures: Any) -> dict[str, Any]:
    """Return the document of a drill: `ok`, `why` not, and its figures."""
    return {"ok": not faults, "why": "; ".join(faults), **figures}


def skipped(reason: str) -> dict[str, Any]:
    """Return the document of a drill that cannot be done on this machine."""
    return document_of((), skipped=reason)


def matrix_of(findings: Sequence[Finding], **figures: Any) -> dict[str, Any]:
    """Return the document of a drill that tries many acts."""
    faults = [f"{finding.act}: {finding.seen}" for finding in findings if not finding.ok]
    return document_of(faults, **figures, matrix=[asdict(finding) for finding in findings])
