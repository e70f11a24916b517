"""Watches a run that goes on, from its first samples to its end.

Usage: live.py [--axe axe.min.js] [--tune VARIABLE VALUE] URL [PICTURE]. With --tune it also asks for a value
beyond all bounds, and then for this one. Exit status as of pages.py.
"""

import json
import pathlib
import sys
import time

import devtools
from pages import LAYOUT, PLOTS, WIDTHS, accessible, by_keyboard


# Writes a value into the field of a parameter and submits it; gives the message.
TUNE = """
(async (name, value) => {
  const rows = [...document.querySelectorAll("form.knob")];
  const row = rows.find((own) => own.querySelector("strong").textContent === name);
  row.querySelector("input").value = value;
  row.requestSubmit();
  await new Promise((done) => setTimeout(done, 400));
  return document.querySelector(".tuning [role=alert]").textContent;
})(%s, %s)
"""


def tuned(browser, variable, value):
    """What is wrong with changing a parameter on the page."""
    faults = []
    said = browser.run(TUNE % (json.dumps(variable), json.dumps("1e9")))
    if "expected" not in said:
        faults.append(f"a value beyond its bounds: {said!r}")
    said = browser.run(TUNE % (json.dumps(variable), json.dumps(value)))
    listed = browser.run("document.querySelector('.tuning ol').textContent")
    if said or variable not in listed:
        faults.append(f"{variable} = {value}: {said!r}, {listed!r}")
    print(f"changed: {listed}")
    return faults


def main(arguments):
    if devtools.program() is None:
        print("SKIPPED: there is no Chromium (Debian: apt-get install chromium)")
        return 3
    axe = None
    if arguments[:1] == ["--axe"]:
        axe = pathlib.Path(arguments[1]).read_text(encoding="utf-8")
        arguments = arguments[2:]
    wish = None
    if arguments[:1] == ["--tune"]:
        wish = arguments[1:3]
        arguments = arguments[3:]
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
                if wish:
                    faults += tuned(browser, *wish)
                    time.sleep(0.7)
                faults += browser.run(LAYOUT) + browser.run(PLOTS)
                if arguments[1:]:
                    browser.picture(arguments[1])
            seen.add(state)
            if state in ("ended", "tripped"):
                break
            time.sleep(0.1)
        for width in WIDTHS:
            browser.size(width)
            found = browser.run(LAYOUT) + by_keyboard(browser)
            if axe:
                found += accessible(browser, axe)
            faults += [f"at {width} px: {one}" for one in found]
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
