"""Charts with logarithmic axes as inline SVG: errors over unknowns or seconds, times as bars."""

import dataclasses
import math
from collections.abc import Sequence
from html import escape

COLOURS = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#7F7F7F",
)  # fmt: skip
"""Safe for the colour-blind (Okabe and Ito)."""
DASHES = ("", "7 4", "2 3", "9 3 2 3")
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 560.0, 340.0, 64.0, 172.0, 30.0, 44.0
ROW, BAR, LONGEST, LETTER = 19.0, 12.0, 290.0, 6.6
"""Of bars: height of a row and of the bar in it, length of the longest, width of a letter."""


@dataclasses.dataclass(frozen=True)
class ChartLine:
    """A named line of positive numbers; `ringed` are the places of points that stand out."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    ringed: Sequence[int] = ()


@dataclasses.dataclass(frozen=True)
class Bar:
    """A named positive number with the least and the most that was found; of a series."""

    name: str
    value: float
    least: float | None = None
    most: float | None = None
    series: int = 0


class _Axis:
    """A logarithmic axis over whole powers of ten, from `begin` to `end` in pixels."""

    def __init__(self, values: Sequence[float], begin: float, end: float) -> None:
        low, high = math.log10(min(values)), math.log10(max(values))
        self.low, self.high = math.floor(low - 0.02), math.ceil(high + 0.02)
        self._begin, self._scale = begin, (end - begin) / (self.high - self.low)

    def at(self, value: float) -> float:
        return self._begin + (math.log10(value) - self.low) * self._scale

    @property
    def ticks(self) -> list[int]:
        step = 1 if self.high - self.low <= 7 else 2
        return list(range(self.low, self.high + 1, step))


def loglog(
    title: str, x_label: str, y_label: str, lines: Sequence[ChartLine], slopes: Sequence[float] = ()
) -> str:
    """Return a chart; `slopes` are drawn as triangles: what theory says of the lines.

    Lines with a number that is not positive (an exact answer) are left out.
    """
    shown = [line for line in lines if min(*line.x, *line.y) > 0.0]
    if not shown:
        return ""
    across = _Axis([x for line in shown for x in line.x], LEFT, WIDTH - RIGHT)
    up = _Axis([y for line in shown for y in line.y], HEIGHT - BOTTOM, TOP)
    parts = [*_frame(title, x_label, y_label, across, up)]
    for number, line in enumerate(shown):
        parts += _line(number, line, across, up)
    for number, slope in enumerate(sorted(set(slopes))):
        parts.append(_triangle(slope, number, across, up))
    size = f'viewBox="0 0 {WIDTH:g} {HEIGHT:g}"'
    label = escape(title, quote=True)
    return f'<svg {size} role="img" aria-label="{label}">{"".join(parts)}</svg>'


def bars(title: str, label: str, rows: Sequence[Bar]) -> str:
    """Return a chart of bars on one logarithmic axis, with whiskers from the least to the most.

    What is not positive is left out.
    """
    shown = [bar for bar in rows if bar.value > 0.0 and (bar.least is None or bar.least > 0.0)]
    if not shown:
        return ""
    ends = [end for bar in shown for end in (bar.value, bar.least, bar.most) if end is not None]
    names = 24.0 + LETTER * max(len(bar.name) for bar in shown)
    across = _Axis(ends, names, names + LONGEST)
    bottom = TOP + ROW * len(shown) + 4.0
    parts = [_text(12.0, 16.0, title, 'class="title"')]
    for power in across.ticks:
        x = across.at(10.0**power)
        parts.append(f'<path class="grid" d="M{x:.1f} {TOP:g}V{bottom:g}"/>')
        parts.append(_power(x, bottom + 18.0, power, 'text-anchor="middle"'))
    for number, bar in enumerate(shown):
        parts += _bar(bar, TOP + ROW * (number + 0.5) + 2.0, across, names)
    middle = names + 0.5 * LONGEST
    parts.append(_text(middle, bottom + BOTTOM - 8.0, label, 'text-anchor="middle"'))
    size = f'viewBox="0 0 {names + LONGEST + 24.0:g} {bottom + BOTTOM:g}"'
    called = escape(title, quote=True)
    return f'<svg {size} role="img" aria-label="{called}">{"".join(parts)}</svg>'


def _bar(bar: Bar, y: float, across: _Axis, names: float) -> list[str]:
    colour = COLOURS[bar.series % len(COLOURS)]
    left, right = across.at(10.0**across.low), across.at(bar.value)
    box = f'x="{left:.1f}" y="{y - 0.5 * BAR:.1f}" width="{right - left:.1f}" height="{BAR:g}"'
    parts = [
        _text(names - 8.0, y + 4.0, bar.name, 'text-anchor="end"'),
        f'<rect {box} fill="{colour}" fill-opacity="0.75"/>',
    ]
    if bar.least is not None and bar.most is not None:
        low, high = across.at(bar.least), across.at(bar.most)
        ends = f"M{low:.1f} {y - 3:.1f}v6M{high:.1f} {y - 3:.1f}v6"
        line = f'd="M{low:.1f} {y:.1f}H{high:.1f}{ends}"'
        parts.append(f'<path {line} fill="none" stroke="#000000" stroke-width="1.2"/>')
    return parts


def _text(x: float, y: float, text: str, extra: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" {extra}>{escape(text)}</text>'


def _power(x: float, y: float, power: int, extra: str) -> str:
    raised = f'<tspan dy="-5" font-size="9">{power}</tspan>'
    return f'<text x="{x:.1f}" y="{y:.1f}" {extra}>10{raised}</text>'


def _frame(title: str, x_label: str, y_label: str, across: _Axis, up: _Axis) -> list[str]:
    right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
    parts = [_text(LEFT, 16.0, title, 'class="title"')]
    for power in across.ticks:
        x = across.at(10.0**power)
        parts.append(f'<path class="grid" d="M{x:.1f} {TOP:g}V{bottom:g}"/>')
        parts.append(_power(x, bottom + 18.0, power, 'text-anchor="middle"'))
    for power in up.ticks:
        y = up.at(10.0**power)
        parts.append(f'<path class="grid" d="M{LEFT:g} {y:.1f}H{right:g}"/>')
        parts.append(_power(LEFT - 8.0, y + 4.0, power, 'text-anchor="end"'))
    middle = 0.5 * (LEFT + right)
    parts.append(_text(middle, HEIGHT - 8.0, x_label, 'text-anchor="middle"'))
    turn = f'text-anchor="middle" transform="rotate(-90 14 {0.5 * (TOP + bottom):.1f})"'
    parts.append(_text(14.0, 0.5 * (TOP + bottom), y_label, turn))
    return parts


def _line(number: int, line: ChartLine, across: _Axis, up: _Axis) -> list[str]:
    colour = COLOURS[number % len(COLOURS)]
    dash = DASHES[(number // 2) % len(DASHES)]
    points = [(across.at(x), up.at(y)) for x, y in zip(line.x, line.y, strict=True)]
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    stroke = f'fill="none" stroke="{colour}" stroke-width="1.8" stroke-dasharray="{dash}"'
    parts = [f'<polyline points="{path}" {stroke}/>']
    parts += [_marker(number, x, y, colour) for x, y in points]
    ring = f'r="6.4" fill="none" stroke="{colour}" stroke-width="1.4"'
    parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" {ring}/>'
              for x, y in (points[place] for place in line.ringed)]  # fmt: skip
    at = TOP + 8.0 + 17.0 * number
    x = WIDTH - RIGHT + 14.0
    parts.append(f'<path d="M{x:g} {at:g}h22" {stroke}/>')
    parts.append(_marker(number, x + 11.0, at, colour))
    parts.append(_text(x + 30.0, at + 4.0, line.name))
    return parts


def _marker(number: int, x: float, y: float, colour: str) -> str:
    if number % 3 == 0:
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.4" fill="{colour}"/>'
    if number % 3 == 1:
        return f'<rect x="{x - 3:.1f}" y="{y - 3:.1f}" width="6" height="6" fill="{colour}"/>'
    return f'<path d="M{x - 4:.1f} {y + 3:.1f}h8l-4 -7z" fill="{colour}"/>'


def _triangle(slope: float, number: int, across: _Axis, up: _Axis) -> str:
    """Draw a triangle of a slope over half a power of ten, from the lower left."""
    begin, low = across.low + 0.15, up.low + 0.12 + 0.75 * number
    high = min(low + 0.5 * abs(slope), up.high)
    x0, x1 = across.at(10.0**begin), across.at(10.0 ** (begin + (high - low) / abs(slope)))
    y0, y1 = up.at(10.0**low), up.at(10.0**high)
    path = f'<path class="slope" d="M{x0:.1f} {y1:.1f}V{y0:.1f}H{x1:.1f}Z"/>'
    return path + _text(x1 + 4.0, y0, f"slope {slope:g}", 'class="small"')
