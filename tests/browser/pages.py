"""Opens pages in a real browser, uses their controls and checks what they show.

Usage: pages.py [--pictures DIR] [--axe axe.min.js] PAGE.html...

With axe-core (the npm package) every page is checked for accessibility, light and dark. Beside a page, `summary.json` of a run is compared with the figures on it. Exit status 1 and a line
for each fault; 3 where there is no browser.
"""

import json
import pathlib
import re
import sys

import devtools

# A phone and a desk.
WIDTHS = [400, 1280]

LAYOUT = r"""(() => {
  const wide = document.documentElement.scrollWidth - innerWidth;
  const faults = wide > 0 ? [`the page is ${wide} px wider than the screen`] : [];
  const shown = (e) => e.offsetParent !== null && getComputedStyle(e).visibility !== "hidden";
  for (const e of document.querySelectorAll("main *, header *, footer *")) {
    if (!shown(e) || e.closest("svg, canvas, .uplot, noscript")) continue;
    const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!own) continue;
    const range = document.createRange();
    range.selectNodeContents(e);
    const box = range.getBoundingClientRect();
    // Headings of a table that is shown as a list are there for screen readers.
    if (e.closest("thead") && box.width <= 1.5) continue;
    if (e.closest("thead") && innerWidth < 640) continue;
    if (box.width > 0 && (box.right > innerWidth + 1 || box.left < -1)) {
      faults.push(`cut off: "${e.textContent.trim().slice(0, 60)}" reaches ${Math.round(box.right)} px`);
    }
  }
  for (const e of document.querySelectorAll(".scroll, figure, .chart")) {
    if (e.scrollWidth > e.clientWidth + 1) faults.push(`${e.className || e.tagName} is wider than its place: ${e.scrollWidth} of ${e.clientWidth} px`);
  }
  return faults;
})()"""

PLOTS = r"""(() => {
  const faults = [];
  for (const place of document.querySelectorAll("figure:not([hidden]) .chart")) {
    const title = place.closest("figure").querySelector("figcaption").firstChild.textContent;
    const canvas = place.querySelector("canvas");
    if (!canvas) { faults.push(`"${title}" has no canvas: ${place.textContent}`); continue; }
    const { data, width, height } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    // Coloured pixels: axes and grid are grey.
    let coloured = 0;
    for (let n = 0; n < data.length; n += 4) {
      const [r, g, b, a] = [data[n], data[n + 1], data[n + 2], data[n + 3]];
      if (a > 60 && Math.max(r, g, b) - Math.min(r, g, b) > 40) coloured++;
    }
    if (coloured < 30) faults.push(`"${title}" shows nothing (${coloured} coloured pixels of ${width} x ${height})`);
  }
  return faults;
})()"""

CONTROLS = r"""(async () => {
  const faults = [];
  // A plot by its keys alone.
  const keyboard = async (figure) => {
    const wrong = [];
    const place = figure.querySelector(".chart");
    const press = (at, key) => at.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
    const shown = () => figure.querySelectorAll(".readout td").length;
    place.focus();
    if (document.activeElement !== place) wrong.push("a plot cannot be focused");
    if (!/: .* to /.test(place.querySelector("canvas").getAttribute("aria-label"))) wrong.push("a plot has no words");
    for (const key of ["+", "ArrowRight", ".", "a", ">", "b"]) press(place, key);
    await new Promise((done) => setTimeout(done, 50));
    const between = figure.querySelector(".readout tbody tr td:last-child");
    if (!between || !(parseFloat(between.textContent) > 0)) wrong.push(`the cursors differ by ${between && between.textContent}`);
    press(place, "Escape");
    if (shown()) wrong.push("Escape leaves cursors");
    press(place, "0");
    const button = figure.querySelector(".u-legend [role=button]");
    press(button, "Enter");
    if (button.getAttribute("aria-pressed") !== "false") wrong.push("a legend does not hide its curve");
    press(button, " ");
    if (button.getAttribute("aria-pressed") !== "true") wrong.push("a legend does not show its curve again");
    return wrong;
  };
  const root = document.documentElement;
  for (const system of ["si", "laboratory"]) {
    document.querySelector(`[data-set-units="${system}"]`).click();
    if (root.dataset.units !== system) faults.push(`units: ${root.dataset.units} after a click on ${system}`);
    for (const cell of document.querySelectorAll(".laboratory, .si")) {
      const shown = cell.offsetParent !== null;
      if (shown && !cell.classList.contains(system)) { faults.push(`"${cell.textContent}" is shown in ${system}`); break; }
    }
  }
  for (const theme of ["dark", "light"]) {
    document.querySelector(`[data-set-theme="${theme}"]`).click();
    if (root.dataset.theme !== theme) faults.push(`colours: ${root.dataset.theme} after a click on ${theme}`);
  }
  const blobs = [];
  const make = URL.createObjectURL;
  URL.createObjectURL = (blob) => { blobs.push(blob); return make.call(URL, blob); };
  const figures = [...document.querySelectorAll("figure:not([hidden])")].filter((f) => f.querySelector(".chart"));
  for (const figure of figures) {
    figure.querySelector('[data-export="csv"]').click();
    const text = blobs.length ? await blobs.pop().text() : "";
    const lines = text.trim().split("\n");
    const cells = (line) => line.replace(/"[^"]*"/g, "").split(",").length;
    if (lines.length < 2 || !lines.slice(1, 50).every((line) => cells(line) === cells(lines[0]))) {
      faults.push(`the data of "${figure.querySelector("figcaption").firstChild.textContent}" are no table: ${lines.slice(0, 2)}`);
    }
  }
  if (figures.length) {
    const saved = async (kind) => {
      figures[0].querySelector(`[data-export="${kind}"]`).click();
      for (let n = 0; n < 100 && !blobs.length; n++) await new Promise((done) => setTimeout(done, 50));
      return blobs.pop();
    };
    const picture = await saved("png");
    if (!picture || picture.type !== "image/png" || picture.size < 2000) faults.push("the picture is none");
    for (const [id, value] of [["figure-width", 85], ["figure-height", 60]]) document.getElementById(id).value = value;
    const drawing = await saved("svg");
    const svg = new DOMParser().parseFromString(drawing ? await drawing.text() : "", "image/svg+xml").documentElement;
    const curves = svg.querySelectorAll("g path[d]").length;
    if (svg.nodeName !== "svg" || Math.round(svg.getAttribute("width")) !== 321 || !curves) faults.push(`the SVG is ${svg.nodeName}, ${svg.getAttribute("width")} px, ${curves} curves`);
    // A plot with room between two cursors: twelve samples at least.
    const panels = JSON.parse(document.getElementById("panels").textContent);
    const samples = (figure) => {
      const panel = panels[figure.querySelector(".chart").dataset.panel];
      // Four bytes each, in base64.
      return panel ? Math.max(0, ...panel.series.map((one) => one.y.length * 3 / 16)) : 0;
    };
    faults.push(...await keyboard(figures.find((figure) => samples(figure) > 12) || figures[0]));
  }
  URL.createObjectURL = make;
  return faults;
})()"""

# Text of the cell in row ROW and column COLUMN of the first table that has both.
CELL = r"""(([row, column]) => {
  for (const table of document.querySelectorAll("table.figures")) {
    const heads = [...table.querySelectorAll("thead tr > *")].map((th) => th.textContent);
    const at = heads.indexOf(column);
    const found = [...table.querySelectorAll("tbody tr")].find((tr) => tr.cells[0].textContent === row);
    if (at < 0 || !found) continue;
    const cell = found.cells[at];
    const own = cell.querySelector(`.${document.documentElement.dataset.units}`);
    return (own || cell).textContent;
  }
  return null;
})"""

INCH, GRAVITY = 0.0254, 9.80665
# Where a figure of summary.json stands: row, column, and what one of its unit is, US and SI.
FIGURES = [
    ("time_domain_percent", "acceleration, peak", "RMS error", (1, 1)),
    ("frequency_domain_percent", "acceleration, Fourier amplitudes to 25 Hz", "RMS error", (1, 1)),
    ("displacement_percent", "displacement, peak", "RMS error", (1, 1)),
    ("peak_displacement_m", "displacement, peak", "table", (INCH, 1e-3)),
    ("peak_displacement_error_m", "displacement, peak", "largest error", (INCH, 1e-3)),
    ("peak_acceleration_m_s2", "acceleration, peak", "table", (GRAVITY, GRAVITY)),
    ("peak_acceleration_error_m_s2", "acceleration, peak", "largest error", (GRAVITY, GRAVITY)),
]


def figures(browser, summary):
    """Faults of the figures on the page of a run."""
    faults = []
    tracking = summary.get("tracking") or {}
    for place, system in enumerate(["laboratory", "si"]):
        browser.run(f"document.querySelector('[data-set-units=\"{system}\"]').click()")
        for key, row, column, units in FIGURES:
            if key not in tracking:
                continue
            text = browser.run(f"{CELL}({json.dumps([row, column])})")
            number = re.match(r"[-−]?[\d.]+(e[-−]?\d+)?", text or "")
            if not number:
                faults.append(f"{key}: no number in {text!r} ({row}, {column})")
                continue
            shown = float(number.group().replace("−", "-"))
            expected = tracking[key] / units[place]
            digits = len(re.sub(r"e.*|[-−.]", "", number.group()).lstrip("0"))
            if abs(shown - expected) > 0.51 * 10.0 ** -(digits - 1) * abs(expected) + 1e-12:
                faults.append(f"{key}: {text} on the page, {expected} in summary.json ({system})")
    return faults


AXE = r"""(async () => {
  const found = await axe.run(document, { resultTypes: ["violations"] });
  return found.violations.map((one) => `${one.id}: ${one.help}: ${one.nodes.length} times, ${one.nodes[0].html.slice(0, 160)}`);
})()"""


def accessible(browser, axe):
    """Violations that axe-core finds, light and dark; a page without buttons for it follows the system."""
    browser.run(axe + "; true")
    found = []
    for theme in ["light", "dark"]:
        browser.theme(theme)
        found += [f"{theme}: {one}" for one in browser.run(AXE)]
    browser.theme("light")
    return found


# Everything that a mouse can use, numbered; what has the focus, and whether that can be seen.
USABLE = r"""(() => {
  const all = [...document.querySelectorAll("a[href], button, input, select, textarea, summary, [tabindex]")]
    .filter((one) => !one.disabled && one.tabIndex >= 0 && one.getClientRects().length
      && getComputedStyle(one).visibility !== "hidden");
  all.forEach((one, n) => { one.dataset.usable = n; });
  document.activeElement?.blur();
  return all.map((one) => (one.getAttribute("aria-label") || one.textContent || one.id || one.tagName).trim().slice(0, 40));
})()"""
FOCUSED = r"""(async () => {
  await new Promise(requestAnimationFrame);
  const one = document.activeElement, style = getComputedStyle(one);
  const shows = style.outlineStyle !== "none" && parseFloat(style.outlineWidth) > 0 || style.boxShadow !== "none";
  return [one.dataset.usable === undefined ? null : Number(one.dataset.usable), shows];
})()"""


def by_keyboard(browser):
    """What the tabulator does not reach, and what does not show that it has the focus."""
    names = browser.run(USABLE)
    reached, hidden = set(), set()
    for _ in range(len(names) + 2):
        browser.tab()
        number, shows = browser.run(FOCUSED)
        if number is not None:
            reached.add(number)
            if not shows:
                hidden.add(number)
    missed = [f"the keyboard does not reach `{name}`" for n, name in enumerate(names) if n not in reached]
    return missed + [f"`{names[n]}` does not show its focus" for n in sorted(hidden)]


def check(browser, page, pictures, axe):
    """Faults of one page."""
    faults = []
    for width in WIDTHS:
        browser.size(width)
        browser.complaints.clear()
        browser.requests.clear()
        browser.open(page.as_uri())
        took = browser.run("(() => { const t = performance.getEntriesByType('navigation')[0];"
                           " return t.loadEventEnd - t.responseEnd; })()")
        found = browser.run(LAYOUT) + browser.run(PLOTS)
        if width == WIDTHS[-1]:
            found += browser.run(CONTROLS) + browser.run(PLOTS)
        if axe:
            found += accessible(browser, axe)
        found += by_keyboard(browser)
        if width == WIDTHS[-1]:
            beside = page.parent / "summary.json"
            if beside.is_file():
                found += figures(browser, json.loads(beside.read_text()))
        outside = [url for url in browser.requests if not url.startswith((page.as_uri(), "data:", "blob:"))]
        found += [f"asked for {url}" for url in outside]
        found += [f"complained: {text}" for text in browser.complaints]
        faults += [f"{page} at {width} px: {fault}" for fault in found]
        print(f"{page.parent.name}/{page.name} at {width} px: {len(found)} faults, "
              f"{page.stat().st_size / 1e6:.2f} MB, drawn in {took:.0f} ms")
        if pictures:
            browser.picture(pictures / f"{page.parent.name}-{page.stem}-{width}.png")
    if pictures:
        browser.paper(pictures / f"{page.parent.name}-{page.stem}.pdf")
    return faults


def main(arguments):
    pictures = None
    if arguments[:1] == ["--pictures"]:
        pictures = pathlib.Path(arguments[1])
        pictures.mkdir(parents=True, exist_ok=True)
        arguments = arguments[2:]
    axe = None
    if arguments[:1] == ["--axe"]:
        axe = pathlib.Path(arguments[1]).read_text(encoding="utf-8")
        arguments = arguments[2:]
    if devtools.program() is None:
        print("SKIPPED: there is no Chromium (Debian: apt-get install chromium)")
        return 3
    faults = []
    with devtools.Browser() as browser:
        for page in arguments:
            faults += check(browser, pathlib.Path(page).resolve(), pictures, axe)
    print("\n".join(faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
