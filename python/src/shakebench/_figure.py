"""The picture of a run in a notebook: the table's acceleration on its reference."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, List, Tuple

import numpy as np

if TYPE_CHECKING:
    from ._simulation import Run

WIDTH, HEIGHT = 760, 240
LEFT, RIGHT, TOP, BOTTOM = 58, 12, 12, 34
# The pair of curves, the thing asked for below what was done.
SIGNALS = (
    ("reference.acceleration", "reference", "#8a8f98", 2.2),
    ("table.acceleration", "table", "#1f5fa8", 1.1),
)
GRAVITY = 9.80665


def picture(run: "Run") -> str:
    """HTML with figures and an SVG of the run; figures alone where it has no table."""
    words = [html.escape(f"{run.summary['system']} on {run.summary['motion']['name']}: {run.ended}")]
    if run.tracking:
        words.append(f"error {run.tracking['time_domain_percent']:.2f} %")
    text = ", ".join(words)
    drawn = [signal for signal in SIGNALS if signal[0] in run]
    if not drawn or len(run.array) < 2:
        return f"<p>{text}</p>"
    time = run["time"]
    curves = [(label, colour, width, run[name] / GRAVITY) for name, label, colour, width in drawn]
    most = max(float(np.abs(values).max()) for _, _, _, values in curves) or 1.0
    ticks = _ticks(most)
    top = max(most, ticks[-1]) * 1.02
    begin, end = float(time[0]), float(time[-1])

    def x(at: float) -> float:
        return LEFT + (at - begin) / (end - begin) * (WIDTH - LEFT - RIGHT)

    def y(value: float) -> float:
        return TOP + (1 - value / top) / 2 * (HEIGHT - TOP - BOTTOM)

    parts: List[str] = []
    for tick in sorted({-tick for tick in ticks} | set(ticks)):
        parts.append(
            f'<path d="M{LEFT} {y(tick):.1f}H{WIDTH - RIGHT}" stroke="#8884"/>'
            f'<text x="{LEFT - 6}" y="{y(tick) + 4:.1f}" text-anchor="end">{tick:g}</text>'
        )
    for tick in _ticks(end - begin):
        place = x(begin + tick)
        parts.append(f'<text x="{place:.1f}" y="{HEIGHT - 18}" text-anchor="middle">{begin + tick:g}</text>')
    for label, colour, width, values in curves:
        points = " ".join(f"{x(a):.1f},{y(b):.1f}" for a, b in _thinned(time, values))
        parts.append(
            f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{width}">'
            f"<title>{label}</title></polyline>"
        )
    names = " and ".join(f"{label} ({colour})" for label, colour, _, _ in curves)
    legend = "".join(
        f'<tspan fill="{colour}" dx="10">{label}</tspan>' for label, colour, _, _ in curves
    )
    return (
        f"<p>{text}</p>"
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="100%" style="max-width:{WIDTH}px" role="img" '
        f'aria-label="Acceleration in g over time in s: {html.escape(names)}" '
        'font-family="sans-serif" font-size="12" fill="currentColor">'
        + "".join(parts)
        + f'<text x="{WIDTH / 2:.0f}" y="{HEIGHT - 3}" text-anchor="middle">time, s</text>'
        f'<text transform="translate(12 {(HEIGHT - BOTTOM) / 2:.0f}) rotate(-90)" '
        f'text-anchor="middle">acceleration, g</text><text x="{LEFT}" y="{TOP}">{legend}</text></svg>'
    )


def _ticks(most: float) -> List[float]:
    """Round numbers from 0 to at most ``most``, about four of them."""
    size = 10.0 ** np.floor(np.log10(most / 4))
    step = size * min(s for s in (1, 2, 2.5, 5, 10) if s * size >= most / 4 * 0.999)
    return [float(round(k * step, 12)) for k in range(int(most / step + 1e-9) + 1)]


def _thinned(time: np.ndarray, values: np.ndarray) -> List[Tuple[float, float]]:
    """At most two points per pixel: least and greatest value of each group of samples."""
    group = -(-len(values) // (WIDTH - LEFT - RIGHT))
    if group < 3:
        return list(zip(time, values))
    points: List[Tuple[float, float]] = []
    for first in range(0, len(values), group):
        part = values[first : first + group]
        for at in sorted((int(part.argmin()), int(part.argmax()))):
            points.append((time[first + at], part[at]))
    return points
