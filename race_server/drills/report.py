"""What a drill finds, as one document."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Finding:
    """One thing that was tried."""

    act: str
    expected: str
    seen: str
    ok: bool


def document_of(findings: Sequence[Finding], **figures: Any) -> dict[str, Any]:
    """Return the document of a drill: `ok`, its figures, and `why` where it is not ok."""
    failed = [f"{finding.act}: {finding.seen}" for finding in findings if not finding.ok]
    document = {"ok": not failed, **figures, "matrix": [asdict(finding) for finding in findings]}
    return document | ({"why": "; ".join(failed)} if failed else {})
