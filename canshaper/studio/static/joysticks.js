// Where the joysticks are: mouse on two pads, keyboard, gamepad. The largest deflection counts.
import { Gamepad } from "/static/gamepad.js";
import { nameOf, text } from "/static/language.js";

const RAMP_S = 0.12; // a hand moves a joystick from neutral to full in that time
const FINE = 0.4; // with Shift
const SVG = "http://www.w3.org/2000/svg";

// Four ways of two pads: axis of the deployment by its number, sign of right or up, keys, gamepad.
const WAYS = [
  { pad: 0, way: "x", keys: ["KeyD", "KeyA"], gamepad: 0 },
  { pad: 0, way: "y", keys: ["KeyW", "KeyS"], gamepad: 1 },
  { pad: 1, way: "y", keys: ["ArrowUp", "ArrowDown"], gamepad: 3 },
  { pad: 1, way: "x", keys: ["ArrowRight", "ArrowLeft"], gamepad: 2 },
];
const ARROWS = { ArrowUp: "↑", ArrowDown: "↓", ArrowLeft: "←", ArrowRight: "→" };
const SHIFTS = ["ShiftLeft", "ShiftRight"];

export class Joysticks {
  /** @param axes names of the axes, in the order of the deployment. */
  constructor(axes, pads, keys) {
    this.ways = axes.slice(0, 4).map((axis, i) => ({
      axis, ...WAYS[i], key: 0, mouse: 0,
      // Positive slewing is counter-clockwise from above, to the left.
      sign: axis === "slew" ? -1 : 1,
    }));
    this.down = new Set();
    this.at = performance.now();
    this.pads = [];
    pads.replaceChildren();
    for (const number of [0, 1]) {
      const ways = this.ways.filter((w) => w.pad === number);
      if (ways.length) pads.append(this.buildPad(number, ways));
    }
    this.gamepad = new Gamepad(document.getElementById("gamepad"), this.ways);
    this.keys = keys;
    this.nameKeys();
    // What is printed on the keys of this keyboard; not every browser reports it.
    navigator.keyboard?.getLayoutMap?.().then((names) => this.nameKeys(names), () => {});
  }

  nameKeys(names) {
    const keyName = (code) => ARROWS[code] ?? (names?.get(code) ?? code.replace("Key", "")).toUpperCase();
    this.keys.replaceChildren();
    const rows = this.ways.map((w) => [w.keys.map(keyName), `${nameOf("axis", w.axis)} ${wayOf(w.axis)}`]);
    for (const [names, does] of [...rows, [["⇧"], text("key.gently")], [[text("key.space")], text("key.stop")]]) {
      const left = document.createElement("span");
      for (const name of names) left.append(Object.assign(document.createElement("kbd"), { textContent: name }), " ");
      this.keys.append(left, Object.assign(document.createElement("span"), { textContent: does }));
    }
  }

  buildPad(number, ways) {
    const box = document.createElement("div");
    box.className = "pad";
    const svg = document.createElementNS(SVG, "svg");
    svg.setAttribute("viewBox", "-60 -60 120 120");
    svg.setAttribute("role", "application");
    svg.setAttribute("aria-label", text("page.pad", { axes: ways.map((w) => nameOf("axis", w.axis)).join(", ") }));
    svg.id = `pad${number}`;
    const add = (name, attributes) => {
      const element = document.createElementNS(SVG, name);
      for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
      svg.append(element);
      return element;
    };
    add("rect", { class: "plate", x: -59, y: -59, width: 118, height: 118, rx: 10 });
    if (ways.some((w) => w.way === "x")) add("line", { class: "cross", x1: -46, x2: 46, y1: 0, y2: 0 });
    if (ways.some((w) => w.way === "y")) add("line", { class: "cross", x1: 0, x2: 0, y1: -46, y2: 46 });
    for (const w of ways) {
      const label = add("text", { class: "label", "text-anchor": w.way === "x" ? "end" : "middle",
        x: w.way === "x" ? 55 : 0, y: w.way === "x" ? -17 : -50 });
      label.textContent = nameOf("axis", w.axis);
    }
    const knob = add("circle", { class: "knob", r: 13 });
    const sent = add("circle", { class: "sent", r: 3.5 });
    const move = (event) => {
      const at = svg.getBoundingClientRect();
      const x = ((event.clientX - at.left) / at.width - 0.5) * 2 * (60 / 46);
      const y = -((event.clientY - at.top) / at.height - 0.5) * 2 * (60 / 46);
      for (const w of ways) w.mouse = limited(w.way === "x" ? x : y);
    };
    const release = () => ways.forEach((w) => { w.mouse = 0; });
    svg.addEventListener("pointerdown", (event) => {
      svg.setPointerCapture(event.pointerId);
      move(event);
    });
    svg.addEventListener("pointermove", (event) => {
      if (svg.hasPointerCapture(event.pointerId)) move(event);
    });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) svg.addEventListener(name, release);
    this.pads.push({ ways, knob, sent });
    box.append(svg);
    return box;
  }

  /** Take a key by its code; whether it moves a joystick. */
  press(key, isDown) {
    const known = this.ways.some((w) => w.keys.includes(key));
    if (isDown && (known || SHIFTS.includes(key))) this.down.add(key);
    else this.down.delete(key);
    return known;
  }

  /** Let go of everything: the page has lost the focus. */
  release() {
    this.down.clear();
    for (const w of this.ways) w.mouse = 0;
  }

  /** Positions now, -1 .. 1 by axis. */
  read() {
    const now = performance.now();
    const step = Math.min(0.1, (now - this.at) / 1000) / RAMP_S;
    this.at = now;
    const sticks = this.gamepad.read();
    const values = {};
    const fine = SHIFTS.some((key) => this.down.has(key)) ? FINE : 1;
    for (const w of this.ways) {
      const aim = (this.down.has(w.keys[0]) - this.down.has(w.keys[1])) * fine;
      w.key += limited(aim - w.key, step);
      const all = [w.key, w.mouse, sticks?.[w.gamepad] ?? 0];
      w.now = all.reduce((a, b) => (Math.abs(b) > Math.abs(a) ? b : a));
      values[w.axis] = Math.round(w.now * w.sign * 1000) / 1000;
    }
    return values;
  }

  /** Draw the knobs where the hand is, and what counts of it. */
  draw(counted) {
    for (const { ways, knob, sent } of this.pads) {
      for (const w of ways) {
        const own = (w.now ?? 0) * 46;
        const there = (counted?.[w.axis]?.joystick ?? 0) * w.sign * 46;
        const key = w.way === "x" ? "cx" : "cy";
        place(knob, key, w.way === "x" ? own : -own);
        place(sent, key, w.way === "x" ? there : -there);
      }
    }
  }
}

/** Names of the two ways of an axis, the positive one first. */
function wayOf(axis) {
  const key = `way.${axis}`;
  const words = text(key);
  return words === key ? "+ / −" : words;
}

/** Change an attribute only where it is another: each change draws the pad anew. */
function place(element, key, value) {
  const text = value.toFixed(1);
  if (element.getAttribute(key) !== text) element.setAttribute(key, text);
}

function limited(value, most = 1) {
  return Math.max(-most, Math.min(most, value));
}
