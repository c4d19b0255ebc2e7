// Which part of a picture a canvas shows: fitted, zoomed about the pointer, moved.

const MAX_ZOOM = 32;

export class Viewport {
  /** onchange is called after each change; `corner` and `pixel` are those of relight.js. */
  constructor(canvas, onchange) {
    this.canvas = canvas;
    this.onchange = onchange;
    this.zoom = 1;
    this.middle = null;
    new ResizeObserver(() => this.resized()).observe(canvas.parentElement);
  }

  setSize(width, height) {
    this.size = [width, height];
    this.fit();
  }

  /** The whole picture with a margin. */
  fit() {
    this.zoom = 1;
    this.middle = null;
    this.resized();
  }

  resized() {
    const box = this.canvas.parentElement.getBoundingClientRect(), ratio = Math.min(devicePixelRatio || 1, 2);
    const [width, height] = [Math.max(1, Math.round(box.width * ratio)), Math.max(1, Math.round(box.height * ratio))];
    if (this.canvas.width !== width) this.canvas.width = width;
    if (this.canvas.height !== height) this.canvas.height = height;
    this.box = box;
    this.ratio = ratio;
    this.changed();
  }

  changed() {
    if (!this.size) return;
    const { width, height } = this.canvas, [across, down] = this.size;
    this.middle ??= [across / 2, down / 2];
    this.pixel = (Math.max(across / width, down / height) * 1.06) / this.zoom;
    this.corner = [this.middle[0] - (width / 2) * this.pixel, this.middle[1] - (height / 2) * this.pixel];
    this.onchange(this);
  }

  /** Zoom by a factor; what lies under the pointer (client coordinates), or in the middle, stays. */
  zoomBy(factor, x = null, y = null) {
    const before = x === null ? this.middle : this.picture(x, y);
    this.zoom = Math.min(MAX_ZOOM, Math.max(0.5, this.zoom * factor));
    this.changed();
    if (x !== null) {
      const after = this.picture(x, y);
      this.middle = [this.middle[0] + before[0] - after[0], this.middle[1] + before[1] - after[1]];
      this.changed();
    }
  }

  /** Move by so many client pixels. */
  moveBy(x, y) {
    const unit = this.pixel * this.ratio;
    this.middle = [this.middle[0] - x * unit, this.middle[1] - y * unit];
    this.changed();
  }

  /** The place in the picture, in pixels with its upper left corner at 0, 0, of client coordinates. */
  picture(x, y) {
    const box = this.canvas.getBoundingClientRect(), unit = this.pixel * this.ratio;
    return [this.corner[0] + (x - box.x) * unit, this.corner[1] + (y - box.y) * unit];
  }

  /** The place on the stage, in client pixels from its upper left corner, of a place in the picture. */
  stage(x, y) {
    const unit = this.pixel * this.ratio;
    return [(x - this.corner[0]) / unit, (y - this.corner[1]) / unit];
  }
}
