// A recorded match, or a running one, to watch. keepaway_sim.view.page describes the data.

const data = JSON.parse(document.getElementById("data").textContent);
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8, 16];
const ACTIONS = ["holds", "passes to", "gets open", "goes to the ball", "marks"];
const OUTCOMES = ["in play", "taken away", "out of bounds", "aborted"];
const NONE = -32768, PASS = 1, MARK = 4;
const TRAIL = 25; // cycles
const GLANCE = 4; // metres to which the views of players who are not chosen are drawn
const MARGIN = 1.6; // metres around the field
const KNOWN_AGE = 12; // cycles; players forget places of players not seen for longer
const $ = (id) => document.getElementById(id);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

let match = data.match; // null until a live match has said what it is
let episodes = []; // {number, duration, outcome, lostBy, frames: [Int16Array]}
let byNumber = new Map();
const view = {
  episode: -1, // index into episodes
  frame: 0, // with a fraction between two frames
  playing: false,
  speed: 1,
  player: 0, // whose mind is shown; -1: nobody's
  following: false, // a live match's newest moment
  show: { trail: true, cones: true, belief: true, names: true },
};

// --- data ---------------------------------------------------------------------------------------

/** An episode of the list; what it looked like is unpacked when it is watched. */
function addEpisode(entry) {
  const { frames: text, ...rest } = entry;
  const episode = { ...rest, playable: Boolean(text), frames: [] };
  if (text) whenAskedFor(episode, "frames", () => framesOf(text, match.frame_size));
  byNumber.set(episode.number, episodes.length);
  episodes.push(episode);
  return episode;
}

const field = (frame, name, index = 0) => frame[match.layout[name] + index];
const objects = () => match.names.length + 1;
const ballIndex = () => match.names.length;
const isKeeper = (player) => player < match.num_keepers;
const current = () => episodes[view.episode];
const lastFrame = () => Math.max(0, (current()?.frames.length ?? 0) - 1);
const cycleOf = (frame) => cycleNumber(field(frame, "cycle"), field(frame, "cycle_high"));
const seconds = (frame) => cycleOf(frame) * match.cycle_time;

/** Where an object is at the view's moment: [x, y] in metres, between the two frames around it. */
function place(object, observer = -1) {
  const frames = current().frames, i = Math.floor(view.frame), t = view.frame - i;
  const read = (frame) => {
    const name = observer < 0 ? "position" : "believed";
    const at = 2 * (observer < 0 ? object : observer * objects() + object);
    const x = field(frame, name, at), y = field(frame, name, at + 1);
    return x === NONE ? null : [x / 100, y / 100];
  };
  const a = read(frames[i]);
  const b = t > 0 && i + 1 < frames.length ? read(frames[i + 1]) : null;
  if (!a || !b || Math.hypot(a[0] - b[0], a[1] - b[1]) > 4) return a; // a jump is no movement
  return [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
}

function angle(name, player) {
  const frames = current().frames, i = Math.floor(view.frame), t = view.frame - i;
  const a = field(frames[i], name, player) / 1e4;
  if (!(t > 0) || i + 1 >= frames.length) return a;
  let turn = field(frames[i + 1], name, player) / 1e4 - a;
  turn -= 2 * Math.PI * Math.round(turn / (2 * Math.PI));
  return a + t * turn;
}

const nowFrame = () => current().frames[Math.min(Math.floor(view.frame + 1e-6), lastFrame())];

/** What a player does: its request in this cycle, or its last request. */
function doing(frame, player) {
  const asked = field(frame, "requested", player);
  const name = asked >= 0 ? ["requested", "requested_target"] : ["action", "target"];
  return { action: field(frame, name[0], player), target: field(frame, name[1], player), fresh: asked >= 0 };
}

function inWords({ action, target }) {
  const whom = action === PASS || action === MARK ? " " + match.names[target].replace("_", " ") : "";
  return ACTIONS[action] + whom;
}

/** The keepers that a player's action values stand for, as its learner ranked them. */
function rankedKeepers(frame, player) {
  const at = (object) => {
    const spot = 2 * (player * objects() + object);
    return [field(frame, "believed", spot), field(frame, "believed", spot + 1)];
  };
  const places = Array.from({ length: objects() }, (_, object) => at(object));
  return ranked(places, match.num_keepers, player, match.orderings[player]);
}

// --- drawing the field ---------------------------------------------------------------------------

const canvas = $("field"), pen = canvas.getContext("2d");
let scale = 20; // pixels a metre

function layOut() {
  if (!match) return;
  const wide = matchMedia("(min-width: 861px)").matches;
  const room = $("board").clientWidth;
  const below = wide ? $("transport").offsetHeight + 30 : 0;
  const high = wide ? innerHeight - canvas.getBoundingClientRect().top - scrollY - below : innerHeight * 0.7;
  const length = match.field_length + 2 * MARGIN, width = match.field_width + 2 * MARGIN;
  const css = Math.max(8, Math.min(room / length, Math.max(high, 260) / width));
  const ratio = devicePixelRatio || 1;
  canvas.style.width = `${Math.floor(length * css)}px`;
  canvas.style.height = `${Math.floor(width * css)}px`;
  canvas.width = Math.floor(length * css * ratio);
  canvas.height = Math.floor(width * css * ratio);
  scale = css * ratio;
  draw();
  drawCurve();
}

const px = ([x, y]) => [canvas.width / 2 + x * scale, canvas.height / 2 - y * scale];

function disc(at, radius, fill, stroke, lineWidth = 1) {
  const [x, y] = px(at);
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  if (fill) { pen.fillStyle = fill; pen.fill(); }
  if (stroke) { pen.strokeStyle = stroke; pen.lineWidth = lineWidth; pen.stroke(); }
}

function line(from, to, colour, width, dash = []) {
  pen.beginPath();
  pen.moveTo(...px(from));
  pen.lineTo(...px(to));
  pen.setLineDash(dash);
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.stroke();
  pen.setLineDash([]);
}

function drawGrass() {
  pen.fillStyle = css("--grass");
  pen.fillRect(0, 0, canvas.width, canvas.height);
  const [left, top] = px([-match.field_length / 2, match.field_width / 2]);
  const length = match.field_length * scale, width = match.field_width * scale;
  pen.fillStyle = css("--grass-light");
  const stripes = 5;
  for (let k = 0; k < stripes; k += 1)
    if (k % 2 === 0) pen.fillRect(left + (k * length) / stripes, top, length / stripes, width);
  pen.strokeStyle = css("--chalk");
  pen.lineWidth = 0.12 * scale;
  pen.strokeRect(left, top, length, width);
  disc([0, 0], 0.12 * scale, css("--chalk"));
}

function drawView(player, strong) {
  const [x, y] = px(place(player));
  const face = angle("yaw", player) + angle("neck", player);
  pen.save();
  pen.globalAlpha = strong ? 0.26 : 0.16;
  pen.fillStyle = css(isKeeper(player) ? "--keeper" : "--taker");
  pen.beginPath();
  if (match.visible_angle < 2 * Math.PI - 1e-6) {
    pen.moveTo(x, y);
    pen.arc(x, y, (strong ? 60 : GLANCE) * scale, -face - match.visible_angle / 2, -face + match.visible_angle / 2);
    pen.closePath();
    pen.fill();
  }
  pen.restore();
}

function drawTrail() {
  const frames = current().frames, last = Math.floor(view.frame);
  const at = (k) => [field(frames[k], "position", 2 * ballIndex()) / 100, field(frames[k], "position", 2 * ballIndex() + 1) / 100];
  for (let k = Math.max(1, last - TRAIL); k <= last; k += 1) {
    pen.globalAlpha = 0.75 * (1 - (last - k) / (TRAIL + 1));
    line(at(k - 1), at(k), css("--ball"), 0.14 * scale);
  }
  pen.globalAlpha = 0.75;
  line(at(last), place(ballIndex()), css("--ball"), 0.14 * scale);
  pen.globalAlpha = 1;
}

function drawIntent(player) {
  const { action, target } = doing(nowFrame(), player);
  if (action !== PASS && action !== MARK) return;
  const dash = action === PASS ? [0.5 * scale, 0.3 * scale] : [0.12 * scale, 0.25 * scale];
  line(place(player), place(target), css(isKeeper(player) ? "--keeper" : "--taker"), 0.1 * scale, dash);
}

const radius = () => Math.max(0.3 * scale, 0.016 * Math.min(canvas.width, canvas.height));

function drawPlayer(player) {
  const at = place(player), [x, y] = px(at), r = radius();
  const colour = css(isKeeper(player) ? "--keeper" : "--taker");
  const body = angle("yaw", player), face = body + angle("neck", player);
  const spoke = (direction, from, to, style, width) => {
    pen.beginPath();
    pen.moveTo(x + from * r * Math.cos(direction), y - from * r * Math.sin(direction));
    pen.lineTo(x + to * r * Math.cos(direction), y - to * r * Math.sin(direction));
    pen.strokeStyle = style;
    pen.lineWidth = width * r;
    pen.stroke();
  };
  spoke(face, 0, 1.75, colour, 0.3);
  disc(at, r, colour, player === view.player ? css("--focus") : "#10201a", player === view.player ? 0.35 * r : 0.16 * r);
  spoke(body, 0.35, 0.95, "#10201a", 0.24);
  if (!view.show.names) return;
  pen.font = `600 ${Math.round(1.25 * r)}px system-ui, sans-serif`;
  pen.textAlign = "center";
  pen.textBaseline = "top";
  pen.lineWidth = 0.3 * r;
  pen.strokeStyle = css("--grass");
  pen.fillStyle = "#fff";
  const label = (isKeeper(player) ? "K" : "T") + match.names[player].split("_").pop();
  pen.strokeText(label, x, y + 1.35 * r);
  pen.fillText(label, x, y + 1.35 * r);
}

/** What the chosen player believes: hollow where it thinks the others are, tied to where they are. */
function drawBelief() {
  const frame = nowFrame(), r = radius(), me = view.player;
  for (let object = 0; object < objects(); object += 1) {
    if (object === me) continue;
    const age = field(frame, "age", me * objects() + object);
    const thought = place(object, me);
    if (!thought || age > 1000) continue;
    const colour = object === ballIndex() ? css("--ball") : css(isKeeper(object) ? "--keeper" : "--taker");
    pen.globalAlpha = age > KNOWN_AGE ? 0.35 : 1 - 0.04 * age;
    line(place(object), thought, colour, 0.05 * scale, [0.12 * scale, 0.12 * scale]);
    disc(thought, object === ballIndex() ? 0.75 * r : 1.05 * r, null, colour, 0.22 * r);
    if (age > 1) { // everybody's last look is up to a cycle old
      const [x, y] = px(thought);
      pen.font = `${Math.round(1.05 * r)}px system-ui, sans-serif`;
      pen.textAlign = "left";
      pen.textBaseline = "bottom";
      pen.fillStyle = "#fff";
      pen.fillText(`${(age * match.cycle_time).toFixed(1)} s`, x + r, y - 0.6 * r);
    }
    pen.globalAlpha = 1;
  }
}

function drawBall() {
  disc(place(ballIndex()), Math.max(0.16 * scale, 0.55 * radius()), css("--ball"), "#10201a", 0.15 * radius());
}

function draw() {
  if (!match) return;
  drawGrass();
  if (!current()?.frames.length) return;
  const players = match.names.map((_, player) => player);
  if (view.show.cones) players.forEach((player) => drawView(player, player === view.player));
  players.forEach(drawIntent);
  if (view.show.trail) drawTrail();
  players.forEach(drawPlayer);
  if (view.show.belief && view.player >= 0) drawBelief();
  drawBall();
  tell();
}

// --- telling in words ----------------------------------------------------------------------------

function tell() {
  const episode = current(), frame = nowFrame(), main = $("view");
  const end = episode.frames[episode.frames.length - 1];
  $("clock").textContent = `${seconds(frame).toFixed(1)} / ${seconds(end).toFixed(1)} s`;
  $("scrub").max = lastFrame();
  $("scrub").value = view.frame;
  main.dataset.episode = episode.number;
  main.dataset.cycle = cycleOf(frame);
  main.dataset.playing = view.playing;
  const outcome = field(frame, "outcome");
  $("banner").hidden = !outcome;
  $("banner").textContent = `Episode ${episode.number}: ${OUTCOMES[outcome]} after ${seconds(frame).toFixed(1)} s`;
  const descriptions = match.names.map((name, player) => `${name.replace("_", " ")} ${inWords(doing(frame, player))}`);
  canvas.setAttribute("aria-label", `Episode ${episode.number}, ${seconds(frame).toFixed(1)} s: ${descriptions.join("; ")}`);
  descriptions.forEach((_, player) => { $("players").children[player].lastChild.textContent = shortAction(frame, player); });
  tellMind(frame);
}

function shortAction(frame, player) {
  const { action, target } = doing(frame, player);
  const whom = (action === PASS || action === MARK) ? " " + nick(target) : "";
  return ["hold", "pass", "open", "to ball", "mark"][action] + whom;
}

const nick = (player) => (isKeeper(player) ? "K" : "T") + match.names[player].split("_").pop();

let shownMind = null;
function tellMind(frame) {
  const key = `${view.player} ${current().number} ${cycleOf(frame)}`;
  if (key === shownMind) return;
  shownMind = key;
  const mind = $("mind"), me = view.player;
  mind.replaceChildren();
  if (me < 0) {
    mind.append(paragraph("Choose a player to see what it knows, what it wants and what it expects."));
    return;
  }
  const asked = doing(frame, me);
  mind.append(paragraph(`${match.names[me].replace("_", " ")} ${inWords(asked)}${asked.fresh ? "" : " (as before)"}.`));
  const chose = lastChoice(me);
  if (chose) tellValues(chose, me, seconds(frame) - seconds(chose));
  else mind.append(paragraph(`No learner has chosen for it yet${isKeeper(me) ? "; without the ball a keeper has no choice" : ""}.`, "quiet"));
  const off = objectsOff(frame, me);
  if (off) mind.append(paragraph(off, "quiet"));
}

/** The latest frame up to now in which a player's learner chose; null if there is none. */
function lastChoice(me) {
  const { frames } = current();
  let k = Math.min(Math.floor(view.frame + 1e-6), lastFrame());
  while (k >= 0 && field(frames[k], "values", me * match.num_keepers) === NONE) k -= 1;
  return frames[k] ?? null;
}

/** The learner's values as bars, the one that was chosen marked; pale if that was some seconds ago. */
function tellValues(frame, me, ago) {
  const asked = doing(frame, me), values = [];
  for (let k = 0; k < match.num_keepers; k += 1) values.push(field(frame, "values", me * match.num_keepers + k));
  const ranked = rankedKeepers(frame, me);
  const names = isKeeper(me)
    ? ["hold", ...ranked.map((k) => `pass to ${nick(k)}`)]
    : ["go to the ball", ...ranked.map((k) => `mark ${nick(k)}`)];
  const chosen = asked.action === PASS || asked.action === MARK ? 1 + ranked.indexOf(asked.target) : 0;
  const known = values.filter((value) => value !== NONE);
  const low = Math.min(0, ...known), high = Math.max(...known, low + 1);
  values.forEach((value, k) => {
    if (value === NONE || k >= names.length) return;
    const row = document.createElement("div"), bar = document.createElement("i"), number = document.createElement("b");
    row.className = "value" + (asked.fresh && k === chosen ? " chosen" : "") + (ago > 0 ? " past" : "");
    bar.style.width = `${Math.max(2, (100 * (value - low)) / (high - low))}%`;
    number.textContent = `${((value / 10) * match.cycle_time).toFixed(1)} s`;
    row.append(names[k], bar, number);
    $("mind").append(row);
  });
  const when = ago > 0 ? `expected of each choice when it last chose, ${ago.toFixed(1)} s ago` : "expects of each choice now";
  $("mind").append(paragraph(`What the learner ${when}.`, "quiet"));
}

/** How far the player's idea of the others is off. */
function objectsOff(frame, me) {
  let worst = 0, who = -1, unknown = 0;
  for (let object = 0; object < objects(); object += 1) {
    const at = 2 * (me * objects() + object), age = field(frame, "age", me * objects() + object);
    if (object === me || field(frame, "believed", at) === NONE) continue;
    if (age > KNOWN_AGE && object !== ballIndex()) { unknown += 1; continue; }
    const off = Math.hypot(
      field(frame, "believed", at) - field(frame, "position", 2 * object),
      field(frame, "believed", at + 1) - field(frame, "position", 2 * object + 1)) / 100;
    if (off > worst) [worst, who] = [off, object];
  }
  if (who < 0) return unknown ? "It has lost sight of everybody." : "";
  const name = who === ballIndex() ? "the ball" : nick(who);
  const lost = unknown ? ` It has lost sight of ${unknown} of the players.` : "";
  const where = `It believes ${name} ${worst.toFixed(1)} m from the true place, and the others nearer to theirs`;
  return `${where} (hollow circles: where it believes them).${lost}`;
}

function paragraph(text, kind = "") {
  const made = document.createElement("p");
  made.textContent = text;
  if (kind) made.style.color = `var(--${kind})`;
  return made;
}

// --- episodes: list and learning curve -------------------------------------------------------------

const ROW = 1.75; // rem; rows of the list are all alike, so only those in sight exist

function drawList() {
  const list = $("episodes"), rem = parseFloat(getComputedStyle(document.documentElement).fontSize);
  const high = ROW * rem, first = Math.max(0, Math.floor(list.scrollTop / high) - 3);
  const last = Math.min(episodes.length, first + Math.ceil(list.clientHeight / high) + 8);
  let inner = list.firstChild;
  if (!inner) { inner = document.createElement("div"); inner.style.position = "relative"; list.append(inner); }
  inner.style.height = `${episodes.length * high}px`;
  inner.replaceChildren();
  for (let k = first; k < last; k += 1) inner.append(listRow(k, k * high, high));
}

function listRow(k, top, high) {
  const episode = episodes[k], row = document.createElement("div");
  row.className = "episode";
  row.role = "option";
  row.dataset.number = episode.number;
  row.style.cssText = `position:absolute;left:0;right:0;top:${top}px;height:${high}px`;
  row.setAttribute("aria-selected", k === view.episode);
  row.setAttribute("aria-disabled", !episode.playable);
  const off = { 1: " from ", 2: " off " }[episode.outcome];
  const lost = off && episode.lostBy >= 0 ? off + nick(episode.lostBy) : "";
  const cells = [`#${episode.number}`, `${episode.duration.toFixed(1)} s`, OUTCOMES[episode.outcome] + lost];
  cells.forEach((text) => { const cell = document.createElement("span"); cell.textContent = text; row.append(cell); });
  if (!episode.playable) row.title = "not in this page: choose it with view.py --episodes";
  row.onclick = () => select(k);
  return row;
}

function drawCurve() {
  const board = $("curve"), ratio = devicePixelRatio || 1, ink = board.getContext("2d");
  board.width = board.clientWidth * ratio;
  board.height = board.clientHeight * ratio;
  const finished = episodes.filter((episode) => episode.outcome);
  ink.clearRect(0, 0, board.width, board.height);
  if (!finished.length) return;
  const rem = parseFloat(getComputedStyle(document.documentElement).fontSize) * ratio;
  const left = 2.1 * rem, bottom = board.height - 1.3 * rem, top = 0.4 * rem;
  const durations = finished.map((episode) => episode.duration);
  const high = chartTop(durations);
  const x = (k) => left + ((k + 0.5) / finished.length) * (board.width - left - 0.4 * rem);
  const y = (value) => bottom - (Math.min(value, high) / high) * (bottom - top);
  curveAxes(ink, { left, bottom, rem, high, y, width: board.width, finished });
  const size = Math.max(1.2, Math.min(0.22 * rem, (0.3 * board.width) / finished.length)) ;
  finished.forEach((episode, k) => {
    ink.globalAlpha = finished.length > 300 ? 0.35 : 0.8;
    ink.fillStyle = css(episode.outcome === 2 ? "--out" : "--taken");
    ink.beginPath();
    ink.arc(x(k), y(episode.duration), size, 0, 7);
    ink.fill();
  });
  ink.globalAlpha = 1;
  const window = Math.max(1, Math.min(100, Math.ceil(finished.length / 10)));
  ink.beginPath();
  movingMean(durations, window).forEach((value, k) => ink.lineTo(x(k), y(value)));
  ink.strokeStyle = css("--accent");
  ink.lineWidth = 0.14 * rem;
  ink.stroke();
  const here = finished.indexOf(current());
  if (here >= 0) {
    ink.strokeStyle = css("--focus");
    ink.lineWidth = 0.09 * rem;
    ink.strokeRect(x(here) - 0.25 * rem, y(durations[here]) - 0.25 * rem, 0.5 * rem, 0.5 * rem);
  }
  const mean = durations.reduce((a, b) => a + b, 0) / durations.length;
  const out = finished.filter((episode) => episode.outcome === 2).length / finished.length;
  $("window").textContent = `mean of ${window}`;
  $("summary").textContent = `${finished.length}, mean ${mean.toFixed(1)} s, ${Math.round(100 * out)} % out of bounds`;
  board.setAttribute("aria-label",
    `Durations of ${finished.length} episodes: mean ${mean.toFixed(1)} s; line: mean of the last ${window}`);
  board.onclick = (event) => {
    const at = (event.offsetX * ratio - left) / (board.width - left - 0.4 * rem);
    selectNearest(finished[Math.max(0, Math.min(finished.length - 1, Math.floor(at * finished.length)))]);
  };
}

function curveAxes(ink, { left, bottom, rem, high, y, width, finished }) {
  ink.font = `${0.72 * rem}px system-ui, sans-serif`;
  ink.fillStyle = css("--quiet");
  ink.strokeStyle = css("--line");
  ink.lineWidth = Math.max(1, rem / 16);
  const step = [1, 2, 5, 10, 20, 50, 100].find((each) => high / each <= 5) ?? 200;
  ink.textAlign = "right";
  ink.textBaseline = "middle";
  for (let value = 0; value <= high; value += step) {
    ink.fillText(`${value} s`, left - 0.3 * rem, y(value));
    ink.beginPath();
    ink.moveTo(left, y(value));
    ink.lineTo(width, y(value));
    ink.stroke();
  }
  ink.textAlign = "left";
  ink.textBaseline = "alphabetic";
  ink.fillText(`episode ${finished[0].number}`, left, bottom + 1.05 * rem);
  ink.textAlign = "right";
  ink.fillText(String(finished[finished.length - 1].number), width - 0.3 * rem, bottom + 1.05 * rem);
}

/** Select the playable episode nearest to one that may not be in the page. */
function selectNearest(episode) {
  const at = byNumber.get(episode.number);
  const near = episodes.map((_, k) => k).filter((k) => episodes[k].playable);
  near.sort((a, b) => Math.abs(a - at) - Math.abs(b - at));
  if (near.length) select(near[0]);
}

// --- moving about ----------------------------------------------------------------------------------

function select(k, frame = 0) {
  if (!episodes[k]?.playable) return;
  view.episode = k;
  view.frame = frame;
  view.following = false;
  shownMind = null;
  reveal();
  refresh();
}

/** Scroll the list, and nothing else, to the selected episode. */
function reveal() {
  const list = $("episodes"), rem = parseFloat(getComputedStyle(document.documentElement).fontSize);
  const top = view.episode * ROW * rem;
  if (top < list.scrollTop || top + ROW * rem > list.scrollTop + list.clientHeight)
    list.scrollTop = Math.max(0, top - list.clientHeight / 2);
}

function selectNeighbour(direction) {
  for (let k = view.episode + direction; k >= 0 && k < episodes.length; k += direction)
    if (episodes[k].playable) return select(k);
  return undefined;
}

function seek(frame) {
  view.frame = Math.max(0, Math.min(lastFrame(), frame));
  view.following = false;
  showPlay();
  draw();
}

function setPlaying(playing) {
  if (playing && view.frame >= lastFrame()) view.frame = 0;
  view.playing = playing;
  view.following = false;
  showPlay();
  if (playing) requestAnimationFrame(advance);
  draw();
}

function showPlay() {
  $("play").querySelector("path").setAttribute("d", view.playing ? "M3 3h4v10H3zM9 3h4v10H9z" : "M4 2l10 6-10 6z");
  $("play").setAttribute("aria-label", view.playing ? "Pause" : "Play");
  $("live").setAttribute("aria-pressed", view.following);
}

let lastTime = null;
function advance(time) {
  if (!view.playing) { lastTime = null; return; }
  if (lastTime !== null && current()) step(((time - lastTime) / 1000) * view.speed / match.cycle_time);
  lastTime = time;
  requestAnimationFrame(advance);
}

/** Advance by a number of cycles; at an episode's end wait a moment, then play the next one. */
let waited = 0;
function step(cycles) {
  if (view.frame < lastFrame()) {
    view.frame = Math.min(lastFrame(), view.frame + cycles);
    waited = 0;
  } else {
    waited += cycles;
    const next = episodes.findIndex((episode, k) => k > view.episode && episode.playable);
    if (next < 0) { if (!data.live) setPlaying(false); return; }
    if (waited > 10 * view.speed) { waited = 0; select(next); }
  }
  draw();
}

function choosePlayer(player) {
  if (!match || player >= match.names.length) return;
  view.player = player;
  shownMind = null;
  [...$("players").children].forEach((button, k) => button.setAttribute("aria-checked", k === player));
  draw();
  if (player < 0) $("mind").replaceChildren(paragraph("Choose a player to see what it knows and wants."));
}

function toggle(name) {
  const box = document.querySelector(`[data-show=${name}]`);
  box.checked = !box.checked;
  box.onchange();
}

function changeSpeed(direction) {
  const at = Math.max(0, Math.min(SPEEDS.length - 1, SPEEDS.indexOf(view.speed) + direction));
  view.speed = SPEEDS[at];
  $("speed").value = view.speed;
}

function wholeScreen() {
  if (document.fullscreenElement) document.exitFullscreen();
  else document.documentElement.requestFullscreen?.();
}

/** Dark where it was light, and the other way round; before, it is as the system has it. */
function changeTheme() {
  const { dataset } = document.documentElement;
  const isDark = dataset.theme ? dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  dataset.theme = isDark ? "light" : "dark";
  refresh();
}

const KEYS = {
  " ": () => setPlaying(!view.playing),
  ArrowLeft: (shift) => seek(Math.ceil(view.frame - 1e-6) - (shift ? 10 : 1)),
  ArrowRight: (shift) => seek(Math.floor(view.frame + 1e-6) + (shift ? 10 : 1)),
  ArrowUp: () => selectNeighbour(-1),
  ArrowDown: () => selectNeighbour(1),
  Home: () => seek(0),
  End: () => seek(lastFrame()),
  "+": () => changeSpeed(1),
  "=": () => changeSpeed(1),
  "-": () => changeSpeed(-1),
  t: () => toggle("trail"),
  v: () => toggle("cones"),
  b: () => toggle("belief"),
  n: () => toggle("names"),
  d: changeTheme,
  f: wholeScreen,
  "?": () => $("help").click(),
  ...Object.fromEntries([...Array(10).keys()].map((k) => [String(k), () => choosePlayer(k - 1)])),
};

function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
  const act = KEYS[event.key];
  if (!act) return;
  if (event.key === " " && event.target.tagName === "BUTTON" && event.target.id !== "play") return;
  event.preventDefault();
  act(event.shiftKey);
}

/** A click on the field chooses the player that is nearest, if one is near. */
function onFieldClick(event) {
  if (!current()) return;
  const ratio = canvas.width / canvas.clientWidth;
  const far = (player) => {
    const [x, y] = px(place(player));
    return Math.hypot(x - event.offsetX * ratio, y - event.offsetY * ratio);
  };
  const players = match.names.map((_, player) => player).sort((a, b) => far(a) - far(b));
  choosePlayer(far(players[0]) < 3 * radius() ? players[0] : -1);
}

// --- beginning ---------------------------------------------------------------------------------------

function refresh() {
  drawList();
  drawCurve();
  draw();
  showPlay();
}

function describe() {
  const kind = data.live ? "live" : `${episodes.length} episodes`;
  $("title").textContent = `Keepaway ${match.task}, ${kind}`;
  $("facts").textContent = match.facts.join(" · ");
  $("players").replaceChildren(...match.names.map((name, player) => {
    const button = document.createElement("button");
    button.role = "radio";
    button.style.setProperty("--team", `var(${isKeeper(player) ? "--keeper" : "--taker"})`);
    button.append(`${nick(player)} `, document.createElement("small"));
    button.title = name;
    button.onclick = () => choosePlayer(view.player === player ? -1 : player);
    return button;
  }));
}

function connect() {
  $("back").onclick = () => KEYS.ArrowLeft(false);
  $("forward").onclick = () => KEYS.ArrowRight(false);
  $("previous").onclick = () => selectNeighbour(-1);
  $("next").onclick = () => selectNeighbour(1);
  $("play").onclick = () => setPlaying(!view.playing);
  $("scrub").oninput = () => seek(Number($("scrub").value));
  $("whole").onclick = wholeScreen;
  $("theme").onclick = changeTheme;
  $("help").onclick = () => {
    $("keys").hidden = !$("keys").hidden;
    $("help").setAttribute("aria-expanded", !$("keys").hidden);
  };
  $("speed").append(...SPEEDS.map((speed) => new Option(`× ${speed}`, speed)));
  $("speed").value = view.speed;
  $("speed").onchange = () => { view.speed = Number($("speed").value); };
  document.querySelectorAll("[data-show]").forEach((box) => {
    box.onchange = () => { view.show[box.dataset.show] = box.checked; draw(); };
  });
  $("episodes").onscroll = drawList;
  canvas.onclick = onFieldClick;
  document.addEventListener("keydown", onKey);
  addEventListener("resize", layOut);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", refresh);
}

function begin() {
  if (!match) return;
  data.episodes.forEach(addEpisode);
  describe();
  choosePlayer(0);
  const first = episodes.findIndex((episode) => episode.playable);
  if (first >= 0) select(first);
  layOut();
  drawList();
}

// --- a match that is on ------------------------------------------------------------------------------

const KEPT = 200; // episodes that can be gone back to

function onMatch(said) {
  match = said;
  episodes = [];
  byNumber = new Map();
  Object.assign(view, { episode: -1, frame: 0, following: true });
  data.episodes = [];
  begin();
  view.following = true;
  showPlay();
}

function onFrame(number, text) {
  let at = byNumber.get(number);
  if (at === undefined) {
    addEpisode({ number, duration: 0, outcome: 0, lostBy: -1 });
    at = episodes.length - 1;
    if (episodes.length > KEPT) Object.assign(episodes[episodes.length - KEPT - 1], { frames: [], playable: false });
  }
  const episode = episodes[at];
  episode.frames.push(decode(text));
  episode.playable = true;
  episode.duration = Math.max(episode.duration, seconds(episode.frames[episode.frames.length - 1]));
  if (!view.following) return;
  const isNew = view.episode !== at;
  view.episode = at;
  view.frame = lastFrame();
  if (isNew) { reveal(); drawList(); }
  draw();
}

function onEpisode(said) {
  const at = byNumber.get(said.number);
  if (at === undefined) addEpisode(said);
  else Object.assign(episodes[at], said);
  drawList();
  drawCurve();
}

function listen() {
  $("live").hidden = false;
  $("live").onclick = () => {
    setPlaying(false);
    view.following = true;
    view.episode = episodes.length - 1;
    view.frame = lastFrame();
    showPlay();
    reveal();
    refresh();
  };
  $("title").textContent = "Keepaway, live: waiting for a match";
  const source = new EventSource("events");
  source.addEventListener("match", (event) => onMatch(JSON.parse(event.data)));
  source.addEventListener("episode", (event) => onEpisode(JSON.parse(event.data)));
  source.addEventListener("frame", (event) => {
    const [number, text] = JSON.parse(event.data);
    if (match) onFrame(number, text);
  });
  source.onerror = () => { $("facts").textContent = "no connection to the match"; };
  source.onopen = () => { if (match) $("facts").textContent = match.facts.join(" · "); };
}

connect();
begin();
if (data.live) listen();
