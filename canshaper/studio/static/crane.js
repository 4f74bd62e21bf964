// One crane in three dimensions: its parts, its name, and where they are. z is up, as in the model.
import * as THREE from "/static/vendor/three.js";
import { boomPoints, hungPoints, tallest } from "/static/geometry.js";
import { text } from "/static/language.js";
import { PARTS } from "/static/parts.js";

const RAD = Math.PI / 180;
const TRAIL = 90;
const TALL_M = 6.4; // of the picture: a taller crane is drawn smaller
const LABEL_M = 0.9; // height of the letters' box
const UP = new THREE.Vector3(0, 0, 1);
const DOWN = new THREE.Vector3(0, 0, -1);

export const css = (name) => new THREE.Color(getComputedStyle(document.documentElement).getPropertyValue(name).trim());

export class Crane {
  /** @param title of the crane; @param color name of the style's colour. */
  constructor(hello, title, color) {
    this.title = title;
    this.color = color;
    this.ghostly = false;
    this.scale = hello.hall ? 1 : Math.min(1, TALL_M / tallest(hello.boom));
    this.group = new THREE.Group();
    this.group.scale.setScalar(this.scale);
    this.steel = new THREE.MeshLambertMaterial();
    this.dark = new THREE.MeshLambertMaterial();
    this.tool = new THREE.MeshLambertMaterial();
    this.wood = new THREE.MeshLambertMaterial({ color: 0x9a7650 });
    this.base = new THREE.Group();
    this.group.add(this.base);
    this.slew = new THREE.Group();
    this.group.add(this.slew);
    this.build(hello);
    this.plumb = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ transparent: true, opacity: 0.5 }));
    this.plumb.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(6), 3));
    this.plumb.frustumCulled = false;
    this.slew.add(this.plumb);
    this.shade = new THREE.Mesh(new THREE.CircleGeometry(0.42, 20), new THREE.MeshBasicMaterial({ color: 0, transparent: true, opacity: 0.28 }));
    this.shade.position.z = 0.01;
    this.shade.scale.setScalar(1 / this.scale);
    this.group.add(this.shade);
    this.label = new THREE.Sprite(new THREE.SpriteMaterial({ depthTest: false, transparent: true, fog: false }));
    this.label.position.set(-1.6, 0, 1.3).divideScalar(this.scale); // at its foot, where nothing of it moves
    this.label.renderOrder = 1;
    this.group.add(this.label);
    this.path = new Float32Array(TRAIL * 3);
    this.points = 0;
    this.trail = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial());
    this.trail.geometry.setAttribute("position", new THREE.BufferAttribute(this.path, 3));
    this.trail.frustumCulled = false;
    this.group.add(this.trail);
    // Where the tool will hang if the joysticks are let go now.
    this.aim = new THREE.Mesh(new THREE.SphereGeometry(0.35, 20, 14),
      new THREE.MeshLambertMaterial({ transparent: true, opacity: 0.35 }));
    this.group.add(this.aim);
  }

  /** Its parts: of a forwarder, or of a crane with a rope; as thick in the picture, whatever its size. */
  build(hello) {
    const { boom, drawn } = hello;
    if (!boom.jib_m) this.put(PARTS[drawn ?? "forwarder"]());
    if (!boom.straight && !drawn) this.put(PARTS.logs());
    const thick = boom.straight ? 1 / this.scale : 1;
    const pillar = new THREE.Mesh(new THREE.CylinderGeometry(0.2 * thick, 0.3 * thick, boom.pillar_m - 0.75, 16), this.steel);
    pillar.rotation.x = Math.PI / 2;
    pillar.position.z = 0.75 + (boom.pillar_m - 0.75) / 2;
    this.slew.add(pillar);
    this.main = this.beam(0.3, 0.24, this.steel);
    this.outer = this.beam(0.25, 0.2, this.steel);
    this.telescope = this.beam(0.16, 0.13, this.dark);
    this.cylinder = this.beam(0.09, 0.09, this.dark);
    this.joints = [0.2, 0.17].map((r) => {
      const mesh = new THREE.Mesh(new THREE.CylinderGeometry(r, r, 0.36, 14), this.dark);
      this.slew.add(mesh);
      return mesh;
    });
    this.link = this.beam(0.05, 0.05, this.dark);
    this.grapple = boom.straight ? this.buildLoad() : this.buildGrapple();
    this.slew.add(this.grapple);
  }

  /** Add boxes and cylinders of the table. */
  put(parts) {
    for (const [group, material, [a, b, c], place, turn] of parts) {
      const round = typeof a === "string";
      const mesh = new THREE.Mesh(round ? new THREE.CylinderGeometry(b, b, c, 20) : new THREE.BoxGeometry(a, b, c), this[material]);
      mesh.rotation.set(a === "z" ? Math.PI / 2 : 0, 0, turn ?? 0);
      mesh.position.set(...place);
      this[group].add(mesh);
    }
  }

  beam(width, height, material) {
    const mesh = new THREE.Mesh(new THREE.BoxGeometry(1, width / this.scale, height / this.scale), material);
    this.slew.add(mesh);
    return mesh;
  }

  /** A load on a hook, hanging along -z. */
  buildLoad() {
    const group = new THREE.Group();
    const load = new THREE.Mesh(new THREE.BoxGeometry(0.5, 0.5, 0.4), this.tool);
    load.position.z = -0.2;
    group.add(load);
    group.scale.setScalar(1 / this.scale);
    return group;
  }

  buildGrapple() {
    const group = new THREE.Group(); // hangs along -z from its joint, one metre is l2
    const add = (geometry, z) => {
      const mesh = new THREE.Mesh(geometry, this.tool);
      mesh.position.z = z;
      group.add(mesh);
      return mesh;
    };
    add(new THREE.CylinderGeometry(0.13, 0.13, 0.34, 14), -0.3).rotation.x = Math.PI / 2;
    add(new THREE.BoxGeometry(0.3, 0.44, 0.2), -0.55);
    for (const side of [-1, 1]) {
      const claw = add(new THREE.TorusGeometry(0.42, 0.07, 8, 16, Math.PI * 0.78), -0.98);
      claw.rotation.set(Math.PI / 2, side > 0 ? Math.PI / 2 : -Math.PI / 2, 0, "YXZ");
      claw.position.y = side * 0.05;
    }
    return group;
  }

  paint() {
    const own = css(this.color);
    this.steel.color = own;
    this.tool.color = own.clone().lerp(new THREE.Color(0xffffff), 0.35);
    this.dark.color = css("--quiet").lerp(new THREE.Color(0x000000), 0.45);
    this.trail.material.color = this.aim.material.color = own;
    this.plumb.material.color = css("--quiet");
    this.write();
  }

  /** Give it another name. */
  rename(title) {
    if (title === this.title) return;
    this.title = title;
    this.write();
  }

  /** Its name above it, and that its sway is computed where no sensor measures it. */
  write() {
    const canvas = document.createElement("canvas");
    const pen = canvas.getContext("2d");
    const lines = this.modelled ? [this.title, text(this.simulated ? "page.simulated" : "page.modelled")] : [this.title];
    [canvas.width, canvas.height] = [512, 128];
    pen.textAlign = "center";
    lines.forEach((line, i) => {
      pen.font = i ? "32px system-ui, sans-serif" : "600 52px system-ui, sans-serif";
      pen.fillStyle = css(i ? "--text" : this.color).getStyle();
      pen.strokeStyle = css("--bg").getStyle(); // readable in front of its own colour
      pen.lineWidth = 8;
      pen.lineJoin = "round";
      pen.strokeText(line, 256, i ? 112 : 60, canvas.width);
      pen.fillText(line, 256, i ? 112 : 60, canvas.width);
    });
    this.label.material.map?.dispose();
    this.label.material.map = new THREE.CanvasTexture(canvas);
    this.label.material.map.colorSpace = "srgb";
    this.label.material.needsUpdate = true;
    this.label.scale.set(4 * LABEL_M, LABEL_M, 1).divideScalar(this.scale);
  }

  /** See-through, and behind the other one, for two cranes in one place. */
  ghost(on) {
    this.ghostly = on;
    this.label.center.y = on ? -0.3 : 0.5; // two names in one place
    this.base.visible = this.shade.visible = !on;
    this.seeThrough();
  }

  seeThrough() {
    for (const material of [this.steel, this.dark, this.tool]) {
      const through = this.ghostly || (this.modelled && material === this.tool);
      material.transparent = through;
      material.opacity = through ? 0.45 : 1;
      material.polygonOffset = through;
      material.polygonOffsetFactor = material.polygonOffsetUnits = 4;
      material.needsUpdate = true;
    }
  }

  pose(hello, crane) {
    const { pose } = crane;
    this.group.visible = Boolean(pose); // none is invented
    if (!pose) return;
    this.known(crane);
    this.slew.rotation.z = pose[0] * RAD;
    const points = boomPoints(hello.boom, pose, crane.joints);
    const at = ([r, z]) => new THREE.Vector3(r, 0, z);
    span(this.main, at(points.start), at(points.elbow));
    span(this.outer, at(points.base), at(points.end));
    span(this.telescope, at(points.end), at(points.tip));
    span(this.cylinder, new THREE.Vector3(points.start[0] + 0.25, 0, points.start[1] - 0.5),
      at(points.start).lerp(at(points.elbow), 0.45));
    this.joints[0].position.copy(at(points.start));
    this.joints[1].position.copy(at(points.elbow));
    const tip = at(points.tip);
    const hung = hungPoints(hello, crane);
    const joint = tip.clone().add(new THREE.Vector3(...hung.joint));
    const end = tip.clone().add(new THREE.Vector3(...hung.grapple));
    if (crane.rope) this.hang(tip, end, end.clone().multiplyScalar(2).sub(tip));
    else this.hang(tip, joint, end);
    this.aim.visible = Boolean(crane.aim);
    if (crane.aim) {
      const [angle, radius] = [crane.aim[0] * RAD, crane.aim[1]];
      const down = hungPoints(hello, { rope: crane.rope }).grapple[2];
      this.aim.position.set(radius * Math.cos(angle), radius * Math.sin(angle), tip.z + down);
    }
  }

  /** Take whether its sway is measured, and whether there is one. */
  known(crane) {
    if (this.modelled !== !crane.measured || this.simulated !== crane.simulated) {
      this.modelled = !crane.measured;
      this.simulated = crane.simulated;
      this.write();
      this.seeThrough();
    }
    this.grapple.visible = this.link.visible = Boolean(crane.sway);
    this.shade.visible = this.grapple.visible && !this.ghostly;
  }

  /** Hang the tool from the tip by a joint, towards an end, with its plumb line and shade. */
  hang(tip, joint, end) {
    span(this.link, tip, joint);
    this.grapple.position.copy(joint);
    this.grapple.quaternion.setFromUnitVectors(DOWN, end.clone().sub(joint).normalize());
    const line = this.plumb.geometry.attributes.position;
    line.array.set([tip.x, tip.y, tip.z, tip.x, tip.y, 0.02]);
    line.needsUpdate = true;
    const over = end.applyAxisAngle(UP, this.slew.rotation.z);
    this.shade.position.set(over.x, over.y, 0.01);
  }

  /** Draw the way of the grapple. */
  trace(hello, crane) {
    const { pose } = crane;
    if (!pose || !crane.sway) return;
    const tip = boomPoints(hello.boom, pose, crane.joints).tip;
    this.mark(new THREE.Vector3(tip[0], 0, tip[1])
      .add(new THREE.Vector3(...hungPoints(hello, crane).grapple))
      .applyAxisAngle(UP, pose[0] * RAD));
  }

  /** Draw its way on to here. */
  mark(end) {
    if (this.points === TRAIL) this.path.copyWithin(0, 3);
    else this.points += 1;
    this.path.set([end.x, end.y, end.z], (this.points - 1) * 3);
    this.trail.geometry.attributes.position.needsUpdate = true;
    this.trail.geometry.setDrawRange(0, this.points);
  }
}

/** Lay a beam of unit length along x from a to b. */
export function span(mesh, a, b) {
  const along = b.clone().sub(a);
  const length = Math.max(1e-3, along.length());
  mesh.position.copy(a).addScaledVector(along, 0.5);
  mesh.scale.x = length;
  mesh.quaternion.setFromUnitVectors(new THREE.Vector3(1, 0, 0), along.divideScalar(length));
}
