"""When a render stops."""

from __future__ import annotations

from dataclasses import dataclass

from lutgen.errors import InputError, in_range, whole

SAMPLES, SECONDS, NOISE = (1, 10**7), (0.1, 1e6), (0.01, 100.0)
DEFAULT_SAMPLES = 256
_UNITS = {"s": 1.0, "m": 60.0, "h": 3600.0}


@dataclass(frozen=True)
class Goal:
    """When to stop: samples a pixel, seconds of this run, mean ΔE00 of a pixel's noise; None: does not matter."""

    samples: int | None = None
    seconds: float | None = None
    noise: float | None = None


def goal_of(samples: int | None, seconds: str | None, noise: float | None) -> Goal:
    """The goal of a command's options, 256 samples without any; InputError where one is out of range.

    >>> goal_of(None, "2m", None).seconds
    120.0
    """
    if samples is not None:
        whole("spp", samples, *SAMPLES)
    if noise is not None:
        in_range("noise", noise, *NOISE, " (ΔE00)")
    limit = None
    if seconds is not None:
        number, unit = (seconds[:-1], seconds[-1]) if seconds[-1:] in _UNITS else (seconds, "s")
        try:
            limit = float(number) * _UNITS[unit]
        except ValueError as error:
            raise InputError(f"time = {seconds!r}: seconds are needed, for example 60s, 5m or 1h") from error
        in_range("time", limit, *SECONDS, " s")
    if samples is None and limit is None and noise is None:
        samples = DEFAULT_SAMPLES
    return Goal(samples, limit, noise)
