// The field from above with one robot, or with all robots of a match; in a simulation things are put elsewhere by mouse.
import {arrow, css, signed, sized} from "./elements.js";
import {COLOR, shown} from "./layers.js";
import {run, send} from "./link.js";
import {Zoom} from "./zoom.js";

// of robots that are shown together
const ROBOT_COLORS = ["#00e5ff", "#ffb14d", "#c9a2ff", "#7dff8a", "#ff8fb1", "#ffe14d", "#8fb7ff", "#d0d0d0"];
const WAY = "#50ffa0", SIDES = {"1": "#f0be3c", "-1": "#3c78dc"};
// a step that is longer is no motion, but another belief
const JUMP_M = .5;

export class FieldView {
  // cards: returns the robots to draw, at least one, all on the same field
  constructor(canvas, where, cards) {
    Object.assign(this, {canvas, cards, grabbed: null});
    this.zoom = new Zoom(canvas, {
      changed: () => this.draw(),
      take: (fx, fy) => { this.grabbed = this.thingAt(fx, fy); return Boolean(this.grabbed); },
      drag: (fx, fy, turns) => {
        const [x, y] = this.place(fx, fy), thing = this.grabbed;
        if (!turns) [thing.x, thing.y] = [x, y];
        else if (thing.name !== "ball") thing.theta = Math.atan2(y - thing.y, x - thing.x);
        this.draw();
      },
      drop: done => {
        const {name, x, y, theta} = this.grabbed;
        this.grabbed = null;
        if (done) send({type: "place", thing: name, x_m: x, y_m: y, theta_rad: theta});
        this.draw();
      },
      look: (fx, fy) => {
        where.textContent = fx === undefined || !this.half ? "" : this.tellPlace(...this.place(fx, fy));
        canvas.style.cursor = fx !== undefined && this.thingAt(fx, fy) ? "grab" : "";
      },
    });
  }

  setup(field) {
    const ends = [...field.floor, ...field.goals.map(goal => [goal.back_x_m, goal.width_m / 2])];
    for (const [x0, y0, x1, y1] of field.lines) ends.push([x0, y0], [x1, y1]);
    this.half = [0, 1].map(axis => 1.05 * Math.max(...ends.map(end => Math.abs(end[axis]))));
  }

  place(fx, fy) { return [(2 * fx - 1) * this.half[0], (1 - 2 * fy) * this.half[1]]; }

  tellPlace(x, y) {
    const cards = this.cards(), m = cards[0].moment, text = "x " + signed(x) + " m, y " + signed(y) + " m";
    if (cards.length > 1 || !m || !m.pose || !m.pose.located) return text;
    const [px, py, theta] = m.pose.pose, bearing = Math.atan2(y - py, x - px) - theta;
    return text + "; " + Math.hypot(x - px, y - py).toFixed(2) + " m from the robot, at " + signed(Math.atan2(Math.sin(bearing), Math.cos(bearing)) * 180 / Math.PI, 0) + "°";
  }

  world() {
    const told = this.cards().map(card => card.moment).filter(m => m && m.world);
    return told.length ? told.reduce((one, other) => other.t_s > one.t_s ? other : one).world : null;
  }

  thingAt(fx, fy) {
    const world = this.world();
    if (!world || !run.offers.has("place")) return null;
    const [x, y] = this.place(fx, fy), reach = Math.max(this.cards()[0].robot.radius_m, 14 * 2 * this.half[0] / this.canvas.clientWidth / this.zoom.factor);
    const things = world.robots.map(([name, , tx, ty, theta]) => ({name, x: tx, y: ty, theta}));
    if (world.ball) things.push({name: "ball", x: world.ball[0], y: world.ball[1], theta: null});
    const away = thing => Math.hypot(thing.x - x, thing.y - y);
    const nearest = things.reduce((one, other) => away(other) < away(one) ? other : one);
    return away(nearest) <= reach ? nearest : null;
  }

  draw() {
    const cards = this.cards(), {canvas, zoom} = this;
    if (!cards.length || !cards[0].robot) return;
    const [halfX, halfY] = this.half, context = sized(canvas, halfY / halfX);
    this.pen = {
      context, thin: Math.max(1, canvas.width / 600), scale: zoom.factor * canvas.width / (2 * halfX),
      X: x => zoom.x((x + halfX) / (2 * halfX)), Y: y => zoom.y((halfY - y) / (2 * halfY)),
    };
    this.drawGround(cards[0].robot.field);
    cards.forEach((card, index) => {
      if (card.moment) this.drawRobot(card, cards.length > 1 ? ROBOT_COLORS[index % ROBOT_COLORS.length] : COLOR.field, cards.length > 1);
    });
    this.drawWorld(cards);
  }

  path(points, close) {
    const {context, X, Y} = this.pen;
    context.beginPath();
    for (const [x, y] of points) context.lineTo(X(x), Y(y));
    if (close) context.closePath();
  }

  disc(x, y, radius) {
    const {context, X, Y, scale} = this.pen;
    context.beginPath();
    context.arc(X(x), Y(y), Math.max(radius * scale, 1.5), 0, 2 * Math.PI);
  }

  robotAt([x, y, theta], radius, length, fill) {
    const {context} = this.pen;
    this.disc(x, y, radius);
    if (fill) { context.fillStyle = fill; context.fill(); }
    context.stroke();
    this.path([[x, y], [x + length * Math.cos(theta), y + length * Math.sin(theta)]]);
    context.stroke();
  }

  style(color, width, dash = []) {
    const {context, thin} = this.pen;
    context.strokeStyle = color;
    context.lineWidth = width * thin;
    context.setLineDash(dash.map(length => length * thin));
  }

  drawGround(field) {
    const {context, X, Y, scale, thin} = this.pen;
    context.fillStyle = css("--beyond");
    context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    this.path(field.floor, true);
    context.fillStyle = css("--carpet");
    context.fill();
    for (const goal of field.goals) {
      const half = goal.width_m / 2;
      this.path([[goal.x_m, -half], [goal.back_x_m, -half], [goal.back_x_m, half], [goal.x_m, half]], true);
      context.fillStyle = goal.color + "90";
      context.fill();
    }
    this.style(css("--paint"), Math.max(1, field.line_width_m * scale / thin));
    for (const [x0, y0, x1, y1] of field.lines) { this.path([[x0, y0], [x1, y1]]); context.stroke(); }
    for (const [x, y, radius, start, sweep] of field.arcs) {
      context.beginPath();
      context.arc(X(x), Y(y), radius * scale, -start, -start - sweep, sweep > 0);
      context.stroke();
    }
    this.style(css("--soft"), 1.5);
    for (const [x0, y0, x1, y1] of field.walls) { this.path([[x0, y0], [x1, y1]]); context.stroke(); }
  }

  drawRobot(card, color, isOneOfMany) {
    const {context, X, Y, thin} = this.pen, m = card.moment, radius = card.robot.radius_m;
    if (!isOneOfMany) this.drawSurroundings(card);
    if (shown.trail) this.drawTrail(card.history.past(), isOneOfMany ? color : COLOR.trail);
    if (shown.tracks) this.drawTracks(m.tracks || [], radius);
    if (shown.ball && m.ball) {
      context.fillStyle = COLOR.ball;
      this.disc(...m.ball, Math.max(card.robot.field.ball_radius_m, 3 * thin / this.pen.scale));
      context.fill();
    }
    if (shown.candidates) this.drawCandidates(m, radius, color);
    if (m.pose && m.pose.located) this.drawPose(m, radius, color);
    if (shown.truth && m.truth) {
      this.style(COLOR.truth, 1.4, [2, 2]);
      this.robotAt(m.truth, 1.25 * radius, 1.9 * radius);
      context.setLineDash([]);
    }
    if (isOneOfMany) {
      const [x, y] = m.pose && m.pose.located ? m.pose.pose : m.truth || [NaN, NaN];
      context.fillStyle = color;
      context.font = 11 * thin + "px system-ui";
      context.fillText(card.name, X(x + 1.3 * radius) + 2 * thin, Y(y + 1.3 * radius));
    }
  }

  drawSurroundings({moment: m, map}) {
    const {context, X, Y, scale, thin} = this.pen;
    if (shown.map && map && m.map) {
      const [x, y] = m.map.corner_m, [w, h] = m.map.size_m;
      context.imageSmoothingEnabled = false;
      context.drawImage(map, X(x), Y(y + h), w * scale, h * scale);
    }
    if (shown.free && m.free_m && m.free_m.length) {
      this.path(Array.from({length: m.free_m.length / 2}, (_, i) => [m.free_m[2 * i], m.free_m[2 * i + 1]]), true);
      context.fillStyle = COLOR.free + "38";
      context.fill();
      this.style(COLOR.free + "b0", 1);
      context.stroke();
    }
    if (shown.obstacles) {
      for (const [x, y, width, hue] of m.obstacles || []) {
        context.fillStyle = hue === null ? COLOR.obstacles : `hsl(${hue} 90% 55%)`;
        this.disc(x, y, Math.min(Math.max(width / 4, .02), .06));
        context.fill();
      }
    }
  }

  drawTrail(past, color) {
    const {context, X, Y} = this.pen;
    for (const [part, own, dash] of [["pose", color, []], ["truth", COLOR.truth, [1, 3]]]) {
      if (part === "truth" && !shown.truth) continue;
      let last = null;
      context.beginPath();
      for (const {[part]: pose} of past) {
        if (pose) last && Math.hypot(pose[0] - last[0], pose[1] - last[1]) < JUMP_M ? context.lineTo(X(pose[0]), Y(pose[1])) : context.moveTo(X(pose[0]), Y(pose[1]));
        last = pose;
      }
      this.style(own, 1.3, dash);
      context.stroke();
    }
    context.setLineDash([]);
  }

  drawTracks(tracks, radius) {
    const {context, X, Y, scale, thin} = this.pen;
    for (const [x, y, vx, vy, probability, number] of tracks) {
      context.globalAlpha = Math.max(.25, probability);
      this.style(COLOR.tracks, 2);
      context.fillStyle = COLOR.tracks;
      this.disc(x, y, radius);
      context.stroke();
      arrow(context, X(x), Y(y), X(x + vx / 2), Y(y + vy / 2), thin);
      context.font = 11 * thin + "px system-ui";
      context.fillText(number, X(x) + radius * scale + 3, Y(y) - radius * scale);
      context.globalAlpha = 1;
    }
  }

  drawCandidates(m, radius, color) {
    const {context, X, Y, thin} = this.pen;
    // a memory's hypotheses include what this frame allows, and say how probable it is
    const others = (m.hypotheses || m.candidates || []).slice(1);
    for (const pose of others) {
      context.globalAlpha = pose.length > 3 ? Math.max(.35, pose[3]) : .8;
      this.style(color, 2, [4, 3]);
      this.robotAt(pose, radius, 1.5 * radius);
      if (pose.length > 3) {
        context.fillStyle = color;
        context.font = 11 * thin + "px system-ui";
        context.fillText((100 * pose[3]).toFixed(0) + " %", X(pose[0] + 1.2 * radius) + 2 * thin, Y(pose[1] - 1.2 * radius));
      }
    }
    context.globalAlpha = 1;
    context.setLineDash([]);
  }

  drawPose(m, radius, color) {
    const {context, X, Y, scale, thin} = this.pen, pose = m.pose.pose, [a, b, angle] = m.pose.ellipse;
    if (m.way.length) {
      this.path([pose, ...m.way]);
      this.style(WAY, 1.6, [6, 4]);
      context.stroke();
      context.setLineDash([]);
      context.fillStyle = WAY;
      this.disc(...m.way[m.way.length - 1], 3 * thin / scale);
      context.fill();
    }
    this.style(color, 2.2);
    this.robotAt(pose, radius, 1.5 * radius, color + "50");
    context.beginPath();
    context.ellipse(X(pose[0]), Y(pose[1]), Math.max(a * scale, 2 * thin), Math.max(b * scale, 2 * thin), -angle, 0, 2 * Math.PI);
    this.style("#ffffff", 1.2);
    context.stroke();
    if (m.command) {
      const c = Math.cos(pose[2]), s = Math.sin(pose[2]), [f, l] = m.command;
      this.style(WAY, 2.4);
      context.fillStyle = WAY;
      arrow(context, X(pose[0]), Y(pose[1]), X(pose[0] + (c * f - s * l) / 2), Y(pose[1] + (s * f + c * l) / 2), thin);
    }
  }

  // the other robots and the ball of a simulation, and what is being put elsewhere
  drawWorld(cards) {
    const {context, scale, thin} = this.pen, world = this.world(), radius = cards[0].robot.radius_m;
    if (world && shown.truth) {
      const own = new Set(cards.map(card => card.name));
      for (const [name, side, ...pose] of world.robots) {
        if (own.has(name)) continue;
        this.style(SIDES[side], 1.6, [2, 2]);
        this.robotAt(pose, radius, 1.4 * radius);
      }
      context.setLineDash([]);
      this.style(COLOR.truth, 1.4);
      if (world.ball) { this.disc(...world.ball, Math.max(cards[0].robot.field.ball_radius_m, 4 * thin / scale)); context.stroke(); }
    }
    if (!this.grabbed) return;
    const {x, y, theta} = this.grabbed;
    this.style(COLOR.truth, 2.4);
    if (theta === null) { this.disc(x, y, 5 * thin / scale); context.stroke(); }
    else this.robotAt([x, y, theta], radius, 2 * radius, COLOR.truth + "60");
  }
}
