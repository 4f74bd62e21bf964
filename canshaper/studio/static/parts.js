// What a machine has besides booms and ropes, by kind: what moves it, its material, size, middle, turn about z.
// A size is [x, y, z] of a box, or [axis, radius, height] of a cylinder.

const both = (at) => [-at, at];
const around = (x, y) => both(x).flatMap((one) => both(y).map((other) => [one, other]));

export const PARTS = {
  forwarder: () => [
    ["base", "dark", [4.6, 0.9, 0.3], [-0.9, 0, 0.62]],
    ...around(1.6, 0.72).map(([x, y]) => ["base", "dark", ["y", 0.52, 0.42], [x - 0.9, y, 0.52]]),
  ],
  logs: () => [[5.6, -1.2, 0.18], [5.9, -0.85, 0.18], [5.75, -1.02, 0.47]].map((at) => [
    "base", "wood", ["y", 0.18, 3.2], at, Math.PI / 2 - 0.06]),
  excavator: () => [
    ...both(1.15).map((y) => ["base", "dark", [4.2, 0.6, 0.9], [0, y, 0.45]]),
    ["base", "dark", [1.8, 1.8, 0.4], [0, 0, 0.85]],
    ["slew", "steel", [2.7, 2.5, 0.9], [-1, 0, 1.5]],
    ["slew", "dark", [0.5, 2.6, 1.2], [-2.5, 0, 1.6]],
    ["slew", "tool", [1.4, 0.9, 1.7], [0.1, 0.8, 1.9]],
  ],
  bridge: ({ half, runway, top, middle }) => [
    ...both(half).map((side) => ["base", "dark", [0.14, runway, 0.14], [middle + side, 0, top - 0.25]]),
    ...both(0.22).map((side) => ["bridge", "steel", [2 * half, 0.12, 0.26], [middle, side, top]]),
    ...both(half).map((side) => ["bridge", "dark", [0.3, 0.9, 0.2], [middle + side, 0, top - 0.1]]),
    ["trolley", "steel", [0.5, 0.62, 0.22], [0, 0, 0.2]],
  ],
  multicopter: () => [
    ["trolley", "steel", [0.6, 0.6, 0.24], [0, 0, 0.15]],
    ...[1, -1].map((side) => ["trolley", "dark", [2.2, 0.09, 0.07], [0, 0, 0.2], (side * Math.PI) / 4]),
    ...around(0.75, 0.75).map(([x, y]) => ["trolley", "tool", ["z", 0.5, 0.04], [x, y, 0.32]]),
  ],
  hook: () => [["hook", "dark", [0.3, 0.3, 0.3], [0, 0, -0.1]]],
  load: () => [
    ["grapple", "dark", [0.12, 0.12, 0.16], [0, 0, -0.08]],
    ["grapple", "tool", [0.5, 0.5, 0.4], [0, 0, -0.36]],
  ],
};
