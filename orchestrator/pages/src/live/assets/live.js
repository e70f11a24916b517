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

  const element = (tag, words, parent) => {
    const made = document.createElement(tag);
    made.textContent = words;
    parent.append(made);
    return made;
  };
  // Parameters that may change during the run.
  const controls = JSON.parse(document.getElementById("controls").textContent);
  const tuning = controls && (() => {
    const place = document.getElementById("tuning");
    place.hidden = false;
    element("h2", "Parameters", place);
    element("p", controls.may_change
      ? `A change takes ${Number(controls.seconds.toPrecision(3))} s and is part of the record.`
      : "They are changed at the other address that the command printed.", place);
    const shown = (knob, value, digits = 4) => String(Number((value / knob.unit[1]).toPrecision(digits)));
    const fault = document.createElement("p");
    fault.setAttribute("role", "alert");
    const knobs = controls.knobs.map((knob, n) => {
      const row = element(controls.may_change ? "form" : "div", "", place);
      row.className = "knob";
      const name = element(controls.may_change ? "label" : "span", "", row);
      element("strong", knob.variable, name);
      const range = `${shown(knob, knob.low)} to ${shown(knob, knob.high)} ${knob.unit[0]}`;
      element("small", `${knob.about}${knob.about && "; "}${range}`, name);
      const now = element("output", "", row);
      if (!controls.may_change) return { knob, now };
      const input = element("input", "", row);
      input.id = `knob-${n}`;
      name.htmlFor = input.id;
      input.type = "text";
      input.inputMode = "decimal";
      input.value = shown(knob, knob.start, 6);
      const button = element("button", "Change", row);
      button.setAttribute("aria-label", `Change ${knob.variable}`);
      row.addEventListener("submit", async (event) => {
        event.preventDefault();
        const value = input.value.trim() === "" ? NaN : Number(input.value.replace(",", "."));
        const si = value * knob.unit[1];
        const rounding = 1e-6 * Math.max(Math.abs(knob.low), Math.abs(knob.high));
        if (!(si >= knob.low - rounding && si <= knob.high + rounding)) {
          fault.textContent = `${knob.variable} = ${input.value}: expected a number from ${range}`;
          return;
        }
        try {
          const answer = await fetch("tune", {
            method: "POST", body: JSON.stringify({ variable: knob.variable, value: Math.min(Math.max(si, knob.low), knob.high) }),
          });
          fault.textContent = answer.ok ? "" : await answer.text();
        } catch {
          fault.textContent = `The run is over; ${knob.variable} keeps its value.`;
        }
      });
      return { knob, now, input, button };
    });
    place.append(fault);
    const log = element("ol", "", place);
    let logged = 0;
    return {
      show: ({ values, changes }) => {
        knobs.forEach(({ knob, now }, n) => { now.textContent = `${shown(knob, values[n])} ${knob.unit[0]}`; });
        for (const change of changes.slice(logged)) {
          const { knob } = knobs.find((own) => own.knob.variable === change.variable);
          element("li", `${change.time_s.toFixed(2)} s: ${change.variable} from ${shown(knob, change.from)} to ${shown(knob, change.to)} ${knob.unit[0]}`, log);
        }
        logged = changes.length;
      },
      end: () => knobs.forEach(({ input, button }) => [input, button].forEach((own) => { if (own) own.disabled = true; })),
    };
  })();

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
      tuning?.end();
      return;
    }
    if (answer.rows.length > 0) take(answer.rows);
    if (answer.tuning) tuning?.show(answer.tuning);
    if (answer.ended != null) {
      tuning?.end();
      if (state.dataset.state !== "tripped") say("ended", `Ended: ${answer.ended}`);
      else state.textContent += ` — ${answer.ended}`;
      return;
    }
    setTimeout(ask, EVERY);
  };
  addEventListener("resize", () => plots.forEach(({ chart, place }) => chart.setSize({ width: place.clientWidth, height: 190 })));
  ask();
})();
