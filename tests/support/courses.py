"""Small courses for tests, made without a file."""

import numpy as np

from race_server.scenario.track.course import Course


def ring(radius: float = 20.0, half_width: float = 2.0, gates: int = 8, places: int = 10) -> Course:
    """Return a circular course driven counter-clockwise, the timing line on the east side."""
    samples = round(2.0 * np.pi * radius / 0.1)
    angle = np.linspace(0.0, 2.0 * np.pi, samples, endpoint=False)
    heading = (angle + 0.5 * np.pi + np.pi) % (2.0 * np.pi) - np.pi
    line = np.stack(
        [
            radius * np.cos(angle),
            radius * np.sin(angle),
            heading,
            np.full(samples, 1.0 / radius),
        ],
        axis=1,
    )
    borders = []
    for edge in (radius - half_width, radius + half_width):
        points = edge * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        borders.append(np.hstack([points, np.roll(points, -1, axis=0)]))
    length = 2.0 * np.pi * radius
    back = -(1.0 + np.arange(places)) / radius
    grid = np.stack([radius * np.cos(back), radius * np.sin(back), back + 0.5 * np.pi], axis=1)
    box = np.array([0.25, 0.5, 0.75]) * 2.0 * np.pi
    return Course(
        name="ring",
        title="Ring",
        spacing=length / samples,
        line=line,
        half_widths=np.full((samples, 2), half_width),
        kerb=0.0,
        grass=0.0,
        borders=np.concatenate(borders),
        gates=np.arange(gates) * length / gates,
        sectors=(gates // 2, 0),
        grid=grid,
        spots=radius * np.stack([np.cos(box), np.sin(box)], axis=1),
        obstacles=(),
        starts=np.zeros((0, 6)),
        width_min=2.0 * half_width,
        width_mean=2.0 * half_width,
        width_max=2.0 * half_width,
        digest="ring",
    )


SMALL_RING = ring(radius=6.0, half_width=0.7)  # a lap of 37.7 m
TINY_RING = ring(radius=2.5, half_width=0.7)  # a lap of 15.7 m
