"use strict";
(() => {
  const scene = JSON.parse(document.getElementById("scene").textContent);
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const WINDOW = 10; // seconds shown
  const EVERY = 100; // milliseconds between questions
  document.getElementById("title").textContent = scene.title;
  document.title = `${scene.title}, live`;
  const state = document.getElementById("state");
  const facts = document.getElementById("facts");
  const say = (kind, words) => {
    state.dataset.state = kind;
    state.textContent = words;
  };

  const plots = scene.plots.map((plot) => {
    const figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    caption.textContent = plot.title;
    const place = document.createElement("div");
    place.className = "chart";
    figure.append(caption, place);
    document.getElementById("plots").append(figure);
    const fact = document.createElement("div");
    const [name, value, note] = ["dt", "dd", "dd"].map((tag) => document.createElement(tag));
    note.className = "note";
    name.textContent = `${plot.title}, largest`;
    note.textContent = plot.limit == null ? "" : `limit ${(plot.limit / plot.unit[1]).toPrecision(4)} ${plot.unit[0]}`;
    fact.append(name, value, note);
    facts.append(fact);
    const limits = plot.limit == null ? [] : [plot.limit, -plot.limit];
    const data = [[], ...plot.signals.map(() => []), ...limits.map(() => [])];
    const ink = colour("--soft");
    const axis = (label, size) => ({
      label, size, stroke: ink, labelSize: 20, labelFont: "12.5px system-ui, sans-serif",
      font: "12px system-ui, sans-serif", labelGap: 0, grid: { stroke: colour("--grid"), width: 1 },
    });
    const chart = new uPlot({
      width: place.clientWidth, height: 190,
      scales: { x: { time: false, range: (_, low, high) => [Math.max(0, high - WINDOW), Math.max(WINDOW, high)] } },
      series: [
        { label: "time [s]" },
        ...plot.signals.map(([label], n) => ({
          label, stroke: colour(`--series-${label.startsWith("reference") ? 0 : n + 1}`),
          width: label.startsWith("reference") ? 3 : 1.3, pxAlign: 0,
        })),
        ...limits.map((_, n) => ({ label: n ? "lower limit" : "limit", stroke: colour("--series-6"), width: 1, dash: [6, 4], show: false })),
      ],
      axes: [axis("time [s]", 34), axis(plot.unit[0] && `[${plot.unit[0]}]`, 58)],
    }, data, place);
    return { plot, place, chart, data, limits, value, largest: 0 };
  });

  let next = 0;
  let time = 0;
  const take = (rows) => {
    for (const row of rows) {
      time = row[0];
      for (const own of plots) {
        own.data[0].push(time);
        own.plot.signals.forEach(([name, column], n) => {
          const value = row[column];
          own.data[1 + n].push(value == null ? null : value / own.plot.unit[1]);
          if (!name.startsWith("reference")) own.largest = Math.max(own.largest, Math.abs(value));
        });
        own.limits.forEach((limit, n) => own.data[1 + own.plot.signals.length + n].push(limit / own.plot.unit[1]));
      }
    }
    for (const own of plots) {
      const old = own.data[0].findIndex((t) => t >= time - WINDOW - 1);
      if (old > 2000) own.data.forEach((column) => column.splice(0, old));
      own.value.textContent = `${Number((own.largest / own.plot.unit[1]).toPrecision(3))} ${own.plot.unit[0]}`;
      // A limit is drawn where it matters: near it.
      own.limits.forEach((limit, n) => {
        const series = 1 + own.plot.signals.length + n;
        const near = own.largest > 0.6 * limit || own.chart.series[series].show;
        if (n === 0 && near !== own.chart.series[series].show) own.chart.setSeries(series, { show: near });
      });
      own.chart.setData(own.data);
    }
    next += rows.length;
    const last = rows[rows.length - 1];
    const words = `${time.toFixed(2)} ${scene.duration == null ? "" : `of ${scene.duration.toFixed(2)} `}s`;
    if (scene.tripped != null && last[scene.tripped] !== 0) {
      const cause = scene.cause && scene.cause[1].find(([number]) => number === last[scene.cause[0]]);
      say("tripped", `Interlock tripped${cause ? `: ${cause[1]}` : ""} (${words})`);
    } else if (scene.step != null) {
      say("running", `Serving a client: step ${last[scene.step]} committed at ${words}`);
    } else {
      say("running", scene.tripped == null ? `Running, without an interlock: ${words}` : `Running, interlock armed: ${words}`);
    }
  };

  const ask = async () => {
    let answer;
    try {
      answer = await (await fetch(`rows?from=${next}`)).json();
    } catch {
      say("ended", "The run is over; its results lie where the command says.");
      return;
    }
    if (answer.rows.length > 0) take(answer.rows);
    if (answer.ended != null) {
      if (state.dataset.state !== "tripped") say("ended", `Ended: ${answer.ended}`);
      else state.textContent += ` — ${answer.ended}`;
      return;
    }
    setTimeout(ask, EVERY);
  };
  addEventListener("resize", () => plots.forEach(({ chart, place }) => chart.setSize({ width: place.clientWidth, height: 190 })));
  ask();
})();
