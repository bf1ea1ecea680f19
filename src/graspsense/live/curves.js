"use strict";
// Numbers over time, kept in a ring, and their drawing on a canvas.

const KEPT = 30000; // points of a curve: 30 s at 1 kHz

class Series {
  constructor() {
    this.t = new Float64Array(KEPT);
    this.v = new Float64Array(KEPT);
    this.clear();
  }
  clear() {
    this.n = this.next = 0;
  }
  add(t, v) {
    this.t[this.next] = t;
    this.v[this.next] = v === null || typeof v === "string" ? NaN : v;
    this.next = (this.next + 1) % KEPT;
    this.n = Math.min(this.n + 1, KEPT);
  }
  index(k) {
    return (this.next - this.n + k + KEPT) % KEPT;
  }
  time(k) {
    return this.t[this.index(k)];
  }
  value(k) {
    return this.v[this.index(k)];
  }
  last() {
    return this.n ? this.value(this.n - 1) : NaN;
  }
}

// A round step so that about `count` of them fill the range.
function step(range, count) {
  const raw = range / count, power = 10 ** Math.floor(Math.log10(raw));
  return power * [1, 2, 5, 10].find((one) => power * one >= raw * 0.999);
}

// The least and the greatest value of each pixel column, so that no peak is lost: [x, least, greatest] in order.
function columns(series, from, to, width) {
  const found = [];
  let last = null;
  for (let k = 0; k < series.n; k++) {
    const t = series.time(k), v = series.value(k);
    if (t < from || t > to) continue;
    if (Number.isNaN(v)) {
      last = null;
      continue;
    }
    const x = Math.round(((t - from) / (to - from)) * width);
    if (last !== null && last[0] === x) {
      last[1] = Math.min(last[1], v);
      last[2] = Math.max(last[2], v);
      last[4] = v;
    } else {
      last = [x, v, v, v, v, last === null];
      found.push(last);
    }
  }
  return found;
}

// Draw curves [{series, factor, colour}] between two times, with marks [{t, text}].
function draw(canvas, curves, from, to, marks, style) {
  const scale = window.devicePixelRatio || 1, wide = canvas.clientWidth, high = canvas.clientHeight;
  if (canvas.width !== wide * scale || canvas.height !== high * scale) {
    canvas.width = wide * scale;
    canvas.height = high * scale;
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, wide, high);
  const left = 46, top = 20, bottom = 18, width = wide - left - 6, height = high - bottom - top;
  if (!(to > from) || width < 10) return;
  const shown = curves.map((one) => columns(one.series, from, to, width).map((c) =>
    [c[0], c[1] * one.factor, c[2] * one.factor, c[3] * one.factor, c[4] * one.factor, c[5]]));
  let least = 0, most = 0;
  for (const curve of shown) for (const c of curve) [least, most] = [Math.min(least, c[1]), Math.max(most, c[2])];
  if (most === least) most = least + 1;
  const margin = 0.05 * (most - least);
  [least, most] = [least === 0 ? 0 : least - margin, most + margin];
  const y = (v) => top + height - ((v - least) / (most - least)) * height;
  const x = (t) => left + ((t - from) / (to - from)) * width;
  pen.font = "11px system-ui, sans-serif";
  pen.lineWidth = 1;
  pen.strokeStyle = style.grid;
  pen.fillStyle = style.text;
  const rise = step(most - least, 4), run = step(to - from, Math.max(2, width / 90));
  const places = Math.max(0, -Math.floor(Math.log10(rise))), digits = Math.max(0, -Math.floor(Math.log10(run)));
  pen.textAlign = "right";
  for (let v = Math.ceil(least / rise) * rise; v <= most; v += rise) {
    line(pen, left, y(v), left + width, y(v));
    pen.fillText(v.toFixed(Math.min(places, 6)), left - 5, y(v) + 4);
  }
  pen.textAlign = "center";
  for (let t = Math.ceil(from / run) * run; t <= to; t += run) {
    line(pen, x(t), top, x(t), top + height);
    pen.fillText(`${t.toFixed(Math.min(digits, 4))} s`, Math.min(x(t), wide - 18), high - 4);
  }
  pen.textAlign = "left";
  pen.strokeStyle = style.mark;
  let free = 0;
  for (const mark of marks) {
    if (mark.t < from || mark.t > to) continue;
    const named = x(mark.t) >= free;
    line(pen, x(mark.t), named ? 6 : top, x(mark.t), top + height);
    if (named) {
      pen.fillText(mark.text, x(mark.t) + 3, 16);
      free = x(mark.t) + 8 + pen.measureText(mark.text).width;
    }
  }
  pen.lineWidth = 1.5;
  shown.forEach((curve, k) => {
    pen.strokeStyle = curves[k].colour;
    pen.beginPath();
    for (const [at, low, high_, first, end, begins] of curve) {
      if (begins) pen.moveTo(left + at, y(first));
      for (const v of [first, low, high_, end]) pen.lineTo(left + at, y(v));
    }
    pen.stroke();
  });
}

function line(pen, x0, y0, x1, y1) {
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
}
