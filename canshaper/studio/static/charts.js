// Command, sway and states of an axis: the last ten minutes, of which a part is shown.
import { History } from "/static/history.js";
import { nameOf, text } from "/static/language.js";
import { explain, Lanes, spans } from "/static/lanes.js";
import { large } from "/static/theme.js";
import uPlot from "/static/vendor/uplot.js";

const KEPT_S = 600;
const WINDOWS_S = [5, 10, 20, 60, 180, KEPT_S];
const MOST_ROWS = KEPT_S * 36; // the studio sends thirty pictures a second
const MOST_POINTS = 1200; // of a line: there are no more dots across
const MOST_EVENTS = 500; // as many as the studio keeps
const DRAW_MS = 100;

const set = (element, text) => {
  if (element.textContent !== text) element.textContent = text;
};
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export class Charts {
  /** @param hello what there is. */
  constructor(hello) {
    this.hello = hello;
    this.axis = hello.axes[0];
    this.drawn = 0;
    this.history = new History(
      hello.axes.flatMap((axis) => [`${axis} joystick`, ...hello.cranes.flatMap((c) => [`${axis} valve ${c}`, `${axis} sway ${c}`, `${axis} model ${c}`])]),
      hello.axes.flatMap((axis) => hello.cranes.map((c) => `${axis} ${c}`)), MOST_ROWS, KEPT_S,
    );
    this.events = []; // {t, source, text, level}
    this.lanes = new Lanes(hello.cranes, hello.colors, css);
    this.main = hello.cranes[0];
    this.seconds = 20;
    this.stoppedAt = null; // the time up to which is shown, while paused
    this.at = null; // the time that is looked at, of a drive that is over
    this.onseek = null; // called with a time that was clicked at
    explain(document.getElementById("levels"));
    this.build();
  }

  build() {
    this.destroy();
    const { cranes } = this.hello;
    const color = (name) => css(this.hello.colors[name]);
    const named = (crane) => ({ label: nameOf("crane", crane), name: crane }); // in the legend, in the table
    const lines = [{ label: text("chart.joystick"), name: "joystick", stroke: css("--joystick"), of: "joystick", dash: [5, 4] },
      ...cranes.map((c) => ({ ...(c === "machine" ? { label: text("chart.valve"), name: "valve" } : named(c)), stroke: color(c), of: `valve ${c}`, width: 2 }))];
    const sways = [...cranes.map((c) => ({ ...(c === "machine" ? { label: text("chart.measured"), name: "measured" } : named(c)), stroke: color(c), of: `sway ${c}`, width: 2 })),
      { label: text("chart.model"), name: "model", stroke: css("--predicted"), of: `model ${this.main}`, dash: [3, 3] }];
    this.command = this.plot("chart-command", "legend-command", lines, 100, { range: [-105, 105] });
    this.sway = this.plot("chart-sway", "legend-sway", sways, 1, {
      range: (_, low, high) => {
        const most = Math.max(5, Math.abs(low ?? 0), Math.abs(high ?? 0)) * 1.08;
        return [-most, most];
      },
    });
    this.states = this.plot("chart-states", "legend-states",
      cranes.map((c) => ({ ...named(c), stroke: color(c) })), 1, { range: [0, 1] }, (u) => this.lanes.draw(u));
  }

  destroy() {
    for (const plot of [this.command, this.sway, this.states]) plot?.destroy();
  }

  /** @param paint draws into a plot that has no lines. */
  plot(id, legendId, series, scale, y, paint) {
    const host = document.getElementById(id);
    const grid = { stroke: css("--line"), width: 1 };
    const axis = { stroke: css("--quiet"), grid, ticks: { show: false }, font: `${11 * large()}px system-ui, sans-serif` };
    const [wide, tall] = [38 * large(), 22 * large()];
    const plot = new uPlot({
      width: host.clientWidth, height: host.clientHeight, cursor: { sync: { key: "charts" }, drag: { setScale: false, x: false }, points: { show: false } }, legend: { show: false },
      padding: [6, 16, 0, 0],
      scales: { x: { time: false, range: () => this.range() }, y },
      hooks: { setCursor: [(u) => this.showCursor(u)], ready: [(u) => this.listen(u)], draw: [...(paint ? [paint] : []), (u) => this.line(u)] },
      axes: paint ? [{ show: false }, { ...axis, size: wide, values: (_, v) => v.map(() => ""), grid: { show: false } }]
        : [{ ...axis, size: tall, values: (_, v) => v.map((s) => (s || this.stoppedAt || this.at !== null ? `${s} s` : text("chart.now"))) }, { ...axis, size: wide }],
      series: [{}, ...series.map((s) => ({ stroke: s.stroke, width: s.width ?? 1.5, dash: s.dash, points: { show: false } }))],
    }, [[], ...series.map(() => [])], host);
    plot.lines = series;
    plot.factor = scale;
    const legend = document.getElementById(legendId);
    legend.replaceChildren(...series.map((s) => {
      const item = document.createElement("span");
      const line = document.createElement("i");
      line.style.setProperty("--color", s.stroke);
      const value = document.createElement("b");
      item.append(line, value, s.label); // of a long name the end is cut off, not the value
      return item;
    }));
    plot.values = legend.querySelectorAll("b");
    return plot;
  }

  /** Up to when is shown, and where zero is: now, or the begin of a drive that is over. */
  window() {
    const last = this.history.last ?? 0;
    if (this.at === null) return [this.stoppedAt ?? last, this.stoppedAt ?? last];
    const first = this.history.first ?? 0;
    return [Math.max(first + this.seconds, Math.min(last, this.at + this.seconds / 2)), 0];
  }

  range() {
    const [end, zero] = this.window();
    return [end - this.seconds - zero, end - zero];
  }

  /** Look at a time of a drive that is over. */
  seek(t) {
    this.at = t;
  }

  listen(plot) {
    plot.over.addEventListener("click", () => {
      if (this.at !== null && plot.cursor.left >= 0) this.onseek?.(plot.posToVal(plot.cursor.left, "x"));
    });
  }

  /** The time that is looked at, as a line. */
  line(plot) {
    if (this.at === null) return;
    const { top, height } = plot.bbox;
    plot.ctx.fillStyle = css("--text");
    plot.ctx.fillRect(plot.valToPos(this.at, "x", true), top, devicePixelRatio, height);
  }

  /** Write what is under the cursor into the legend. */
  showCursor(plot) {
    const at = plot.cursor.idx;
    const t = at == null ? null : plot.data[0][at];
    const states = plot === this.states;
    const words = states && t !== null ? this.lanes.words(t) : [];
    plot.values?.forEach((element, i) => {
      const value = t === null || states ? null : plot.data[i + 1][at];
      set(element, words[i] ?? (value == null ? "" : value.toFixed(1)));
    });
    if (!states) return;
    const mark = t === null ? null : this.lanes.near(plot, this.axis);
    set(document.getElementById("mark"), mark ?? "");
    document.getElementById("legend-states").hidden = mark !== null;
  }

  /** Mark an event on the time axis. */
  mark(t, source, text, level) {
    this.events.push({ t, source, text, level });
    if (this.events.length > MOST_EVENTS) this.events.shift();
  }

  /** Keep one picture of the machine. */
  add(shown) {
    const [numbers, states] = [{}, {}];
    for (const axis of this.hello.axes) {
      numbers[`${axis} joystick`] = shown.cranes[this.main]?.axes[axis].joystick;
      for (const [name, crane] of Object.entries(shown.cranes)) {
        const way = this.hello.sway_of[axis];
        const one = crane.axes[axis];
        numbers[`${axis} valve ${name}`] = one.valve;
        numbers[`${axis} sway ${name}`] = way && (crane.measured || crane.simulated) ? crane.sway?.[way === "across" ? 0 : 1] : null;
        numbers[`${axis} model ${name}`] = one.predicted;
        states[`${axis} ${name}`] = one;
      }
    }
    if (shown.t < this.history.last) { // another studio
      this.history.clear();
      this.events = [];
    }
    this.history.push(shown.t, numbers, states);
  }

  /** Stop the picture, or let it go on; nothing is lost meanwhile. */
  pause(on) {
    this.stoppedAt = on ? this.history.last ?? null : null;
    this.drawn = 0;
    // The range may be the same one, but its end is now no more.
    for (const plot of [this.command, this.sway]) plot.redraw(false, true);
  }

  /** Show more seconds, or fewer. */
  zoom(steps) {
    const at = WINDOWS_S.indexOf(this.seconds) + steps;
    this.seconds = WINDOWS_S[Math.max(0, Math.min(WINDOWS_S.length - 1, at))];
    this.drawn = 0;
  }

  /** Everything that is kept, as lines of comma-separated values. */
  csv() {
    const plots = [["command", this.command], ["sway", this.sway]];
    const columns = this.hello.axes.flatMap((axis) => plots.flatMap(([what, plot]) =>
      plot.lines.map((line) => [`${axis} ${what} ${line.name}`, `${axis} ${line.of}`, plot.factor])));
    const states = this.hello.axes.flatMap((axis) => this.hello.cranes.map((c) => [axis, c]));
    const titles = [...columns.map(([name]) => name), ...states.map(([axis, c]) => `${axis} state ${c}`)];
    const lines = [["seconds", ...titles].join(",")];
    const { history } = this;
    for (let row = 0; row < history.length; row += 1) {
      const cells = columns.map(([, column, factor]) => {
        const value = history.value(row, column);
        return value === null ? "" : String(Math.round(1000 * value * factor) / 1000);
      });
      const words = states.map(([axis, c]) => `"${history.look(row, `${axis} ${c}`)?.state ?? ""}"`);
      lines.push([(history.time(row) - history.first).toFixed(3), ...cells, ...words].join(","));
    }
    return `${lines.join("\n")}\n`;
  }

  /** The charts as they are, one above the other, as a canvas. */
  picture() {
    const parts = [this.command, this.sway, this.states].map((plot) => plot.ctx.canvas);
    const whole = document.createElement("canvas");
    whole.width = Math.max(...parts.map((part) => part.width));
    whole.height = parts.reduce((sum, part) => sum + part.height, 0);
    const pen = whole.getContext("2d");
    pen.fillStyle = css("--panel");
    pen.fillRect(0, 0, whole.width, whole.height);
    parts.reduce((top, part) => {
      pen.drawImage(part, 0, top);
      return top + part.height;
    }, 0);
    return whole;
  }

  draw(now) {
    const { history } = this;
    if (now - this.drawn < DRAW_MS || !history.length) return;
    this.drawn = now;
    const [end, zero] = this.window();
    const [from, to] = [history.from(end - this.seconds), history.after(end)];
    const every = Math.max(1, Math.ceil((to - from) / MOST_POINTS));
    const rows = Array.from({ length: Math.ceil((to - from) / every) }, (_, i) => from + i * every);
    const x = rows.map((row) => history.time(row) - zero);
    for (const plot of [this.command, this.sway]) {
      plot.setData([x, ...plot.lines.map(({ of }) => rows.map((row) => {
        const value = history.value(row, `${this.axis} ${of}`);
        return value === null ? null : value * plot.factor;
      }))]);
    }
    // Not one state may be left out.
    for (const name of this.hello.cranes) this.lanes.spans[name] = spans(history, `${this.axis} ${name}`, from, to, zero);
    this.lanes.marks = this.events.filter(({ t }) => t <= end && end - t <= this.seconds).map((one) => ({ ...one, t: one.t - zero }));
    this.states.setData([x, ...this.hello.cranes.map(() => x.map(() => null))]);
  }

  show(axis) {
    this.axis = axis;
    this.drawn = 0;
    const { sway_of: { [axis]: way }, hall, drawn } = this.hello;
    const of = hall && drawn ? "chart.flown" : `chart.${hall ? "hall." : ""}${way}`;
    document.getElementById("sway-of").textContent = text(way ? of : "chart.nosway");
  }

  resize() {
    for (const [plot, id] of [[this.command, "chart-command"], [this.sway, "chart-sway"], [this.states, "chart-states"]]) {
      const host = document.getElementById(id);
      plot.setSize({ width: host.clientWidth, height: host.clientHeight });
    }
  }
}
