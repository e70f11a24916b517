(() => {
  const root = document.documentElement;
  const source = document.getElementById("panels");
  const panels = source ? JSON.parse(source.textContent) : [];
  const colour = (name) => getComputedStyle(root).getPropertyValue(name).trim();

  const floats = (text) => {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  };
  // Numbers as embedded, once; a value that is not finite is a gap.
  const gaps = (values) => Array.from(values, (v) => (Number.isFinite(v) ? v : null));
  for (const panel of panels) {
    for (const series of panel.series) {
      const y = gaps(floats(series.y));
      const upper = series.upper ? gaps(floats(series.upper)) : null;
      const x = Array.isArray(series.x)
        ? y.map((_, n) => series.x[0] + n * series.x[1])
        : Array.from(floats(series.x));
      series.key = Array.isArray(series.x) ? `${series.x}:${y.length}` : series.x;
      Object.assign(series, { x, y, upper });
    }
  }

  const digits = (value, span) => {
    if (value == null) return "";
    const size = Math.max(Math.abs(value), span * 1e-3);
    const text = size !== 0 && (size < 1e-4 || size >= 1e6)
      ? value.toExponential(3) : value.toPrecision(4);
    return (text.includes("e") ? text : String(+text)).replaceAll("-", "\u2212");
  };
  const named = (axis, unit) => axis.label + (unit[0] ? ` [${unit[0]}]` : "");

  // The columns uPlot wants: one ascending x for all series, merged where they differ.
  const columns = (panel, xUnit, yUnit) => {
    const groups = new Map();
    const roles = [];
    for (const series of panel.series) {
      let order = null;
      if (series.style === "points" || series.style === "path") {
        order = series.x.map((_, n) => n).sort((a, b) => series.x[a] - series.x[b]);
      }
      const pick = (values) => (order ? order.map((n) => values[n]) : values);
      const key = order ? `${series.key}:sorted` : series.key;
      if (!groups.has(key)) {
        const x = pick(series.x).map((v) => v / xUnit[1]);
        // Merging would make one of two points that stand above each other.
        if (order) x.forEach((v, n) => { if (n && v <= x[n - 1]) x[n] = x[n - 1] + Math.max(Math.abs(x[n - 1]) * 1e-12, 1e-300); });
        groups.set(key, [x]);
      }
      const scaled = (values) => pick(values).map((v) => {
        if (v == null || (panel.y.log && v <= 0)) return null;
        return v / yUnit[1];
      });
      const add = (values, role) => {
        groups.get(key).push(scaled(values));
        roles.push({ key, at: groups.get(key).length - 1, series, role });
      };
      add(series.y, "value");
      if (series.upper) add(series.upper, "upper");
    }
    const keys = [...groups.keys()];
    const merged = groups.size > 1 ? uPlot.join([...groups.values()]) : groups.get(keys[0]);
    let offset = 1;
    const first = new Map();
    for (const key of keys) {
      first.set(key, offset);
      offset += groups.get(key).length - 1;
    }
    let data = [merged[0]];
    for (const role of roles) data.push(merged[first.get(role.key) + role.at - 1]);
    if (panel.x.log) {
      const keep = data[0].map((x) => x > 0);
      data = data.map((column) => column.filter((_, n) => keep[n]));
    }
    return { data, roles };
  };

  // So many digits that no two ticks have the same label.
  const labels = (ticks) => {
    for (let count = 6; ; count++) {
      const all = ticks.map((tick) => (tick === null ? "" : String(+tick.toPrecision(count))));
      if (count >= 15 || new Set(all).size === all.length) return all;
    }
  };

  // Room for the longest label.
  const wide = (least) => (_, values) =>
    Math.max(least, 16 + 7 * Math.max(0, ...(values ?? []).map((label) => label.length)));

  // Ticks of a logarithmic axis: decades, 1-2-5 where few decades show, even steps within one.
  const logTicks = (low, high) => {
    if (!(low > 0 && high > low)) return [];
    const decades = Math.log10(high / low);
    const ticks = [];
    if (decades < 0.6) {
      const rough = (high - low) / 6;
      const power = 10 ** Math.floor(Math.log10(rough));
      const step = [1, 2, 5, 10].map((m) => m * power).find((m) => m >= rough);
      for (let n = Math.ceil(low / step); n * step <= high; n++) ticks.push(+(n * step).toPrecision(12));
      return ticks;
    }
    for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++) {
      for (const m of decades < 2.5 ? [1, 2, 5] : [1]) {
        const tick = Number(`${m}e${power}`);
        if (tick >= low && tick <= high) ticks.push(tick);
      }
    }
    return ticks;
  };

  // A line in the order of its values, which may turn back.
  const path = (series, xUnit, yUnit, stroke) => (u) => {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.beginPath();
    let pen = false;
    series.x.forEach((x, n) => {
      if (series.y[n] == null) { pen = false; return; }
      const at = [u.valToPos(x / xUnit[1], "x", true), u.valToPos(series.y[n] / yUnit[1], "y", true)];
      if (pen) ctx.lineTo(...at); else ctx.moveTo(...at);
      pen = true;
    });
    ctx.strokeStyle = stroke;
    ctx.lineWidth = 1.4 * devicePixelRatio;
    ctx.stroke();
    ctx.restore();
  };

  let charts = [];
  let printing = false;
  // Of the reference's peak, %.
  let tolerance = 0;
  const page = { colour, digits, charts: () => charts };
  const draw = (place) => {
    const panel = panels[Number(place.dataset.panel)];
    const system = root.dataset.units;
    const [xUnit, yUnit] = [panel.x[system], panel.y[system]];
    const { data, roles } = columns(panel, xUnit, yUnit);
    const span = (column) => {
      let low = Infinity;
      let high = -Infinity;
      for (const v of column) if (v != null) { low = Math.min(low, v); high = Math.max(high, v); }
      return high > low ? high - low : Math.abs(high) || 1;
    };
    const ySpan = Math.max(...data.slice(1).map(span));
    const bands = [];
    const drawn = [];
    const lines = [];
    const series = [{ label: named(panel.x, xUnit), value: (_, v) => digits(v, span(data[0])) }];
    roles.forEach(({ series: one, role }, n) => {
      const stroke = strokeOf(one);
      const is = (style) => one.style === style;
      const wide = one.colour === 0 && is("line");
      series.push({
        label: role === "upper" ? `${one.name}, upper` : one.name,
        stroke: is("path") ? "transparent" : wide ? `${stroke}88` : stroke,
        // A reference lies wide and pale behind what follows it, so that both are seen.
        width: is("points") || is("path") ? 0 : is("band") ? 0.6 : wide ? 4 : 1.2,
        pxAlign: 0,
        dash: is("dashed") ? [6, 4] : undefined,
        points: { show: is("points"), size: 6, fill: stroke, stroke },
        paths: is("points") || is("path") ? () => null : undefined,
        value: (_, v) => digits(v, ySpan),
      });
      if (role === "upper") bands.push({ series: [n + 1, n], fill: `${stroke}33` });
      if (is("path")) drawn.push(path(one, xUnit, yUnit, stroke));
      lines.push({
        name: series.at(-1).label, stroke, width: is("band") ? 0.6 : wide ? 3 : 1.2, dash: is("dashed"), points: is("points"),
        hidden: role === "upper",
        path: is("path") ? [one.x.map((v) => v / xUnit[1]), one.y.map((v) => (v == null ? null : v / yUnit[1]))] : null,
      });
    });
    const at = tolerance > 0 ? roles.findIndex(({ series: one }) => one.colour === 0 && one.style === "line") : -1;
    if (at >= 0) {
      // What may lie around the reference, and how much of each other curve does not.
      const asked = data[at + 1];
      const allowed = tolerance / 100 * Math.max(...asked.map((v) => Math.abs(v ?? 0)));
      roles.forEach((_, n) => {
        if (n === at) return;
        const both = data[n + 1].filter((v, k) => v != null && asked[k] != null).length;
        const out = data[n + 1].filter((v, k) => v != null && asked[k] != null && Math.abs(v - asked[k]) > allowed).length;
        if (both) series[n + 1].label = lines[n].name = `${lines[n].name} (${(100 * out / both).toPrecision(3)} % outside)`;
      });
      const stroke = colour("--series-0");
      for (const sign of [1, -1]) {
        data.push(asked.map((v) => (v == null ? null : v + sign * allowed)));
        const label = `${sign > 0 ? "+" : "\u2212"}${tolerance} % of the peak`;
        series.push({ label, stroke, width: 0.6, points: { show: false }, value: (_, v) => digits(v, ySpan) });
        lines.push({ name: label, stroke, width: 0.6 });
      }
      bands.push({ series: [data.length - 2, data.length - 1], fill: `${stroke}22` });
    }
    const ink = colour("--soft");
    const axis = (which, unit, size) => ({
      ...(which.log && {
        splits: (_, __, low, high) => logTicks(low, high),
        filter: (_, ticks) => ticks,
      }),
      values: (_, ticks) => labels(ticks),
      label: named(which, unit), size, stroke: ink, labelSize: 20, labelFont: "12.5px system-ui, sans-serif",
      font: "12px system-ui, sans-serif", labelGap: 0,
      grid: { stroke: colour("--grid"), width: 1 }, ticks: { stroke: colour("--line"), width: 1, size: 5 },
    });
    const scale = (which, unit) => {
      const made = { time: false };
      if (which.log) { made.distr = 3; made.log = 10; }
      if (which.log && which === panel.x) {
        made.range = (_, low, high) => (low > 0 ? [0.98 * low, 1.02 * high] : [null, null]);
      }
      if (which.limits) made.range = limited(which, unit);
      return made;
    };
    const options = {
      width: printing ? 680 : place.clientWidth, height: height(panel, place.clientWidth),
      scales: { x: scale(panel.x, xUnit), y: scale(panel.y, yUnit) },
      series, bands,
      axes: [axis(panel.x, xUnit, 34), axis(panel.y, yUnit, wide(panel.y.log ? 64 : 58))],
      cursor: {
        drag: { x: true, y: false, dist: 4 },
        sync: { key: `${panel.x.label}/${panel.x.log}`, setSeries: false },
        points: { size: 6 },
      },
      hooks: { draw: drawn },
    };
    const chart = new uPlot(options, data, place);
    chart.names = { x: named(panel.x, xUnit), y: named(panel.y, yUnit), lines };
    inspector.attach(chart, panel, chart.names, page);
    return chart;
  };
  // A part of a plane is drawn as a plane, as far as there is room.
  const height = (panel, width) => {
    const plane = panel.x.limits && panel.y.limits && !panel.x.log && !panel.y.log;
    const span = ([low, high]) => high - low;
    if (!plane || printing) return printing ? 175 : 250;
    return Math.max(250, Math.min(520, 70 + (width - 70) * span(panel.y.limits) / span(panel.x.limits)));
  };
  // Fixed limits; along x a zoom stays within them.
  const limited = (which, unit) => {
    const [from, to] = which.limits.map((v) => v / unit[1]);
    return (_, low, high, key) => (key === "y" || low >= to || high <= from
      ? [from, to] : [Math.max(low, from), Math.min(high, to)]);
  };

  const build = () => {
    charts.forEach((chart) => chart.destroy());
    charts = [...document.querySelectorAll(".chart")].flatMap((place) => {
      if (!place.dataset.panel || !panels[Number(place.dataset.panel)].series.length) return [];
      try { return [draw(place)]; } catch (error) {
        // The other plots are worth seeing even if one cannot be drawn.
        place.textContent = `This plot could not be drawn (${error.message}).`;
        return [];
      }
    });
  };
  const resize = () => charts.forEach((chart) => {
    const width = chart.root.parentElement.clientWidth;
    if (width > 0 && width !== chart.width) chart.setSize({ width, height: chart.height });
  });

  // A file for the reader, made of what the page holds.
  const save = (name, parts, type) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob(parts, { type }));
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  };
  const fileName = (panel, ending) =>
    `${document.title} - ${panel.title}`.replace(/[^\p{L}\p{N}.]+/gu, "-").slice(0, 90) + ending;
  const strokeOf = (one) => colour(`--series-${one.colour === 0 ? 0 : 1 + (one.colour - 1) % 8}`);

  // The data in the units shown; series that stand at other places get a column of places each.
  const table = (panel) => {
    const system = root.dataset.units;
    const [xUnit, yUnit] = [panel.x[system], panel.y[system]];
    const cell = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    const head = (text, unit) => cell(text + (unit[0] ? ` [${unit[0]}]` : ""));
    const list = [];
    let last = null;
    for (const one of panel.series) {
      if (one.key !== last) list.push({ head: head(panel.x.label, xUnit), values: one.x, unit: xUnit[1] });
      last = one.key;
      list.push({ head: head(one.name, yUnit), values: one.y, unit: yUnit[1] });
      if (one.upper) list.push({ head: head(`${one.name}, upper`, yUnit), values: one.upper, unit: yUnit[1] });
    }
    const lines = [list.map((column) => column.head).join(",")];
    const longest = Math.max(...list.map((column) => column.values.length));
    const number = (column, n) => {
      const value = column.values[n];
      return value == null ? "" : String(Number((value / column.unit).toPrecision(8)));
    };
    for (let n = 0; n < longest; n++) lines.push(list.map((column) => number(column, n)).join(","));
    return `${lines.join("\n")}\n`;
  };
  const field = (name, usual) => Number(document.getElementById(name)?.value) || usual;
  // mm on the page, px of SVG.
  const size = () => [field("figure-width", 180), field("figure-height", 75)].map((mm) => Math.min(Math.max(mm, 20), 1000) * 96 / 25.4);
  const exports = async (button) => {
    const place = button.closest("figure").querySelector(".chart");
    const panel = panels[Number(place.dataset.panel)];
    if (!panel) return undefined;
    const kind = button.dataset.export;
    if (kind === "csv") return save(fileName(panel, ".csv"), [table(panel)], "text/csv");
    const chart = charts.find((one) => one.root.parentElement === place);
    if (!chart) return undefined;
    const text = inspector.svg(chart, panel, chart.names, page, size());
    if (kind === "svg") return save(fileName(panel, ".svg"), [text], "image/svg+xml");
    return save(fileName(panel, ".png"), [await inspector.png(text, size(), 300 / 96)], "image/png");
  };
  document.addEventListener("click", (event) => {
    const button = event.target.closest?.("[data-export]");
    if (button) exports(button);
  });
  document.getElementById("tolerance")?.addEventListener("change", (event) => {
    tolerance = Math.max(0, Number(event.target.value) || 0);
    build();
  });

  // Any signal of a file that the reader chooses, such as the run's results.csv.
  const chosen = document.getElementById("signal-file");
  chosen?.addEventListener("change", async () => {
    const said = document.getElementById("signal-said");
    const list = document.getElementById("signal-list");
    const found = chosen.files.length ? inspector.read(await chosen.files[0].text()) : [];
    list.replaceChildren();
    said.textContent = found.length > 1 ? `${found.length - 1} signals over ${found[0].head}`
      : "no columns of numbers; expected a CSV file such as results.csv";
    const figure = document.getElementById("signal-figure");
    figure.hidden = true;
    if (found.length < 2) return;
    const unit = ["", 1];
    const axis = (label) => ({ label, laboratory: unit, si: unit, log: false, limits: null });
    const place = figure.querySelector(".chart");
    if (!place.dataset.panel) place.dataset.panel = String(panels.push({ title: "Signals", x: axis(""), y: axis(""), series: [] }) - 1);
    const panel = panels[Number(place.dataset.panel)];
    panel.x.label = found[0].head;
    panel.title = chosen.files[0].name;
    const shown = () => {
      const names = [...list.querySelectorAll("input:checked")].map((box) => Number(box.value));
      figure.hidden = !names.length;
      panel.series = names.map((n, order) => ({
        name: found[n].head, style: "line", colour: order + 1, key: "file", upper: null,
        x: found[0].values, y: gaps(found[n].values),
      }));
      panel.y.label = names.length === 1 ? found[names[0]].head : "";
      build();
    };
    found.forEach(({ head }, n) => {
      if (!n) return;
      const label = document.createElement("label");
      const box = Object.assign(document.createElement("input"), { type: "checkbox", value: n });
      box.addEventListener("change", shown);
      label.append(box, ` ${head}`);
      list.append(label);
    });
  });

  const remember = (key, value) => { try { localStorage.setItem(key, value); } catch { /* a private window */ } };
  const recall = (key) => { try { return localStorage.getItem(key); } catch { return null; } };
  const choose = (what, value, again) => {
    root.dataset[what] = value;
    const attribute = `data-set-${what}`;
    for (const button of document.querySelectorAll(`[${attribute}]`)) {
      button.setAttribute("aria-pressed", String(button.getAttribute(attribute) === value));
      if (!again) button.addEventListener("click", () => {
        remember(`shakebench-${what}`, button.getAttribute(attribute));
        choose(what, button.getAttribute(attribute), true);
        build();
      });
    }
  };
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  choose("theme", recall("shakebench-theme") || (dark ? "dark" : "light"));
  // What the command was asked for holds until the reader chooses otherwise.
  choose("units", (!root.dataset.unitsAsked && recall("shakebench-units")) || root.dataset.units);
  build();
  let waiting = 0;
  addEventListener("resize", () => { cancelAnimationFrame(waiting); waiting = requestAnimationFrame(resize); });
  let before = null;
  addEventListener("beforeprint", () => {
    before = root.dataset.theme;
    printing = true;
    choose("theme", "light", true);
    build();
  });
  addEventListener("afterprint", () => {
    printing = false;
    choose("theme", before, true);
    build();
  });
})();
