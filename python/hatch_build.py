"""Puts the program and its FMUs into the wheel.

`dist/release` names them: SHAKEBENCH_PAYLOAD is a folder with the program, `fmus/` and `licences/`,
SHAKEBENCH_WHEEL_TAG the platform they are for. Without them the wheel holds Python alone and runs
the program of the checkout that it is installed from.
"""

import os
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Payload(BuildHookInterface):
    def initialize(self, version, build_data):
        payload = os.environ.get("SHAKEBENCH_PAYLOAD")
        if payload is None or version == "editable":
            return
        for file in sorted(Path(payload).rglob("*")):
            if file.is_file():
                inside = Path("shakebench/program") / file.relative_to(payload)
                build_data["force_include"][str(file)] = inside.as_posix()
        build_data["pure_python"] = False
        build_data["tag"] = "py3-none-" + os.environ["SHAKEBENCH_WHEEL_TAG"]
