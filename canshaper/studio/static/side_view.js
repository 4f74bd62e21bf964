// The cranes from the side, in two dimensions: where there is no WebGL.
import { boomPoints, counterJib, hungPoints, ropePoints, tallest } from "/static/geometry.js";
import { nameOf, text } from "/static/language.js";

const RAD = Math.PI / 180;
const BEHIND_M = 1.5; // drawn behind the pillar
const FREE_M = 0.7; // above, below and beyond what the crane reaches
const TELESCOPE_M = 2.5; // its stroke
const BOOM_PX = 6;
const TRAIL = 90;
const LEAP_S = 1; // a longer step is another part of a drive

export class SideView {
  /** @param canvas that has no WebGL context; @param hello what there is. */
  constructor(canvas, hello) {
    this.canvas = canvas;
    this.hello = hello;
    this.pen = canvas.getContext("2d");
    this.overlay = false;
    this.trails = Object.fromEntries(hello.cranes.map((name) => [name, []]));
    const { boom, grapple, hall } = hello;
    this.behind = BEHIND_M + counterJib(boom);
    this.reach = boom.main_boom_m + boom.outer_boom_m + TELESCOPE_M + FREE_M;
    this.height = tallest(boom) + FREE_M + grapple.l1;
    if (hall) [this.behind, this.reach, this.height] = [0, hall.runway, hall.rope + hall.sling + 2 * FREE_M];
    this.paint();
  }

  /** Take the colours of the theme. */
  paint() {
    const style = getComputedStyle(document.documentElement);
    const names = ["shaped", "raw", "other", "sky", "ground", "grid", "text", "quiet"];
    this.colors = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  }

  setOverlay(on) {
    this.overlay = on;
  }

  dispose() {} // nothing of it is kept outside of this page

  add(shown) {
    const leap = this.shown && !(shown.t >= this.shown.t && shown.t < this.shown.t + LEAP_S);
    if (leap) for (const trail of Object.values(this.trails)) trail.length = 0;
    this.shown = shown;
    for (const [name, crane] of Object.entries(shown.cranes)) {
      const trail = this.trails[name];
      if (!(crane.pose || crane.trolley) || !crane.sway) continue;
      trail.push(this.points(crane).grapple);
      if (trail.length > TRAIL) trail.shift();
    }
  }

  /** Pivots and grapple as [radius, height]; of a bridge crane along its runway, above the ground. */
  points(crane) {
    const { hall, drawn } = this.hello;
    if (hall) {
      const points = ropePoints(crane.trolley, crane.sway, hall.sling, crane.sling);
      const left = (drawn ? crane.trolley[0] : 0) - hall.runway / 2; // a multicopter keeps its place
      const at = ([along, , up]) => [along - left, hall.rope + hall.sling + FREE_M + up];
      return { tip: at(points.tip), joint: at(points.hook), grapple: at(points.load) };
    }
    const points = boomPoints(this.hello.boom, crane.pose, crane.joints);
    const hung = hungPoints(this.hello, crane);
    const at = ([out, , up]) => [points.tip[0] + out, points.tip[1] + up];
    return { ...points, joint: at(hung.joint), grapple: at(hung.grapple) };
  }

  draw() {
    const { canvas, pen, colors } = this;
    const sharp = Math.min(devicePixelRatio, 2);
    const [w, h] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.round(w * sharp)) canvas.width = Math.round(w * sharp);
    if (canvas.height !== Math.round(h * sharp)) canvas.height = Math.round(h * sharp);
    pen.setTransform(sharp, 0, 0, sharp, 0, 0);
    pen.fillStyle = colors.sky;
    pen.fillRect(0, 0, w, h);
    const { cranes } = this.hello;
    const part = this.overlay ? w : w / cranes.length;
    const scale = Math.min(part / (this.reach + this.behind), h / (this.height + FREE_M));
    const ground = h - FREE_M * scale;
    pen.fillStyle = colors.ground;
    pen.fillRect(0, ground, w, h - ground);
    cranes.forEach((name, i) => {
      const left = this.overlay ? 0 : i * part;
      const at = ([radius, height]) => [left + (radius + this.behind) * scale, ground - height * scale];
      this.drawCrane(name, this.shown?.cranes[name], at, i, left);
    });
  }

  drawCrane(name, crane, at, number, left) {
    const { pen, colors } = this;
    const color = colors[this.hello.colors[name].slice(2)];
    pen.textAlign = "left";
    pen.font = "600 15px system-ui, sans-serif";
    pen.fillStyle = color;
    pen.fillText(nameOf("crane", name), left + 12, 22 + (this.overlay ? 20 * number : 0));
    pen.font = "13px system-ui, sans-serif";
    pen.fillStyle = colors.text;
    const { hall, boom, drawn } = this.hello;
    if (!(hall ? crane?.trolley : crane?.pose)) {
      pen.fillText(text("nopose.crane"), left + 12, 62);
      return;
    }
    const angle = hall ? "" : `${text("page.slewed", { deg: (((crane.pose[0] + 540) % 360) - 180).toFixed(0) })}, `;
    const across = crane.sway ? text("page.across", { deg: crane.sway[hall ? 1 : 0].toFixed(1) }) : "";
    if (!this.overlay) {
      pen.fillText(angle + across, left + 12, 42);
      if (!crane.measured) pen.fillText(text(crane.simulated ? "page.simulated" : "page.modelled"), left + 12, 62);
    }
    const points = this.points(crane);
    if (hall) {
      const ends = drawn ? points.tip[0] - 1 : 0;
      this.line([[ends, points.tip[1]], [hall.runway - ends, points.tip[1]]].map(at), colors.quiet, BOOM_PX - 2);
    } else {
      this.line([[0, 0], [0, boom.pillar_m], points.start].map(at), color, BOOM_PX + 2);
      this.line([points.start, points.elbow, points.base, points.end].map(at), color, BOOM_PX);
      this.line([points.end, points.tip].map(at), color, BOOM_PX - 2);
    }
    this.line([points.tip, [points.tip[0], 0]].map(at), colors.quiet, 1, [4, 4]);
    this.line(this.trails[name].map(at), color, 1.5);
    if (!crane.sway) return;
    this.line([points.tip, points.joint, points.grapple].map(at), color, 3, crane.measured ? [] : [5, 4]);
    const [x, y] = at(points.grapple);
    pen.beginPath();
    pen.arc(x, y, 9, 0, 360 * RAD);
    if (crane.measured) pen.fill();
    else pen.stroke();
  }

  line(points, color, width, dash = []) {
    const { pen } = this;
    pen.strokeStyle = pen.fillStyle = color;
    pen.lineWidth = width;
    pen.lineCap = pen.lineJoin = "round";
    pen.setLineDash(dash);
    pen.beginPath();
    points.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.stroke();
    pen.setLineDash([]);
  }
}
