// Draws the figures of the page from the data beside it. Axes of the same span of time follow each other.
"use strict";
(function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const phone = window.matchMedia("(max-width: 40rem)");
  const colour = (light) => (dark.matches && data.dark[light]) || light;
  const paper = () => colour("#ffffff"), ink = () => colour("#1c2430");
  const muted = () => colour("#5b6675"), grid = () => colour("#e3e7ec");
  const shown = new Map();
  let following = false;

  const axisName = (kind, number) => kind + "axis" + (number || "");
  const axisRef = (kind, number) => kind + (number || "");

  function domains(figure) {
    const narrow = phone.matches;
    const cells = figure.axes.map((axes, place) => narrow
      ? { row: place, share: axes.share, left: 0, right: 1 }
      : { row: axes.row, share: axes.share, column: axes.column, columns: axes.columns });
    const rows = [...new Set(cells.map((cell) => cell.row))].sort((a, b) => a - b);
    const shares = rows.map((row) => cells.find((cell) => cell.row === row).share);
    const total = shares.reduce((sum, share) => sum + share, 0);
    const each = narrow ? 230 : 0;
    const height = narrow ? 60 + each * rows.length : Math.max(figure.height, 230) + 40;
    const inner = height - 100, gap = Math.min(0.5 / rows.length, (narrow ? 66 : 52) / inner);
    let top = 1;
    const spans = rows.map((row, place) => {
      const high = (1 - gap * (rows.length - 1)) * shares[place] / total;
      const span = [Math.max(0, top - high), top];
      top -= high + gap;
      return span;
    });
    const wide = cells.map((cell, place) => {
      const span = spans[rows.indexOf(cell.row)];
      if (narrow || cell.columns === 1) return { x: [0, 1], y: span };
      const width = 1 / cell.columns, room = cell.columns > 1 ? 0.05 : 0;
      return { x: [cell.column * width + (cell.column ? room : 0), (cell.column + 1) * width - (cell.column ? 0 : room / 2)], y: span };
    });
    return { height, places: wide };
  }

  function layout(figure) {
    const { height, places } = domains(figure);
    const whole = {
      height, margin: { l: 64, r: 44, t: 44, b: 48 }, paper_bgcolor: paper(), plot_bgcolor: paper(),
      font: { color: ink(), size: 12, family: "system-ui, sans-serif" }, hovermode: "closest", dragmode: "zoom",
      legend: { orientation: "h", x: 0, y: 1, yanchor: "bottom", yref: "container", bgcolor: "rgba(0,0,0,0)" },
      annotations: [], shapes: [], showlegend: false,
      hoverlabel: { font: { family: "system-ui, sans-serif" } },
    };
    whole.legend.y = 0.995; whole.legend.yanchor = "top";
    figure.axes.forEach((axes, place) => {
      const x = axisRef("x", place && place + 1), y = axisRef("y", place && place + 1);
      const place_in = places[place];
      const line = { gridcolor: grid(), linecolor: muted(), zeroline: false, showline: true, ticks: "outside", tickcolor: muted() };
      whole[axisName("x", place && place + 1)] = {
        ...line, domain: place_in.x, anchor: y, range: axes.x.slice(), title: { text: axes.xlabel, standoff: 6 },
      };
      whole[axisName("y", place && place + 1)] = {
        ...line, domain: place_in.y, anchor: x, range: axes.y.slice(), type: axes.log ? "log" : "linear",
        title: { text: phone.matches ? "" : axes.ylabel, standoff: 4, font: { size: 11 } },
        exponentformat: "power", minexponent: 6, separatethousands: true, automargin: true,
        ...(axes.log && Math.abs(axes.y[1] - axes.y[0]) > 2 ? { dtick: 1 } : {}),
        ...(axes.ticks ? { tickvals: axes.ticks[0], ticktext: axes.ticks[1], showgrid: false } : {}),
      };
      const title = phone.matches ? [axes.title, axes.ylabel.replace("<br>", " ")].filter(Boolean).join(" · ") : axes.title;
      if (title) whole.annotations.push({
        text: title, xref: x + " domain", yref: y + " domain", x: 0, y: 1, xanchor: "left", yanchor: "bottom",
        showarrow: false, font: { size: 11, color: muted() },
      });
      for (const level of axes.levels) whole.shapes.push({
        type: "line", xref: x + " domain", yref: y, x0: 0, x1: 1, y0: level.y, y1: level.y, layer: "below",
        line: { color: colour(level.colour), width: level.size, dash: level.dash },
      });
      for (const span of axes.spans) whole.shapes.push({
        type: "rect", xref: x, yref: y + " domain", x0: span.x[0], x1: span.x[1], y0: 0, y1: 1, layer: "below",
        fillcolor: span.colour, opacity: span.opacity, line: { width: 0 },
      });
      for (const word of axes.words) whole.annotations.push({
        text: word.bold ? "<b>" + word.text + "</b>" : word.text, showarrow: false,
        xref: word.across ? x + " domain" : x, yref: y, x: word.x, y: axes.log ? Math.log10(word.y) : word.y,
        xshift: word.shift[0], yshift: word.shift[1], xanchor: word.right ? "right" : "left", yanchor: word.vertical,
        font: { size: 11, color: colour(word.colour) },
      });
    });
    return whole;
  }

  function traces(figure) {
    const seen = new Set(), all = [];
    figure.axes.forEach((axes, place) => {
      for (const trace of axes.traces) {
        const named = trace.key && !seen.has(trace.name);
        if (named) seen.add(trace.name);
        all.push({
          type: "scatter", mode: trace.mode, x: trace.x, y: trace.y, name: trace.name || axes.title,
          xaxis: axisRef("x", place && place + 1), yaxis: axisRef("y", place && place + 1),
          legendgroup: trace.name, showlegend: named, connectgaps: false,
          hovertemplate: "%{y:.6g}<br>" + "t = %{x:.6g} s",
          line: { color: colour(trace.colour), width: Math.max(trace.size, 1), dash: trace.dash, shape: trace.steps ? "hv" : "linear" },
          marker: { color: colour(trace.colour), size: Math.max(trace.size, 3) },
        });
      }
    });
    return { all, legend: seen.size > 1 };
  }

  function draw(name) {
    const figure = data.figures[name], place = document.getElementById("plot-" + name);
    const { all, legend } = traces(figure), whole = layout(figure);
    whole.showlegend = legend;
    place.style.height = whole.height + "px";
    const options = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["lasso2d", "select2d"],
      toImageButtonOptions: { format: "svg", filename: name } };
    return Plotly.react(place, all, whole, options).then(() => {
      if (!shown.has(name)) {
        shown.set(name, place);
        place.on("plotly_relayout", (change) => follow(name, change));
      }
    });
  }

  // Whoever zooms one span of time zooms it in all figures that show it.
  function follow(name, change) {
    const figure = data.figures[name];
    if (following || !figure.timed) return;
    const asked = new Map();
    figure.axes.forEach((axes, place) => {
      const key = axisName("x", place && place + 1), span = axes.x.join();
      if (change[key + ".range[0]"] !== undefined) asked.set(span, [change[key + ".range[0]"], change[key + ".range[1]"]]);
      else if (change[key + ".range"]) asked.set(span, change[key + ".range"]);
      else if (change[key + ".autorange"]) asked.set(span, axes.x.slice());
    });
    if (!asked.size) return;
    following = true;
    const done = [];
    for (const [other, place] of shown) {
      const update = {};
      data.figures[other].axes.forEach((axes, number) => {
        const range = asked.get(axes.x.join());
        if (range && data.figures[other].timed) update[axisName("x", number && number + 1) + ".range"] = range.slice();
      });
      if (Object.keys(update).length) done.push(Plotly.relayout(place, update));
    }
    Promise.all(done).finally(() => { following = false; });
  }

  function numbers(packed) {
    const bytes = Uint8Array.from(atob(packed.bdata), (letter) => letter.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  }

  // Components in the body frame, turned into the frame of the reference by a quaternion with its scalar first.
  function turned(q, v) {
    const [w, x, y, z] = q;
    const t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])];
    return [
      v[0] + w * t[0] + y * t[2] - z * t[1],
      v[1] + w * t[1] + z * t[0] - x * t[2],
      v[2] + w * t[2] + x * t[1] - y * t[0],
    ];
  }

  function box(half, place) {
    const c = [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]]
      .map((corner) => corner.map((sign, axis) => sign * half[axis] + place[axis]));
    const way = [0, 1, 2, 3, 0, 4, 5, 1, 5, 6, 2, 6, 7, 3, 7, 4];
    return [...way.map((number) => c[number]), null];
  }

  const shape = [...box([0.25, 0.25, 0.3], [0, 0, 0]), ...box([0.2, 0.45, 0.01], [0, 0.75, 0]), ...box([0.2, 0.45, 0.01], [0, -0.75, 0])];

  function turning() {
    const view = data.turning;
    if (!view) return;
    const times = numbers(view.times), place = document.getElementById("turning-plot");
    const slider = document.getElementById("turning-time"), words = document.getElementById("turning-words");
    const bodies = view.bodies.map((body) => ({ name: body.name, q: numbers(body.q), torque: numbers(body.torque) }));
    const columns = Math.ceil(Math.sqrt(bodies.length));
    const at = (number) => [0, 3 * (number % columns), -2.2 * Math.floor(number / columns)];
    const axes = [[[0.9, 0, 0], "#d62728", "x"], [[0, 1.3, 0], "#2ca02c", "y"], [[0, 0, 0.9], "#3b7dd8", "z"]];
    function lines(moment) {
      const all = [];
      bodies.forEach((body, number) => {
        const q = body.q.slice(4 * moment, 4 * moment + 4), origin = at(number);
        const line = (points, rest) => {
          const moved = points.map((point) => point && turned(q, point).map((value, axis) => value + origin[axis]));
          all.push({ type: "scatter3d", mode: "lines", hoverinfo: "name", showlegend: false,
            x: moved.map((p) => p && p[0]), y: moved.map((p) => p && p[1]), z: moved.map((p) => p && p[2]), ...rest });
        };
        line(shape, { name: body.name, line: { color: muted(), width: 3 } });
        axes.forEach(([tip, tint, label]) => line([[0, 0, 0], tip], { name: body.name + " " + label, line: { color: tint, width: 6 } }));
        const torque = Array.from(body.torque.slice(3 * moment, 3 * moment + 3));
        line([[0, 0, 0], torque], { name: body.name + " torque", line: { color: "#e8a200", width: 9 } });
        all.push({ type: "scatter3d", mode: "text", x: [origin[0]], y: [origin[1]], z: [origin[2] + 1.05], text: [body.name],
          hoverinfo: "skip", showlegend: false, textfont: { color: ink() } });
      });
      return all;
    }
    const hidden = { visible: false };
    const whole = () => ({
      height: phone.matches ? 320 : 420, margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: paper(), uirevision: 1,
      scene: { aspectmode: "data", xaxis: hidden, yaxis: hidden, zaxis: hidden, camera: { eye: { x: 1.5, y: 0.9, z: 0.7 } } },
    });
    function show() {
      const moment = Number(slider.value);
      words.textContent = "t = " + Number(times[moment].toPrecision(6)) + " s";
      place.style.height = whole().height + "px";
      return Plotly.react(place, lines(moment), whole(), { responsive: true, displaylogo: false });
    }
    slider.max = times.length - 1;
    slider.addEventListener("input", show);
    redraws.push(show);
    return show();
  }

  const redraws = [() => Promise.all(Object.keys(data.figures).map(draw))];
  const redraw = () => redraws.forEach((one) => one());
  dark.addEventListener("change", redraw);
  phone.addEventListener("change", redraw);
  redraws[0]().then(turning).then(() => { document.body.dataset.drawn = "yes"; });
})();
