"""Hatchling as the build backend, with the metadata apart from the wheel.

Hatchling leaves that function out when pip asks, because build hooks may change the metadata. Ours do not, and
without it pip compiles the whole program while it prints "Preparing metadata".
"""

import os

os.environ.pop("PIP_BUILD_TRACKER", None)

from hatchling.build import *  # noqa: E402, F403
