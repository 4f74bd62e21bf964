// What the filter in force leaves of the swing, over the length that the pendulum really has.
import { text } from "/static/language.js";
import { large } from "/static/theme.js";
import uPlot from "/static/vendor/uplot.js";

const SOON_MS = 300; // a slider that is dragged asks once
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export class Residual {
  /** @param host where it is drawn; @param legend where its numbers stand. */
  constructor(host, legend) {
    this.host = host;
    this.legend = legend;
    this.curves = null;
    this.asked = "";
  }

  /** Ask for the curves when other numbers are in force. @param numbers whatever changes with them. */
  follow(numbers) {
    const now = JSON.stringify(numbers);
    if (now === this.asked || this.host.hidden) return;
    this.asked = now;
    clearTimeout(this.soon);
    this.soon = setTimeout(() => this.load(), SOON_MS);
  }

  async load() {
    try {
      this.curves = await (await fetch("/residuals.json")).json();
    } catch {
      this.asked = ""; // the page says that the studio is gone, and asks again
      return;
    }
    this.build();
  }

  show(axis) {
    this.axis = axis;
    if (this.curves) this.build();
  }

  build() {
    this.plot?.destroy();
    this.plot = null;
    const curve = this.curves?.[this.axis];
    if (this.host.hidden || !this.curves) return;
    if (!curve) {
      this.legend.textContent = text("left.none");
      return;
    }
    const { believes, file } = curve;
    const grid = { stroke: css("--line"), width: 1 };
    const font = `${12 * large()}px system-ui, sans-serif`;
    const axis = { stroke: css("--quiet"), grid, ticks: { show: false }, font, labelFont: font };
    this.plot = new uPlot({
      width: this.host.clientWidth, height: this.host.clientHeight - this.legend.offsetHeight,
      legend: { show: false }, cursor: { drag: { setScale: false, x: false } }, padding: [12, 20, 0, 0],
      scales: { x: { time: false }, y: { range: (_, __, high) => [0, Math.max(20, high ?? 0) * 1.05] } },
      axes: [{ ...axis, label: text("left.length") }, { ...axis, size: 56, label: text("left.swing") }],
      series: [{}, { stroke: css("--shaped"), width: 2.5, points: { show: false } }],
      hooks: { draw: [(u) => { mark(u, believes, css("--text"), []); mark(u, file, css("--other"), [6, 4]); }] },
    }, [curve.lengths_m, curve.left.map((part) => 100 * part)], this.host);
    const left = at(curve, file);
    this.legend.textContent = text("left.words", {
      believes: believes.toFixed(2), file: file.toFixed(2), percent: (100 * left).toFixed(1),
    });
  }

  resize() {
    if (this.plot) this.build();
  }
}

/** What is left at a length. */
function at({ lengths_m: lengths, left }, length) {
  const i = Math.max(1, lengths.findIndex((one) => one >= length));
  const part = (length - lengths[i - 1]) / (lengths[i] - lengths[i - 1]);
  return left[i - 1] + part * (left[i] - left[i - 1]);
}

function mark(u, x, color, dash) {
  const { top, height } = u.bbox;
  const px = u.valToPos(x, "x", true);
  u.ctx.save();
  u.ctx.strokeStyle = color;
  u.ctx.lineWidth = 2;
  u.ctx.setLineDash(dash);
  u.ctx.beginPath();
  u.ctx.moveTo(px, top);
  u.ctx.lineTo(px, top + height);
  u.ctx.stroke();
  u.ctx.restore();
}
