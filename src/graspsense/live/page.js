"use strict";
// The page of live grasps: it shows what comes over the WebSocket, and sends nothing.

const PHASES = ["opening", "taring", "approach", "squeeze", "hold", "release"];
const KINDS = [["effort", "N", 1], ["velocity", "mm/s", 1e3], ["position", "mm", 1e3], ["force", "N", 1]];
const COLOURS = ["--a", "--b", "--c"];
const MOST_EVENTS = 200;
const SPECTRUM = 256; // samples of a column of a spectrogram
const MOST_COLUMNS = 240;
const $ = (id) => document.getElementById(id);

const panels = new Map(); // title to {canvas, curves}
const series = new Map(); // name to Series
const arrays = new Map(); // name to {canvas, text, zero, least, most}
const spectra = new Map(); // name to {canvas, pending, columns}
let marks = [], declared = {}, rate = 0, newest = NaN, stale = true;

function words(name) {
  return name.replaceAll("_", " ");
}

function made(tag, parent, text = "", kind = "") {
  const element = document.createElement(tag);
  element.textContent = text;
  element.className = kind;
  parent.append(element);
  return element;
}

// Gap, force and commands stand first, whatever comes first; further channels of the gripper stand below.
function curve(title, name, label, unit, factor, place = $("curves")) {
  if (series.has(name)) return series.get(name);
  if (!panels.has(title)) {
    const head = made("h2", place, `${words(title)} `);
    const canvas = made("canvas", place);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${words(title)} over time`);
    panels.set(title, {head, canvas, curves: []});
  }
  const panel = panels.get(title), colour = COLOURS[panel.curves.length % COLOURS.length];
  const key = made("span", panel.head, "", "key");
  key.style.color = `var(${colour})`;
  key.textContent = `${label} `;
  const value = made("span", key, "", "value");
  value.dataset.name = name;
  panel.curves.push({series: new Series(), colour, factor, unit, value});
  series.set(name, panel.curves.at(-1).series);
  return series.get(name);
}

function cleared() {
  for (const one of [$("curves"), $("channels"), $("arrays"), $("events"), $("because")]) one.replaceChildren();
  for (const one of [panels, series, arrays, spectra]) one.clear();
  for (const id of ["certainty", "set", "outcome", "phase", "time"]) $(id).textContent = "";
  $("label").textContent = "none yet";
  marks = [];
  newest = NaN;
}

function values(message, name, into) {
  const column = message[name];
  for (let k = 0; k < column.length; k++) into.add(message.t_s[k], column[k]);
}

function has(message, name) {
  return series.has(name) || message[name].some((value) => value !== null);
}

const take = {
  grasp(message) {
    cleared();
    $("device").textContent = message.device;
    declared = Object.fromEntries(message.channels.map((channel) => [channel.name, channel]));
    rate = message.rate_hz;
  },
  ticks(message) {
    newest = message.t_s.at(-1);
    $("phase").textContent = PHASES[message.phase.at(-1)];
    $("time").textContent = `${newest.toFixed(3)} s`;
    if (has(message, "gap_m")) values(message, "gap_m", curve("Gap", "gap_m", "", "mm", 1e3));
    for (const [name, label] of [["force_left_n", "left"], ["force_right_n", "right"]]) {
      if (has(message, name)) values(message, name, curve("Force", name, label, "N", 1));
    }
    if (has(message, "effort_n")) values(message, "effort_n", curve("Effort", "effort_n", "measured", "N", 1));
    const [kind, unit, factor] = KINDS[message.command_kind.at(-1)];
    const title = ["effort", "force"].includes(kind) ? "Effort" : "Command";
    const commanded = curve(title, `command ${kind}`, `commanded ${kind}`, unit, factor);
    for (let k = 0; k < message.t_s.length; k++) {
      if (KINDS[message.command_kind[k]][0] === kind) commanded.add(message.t_s[k], message.command[k]);
    }
  },
  scalars(message) {
    for (const name of Object.keys(message)) {
      if (name === "kind" || name === "t_s") continue;
      const unit = declared[name]?.unit ?? "";
      values(message, name, curve(name, `channel ${name}`, "", unit, 1, $("channels")));
    }
  },
  samples(message) {
    const channel = declared[message.name], unit = channel?.unit ?? "";
    const interval = channel?.rate_hz ? 1 / channel.rate_hz : 0;
    const axes = channel?.axes ?? message.values[0]?.[0]?.map((_, axis) => `${axis}`) ?? [];
    message.values.forEach((rows, k) => rows.forEach((row, i) => row.forEach((value, axis) => {
      const into = curve(message.name, `${message.name} ${axes[axis]}`, axes[axis], unit, 1, $("channels"));
      into.add(message.t_s[k] - (rows.length - 1 - i) * interval, value);
    })));
    spectrum(message, channel);
  },
  image(message) {
    heat(message);
  },
  event(message) {
    if (PHASES.includes(message.what) || message.source === "controller") {
      marks.push({t: message.t_s, text: message.what});
      if (marks.length > MOST_EVENTS) marks.shift();
    }
    const events = $("events");
    made("li", events, `${message.t_s.toFixed(3)} s: ${message.what}`);
    if (events.childElementCount > MOST_EVENTS) events.firstElementChild.remove();
    events.scrollTop = events.scrollHeight;
  },
  prediction(message) {
    $("label").textContent = message.label;
    $("certainty").textContent = message.certainty;
    $("set").textContent = message.set ? `set: ${message.set}` : "";
    $("because").replaceChildren();
    for (const reason of message.because) made("li", $("because"), reason);
  },
  outcome(message) {
    $("outcome").textContent = `outcome: ${message.outcome}${message.reason ? `: ${message.reason}` : ""}`;
  },
  progress(message) {
    $("progress").hidden = false;
    $("done").textContent = message.text;
  },
  stored(message) {
    $("stored").hidden = false;
    $("rows").replaceChildren();
    for (const row of message.rows) {
      const line = made("tr", $("rows"));
      for (const cell of row) made("td", line, cell);
    }
  },
};

function heat(message) {
  const channel = declared[message.name] ?? declared.pads ?? {};
  const parts = channel.components ?? 1, cells = message.cells.length / parts;
  const columns = channel.rows * channel.columns === cells ? channel.columns : Math.ceil(Math.sqrt(cells));
  if (!arrays.has(message.name)) {
    const figure = made("div", $("arrays"));
    const text = made("div", figure);
    const canvas = made("canvas", figure);
    canvas.width = columns;
    canvas.height = Math.ceil(cells / columns);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `image of ${words(message.name)}`);
    arrays.set(message.name, {canvas, text, zero: null, least: Infinity, most: -Infinity});
  }
  const state = arrays.get(message.name), {canvas, text} = state, picture = new ImageData(canvas.width, canvas.height);
  const colours = parts === 3 && channel.dtype === "uint8";
  const sizes = colours ? message.cells : Array.from({length: cells}, (_, k) =>
    parts === 1 ? message.cells[k] : Math.hypot(...message.cells.slice(k * parts, (k + 1) * parts)));
  // Unloaded cells differ, so what is shown is the change since the first image, on the scale of all images so far.
  state.zero ??= channel.dtype === "uint8" ? [] : sizes;
  const changes = sizes.map((size, k) => (typeof size === "number" ? size - (state.zero[k] ?? 0) : NaN));
  for (const change of changes) if (!Number.isNaN(change)) [state.least, state.most] = [Math.min(state.least, change), Math.max(state.most, change)];
  const {least, most} = state;
  for (let k = 0; k < cells; k++) {
    if (colours) picture.data.set([...message.cells.slice(3 * k, 3 * k + 3), 255], 4 * k);
    else if (!Number.isNaN(changes[k])) picture.data.set(shade((changes[k] - least) / (most - least || 1)), 4 * k);
  }
  canvas.getContext("2d").putImageData(picture, 0, 0);
  const shown = (size) => (Number.isFinite(size) ? Number(size.toPrecision(4)).toString() : "-");
  const change = channel.dtype === "uint8" ? "" : "change of ";
  text.textContent = `${words(message.name)}: ${change}${shown(least)} to ${shown(most)} ${channel.unit ?? ""}`;
}

// From dark blue over red to yellow; lighter is more, in light and dark.
function shade(share) {
  const s = Math.min(Math.max(share, 0), 1);
  return [255 * Math.min(1, 1.6 * s), 255 * Math.max(0, 1.7 * s - 0.75), 255 * Math.max(0, 0.45 - Math.abs(s - 0.25)), 255];
}

// A column of the spectrogram for every SPECTRUM samples: the amplitude of all axes at each frequency, in dB.
function spectrum(message, channel) {
  if (!channel) return;
  if (!spectra.has(message.name)) {
    made("h2", $("channels"), `${words(message.name)}: spectrum from 0 (bottom) to ${channel.rate_hz / 2} Hz`);
    const canvas = made("canvas", $("channels"));
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `spectrogram of ${words(message.name)}`);
    [canvas.width, canvas.height] = [MOST_COLUMNS, SPECTRUM / 2];
    spectra.set(message.name, {canvas, pending: [], columns: 0});
  }
  const state = spectra.get(message.name);
  for (const rows of message.values) state.pending.push(...rows);
  while (state.pending.length >= SPECTRUM) {
    const block = state.pending.splice(0, SPECTRUM), power = new Float64Array(SPECTRUM / 2);
    block[0].forEach((_, axis) => {
      fourier(block.map((row) => row[axis] ?? 0)).forEach((one, k) => (power[k] += one));
    });
    const pen = state.canvas.getContext("2d"), column = new ImageData(1, SPECTRUM / 2);
    power.forEach((one, k) => {
      const decibels = 10 * Math.log10(one + 1e-30), high = 10 * Math.log10(Math.max(...power) + 1e-30);
      column.data.set(shade(1 + (decibels - high) / 60), 4 * (SPECTRUM / 2 - 1 - k));
    });
    if (state.columns === MOST_COLUMNS) {
      pen.drawImage(state.canvas, -1, 0);
      state.columns -= 1;
    }
    pen.putImageData(column, state.columns, 0);
    state.columns += 1;
  }
}

// The power at the frequencies below half the rate, of a window without its mean.
function fourier(samples) {
  const n = samples.length, mean = samples.reduce((sum, one) => sum + one, 0) / n;
  const re = samples.map((one, k) => (one - mean) * (0.5 - 0.5 * Math.cos((2 * Math.PI * k) / n)));
  const im = new Array(n).fill(0);
  for (let i = 1, j = 0; i < n; i++) {
    let bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) [re[i], re[j]] = [re[j], re[i]];
  }
  for (let size = 2; size <= n; size *= 2) {
    for (let from = 0; from < n; from += size) {
      for (let k = 0; k < size / 2; k++) {
        const angle = (-2 * Math.PI * k) / size, [c, s] = [Math.cos(angle), Math.sin(angle)];
        const [a, b] = [from + k, from + k + size / 2];
        const [x, y] = [re[b] * c - im[b] * s, re[b] * s + im[b] * c];
        [re[b], im[b], re[a], im[a]] = [re[a] - x, im[a] - y, re[a] + x, im[a] + y];
      }
    }
  }
  return re.slice(0, n / 2).map((one, k) => one * one + im[k] * im[k]);
}

function paint() {
  requestAnimationFrame(paint);
  if (!stale) return;
  stale = false;
  const look = getComputedStyle(document.documentElement), colour = (name) => look.getPropertyValue(name).trim();
  const style = {grid: colour("--line"), text: colour("--soft"), mark: colour("--mark")};
  for (const {canvas, curves} of panels.values()) {
    const starts = curves.filter((one) => one.series.n).map((one) => one.series.time(0));
    const drawn = curves.map((one) => ({...one, colour: colour(one.colour)}));
    draw(canvas, drawn, Math.min(...starts), newest, marks, style);
    for (const one of curves) {
      const value = one.series.last() * one.factor;
      one.value.textContent = `${Number.isNaN(value) ? "-" : value.toFixed(3)} ${one.unit}`;
    }
  }
}

const socket = new WebSocket(`${location.href.replace(/^http/, "ws").replace(/[^/]*$/, "")}frames`);
socket.onopen = () => ($("link").textContent = "connected");
socket.onclose = () => ($("link").textContent = "ended");
socket.onmessage = (event) => {
  for (const message of JSON.parse(event.data)) {
    if (Object.hasOwn(take, message.kind)) take[message.kind](message);
  }
  stale = true;
};
new ResizeObserver(() => (stale = true)).observe(document.body);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => (stale = true));
paint();
