// One robot: its frame, the field, plots and figures.
import {$, make, pill, seldom, signed} from "./elements.js";
import {FieldView} from "./field_view.js";
import {ImageView} from "./image_view.js";
import {send} from "./link.js";
import {History, Plots} from "./plots.js";

const PICTURE = part => '<div class="picture"><canvas data-part="' + part + '"></canvas><output class="where" data-upon data-part="' + part + '-where"></output></div>';

export class Card {
  constructor(name, choose, drawn) {
    this.drawn = drawn;
    this.element = make("article", undefined, "card");
    this.element.dataset.robot = name;
    this.element.innerHTML = '<header><h2></h2><span class="pill" data-part="located"></span><span class="pose"></span><span class="space"></span>' +
      '<span class="soft" data-part="rate"></span></header><div class="reason"></div>' +
      '<div class="pictures">' + PICTURE("image") + PICTURE("field") + '</div><div class="plots"></div>' +
      '<div class="facts"><section><h3>Stage times</h3><div class="bars"></div></section>' +
      '<section><h3>Colours in use</h3><div class="swatches"></div></section>' +
      '<section><h3>Command and reasons</h3><ul></ul></section><section><h3>This frame</h3><ul data-part="frame"></ul></section></div>';
    this.element.querySelector("h2").textContent = name;
    this.element.onclick = () => choose(name);
    this.part = part => this.element.querySelector('[data-part="' + part + '"]');
    this.name = name;
    this.times = {};
    this.history = new History();
    this.plots = new Plots(this.element.querySelector(".plots"));
    this.image = new ImageView(this.part("image"), this.part("image-where"), this);
    this.field = new FieldView(this.part("field"), this.part("field-where"), () => [this]);
    this.drawPlots = seldom(() => this.plots.draw(this.history), 250);
    $("robots").append(this.element);
    new ResizeObserver(() => this.draw()).observe(this.element);
  }

  setup(robot) {
    this.robot = robot;
    this.field.setup(robot.field);
    this.moment = null;
    this.history = new History();
    this.draw();
  }

  async receive(moment, jpeg, png) {
    this.next = [moment, jpeg, png];
    if (this.busy) return;
    this.busy = true;
    while (this.next) {
      const [now, picture, map] = this.next;
      this.next = null;
      try {
        const bitmap = await createImageBitmap(new Blob([picture], {type: "image/jpeg"}));
        const mapBitmap = map.byteLength ? await createImageBitmap(new Blob([map], {type: "image/png"})) : null;
        await new Promise(requestAnimationFrame);
        if (this.bitmap) this.bitmap.close();
        if (this.map) this.map.close();
        [this.bitmap, this.map, this.moment] = [bitmap, mapBitmap, now];
        this.history.add(now);
        this.draw();
        this.tell();
        this.drawn();
      } finally {
        send({type: "drawn", robot: this.name, number: now.number});
      }
    }
    this.busy = false;
  }

  tell() {
    const m = this.moment, known = m.pose, at = this.element.dataset;
    at.number = m.number;
    at.t = m.t_s;
    at.x = at.y = at.theta = at.truth = "";
    if (m.truth) at.truth = JSON.stringify(m.truth);
    const located = known && known.located;
    pill(this.part("located"), !m.timings_ms ? "not looked at" : located ? "located" : "not located", located ? "good" : "bad");
    const pose = this.element.querySelector(".pose");
    if (located) {
      const [x, y, theta] = known.pose, [sx, sy, st] = known.std, sign = value => (value < 0 ? "−" : "+") + Math.abs(value).toFixed(3);
      [at.x, at.y, at.theta] = [x, y, theta];
      pose.innerHTML = "<b></b> <small></small>";
      pose.firstChild.textContent = "x " + sign(x) + " m   y " + sign(y) + " m   θ " + (theta * 180 / Math.PI).toFixed(1) + "°";
      pose.lastChild.textContent = "± " + (sx * 1000).toFixed(1) + " mm, " + (sy * 1000).toFixed(1) + " mm, " + (st * 180 / Math.PI).toFixed(2) + "°" + (m.from_memory ? " (memory)" : "");
    } else pose.textContent = "";
    const frame = m.frame_pose;
    this.element.querySelector(".reason").textContent = m.problem || (known && !located ? known.reason : "") ||
      (m.from_memory && frame && !frame.located ? "this frame: " + frame.reason : "");
    this.part("rate").textContent = [m.rate_hz ? m.rate_hz.toFixed(1) + " frames/s" : "", m.dropped ? m.dropped + " not shown" : "", "t " + m.t_s.toFixed(2) + " s"].filter(Boolean).join(" · ");
    this.tellTimes(m.timings_ms || {});
    this.element.querySelector(".swatches").replaceChildren(...(m.colors.length ? m.colors.map(([name, color]) => {
      const label = make("span", name.replaceAll("_", " ").replace("positive ", "+").replace("negative ", "−")), dot = make("i");
      dot.style.background = color;
      label.prepend(dot);
      return label;
    }) : [make("span", "none", "soft")]));
    const command = m.command ? ["ahead " + signed(m.command[0]) + " m/s, left " + signed(m.command[1]) + " m/s, turn " + signed(m.command[2]) + " rad/s"] : ["no command"];
    this.element.querySelector("ul").replaceChildren(...[...command, ...m.reasons].map(text => make("li", text)));
    const facts = [];
    if (frame && frame.located) facts.push((100 * frame.inlier_ratio).toFixed(0) + " % agree, residual " + frame.residual_px.toFixed(2) + " px",
      m.candidates.length + (m.candidates.length === 1 ? " candidate" : " candidates"));
    else if (frame) facts.push("not located: " + frame.reason);
    for (const [name, value] of Object.entries(m.settings)) facts.push(name + ": " + value);
    facts.push(m.size_px.join(" × ") + " px");
    this.part("frame").replaceChildren(...facts.map(text => make("li", text)));
  }

  tellTimes(times) {
    // smoothed, so that the figures can be read
    for (const name of Object.keys(this.times)) if (!(name in times)) delete this.times[name];
    for (const [name, ms] of Object.entries(times)) this.times[name] = name in this.times ? 0.9 * this.times[name] + 0.1 * ms : ms;
    const longest = Math.max(this.times.total || 0, ...Object.values(this.times), 1e-6);
    const rows = Object.entries(this.times).sort(([a], [b]) => (a === "total") - (b === "total"));
    this.element.querySelector(".bars").replaceChildren(...(rows.length ? rows : []).flatMap(([name, ms]) => {
      const bar = make("i");
      bar.style.width = 100 * ms / longest + "%";
      if (name === "total") bar.style.background = "var(--soft)";
      const box = make("div");
      box.append(bar);
      bar.style.display = "block";
      return [make("span", name.replaceAll("_", " ")), box, make("span", ms.toFixed(2) + " ms")];
    }));
  }

  draw() {
    if (!this.robot) return;
    this.image.draw();
    this.field.draw();
    this.drawPlots();
  }
}
