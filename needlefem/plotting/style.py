"""How everything in pictures looks."""

import dataclasses


@dataclasses.dataclass(frozen=True, kw_only=True)
class Style:
    """How everything looks; colours are safe for the colour-blind (Okabe and Ito).

    Widths are in pixels, `text_size` over the smaller side of a panel. The colour map is one of
    matplotlib's perceptually uniform ones.
    """

    background: str = "white"
    tissue: tuple[str, ...] = ("#f4e7c5", "#e3b5a4", "#c9d5e8", "#cfe3cf", "#dcc9e6", "#d2c6ae")
    mesh: str = "#8a7f6a"
    outline: str = "#5b3a29"
    on_image: str = "#f0e442"
    on_field: str = "white"
    needle: str = "#20262e"
    seed: str = "#0072B2"
    target: str = "#D55E00"
    path: str = "#009E73"
    obstacle: str = "#8c8f94"
    support: str = "#56606b"
    folded: str = "#D55E00"
    text: str = "#202020"
    grid: str = "#e4e4e4"
    colour_map: str = "viridis"
    mesh_width: float = 0.6
    outline_width: float = 3.0
    path_width: float = 3.0
    text_size: float = 0.034
    smallest_text: int = 9
