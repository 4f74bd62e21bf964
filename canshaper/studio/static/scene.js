// The cranes in three dimensions. Inside `world` z is up, as in the model.
import * as THREE from "/static/vendor/three.js";
import { boomPoints, grapplePoints } from "/static/geometry.js";

const RAD = Math.PI / 180;
const APART_M = 6.4;
const NEARER = 0.88;
const BEHIND_S = 0.07; // pictures are drawn a little late, so that there are two to draw between
const TRAIL = 90;
const SLOW_MS = 30; // a picture that takes longer on average is drawn with fewer points
const QUICK_MS = 20; // one that takes less, with more again
const START_POSE = [0, 4, 4];

const css = (name) => new THREE.Color(getComputedStyle(document.documentElement).getPropertyValue(name).trim());

export class Scene {
  constructor(canvas, hello) {
    this.hello = hello;
    this.overlay = false;
    this.shown = [];
    this.offset = null;
    const software = drawnBySoftware();
    this.finest = Math.min(window.devicePixelRatio, 2);
    this.coarsest = software ? 0.5 : 0.75;
    this.sharpness = this.finest;
    this.cost = 16;
    this.judged = 0;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !software, powerPreference: "high-performance" });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(42, 1, 0.1, 120);
    this.camera.position.set(-10.2, 7.6, 4.4);
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    this.controls.target.set(1.4, 1.55, 0);
    this.controls.maxPolarAngle = 1.52;
    this.controls.minDistance = 4;
    this.controls.maxDistance = 45;
    this.controls.enableDamping = true;
    this.world = new THREE.Group();
    this.world.rotation.x = -Math.PI / 2;
    this.scene.add(this.world);
    this.hemisphere = new THREE.HemisphereLight(0xffffff, 0x334155, 1.5);
    this.sun = new THREE.DirectionalLight(0xffffff, 1.9);
    this.sun.position.set(-5, 9, 6);
    this.scene.add(this.hemisphere, this.sun);
    this.ground = new THREE.Mesh(new THREE.CircleGeometry(60, 48), new THREE.MeshLambertMaterial());
    this.ground.position.z = -0.02;
    this.world.add(this.ground);
    this.cranes = {};
    hello.cranes.forEach((name, i) => {
      const crane = new Crane(hello, name, name === "raw" ? "--raw" : "--shaped");
      crane.side = hello.cranes.length > 1 ? (i ? -0.5 : 0.5) * APART_M : 0;
      this.cranes[name] = crane;
      this.world.add(crane.group);
    });
    this.paint();
    this.place();
  }

  /** Take the colours of the theme. */
  paint() {
    this.scene.background = css("--sky");
    this.scene.fog = new THREE.Fog(css("--sky"), 24, 60);
    this.ground.material.color = css("--ground");
    if (this.grid) this.scene.remove(this.grid);
    this.grid = new THREE.GridHelper(60, 30, css("--grid"), css("--grid"));
    this.scene.add(this.grid);
    for (const crane of Object.values(this.cranes)) crane.paint();
  }

  setOverlay(on) {
    if (on === this.overlay) return;
    this.overlay = on;
    this.place();
    // One crane needs less room than two.
    this.camera.position.sub(this.controls.target).multiplyScalar(on ? NEARER : 1 / NEARER).add(this.controls.target);
  }

  place() {
    for (const [name, crane] of Object.entries(this.cranes)) {
      crane.group.position.y = this.overlay ? 0 : crane.side;
      crane.ghost(this.overlay && name === "raw");
    }
  }

  add(shown) {
    const last = this.shown.at(-1);
    if (last && shown.t < last.t) this.shown = [];
    this.shown.push(shown);
    if (this.shown.length > 8) this.shown.shift();
    // The smallest difference of the clocks is that of the quickest message.
    const offset = performance.now() / 1000 - shown.t;
    this.offset = this.offset === null || last?.t > shown.t ? offset : Math.min(offset, this.offset + 0.0005);
    for (const [name, crane] of Object.entries(shown.cranes)) this.cranes[name]?.trace(this.hello, crane);
  }

  draw(now) {
    this.resize();
    const began = performance.now();
    const [a, b, part] = this.between(now / 1000 - (this.offset ?? 0) - BEHIND_S);
    if (b) {
      for (const [name, crane] of Object.entries(this.cranes)) {
        if (b.cranes[name]) crane.pose(this.hello, mixed(a.cranes[name] ?? b.cranes[name], b.cranes[name], part));
      }
    }
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
    this.judge(now, performance.now() - began);
  }

  between(t) {
    for (let i = this.shown.length - 1; i > 0; i -= 1) {
      const [a, b] = [this.shown[i - 1], this.shown[i]];
      if (t >= a.t) return [a, b, Math.min(1, (t - a.t) / Math.max(1e-3, b.t - a.t))];
    }
    return [this.shown[0], this.shown[0], 0];
  }

  /** Draw coarser while a picture takes too long, as without a graphics card. */
  judge(now, cost) {
    this.cost += 0.05 * (Math.max(cost, now - (this.before ?? now)) - this.cost);
    this.before = now;
    const slow = this.cost > SLOW_MS && now - this.judged > 1500;
    const quick = this.cost < QUICK_MS && now - this.judged > 8000;
    if (!slow && !quick) return;
    this.judged = now;
    const wanted = this.sharpness * (slow ? 0.8 : 1.25);
    this.sharpness = Math.min(this.finest, Math.max(this.coarsest, wanted));
  }

  resize() {
    const canvas = this.renderer.domElement;
    const [w, h] = [canvas.clientWidth, canvas.clientHeight];
    const size = `${w} ${h} ${this.sharpness}`;
    if (size === this.size || !w || !h) return;
    this.size = size;
    this.renderer.setPixelRatio(this.sharpness);
    this.renderer.setSize(w, h, false);
    this.camera.aspect = w / h;
    this.camera.updateProjectionMatrix();
  }
}

/** Whether there is no graphics card. */
function drawnBySoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

class Crane {
  constructor(hello, name, color) {
    this.name = name;
    this.color = color;
    this.group = new THREE.Group();
    this.steel = new THREE.MeshLambertMaterial();
    this.dark = new THREE.MeshLambertMaterial();
    this.tool = new THREE.MeshLambertMaterial();
    this.wood = new THREE.MeshLambertMaterial({ color: 0x9a7650 });
    this.base = new THREE.Group();
    this.group.add(this.base);
    this.carrier();
    this.slew = new THREE.Group();
    this.group.add(this.slew);
    const pillar = new THREE.Mesh(new THREE.CylinderGeometry(0.2, 0.3, hello.boom.pillar_m - 0.75, 16), this.steel);
    pillar.rotation.x = Math.PI / 2;
    pillar.position.z = 0.75 + (hello.boom.pillar_m - 0.75) / 2;
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
    this.grapple = this.buildGrapple();
    this.slew.add(this.grapple);
    this.plumb = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ transparent: true, opacity: 0.5 }));
    this.plumb.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(6), 3));
    this.plumb.frustumCulled = false;
    this.slew.add(this.plumb);
    this.shade = new THREE.Mesh(new THREE.CircleGeometry(0.42, 20), new THREE.MeshBasicMaterial({ color: 0, transparent: true, opacity: 0.28 }));
    this.shade.position.z = 0.01;
    this.group.add(this.shade);
    this.path = new Float32Array(TRAIL * 3);
    this.points = 0;
    this.trail = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial());
    this.trail.geometry.setAttribute("position", new THREE.BufferAttribute(this.path, 3));
    this.trail.frustumCulled = false;
    this.group.add(this.trail);
  }

  /** The forwarder it stands on, and a few logs. */
  carrier() {
    const add = (geometry, material, x, y, z) => {
      const mesh = new THREE.Mesh(geometry, material);
      mesh.position.set(x, y, z);
      this.base.add(mesh);
      return mesh;
    };
    add(new THREE.BoxGeometry(4.6, 0.9, 0.3), this.dark, -0.9, 0, 0.62);
    for (const x of [-2.5, 0.7]) {
      for (const y of [-0.72, 0.72]) add(new THREE.CylinderGeometry(0.52, 0.52, 0.42, 20), this.dark, x, y, 0.52);
    }
    for (const [i, [x, y]] of [[5.6, -1.2], [5.9, -0.85], [5.75, -1.02]].entries()) {
      const log = add(new THREE.CylinderGeometry(0.17, 0.19, 3.2, 10), this.wood, x, y, i === 2 ? 0.47 : 0.18);
      log.rotation.z = Math.PI / 2 - 0.06;
    }
  }

  beam(width, height, material) {
    const mesh = new THREE.Mesh(new THREE.BoxGeometry(1, width, height), material);
    this.slew.add(mesh);
    return mesh;
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
    this.trail.material.color = own;
    this.plumb.material.color = css("--quiet");
  }

  /** See-through, and behind the other one, for two cranes in one place. */
  ghost(on) {
    for (const material of [this.steel, this.dark, this.tool]) {
      material.transparent = on;
      material.opacity = on ? 0.45 : 1;
      material.polygonOffset = on;
      material.polygonOffsetFactor = material.polygonOffsetUnits = 4;
      material.needsUpdate = true;
    }
    this.base.visible = this.shade.visible = !on;
  }

  pose(hello, crane) {
    const pose = crane.pose ?? START_POSE;
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
    const hung = grapplePoints(hello.grapple, crane.sway);
    const joint = tip.clone().add(new THREE.Vector3(...hung.joint));
    const end = tip.clone().add(new THREE.Vector3(...hung.grapple));
    span(this.link, tip, joint);
    this.grapple.position.copy(joint);
    this.grapple.quaternion.setFromUnitVectors(DOWN, end.clone().sub(joint).normalize());
    const line = this.plumb.geometry.attributes.position;
    line.array.set([tip.x, 0, tip.z, tip.x, 0, 0.02]);
    line.needsUpdate = true;
    const over = end.applyAxisAngle(UP, this.slew.rotation.z);
    this.shade.position.set(over.x, over.y, 0.01);
  }

  /** Draw the way of the grapple. */
  trace(hello, crane) {
    const pose = crane.pose ?? START_POSE;
    const tip = boomPoints(hello.boom, pose, crane.joints).tip;
    const end = new THREE.Vector3(tip[0], 0, tip[1])
      .add(new THREE.Vector3(...grapplePoints(hello.grapple, crane.sway).grapple))
      .applyAxisAngle(UP, pose[0] * RAD);
    if (this.points === TRAIL) this.path.copyWithin(0, 3);
    else this.points += 1;
    this.path.set([end.x, end.y, end.z], (this.points - 1) * 3);
    this.trail.geometry.attributes.position.needsUpdate = true;
    this.trail.geometry.setDrawRange(0, this.points);
  }
}

const UP = new THREE.Vector3(0, 0, 1);
const DOWN = new THREE.Vector3(0, 0, -1);

/** Lay a beam of unit length along x from a to b. */
function span(mesh, a, b) {
  const along = b.clone().sub(a);
  const length = Math.max(1e-3, along.length());
  mesh.position.copy(a).addScaledVector(along, 0.5);
  mesh.scale.x = length;
  mesh.quaternion.setFromUnitVectors(new THREE.Vector3(1, 0, 0), along.divideScalar(length));
}

function mixed(a, b, part) {
  const mix = (x, y) => (x && y ? x.map((v, i) => v + (y[i] - v) * part) : y);
  const pose = mix(a.pose, b.pose);
  if (a.pose && b.pose) pose[0] = a.pose[0] + (((b.pose[0] - a.pose[0] + 540) % 360) - 180) * part;
  return { pose, joints: mix(a.joints, b.joints), sway: mix(a.sway, b.sway) };
}
