// The cranes from above, on one scale: the way of tip and grapple, and how far the grapple gets past
// a tip that stands.
import { boomPoints, hungPoints, ropePoints } from "/static/geometry.js";
import { nameOf, text } from "/static/language.js";

const RAD = Math.PI / 180;
const KEPT_S = 12;
const LEAP_S = 1; // a longer step is another part of a drive
const STANDS_M = 0.01; // a tip that moved less in STANDS_S stands
const STANDS_S = 0.3;
const FREE_M = 0.8; // around what is drawn
const DRAW_MS = 50;

/** Tip and grapple from above, [x, y]; the boom that has not slewed lies along x. */
export function fromAbove(hello, crane) {
  const { pose, joints, trolley, sway, sling, aim } = crane;
  if (trolley) {
    const { tip, load } = ropePoints(trolley, sway, hello.hall.sling, sling);
    return { tip: tip.slice(0, 2), grapple: sway ? load.slice(0, 2) : null, aim: null };
  }
  const [s, c] = [Math.sin(pose[0] * RAD), Math.cos(pose[0] * RAD)];
  const at = (out, side) => [out * c - side * s, out * s + side * c];
  const radius = boomPoints(hello.boom, pose, joints).tip[0];
  const [out, side] = hungPoints(hello, crane).grapple;
  return { tip: at(radius, 0), grapple: sway ? at(radius + out, side) : null, aim: aimAt(aim) };
}

/** Where the tip will stop if the joysticks are let go now; nothing where that is not known. */
function aimAt(aim) {
  return aim && [aim[1] * Math.cos(aim[0] * RAD), aim[1] * Math.sin(aim[0] * RAD)];
}

/** The way of one crane, and its overshoot. */
export class Way {
  constructor() { this.points = []; this.overshoot = null; }

  add(t, { tip, grapple, aim }) {
    const last = this.points.at(-1);
    if (last && !(t >= last.t && t < last.t + LEAP_S)) [this.points, this.overshoot] = [[], null];
    this.points.push({ t, tip, grapple, aim });
    while (this.points[0].t < t - KEPT_S) this.points.shift();
    const before = this.points.findLast((point) => point.t <= t - STANDS_S);
    this.stands = Boolean(before) && distance(before.tip, tip) < STANDS_M;
    if (!this.stands) this.overshoot = null; // of a tip that moves there is none yet
    else if (grapple) this.overshoot = Math.max(this.overshoot ?? 0, distance(grapple, tip));
  }
}

export class Plan {
  constructor(canvas, hello) {
    this.canvas = canvas;
    this.hello = hello;
    this.pen = canvas.getContext("2d");
    this.ways = Object.fromEntries(hello.cranes.map((name) => [name, new Way()]));
    this.drawn = 0;
    this.paint();
  }

  /** Take the colours of the theme. */
  paint() {
    const style = getComputedStyle(document.documentElement);
    const names = ["--sky", "--grid", "--text", "--quiet", ...Object.values(this.hello.colors)];
    this.colors = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(name).trim()]));
  }

  add(shown) {
    for (const [name, crane] of Object.entries(shown.cranes)) {
      if (crane.pose || crane.trolley) this.ways[name]?.add(shown.t, fromAbove(this.hello, crane));
    }
  }

  draw(now) {
    if (now - this.drawn < DRAW_MS) return;
    this.drawn = now;
    const { canvas, pen, colors } = this;
    const sharp = Math.min(devicePixelRatio, 2);
    const [w, h] = [canvas.clientWidth, canvas.clientHeight];
    [canvas.width, canvas.height] = [Math.round(w * sharp), Math.round(h * sharp)];
    pen.setTransform(sharp, 0, 0, sharp, 0, 0);
    pen.fillStyle = colors["--sky"];
    pen.fillRect(0, 0, w, h);
    const all = Object.values(this.ways).flatMap((way) => way.points.flatMap((p) => [p.tip, p.grapple ?? p.tip]));
    if (!all.length) return;
    const middle = [0, 1].map((k) => (Math.min(...all.map((p) => p[k])) + Math.max(...all.map((p) => p[k]))) / 2);
    const half = [0, 1].map((k) => FREE_M + Math.max(...all.map((p) => Math.abs(p[k] - middle[k]))));
    const scale = Math.min(w / (2 * half[0]), h / (2 * half[1]));
    const at = ([x, y]) => [w / 2 + (x - middle[0]) * scale, h / 2 - (y - middle[1]) * scale];
    this.metres(at, scale, middle, w, h);
    const names = Object.entries(this.ways);
    names.forEach(([name, way], i) => this.way(name, way, at, 22 + 20 * i));
    const words = `${text("page.above")} ${names.map(([name, way]) => `${nameOf("crane", name)}: ${said(way)}`).join("; ")}`;
    if (words !== this.words) canvas.setAttribute("aria-label", words);
    this.words = words;
  }

  /** A grid of metres, named. */
  metres(at, scale, middle, w, h) {
    const { pen, colors } = this;
    pen.strokeStyle = colors["--grid"];
    pen.fillStyle = colors["--quiet"];
    pen.font = "11px system-ui, sans-serif";
    pen.lineWidth = 1;
    for (const [k, size] of [[0, w], [1, h]]) {
      const reach = size / scale / 2;
      for (let m = Math.ceil(middle[k] - reach); m <= middle[k] + reach; m += 1) {
        const [x, y] = at(k ? [middle[0], m] : [m, middle[1]]);
        this.line(k ? [[0, y], [w, y]] : [[x, 0], [x, h]]);
        if (k) pen.fillText(`${m} m`, 4, y - 3);
        else pen.fillText(`${m} m`, x + 3, h - 5);
      }
    }
  }

  way(name, way, at, line) {
    const { pen } = this;
    const last = way.points.at(-1);
    const color = this.colors[this.hello.colors[name]];
    pen.font = "600 15px system-ui, sans-serif";
    pen.fillStyle = pen.strokeStyle = color;
    pen.fillText(`${nameOf("crane", name)}: ${said(way)}`, 44, line, this.canvas.clientWidth - 52);
    if (!last) return;
    pen.lineWidth = 1;
    this.line(way.points.map((p) => at(p.tip)), [5, 3]);
    pen.lineWidth = 2;
    this.line(way.points.filter((p) => p.grapple).map((p) => at(p.grapple)));
    const [x, y] = at(last.tip);
    pen.strokeRect(x - 4, y - 4, 8, 8);
    if (last.aim) this.cross(at(last.aim));
    if (!last.grapple) return;
    pen.beginPath();
    pen.arc(...at(last.grapple), 6, 0, 2 * Math.PI);
    pen.fill();
    if (!way.overshoot) return;
    pen.lineWidth = 1;
    pen.setLineDash([2, 3]);
    pen.beginPath();
    pen.arc(x, y, Math.abs(at([way.overshoot, 0])[0] - at([0, 0])[0]), 0, 2 * Math.PI);
    pen.stroke();
    pen.setLineDash([]);
  }

  /** The aim point. */
  cross([x, y]) {
    this.line([[x - 9, y], [x + 9, y]]);
    this.line([[x, y - 9], [x, y + 9]]);
  }

  line(points, dash = []) {
    const { pen } = this;
    pen.setLineDash(dash);
    pen.beginPath();
    points.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.stroke();
    pen.setLineDash([]);
  }
}

function said(way) {
  if (!way.points.length) return text("above.nopose");
  const { tip, aim } = way.points.at(-1);
  if (way.overshoot === null) {
    return aim ? text("above.aim", { m: distance(tip, aim).toFixed(1) }) : text("above.moves");
  }
  return text("above.overshoot", { cm: Math.round(100 * way.overshoot) });
}

function distance([x, y], [u, v]) {
  return Math.hypot(x - u, y - v);
}
