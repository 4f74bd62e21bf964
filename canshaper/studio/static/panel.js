// States, events, sliders and the large numbers.

import { craneName, language, meaning, nameOf, spoken, text } from "/static/language.js";

const MOST_EVENTS = 300;
const OLD_S = 0.5;
const SHOW_MS = 150; // no one reads faster
const FILE = -1; // position of the slider of settings at which they are those of the file
const URGENT = ["bad", "stop", "wait", "move", "ready"]; // levels of states, the first is said first

const make = (tag, attributes = {}, ...children) => {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key in element) element[key] = value;
    else element.setAttribute(key, value);
  }
  element.append(...children);
  return element;
};
const coloured = (element, color) => {
  if (color) element.style.color = `var(${color})`;
  return element;
};
const set = (element, text) => {
  if (element.textContent !== text) element.textContent = text;
};

const sizeOf = (list) => `${list.scrollHeight} ${list.clientHeight}`;

export class Panel {
  constructor(hello, slide) {
    this.hello = hello;
    this.shownAt = -SHOW_MS;
    this.cells = {};
    const body = document.querySelector("#axes tbody");
    body.replaceChildren(make("tr", {}, make("th", {}, text("page.axis")), ...hello.cranes.map((c) => coloured(make("th", {}, nameOf("crane", c)), hello.colors[c]))));
    for (const axis of hello.axes) {
      const row = make("tr", {}, make("td", {}, nameOf("axis", axis)));
      for (const crane of hello.cranes) {
        const state = make("span", { className: "state" });
        const reason = make("div", { className: "quiet", lang: "en" });
        const means = make("div", { className: "means" });
        this.cells[`${crane} ${axis}`] = { state, reason, means };
        row.append(make("td", {}, state, reason, means));
      }
      body.append(row);
    }
    const swings = document.getElementById("swings");
    this.swings = Object.fromEntries(hello.cranes.map((crane) => [crane,
      { number: make("b", { id: `swing-${crane}` }, "–"), from: make("span", { className: "quiet" }), still: make("span", { id: `still-${crane}` }), why: make("span", { id: `why-${crane}`, className: "why" }), name: make("b") }]));
    // In the order in which the cranes stand in the picture.
    swings.replaceChildren(...Object.entries(this.swings).map(([crane, { name, number, from, still, why }]) => {
      const box = make("div", { className: "swing" }, name, number, from, still, why);
      box.style.setProperty("--color", `var(${hello.colors[crane]})`);
      return box;
    }));
    const sources = document.getElementById("sources");
    sources.hidden = !hello.machine; // of our own cranes there is nothing to find out
    sources.querySelector("ul").replaceChildren();
    this.sources = {};
    this.buildSliders(slide);
    const list = document.getElementById("events");
    list.replaceChildren();
    // The newest event stays in sight, also where the list gets another size, until a person scrolls up.
    this.follows = true;
    list.onscroll = () => {
      if (sizeOf(list) !== this.size) this.follow(); // it has another layout, no person has scrolled
      else this.follows = list.scrollHeight - list.scrollTop - list.clientHeight < 30;
    };
    this.sized?.disconnect();
    this.sized = new ResizeObserver(() => this.follow());
    this.sized.observe(list);
  }

  follow() {
    const list = document.getElementById("events");
    if (this.follows) list.scrollTop = list.scrollHeight;
    this.size = sizeOf(list);
  }

  buildSliders(slide) {
    this.sliders = {};
    const host = document.getElementById("sliders");
    host.replaceChildren();
    this.preference = this.hello.preference ? this.buildPreference(host, slide) : null;
    for (const [name, { range, numbers }] of Object.entries(this.hello.sliders)) {
      const title = text(`slider.${name}`);
      // By its logarithm: half and double are as far from the middle.
      const input = make("input", { type: "range", id: `slider-${name}`, min: Math.log2(range[0]), max: Math.log2(range[1]), step: 0.01, value: 0 });
      const value = make("b");
      const found = make("span", { className: "numbers" });
      const factor = () => Math.min(range[1], Math.max(range[0], 2 ** input.value));
      const showFactor = (f) => {
        set(value, `×\u00a0${f.toFixed(2)}`);
        const byAxis = {};
        for (const [key, v, p] of numbers) {
          const [, axis, , number] = key.split(".");
          (byAxis[nameOf("axis", axis)] ??= []).push(text(`slider.number.${number}`, { value: (v * f ** p).toPrecision(3) }));
        }
        set(found, Object.entries(byAxis).map(([axis, all]) => `${axis} ${all.join(" ")}`).join(" · "));
      };
      input.addEventListener("input", () => {
        this.touched = performance.now();
        showFactor(factor());
        slide(name, factor());
      });
      const back = make("button", { className: "back", title: text("slider.back"), onclick: () => {
        input.value = 0;
        input.dispatchEvent(new Event("input"));
      } }, "× 1.00");
      back.setAttribute("aria-label", text("slider.backTo", { title }));
      const label = make("label", { htmlFor: input.id }, `${title} `, value);
      host.append(make("div", { className: "slider" }, back, label, input,
        make("div", { className: "ends" }, make("span", {}, text(`slider.${name}.low`)), found, make("span", {}, text(`slider.${name}.high`)))));
      this.sliders[name] = { input, showFactor, back };
      showFactor(1);
    }
    if (!host.children.length && this.hello.drives) {
      host.append(make("p", { className: "quiet" }, text("slider.none")));
    }
  }

  /** The slider of settings that each filter has; their numbers take the studio some seconds. */
  buildPreference(host, slide) {
    const title = text("slider.preference");
    const input = make("input", { type: "range", id: "slider-preference", min: 0, max: 1, step: 0.1, value: 0.5, disabled: true });
    const value = make("b");
    const found = make("span", { className: "numbers" }, text("preference.wait"));
    const back = make("button", { className: "back", title: text("slider.back"), disabled: true, onclick: () => slide("preference", FILE) }, text("preference.file"));
    back.setAttribute("aria-label", `${title}: ${text("preference.file")}`);
    const one = { input, back, at: FILE, words: (at) => {
      set(value, at === FILE ? text("preference.file") : at.toFixed(1));
      set(found, Object.entries(one.settings ?? {}).map(([axis, { file, choose }]) => {
        const setting = at === FILE || !choose.length ? file : choose[Math.round(at * (choose.length - 1))];
        return text("preference.words", { axis: nameOf("axis", axis), percent: (100 * setting.left).toFixed(0),
          m: setting.run_on_m.toFixed(2), s: setting.still_s?.toFixed(1) ?? "∞" });
      }).join(" · "));
    } };
    input.addEventListener("input", () => {
      this.touched = performance.now();
      one.words(Number(input.value));
    });
    input.addEventListener("change", () => slide("preference", Number(input.value)));
    host.append(make("div", { className: "slider" }, back, make("label", { htmlFor: input.id }, `${title} `, value), input,
      make("div", { className: "ends" }, make("span", {}, text("slider.preference.low")), found, make("span", {}, text("slider.preference.high")))));
    return one;
  }

  showPreference(at, mine) {
    const { input, back, words, settings } = this.preference;
    input.disabled = !mine || !settings;
    back.disabled = !mine || at === FILE;
    if (!settings || this.preference.at === at || performance.now() - (this.touched ?? -1e9) <= 1000) return;
    this.preference.at = at;
    if (at !== FILE) input.value = at;
    words(at);
  }

  show(shown, mine, soon = false) {
    const now = performance.now();
    if (shown.settings && this.preference) {
      this.preference.settings = shown.settings;
      this.preference.words(this.preference.at);
    }
    if (now - this.shownAt < SHOW_MS && mine === this.mine && !soon) return;
    this.shownAt = now;
    this.mine = mine;
    // A time measured before anti-sway was switched says nothing of the setting that is named now.
    if (shown.antisway !== (this.antisway ??= shown.antisway)) this.before = shown.cranes.shaped?.still;
    else if (shown.cranes.shaped?.still !== this.before) this.before = undefined;
    this.antisway = shown.antisway;
    for (const [name, crane] of Object.entries(shown.cranes)) {
      const { name: title, number, from, still, why } = this.swings[name];
      set(title, craneName(name, shown));
      this.showWhy(why, crane);
      const known = crane.swing != null && crane.sway;
      set(number, known ? `±${crane.swing.toFixed(1)}°` : "–");
      if (!known) set(from, text("swing.unknown"));
      else set(from, text(crane.measured ? "swing.measured" : crane.simulated ? "swing.simulated" : "swing.modelled"));
      const s = crane.still?.toFixed(1);
      const past = name === "shaped" && !crane.swings && crane.still === this.before;
      set(still, known && s && !past ? text(crane.swings ? "still.swings" : "still.after", { s }) : "");
      from.parentElement.classList.toggle("modelled", Boolean(known && !crane.measured));
      if (this.hello.machine) this.showSources(crane.sources);
      for (const [axis, values] of Object.entries(crane.axes)) {
        const { state, reason, means } = this.cells[`${name} ${axis}`];
        state.lang = values.state ? "en" : language;
        set(state, values.state ?? text(crane.daemon ? "page.unknown" : "page.silent"));
        set(means, [values.state, values.reason].map(meaning).filter(Boolean).join(": "));
        state.dataset.level = values.level;
        set(reason, values.reason ?? "");
      }
    }
    for (const [name, { input, showFactor, back }] of Object.entries(this.sliders)) {
      input.disabled = !mine;
      back.disabled = !mine || shown.sliders[name] === 1;
      // While a hand is on it, it shows what is wanted; then what the daemon has.
      if (performance.now() - (this.touched ?? -1e9) > 1000) {
        input.value = Math.log2(shown.sliders[name]);
        showFactor(shown.sliders[name]);
      }
    }
    const first = Object.values(shown.cranes)[0];
    if (this.preference) this.showPreference(shown.sliders.preference, mine);
    const late = first?.late_us == null ? "" : text("page.late", { ms: (first.late_us / 1000).toFixed(2), missed: first.missed });
    set(document.getElementById("late"), late);
    const silent = Object.entries(shown.cranes).filter(([, crane]) => !crane.crane).map(([name]) => nameOf("crane", name));
    let note = "";
    if (silent.length && !this.hello.playback) {
      note = this.hello.drives ? text("note.silent", { cranes: silent.join(", ") }) : text("note.nobus");
    }
    set(document.getElementById("note"), note);
  }

  /** The state that matters most, of all axes, and why. */
  showWhy(element, crane) {
    const axes = Object.entries(crane.axes).filter(([, one]) => one.state);
    const level = URGENT.find((one) => axes.some(([, axis]) => axis.level === one));
    const those = axes.filter(([, one]) => one.level === level);
    if (!those.length) {
      element.dataset.level = "off";
      set(element, text(crane.daemon ? "page.unknown" : "page.silent"));
      return;
    }
    const [[axis, { state, reason }]] = those;
    const words = [state, reason].filter(Boolean).map((one) => meaning(one) || one).join(": ");
    element.dataset.level = level;
    set(element, those.length < axes.length ? `${nameOf("axis", axis)} ${words}` : words);
  }

  showSources(sources) {
    const list = document.querySelector("#sources ul");
    for (const [name, { per_s: rate, age_s: age }] of Object.entries(sources)) {
      if (!this.sources[name]) {
        this.sources[name] = { rate: make("b"), age: make("span") };
        list.append(make("li", {}, make("span", {}, name), this.sources[name].rate, this.sources[name].age));
      }
      const one = this.sources[name];
      set(one.rate, `${rate}/s`);
      set(one.age, age === null ? text("sources.never") : `${age.toFixed(age < 10 ? 2 : 0)} s`);
      one.age.parentElement.classList.toggle("old", age === null || age > OLD_S);
    }
  }

  /** Add what the studio has said; what the page has no text for stays English, as the log of the daemon. */
  said(time, source, words, level) {
    const own = spoken(words);
    this.event(time, source, own, level, own === words ? "en" : language);
  }

  /** Add what happened. */
  event(time, source, words, level, lang) {
    const list = document.getElementById("events");
    const stamp = this.hello.playback ? `${time.toFixed(2)} s` : new Date(time * 1000).toTimeString().slice(0, 8);
    list.append(make("li", {}, make("time", {}, stamp), coloured(make("span", { className: "source" }, source === "page" ? text("event.page") : nameOf("crane", source)), this.hello.colors[source]),
      make("span", { className: level, lang }, words)));
    while (list.children.length > MOST_EVENTS) list.firstChild.remove();
    this.follow();
  }
}
