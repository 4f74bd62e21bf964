// States of an axis over time, a lane for each crane, and what happened as marks above them.

import { text } from "/static/language.js";

const MARK_PX = 9; // height of the strip of marks
const NEAR_PX = 6; // so near to the cursor a mark is named
const MOST_NAMED = 8; // of more only the count is named: the list has them
const HATCH_PX = 5;

/** How a state looks: colour of the style, and lines for those that have to differ without colour. */
const LOOKS = {
  ready: ["--idle", 0],
  wait: ["--warn", 0],
  move: ["--focus", 0],
  stop: ["--warn", 1],
  bad: ["--bad", 2],
};

/** Say what the colours are. @param host where. */
export function explain(host) {
  host.replaceChildren(...Object.entries(LOOKS).map(([level, [color, lines]]) => {
    const item = document.createElement("span");
    const swatch = document.createElement("i");
    swatch.style.setProperty("--color", `var(${color})`);
    swatch.className = `hatch${lines}`;
    item.append(swatch, text(`level.${level}`));
    return item;
  }));
}

/** From and to when a lane of the history was in which state, less `zero`; gaps where it is not known. */
export function spans(history, lane, begin, end, zero) {
  const parts = [];
  let last = null;
  let before = null;
  for (let row = begin; row < end; row += 1) {
    const look = history.look(row, lane);
    const t = history.time(row) - zero;
    if (last) last.to = t;
    if (last && look === before) continue;
    before = look;
    last = look && { from: t, to: t, ...look };
    if (last) parts.push(last);
  }
  return parts;
}

/** Draw all lanes into a plot of uPlot. */
export class Lanes {
  /** @param names of the cranes, from the top; @param colors names in the style, by crane; @param css colour of the style by its name. */
  constructor(names, colors, css) {
    this.names = names;
    this.colors = colors;
    this.css = css;
    this.spans = {}; // by crane, in the time of the plot
    this.marks = []; // {t, source, text, level}, in the time of the plot
  }

  /** @param u the plot, whose x is time. */
  draw(u) {
    const { left, top, width, height } = u.bbox;
    const pen = u.ctx;
    const px = devicePixelRatio;
    const strip = MARK_PX * px;
    const tall = (height - strip) / this.names.length;
    const x = (t) => Math.min(left + width, Math.max(left, u.valToPos(t, "x", true)));
    pen.save();
    this.names.forEach((name, i) => {
      const y = top + strip + i * tall;
      for (const span of this.spans[name] ?? []) {
        const [from, to] = [x(span.from), x(span.to)];
        if (to > from) this.bar(pen, from, y + px, to - from, tall - 2 * px, LOOKS[span.level], px);
      }
      pen.fillStyle = this.css(this.colors[name]);
      pen.fillRect(left - 6 * px, y + px, 4 * px, tall - 2 * px);
    });
    for (const mark of this.marks) this.mark(pen, x(mark.t), top, mark, px);
    pen.restore();
  }

  bar(pen, x, y, width, height, look, px) {
    if (!look) return;
    const [color, lines] = look;
    pen.fillStyle = this.css(color);
    pen.fillRect(x, y, width, height);
    if (!lines) return;
    pen.save();
    pen.beginPath();
    pen.rect(x, y, width, height);
    pen.clip();
    pen.strokeStyle = this.css("--panel");
    pen.lineWidth = 1.5 * px;
    pen.beginPath();
    for (let at = x - height; at < x + width + height; at += HATCH_PX * px) {
      pen.moveTo(at, y + height);
      pen.lineTo(at + height, y);
      if (lines > 1) {
        pen.moveTo(at, y);
        pen.lineTo(at + height, y + height);
      }
    }
    pen.stroke();
    pen.restore();
  }

  mark(pen, x, top, mark, px) {
    pen.fillStyle = this.css({ warn: "--warn", bad: "--bad" }[mark.level] ?? "--quiet");
    pen.beginPath();
    pen.moveTo(x - 3 * px, top);
    pen.lineTo(x + 3 * px, top);
    pen.lineTo(x, top + (MARK_PX - 2) * px);
    pen.fill();
  }

  /** States at a time, in words, in the order of the lanes. */
  words(t) {
    return this.names.map((name) => {
      const span = (this.spans[name] ?? []).findLast((one) => one.from <= t && t <= one.to);
      return span?.state ?? text("page.unknown");
    });
  }

  /** The events whose marks are under the cursor, a line each, those of the axis first; null where there is none. */
  near(u, axis) {
    const of = (mark) => Math.abs(u.valToPos(mark.t, "x") - u.cursor.left);
    const other = (mark) => !mark.text.startsWith(`${axis}: `);
    const under = this.marks.filter((mark) => of(mark) < NEAR_PX).sort((a, b) => other(a) - other(b) || of(a) - of(b));
    const lines = under.slice(0, MOST_NAMED).map((mark) => `${mark.source}: ${mark.text}`);
    if (under.length > MOST_NAMED) lines.push(`+ ${under.length - MOST_NAMED}`);
    return lines.join("\n") || null;
  }
}
