"""Puts the program, its native library and its FMUs into the wheel.

`dist/release` names them: SHAKEBENCH_PAYLOAD is a folder with the program, the library, `fmus/` and
`licences/`, SHAKEBENCH_WHEEL_TAG the platform they are for. Without it (`pip install ./python`) they are
built here, by the cargo of this machine.
"""

import json
import os
import shutil
import subprocess
import sysconfig
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

CHECKOUT = Path(__file__).resolve().parent.parent
PACKAGES = ("shakebench", "hybrid-benchmark", "shakebench-native")
SUFFIX = ".exe" if os.name == "nt" else ""
PROGRAMS = ("shakebench" + SUFFIX, "shakebench-hybrid" + SUFFIX)
LIBRARIES = ("libshakebench_native.so", "libshakebench_native.dylib", "shakebench_native.dll")


class Payload(BuildHookInterface):
    def initialize(self, version, build_data):
        if version == "editable":
            # It runs what the checkout has.
            return
        payload = os.environ.get("SHAKEBENCH_PAYLOAD")
        tag = os.environ.get("SHAKEBENCH_WHEEL_TAG")
        if payload is None:
            payload = self.build()
            tag = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        for file in sorted(Path(payload).rglob("*")):
            if file.is_file():
                inside = Path("shakebench/program") / file.relative_to(payload)
                build_data["force_include"][str(file)] = inside.as_posix()
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{tag}"

    def build(self):
        """Compiles everything in the checkout; gives the folder of what is installed."""
        if not (CHECKOUT / "Cargo.toml").is_file():
            raise SystemExit(
                "error: the sources of the program are not beside this folder; install from a checkout: "
                "`pip install ./python`"
            )
        cargo = shutil.which("cargo")
        if cargo is None:
            raise SystemExit(
                "error: cargo is not installed; install Rust 1.89 or newer, or install a wheel of a release"
            )
        self.app.display_info("building the program with cargo (some minutes the first time)")
        command = [cargo, "build", "--release", "--locked"]
        for package in PACKAGES:
            command += ["-p", package]
        metadata = [cargo, "metadata", "--format-version", "1", "--no-deps", "--offline"]
        self.run(command)
        told = subprocess.run(metadata, cwd=CHECKOUT, stdout=subprocess.PIPE, check=True)
        built = Path(json.loads(told.stdout)["target_directory"]) / "release"
        payload = built.parent / "wheel"
        shutil.rmtree(payload, ignore_errors=True)
        payload.mkdir(parents=True)
        for name in (*PROGRAMS, *LIBRARIES):
            if (built / name).is_file():
                shutil.copy2(built / name, payload / name)
        self.run([str(built / PROGRAMS[0]), "build", "--out", str(payload / "fmus")])
        licences = payload / "licences"
        licences.mkdir()
        for name in ("LICENSE-APACHE", "LICENSE-MIT"):
            shutil.copy2(CHECKOUT / name, licences / name)
        return payload

    @staticmethod
    def run(command):
        done = subprocess.run(command, cwd=CHECKOUT, stdout=subprocess.DEVNULL)
        if done.returncode:
            raise SystemExit(f"error: `{' '.join(command[:3])} ...` failed; see above")
