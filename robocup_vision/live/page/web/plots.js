// What a robot's pictures have told over time: its trail, and plots of error, standard deviation and time.
import {css, make, sized} from "./elements.js";

// as long as the page's process keeps pictures; of less a plot shows a part
const SPAN_S = 30, SHORTEST_S = 3;
const DEGREE = Math.PI / 180;
const PLOTS = [
  {title: "Position", unit: "mm", log: true, lines: [["error", "#e0525e", one => one.error && 1e3 * one.error[0]], ["std", "#3f8fe0", one => one.std && 1e3 * Math.hypot(one.std[0], one.std[1])]]},
  {title: "Heading", unit: "°", log: true, lines: [["error", "#e0525e", one => one.error && one.error[1] / DEGREE], ["std", "#3f8fe0", one => one.std && one.std[2] / DEGREE]]},
  {title: "Time per frame", unit: "ms", log: false, lines: [["time", "#2fa36b", one => one.ms]]},
];

export class History {
  constructor() { this.all = []; }

  add(m) {
    const last = this.all[this.all.length - 1];
    // the source has gone to another time
    if (last && m.number > last.number && m.t_s <= last.t_s) this.all = [];
    const located = m.pose && m.pose.located;
    this.now = {number: m.number, t_s: m.t_s, pose: located ? m.pose.pose : null, std: located ? m.pose.std : null, truth: m.truth,
      error: m.error || null, ms: m.timings_ms ? m.timings_ms.total : null};
    const others = this.all.filter(one => one.number !== m.number);
    this.all = [...others, this.now].sort((one, other) => one.number - other.number);
    const end_s = this.all[this.all.length - 1].t_s;
    this.all = this.all.filter(one => one.t_s > end_s - SPAN_S);
  }

  // up to the picture that is shown
  past() { return this.all.filter(one => one.number <= this.now.number); }
}

export class Plots {
  constructor(element) {
    this.parts = PLOTS.map(plot => {
      const figure = make("figure"), caption = make("figcaption"), canvas = make("canvas");
      canvas.dataset.part = plot.title.split(" ")[0].toLowerCase();
      figure.append(caption, canvas);
      element.append(figure);
      return {...plot, caption, canvas};
    });
  }

  draw(history) {
    for (const part of this.parts) drawPlot(part, history);
  }
}

function drawPlot({title, unit, log, lines, caption, canvas}, {all, now}) {
  caption.replaceChildren(make("b", title));
  const context = sized(canvas, .34), {width, height} = canvas, thin = Math.max(1, width / 400), font = 10 * (window.devicePixelRatio || 1);
  context.clearRect(0, 0, width, height);
  const drawn = lines.map(([name, color, value]) => {
    const at = now && value(now);
    if (Number.isFinite(at)) {
      const label = make("span", name + " " + (at < 100 ? at.toPrecision(3) : at.toFixed(0)) + " " + unit);
      label.style.color = color;
      caption.append(" ", label);
    }
    return [color, all.map(one => [one.t_s, value(one)]).filter(([, y]) => Number.isFinite(y))];
  });
  const values = drawn.flatMap(([, points]) => points.map(([, y]) => y)).filter(y => !log || y > 0);
  if (!values.length) return;
  const scale = y => log ? Math.log10(Math.max(y, 1e-3)) : y;
  const low = log ? Math.floor(scale(Math.min(...values))) : 0, high = log ? Math.max(Math.ceil(scale(Math.max(...values))), low + 1) : 1.15 * Math.max(...values);
  const end_s = all[all.length - 1].t_s, span_s = Math.max(end_s - all[0].t_s, SHORTEST_S);
  const X = t => width * (1 - (end_s - t) / span_s), Y = y => height * (1 - (scale(y) - low) / (high - low));
  context.font = font + "px system-ui";
  context.lineWidth = thin;
  for (const y of log ? Array.from({length: high - low}, (_, i) => 10 ** (low + i)) : [.5, 1].map(part => part * high / 1.15)) {
    context.strokeStyle = css("--rule");
    context.beginPath();
    context.moveTo(0, Y(y));
    context.lineTo(width, Y(y));
    context.stroke();
    context.fillStyle = css("--soft");
    context.fillText(Number(y.toPrecision(2)) + " " + unit, 2, Y(y) - 2);
  }
  for (const [color, points] of drawn) {
    context.strokeStyle = context.fillStyle = color;
    context.lineWidth = 1.4 * thin;
    context.beginPath();
    // a gap where frames were not located, or not shown
    points.forEach(([t, y], i) => i && t - points[i - 1][0] < 1 ? context.lineTo(X(t), Y(y)) : context.moveTo(X(t), Y(y)));
    context.stroke();
  }
  context.strokeStyle = css("--soft");
  context.lineWidth = thin;
  context.beginPath();
  context.moveTo(X(now.t_s), 0);
  context.lineTo(X(now.t_s), height);
  context.stroke();
}
