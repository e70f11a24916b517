"use strict";
// What a reader does with a plot: read it without seeing it, zoom and pan by keyboard, put two cursors on
// it, and save it as SVG or PNG at a chosen size.
const inspector = (() => {
  const escaped = (text) => String(text).replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);

  const element = (name, text) => `<${name}>${escaped(text)}</${name}>`;

  // The curves in words: the least and the greatest value of each.
  const words = (chart, panel, names, digits) => {
    const parts = names.lines.map((line, n) => {
      const values = chart.data[n + 1].filter((v) => v != null);
      if (!values.length) return `${line.name}: no values`;
      let [low, high] = [Infinity, -Infinity];
      for (const v of values) { low = Math.min(low, v); high = Math.max(high, v); }
      return `${line.name}: ${digits(low, high - low)} to ${digits(high, high - low)}`;
    });
    return `Plot of ${panel.title}: ${names.y} over ${names.x}. ${parts.join("; ")}.`;
  };

  // Everything along x happens to all plots that zoom together.
  const peers = (chart, charts) => {
    const key = (one) => one.cursor.sync && one.cursor.sync.key;
    return charts.filter((one) => key(one) === key(chart));
  };
  const whole = (chart) => [chart.data[0][0], chart.data[0][chart.data[0].length - 1]];
  const move = (chart, charts, { zoom = 1, pan = 0, reset = false }) => {
    const log = chart.scales.x.distr === 3;
    const [to, from] = log ? [Math.log, Math.exp] : [(v) => v, (v) => v];
    const [least, most] = whole(chart).map(to);
    let [low, high] = [chart.scales.x.min, chart.scales.x.max].map(to);
    if (reset) [low, high] = [least, most];
    const half = Math.min((high - low) * zoom, most - least) / 2;
    let middle = (low + high) / 2 + pan * (high - low);
    middle = Math.min(Math.max(middle, least + half), most - half);
    if (!(half > 0)) return;
    const [min, max] = [from(middle - half), from(middle + half)];
    for (const one of peers(chart, charts)) one.setScale("x", { min, max });
  };

  const nearest = (column, x) => {
    let [low, high] = [0, column.length - 1];
    while (high - low > 1) {
      const at = (low + high) >> 1;
      if (column[at] <= x) low = at; else high = at;
    }
    return x - column[low] <= column[high] - x ? low : high;
  };

  // Two cursors and what lies between them.
  const readout = (chart, names, digits, marks, place) => {
    const at = (name) => (marks[name] == null ? null : nearest(chart.data[0], marks[name]));
    const [a, b] = [at("a"), at("b")];
    if (a == null && b == null) { place.hidden = true; place.textContent = ""; return; }
    const cell = (v) => (v == null ? "" : digits(v, Math.abs(v)));
    const row = (name, column) => {
      const [x, y] = [a == null ? null : column[a], b == null ? null : column[b]];
      const between = x == null || y == null ? null : y - x;
      return `<tr><th scope="row">${escaped(name)}</th><td>${cell(x)}</td><td>${cell(y)}</td><td>${cell(between)}</td></tr>`;
    };
    const rows = [row(names.x, chart.data[0])];
    names.lines.forEach((line, n) => { if (chart.series[n + 1].show) rows.push(row(line.name, chart.data[n + 1])); });
    place.innerHTML = `<table><caption>Cursors</caption><thead><tr><td></td><th scope="col">A</th><th scope="col">B</th>`
      + `<th scope="col">B \u2212 A</th></tr></thead><tbody>${rows.join("")}</tbody></table>`;
    place.hidden = false;
  };
  const lines = (marks, ink) => (u) => {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.strokeStyle = ctx.fillStyle = ink();
    ctx.lineWidth = devicePixelRatio;
    ctx.font = `${12 * devicePixelRatio}px system-ui, sans-serif`;
    for (const name of ["a", "b"]) {
      if (marks[name] == null) continue;
      const x = u.valToPos(marks[name], "x", true);
      if (x < bbox.left || x > bbox.left + bbox.width) continue;
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      ctx.fillText(name.toUpperCase(), x + 3 * devicePixelRatio, bbox.top + 13 * devicePixelRatio);
    }
    ctx.restore();
  };

  // Makes a plot reachable: `names` holds the axes' names and a line per curve.
  const attach = (chart, panel, names, page) => {
    const place = chart.root.parentElement;
    const marks = (place.marks ??= {});
    place.tabIndex = 0;
    place.setAttribute("role", "group");
    place.setAttribute("aria-label", panel.title);
    place.setAttribute("aria-describedby", "plot-keys");
    const canvas = place.querySelector("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", words(chart, panel, names, page.digits));
    let shown = place.parentElement.querySelector(".readout");
    if (!shown) {
      shown = document.createElement("div");
      shown.className = "readout";
      shown.setAttribute("aria-live", "polite");
      place.after(shown);
    }
    const show = () => { readout(chart, names, page.digits, marks, shown); chart.redraw(false); };
    chart.hooks.draw.push(lines(marks, () => page.colour("--ink")));
    readout(chart, names, page.digits, marks, shown);

    const legend = place.querySelector(".u-legend");
    if (legend) {
      legend.setAttribute("role", "presentation");
      legend.querySelectorAll(".u-series").forEach((row, n) => {
        if (n === 0) return;
        const button = row.querySelector("th");
        const tell = () => button.setAttribute("aria-pressed", String(chart.series[n].show !== false));
        button.setAttribute("role", "button");
        button.tabIndex = 0;
        tell();
        button.addEventListener("click", () => setTimeout(tell, 0));
        button.addEventListener("keydown", (event) => {
          if (event.key !== "Enter" && event.key !== " ") return;
          event.preventDefault();
          event.stopPropagation();
          chart.setSeries(n, { show: !chart.series[n].show });
          tell();
        });
      });
    }

    const put = (name) => {
      const at = chart.cursor.idx ?? nearest(chart.data[0], (chart.scales.x.min + chart.scales.x.max) / 2);
      marks[name] = chart.data[0][at];
      show();
    };
    const nudge = (by) => {
      const column = chart.data[0];
      const now = chart.cursor.idx ?? nearest(column, (chart.scales.x.min + chart.scales.x.max) / 2);
      const at = Math.min(Math.max(now + by, 0), column.length - 1);
      chart.setCursor({ left: chart.valToPos(column[at], "x"), top: chart.over.clientHeight / 2 });
    };
    const keys = {
      "+": () => move(chart, page.charts(), { zoom: 0.5 }),
      "=": () => move(chart, page.charts(), { zoom: 0.5 }),
      "-": () => move(chart, page.charts(), { zoom: 2 }),
      ArrowLeft: () => move(chart, page.charts(), { pan: -0.2 }),
      ArrowRight: () => move(chart, page.charts(), { pan: 0.2 }),
      0: () => move(chart, page.charts(), { reset: true }),
      Home: () => move(chart, page.charts(), { reset: true }),
      ",": () => nudge(-1), ".": () => nudge(1), "<": () => nudge(-20), ">": () => nudge(20),
      a: () => put("a"), b: () => put("b"),
      Escape: () => { marks.a = marks.b = null; show(); },
    };
    place.onkeydown = (event) => {
      const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
      if (event.ctrlKey || event.metaKey || event.altKey || !keys[key]) return;
      event.preventDefault();
      keys[key]();
    };
    chart.over.addEventListener("click", (event) => {
      if (event.shiftKey) put(marks.a == null || marks.b != null ? "a" : "b");
    });
  };

  // The plot as it is zoomed, of a size in px, as SVG.
  const svg = (chart, panel, names, page, [width, height]) => {
    const font = 'font-family="Helvetica, Arial, sans-serif" font-size="11"';
    const shown = names.lines.map((line, n) => ({ ...line, n: n + 1 })).filter((line) => chart.series[line.n].show);
    const rows = [[]];
    let used = 0;
    for (const line of shown.filter((one) => !one.hidden)) {
      const wide = 34 + 6.2 * line.name.length;
      if (used && used + wide > width - 80) { rows.push([]); used = 0; }
      rows.at(-1).push({ line, at: used });
      used += wide;
    }
    const box = { left: 64, right: width - 12, top: 10 + 16 * rows.length, bottom: height - 40 };
    const scale = (name, from, to) => {
      const { min, max, distr } = chart.scales[name];
      const log = distr === 3 ? Math.log : (v) => v;
      return (v) => from + (log(v) - log(min)) / (log(max) - log(min)) * (to - from);
    };
    const [x, y] = [scale("x", box.left, box.right), scale("y", box.bottom, box.top)];
    const ink = page.colour("--ink");
    const number = (v) => +v.toFixed(2);
    const parts = [];
    const ticks = (n) => {
      const axis = chart.axes[n];
      return (axis._splits ?? []).map((at, k) => [at, (axis._values ?? [])[k]]).filter(([, text]) => text);
    };
    for (const [at, text] of ticks(0)) {
      const px = number(x(at));
      if (px < box.left - 1 || px > box.right + 1) continue;
      parts.push(`<path d="M${px} ${box.top}V${box.bottom + 4}" stroke="${page.colour("--grid")}"/>`
        + `<text x="${px}" y="${box.bottom + 16}" text-anchor="middle">${escaped(text)}</text>`);
    }
    for (const [at, text] of ticks(1)) {
      const py = number(y(at));
      if (py < box.top - 1 || py > box.bottom + 1) continue;
      parts.push(`<path d="M${box.left - 4} ${py}H${box.right}" stroke="${page.colour("--grid")}"/>`
        + `<text x="${box.left - 8}" y="${py + 4}" text-anchor="end">${escaped(text)}</text>`);
    }
    parts.push(`<text x="${(box.left + box.right) / 2}" y="${height - 6}" text-anchor="middle">${escaped(names.x)}</text>`);
    parts.push(`<text transform="translate(14 ${(box.top + box.bottom) / 2}) rotate(-90)" text-anchor="middle">${escaped(names.y)}</text>`);
    parts.push(`<g clip-path="url(#inside)">`);
    for (const line of shown) {
      let [xs, ys] = [chart.data[0], chart.data[line.n]];
      if (line.path) [xs, ys] = line.path;
      const places = [];
      let [pen, last] = [false, null];
      for (let n = 0; n < xs.length; n++) {
        if (ys[n] == null) { pen = false; continue; }
        const at = [x(xs[n]), y(ys[n])];
        // Outside of the picture nothing is seen but the way into it.
        if (!line.path && (at[0] < box.left - width || at[0] > box.right + width)) { pen = false; continue; }
        const text = `${number(at[0])} ${number(at[1])}`;
        if (line.points) places.push(`M${text}h0`);
        else if (text !== last) places.push(`${pen ? "L" : "M"}${text}`);
        [pen, last] = [true, text];
      }
      const look = line.points ? 'stroke-width="5" stroke-linecap="round"' : `stroke-width="${line.width}" stroke-linejoin="round"`;
      const dash = line.dash ? ' stroke-dasharray="6 4"' : "";
      parts.push(`<path d="${places.join("")}" fill="none" stroke="${line.stroke}" ${look}${dash}>${element("title", line.name)}</path>`);
    }
    parts.push("</g>");
    rows.forEach((row, n) => row.forEach(({ line, at }) => {
      const [left, top] = [box.left + at, 12 + 16 * n];
      parts.push(`<path d="M${left} ${top - 4}h22" stroke="${line.stroke}" stroke-width="3"/>`
        + `<text x="${left + 27}" y="${top}">${escaped(line.name)}</text>`);
    }));
    parts.push(`<path d="M${box.left} ${box.top}V${box.bottom}H${box.right}" fill="none" stroke="${ink}"/>`);
    return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}" role="img" ${font} fill="${ink}">`
      + element("title", panel.title) + element("desc", words(chart, panel, names, page.digits))
      + `<clipPath id="inside"><rect x="${box.left}" y="${box.top}" width="${box.right - box.left}" height="${box.bottom - box.top}"/></clipPath>`
      + `<rect width="100%" height="100%" fill="${page.colour("--card")}"/>${parts.join("")}</svg>`;
  };

  // An SVG as PNG with so many dots for each of its px.
  const png = (text, [width, height], ratio) => new Promise((done, fail) => {
    const image = new Image();
    image.onload = () => {
      const canvas = document.createElement("canvas");
      [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
      canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
      canvas.toBlob(done, "image/png");
    };
    image.onerror = () => fail(new Error("the picture cannot be drawn"));
    image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}`;
  });

  // The columns of a CSV file that hold numbers; the first is the abscissa.
  const read = (text) => {
    const rows = text.split(/\r?\n/).filter((line) => line && !line.startsWith("#"));
    const cells = (line) => (line.match(/("([^"]|"")*"|[^,;]*)([,;]|$)/g) ?? [])
      .map((cell) => cell.replace(/[,;]$/, "").replace(/^"|"$/g, "").replaceAll('""', '"'));
    const heads = cells(rows[0] ?? "").filter((head, n, all) => head || n < all.length - 1);
    const columns = heads.map(() => []);
    for (const line of rows.slice(1)) cells(line).forEach((cell, n) => { if (n < columns.length) columns[n].push(cell === "" ? NaN : Number(cell)); });
    return heads.map((head, n) => ({ head, values: columns[n] }))
      .filter(({ values }) => values.length > 1 && values.some(Number.isFinite));
  };

  return { attach, svg, png, read };
})();
