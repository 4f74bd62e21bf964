// The texts of the page in the language of the person: that chosen here, else that of the browser.
// States and reasons of the daemon stay English where they are shown, the terms of its log and manual.

const LANGUAGES = { en: "English", de: "Deutsch", fi: "Suomi", sv: "Svenska" };
const ATTRIBUTES = { "data-t-title": "title", "data-t-label": "aria-label" };

/** The language that was chosen on any of the pages, else the first of the browser's that there is. */
function chosen() {
  const wanted = [localStorage.getItem("language"), ...navigator.languages.map((one) => one.split("-")[0])];
  return wanted.find((one) => one in LANGUAGES) ?? "en";
}

/** Texts of a language by their key; none where the table cannot be read: English stands in for it. */
async function table(name) {
  try {
    const answer = await fetch(`/static/languages/${name}.json`);
    return answer.ok ? await answer.json() : {};
  } catch {
    return {};
  }
}

export const language = chosen();
const [own, english] = await Promise.all([table(language), table("en")]);

/** A text with {name} replaced by values; the key itself where there is none. */
export function text(key, values = {}) {
  const template = own[key] ?? english[key] ?? key;
  return template.replace(/\{(\w+)\}/g, (whole, name) => values[name] ?? whole);
}

/** Name of an axis or crane; one that the page does not know stays as in the file. */
export function nameOf(kind, name) {
  const key = `${kind}.${name}`;
  return key in english ? text(key) : name.replaceAll("_", "-");
}

/** Name of a crane; the shaped one is not called so while its anti-sway is off. */
export function craneName(name, shown) {
  return name === "shaped" && shown?.antisway === false ? text("crane.off") : nameOf("crane", name);
}

/** What a state or reason of the daemon means; nothing in English, where it says so itself. */
export function meaning(words) {
  const meaning = own[`term.${words}`];
  return meaning && meaning !== words ? meaning : "";
}

const SAID = Object.entries(english).filter(([key]) => key.startsWith("said."))
  .map(([key, template]) => [key, new RegExp(`^${template.split(/\{(\w+)\}/)
    .map((part, i) => (i % 2 ? `(?<${part}>.+?)` : part.replace(/[.*+?^${}()|[\]\\]/g, "\\$&"))).join("")}$`)]);

/** What the studio has said in English, in the language of the page; as it is where that has no text for it. */
export function spoken(words) {
  for (const [key, pattern] of SAID) {
    const match = pattern.exec(words);
    if (match) return text(key, Object.fromEntries(Object.entries(match.groups ?? {}).map(inOwn)));
  }
  return words;
}

const inOwn = ([kind, value]) => [kind, kind === "axis" ? nameOf("axis", value) : own[`term.${value}`] ?? value];

/** Put the texts into the elements that name their keys, and offer the languages. @param select where. */
export function translate(select) {
  document.documentElement.lang = language;
  for (const element of document.querySelectorAll("[data-t]")) element.textContent = text(element.dataset.t);
  for (const [key, attribute] of Object.entries(ATTRIBUTES)) {
    for (const element of document.querySelectorAll(`[${key}]`)) element.setAttribute(attribute, text(element.getAttribute(key)));
  }
  select.replaceChildren(...Object.entries(LANGUAGES).map(([code, name]) => new Option(name, code)));
  for (const option of select.options) option.lang = option.value;
  select.value = language;
  select.onchange = () => {
    localStorage.setItem("language", select.value);
    location.reload();
  };
}
