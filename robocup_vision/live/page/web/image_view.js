// A robot's frame with its layers.
import {css, sized} from "./elements.js";
import {COLOR, shown} from "./layers.js";
import {Zoom} from "./zoom.js";

export class ImageView {
  constructor(canvas, where, card) {
    Object.assign(this, {canvas, card});
    this.zoom = new Zoom(canvas, {
      changed: () => this.draw(),
      look: (x, y) => {
        const m = card.moment;
        where.textContent = m && x !== undefined ? "u " + Math.floor(x * m.size_px[0]) + " px, v " + Math.floor(y * m.size_px[1]) + " px" : "";
      },
    });
  }

  draw() {
    const {canvas, zoom} = this, {moment, bitmap} = this.card;
    if (!moment || !bitmap) return;
    const [width, height] = moment.size_px, layers = moment.layers, context = sized(canvas, height / width);
    const X = u => zoom.x((u + .5) / width), Y = v => zoom.y((v + .5) / height);
    const scale = zoom.factor * canvas.width / width;
    context.fillStyle = css("--well");
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.imageSmoothingEnabled = scale < 3;
    context.drawImage(bitmap, zoom.x(0), zoom.y(0), zoom.factor * canvas.width, zoom.factor * canvas.height);
    if (!layers) return;
    const line = Math.max(1.2, canvas.width / 480);
    const path = (points, close) => {
      context.beginPath();
      for (let i = 0; i < points.length; i += 2) context.lineTo(X(points[i]), Y(points[i + 1]));
      if (close) context.closePath();
    };
    const dots = (points, color, size) => {
      context.fillStyle = color;
      for (let i = 0; i < points.length; i += 2) context.fillRect(X(points[i]) - size / 2, Y(points[i + 1]) - size / 2, size, size);
    };
    if (shown.free && layers.free.length) {
      path(layers.free, true);
      context.fillStyle = COLOR.free + "40";
      context.fill();
      context.strokeStyle = COLOR.free;
      context.lineWidth = line * .8;
      context.stroke();
    }
    if (shown.lines) dots(layers.lines, COLOR.lines, line * 1.8);
    for (const [name, thick] of [["field", 1], ["goals", 1.6], ["truth", 1.4], ["obstacles", 2.4], ["ball", 2], ["markings", 1.6]]) {
      if (!shown[name]) continue;
      context.strokeStyle = COLOR[name];
      context.lineWidth = line * thick;
      context.setLineDash(name === "truth" ? [2 * line, 4 * line] : []);
      for (const points of layers[name]) { path(points, false); context.stroke(); }
    }
    context.setLineDash([]);
    if (shown.edge) dots(layers.edge, COLOR.edge, line * 2.2);
    for (const name of ["missing", "hidden", "found"]) if (shown[name]) dots(layers[name], COLOR[name], line * 2.6);
  }
}
