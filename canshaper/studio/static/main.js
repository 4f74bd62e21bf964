// The page: it sends where the joysticks are and shows what is on the buses, nothing else.
import { Charts } from "/static/charts.js";
import { Link } from "/static/link.js";
import { Panel } from "/static/panel.js";
import { Scene } from "/static/scene.js";
import { Joysticks } from "/static/joysticks.js";

const SEND_MS = 20;
const SLIDE_MS = 100;
const byId = (id) => document.getElementById(id);

let hello, panel, charts, scene, joysticks, shown, link;
let taken = false; // whether this page has asked for the joysticks on this connection
const slides = {};

function begin(found) {
  const first = !hello;
  const same = hello && JSON.stringify({ ...found, page: 0 }) === JSON.stringify({ ...hello, page: 0 });
  hello = found;
  byId("file").textContent = hello.machine ? `${hello.file} — listening only` : hello.file;
  byId("controls").hidden = !hello.drives;
  byId("hands").hidden = !hello.drives;
  byId("profile").hidden = !hello.profiles;
  byId("view").hidden = hello.cranes.length < 2;
  pill("link", "connected", "ok");
  byId("banner").hidden = true;
  taken = false;
  if (same) {
    byId("events").replaceChildren();
    return;
  }
  panel = new Panel(hello, (name, factor) => { slides[name] = factor; });
  joysticks = new Joysticks(hello.drives ? hello.axes : [], byId("pads"), byId("keys"));
  charts?.command.destroy();
  charts?.sway.destroy();
  charts = new Charts(hello);
  if (first) {
    try {
      scene = new Scene(byId("scene"), hello);
    } catch (error) {
      byId("note").textContent = `No 3-D picture: ${error.message}`;
    }
  } else {
    location.reload(); // another machine: other cranes
  }
  byId("tabs").replaceChildren(...hello.axes.map((axis) => {
    const tab = document.createElement("button");
    tab.textContent = axis.replace("_", "-");
    tab.setAttribute("role", "tab");
    tab.dataset.axis = axis;
    tab.onclick = () => choose(axis);
    return tab;
  }));
  choose(hello.axes[0]);
}

function choose(axis) {
  charts.show(axis);
  for (const tab of byId("tabs").children) tab.setAttribute("aria-selected", tab.dataset.axis === axis);
}

function show(message) {
  shown = message;
  const mine = message.driver === hello.page;
  if (!taken && hello.drives) {
    taken = true;
    if (message.driver === null) link.send({ do: "take" });
  }
  charts.add(message);
  scene?.add(message);
  panel.show(message, mine);
  for (const [, time, source, text, level] of message.events ?? []) panel.event(time, source, text, level);
  for (const text of message.refused ?? []) panel.event(Date.now() / 1000, "page", `refused: ${text}`, "warn");
  if (!hello.drives) return;
  const silent = Object.entries(message.cranes).filter(([, crane]) => !crane.daemon).map(([name]) => name);
  if (silent.length) pill("link", `daemon silent: ${silent.join(", ")}`, "bad");
  else pill("link", "connected", "ok");
  byId("seat").hidden = false;
  if (mine) pill("seat", message.enable ? "you drive" : "you drive: press enable", message.enable ? "ok" : "warn");
  else pill("seat", message.driver === null ? "nobody drives" : "another page drives", "warn");
  byId("take").hidden = mine;
  for (const id of ["enable", "antisway", "reset", "profile"]) byId(id).disabled = !mine;
  const profiles = Object.values(Object.values(message.cranes)[0].axes).map((axis) => axis.profile);
  byId("profile").querySelector("b").textContent = [...new Set(profiles.filter(Boolean))].join(" / ");
  byId("enable").setAttribute("aria-pressed", message.enable);
  byId("antisway").setAttribute("aria-pressed", message.antisway);
}

function lost(reason) {
  pill("link", "no connection", "bad");
  byId("banner").textContent = reason
    ? `The studio has closed the connection: ${reason}. Trying again.`
    : "No connection to the studio; joysticks are in neutral there. Trying again.";
  byId("banner").hidden = false;
  byId("seat").hidden = true;
}

function pill(id, text, level) {
  const element = byId(id);
  if (element.textContent !== text) element.textContent = text;
  element.className = `pill ${level}`;
}

// -- what a hand does --------------------------------------------------------------------------

const actions = {
  e: () => link.send({ do: shown?.enable ? "release" : "enable" }),
  " ": () => link.send({ do: "release" }),
  n: () => link.send({ antisway: !shown?.antisway }),
  x: () => link.send({ do: "reset" }),
  p: () => hello?.profiles && link.send({ do: "profile" }),
  v: () => overlay(!scene?.overlay),
};

function overlay(on) {
  scene?.setOverlay(on);
  byId("view").setAttribute("aria-pressed", on);
}

addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || !joysticks) return;
  const key = event.key.toLowerCase();
  const onSlider = event.target.type === "range" && key.startsWith("arrow");
  if (onSlider) return;
  if (joysticks.press(key, true)) event.preventDefault();
  else if (actions[key] && !event.repeat) {
    event.preventDefault();
    actions[key]();
  }
});
addEventListener("keyup", (event) => joysticks?.press(event.key.toLowerCase(), false));
addEventListener("blur", () => joysticks?.release());
document.addEventListener("visibilitychange", () => joysticks?.release());

byId("take").onclick = () => link.send({ do: "take" });
byId("enable").onclick = actions.e;
byId("antisway").onclick = actions.n;
byId("reset").onclick = actions.x;
byId("profile").onclick = actions.p;
byId("view").onclick = actions.v;
byId("theme").onclick = () => theme(document.documentElement.dataset.theme === "light" ? "dark" : "light");

function theme(name) {
  document.documentElement.dataset.theme = name;
  localStorage.setItem("theme", name);
  scene?.paint();
  charts?.build();
}
theme(localStorage.getItem("theme") ?? (matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark"));

setInterval(() => {
  if (!joysticks || !hello?.drives) return;
  const read = joysticks.read();
  if (shown?.driver === hello.page) link.sendNow({ joysticks: read });
}, SEND_MS);
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
  scene?.draw(now);
  charts.draw(now);
  joysticks.draw(shown && Object.values(shown.cranes)[0]?.axes);
  pictures += 1;
  if (now - counted >= 1000) {
    byId("fps").textContent = Math.round((1000 * pictures) / (now - counted));
    pictures = 0;
    counted = now;
  }
}
addEventListener("resize", () => charts?.resize());
link = new Link({ hello: begin, shown: show, lost });
requestAnimationFrame(draw);
