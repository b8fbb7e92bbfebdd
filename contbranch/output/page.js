"use strict";
// The page of a diagram, a loop or a sweep. `data` says what there is; its arrays are [start, length] in `numbers`.
const WORDS = { load: "Load F", displacement: "Displacement d", contact_radius: "Contact radius a",
  central_gap: "Central gap g(0)", energy: "Energy V", piezo: "Position of the spring d + F/K", deflection: "Deflection F/K",
  gap: "Gap g", pressure: "Pressure p", r: "Radius r" };
const byId = (id) => document.getElementById(id);
const data = JSON.parse(byId("data").textContent);
const NAMES = Object.keys(WORDS).slice(0, data.items.some((one) => one.stiffness) ? 7 : 5);
const view = { item: 0, branch: 0, row: 0, x: "load", y: "contact_radius", control: "load", all: false, step: null };
let numbers = null, scene = null;

async function unpack(text) {
  const packed = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  const count = planes.length / 4, bytes = new Uint8Array(planes.length);
  for (let k = 0; k < 4; k++) for (let i = 0; i < count; i++) bytes[4 * i + k] = planes[k * count + i];
  return new Float32Array(bytes.buffer);
}
const array = (place) => numbers.subarray(place[0], place[0] + place[1]);
const driven = (control = view.control) => control === "spring" ? "piezo" : control;
const item = () => data.items[view.item];
const unit = (name) => data.units[{ r: "radius", piezo: "displacement", deflection: "displacement" }[name] || name] || "";
const label = (name) => WORDS[name] + (unit(name) ? ` (${unit(name)})` : "");
const words = (name) => name.replace(/_/g, " ");
const digits = (value, count = 7) => value === null || Number.isNaN(value) ? "–"
  : String(Number(value.toPrecision(count))).replace("-", "−").replace(/e[+]?/, " e");
const kept = (value) => digits(value, data.digits);  // of an array
const called = (event) => event.kind === "touch" ? "first touch"
  : [event.kind, event.name, event.mode && `m = ${event.mode}`].filter(Boolean).join(" ");
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

function element(kind, given = {}, parent = null, text = null) {
  const made = document.createElement(kind);
  for (const [key, value] of Object.entries(given)) made.setAttribute(key, value);
  if (text !== null) made.textContent = text;
  if (parent) parent.append(made);
  return made;
}
function draw(kind, given, parent, text = null) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", kind);
  for (const [key, value] of Object.entries(given)) made.setAttribute(key, value);
  if (text !== null) made.textContent = text;
  parent.append(made);
  return made;
}

const pen = document.createElement("canvas").getContext("2d");
pen.font = `13px ${getComputedStyle(document.body).fontFamily}`;
const wide = (text) => pen.measureText(text).width;

// Axes ---------------------------------------------------------------------------------------------------------------
function ticks(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((k) => k * power).find((one) => one >= raw * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return { at: found, step, show: (v) => digits(Math.abs(v) < 1e-9 * step ? 0 : v, 6) };
}
const upwards = (range, height) => ticks(...range, Math.max(2, height / 48));
// As wide as the numbers beside it, and the name of the axis beside these.
function margin(range, height) {
  const { at, show } = upwards(range, height);
  return 34 + Math.max(22, ...at.map((v) => wide(show(v))));
}
function axes(svg, box, x, y, names) {
  const px = (v) => box.left + (v - x[0]) / (x[1] - x[0]) * box.width;
  const py = (v) => box.top + box.height - (v - y[0]) / (y[1] - y[0]) * box.height;
  const vertical = upwards(y, box.height);
  const crowded = ({ at, step, show }) => Math.max(0, ...at.map((v) => wide(show(v)))) + 14 > box.width / (x[1] - x[0]) * step;
  let count = Math.max(3, box.width / 75), horizontal = ticks(...x, count);
  while (count > 1 && crowded(horizontal)) horizontal = ticks(...x, --count);
  for (const v of horizontal.at) {
    if (v === 0) draw("line", { class: "zero", x1: px(0), x2: px(0), y1: box.top, y2: box.top + box.height }, svg);
    draw("line", { class: "tick", x1: px(v), x2: px(v), y1: box.top + box.height, y2: box.top + box.height - 5 }, svg);
    if (names[0]) draw("text", { x: px(v), y: box.top + box.height + 17, "text-anchor": "middle" }, svg, horizontal.show(v));
  }
  for (const v of vertical.at) {
    if (v === 0) draw("line", { class: "zero", x1: box.left, x2: box.left + box.width, y1: py(0), y2: py(0) }, svg);
    draw("line", { class: "tick", x1: box.left, x2: box.left + 5, y1: py(v), y2: py(v) }, svg);
    draw("text", { x: box.left - 7, y: py(v) + 4.5, "text-anchor": "end" }, svg, vertical.show(v));
  }
  const middle = box.top + box.height / 2;
  draw("text", { x: box.left + box.width / 2, y: box.top + box.height + 37, "text-anchor": "middle" }, svg, names[0]);
  draw("text", { x: 15, y: middle, "text-anchor": "middle", transform: `rotate(-90 15 ${middle})` }, svg, names[1]);
  draw("rect", { class: "frame", x: box.left, y: box.top, width: box.width, height: box.height }, svg);
  const clip = `clip${Math.random().toString(36).slice(2)}`;
  const frame = { x: box.left, y: box.top, width: box.width, height: box.height };
  draw("rect", frame, draw("clipPath", { id: clip }, svg));
  return { px, py, inside: draw("g", { "clip-path": `url(#${clip})` }, svg), box, x, y };
}
const line = (xs, ys, px, py) => Array.from(xs, (v, i) => `${i ? "L" : "M"}${px(v).toFixed(2)} ${py(ys[i]).toFixed(2)}`).join("");

// What is seen: the part of the curve around its events, unless all of it is asked for --------------------------------
function limits() {
  const known = item().events.filter((e) => ["fold", "touch", "symmetry"].includes(e.kind));
  const lines = item().branches.map((b) => b.fine), found = {};
  const windowed = !view.all && known.length > 0;
  const windows = {};
  for (const name of windowed ? ["load", "displacement"] : []) {
    const values = known.map((e) => e[name]);
    item().branches.forEach((b, k) => {
      const on = known.filter((e) => e.branch === k).map((e) => e.position), at = array(b.position), all = array(b.fine[name]);
      at.forEach((p, i) => { if (p >= Math.min(...on) && p <= Math.max(...on)) values.push(all[i]); });
    });
    const low = Math.min(...values), high = Math.max(...values);
    const pad = Math.max(high - low, (known.some((e) => e.kind === "fold") ? 0.05 : 1) * Math.max(Math.abs(low), Math.abs(high)));
    windows[name] = [low - pad, high + pad];
  }
  for (const name of [view.x, view.y]) {
    let low = Infinity, high = -Infinity;
    const take = (value) => { if (Number.isFinite(value)) { low = Math.min(low, value); high = Math.max(high, value); } };
    for (const fine of lines) {
      const seen = Object.entries(windows).map(([key, range]) => [array(fine[key]), range]);
      array(fine[name]).forEach((value, i) => { if (seen.every(([v, [a, b]]) => v[i] >= a && v[i] <= b)) take(value); });
    }
    known.forEach((e) => take(e[name]));
    if (item().loop && (view.all || !windowed)) array(item().loop[name]).forEach(take);
    const margin = 0.07 * (high - low || Math.abs(high) || 1);
    found[name] = Number.isFinite(low) ? [low - margin, high + margin] : [0, 1];
  }
  return found;
}

// The diagram --------------------------------------------------------------------------------------------------------
function drawDiagram() {
  const holder = byId("diagram"), width = holder.clientWidth || 700, height = clamp(0.72 * width, 300, 560);
  holder.replaceChildren();
  const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, height, tabindex: 0, role: "application",
    "aria-label": `${WORDS[view.y]} against ${WORDS[view.x]}. Left and right arrow keys move along the curve.` }, holder);
  const range = limits(), left = margin(range[view.y], height - 60);
  const box = { left, top: 10, width: width - left - 16, height: height - 60 };
  const plot = axes(svg, box, range[view.x], range[view.y], [label(view.x), label(view.y)]);
  for (const branch of item().branches) {
    const xs = array(branch.fine[view.x]), ys = array(branch.fine[view.y]), stable = array(branch.stable[view.control]);
    for (let start = 0; start < xs.length - 1;) {
      let stop = start + 1;
      while (stop < xs.length - 1 && stable[stop] === stable[start]) stop++;
      const path = line(xs.subarray(start, stop + 1), ys.subarray(start, stop + 1), plot.px, plot.py);
      draw("path", { class: stable[start] ? "stable" : "unstable", d: path }, plot.inside);
      start = stop;
    }
  }
  const loop = journey();
  if (view.step !== null || looped()) {
    for (const leg of loop.legs) draw("path", { class: "loop", d: line(leg.x, leg.y, plot.px, plot.py) }, plot.inside);
    for (const [a, b] of loop.jumps) draw("path", { class: "jump", d: line([a[0], b[0]], [a[1], b[1]], plot.px, plot.py) }, plot.inside);
  }
  if (view.step !== null) for (const [x, y] of loop.lost || []) {
    const text = "jumps to no state of this curve", left = clamp(plot.px(x) + 12, box.left + 4, box.left + box.width - wide(text) - 4);
    draw("text", { x: left, y: plot.py(y) + 22 }, svg, text);
  }
  const marks = item().events.map((event) => ({ event, x: plot.px(event[view.x]), y: plot.py(event[view.y]) })).filter(({ event, x, y }) =>
    (["touch", "symmetry"].includes(event.kind) || (event.kind === "fold" && event.control === view.control))
    && x >= box.left && x <= box.left + box.width && y >= box.top && y <= box.top + box.height);
  for (const { event, x, y } of marks) {
    const made = event.kind === "fold" ? draw("circle", { class: "mark", cx: x, cy: y, r: 5 }, svg)
      : draw("path", { class: "mark", d: `M${x - 5} ${y}L${x} ${y - 5}L${x + 5} ${y}L${x} ${y + 5}Z` }, svg);
    draw("title", {}, made, called(event));
  }
  drawNames(svg, box, marks);
  const here = draw("circle", { class: "here", r: 6, cx: -99, cy: -99 }, draw("g", { "clip-path": plot.inside.getAttribute("clip-path") }, svg));
  scene = { svg, plot, here };
  const point = (event) => {
    const frame = svg.getBoundingClientRect(), k = width / frame.width;
    nearest((event.clientX - frame.left) * k, (event.clientY - frame.top) * k);
  };
  svg.addEventListener("pointermove", point);
  svg.addEventListener("pointerdown", point);
  svg.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10, Home: -1e9, End: 1e9 }[event.key];
    if (step) { event.preventDefault(); go(view.branch, (item().branches.length ? view.row : view.step) + step); }
  });
  const control = view.control === "spring" ? "the spring" : view.control;
  const known = { stable: "stable", unstable: `unstable under ${control}`, loop: "quasi-static loop" };
  byId("legend").replaceChildren();
  for (const [kind, text] of Object.entries(known)) {
    if (kind === "loop" ? view.step === null && !item().loop : !item().branches.length) continue;
    const holder = element("span", {}, byId("legend")), sample = draw("svg", { viewBox: "0 0 34 12" }, holder);
    draw("line", { class: kind, x1: 0, x2: 34, y1: 6, y2: 6 }, sample);
    holder.append(text);
  }
}
// Names beside the marks, those of the layers nearest to the wall first. One without a free place is left out: its mark
// says it to who points at it, and so does the table.
function drawNames(svg, box, marks) {
  const taken = marks.map(({ x, y }) => [x - 5, x + 5, y - 18, y + 18]);  // no name is that of the mark below it
  const layer = ({ event }) => event.mode || Number((/-(\d+)$/.exec(event.name) || [])[1] || 0);
  for (const { event, x, y } of [...marks].sort((one, other) => layer(one) - layer(other))) {
    const text = { fold: event.name || "", symmetry: `m = ${event.mode}` }[event.kind] ?? called(event), long = wide(text);
    const spots = [-8, 18, -24, 34].flatMap((dy) => [9, -9 - long].map((dx) => [x + dx, x + dx + long, y + dy - 10, y + dy + 2]));
    const free = spots.find(([a, b, c, d]) => a > box.left && b < box.left + box.width && c > box.top && d < box.top + box.height
      && taken.every(([left, right, top, bottom]) => b < left || a > right || d < top || c > bottom));
    if (!text || !free) continue;
    taken.push(free);
    draw("text", { class: "name", x: free[0], y: free[3] - 2 }, svg, text);
  }
}
// Rows that can be pointed at: of the curve, or, where a loop has none behind it, those of the loop itself.
const lines = () => item().branches.length ? item().branches.map((branch) => branch.rows) : item().loop ? [item().loop] : [];
function nearest(x, y) {
  let best = Infinity, found = null;
  lines().forEach((rows, b) => {
    const xs = array(rows[view.x]), ys = array(rows[view.y]);
    xs.forEach((value, i) => {
      const far = Math.hypot(scene.plot.px(value) - x, scene.plot.py(ys[i]) - y);
      if (far < best) { best = far; found = [b, i]; }
    });
  });
  if (found) go(...found);
}
function go(branch, row) {
  if (item().branches.length) return select(branch, row);
  byId("loop").value = row;
  play(Number(byId("loop").value));
}
function select(branch, row, values = null) {
  const one = item().branches[branch];
  if (!one) return drawProfile();
  view.branch = branch;
  view.row = clamp(row, 0, array(one.rows.load).length - 1);
  show(values || Object.fromEntries(NAMES.map((name) => [name, array(one.rows[name])[view.row]])));
}
function show(values) {
  view.values = values;
  scene.here.setAttribute("cx", scene.plot.px(values[view.x]));
  scene.here.setAttribute("cy", scene.plot.py(values[view.y]));
  drawProfile();
}

// One state: the deformed tip above the wall, and the pressure --------------------------------------------------------
function profile(branch = view.branch, row = view.row) {
  const one = item().branches[branch];
  if (!one || !one.counts) return null;
  const counts = array(one.counts);
  let start = 0;
  for (let k = 0; k < row; k++) start += counts[k];
  const cut = (place) => array(place).subarray(start, start + counts[row]);
  return { r: cut(one.r), gap: cut(one.gap), pressure: cut(one.pressure) };
}
function span(name, branch) {
  const [low, high] = array(branch[name]).reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [0, 0]);
  return [low - 0.06 * (high - low || 1), high + 0.06 * (high - low || 1)];
}
// Colours that the colour-blind tell apart: viridis, and blue to red about zero.
const GAPS = [[253, 231, 37], [94, 201, 98], [33, 145, 140], [59, 82, 139], [68, 1, 84]].reverse();
const PRESSURES = [[33, 102, 172], [146, 197, 222], [247, 247, 247], [244, 165, 130], [178, 24, 43]];
function colour(stops, share) {
  const at = clamp(share, 0, 1) * (stops.length - 1), k = Math.min(Math.floor(at), stops.length - 2);
  return stops[k].map((v, i) => Math.round(v + (at - k) * (stops[k + 1][i] - v)));
}
function maps(branch = view.branch, row = view.row) {
  const kept = (item().branches[branch] || {}).maps;
  if (!kept) return null;
  const edges = array(kept.edges);
  let start = 0;
  for (let k = 0; k < row; k++) start += edges[6 * k + 2] * edges[6 * k + 5];
  const [x0, x1, columns, y0, y1, rows] = edges.subarray(6 * row, 6 * row + 6);
  const cut = (place) => array(place).subarray(start, start + rows * columns);
  return { x: [x0, x1], y: [y0, y1], columns, rows, gap: cut(kept.gap), pressure: cut(kept.pressure) };
}
function drawMap(holder, shown, name, stops, low, high, note) {
  const width = holder.clientWidth || 420;
  const half = [shown.x, shown.y].map(([a, b], k) => (b - a) / (2 * ([shown.columns, shown.rows][k] - 1 || 1)));
  const x = [shown.x[0] - half[0], shown.x[1] + half[0]], y = [shown.y[0] - half[1], shown.y[1] + half[1]];
  const shape = (x[1] - x[0]) / (y[1] - y[0]), left = margin(y, 330), inner = Math.min(width - left - 16, 330 * shape);
  const box = { left, top: 8, width: inner, height: inner / shape }, height = box.height + 52;
  const canvas = element("canvas", { width: shown.columns, height: shown.rows }), ink = canvas.getContext("2d");
  const image = ink.createImageData(shown.columns, shown.rows);
  shown[name].forEach((value, k) => {
    const touching = name === "gap" && value === 0, place = 4 * ((shown.rows - 1 - Math.floor(k / shown.columns)) * shown.columns + k % shown.columns);
    image.data.set([...(touching ? [64, 64, 64] : colour(stops, (value - low) / (high - low || 1))), 255], place);
  });
  ink.putImageData(image, 0, 0);
  element("p", { class: "note" }, holder, note);
  const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, height, role: "img", "aria-label": `Map: ${note}` }, holder);
  draw("image", { id: `map-${name}`, href: canvas.toDataURL(), x: box.left, y: box.top, width: box.width, height: box.height,
    preserveAspectRatio: "none", style: "image-rendering:pixelated" }, svg);
  axes(svg, box, x, y, [`x${unit("r") ? ` (${unit("r")})` : ""}`, `y${unit("r") ? ` (${unit("r")})` : ""}`]);
}
function drawMaps(holder, shown) {
  const top = item().limit || Math.max(...shown.gap), strong = shown.pressure.reduce((most, v) => Math.max(most, Math.abs(v)), 0);
  const named = (name, low, high) => `${label(name)}: ${digits(low, 3)} to ${digits(high, 3)}`;
  drawMap(holder, shown, "gap", GAPS, 0, Math.min(top, Math.max(...shown.gap)), `${named("gap", 0, Math.min(top, Math.max(...shown.gap)))}, grey: contact`);
  drawMap(holder, shown, "pressure", PRESSURES, -strong, strong, `${named("pressure", -strong, strong)}, red: repulsion`);
}
function drawProfile() {
  const one = item().branches[view.branch], holder = byId("profile"), shown = profile();
  holder.replaceChildren();
  byId("state").replaceChildren();
  if (!one && !item().loop) return;
  const entry = (name, value) => { element("dt", {}, byId("state"), name); element("dd", {}, byId("state"), value); };
  for (const name of NAMES) entry(WORDS[name], `${kept(view.values[name])} ${unit(name)}`);
  for (const control of item().controls) {
    const modes = one ? array(one.unstable[control])[view.row] : 0;  // a loop passes stable states
    entry(`under ${control === "spring" ? "the spring" : control}`, modes ? `unstable (${modes} mode${modes > 1 ? "s" : ""})` : "stable");
  }
  const flat = maps();
  if (flat) return drawMaps(holder, flat);
  if (!shown) return void element("p", { class: "soft" }, holder, `No profiles were kept for this ${one ? "curve" : "loop"}.`);
  const width = holder.clientWidth || 420, height = clamp(0.98 * width, 300, 460), half = (height - 66) / 2;
  const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, height, role: "img",
    "aria-label": `Deformed tip above the wall, and pressure, at load ${kept(array(one.rows.load)[view.row])}` }, holder);
  const onGrid = ["periodic", "free"].includes(item().model);
  const reach = 1.02 * (one.reach || shown.r[shown.r.length - 1]), low = onGrid ? 0 : -reach, top = item().limit || span("gap", one)[1];
  const mirrored = (values) => [...Array.from(values).reverse(), ...values];
  const last = shown.r.length - 1, slope = (shown.gap[last] - shown.gap[last - 1]) / (shown.r[last] - shown.r[last - 1]);
  const beyond = Math.max(0, 1.5 * top - shown.gap[last]) / Math.max(slope, 1e-9);
  const rs = mirrored(shown.r).map((v, i) => i <= last ? -v : v);
  const gaps = [-0.14 * top, top], pressures = span("pressure", one);
  const left = Math.max(margin(gaps, half), margin(pressures, half)), box = { left, top: 8, width: width - left - 16, height: half };
  const upper = axes(svg, box, [low, reach], gaps, ["", label("gap")]);
  const outline = [1.5 * top, ...mirrored(shown.gap), 1.5 * top];
  const across = [rs[0] - beyond, ...rs, rs[rs.length - 1] + beyond];
  draw("rect", { class: "wall", x: left, y: upper.py(0), width: box.width, height: box.top + half - upper.py(0) }, upper.inside);
  if (!onGrid) draw("path", { class: "body", id: "tip", d: line(across, outline, upper.px, upper.py) }, upper.inside);
  if (item().tip) {
    const r = array(item().tip.r), z = Array.from(array(item().tip.z), (v) => v + array(one.rows.central_gap)[view.row]);
    draw("path", { class: "outline", d: line(r, z, upper.px, upper.py) + line(Array.from(r, (v) => -v), z, upper.px, upper.py) }, upper.inside);
  }
  const lower = axes(svg, { ...box, top: 16 + half }, [low, reach], pressures, [label("r"), label("pressure")]);
  if (onGrid) {
    element("p", { class: "soft" }, holder, "On a grid: means over the nodes at equal distance from the middle.");
    const dots = (values, plot) => Array.from(shown.r, (r, i) => `M${plot.px(r)} ${plot.py(values[i])}h0`).join("");
    draw("path", { class: "dots", d: dots(shown.gap, upper) }, upper.inside);
    draw("path", { class: "dots", d: dots(shown.pressure, lower) }, lower.inside);
  } else draw("path", { class: "pressure", id: "pressure", d: line(rs, mirrored(shown.pressure), lower.px, lower.py) }, lower.inside);
}

// The quasi-static loop: as computed, or along the curve, a jump leading to its next stable state that is lower ---------
function runs() {
  const found = [];
  item().branches.forEach((branch, b) => {
    const stable = array(branch.stable[view.control]), at = drive(branch);
    for (let i = 0; i < stable.length; i++) {
      if (!stable[i]) continue;
      const start = i;
      while (i < stable.length - 1 && stable[i]) i++;
      if (i > start) found.push({ b, start, stop: i, at, low: Math.min(at[start], at[i]), high: Math.max(at[start], at[i]),
        up: at[i] > at[start] ? 1 : -1, last: i === stable.length - 1 });
    }
  });
  return found;
}
const drive = (branch) => array(branch.fine[driven()]);
function between(values, i) {  // at a place between drawn points
  const k = Math.floor(i);
  return i === k ? values[k] : values[k] + (i - k) * (values[k + 1] - values[k]);
}
function height(branch, i, at) {
  const [load, d, energy] = ["load", "displacement", "energy"].map((name) => between(array(branch.fine[name]), i));
  if (view.control === "load") return energy - at * d;
  return view.control === "displacement" ? energy + load * (at - d) : energy + 0.5 * item().stiffness * (at - d) ** 2;
}
function locate(run, value) {
  for (let i = run.start; i < run.stop; i++) {
    const before = value - run.at[i], after = value - run.at[i + 1];
    if (before * after <= 0) return before === after ? i : i + before / (before - after);
  }
  return null;
}
let travelled = { key: "", stops: [], jumps: [], turn: Infinity };  // turn: how many stops are on the way there
function travel() {
  const key = [view.item, view.control].join();
  if (travelled.key === key) return travelled;
  const all = runs(), stops = [], jumps = [];
  let run = all[0], i = run ? run.start : 0, direction = 1, turn = Infinity;
  for (let legs = 0; run && legs < 2 * all.length + 2; legs++) {
    const goal = run.up * direction > 0 ? run.stop : run.start;
    for (; i !== goal; i = goal > i ? Math.floor(i) + 1 : Math.ceil(i) - 1) stops.push([run.b, i]);
    stops.push([run.b, i]);
    const forward = goal === run.stop;
    if ((forward && run.last) || (!forward && run.start === 0)) {
      if (direction < 0) break;
      [direction, turn] = [-1, stops.length];
      continue;
    }
    const value = run.at[goal], level = height(item().branches[run.b], goal, value), order = all.indexOf(run);
    const others = (forward ? all.slice(order + 1) : all.slice(0, order).reverse()).map((other) => [other, locate(other, value)]);
    const next = others.find(([other, place]) => place !== null && height(item().branches[other.b], place, value) < level);
    if (!next) {
      jumps.push([[run.b, i], null]);
      if (direction < 0) break;
      [direction, turn] = [-1, stops.length];
      continue;
    }
    jumps.push([[run.b, i], [next[0].b, next[1]]]);
    [run, i] = next;
  }
  travelled = { key, stops, jumps, turn };
  return travelled;
}
const looped = () => Boolean(item().loop) && item().control === view.control;
function journey() {
  const legs = [], jumps = [];
  if (looped()) {
    const x = array(item().loop[view.x]), y = array(item().loop[view.y]), leg = array(item().loop.leg), direction = array(item().loop.direction);
    for (let start = 0; start < x.length;) {
      let stop = start;
      while (stop < x.length && leg[stop] === leg[start]) stop++;
      legs.push({ x: x.subarray(start, stop), y: y.subarray(start, stop) });
      if (stop < x.length && direction[stop] === direction[stop - 1]) jumps.push([[x[stop - 1], y[stop - 1]], [x[stop], y[stop]]]);
      start = stop;
    }
    return { legs, jumps, count: x.length };
  }
  const { stops, jumps: made } = travel(), at = ([b, i]) => [view.x, view.y].map((name) => between(array(item().branches[b].fine[name]), i));
  const landed = new Set(made.filter((j) => j[1]).map((j) => String(j[1])));
  let leg = { x: [], y: [] };
  stops.forEach((stop, k) => {
    if (leg.x.length && landed.has(String(stop)) && String(stops[k - 1]) !== String(stop) && Math.abs(stop[1] - stops[k - 1][1]) > 1) { legs.push(leg); leg = { x: [], y: [] }; }
    const [x, y] = at(stop);
    leg.x.push(x); leg.y.push(y);
  });
  legs.push(leg);
  for (const [from, to] of made.filter((jump) => jump[1])) {
    const before = at(from), after = at(to);  // what is controlled does not change
    jumps.push([before, [view.x, view.y].map((name, k) => name === driven() ? before[k] : after[k])]);
  }
  return { legs, jumps, lost: made.filter((jump) => !jump[1]).map((jump) => at(jump[0])), count: stops.length };
}
function play(step) {
  const first = view.step === null;
  view.step = step;
  if (first) drawDiagram();
  if (looped()) {
    const scale = (name) => { const v = array(item().loop[name]); return Math.max(...v) - Math.min(...v) || 1; };
    let best = Infinity, found = null;
    const at = ["load", "displacement", "contact_radius"].map((name) => [name, array(item().loop[name])[step], scale(name)]);
    item().branches.forEach((branch, b) => array(branch.rows.load).forEach((_, i) => {
      const far = Math.hypot(...at.map(([name, value, size]) => (array(branch.rows[name])[i] - value) / size));
      if (far < best) { best = far; found = [b, i]; }
    }));
    const values = Object.fromEntries(NAMES.map((name) => [name, array(item().loop[name])[step]]));
    return found ? select(...found, values) : show(values);
  }
  const stop = travel().stops[step];
  if (!stop) return drawProfile();
  visit(...stop);
}
function visit(b, i) {
  const branch = item().branches[b], values = Object.fromEntries(NAMES.map((name) => [name, between(array(branch.fine[name]), i)]));
  select(b, Math.round(between(array(branch.position), i)), values);  // the profile is that of the nearest point
}

// On another curve: the place where what is controlled is what it was; of several the nearest, on a loop on the same way.
function keep(values, back) {
  const sizes = ["load", "displacement", "contact_radius", driven()].map((name) => {
    const ends = item().branches.flatMap((branch) => span(name, branch.fine));
    return [name, Math.max(...ends) - Math.min(...ends)];
  });
  const path = view.step === null ? item().branches.flatMap((branch, b) => Array.from(drive(branch), (_, i) => [b, i])) : travel().stops;
  let best = Infinity, found = null;
  path.slice(0, -1).forEach(([b, i], k) => {
    const [next, j] = path[k + 1];
    if (next !== b || (view.step !== null && back !== k >= travel().turn)) return;
    const fine = item().branches[b].fine, at = drive(item().branches[b]), [from, to] = [between(at, i), between(at, j)];
    const share = clamp((values[driven()] - from) / (to - from || 1), 0, 1), place = i + share * (j - i);
    const off = sizes.map(([name, size]) => (between(array(fine[name]), place) - values[name]) / size);
    const far = Math.hypot(...off) + 1e3 * Math.abs(off[3]);
    if (far < best) { best = far; found = [b, place, k + Math.round(share)]; }
  });
  if (!found) return;
  if (view.step === null) return visit(found[0], found[1]);
  byId("loop").value = found[2];
  play(found[2]);
}

// Tables, menus, sliders ----------------------------------------------------------------------------------------------
function table(holder, headings, rows) {
  holder.replaceChildren();
  if (!rows.length) return;
  const made = element("table", {}, holder), head = element("tr", {}, element("thead", {}, made));
  headings.forEach((text) => element("th", { scope: "col" }, head, text));
  const body = element("tbody", {}, made);
  for (const row of rows) { const tr = element("tr", {}, body); row.forEach((text) => element("td", {}, tr, text)); }
}
function drawTables() {
  const shown = NAMES.slice(0, 4), { jumps, dissipated } = item().loop || { jumps: [] };
  const ends = (state) => shown.map((name) => digits(state ? state[name] : null));
  const nowhere = item().status === "complete" ? "to infinity" : "not reached";
  table(byId("jumps"), ["jump", label(driven(item().control)), "", ...shown.map(label), `dissipated ${unit("energy") && `(${unit("energy")})`}`], [
    ...jumps.flatMap((jump) => [[jump.name || "jump", digits(jump.position), "from", ...ends(jump.from), digits(jump.dissipated)],
      ["", "", jump.to ? "to" : nowhere, ...ends(jump.to), ""]]),
    ...jumps.slice(0, 1).map(() => ["whole loop", "", "", ...shown.map(() => ""), digits(dissipated)])]);
  table(byId("events"), ["event", "control", ...shown.map(label)], item().events.map((e) =>
    [called(e), e.control || "", ...shown.map((name) => digits(e[name]))]));
  const holder = byId("table"), fill = () => {
    const rows = [];
    const counted = item().branches.length ? item().controls : [];
    lines().forEach((line, b) => array(line.load).forEach((_, i) => rows.push([String(i), ...NAMES.map((name) => kept(array(line[name])[i])),
      ...counted.map((c) => kept(array(item().branches[b].unstable[c])[i]))])));
    table(holder, ["point", ...NAMES.map(label), ...counted.map((c) => `unstable modes, ${c}`)], rows);
  };
  holder.replaceChildren();
  holder.parentElement.ontoggle = () => { if (holder.parentElement.open) fill(); };
  if (holder.parentElement.open) fill();
}
function redraw() {
  const status = item().status !== "complete" ? `${item().status}: ${item().message}` : item().loop ? item().message : "";
  const at = Object.entries(item().parameters || {}).map(([name, value]) => `${name} = ${digits(value, 5)} ${unit(name)}`.trim()).join(", ");
  byId("status").textContent = [at, status].filter(Boolean).join(" · ");
  if (item().controls.length && !item().controls.includes(view.control)) view.control = item().controls[0];
  view.branch = clamp(view.branch, 0, Math.max(0, item().branches.length - 1));
  if (item().loop && !item().branches.length && view.step === null) view.step = 0;
  drawDiagram();
  drawTables();
  const slider = byId("loop");
  slider.max = Math.max(0, journey().count - 1);
  if (view.step === null) select(view.branch, view.row);
  else { slider.value = Math.min(view.step, slider.max); play(Number(slider.value)); }
}
function menu(name, title, choices) {
  const holder = element("label", {}, byId("controls"), title), made = element("select", { id: name }, holder);
  for (const [value, text] of choices) element("option", { value }, made, text);
  made.value = view[name];
  made.addEventListener("change", () => { view[name] = made.value; travelled.key = ""; redraw(); });
}
function slider(id, title, max, act) {
  const holder = element("label", {}, byId("controls"), title);
  const made = element("input", { type: "range", id, min: 0, max, value: 0, step: 1 }, holder);
  made.addEventListener("input", () => act(Number(made.value)));
  return made;
}
function start() {
  byId("title").textContent = data.title;
  const first = data.items.findIndex((one) => one.branches.length || one.loop);
  view.item = Math.max(0, first);
  view.control = item().control || "load";
  const met = item().events.find((event) => event.kind === "fold" || event.kind === "touch");
  if (met) Object.assign(view, { branch: met.branch, row: Math.round(met.position) });
  menu("x", "across", NAMES.map((name) => [name, WORDS[name]]));
  menu("y", "up", NAMES.map((name) => [name, WORDS[name]]));
  const controls = [...new Set(data.items.flatMap((one) => one.controls || []))];
  menu("control", "control", controls.map((c) => [c, c]));
  const whole = element("label", {}, byId("controls")), box = element("input", { type: "checkbox", id: "all" }, whole);
  whole.append("whole curve");
  box.addEventListener("change", () => { view.all = box.checked; redraw(); });
  const loop = slider("loop", "loop", 1, play), button = element("button", { type: "button", id: "play" }, byId("controls"), "▶ play the loop");
  let timer = null;
  button.addEventListener("click", () => {
    if (timer) { clearInterval(timer); timer = null; button.textContent = "▶ play the loop"; return; }
    button.textContent = "⏸ pause";
    const stride = Math.max(1, Math.round(Number(loop.max) / 240));
    timer = setInterval(() => {
      const next = Number(loop.value) + stride;
      loop.value = next > Number(loop.max) ? 0 : next;
      play(Number(loop.value));
    }, 40);
  });
  if (data.items.length > 1) {
    const grid = data.mode === "grid", sizes = data.parameters.map((name) => data.axes[name].length);
    const names = grid ? data.parameters : ["task"], places = names.map(() => 0);
    names.forEach((name, k) => {
      const shown = (v) => grid ? `${digits(data.axes[name][v], 4)} ${unit(name)}` : String(v);
      const made = slider(`parameter${k}`, name, (grid ? sizes[k] : data.items.length) - 1, (value) => {
        const before = view.values, back = view.step >= travel().turn;
        places[k] = value;
        view.item = grid ? places.reduce((sum, p, j) => sum * sizes[j] + p, 0) : value;
        text.textContent = shown(value);
        redraw();
        if (before) keep(before, back);
      });
      if (!grid) made.value = view.item;
      const text = element("span", { class: "soft", style: "min-width:6.5em" }, made.parentElement, shown(Number(made.value)));
    });
    if (grid) view.item = 0;
  }
  redraw();
  let width = innerWidth;
  addEventListener("resize", () => { if (innerWidth !== width) { width = innerWidth; redraw(); } });
}
unpack(byId("arrays").textContent).then((found) => {
  numbers = found;
  start();
  document.documentElement.dataset.ready = "yes";
}).catch((error) => { byId("status").textContent = `This page could not be drawn: ${error.message}`; throw error; });
