// The polygon that is filled into the mask, or cut out of it: corners set by clicks, or by keys at a cursor.

import { announce } from "../dom.js";
import { pixelAt } from "../rounding.js";
import { Konva } from "../vendor.js";

const CLOSE_PX = 10;
const CURSOR_PX = 6;

export class Polygon {
  /** `filled` takes the corners and whether they are cut out, and returns whether it has taken them. */
  constructor(view, filled) {
    Object.assign(this, { view, filled, corners: [], isMoved: false });
    const style = { strokeScaleEnabled: false, visible: false, listening: false };
    this.path = new Konva.Line({ stroke: "#ffd27a", strokeWidth: 2, ...style });
    this.cursor = new Konva.Circle({ stroke: "#fff", strokeWidth: 1.5, ...style });
    view.picture.shapes.add(this.path, this.cursor);
    view.picture.onzoom.push((zoom) => this.cursor.radius(CURSOR_PX / zoom));
    this.cursor.radius(CURSOR_PX / view.picture.zoom);
  }

  get isChosen() {
    return this.view.tool === "polygon";
  }

  /** Keeps the corners of an unfinished polygon while another tool is used, and goes on from them afterwards. */
  toolChanged() {
    const count = this.corners.length;
    if (this.isChosen) {
      if (!this.cursor.visible()) this.place(pixelAt(this.corners.at(-1) ?? this.view.picture.centre()));
    } else if (this.cursor.visible() && count) {
      this.path.points(this.corners.flatMap(({ x, y }) => [x, y]));
      this.isMoved = false;
      announce(`${count === 1 ? "1 corner is" : `${count} corners are`} kept: Polygon goes on from there`);
    }
    this.cursor.visible(this.isChosen);
  }

  /** Moves the cursor to the pointer. */
  follow(point) {
    this.isMoved = false;
    this.place(point);
  }

  /** Moves the cursor by keys, within the frame. */
  move(x, y) {
    const { width, height } = this.view.picture;
    const within = (value, size) => Math.min(Math.max(value, 0), size - 1);
    this.isMoved = true;
    this.place({ x: within(this.cursor.x() + x, width), y: within(this.cursor.y() + y, height) });
    this.view.picture.reveal(this.cursor.position());
    return true;
  }

  place(point) {
    this.cursor.position(point);
    this.path.visible(this.corners.length > 0);
    this.path.points([...this.corners, point].flatMap(({ x, y }) => [x, y]));
  }

  /** Sets a corner; on the first one, closes the polygon. */
  add(point) {
    if (this.corners.length > 2 && this.isNear(point, this.corners[0])) {
      this.close(false);
      return;
    }
    this.corners.push({ x: point.x, y: point.y });
    this.isMoved = false;
    this.place(point);
  }

  isNear(point, corner) {
    return Math.hypot(point.x - corner.x, point.y - corner.y) * this.view.picture.zoom < CLOSE_PX;
  }

  /** Sets a corner at the cursor, and says where. */
  addAtCursor() {
    if (!this.isChosen) return false;
    this.add(this.cursor.position());
    const corner = this.corners.at(-1);
    if (corner) announce(`corner ${this.corners.length} at ${Math.round(corner.x)}, ${Math.round(corner.y)}`);
    return true;
  }

  /** Sets a corner where keys have moved the cursor; where it is set already, fills the polygon or cuts it out. */
  enter(cutsOut) {
    if (!this.isChosen) return false;
    if (!this.corners.length || (this.isMoved && !cutsOut)) return this.addAtCursor();
    this.close(cutsOut);
    return true;
  }

  close(cutsOut) {
    if (this.corners.length < 3) {
      announce("a polygon needs three corners: move the cursor, and set another one");
      return;
    }
    if (!this.filled(this.corners, cutsOut)) return;
    this.cancel();
    announce(cutsOut ? "polygon cut out" : "polygon filled");
  }

  /** Takes the last corner back. */
  removeLast() {
    if (!this.isChosen) return false;
    this.corners.pop();
    this.isMoved = this.corners.length > 0;
    this.place(this.cursor.position());
    announce(this.corners.length === 1 ? "1 corner" : `${this.corners.length} corners`);
    return true;
  }

  cancel() {
    const had = this.corners.length > 0;
    this.corners = [];
    this.isMoved = false;
    this.path.visible(false);
    return had;
  }
}
