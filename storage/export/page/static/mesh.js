// A mesh that turns: three.js, with a cut by confidence, a section and measuring.

import {
  AmbientLight, BufferAttribute, BufferGeometry, DirectionalLight, DoubleSide, Group, Line, LineBasicMaterial, Mesh,
  MeshBasicMaterial, MeshStandardMaterial, OrthographicCamera, Plane, Raycaster, Scene, SphereGeometry, Vector2, Vector3,
  WebGLRenderer,
} from "./vendor/three/three.module.min.js";
import { OrbitControls } from "./vendor/three/OrbitControls.js";
import { NO_CONFIDENCE } from "./payload.js";
import { UNSEEN, cameraShapes, outlineShapes, viewColour } from "./cameras.js";
import { scaleColour } from "./lenses.js";

const CLAY = 0xcfd2d3;
/** Outlines lie on the surface; so much farther from its middle they are not hidden by it. */
const OUTLINE_SCALE = 1.004;
/** Code of a vertex that no view has seen. */
const NO_VIEW = 255;
const BACKGROUND = 0x121416;
const AXES = { x: [-1, 0, 0], y: [0, -1, 0], z: [0, 0, -1] };

export class MeshView {
  /** onmeasure is called with the distance between two points that were clicked, in the mesh's unit, or null. */
  constructor(canvas, onmeasure) {
    this.canvas = canvas;
    this.onmeasure = onmeasure;
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.renderer.setClearColor(BACKGROUND);
    this.scene = new Scene();
    this.camera = new OrthographicCamera(-1, 1, 1, -1, -100, 100);
    this.camera.position.set(0, 0, 3);
    const key = new DirectionalLight(0xffffff, 2.3), fill = new DirectionalLight(0xbfd4ff, 0.7);
    key.position.set(-1, 1.2, 1.6);
    fill.position.set(1.5, -0.4, 0.6);
    this.camera.add(key, fill, key.target, fill.target);
    this.scene.add(this.camera, new AmbientLight(0xffffff, 0.35));
    this.material = new MeshStandardMaterial({ color: CLAY, roughness: 0.5, metalness: 0.0, side: DoubleSide });
    this.group = new Group();
    this.marks = new Group();
    this.cameras = new Group();
    this.scene.add(this.group, this.marks, this.cameras);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.ask());
    this.section = null;
    this.points = [];
    this.isMeasuring = false;
    canvas.addEventListener("pointerdown", (event) => (this.pressed = [event.clientX, event.clientY]));
    canvas.addEventListener("pointerup", (event) => this.released(event));
    canvas.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.resized()).observe(canvas.parentElement);
  }

  /** Show a mesh: positions, normals, triangles, confidence and the views' codes, as meshArrays returns them. */
  setMesh({ positions, normals, triangles, confidence, source }) {
    release(this.group);
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(positions, 3));
    geometry.setAttribute("normal", new BufferAttribute(normals, 3));
    geometry.setIndex(new BufferAttribute(triangles, 1));
    geometry.computeBoundingSphere();
    Object.assign(this, { geometry, triangles, confidence, source });
    const { center, radius } = geometry.boundingSphere;
    this.radius = radius || 1;
    this.mesh = new Mesh(geometry, this.material);
    this.mesh.position.copy(center).negate();
    this.group.add(this.mesh);
    this.outlines = null;
    // One unit of the scene is the radius of the mesh.
    this.group.scale.setScalar(1 / this.radius);
    this.cut = 0;
    this.clearMarks();
    this.home();
  }

  /** The view from the front, a little from above and beside. */
  home() {
    this.camera.position.set(1.1, 0.8, 2.7);
    this.camera.zoom = 1;
    this.controls.target.set(0, 0, 0);
    this.controls.update();
    this.resized();
  }

  /** Colour by confidence, by the view that determines each part (`source`), or plain. */
  colourBy(name) {
    const codes = { confidence: this.confidence, source: this.source }[name];
    if (codes) {
      const colours = new Uint8Array(codes.length * 3), palette = Array.from({ length: 256 }, (_, code) => paletteColour(name, code));
      codes.forEach((code, i) => colours.set(palette[code], 3 * i));
      this.geometry.setAttribute("color", new BufferAttribute(colours, 3, true));
    }
    this.material.vertexColors = Boolean(codes);
    this.material.color.set(codes ? 0xffffff : CLAY);
    this.material.needsUpdate = true;
    this.ask();
  }

  /** Show the cameras of the views (`toward`, `up`); none for a mesh of one view. */
  setCameras(views) {
    release(this.cameras);
    this.scene.remove(this.cameras);
    this.cameras = cameraShapes(views);
    this.scene.add(this.cameras);
    this.ask();
  }

  showCameras(isShown) {
    this.cameras.visible = isShown;
    this.ask();
  }

  /** Show where the outlines of views touch the surface; they are found when they are first asked for. */
  showOutlines(views, isShown) {
    if (isShown && !this.outlines) {
      const [positions, normals] = ["position", "normal"].map((name) => this.geometry.getAttribute(name).array);
      this.outlines = outlineShapes(views, positions, normals, this.triangles);
      this.outlines.scale.setScalar(OUTLINE_SCALE);
      this.outlines.position.copy(this.mesh.position).multiplyScalar(OUTLINE_SCALE);
      this.group.add(this.outlines);
    }
    if (this.outlines) this.outlines.visible = isShown;
    this.ask();
  }

  /** Look from a camera; the whole model stays in the middle. */
  lookFrom({ toward }) {
    this.camera.position.set(...toward).multiplyScalar(3);
    this.controls.target.set(0, 0, 0);
    this.controls.update();
    this.ask();
  }

  /** Show only triangles whose corners have at least this confidence, 0 to 1. */
  cutBelow(least) {
    const { triangles, confidence } = this;
    if (!confidence) return;
    const limit = Math.round(least * 254), kept = [];
    const isKept = (vertex) => limit === 0 || (confidence[vertex] !== NO_CONFIDENCE && confidence[vertex] >= limit);
    for (let i = 0; i < triangles.length; i += 3) {
      if (isKept(triangles[i]) && isKept(triangles[i + 1]) && isKept(triangles[i + 2])) kept.push(triangles[i], triangles[i + 1], triangles[i + 2]);
    }
    this.geometry.setIndex(new BufferAttribute(new Uint32Array(kept), 1));
    this.ask();
  }

  /** Cut everything beyond a plane across an axis; place from -1 to 1, null shows all. */
  cutAcross(axis, place) {
    const planes = axis === "none" ? [] : [new Plane(new Vector3(...AXES[axis]), place)];
    this.renderer.clippingPlanes = planes;
    this.ask();
  }

  measure(isMeasuring) {
    this.isMeasuring = isMeasuring;
    if (!isMeasuring) this.clearMarks();
  }

  clearMarks() {
    this.points = [];
    release(this.marks);
    this.onmeasure(null);
    this.ask();
  }

  released(event) {
    const isClick = this.pressed && Math.hypot(event.clientX - this.pressed[0], event.clientY - this.pressed[1]) < 4;
    if (!this.isMeasuring || !isClick) return;
    const box = this.canvas.getBoundingClientRect();
    this.mark(new Vector2(((event.clientX - box.x) / box.width) * 2 - 1, 1 - ((event.clientY - box.y) / box.height) * 2));
  }

  /** Set a point to measure from or to where the mesh is seen at a place, -1 to 1 across and up. */
  mark(place) {
    if (!this.mesh) return;
    const caster = new Raycaster();
    // Places follow the last change, also one that is not drawn yet.
    this.scene.updateMatrixWorld(true);
    caster.setFromCamera(place, this.camera);
    const shown = this.renderer.clippingPlanes;
    const hit = caster.intersectObject(this.mesh).find(({ point }) => shown.every((plane) => plane.distanceToPoint(point) >= 0));
    if (!hit) return;
    if (this.points.length === 2) this.clearMarks();
    this.points.push(hit.point);
    const dot = new Mesh(new SphereGeometry(0.014), new MeshBasicMaterial({ color: 0xffb340, depthTest: false }));
    dot.position.copy(hit.point);
    this.marks.add(dot);
    if (this.points.length === 2) {
      const line = new Line(new BufferGeometry().setFromPoints(this.points), new LineBasicMaterial({ color: 0xffb340, depthTest: false }));
      this.marks.add(line);
      this.onmeasure(this.points[0].distanceTo(this.points[1]) * this.radius);
    }
    this.ask();
  }

  key(event) {
    const turns = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (event.key === "Enter" && this.isMeasuring) this.mark(new Vector2(0, 0));
    else if (event.key === "+" || event.key === "-") this.camera.zoom *= event.key === "+" ? 1.2 : 1 / 1.2;
    else if (event.key in turns) {
      const [around, up] = turns[event.key], offset = this.camera.position.clone().sub(this.controls.target);
      const length = offset.length(), azimuth = Math.atan2(offset.x, offset.z) + around * 0.12;
      const height = Math.max(-1.5, Math.min(1.5, Math.asin(offset.y / length) + up * 0.12));
      offset.set(Math.sin(azimuth) * Math.cos(height), Math.sin(height), Math.cos(azimuth) * Math.cos(height)).multiplyScalar(length);
      this.camera.position.copy(this.controls.target).add(offset);
    } else return;
    event.preventDefault();
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.ask();
  }

  resized() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio || 1, 2));
    this.renderer.setSize(width, height, false);
    const [across, up] = width > height ? [width / height, 1] : [1, height / width];
    Object.assign(this.camera, { left: -across * 1.05, right: across * 1.05, top: up * 1.05, bottom: -up * 1.05 });
    this.camera.updateProjectionMatrix();
    this.ask();
  }

  dispose() {
    this.isAsked = true;
    this.controls.dispose();
    for (const group of [this.group, this.marks, this.cameras]) release(group);
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  ask() {
    if (this.isAsked) return;
    this.isAsked = true;
    requestAnimationFrame(() => {
      this.isAsked = false;
      if (this.canvas.clientWidth) this.renderer.render(this.scene, this.camera);
    });
  }
}

/** Empty a group, and give back the graphics memory of all in it. */
function release(group) {
  group.traverse(({ geometry }) => geometry?.dispose());
  group.clear();
}

function paletteColour(name, code) {
  if (name === "source") return code === NO_VIEW ? UNSEEN : viewColour(code).toArray().map((part) => Math.round(255 * part));
  return code === NO_CONFIDENCE ? [90, 90, 90] : scaleColour(code / 254);
}
