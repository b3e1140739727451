// Which part of a canvas is shown: Ctrl and the wheel, two fingers, or the buttons enlarge; dragging moves.
// Places are fractions of the whole picture, from 0 to 1, from its upper left corner.
import {make} from "./elements.js";

const LARGEST = 20;

export class Zoom {
  // take: whether a press there is the owner's own, who then gets drag and drop; look: the pointer is there (or nowhere)
  constructor(canvas, {changed, take = () => false, drag, drop, look}) {
    Object.assign(this, {canvas, changed, factor: 1, left: 0, top: 0});
    const pointers = new Map();
    let taken = false;
    canvas.onwheel = event => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      this.enlarge(1.003 ** -event.deltaY, ...this.at(event));
    };
    canvas.addEventListener("touchstart", event => { if (taken) event.preventDefault(); }, {passive: false});
    canvas.onpointerdown = event => {
      if (event.button) return;
      canvas.setPointerCapture(event.pointerId);
      if (!pointers.size) taken = take(...this.at(event));
      pointers.set(event.pointerId, event);
    };
    canvas.onpointermove = event => {
      look(...this.at(event));
      const before = pointers.get(event.pointerId);
      if (!before) return;
      pointers.set(event.pointerId, event);
      if (taken) drag(...this.at(event), event.shiftKey);
      else this.follow(before, event, [...pointers.values()].find(other => other.pointerId !== event.pointerId));
    };
    canvas.onpointerup = canvas.onpointercancel = event => {
      pointers.delete(event.pointerId);
      if (!taken || pointers.size) return;
      taken = false;
      drop(event.type === "pointerup");
    };
    canvas.onpointerleave = () => look();
    const buttons = make("span", undefined, "zoom");
    buttons.dataset.upon = "";
    for (const [sign, title, ratio] of [["+", "larger", 1.5], ["−", "smaller", 1 / 1.5]]) {
      const button = make("button", sign);
      button.title = button.ariaLabel = title;
      button.onclick = () => this.enlarge(ratio, this.left + .5 / this.factor, this.top + .5 / this.factor);
      buttons.append(button);
    }
    canvas.after(buttons);
  }

  at(event) {
    const box = this.canvas.getBoundingClientRect();
    return [this.left + (event.clientX - box.left) / box.width / this.factor, this.top + (event.clientY - box.top) / box.height / this.factor];
  }

  // a place in pixels of the canvas
  x(place) { return (place - this.left) * this.factor * this.canvas.width; }
  y(place) { return (place - this.top) * this.factor * this.canvas.height; }

  follow(before, event, other) {
    if (other) {
      const away = one => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
      const between = {clientX: (event.clientX + other.clientX) / 2, clientY: (event.clientY + other.clientY) / 2};
      this.enlarge(away(event) / Math.max(away(before), 1), ...this.at(between));
    } else if (this.factor > 1) {
      const box = this.canvas.getBoundingClientRect();
      this.show(this.factor, this.left - (event.clientX - before.clientX) / box.width / this.factor,
        this.top - (event.clientY - before.clientY) / box.height / this.factor);
    }
  }

  enlarge(ratio, x, y) {
    const factor = Math.min(Math.max(this.factor * ratio, 1), LARGEST), kept = this.factor / factor;
    this.show(factor, x - (x - this.left) * kept, y - (y - this.top) * kept);
  }

  show(factor, left, top) {
    const most = 1 - 1 / factor, inside = value => Math.min(Math.max(value, 0), most);
    Object.assign(this, {factor, left: inside(left), top: inside(top)});
    // a finger scrolls the page while there is nothing to move
    this.canvas.style.touchAction = factor > 1 ? "none" : "pan-x pan-y";
    this.changed();
  }
}
