"""Charts of lines."""

from typing import Any

from needlefem.output.driver import renderer


def line_chart(plotter: Any, title: str, x: str, y: str) -> Any:
    """Return an empty chart that fills a plotter's active panel."""
    chart = renderer().Chart2D()
    chart.title = title
    chart.x_label, chart.y_label = x, y
    for axis in (chart.x_axis, chart.y_axis):
        axis.label_size, axis.tick_label_size = 26, 22
    chart.GetTitleProperties().SetFontSize(28)
    chart.GetLegend().SetLabelSize(22)
    plotter.add_chart(chart)
    return chart
