// The connection to the studio: one JSON object a message, made again when it is lost.

const FIRST_WAIT_MS = 300;
const LONGEST_WAIT_MS = 3000;
// A studio that is there sends thirty times a second.
const SILENT_MS = 3000;

export class Link {
  /** @param on {hello, shown, lost}: called with what was received, and why a connection ended. */
  constructor(on) {
    this.on = on;
    this.wait = FIRST_WAIT_MS;
    this.open();
    setInterval(() => {
      if (this.up && performance.now() - this.heard > SILENT_MS) this.socket.close();
    }, 1000);
  }

  get up() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  open() {
    this.socket = new WebSocket(`ws://${location.host}/ws`);
    this.heard = performance.now();
    this.socket.onmessage = (event) => {
      this.heard = performance.now();
      const message = JSON.parse(event.data);
      if (message.hello) {
        this.wait = FIRST_WAIT_MS;
        this.on.hello(message.hello);
      } else {
        this.on.shown(message);
      }
    };
    this.socket.onclose = (event) => {
      this.on.lost(event.reason);
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(LONGEST_WAIT_MS, this.wait * 1.6);
    };
  }

  /** Send what a hand did once. */
  send(message) {
    if (this.up) this.socket.send(JSON.stringify(message));
  }

  /** Send where the joysticks are; what cannot go out now is out of date later. */
  sendNow(message) {
    if (this.up && this.socket.bufferedAmount === 0) this.socket.send(JSON.stringify(message));
  }
}
