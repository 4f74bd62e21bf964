// The connection to the studio, which a worker keeps, and how old what it brought is.

// Two clocks differ by that much at most: a part of the time that has passed.
const DRIFT = 1e-4;

export class Link {
  /** @param on {hello, shown, lost}: called with what was received, and why a connection ended. */
  constructor(on) {
    this.offset = Infinity; // from the studio's clock to ours, by the quickest message; ms
    this.last = -Infinity; // the studio's clock at the last message, ms
    this.worker = new Worker("/static/wire.js");
    this.worker.onmessage = ({ data }) => {
      if (data.lost !== undefined) {
        on.lost(data.lost);
        return;
      }
      const message = JSON.parse(data.text);
      if (message.hello) {
        this.offset = Infinity;
        this.last = -Infinity;
        on.hello(message.hello);
      } else {
        this.take(message.t * 1000);
        on.shown(message);
      }
    };
  }

  take(sent) {
    const drift = Math.max(0, sent - this.last) * DRIFT;
    this.offset = Math.min(performance.now() - sent, this.offset + (Number.isFinite(drift) ? drift : 0));
    this.last = sent;
  }

  /** Age of what is shown, ms: also what waited on its way is old. */
  age() {
    return performance.now() - this.last - (Number.isFinite(this.offset) ? this.offset : 0);
  }

  /** Send what a hand did once. */
  send(message) {
    this.worker.postMessage(message);
  }

  /** Positions of the joysticks now, or null where this page does not drive. */
  joysticks(positions) {
    this.worker.postMessage({ joysticks: positions });
  }
}
