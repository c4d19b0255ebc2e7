// The cameras of a model's views: from where each looks, in its colour, and the view from there.

import { BufferGeometry, Color, Group, LineBasicMaterial, LineSegments, Vector3 } from "./vendor/three/three.module.min.js";
import { button, make } from "./elements.js";

/** Twelve colours that differ in lightness too; views beyond them begin anew. */
const COLOURS = ["#e0b96f", "#7fb3ff", "#8fd6a5", "#ff9d8f", "#b79bff", "#f2e086", "#5fd0d6", "#e58fc8", "#a9c36a", "#c98b5a", "#8c9eb8", "#f5f3ee"];
/** Grey of what no view has seen. */
export const UNSEEN = [96, 96, 96];
/** Distance of a camera from the middle and its size, in radii of the mesh: in reality it stands far away. */
const DISTANCE = 1.3;
const SIZE = 0.11;

export function viewColour(number) {
  return new Color(COLOURS[number % COLOURS.length]);
}

/** Lines of a pyramid for each view, its tip at the camera and its base towards the object. */
export function cameraShapes(views) {
  const group = new Group();
  for (const [number, { toward, up }] of views.entries()) {
    const direction = new Vector3(...toward), upwards = new Vector3(...up), across = new Vector3().crossVectors(upwards, direction);
    const tip = direction.clone().multiplyScalar(DISTANCE + 1.4 * SIZE);
    const base = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) =>
      direction.clone().multiplyScalar(DISTANCE).addScaledVector(across, 1.3 * SIZE * x).addScaledVector(upwards, SIZE * y));
    const points = base.flatMap((corner, i) => [tip, corner, corner, base[(i + 1) % 4]]);
    // A stroke above the base shows which side is up.
    points.push(base[2], direction.clone().multiplyScalar(DISTANCE).addScaledVector(upwards, 1.6 * SIZE), base[3], points.at(-1));
    group.add(new LineSegments(new BufferGeometry().setFromPoints(points), new LineBasicMaterial({ color: viewColour(number) })));
  }
  return group;
}

/** Lines on a mesh, for each view in its colour, where its normals are across the view as seen from far away: there the view's outline touches it. */
export function outlineShapes(views, positions, normals, triangles) {
  const group = new Group(), values = new Float32Array(positions.length / 3);
  for (const [number, { toward: [x, y, z] }] of views.entries()) {
    for (let i = 0; i < values.length; i++) values[i] = normals[3 * i] * x + normals[3 * i + 1] * y + normals[3 * i + 2] * z;
    const points = [];
    for (let i = 0; i < triangles.length; i += 3) {
      for (const [one, other] of [[0, 1], [1, 2], [2, 0]]) {
        // Both triangles of an edge find the same point.
        const [first, second] = [triangles[i + one], triangles[i + other]].sort((a, b) => a - b);
        if (values[first] > 0 === values[second] > 0) continue;
        const start = new Vector3().fromArray(positions, 3 * first), end = new Vector3().fromArray(positions, 3 * second);
        points.push(start.lerp(end, values[first] / (values[first] - values[second])));
      }
    }
    group.add(new LineSegments(new BufferGeometry().setFromPoints(points), new LineBasicMaterial({ color: viewColour(number) })));
  }
  return group;
}

/** The list of views: colour, name, share of the surface; a click looks from there. */
export function viewList(views, unseen, onlook) {
  const percent = (share) => `${(100 * share).toFixed(share < 0.1 ? 1 : 0)} %`;
  const row = (colour, text, share) => {
    const swatch = make("i", { className: "swatch" });
    swatch.style.backgroundColor = colour;
    return make("li", {}, swatch, text, make("b", {}, share));
  };
  const rows = views.map((view, number) => row(`#${viewColour(number).getHexString()}`, button(view.name, () => onlook(view), { title: `Look as ${view.name} does` }), percent(view.share)));
  if (unseen !== null && unseen !== undefined) rows.push(row(`rgb(${UNSEEN.join(" ")})`, make("span", {}, "seen by no view"), percent(unseen)));
  return make("div", { className: "legend views" }, make("p", {}, "Views, and the share of the surface that each determines"), make("ul", {}, ...rows));
}
