"use strict";
// Tables are sorted and filtered, pictures show values under the pointer and zoom. Without this script the page is complete.
document.documentElement.classList.add("scripted");
const made = (tag, kind, text = "") => Object.assign(document.createElement(tag), {className: kind, textContent: text});
const numbers = (text) => text.split(" ").map(Number);

// Tables: a click on a heading sorts by its column; a box above long tables keeps the rows with all of its words.
const MIN_FILTERED = 8;
const collator = new Intl.Collator("en", {numeric: true});
const valueOf = (cell) => {
  const text = cell.textContent.trim().replace(/−/g, "-").replace(/,/g, "");
  const found = /^[+-]?(\d+\.?\d*(e[+-]?\d+)?|inf)/i.exec(text);
  return found ? (/inf/i.test(found[0]) ? (text[0] === "-" ? -Infinity : Infinity) : parseFloat(found[0])) : NaN;
};
const compared = (a, b) => {
  const x = valueOf(a), y = valueOf(b);
  if (Number.isNaN(x) !== Number.isNaN(y)) return Number.isNaN(x) ? 1 : -1;
  return Number.isNaN(x) || x === y ? collator.compare(a.textContent, b.textContent) : x - y;
};
for (const table of document.querySelectorAll("table.rows")) {
  const body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
  // On a phone each row stands by itself, and each cell with the heading of its column.
  for (const row of body.rows) heads.forEach((head, column) => { row.cells[column].dataset.head = head.textContent; });
  heads.forEach((head, column) => {
    const button = made("button", "", head.textContent);
    button.type = "button";
    head.replaceChildren(button);
    button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const rows = [...body.rows].sort((a, b) => compared(a.cells[column], b.cells[column]) * (down ? -1 : 1));
      body.append(...rows);
    });
  });
  if (body.rows.length < MIN_FILTERED) continue;
  const label = made("label", "filter", "Filter"), box = made("input", ""), count = made("span", "");
  box.type = "search";
  count.setAttribute("role", "status");
  label.append(box, count);
  box.addEventListener("input", () => {
    const words = box.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const row of body.rows) {
      const text = [...row.cells].map((cell) => cell.textContent).join(" ").toLowerCase();
      row.hidden = !words.every((word) => text.includes(word));
      shown += !row.hidden;
    }
    count.textContent = words.length ? `${shown} of ${body.rows.length} rows` : "";
  });
  table.parentElement.before(label);
}
// Small curves: the boxes choose which trials are drawn over each other.
for (const choose of document.querySelectorAll(".choose")) {
  choose.addEventListener("change", ({target}) => {
    for (const line of choose.querySelectorAll(`[data-trial="${target.value}"]`)) line.classList.toggle("left-out", !target.checked);
  });
}
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((one) => { one.open = true; }));

// Pictures. A group of class `plot` carries its scales as "low high start end"; so does each axis, which is drawn anew.
const SVG = "http://www.w3.org/2000/svg";
const REACH = 18;  // Largest distance from the pointer to a mark that is read out, in units of the picture.
const LEAST = 6;   // A shorter drag is a click.
const scaled = ([low, high, start, end], value) => start + (end - start) * (value - low) / (high - low || 1);
const inverse = ([low, high, start, end], place) => low + (high - low) * (place - start) / (end - start || 1);
const shownNumber = (value) => String(Number(value.toPrecision(4))).replace("-", "−");
const ticks = ([low, high], about) => {
  const power = 10 ** Math.floor(Math.log10((high - low) / about));
  const step = [1, 2, 5, 10].map((k) => k * power).find((k) => (high - low) / k <= about) || 10 * power;
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k <= Math.floor(high / step + 1e-9); k++) found.push(k * step);
  return found;
};
let clips = 0;
const svgElement = (tag, attributes, text = "") => {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.textContent = text;
  return element;
};

class Plot {
  constructor(group) {
    this.group = group;
    this.x = this.x0 = numbers(group.dataset.x);
    this.y = this.y0 = group.dataset.y ? numbers(group.dataset.y) : null;
    this.top = Number(group.dataset.top);
    this.bottom = Number(group.dataset.bottom);
    this.items = [...group.querySelectorAll("[points],[transform],[d]")].filter((one) => !one.closest("g[transform]") || one.matches("g"))
      .map((element) => ({element, places: this.read(element)}));
  }
  read(element) {
    if (element.hasAttribute("points")) return element.getAttribute("points").split(" ").map((one) => one.split(",").map(Number));
    const numbersIn = (element.getAttribute("transform") || element.getAttribute("d")).match(/-?[\d.]+/g).map(Number);
    if (element.hasAttribute("transform")) return [numbersIn];
    const places = [];
    for (let k = 0; k + 2 < numbersIn.length; k += 3) places.push([numbersIn[k], numbersIn[k + 1]]);
    return places;
  }
  place([x, y]) {
    return [scaled(this.x, inverse(this.x0, x)), this.y ? scaled(this.y, inverse(this.y0, y)) : y];
  }
  draw() {
    const fixed = (place) => this.place(place).map((one) => one.toFixed(2));
    for (const {element, places} of this.items) {
      if (element.hasAttribute("points")) element.setAttribute("points", places.map((one) => fixed(one).join()).join(" "));
      else if (element.hasAttribute("transform")) element.setAttribute("transform", `translate(${fixed(places[0]).join(" ")})`);
      else element.setAttribute("d", places.map((one) => `M${fixed(one).join(" ")}h0`).join(""));
    }
    if (!this.group.hasAttribute("clip-path")) {
      const clip = svgElement("clipPath", {id: `clip${clips}`}), left = Math.min(this.x[2], this.x[3]);
      clip.append(svgElement("rect", {x: left, y: this.top, width: Math.abs(this.x[3] - this.x[2]), height: this.bottom - this.top}));
      this.group.before(clip);
      this.group.setAttribute("clip-path", `url(#clip${clips++})`);
    }
  }
  has([x, y]) {
    return x >= Math.min(this.x[2], this.x[3]) - 8 && x <= Math.max(this.x[2], this.x[3]) + 8 && y >= this.top - 8 && y <= this.bottom + 8;
  }
  // What is nearest to a place: a mark with words of its own, a dot of a row, or every line at this x.
  under([x, y]) {
    let best = null, least = REACH;
    for (const {element, places} of this.items) {
      const title = element.querySelector("title"), dots = element.hasAttribute("d");
      if (!title && !dots) continue;
      for (const place of places) {
        const [px, py] = this.place(place), distance = Math.hypot(px - x, py - y);
        if (distance < least) {
          least = distance;
          const value = this.y0 ? `${shownNumber(inverse(this.x0, place[0]))}, ${shownNumber(inverse(this.y0, place[1]))}` : shownNumber(inverse(this.x0, place[0]));
          best = {at: [px, py], words: title ? title.textContent : `${element.dataset.name}: ${value}`};
        }
      }
    }
    return best;
  }
  lines(x) {
    const found = [];
    for (const {element, places} of this.items) {
      if (!element.dataset.name || !element.hasAttribute("points") || element.classList.contains("left-out")) continue;
      let near = null;
      for (const place of places) {
        const px = this.place(place)[0];
        if (near === null || Math.abs(px - x) < Math.abs(near.px - x)) near = {px, place};
      }
      if (near && Math.abs(near.px - x) < REACH) found.push({px: near.px, words: `${element.dataset.name}: ${shownNumber(inverse(this.y0, near.place[1]))}`, t: inverse(this.x0, near.place[0])});
    }
    return found;
  }
}

for (const svg of document.querySelectorAll("figure svg")) {
  const plots = [...svg.querySelectorAll("g.plot")].map((group) => new Plot(group));
  if (!plots.length) continue;
  // An axis without length has a picture beside it, which does not move.
  const axes = [...svg.querySelectorAll("g.axis")].map((group) => ({group, scale: numbers(group.dataset.scale), first: numbers(group.dataset.scale)}))
    .filter(({group}) => new Set(numbers(group.dataset.span)).size > 1);
  const figure = svg.closest("figure"), tip = made("div", "tip"), reset = made("button", "reset", "whole picture");
  const cursor = svgElement("g", {fill: "none", stroke: "var(--quiet)"});
  reset.type = "button";
  tip.hidden = reset.hidden = true;
  tip.setAttribute("aria-hidden", "true");
  figure.append(tip, reset);
  svg.append(cursor);
  svg.classList.add("zoomable");
  const placeOf = (event) => {
    const box = svg.getBoundingClientRect(), width = svg.viewBox.baseVal.width;
    return [(event.clientX - box.left) * width / box.width, (event.clientY - box.top) * width / box.width];
  };
  const redraw = () => {
    plots.forEach((plot) => plot.draw());
    for (const {group, scale} of axes) {
      const across = group.classList.contains("x"), [from, to] = numbers(group.dataset.span);
      const parts = ticks(scale, across ? 5 : 4).flatMap((value) => {
        const at = scaled(scale, value).toFixed(1), text = {"font-size": 11, fill: "var(--quiet)"};
        return across
          ? [svgElement("path", {d: `M${at} ${from}V${to}`, stroke: "var(--grid)"}), svgElement("text", {...text, x: at, y: to + 13, "text-anchor": "middle"}, shownNumber(value))]
          : [svgElement("path", {d: `M${from} ${at}H${to}`, stroke: "var(--grid)"}), svgElement("text", {...text, x: from - 4, y: Number(at) + 4, "text-anchor": "end"}, shownNumber(value))];
      });
      group.replaceChildren(...parts);
    }
  };
  // Every plot and axis with this range on the paper gets the part of it between two places.
  const zoom = (kind, [start, end], from, to) => {
    const part = (scale) => [inverse(scale, from), inverse(scale, to), start, end];
    for (const one of plots) if (one[kind] && one[kind][2] === start && one[kind][3] === end) one[kind] = part(one[kind]);
    for (const one of axes) if (one.group.classList.contains(kind) && one.scale[2] === start && one.scale[3] === end) one.scale = part(one.scale);
  };
  const whole = () => {
    plots.forEach((plot) => { plot.x = plot.x0; plot.y = plot.y0; });
    axes.forEach((axis) => { axis.scale = axis.first; });
    redraw();
    reset.hidden = true;
  };
  const read = (at, event) => {
    cursor.replaceChildren();
    const plot = plots.find((one) => one.has(at));
    const near = plot && plot.under(at);
    const lines = plot && !near ? plots.filter((one) => one.x[2] === plot.x[2]).flatMap((one) => one.lines(at[0])) : [];
    tip.hidden = !near && !lines.length;
    if (near) {
      tip.textContent = near.words;
      cursor.append(svgElement("circle", {cx: near.at[0], cy: near.at[1], r: 7}));
    } else if (lines.length) {
      tip.textContent = [`${shownNumber(lines[0].t)} ${svg.dataset.unit || ""}`.trim(), ...lines.map((one) => one.words)].join("\n");
      cursor.append(svgElement("path", {d: `M${lines[0].px} ${Math.min(...plots.map((one) => one.top))}V${Math.max(...plots.map((one) => one.bottom))}`}));
    }
    if (tip.hidden) return;
    const box = figure.getBoundingClientRect(), size = tip.getBoundingClientRect();
    const left = event.clientX - box.left + 14;
    tip.style.left = `${Math.max(0, left + size.width > box.width ? left - size.width - 28 : left)}px`;
    tip.style.top = `${Math.max(0, event.clientY - box.top - size.height - 8)}px`;
  };
  let drag = null;
  svg.addEventListener("pointerdown", (event) => {
    const at = placeOf(event), plot = plots.find((one) => one.has(at));
    if (event.pointerType === "touch") read(at, event);
    else if (plot && event.button === 0) {
      drag = {at, plot};
      svg.setPointerCapture(event.pointerId);
      event.preventDefault();
    }
  });
  svg.addEventListener("pointermove", (event) => {
    const at = placeOf(event);
    if (!drag) return read(at, event);
    tip.hidden = true;
    const [x, y] = drag.at;
    cursor.replaceChildren(svgElement("rect", {x: Math.min(x, at[0]), y: Math.min(y, at[1]), width: Math.abs(at[0] - x), height: Math.abs(at[1] - y), "stroke-dasharray": "3 3"}));
  });
  svg.addEventListener("pointerup", (event) => {
    if (!drag) return;
    const {at: [x, y], plot} = drag, [x2, y2] = placeOf(event);
    drag = null;
    cursor.replaceChildren();
    const wide = Math.abs(x2 - x) >= LEAST, high = plot.y && Math.abs(y2 - y) >= 4 * LEAST;
    const within = (value, scale) => Math.min(Math.max(value, Math.min(scale[2], scale[3])), Math.max(scale[2], scale[3]));
    if (wide) zoom("x", plot.x.slice(2), within(Math.min(x, x2), plot.x), within(Math.max(x, x2), plot.x));
    if (high) zoom("y", plot.y.slice(2), within(Math.max(y, y2), plot.y), within(Math.min(y, y2), plot.y));
    if (wide || high) {
      redraw();
      reset.hidden = false;
    }
  });
  svg.addEventListener("pointerleave", () => { tip.hidden = true; cursor.replaceChildren(); });
  svg.addEventListener("dblclick", whole);
  reset.addEventListener("click", whole);
}
