// A bridge crane in three dimensions, smaller than it is: bridge on its runway, trolley, rope and load.
import * as THREE from "/static/vendor/three.js";
import { Crane, span } from "/static/crane.js";
import { ropePoints } from "/static/geometry.js";

const TOP_M = 6.4; // of the picture: of the runway
const FREE_M = 2; // below the longest rope
const MIDDLE_M = 2; // of the bridge, from where forwarders stand

export class BridgeCrane extends Crane {
  build({ hall }) {
    this.size = TOP_M / (hall.rope + FREE_M);
    const [runway, half] = [hall.runway * this.size, (hall.span * this.size) / 2];
    const box = (x, y, z, material, group) => {
      const mesh = new THREE.Mesh(new THREE.BoxGeometry(x, y, z), material);
      group.add(mesh);
      return mesh;
    };
    for (const side of [-half, half]) {
      box(0.14, runway, 0.14, this.dark, this.base).position.set(MIDDLE_M + side, 0, TOP_M - 0.25);
    }
    this.bridge = new THREE.Group();
    this.slew.add(this.bridge);
    for (const side of [-0.22, 0.22]) box(2 * half, 0.12, 0.26, this.steel, this.bridge).position.set(MIDDLE_M, side, TOP_M);
    for (const side of [-half, half]) box(0.3, 0.9, 0.2, this.dark, this.bridge).position.set(MIDDLE_M + side, 0, TOP_M - 0.1);
    this.trolley = box(0.5, 0.62, 0.22, this.steel, this.slew);
    this.link = this.beam(0.035, 0.035, this.dark);
    this.grapple = new THREE.Group();
    box(0.12, 0.12, 0.16, this.dark, this.grapple).position.z = -0.08;
    box(0.5, 0.5, 0.4, this.tool, this.grapple).position.z = -0.36;
    this.slew.add(this.grapple);
  }

  /** Trolley and load in the picture: the runway to the right, the bridge away from the eye. */
  at({ trolley, sway }) {
    const { tip, load } = ropePoints(trolley, sway);
    return [tip, load].map(([runway, bridge, up]) => new THREE.Vector3(
      MIDDLE_M + bridge * this.size, -runway * this.size, TOP_M + up * this.size));
  }

  pose(_hello, crane) {
    this.group.visible = Boolean(crane.trolley); // none is invented
    this.aim.visible = false;
    if (!crane.trolley) return;
    this.known(crane);
    const [tip, load] = this.at(crane);
    this.bridge.position.y = tip.y;
    this.trolley.position.copy(tip).z += 0.2;
    this.hang(tip, load, load.clone().multiplyScalar(2).sub(tip));
    this.shade.position.set(load.x, load.y, 0.01);
  }

  trace(_hello, crane) {
    if (crane.trolley && crane.sway) this.mark(this.at(crane)[1]);
  }
}
