// A study with people: the target in the picture, what is to be done, and the driver's grip.
import * as THREE from "/static/vendor/three.js";
import { css } from "/static/crane.js";
import { meaning, text } from "/static/language.js";
import { fromAbove } from "/static/plan.js";

const EYE = [-2.2, 8.6, 2.2]; // everyone sees the crane from here: from behind, above its boom
const LOOKS_AT = [4.2, 0, 0];
const OTHERS = ["KeyN", "KeyX", "KeyP", "KeyV", "KeyB", "KeyL"]; // of the live page

const byId = (id) => document.getElementById(id);
const set = (id, words) => { if (byId(id).textContent !== words) byId(id).textContent = words; };

export class Study {
  /** @param hello what there is; @param shell its pictures; @param send sends; @param actions by keys and buttons of a gamepad. */
  constructor(hello, shell, send, actions, gamepad) {
    this.hello = hello;
    this.shell = shell;
    this.send = send;
    document.body.classList.add("study");
    byId("study").hidden = false;
    byId("hands").hidden = byId("controls").hidden = hello.study.can;
    for (const code of OTHERS) delete actions[code];
    gamepad.on = { enable: gamepad.on.enable, release: gamepad.on.release, grip: () => this.grip("gamepad") };
    gamepad.lost = () => send({ study: "broken", why: "unplugged" });
    actions.KeyG = () => this.grip("keyboard");
    actions.Enter = () => send({ study: "begin" });
    byId("grip").onclick = () => this.grip("pointer");
    byId("begin").onclick = actions.Enter;
  }

  grip(by) {
    this.send({ study: "grip", by });
  }

  /** Put the target where everyone sees it alike; whether there is a picture for it. */
  stand() {
    const { scene } = this.shell;
    if (!scene.world || scene === this.scene) return Boolean(scene.world);
    this.scene = scene;
    scene.ownView = true;
    scene.controls.enabled = false;
    scene.camera.position.set(...EYE);
    scene.controls.target.set(...LOOKS_AT);
    const disc = (radius, color, opacity) => new THREE.Mesh(new THREE.CircleGeometry(radius, 48),
      new THREE.MeshBasicMaterial({ color: css(color), transparent: true, opacity, depthTest: false }));
    this.dot = disc(0.07, "--bad", 1); // below the grapple: this counts
    this.dot.renderOrder = 2;
    this.target = new THREE.Group().add(disc(1, "--focus", 1), disc(0.9, "--ground", 0.7));
    scene.world.add(this.target, this.dot);
    this.crane = Object.values(scene.cranes)[0];
    this.crane.label.visible = false;
    return true;
  }

  show({ study, cranes }, mine) {
    const drawn = this.stand();
    const crane = Object.values(cranes)[0];
    const ready = drawn && mine && study.phase === "pause" && !study.wait_s;
    set("task", drawn ? this.task(study) : text("study.nowebgl"));
    set("outcome", drawn ? this.outcome(study) : "");
    byId("outcome").className = study.result?.[0] ?? "";
    byId("begin").disabled = !ready;
    byId("begin").hidden = study.phase !== "pause";
    byId("grip").hidden = study.phase === "pause" || study.phase === "done";
    byId("grip").disabled = !mine || study.phase !== "moving";
    byId("result").hidden = study.phase !== "done";
    if (!drawn && mine && study.phase === "moving") this.send({ study: "broken", why: "picture" });
    if (!drawn) return;
    this.target.visible = Boolean(study.target);
    if (study.target) {
      const [x, y, width] = study.target;
      this.target.position.set(x, y, 0.02);
      this.target.scale.setScalar(width / 2);
    }
    const at = crane.pose && crane.sway && fromAbove(this.hello, crane).grapple;
    this.dot.visible = Boolean(at);
    if (at) this.dot.position.set(...at, 0.03);
    if (study.phase === "ready" && this.phase !== "ready") this.crane.points = 0;
    this.phase = study.phase;
  }

  /** Which placement it is. */
  task(study) {
    if (study.phase === "done") return text("study.done");
    const values = { part: study.part, parts: study.parts, number: study.number, numbers: study.numbers };
    return text(study.practice ? "study.practice" : "study.placement", values);
  }

  /** What is to be done, or what has become of it. */
  outcome({ phase, why, result, wait_s: wait, stands }) {
    if (phase === "done") return "";
    if (phase === "shown") return text(`study.${result[0]}`, { cm: Math.round(100 * result[1]) });
    if (phase === "moving") return text("study.moving");
    if (phase === "ready") return stands ? meaning(stands) || stands : text("study.ready");
    if (wait) return text("study.break", { s: wait });
    return why ? text("study.broken", { why: text(`study.why.${why}`) }) : text("study.begins");
  }
}
