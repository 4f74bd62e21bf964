// The page of a drive that is over: all its pictures are here, and a time bar goes through them.
import { spoken, text } from "/static/language.js";
import { Panel } from "/static/panel.js";
import { Shell } from "/static/shell.js";

const STEP_S = 0.2;
const PICTURE_S = 0.04;
const byId = (id) => document.getElementById(id);

const shell = new Shell();
let panel, drive;
let at = 0; // seconds of the drive
let playing = false;
let drawnAt = 0;

/** Times of all pictures, and of each crane its picture at every one of them. */
class Drive {
  constructor({ hello, title, notes, cranes, events }) {
    Object.assign(this, { hello, title, notes, events });
    const numbers = [...new Set(Object.values(cranes).flatMap((crane) => crane.numbers))].sort((a, b) => a - b);
    this.times = numbers.map((number) => number * PICTURE_S);
    this.pictures = Object.fromEntries(Object.entries(cranes).map(([name, crane]) => {
      let next = 0;
      return [name, numbers.map((number) => {
        while (next + 1 < crane.numbers.length && crane.numbers[next + 1] <= number) next += 1;
        return crane.pictures[next];
      })];
    }));
  }

  get first() { return this.times[0]; }

  get last() { return this.times.at(-1); }

  /** Number of the picture at a time. */
  indexAt(t) {
    let [low, high] = [0, this.times.length - 1];
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (this.times[middle] <= t + 1e-6) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  /** A picture as a live page gets it. */
  message(index) {
    return { t: this.times[index], driver: null, cranes: Object.fromEntries(
      Object.entries(this.pictures).map(([name, all]) => [name, all[index]])) };
  }
}

async function open(number) {
  play(false);
  pill(text("play.opening"), "");
  const answer = await fetch(`/drive/${number}.json`);
  if (!answer.ok) {
    pill(text("play.fault"), "bad");
    byId("banner").hidden = false;
    byId("banner").textContent = await answer.text();
    return;
  }
  byId("banner").hidden = true;
  drive = new Drive(await answer.json());
  const { hello } = drive;
  byId("file").textContent = text("play.over", { file: hello.file });
  byId("title").textContent = drive.title;
  shell.begin(hello);
  panel = new Panel(hello, () => {});
  drive.times.forEach((_, i) => shell.charts.add(drive.message(i)));
  for (const [t, source, words, level] of drive.events) {
    shell.charts.mark(t, source, spoken(words), level);
    panel.said(t, source, words, level);
  }
  byId("notes").replaceChildren(...drive.notes.map((note) => Object.assign(document.createElement("li"), { textContent: note, lang: "en" })));
  const bar = byId("time");
  Object.assign(bar, { min: drive.first, max: drive.last, step: PICTURE_S });
  shell.charts.onseek = seek;
  seek(drive.first);
  pill(text("play.opened"), "ok");
}

function pill(words, level) {
  byId("link").textContent = words;
  byId("link").className = `pill ${level}`;
}

/** Show the drive as it was at a time. */
function seek(t) {
  at = Math.min(drive.last, Math.max(drive.first, t));
  const message = drive.message(drive.indexAt(at));
  shell.charts.seek(at);
  shell.show(message);
  panel.show(message, false, true);
  const bar = byId("time");
  bar.value = at;
  bar.setAttribute("aria-valuetext", `${at.toFixed(2)} s`);
  byId("at").textContent = text("play.at", { at: at.toFixed(2), last: drive.last.toFixed(2) });
}

function play(on) {
  playing = on;
  byId("play").textContent = text(on ? "play.stop" : "play.play");
  byId("play").setAttribute("aria-pressed", on);
  if (on && at >= drive.last) seek(drive.first);
}

/** Go to the event before or after. */
function event(way) {
  const times = drive.events.map(([t]) => t).filter((t) => (way > 0 ? t > at + 1e-3 : t < at - 1e-3));
  if (times.length) seek(way > 0 ? Math.min(...times) : Math.max(...times));
}

function draw(now) {
  requestAnimationFrame(draw);
  const passed = (now - drawnAt) / 1000;
  drawnAt = now;
  if (!drive || !shell.charts) return;
  if (playing) {
    seek(at + passed * Number(byId("speed").value));
    if (at >= drive.last) play(false);
  }
  shell.draw(now);
}

const keys = {
  Space: () => play(!playing),
  ArrowLeft: () => seek(at - STEP_S),
  ArrowRight: () => seek(at + STEP_S),
  Home: () => seek(drive.first),
  End: () => seek(drive.last),
  KeyV: () => shell.overlay(!shell.scene?.overlay),
  KeyB: () => shell.look("plan"),
};
addEventListener("keydown", (press) => {
  if (press.ctrlKey || press.altKey || press.metaKey || !drive) return;
  if (/^(BUTTON|SELECT|INPUT)$/.test(press.target.tagName) && press.target.id !== "time") return;
  if (!keys[press.code]) return;
  press.preventDefault();
  keys[press.code]();
});

byId("play").onclick = () => play(!playing);
byId("before").onclick = () => event(-1);
byId("after").onclick = () => event(1);
byId("time").oninput = () => seek(Number(byId("time").value));
byId("drive").onchange = () => open(byId("drive").value);
for (const id of ["controls", "hands", "left", "pause", "seat"]) byId(id).hidden = true;
document.querySelector("a[href='/commission']").hidden = true;
for (const id of ["playback", "about"]) byId(id).hidden = false;
byId("fps").parentElement.hidden = true;

const titles = await (await fetch("/drives.json")).json();
byId("drive").replaceChildren(...titles.map((title, i) => new Option(title, i)));
byId("drive").hidden = byId("title").hidden = false;
byId("drive").hidden = titles.length < 2;
requestAnimationFrame(draw);
await open(0);
