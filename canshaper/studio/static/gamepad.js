// A gamepad: its sticks, and what its buttons do. A button counts when it goes down, not before it
// was seen up: one that is held while the gamepad is connected does nothing.

import { nameOf, text } from "/static/language.js";

/** By the number in the standard mapping of browsers. */
const BUTTONS = [
  { number: 0, name: "A", action: "enable" },
  { number: 1, name: "B", action: "release" },
  { number: 2, name: "X", action: "antisway" },
  { number: 3, name: "Y", action: "profile" },
  { number: 5, name: "RB", action: "grip" },
  { number: 9, name: "Start", action: "reset" },
];
const DEAD = 0.1;

export class Gamepad {
  /** @param host where the layout is shown; @param ways axes with the number of their stick. */
  constructor(host, ways) {
    this.host = host;
    this.ways = ways;
    this.id = null;
    this.down = [];
    this.on = {}; // what to do, by action
    this.lost = () => {}; // what to do when it is unplugged
    host.hidden = true;
  }

  /** Positions of its sticks, up and right positive; null where there is none. Its buttons act. */
  read() {
    const pad = [...(navigator.getGamepads?.() ?? [])].find((one) => one?.connected);
    if ((pad?.id ?? null) !== this.id || !pad) this.connected(pad);
    if (!pad) return null;
    for (const { number, action } of BUTTONS) {
      const down = Boolean(pad.buttons?.[number]?.pressed);
      if (down && this.down[number] === false) this.on[action]?.();
      this.down[number] = down;
    }
    return pad.axes.map((value, number) => beyondDeadZone(number % 2 ? -value : value));
  }

  /** Show the layout of another one, or none. */
  connected(pad) {
    if (this.id !== null && !pad) this.lost();
    this.down = [];
    this.id = pad ? pad.id ?? "" : null;
    this.host.hidden = !pad;
    if (!pad) return;
    const usual = !pad.mapping || pad.mapping === "standard";
    const rows = [...this.ways.map((w) => [text(`stick.${w.gamepad}`), nameOf("axis", w.axis)]),
      ...BUTTONS.filter(({ action }) => this.on[action]).map(({ number, name, action }) =>
        [usual ? name : text("gamepad.button", { number: number + 1 }), text(`gamepad.${action}`)])];
    this.host.replaceChildren(...rows.flatMap(([part, does]) => [
      Object.assign(document.createElement("kbd"), { textContent: part }),
      Object.assign(document.createElement("span"), { textContent: does }),
    ]));
  }
}

function beyondDeadZone(value) {
  const far = (Math.abs(value) - DEAD) / (1 - DEAD);
  return far > 0 ? Math.sign(value) * Math.min(1, far) : 0;
}
