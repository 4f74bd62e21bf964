// A bridge crane in three dimensions, smaller than it is: bridge on its runway, trolley, rope and load, or a hook and
// a load on a sling. A multicopter keeps its place: the ground passes below it.
import * as THREE from "/static/vendor/three.js";
import { Crane, span } from "/static/crane.js";
import { ropePoints } from "/static/geometry.js";
import { PARTS } from "/static/parts.js";

const TOP_M = 6.4; // of the picture: of the runway
const FREE_M = 2; // below the longest rope
const MIDDLE_M = 2; // of the bridge, from where forwarders stand

export class BridgeCrane extends Crane {
  build({ hall, drawn }) {
    this.flies = drawn === "multicopter";
    this.slung = hall.sling;
    this.size = TOP_M / (hall.rope + hall.sling + FREE_M);
    for (const name of ["bridge", "trolley", "hook", "grapple"]) this.slew.add((this[name] = new THREE.Group()));
    const [runway, half] = [hall.runway * this.size, (hall.span * this.size) / 2];
    this.put(PARTS[drawn ?? "bridge"]({ runway, half, top: TOP_M, middle: MIDDLE_M }));
    this.put(PARTS.load());
    this.link = this.beam(0.035, 0.035, this.dark);
    if (!this.slung) return;
    this.put(PARTS.hook());
    this.sling = this.beam(0.035, 0.035, this.dark);
  }

  /** Trolley, hook and load in the picture: the runway to the right, the bridge away from the eye. */
  at({ trolley, sway, sling }) {
    const { tip, hook, load } = ropePoints(trolley, sway, this.slung, sling);
    const [x, y] = this.flies ? trolley : [0, 0];
    return [tip, hook, load].map(([runway, bridge, up]) => new THREE.Vector3(
      MIDDLE_M + (bridge - y) * this.size, (x - runway) * this.size, TOP_M + up * this.size));
  }

  pose(_hello, crane) {
    this.group.visible = Boolean(crane.trolley); // none is invented
    this.aim.visible = false;
    if (!crane.trolley) return;
    this.known(crane);
    const [tip, hook, load] = this.at(crane);
    if (this.flies) this.flown = crane.trolley.map((way) => way * this.size);
    this.bridge.position.y = tip.y;
    this.trolley.position.copy(tip);
    this.hang(tip, hook, hook.clone().multiplyScalar(2).sub(tip));
    this.hook.visible = this.grapple.visible;
    if (this.slung) {
      this.sling.visible = this.grapple.visible;
      this.hook.position.copy(hook);
      span(this.sling, hook, load);
      this.grapple.position.copy(load);
    }
    this.shade.position.set(load.x, load.y, 0.01);
  }

  trace(_hello, crane) {
    if (crane.trolley && crane.sway) this.mark(this.at(crane)[2]);
  }
}
