// Worker: the connection to the studio. The joysticks leave from here, so that drawing cannot stop
// them. A socket that has gone silent is given up, not closed: closing waits for the other side.

const SEND_MS = 20;
const SILENT_MS = 1000; // a studio that is there sends thirty times a second
const CONNECT_MS = 2000; // and more with each attempt: a network may be slower than that
const FIRST_WAIT_MS = 300;
const LONGEST_WAIT_MS = 3000;
const PAGE_STOOD_MS = 300; // the page reads the joysticks every 20 ms

let socket;
let receivedAt = 0;
let wait = FIRST_WAIT_MS;
let openAt = 0; // when the next socket is opened
let joysticks = null; // positions, as the page has read them; null where it does not drive
let readAt = 0;
let centred = true; // seen in neutral since the page last stood still

onmessage = ({ data }) => {
  if (data.joysticks === undefined) {
    send(data);
    return;
  }
  joysticks = data.joysticks;
  readAt = performance.now();
  centred ||= joysticks !== null && Object.values(joysticks).every((position) => position === 0);
};

function up() {
  return socket?.readyState === WebSocket.OPEN;
}

function send(message) {
  if (up()) socket.send(JSON.stringify(message));
}

function open() {
  const one = new WebSocket(`ws://${location.host}/ws`);
  socket = one;
  receivedAt = performance.now();
  one.onopen = () => { receivedAt = performance.now(); }; // its first message has all its time
  one.onmessage = (event) => {
    receivedAt = performance.now();
    wait = FIRST_WAIT_MS;
    postMessage({ text: event.data });
  };
  one.onclose = (event) => giveUp(event.reason);
}

/** Never hear of this socket again, and open another one after a while. */
function giveUp(reason) {
  socket.onopen = socket.onmessage = socket.onclose = null;
  socket.close();
  socket = null;
  postMessage({ lost: reason });
  openAt = performance.now() + wait;
  wait = Math.min(LONGEST_WAIT_MS, wait * 1.6);
}

function watch(now) {
  if (!socket) {
    if (now >= openAt) open();
  } else if (now - receivedAt > (up() ? SILENT_MS : CONNECT_MS + wait)) {
    giveUp("");
  }
}

function sendJoysticks(now) {
  if (!joysticks) return;
  const stood = now - readAt > PAGE_STOOD_MS;
  // Neutral once; then the studio does what it does with a page that is silent.
  if (stood && !centred) return;
  centred &&= !stood;
  const positions = centred ? joysticks : Object.fromEntries(Object.keys(joysticks).map((axis) => [axis, 0]));
  // What cannot go out now is out of date later.
  if (up() && socket.bufferedAmount === 0) send({ joysticks: positions });
}

setInterval(() => {
  const now = performance.now();
  watch(now);
  sendJoysticks(now);
}, SEND_MS);
