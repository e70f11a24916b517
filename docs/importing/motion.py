"""The motion that the examples of this folder play: a sine of 1 Hz that begins and ends at rest."""

import math

STEP = 0.002  # s, the period of the controllers
DURATION = 6.0  # s
AMPLITUDE = 0.5 * 0.0254  # m
FREQUENCY = 2.0 * math.pi  # rad/s


def reference(time):
    """Displacement (m), velocity (m/s) and acceleration (m/s2) at `time` (s)."""
    # The envelope sin2 over the whole duration, with its derivatives.
    slow = math.pi / DURATION
    envelope = math.sin(slow * time) ** 2
    first = slow * math.sin(2.0 * slow * time)
    second = 2.0 * slow**2 * math.cos(2.0 * slow * time)
    sine, cosine = math.sin(FREQUENCY * time), math.cos(FREQUENCY * time)
    return (
        AMPLITUDE * envelope * sine,
        AMPLITUDE * (first * sine + envelope * FREQUENCY * cosine),
        AMPLITUDE
        * (second * sine + 2.0 * first * FREQUENCY * cosine - envelope * FREQUENCY**2 * sine),
    )


def report(rows):
    """Prints the largest error of pairs (wanted, reached) in percent of the amplitude."""
    error = max(abs(wanted - reached) for wanted, reached in rows) / AMPLITUDE
    peak = max(abs(reached) for _, reached in rows)
    print(f"peak {1e3 * peak:.3f} mm, largest error {100 * error:.2f} % of the amplitude")
    return error
