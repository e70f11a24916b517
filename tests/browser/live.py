"""Watches a run that goes on, from its first samples to its end.

Usage: live.py [--axe axe.min.js] URL [PICTURE]. Exit status as of pages.py.
"""

import pathlib
import sys
import time

import devtools
from pages import AXE, LAYOUT, PLOTS


def main(arguments):
    if devtools.program() is None:
        print("SKIPPED: there is no Chromium (Debian: apt-get install chromium)")
        return 3
    axe = None
    if arguments[:1] == ["--axe"]:
        axe = pathlib.Path(arguments[1]).read_text(encoding="utf-8")
        arguments = arguments[2:]
    url = arguments[0]
    faults = []
    with devtools.Browser() as browser:
        browser.size(400)
        browser.open(url)
        seen = set()
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline:
            state = browser.run("document.getElementById('state').dataset.state") or "waiting"
            if state == "running" and state not in seen:
                time.sleep(0.7)
                faults += browser.run(LAYOUT) + browser.run(PLOTS)
                if arguments[1:]:
                    browser.picture(arguments[1])
            seen.add(state)
            if state in ("ended", "tripped"):
                break
            time.sleep(0.1)
        if axe:
            browser.run(axe + "; true")
            faults += browser.run(AXE)
        words = browser.run("document.getElementById('state').textContent")
        print(f"{sorted(seen)}: {words}")
        if "running" not in seen or not seen & {"ended", "tripped"}:
            faults.append(f"the page went through {sorted(seen)} only")
        outside = [asked for asked in browser.requests if not asked.startswith((url, "data:"))]
        faults += [f"asked for {asked}" for asked in outside]
        faults += [f"complained: {text}" for text in browser.complaints]
    print("\n".join(faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
