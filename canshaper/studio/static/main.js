// The page: it sends where the joysticks are and shows what is on the buses, nothing else.
import { language, nameOf, spoken, text } from "/static/language.js";
import { Link } from "/static/link.js";
import { Numbers } from "/static/numbers.js";
import { Panel } from "/static/panel.js";
import { Shell } from "/static/shell.js";
import { Joysticks } from "/static/joysticks.js";
import { Study } from "/static/study.js";

const READ_MS = 20;
const SLIDE_MS = 100;
const STALE_MS = 500; // what is older is no news
const HICCUP_MS = 300;
const TOLD_MS = 4000; // so long a hiccup is shown
const byId = (id) => document.getElementById(id);

const shell = new Shell();
let hello, panel, numbers, joysticks, shown, link, study;
let inForce = null; // numbers of a machine that may be changed
let taken = false; // whether this page has asked for the joysticks on this connection
let before = null; // its number on the connection before, where it drove
let stale = false;
let drawn = false; // whether there were pictures for a second: at the start shaders are built
let closedFor = ""; // why the studio closed the connection
const slides = {};

function begin(found) {
  const first = !hello;
  before = shown && shown.driver === hello?.page ? hello.page : null;
  shown = undefined;
  closedFor = "";
  const same = hello && JSON.stringify({ ...found, page: 0 }) === JSON.stringify({ ...hello, page: 0 });
  hello = found;
  byId("file").textContent = hello.machine ? text("file.listening", { file: hello.file }) : hello.file;
  byId("controls").hidden = !hello.drives;
  byId("hands").hidden = !hello.drives;
  byId("profile").hidden = !hello.profiles;
  taken = false;
  if (hello.preference) link.send({ settings: true }); // they come when they are computed
  if (same) {
    byId("events").replaceChildren(); // all of them come again
    shell.charts.events = [];
    return;
  }
  panel = new Panel(hello, (name, factor) => { slides[name] = factor; });
  joysticks = new Joysticks(hello.drives ? hello.axes : [], byId("pads"), byId("keys"));
  joysticks.gamepad.on = {
    enable: () => link.send({ do: "enable" }),
    release: actions.Space,
    antisway: actions.KeyN,
    reset: actions.KeyX,
    ...(hello.profiles ? { profile: actions.KeyP } : {}),
  };
  if (hello.study) study = new Study(hello, shell, (message) => link.send(message), actions, joysticks.gamepad);
  if (hello.numbers) numbers = new Numbers(byId("numbers"), (message) => link.send(message));
  if (first) shell.begin(hello);
  else location.reload(); // another machine: other cranes
}

function show(message) {
  shown = message;
  const mine = message.driver === hello.page;
  if (!taken && hello.drives) {
    taken = true;
    // A connection that was lost is not gone for the studio: its driver is this page.
    if (message.driver === null || message.driver === before) link.send({ do: "take" });
  }
  shell.charts.add(message);
  shell.show(message);
  panel.show(message, mine);
  for (const [, time, source, words, level, clock] of message.events ?? []) {
    panel.said(time, source, words, level);
    shell.charts.mark(clock, source, spoken(words), level);
  }
  for (const why of message.refused ?? []) panel.event(Date.now() / 1000, "page", text("event.refused", { text: spoken(why) }), "warn", language);
  inForce = message.numbers?.table ?? inForce;
  shell.residual.follow([message.sliders, inForce]);
  if (message.numbers) numbers.show(message.numbers);
  if (message.difference) numbers.ask(message.difference);
  study?.show(message, mine);
  fresh();
  byId("hint").hidden = !mine || message.enable || Boolean(hello.study?.can);
  byId("language").disabled = mine && message.enable; // another one loads the page again
  if (!hello.drives) return;
  byId("seat").hidden = false;
  if (mine) pill("seat", text(message.enable ? "seat.drive" : "seat.enable"), message.enable ? "ok" : "warn");
  else pill("seat", text(message.driver === null ? "seat.nobody" : "seat.other"), "warn");
  byId("take").hidden = mine;
  for (const id of ["enable", "stop", "antisway", "reset", "profile"]) byId(id).disabled = !mine;
  const profiles = Object.values(Object.values(message.cranes)[0].axes).map((axis) => axis.profile);
  byId("profile").querySelector("b").textContent = [...new Set(profiles.filter(Boolean))].join(" / ");
  byId("enable").setAttribute("aria-pressed", message.enable);
  byId("antisway").setAttribute("aria-pressed", message.antisway);
  byId("antisway").querySelector("b").textContent = text(message.antisway ? "button.on" : "button.off");
}

function lost(reason) {
  closedFor = reason || closedFor;
  byId("seat").hidden = true;
}

/** Whether what is shown is news; what is not is grey. */
function fresh() {
  const age = link.age();
  const old = !(age < STALE_MS);
  if (old !== stale) document.body.classList.toggle("stale", old);
  stale = old;
  byId("banner").hidden = !old || !hello;
  if (!old) {
    const silent = Object.entries(shown?.cranes ?? {}).filter(([, crane]) => !crane.daemon).map(([name]) => nameOf("crane", name));
    if (silent.length) pill("link", text("link.silent", { cranes: silent.join(", ") }), "bad");
    else pill("link", text("link.connected"), "ok");
  } else if (hello) {
    pill("link", text("link.none"), "bad");
    const since = Number.isFinite(age) ? text("banner.oldFor", { s: (age / 1000).toFixed(1) }) : text("banner.old");
    const hand = hello.drives ? ` ${text("banner.neutral")}` : "";
    byId("banner").textContent = closedFor ? text("banner.closed", { reason: closedFor }) : since + hand;
  }
}

function pill(id, words, level) {
  const element = byId(id);
  if (element.textContent !== words) element.textContent = words;
  element.className = `pill ${level}`;
}

// -- what a hand does --------------------------------------------------------------------------

const enable = () => link.send({ do: shown?.enable ? "release" : "enable" });
// By their place on the keyboard, whatever letter is on them.
const actions = {
  KeyE: enable,
  Space: () => link.send({ do: "release" }),
  KeyN: () => link.send({ antisway: !shown?.antisway }),
  KeyX: () => link.send({ do: "reset" }),
  KeyP: () => hello?.profiles && link.send({ do: "profile" }),
  KeyV: () => shell.overlay(!shell.scene?.overlay),
  KeyB: () => shell.look("plan"),
  KeyL: () => shell.look("residual"),
};

addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || !joysticks) return;
  if (event.target.matches?.("input:not([type=range]), dialog *")) return; // it is written in
  const onSlider = event.target.type === "range" && event.code.startsWith("Arrow");
  if (onSlider) return;
  if (joysticks.press(event.code, true)) event.preventDefault();
  else if (actions[event.code] && !event.repeat) {
    event.preventDefault();
    actions[event.code]();
  }
});
addEventListener("keyup", (event) => joysticks?.press(event.code, false));
addEventListener("blur", () => joysticks?.release());
document.addEventListener("visibilitychange", () => {
  joysticks?.release();
  readAt = null; // a page that is hidden is called seldom
});

byId("take").onclick = () => link.send({ do: "take" });
byId("enable").onclick = byId("hint").onclick = enable;
byId("stop").onclick = actions.Space;
byId("antisway").onclick = actions.KeyN;
byId("reset").onclick = actions.KeyX;
byId("profile").onclick = actions.KeyP;

let readAt = null;
let hiccupUntil = 0;
let deflected = false; // whether a joystick was, when it was last read
setInterval(() => {
  const now = performance.now();
  if (readAt !== null && drawn && !document.hidden && now - readAt > HICCUP_MS) hiccup(now - readAt, now);
  readAt = now;
  if (now > hiccupUntil) byId("hiccup").hidden = true;
  if (link) fresh();
  if (!joysticks || !hello?.drives) return;
  const read = joysticks.read();
  deflected = Object.values(read).some(Boolean);
  link.joysticks(shown?.driver === hello.page ? read : null);
}, READ_MS);

/** Say that the page stood still: as an event, in large words where that stopped a drive. */
function hiccup(ms, now) {
  const stood = text("hiccup.stood", { s: (ms / 1000).toFixed(1) });
  panel?.event(Date.now() / 1000, "page", stood, "warn", language);
  if (!deflected || shown?.driver !== hello.page || !shown.enable) return;
  byId("hiccup").querySelector("b").textContent = stood;
  byId("hiccup").hidden = false;
  hiccupUntil = now + TOLD_MS;
}

setInterval(() => {
  for (const [name, to] of Object.entries(slides)) {
    link.send({ slide: name, to });
    delete slides[name];
  }
}, SLIDE_MS);

// -- pictures ----------------------------------------------------------------------------------

let pictures = 0;
let counted = performance.now();

function draw(now) {
  requestAnimationFrame(draw);
  if (!hello) return;
  shell.draw(now);
  joysticks.draw(shown && Object.values(shown.cranes)[0]?.axes);
  pictures += 1;
  if (now - counted >= 1000) {
    byId("fps").textContent = Math.round((1000 * pictures) / (now - counted));
    pictures = 0;
    drawn = true;
    counted = now;
  }
}
link = new Link({ hello: begin, shown: show, lost });
requestAnimationFrame(draw);
