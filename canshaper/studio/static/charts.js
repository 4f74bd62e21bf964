// The last twenty seconds of an axis: command and sway.
import uPlot from "/static/vendor/uplot.js";

const SECONDS = 20;
const MOST = SECONDS * 40;
const DRAW_MS = 100;

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export class Charts {
  /** @param hello what there is. */
  constructor(hello) {
    this.hello = hello;
    this.axis = hello.axes[0];
    this.drawn = 0;
    this.rows = []; // [t, {axis: {joystick, [crane]: {valve, sway, predicted}}}]
    this.main = hello.cranes[0];
    this.build();
  }

  build() {
    this.command?.destroy();
    this.sway?.destroy();
    const { cranes } = this.hello;
    const color = (name) => css({ raw: "--raw" }[name] ?? "--shaped");
    const lines = [{ label: "joystick", stroke: css("--joystick"), get: (v) => v.joystick, dash: [5, 4] },
      ...cranes.map((c) => ({ label: c === "machine" ? "valve" : c, stroke: color(c), get: (v) => v[c]?.valve, width: 2 })).reverse()];
    const sways = [...cranes.map((c) => ({ label: c === "machine" ? "measured" : c, stroke: color(c), get: (v) => v[c]?.sway, width: 2 })).reverse(),
      { label: "model", stroke: css("--predicted"), get: (v) => v[this.main]?.predicted, dash: [3, 3] }];
    this.command = this.plot("chart-command", "legend-command", lines, 100, { range: [-105, 105] });
    this.sway = this.plot("chart-sway", "legend-sway", sways, 1, {
      range: (_, low, high) => {
        const most = Math.max(5, Math.abs(low ?? 0), Math.abs(high ?? 0)) * 1.08;
        return [-most, most];
      },
    });
  }

  plot(id, legendId, series, scale, y) {
    const host = document.getElementById(id);
    const grid = { stroke: css("--line"), width: 1 };
    const axis = { stroke: css("--quiet"), grid, ticks: { show: false }, font: "11px system-ui, sans-serif" };
    const plot = new uPlot({
      width: host.clientWidth, height: host.clientHeight, cursor: { show: false }, legend: { show: false },
      padding: [6, 16, 0, 0],
      scales: { x: { time: false, range: [-SECONDS, 0] }, y },
      axes: [{ ...axis, size: 22, values: (_, v) => v.map((s) => (s ? `${s} s` : "now")) }, { ...axis, size: 38 }],
      series: [{}, ...series.map((s) => ({ stroke: s.stroke, width: s.width ?? 1.5, dash: s.dash, points: { show: false } }))],
    }, [[], ...series.map(() => [])], host);
    plot.lines = series;
    plot.factor = scale;
    const legend = document.getElementById(legendId);
    legend.replaceChildren(...series.map((s) => {
      const item = document.createElement("span");
      const line = document.createElement("i");
      line.style.setProperty("--color", s.stroke);
      item.append(line, s.label);
      return item;
    }));
    return plot;
  }

  /** Keep one picture of the machine. */
  add(shown) {
    const row = {};
    for (const axis of this.hello.axes) {
      row[axis] = { joystick: shown.cranes[this.main]?.axes[axis].joystick };
      for (const [name, crane] of Object.entries(shown.cranes)) {
        const way = this.hello.sway_of[axis];
        row[axis][name] = {
          valve: crane.axes[axis].valve,
          sway: way && crane.measured ? crane.sway?.[way === "across" ? 0 : 1] : null,
          predicted: crane.axes[axis].predicted,
        };
      }
    }
    const last = this.rows.at(-1);
    if (last && shown.t < last[0]) this.rows = []; // another studio
    this.rows.push([shown.t, row]);
    if (this.rows.length > MOST) this.rows.splice(0, this.rows.length - MOST);
  }

  draw(now) {
    if (now - this.drawn < DRAW_MS || !this.rows.length) return;
    this.drawn = now;
    const end = this.rows.at(-1)[0];
    const rows = this.rows.filter(([t]) => end - t <= SECONDS);
    const x = rows.map(([t]) => t - end);
    for (const plot of [this.command, this.sway]) {
      plot.setData([x, ...plot.lines.map((s) => rows.map(([, row]) => {
        const value = s.get(row[this.axis]);
        return value == null ? null : value * plot.factor;
      }))]);
    }
  }

  show(axis) {
    this.axis = axis;
    this.drawn = 0;
    const way = this.hello.sway_of[axis];
    document.getElementById("sway-of").textContent = way ? `degrees, ${way} the boom` : "this axis excites none";
  }

  resize() {
    for (const [plot, id] of [[this.command, "chart-command"], [this.sway, "chart-sway"]]) {
      const host = document.getElementById(id);
      plot.setSize({ width: host.clientWidth, height: host.clientHeight });
    }
  }
}
