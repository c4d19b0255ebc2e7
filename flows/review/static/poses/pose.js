// A pose as the catalogue gives it: null, {turntable: degrees} or {camera_to_world: 4 rows of 4 numbers}.

/** Kinds of poses, with the words for them. */
export const POSE_KINDS = [["", "not known"], ["turntable", "turntable"], ["camera_to_world", "matrix"]];

const MAX_TURN_DEG = 36000;

/** What the angle of a turntable must be: arguments of `typedNumber`. */
export const TURN = [(turn) => Math.abs(turn) <= MAX_TURN_DEG, `it must lie between -${MAX_TURN_DEG} and ${MAX_TURN_DEG} degrees`];

const IDENTITY = [0, 1, 2, 3].map((row) => [0, 1, 2, 3].map((column) => Number(row === column)));

/** Returns the kind of a pose. */
export function kindOf(pose) {
  if (!pose) return "";
  return pose.turntable === undefined ? "camera_to_world" : "turntable";
}

/** Returns the first pose of a kind: turned by so many degrees, or the matrix of no turn. */
export function poseOf(kind, turn = 0) {
  return { "": null, turntable: { turntable: turn }, camera_to_world: { camera_to_world: IDENTITY } }[kind];
}

/** Returns by how many degrees, -180 to 180, one turns from one angle to another. */
export function turnBetween(from, to) {
  return ((((to - from) % 360) + 540) % 360) - 180;
}
