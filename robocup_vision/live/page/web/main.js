// Puts the page together: what the run tells, its controls, and the keys.
import {Card} from "./card.js";
import {$, make, pill, seldom} from "./elements.js";
import {FieldView} from "./field_view.js";
import {makeLegend, shown} from "./layers.js";
import {connect, isOpen, run, send} from "./link.js";

const cards = new Map();
let chosen = null, wanted = openedMoment(), dragging = false;
const together = new FieldView($("together-field"), $("together-where"), () => [...cards.values()]);
const drawTogether = seldom(() => { if (!$("together").hidden) together.draw(); }, 60);
new ResizeObserver(drawTogether).observe($("together"));

function openedMoment() {
  const query = new URLSearchParams(location.search), t = Number(query.get("t"));
  return query.has("recording") ? {recording: query.get("recording"), t_s: Number.isFinite(t) ? Math.max(t, 0) : 0} : null;
}

function tell(message) {
  if (message.type === "hello") hello(message);
  else if (message.type === "status") showStatus(message);
  else if (message.type === "refused") addLine("refused: " + message.reason);
}

function hello(message) {
  run.offers = new Set(message.offers);
  $("record").hidden = !run.offers.has("record");
  $("save").hidden = !run.offers.has("save");
  $("calibration").hidden = !run.offers.has("calibrate");
  const names = new Set(message.robots.map(robot => robot.name));
  for (const [name, card] of cards) if (!names.has(name)) { card.element.remove(); cards.delete(name); }
  for (const robot of message.robots) {
    if (!cards.has(robot.name)) cards.set(robot.name, new Card(robot.name, choose, drawTogether));
    cards.get(robot.name).setup(robot);
  }
  $("robots").classList.toggle("one", cards.size === 1);
  const fields = new Set(message.robots.map(robot => robot.field.name));
  // robots of one match, whatever source each comes from
  $("together").hidden = message.robots.length < 2 || fields.size > 1;
  if (!$("together").hidden) together.setup(message.robots[0].field);
  $("placing").hidden = !run.offers.has("place");
  if (!names.has(chosen)) choose(message.robots.length ? message.robots[0].name : null);
  if (shown.markings) wantMarkings();
  if (wanted && run.offers.has("open")) { send({type: "open", ...wanted}); }
  wanted = null;
}

function choose(name) {
  chosen = name;
  for (const [other, card] of cards) card.element.classList.toggle("chosen", other === name && cards.size > 1);
}

function showStatus(message) {
  run.status = message;
  $("source").textContent = $("source").title = message.source || "";
  document.title = (message.source ? message.source + " – " : "") + "robocup-vision live";
  const still = message.stands_still || message.paused;
  Object.assign(document.body.dataset, {paused: Boolean(message.paused), still: Boolean(message.stands_still), back: message.back_s});
  const state = message.problem ? [message.problem, "bad"] : message.ended ? ["ended", "warn"]
    : message.stands_still && message.back_s > 0 ? [message.back_s.toFixed(1) + " s before the newest", "warn"] : still ? ["paused", "warn"] : ["", "warn"];
  pill($("state"), ...state);
  $("pause").setAttribute("aria-pressed", String(Boolean(still)));
  $("pause").firstChild.textContent = still ? "Go on" : "Pause";
  pill($("recording"), message.recording ? "recording to " + message.recording : "", "bad");
  $("record").setAttribute("aria-pressed", String(Boolean(message.recording)));
  $("record").firstChild.textContent = message.recording ? "Stop recording" : "Record";
  if (!dragging) {
    $("back").value = message.back_s || 0;
    $("back-text").textContent = message.back_s ? "−" + message.back_s.toFixed(1) + " s" : "newest";
  }
  $("seek-label").hidden = !(run.offers.has("seek") && message.duration_s > 0);
  if (message.duration_s > 0) $("seek").max = message.duration_s;
  const lines = message.lines || [];
  $("lines").replaceChildren(...(lines.length ? lines.slice().reverse() : ["none"]).map(text => make("p", text, lines.length ? "" : "soft")));
  showRecordings(message.recordings || [], message.opened);
  if (message.calibration) showCalibration(message.calibration);
}

function addLine(text) {
  $("lines").prepend(make("p", text));
}

function showRecordings(names, opened) {
  $("recordings").hidden = !names.length;
  const list = $("recording-list");
  if (list.dataset.names !== JSON.stringify([names, opened])) {
    list.dataset.names = JSON.stringify([names, opened]);
    list.replaceChildren(...names.map(name => {
      const button = make("button", name);
      button.setAttribute("aria-pressed", String(name === opened));
      button.onclick = () => send({type: "open", recording: name, t_s: 0});
      return button;
    }));
  }
}

function showCalibration(told) {
  $("calibration-text").textContent = told.text;
  $("collect").setAttribute("aria-pressed", String(told.collecting));
  $("collect").firstChild.textContent = told.collecting ? "Stop collecting" : "Collect frames";
  for (const id of ["calibrate-omni", "calibrate-pinhole"]) $(id).disabled = told.busy || !told.frames;
  $("collect").disabled = told.busy;
  $("findings").replaceChildren(...told.findings.map(([subject, state, evidence]) => {
    const line = make("p", undefined, "finding"), word = make("span", state, "pill " + {ok: "good", wrong: "bad"}[state]);
    if (state === "unknown") word.className = "pill warn";
    line.append(word, " ", make("b", subject), ": " + evidence);
    return line;
  }));
}

function receive(moment, jpeg, map) {
  const card = cards.get(moment.robot);
  if (card) card.receive(moment, jpeg, map);
  $("clock").textContent = "t " + moment.t_s.toFixed(2) + " s";
  if (!dragging && run.offers.has("seek")) { $("seek").value = moment.t_s; $("seek-text").textContent = moment.t_s.toFixed(1) + " s"; }
}

function drawAll() {
  for (const card of cards.values()) card.draw();
  drawTogether();
}

// ---- controls ---------------------------------------------------------------------------------------------------
const actions = {
  pause: () => send({type: "pause", on: !(run.status.stands_still || run.status.paused)}),
  step: frames => send({type: "step", frames}),
  back30: () => send({type: "back", seconds: 30}),
  newest: () => send({type: "pause", on: false}),
  record: () => run.offers.has("record") && send({type: "record", on: !run.status.recording}),
  save: () => {
    const card = cards.get(chosen);
    if (run.offers.has("save") && card && card.moment) send({type: "save", robot: chosen, number: card.moment.number});
  },
  collect: () => run.offers.has("calibrate") && run.status.calibration && send({type: "collect", on: !run.status.calibration.collecting}),
  theme: () => setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"),
};
$("pause").onclick = actions.pause;
$("step").onclick = () => actions.step(1);
$("step-back").onclick = () => actions.step(-1);
$("back30").onclick = actions.back30;
$("newest").onclick = actions.newest;
$("record").onclick = actions.record;
$("save").onclick = actions.save;
$("collect").onclick = actions.collect;
$("theme").onclick = actions.theme;
$("calibrate-omni").onclick = () => send({type: "calibrate", kind: "omni"});
$("calibrate-pinhole").onclick = () => send({type: "calibrate", kind: "pinhole"});
for (const id of ["back", "seek"]) {
  $(id).onpointerdown = () => { dragging = true; };
  $(id).onpointerup = $(id).onpointercancel = () => { dragging = false; };
}
$("back").oninput = () => send({type: "back", seconds: Number($("back").value)});
$("seek").onchange = () => { dragging = false; send({type: "seek", t_s: Number($("seek").value)}); };

makeLegend($("legend"), make, name => {
  if (name === "markings") wantMarkings();
  drawAll();
});

function wantMarkings() {
  send({type: "markings", on: shown.markings});
}

const keys = {" ": actions.pause, b: actions.back30, n: actions.newest, r: actions.record, s: actions.save, t: actions.theme, c: actions.collect};
document.addEventListener("keydown", event => {
  if (event.ctrlKey || event.metaKey || event.altKey || (event.target.type === "range" && event.key.startsWith("Arrow"))) return;
  const frames = event.shiftKey ? 10 : 1, key = event.key.toLowerCase();
  if (event.key === "ArrowRight") actions.step(frames);
  else if (event.key === "ArrowLeft") actions.step(-frames);
  else if (/^[0-9]$/.test(key)) document.querySelectorAll("#legend input")[(Number(key) + 9) % 10].click();
  else if (keys[key]) keys[key]();
  else return;
  event.preventDefault();
});

function setTheme(name) {
  document.documentElement.dataset.theme = name;
  try { localStorage.setItem("theme", name); } catch { /* private windows keep nothing */ }
  drawAll();
}
let theme = null;
try { theme = localStorage.getItem("theme"); } catch { /* likewise */ }
setTheme(theme || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
let ticked = performance.now();
setInterval(() => {
  const now = performance.now(), awake = now - ticked < 2000, silent = now - run.heard > 4000;
  ticked = now;
  // a browser that was busy itself has heard nothing either
  if (awake && isOpen()) pill($("link"), silent ? "no answer" : "connected", silent ? "bad" : "good");
}, 1000);
connect(tell, receive, (text, kind) => pill($("link"), text, kind));
