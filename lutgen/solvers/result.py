"""What a solver returns."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Reflectance:
    """Shares of light that fell along the normal: diffuse, specular, transmitted; std_error is the diffuse share's.

    >>> Reflectance(diffuse=0.29, specular=0.0278).transmitted
    0.0
    """

    diffuse: float
    specular: float
    transmitted: float = 0.0
    std_error: float = 0.0
