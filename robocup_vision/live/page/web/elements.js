// Elements, numbers in words, and what several drawings share.
export const $ = id => document.getElementById(id);

export function make(tag, text, kind) {
  const element = document.createElement(tag);
  if (text !== undefined) element.textContent = text;
  if (kind) element.className = kind;
  return element;
}

export function pill(element, text, kind) {
  element.hidden = !text;
  element.textContent = text;
  element.className = "pill " + kind;
}

// returns a function that calls another one at most so often, and always after the last time it was called itself
export function seldom(call, wait_ms) {
  let timer = 0;
  return () => { timer ||= setTimeout(() => { timer = 0; call(); }, wait_ms); };
}

export function signed(value, digits = 2) {
  const text = Math.abs(value).toFixed(digits);
  return (value < 0 && Number(text) ? "−" : "") + text;
}

export function sized(canvas, ratio) {
  const width = Math.max(160, Math.round(canvas.clientWidth * (window.devicePixelRatio || 1))), height = Math.round(width * ratio);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  return canvas.getContext("2d");
}

export function css(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name);
}

export function arrow(context, x0, y0, x1, y1, thin) {
  const length = Math.hypot(x1 - x0, y1 - y0);
  if (length < 4 * thin) return;
  const c = (x1 - x0) / length, s = (y1 - y0) / length, head = 7 * thin;
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
  context.beginPath();
  context.moveTo(x1, y1);
  context.lineTo(x1 - head * c + .5 * head * s, y1 - head * s - .5 * head * c);
  context.lineTo(x1 - head * c - .5 * head * s, y1 - head * s + .5 * head * c);
  context.fill();
}
