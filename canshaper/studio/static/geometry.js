// Where the parts of a crane are: metres, z upwards, the boom in the plane of radius and height.
// As in sim/canshaper_sim/kinematics.py and grapple.py.

const RAD = Math.PI / 180;
const COMFORT = 0.94; // of the reach: a straight arm is hardly ever driven

/** Height of the highest point that a boom is drawn at, m. */
export function tallest(boom) {
  if (boom.jib_m) return boom.pillar_m;
  return boom.pillar_m + boom.main_boom_m + (boom.straight ? boom.outer_boom_m : 0);
}

/** Length of a counter jib, m; 0 for a crane without one. */
export const counterJib = (boom) => 0.25 * (boom.jib_m ?? 0);

/** Pivots of the boom as [radius, height]: lift joint, knuckle, telescope, tip. */
export function boomPoints(boom, pose, joints) {
  const start = [boom.pillar_offset_m, boom.pillar_m];
  if (boom.straight) return fromTip(boom, start, [pose[1], pose[2]]);
  if (joints) {
    const [lift, knuckle] = [joints[0] * RAD, joints[1] * RAD];
    return fromJoints(boom, start, lift, knuckle, joints[2]);
  }
  // Only the tip is known: an arm that reaches it, folded upwards, its telescope as far out as needed.
  const out = pose[1] - start[0];
  const up = pose[2] - start[1];
  const distance = Math.hypot(out, up);
  const outer = Math.max(boom.outer_boom_m, distance / COMFORT - boom.main_boom_m);
  const main = boom.main_boom_m;
  const fold = Math.acos(clamp((distance ** 2 - main ** 2 - outer ** 2) / (2 * main * outer)));
  const lift = Math.atan2(up, out) + Math.atan2(outer * Math.sin(fold), main + outer * Math.cos(fold));
  return fromJoints({ ...boom, knuckle_offset_m: 0 }, start, lift, -fold, outer - boom.outer_boom_m);
}

/** A jib with a trolley and a counter jib, or a straight boom whose telescope goes to its tip. */
function fromTip(boom, start, tip) {
  if (boom.jib_m) {
    return { start, elbow: [boom.jib_m, start[1]], base: start, end: [-counterJib(boom), start[1]], tip };
  }
  const part = Math.min(1, boom.main_boom_m / Math.hypot(tip[0] - start[0], tip[1] - start[1]));
  const elbow = start.map((from, k) => from + part * (tip[k] - from));
  return { start, elbow, base: elbow, end: elbow, tip };
}

function fromJoints(boom, start, lift, knuckle, extension) {
  const turn = lift + knuckle;
  const [s, c] = [Math.sin(turn), Math.cos(turn)];
  const elbow = [start[0] + boom.main_boom_m * Math.cos(lift), start[1] + boom.main_boom_m * Math.sin(lift)];
  const base = [elbow[0] + boom.knuckle_offset_m * s, elbow[1] - boom.knuckle_offset_m * c];
  const along = (length) => [base[0] + length * c, base[1] + length * s];
  return { start, elbow, base, end: along(boom.outer_boom_m), tip: along(boom.outer_boom_m + extension) };
}

/** Points below the tip of a crane: a load on its rope, or a grapple. */
export function hungPoints(hello, { rope, sway }) {
  return grapplePoints(rope ? { l1: 0, l2: rope } : hello.grapple, sway);
}

/** Link joint and grapple relative to the tip, as [outwards, in slew direction, upwards]. */
export function grapplePoints(grapple, sway) {
  const across = (sway?.[0] ?? 0) * RAD;
  const along = (sway?.[1] ?? 0) * RAD;
  const { l1, l2 } = grapple;
  const l3 = l1 + l2 * Math.cos(along);
  return {
    joint: [0, l1 * Math.sin(across), -l1 * Math.cos(across)],
    grapple: [-l2 * Math.sin(along), l3 * Math.sin(across), -l3 * Math.cos(across)],
  };
}

/**
 * Trolley, hook and load from the middle of runway and bridge, as [along the runway, along the bridge, upwards], m.
 * @param slung length of a sling below the hook, 0 for none; @param sling how it hangs, degrees.
 */
export function ropePoints([runway, bridge, rope], sway, slung, sling) {
  const below = ([x, y, z], length, angles) => {
    const [along, across] = [0, 1].map((k) => Math.tan((angles?.[k] ?? 0) * RAD));
    const down = length / Math.hypot(1, along, across);
    return [x + down * along, y + down * across, z - down];
  };
  const tip = [runway, bridge, 0];
  const hook = below(tip, rope, sway);
  return { tip, hook, load: below(hook, slung, sling ?? sway) };
}

function clamp(value) {
  return Math.max(-1, Math.min(1, value));
}
