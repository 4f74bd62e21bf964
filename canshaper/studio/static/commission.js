// The commissioning, step by step: what the server says is shown, nothing is kept here.
import { language, text, translate } from "/static/language.js";
import { chosenTheme } from "/static/theme.js";

const byId = (id) => document.getElementById(id);
const AGAIN_MS = 1000; // while a step is under way in another page

let shown = { steps: [] };
let chosen = null; // a person's choice; else the first open step
let asked = false; // whether an answer is waited for

async function ask(path, method = "GET") {
  asked = true;
  draw();
  try {
    const answer = await fetch(path, { method });
    if (!answer.ok) throw new Error((await answer.text()).trim());
    shown = await answer.json();
    if (shown.error) throw new Error(shown.error);
    showNews(shown.news || "");
  } catch (error) {
    showNews(error.message);
  }
  asked = false;
  draw();
  if (shown.busy) setTimeout(() => ask("/commission/state"), AGAIN_MS);
}

function showNews(words) {
  byId("banner").textContent = words;
  byId("banner").hidden = !words;
}

const current = () => shown.steps.find((s) => s.name === chosen)
  ?? shown.steps.find((s) => s.status === "open") ?? shown.steps.at(-1);

function element(name, text, attributes = {}) {
  const one = document.createElement(name);
  if (text !== undefined) one.textContent = text;
  return Object.assign(one, attributes);
}

function draw() {
  const step = current();
  byId("file").textContent = shown.file ? `${shown.file} ${shown.crane ?? ""}` : "";
  byId("kind").hidden = !shown.file;
  byId("kind").textContent = text(shown.machine ? "commission.machine" : "commission.rehearsal");
  byId("report").hidden = !shown.report;
  byId("report").href = `/commission/files/${shown.report}`;
  byId("steps").replaceChildren(...shown.steps.map((one) => item(one, step)));
  if (step) drawStep(step);
  else if (!asked) {
    byId("title").textContent = text("commission.nofile");
    say(text("commission.copy", { command: "canshaper studio machine.yaml" }), language);
  }
}

function item(one, step) {
  const li = element("li", undefined, { className: one.status });
  const button = element("button", `${one.name}: ${titleOf(one)}`);
  if (one === step) button.setAttribute("aria-current", "step");
  button.append(element("small", [text(`status.${one.status}`), one.at?.replace("T", " ")].filter(Boolean).join(", ")));
  button.addEventListener("click", () => { chosen = one.name; draw(); });
  li.append(button);
  return li;
}

function drawStep(step) {
  const busy = asked || Boolean(shown.busy);
  byId("title").textContent = titleOf(step);
  if (!busy && step.why) say(step.why, "en");
  else say(text(busy ? "commission.busy" : `status.${step.status}`), language);
  for (const [id, offered] of [["run", true], ["accept", step.proposed], ["skip", step.status === "open"]]) {
    byId(id).hidden = shown.machine || !offered;
    byId(id).disabled = busy;
  }
  const { offered, recommended, chosen: taken } = step.choice;
  byId("choose").hidden = shown.machine || !(offered?.length > 1);
  byId("choice").disabled = busy;
  byId("choice").replaceChildren(...(offered ?? []).map((kind) => element("option",
    kind === recommended ? text("commission.recommended", { kind }) : kind, { value: kind, selected: kind === taken })));
  byId("run").textContent = text(step.at ? "commission.again" : "commission.run");
  byId("problems").replaceChildren(...step.problems.map((fault) => element("li", fault)));
  byId("parts").replaceChildren(...step.parts.map(part));
  byId("wrote").textContent = text(step.proposed ? "commission.would" : "commission.written", { file: shown.file });
  byId("wrote").hidden = byId("diff").hidden = !step.diff;
  byId("diff").replaceChildren(...step.diff.split("\n").map(line));
  byId("pictures").replaceChildren(...step.pictures.map((name) => element("img", undefined, {
    src: `/commission/files/${name}?${encodeURIComponent(step.at)}`, alt: `${titleOf(step)}: ${name}`,
  })));
}

/** Title of a step; one that the page does not know has that of the procedure. */
function titleOf(step) {
  const key = `step.${step.name}`;
  const title = text(key);
  return title === key ? step.title : title;
}

/** Say how the step is: what the procedure says is English. */
function say(words, lang) {
  Object.assign(byId("said"), { textContent: words, lang });
}

function part(one) {
  if (one.text !== undefined) return element("p", one.text);
  const table = element("table");
  if (one.title) table.append(element("caption", one.title));
  const row = (cells, kind) => {
    const tr = element("tr");
    tr.append(...cells.map((cell) => element(kind, cell)));
    return tr;
  };
  table.append(row(one.columns, "th"), ...one.rows.map((cells) => row(cells, "td")));
  const box = element("div");
  box.append(table);
  return box;
}

function line(text) {
  const kind = text.startsWith("+") ? "ins" : text.startsWith("-") ? "del" : "span";
  return element(kind, `${text}\n`);
}

for (const what of ["run", "accept", "skip"]) {
  byId(what).addEventListener("click", () => {
    const name = current().name;
    chosen = what === "run" ? name : null;
    ask(`/commission/${what}/${name}`, "POST");
  });
}
byId("choice").addEventListener("change", ({ target }) => {
  chosen = current().name;
  ask(`/commission/run/${chosen}?answer=${target.value}`, "POST");
});
translate(byId("language"));
document.documentElement.dataset.theme = chosenTheme();
ask("/commission/state");
