// Numbers of a running machine: what is in force, another value, the way back, and the file.

import { text } from "/static/language.js";

const make = (tag, attributes = {}, ...children) => {
  const element = Object.assign(document.createElement(tag), attributes);
  element.append(...children);
  return element;
};
const short = (value) => String(Number(value.toPrecision(6)));

export class Numbers {
  /** @param host the section; @param send called with a message to the studio. */
  constructor(host, send) {
    this.rows = {};
    this.part = (name) => host.querySelector(`.${name}`);
    host.hidden = false;
    const who = this.part("who");
    who.value = localStorage.getItem("who") ?? "";
    who.onchange = () => localStorage.setItem("who", who.value);
    this.send = (message) => send({ ...message, who: who.value });
    this.part("set").onclick = () => this.set();
    this.part("swap").onclick = () => this.send({ numbers: "swap" });
    this.part("undo").onclick = () => this.send({ numbers: "undo" });
    this.part("write").onclick = () => this.send({ numbers: "difference" });
    this.dialog = this.part("difference");
    this.part("cancel").onclick = () => this.dialog.close();
    this.part("really").onclick = () => {
      this.send({ numbers: "write", hash: this.hash });
      this.dialog.close();
    };
  }

  /** Take what is in force now. */
  show({ table, fault, undo, other, changes }) {
    this.table = table;
    for (const [key, one] of Object.entries(table)) {
      const row = (this.rows[key] ??= this.row(key, one));
      row.now.textContent = short(one.now);
      row.now.classList.toggle("warn", one.now !== one.file);
      row.file.textContent = short(one.file);
      row.other.textContent = key in other ? short(other[key]) : "";
    }
    this.part("undo").disabled = !undo;
    this.part("swap").disabled = !Object.keys(other).length;
    this.part("fault").textContent = fault;
    this.part("changes").replaceChildren(...changes.toReversed().map(({ time_s: time, who, numbers }) => make("li", {},
      make("time", {}, new Date(time * 1000).toTimeString().slice(0, 8)), make("b", {}, who),
      make("span", {}, Object.entries(numbers).map(([key, [was, is]]) => `${key} ${short(was)} → ${short(is)}`).join(", ")))));
    this.ready();
  }

  row(key, { low, high }) {
    const input = make("input", { type: "number", min: low, max: high, step: "any", ariaLabel: text("numbers.anotherOf", { key }), oninput: () => this.ready() });
    const cells = { now: make("td"), file: make("td"), other: make("td"), input };
    this.part("table").append(make("tr", {}, make("td", {}, key), cells.now, cells.file, cells.other,
      make("td", {}, text("numbers.fromTo", { low: short(low), high: short(high) })), make("td", {}, input)));
    return cells;
  }

  /** Values that were put in, by key. */
  wanted() {
    return Object.fromEntries(Object.entries(this.rows)
      .filter(([, { input }]) => input.value !== "" && input.checkValidity()).map(([key, { input }]) => [key, Number(input.value)]));
  }

  ready() {
    const wrong = Object.values(this.rows).some(({ input }) => !input.checkValidity());
    this.part("set").disabled = wrong || !Object.keys(this.wanted()).length;
  }

  set() {
    const change = this.wanted();
    const seen = Object.fromEntries(Object.keys(change).map((key) => [key, this.table[key].now]));
    this.send({ numbers: { change, seen } });
    for (const key of Object.keys(change)) this.rows[key].input.value = "";
    this.ready();
  }

  /** Show what would be written, and ask. */
  ask({ text: lines, hash }) {
    this.hash = hash;
    this.part("lines").replaceChildren(...(lines || text("numbers.nothing")).split("\n").map((line) => {
      const level = { "+": "ok", "-": "bad" }[line[0]] ?? "quiet";
      return make("span", { className: level }, `${line}\n`);
    }));
    this.part("really").disabled = !lines;
    this.dialog.showModal();
  }
}
