"""The fence of a kart, from the map that the server gives."""

from race_agents.unit.fence import CourseFence, Fence, LotFence
from race_server.net.wire.lobby import CourseSheet


def fence_of(sheet: CourseSheet) -> Fence:
    """Return the course as the kart may use it."""
    if len(sheet.line):
        return CourseFence.of(sheet.line, sheet.half_widths, sheet.kerb, sheet.borders)
    corners = sheet.borders.reshape(-1, 2)
    (x0, y0), (x1, y1) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return LotFence((x0, y0), (x1, y1))
