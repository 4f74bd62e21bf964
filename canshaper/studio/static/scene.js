// The cranes in three dimensions. Inside `world` z is up, as in the model.
import * as THREE from "/static/vendor/three.js";
import { BridgeCrane } from "/static/bridge_crane.js";
import { Crane, css } from "/static/crane.js";
import { craneName, nameOf, text } from "/static/language.js";

const APART_M = 6.4;
const NEARER = 0.88;
const CELL_M = 2; // of the grid on the ground
const LEAP_S = 1; // a longer step is another part of a drive
const BEHIND_S = 0.07; // pictures are drawn a little late, so that there are two to draw between
const FIELD_DEG = 42;
const NARROW_FIELD_DEG = 58; // on a phone that is held upright
const EDGE = 0.92; // of half the picture: a grapple beyond is led back into it
const FARTHEST_M = 30; // from where the eye does that
const SOFTWARE_POINTS = 200_000; // of a picture that a processor draws quickly
const SLOW_MS = 30; // a picture that takes longer on average is drawn with fewer points
const QUICK_MS = 20; // one that takes less, with more again

export class Scene {
  constructor(canvas, hello) {
    this.hello = hello;
    this.overlay = false;
    this.shown = [];
    this.offset = null;
    this.software = drawnBySoftware();
    this.finest = Math.min(window.devicePixelRatio, 2);
    const few = Math.sqrt(SOFTWARE_POINTS / Math.max(1, canvas.clientWidth * canvas.clientHeight));
    this.coarsest = this.software ? Math.min(0.5, few) : 0.75;
    this.sharpness = this.software ? Math.min(this.finest, few) : this.finest;
    this.cost = 16;
    this.judged = 0;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !this.software, powerPreference: "high-performance" });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(FIELD_DEG, 1, 0.1, 120);
    // Two stand side by side; of more the eye is farther away.
    const far = Math.max(1, 0.4 + 0.3 * hello.cranes.length);
    this.camera.position.set(...(hello.hall || hello.boom.straight ? [-14, 3, 5] : [-10.2, 7.6, 4.4])).multiplyScalar(far);
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    this.controls.target.set(1.4, hello.hall || hello.boom.straight ? 3.2 : 1.55, 0);
    this.controls.maxPolarAngle = 1.52;
    this.controls.minDistance = 4;
    this.controls.maxDistance = 45;
    this.controls.enableDamping = true;
    this.controls.addEventListener("start", () => { this.ownView = true; });
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
      const crane = new (hello.hall ? BridgeCrane : Crane)(hello, nameOf("crane", name), hello.colors[name]);
      crane.side = ((hello.cranes.length - 1) / 2 - i) * APART_M;
      this.cranes[name] = crane;
      this.world.add(crane.group);
    });
    this.paint();
    this.place();
  }

  /** Whether less is drawn than the screen could show. */
  get coarse() {
    return this.software || this.sharpness < this.finest;
  }

  /** Take the colours of the theme. */
  paint() {
    this.scene.background = css("--sky");
    this.scene.fog = new THREE.Fog(css("--sky"), 24, 60);
    this.ground.material.color = css("--ground");
    if (this.grid) this.scene.remove(this.grid);
    this.grid = new THREE.GridHelper(60, 60 / CELL_M, css("--grid"), css("--grid"));
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

  /** Give back what the graphics card keeps. */
  dispose() {
    this.controls.dispose();
    this.scene.traverse((one) => {
      one.geometry?.dispose();
      one.material?.map?.dispose();
      one.material?.dispose?.();
    });
    this.renderer.dispose();
  }

  place() {
    for (const [name, crane] of Object.entries(this.cranes)) {
      crane.group.position.y = this.overlay ? 0 : crane.side;
      crane.ghost(this.overlay && name !== this.hello.cranes[0]);
    }
  }

  add(shown) {
    const last = this.shown.at(-1);
    if (last && !(shown.t >= last.t && shown.t < last.t + LEAP_S)) {
      this.shown = [];
      for (const crane of Object.values(this.cranes)) crane.points = 0;
    }
    this.shown.push(shown);
    if (this.shown.length > 8) this.shown.shift();
    // The smallest difference of the clocks is that of the quickest message.
    const offset = performance.now() / 1000 - shown.t;
    this.offset = this.offset === null || last?.t > shown.t ? offset : Math.min(offset, this.offset + 0.0005);
    for (const [name, crane] of Object.entries(shown.cranes)) {
      this.cranes[name]?.rename(craneName(name, shown));
      this.cranes[name]?.trace(this.hello, crane);
    }
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
    const [x, y] = this.cranes[this.hello.cranes[0]].flown ?? [0, 0];
    this.grid.position.set(-y % CELL_M, 0, -x % CELL_M);
    this.keepInside();
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
    this.judge(now, performance.now() - began);
  }

  /** Step back while a grapple is not in the picture, until a person chooses what is seen. */
  keepInside() {
    const eye = this.camera.position.clone().sub(this.controls.target);
    if (this.ownView || eye.length() > FARTHEST_M) return;
    const outside = Object.values(this.cranes).some((crane) => {
      const at = crane.grapple.getWorldPosition(new THREE.Vector3()).project(this.camera);
      return crane.group.visible && crane.grapple.visible && Math.max(Math.abs(at.x), Math.abs(at.y)) > EDGE;
    });
    if (outside) this.camera.position.copy(this.controls.target).add(eye.multiplyScalar(1.01));
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
    this.camera.fov = w > h ? FIELD_DEG : NARROW_FIELD_DEG;
    this.camera.updateProjectionMatrix();
  }
}

/** Whether there is no graphics card. */
function drawnBySoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) throw new Error(text("page.nowebgl"));
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

function mixed(a, b, part) {
  const mix = (x, y) => (x && y ? x.map((v, i) => v + (y[i] - v) * part) : y);
  const pose = mix(a.pose, b.pose);
  if (a.pose && b.pose) pose[0] = a.pose[0] + (((b.pose[0] - a.pose[0] + 540) % 360) - 180) * part;
  const [joints, trolley, sway, sling] = ["joints", "trolley", "sway", "sling"].map((key) => mix(a[key], b[key]));
  return { ...b, pose, joints, trolley, sway, sling };
}
