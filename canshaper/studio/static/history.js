// What the charts keep of a drive: a ring of typed arrays, so that the page takes as much memory in
// its first minute as in its last.

export class History {
  /** @param columns names of numbers; @param lanes names of states; @param rows that are kept; @param kept_s how long. */
  constructor(columns, lanes, rows, kept_s) {
    this.most = rows;
    this.kept_s = kept_s;
    this.t = new Float64Array(rows);
    this.numbers = Object.fromEntries(columns.map((name) => [name, new Float32Array(rows)]));
    this.states = Object.fromEntries(lanes.map((name) => [name, new Uint16Array(rows)]));
    this.looks = [null]; // every {state, level, reason} there was; 0: not known
    this.clear();
  }

  clear() {
    this.begin = 0; // place of the oldest row
    this.length = 0;
  }

  /** Keep a row. @param numbers by column; @param states {state, level, reason} by lane. */
  push(t, numbers, states) {
    if (this.length === this.most) this.drop();
    const at = (this.begin + this.length) % this.most;
    this.length += 1;
    this.t[at] = t;
    for (const [name, column] of Object.entries(this.numbers)) column[at] = numbers[name] ?? NaN;
    for (const [name, column] of Object.entries(this.states)) column[at] = this.number(states[name]);
    while (t - this.time(0) > this.kept_s) this.drop();
  }

  drop() {
    this.begin = (this.begin + 1) % this.most;
    this.length -= 1;
  }

  /** Number of a look: there are few, and they come again and again. */
  number(look) {
    if (!look?.state) return 0;
    const known = this.looks.findIndex((one) => one?.state === look.state && one.reason === look.reason);
    if (known > 0) return known;
    return this.looks.push({ state: look.state, level: look.level, reason: look.reason }) - 1;
  }

  at(row) {
    return (this.begin + row) % this.most;
  }

  /** Time of a row, counted from the oldest one; undefined beyond the last one. */
  time(row) {
    return row >= 0 && row < this.length ? this.t[this.at(row)] : undefined;
  }

  get first() { return this.time(0); }

  get last() { return this.time(this.length - 1); }

  value(row, column) {
    const value = this.numbers[column]?.[this.at(row)];
    return value === undefined || Number.isNaN(value) ? null : value;
  }

  /** {state, level, reason} of a lane, the same object for the same one; null where it is not known. */
  look(row, lane) {
    return this.looks[this.states[lane][this.at(row)]];
  }

  /** The first row that is not before a time. */
  from(t) {
    let [low, high] = [0, this.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.t[this.at(middle)] < t) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** The first row that is after a time. */
  after(t) {
    let row = this.from(t);
    while (this.time(row) === t) row += 1;
    return row;
  }
}
