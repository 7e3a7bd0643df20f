"use strict";
const at = (id) => document.getElementById(id);
const root = document.documentElement;
const make = (tag, text, more = {}) => Object.assign(document.createElement(tag), text == null ? {} : { textContent: text }, more);

// Numbers as people read them; JSON has null for infinity.
const shown = (value, digits = 4) => value == null ? "–" : plots.number(Number(Number(value).toPrecision(digits)));

// ---- The library in its worker -------------------------------------------------------------------------------------

let worker, module, next = 0;
const asked = new Map();
let memoryBytes = 0;
const unpacked = async (id) => {
  const bytes = Uint8Array.from(atob(at(id).textContent), (c) => c.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
};
const send = (content) => new Promise((done) => { asked.set(++next, done); worker.postMessage({ id: next, ...content }); });
const ask = (message) => send({ message });
const start = async () => {
  worker?.terminate();
  asked.clear();
  worker = new Worker(URL.createObjectURL(new Blob([at("worker").textContent], { type: "text/javascript" })));
  worker.onmessage = ({ data }) => {
    if (data.work) return progress(data);
    const done = asked.get(data.id);
    asked.delete(data.id);
    memoryBytes = data.memoryBytes;
    done?.(data.answer);
  };
  const { error } = await send({ module });
  if (error) throw new Error(error);
};

// ---- What is said --------------------------------------------------------------------------------------------------

const say = (text, isBad = false) => { at("state").textContent = text; at("state").className = isBad ? "bad" : ""; };
let began = 0, isBusy = false;
const busy = (work, allowed) => {
  isBusy = Boolean(work);
  at("busy").hidden = !work;
  for (const id of ["identify", "survey", "simulate", "expect", "loop", "flight"]) at(id).disabled = isBusy && id !== allowed;
  if (work) { began = performance.now(); at("progress").removeAttribute("value"); say(work); }
};
const progress = ({ work, done, all }) => {
  if (!isBusy) return;
  say(`${work[0].toUpperCase()}${work.slice(1)}.`);
  if (all > 0) at("progress").value = done / all; else at("progress").removeAttribute("value");
};
// Asks for something that takes long, while only `allowed` can be pressed. Undefined: it failed, and the page says why.
const waited = async (work, content, allowed) => {
  busy(work, allowed);
  const answer = await send(content);
  busy(null);
  if (answer.stopped) await start();
  if (answer.error) { say(answer.error, true); return undefined; }
  return answer;
};
const took = () => `${((performance.now() - began) / 1000).toFixed(2)} s`;

// ---- State in the fragment: what was set for one loop of one recording, never data ---------------------------------

const NAMES = ["kp", "ki", "kd", "filter_s"], LABELS = { kp: "Kp", ki: "Ki", kd: "Kd", filter_s: "filter (s)" };
const SYSTEM = ["vendor", "input-range", "output-range"];
const CHOICES = ["from", "to", "structure", "style", ...SYSTEM, "more"];
let kept, linked, fromAddress;
const writeAddress = () => history.replaceState(null, "", kept.size ? `#${kept}` : location.pathname + location.search);
const keep = (name, value) => {
  if ((kept.get(name) ?? "") === String(value ?? "")) return;
  if (value == null || value === "") kept.delete(name); else kept.set(name, value);
  writeAddress();
};
const readAddress = () => {
  kept = new URLSearchParams(location.hash.slice(1));
  // Gains of the link that opened the page, for its recording and loop.
  linked = NAMES.every((name) => kept.has(name) && Number.isFinite(Number(kept.get(name)))) ? Object.fromEntries(NAMES.map((name) => [name, Number(kept.get(name))])) : undefined;
};
readAddress();
const forget = (names) => { linked = fromAddress = undefined; for (const name of names) keep(name); };
// Drops what was set for another loop or recording. Whether something was.
const belongTo = (key, flight, loop) => {
  const own = Object.entries({ file: key, flight, loop });
  const all = [...CHOICES, ...NAMES];
  const isOther = own.some(([name, value]) => (kept.get(name) ?? "") !== value) && all.some((name) => kept.has(name));
  if (isOther) forget(all);
  for (const [name, value] of own) keep(name, value);
  return isOther;
};

// ---- Opening -------------------------------------------------------------------------------------------------------

let file, log, signals, report, view;
// Whether a file is answered as soon as it is open.
let isAutomatic = true;
// Hides the section and those after it. What was identified goes with them.
const hideAfter = (id) => {
  const all = ["recording", "settings", "system", "result", "evidence", "design"];
  for (const later of all.slice(all.indexOf(id))) at(later).hidden = true;
  report = undefined;
};
// `again`: after a reload, with the loop that was open.
const open = async (blob, name, again = false) => {
  hideAfter("recording");
  const opened = file = { blob, name };
  wasAnswered = false;
  if (!again) forgetWork();
  const answer = await waited(`Reading ${name}.`, { file });
  if (!answer || opened !== file) return;
  file.key = answer.key;
  const isKept = kept.get("file") === file.key;
  log = answer.log;
  at("drop").classList.add("small");
  at("drop-text").textContent = "Another recording:";
  at("hint").hidden = true;
  at("loops").hidden = !log;
  forgetSurvey();
  if (log) {
    at("flight").replaceChildren(...log.flights.map((flight, k) => make("option", `${k + 1}: ${(flight.span_s[1] - flight.span_s[0]).toFixed(0)} s, ${flight.version || flight.firmware}`, { value: k + 1 })));
    const lengths = log.flights.map(({ span_s: [from, to] }) => to - from);
    at("flight").value = (isKept && kept.get("flight")) || 1 + lengths.indexOf(Math.max(...lengths));
    if (!at("flight").value) at("flight").value = 1;
    at("flight-label").hidden = log.flights.length < 2;
    fillLoops();
    if (isKept && [...at("loop").options].some((one) => one.value === kept.get("loop"))) at("loop").value = kept.get("loop");
    if (!at("loop").options.length) return say("The log has no control loop with input and output. Its advice: " + (log.flights[0]?.advice ?? []).join(" "), true);
  }
  const isSet = isKept && [...CHOICES, ...NAMES].some((name) => kept.has(name));
  const isOther = belongs();
  await readSignals();
  if (isOther && signals) say(`${at("state").textContent} Settings of another recording or loop are not used.`);
  if (isAutomatic && signals && opened === file) await answerAll(opened, isSet, again);
  if (opened === file) await keepWork();
};
// The answer without a click: of a flight log all loops, then the first one to change; where settings are given, their loop.
const answerAll = async (of, isSet, again) => {
  const own = again && at("loop").value;
  if (log && at("loop").options.length > 1 && !isSet) {
    const loops = await surveyAll();
    if (!loops || of !== file) return;
    if (own) return openLoop(own);
    const first = ["change", "first_gains", "keep"].map((verdict) => loops.find(({ answer }) => answer?.verdict === verdict)).find(Boolean);
    if (!first) return say("No loop is told by this flight: fly a chirp, or 30 s of quick stick movements on each axis.");
    return openLoop(first.name);
  }
  await identify();
  at("settings-panel").open = !report || report.verdict.kind !== "identified";
};
const openLoop = async (name) => {
  if (at("loop").value !== name) { at("loop").value = name; belongs(); await readSignals(); }
  await identify();
  at("settings-panel").open = !report || report.verdict.kind !== "identified";
};
// The settings belong to the loop that is chosen.
const belongs = () => belongTo(file.key, log ? at("flight").value : "", log ? at("loop").value : "");
const fillLoops = () => {
  const flight = log.flights[at("flight").value - 1];
  const loops = (flight?.loops ?? []).filter((one) => one.input && one.output);
  at("loop").replaceChildren(...loops.map((one) => make("option", one.name)));
};
const flightSettings = () => (log && log.flights.length > 1 ? { flight: at("flight").value } : {});
// Further settings, written as NAME=VALUE or --name VALUE.
const moreSettings = () => {
  const all = {};
  for (const [, name, value] of at("more").value.matchAll(/(?:--)?([a-z][\w-]*)(?:\s*=\s*|\s+|$)("[^"]*"|\S*)/g)) all[name.replaceAll("-", "_")] = value.replace(/^"|"$/g, "");
  return all;
};
// The choice of a loop and the further settings.
const loopSettings = () => {
  const [axis, kind] = log ? at("loop").value.split(" ") : [];
  return { ...(kind ? { axis, loop: kind } : log ? { loop: axis } : {}), ...flightSettings(), ...moreSettings() };
};
const words = (text) => (text.match(/"[^"]*"|\S+/g) ?? []).map((word) => word.replace(/^"|"$/g, ""));
const settings = () => {
  const all = loopSettings();
  for (const id of CHOICES) if (id !== "more" && at(id).value !== "") all[id.replaceAll("-", "_")] = at(id).value;
  return all;
};
let reading;
const readSignals = () => (reading = readNow());
const readNow = async () => {
  isUnread = false;
  hideAfter("result");
  for (const id of CHOICES) at(id).value = kept.get(id) ?? "";
  const answer = await waited("Reading the signals.", { message: { do: "signals", settings: loopSettings() } }, "identify");
  // The names of columns can be given as options.
  at("recording").hidden = !log || !at("loop").options.length;
  at("settings").hidden = !answer && Boolean(log) && !at("loop").options.length;
  at("settings-panel").open = true;
  at("signals").hidden = !answer;
  if (!answer) { signals = undefined; return; }
  signals = answer;
  showSystem();
  say(`${file.name}: ${signals.samples.toLocaleString("en")} samples, ${shown(signals.span_s[1] - signals.span_s[0])} s.`);
  at("notes").textContent = log ? `Input: ${signals.names[0]}. Output: ${signals.names[1]}.` : signals.notes.map((note) => `${note[0].toUpperCase()}${note.slice(1)}.`).join(" ");
  view = signals.span_s;
  await drawSignals();
};

// ---- The work over a reload: the file in the browser's database, under a name that only this tab knows -------------

const STORE = "work", A_DAY_MS = 86_400_000;
let keptFile;
const tab = () => sessionStorage.tab ??= crypto.randomUUID?.() ?? String(Math.random());
const done = (request) => new Promise((resolve, reject) => { request.onsuccess = () => resolve(request.result); request.onerror = () => reject(request.error); });
const inStore = async (work) => {
  const request = indexedDB.open("onecycle-studio", 1);
  request.onupgradeneeded = () => request.result.createObjectStore(STORE);
  const database = await done(request);
  try { return await work(database.transaction(STORE, "readwrite").objectStore(STORE)); } finally { database.close(); }
};
const keepWork = async () => {
  const of = file;
  if (!of) return;
  try {
    await inStore((store) => done(store.put({ blob: of.blob, name: of.name, before, at: Date.now() }, tab())));
    if (of === file) keptFile = of;
  } catch { keptFile = undefined; }
};
const forgetWork = async () => {
  keptFile = undefined;
  try { await inStore((store) => done(store.delete(tab()))); } catch { /* Nothing is kept. */ }
};
// The file that was open before a reload, or before the way back to this page. Those of a day ago are deleted.
const keptWork = async () => {
  const [{ type }] = performance.getEntriesByType("navigation");
  try {
    return await inStore(async (store) => {
      const [keys, all] = await Promise.all([done(store.getAllKeys()), done(store.getAll())]);
      const isOld = ({ at: kept }) => kept < Date.now() - A_DAY_MS;
      await Promise.all(keys.filter((key, k) => isOld(all[k])).map((key) => done(store.delete(key))));
      return type === "navigate" ? undefined : all[keys.indexOf(tab())];
    });
  } catch { return undefined; }
};

// ---- Signals, and a stretch chosen with the mouse ------------------------------------------------------------------

let thinned, frame;
const drawSignals = async () => {
  const [from_s, to_s] = view;
  const points = Math.max(200, 2 * at("signals").clientWidth);
  thinned = await ask({ do: "view", from_s, to_s, points });
  if (thinned.error) return say(thinned.error, true);
  redrawSignals();
};
const redrawSignals = () => {
  if (!thinned || !signals) return;
  const unit = (k) => (signals.names[k].length > 20 ? ["input", "output"][k] : signals.names[k]) + (signals.units[k] ? ` (${signals.units[k]})` : "");
  const spans = signals.parts.map(([from, to]) => ({ from, to }));
  const chosen = stretch();
  if (chosen) spans.push({ from: chosen[0], to: chosen[1], chosen: true });
  const set = thinned.set_point ?? [];
  const panels = [
    { title: "Output and set-point over time", y: unit(1), curves: [{ points: set, hue: "reference" }, { points: thinned.output, hue: "model" }] },
    { title: "Input over time", y: unit(0), curves: [{ points: thinned.input, hue: "input" }] },
  ];
  if (at("signals").childElementCount !== 2) at("signals").replaceChildren(make("div", null, { id: "signals-0" }), make("div", null, { id: "signals-1" }));
  panels.forEach((panel, k) => {
    frame = plots.draw(at(`signals-${k}`), { ...panel, x: "time (s)", xs: view, ys: plots.range(panel.curves.map((c) => c.points)), spans, height: k ? 170 : 230 });
  });
};
// The chosen stretch, or undefined.
const stretch = () => {
  const [from, to] = ["from", "to"].map((id) => at(id).value === "" ? null : Number(at(id).value));
  return from == null && to == null ? undefined : [from ?? signals.span_s[0], to ?? signals.span_s[1]];
};
const choose = (from, to) => {
  at("from").value = from ?? ""; at("to").value = to ?? "";
  keep("from", from); keep("to", to);
  outdate();
  redrawSignals();
};
let dragged = null;
const time = (event) => {
  const box = at("signals-0").getBoundingClientRect();
  const share = (event.clientX - box.left - frame.left) / frame.width;
  return view[0] + Math.min(Math.max(share, 0), 1) * (view[1] - view[0]);
};
at("signals").addEventListener("pointerdown", (event) => { if (frame && event.button === 0) { dragged = time(event); at("signals").setPointerCapture(event.pointerId); } });
at("signals").addEventListener("pointermove", (event) => {
  if (dragged == null) return;
  const [a, b] = [dragged, time(event)].sort((x, y) => x - y);
  if (b - a > 0.003 * (view[1] - view[0])) choose(Number(a.toPrecision(7)), Number(b.toPrecision(7)));
});
for (const end of ["pointerup", "pointercancel"]) at("signals").addEventListener(end, () => { dragged = null; });
for (const id of ["from", "to"]) at(id).onchange = () => { keep(id, at(id).value); redrawSignals(); };
at("whole").onclick = () => { choose(null, null); view = signals.span_s; drawSignals(); };
at("zoom").onclick = () => { const chosen = stretch(); view = chosen && chosen[1] > chosen[0] ? chosen : signals.span_s; drawSignals(); };
// What was identified is not of these settings any more.
const outdate = () => {
  forget(NAMES);
  if (report) say("The settings have changed: press Identify.");
  hideAfter("result");
};
for (const id of CHOICES) at(id).addEventListener("input", outdate);
for (const id of ["style", "more"]) at(id).addEventListener("input", () => forgetSurvey());
for (const id of ["structure", "style"]) at(id).onchange = () => keep(id, at(id).value);

// ---- Controllers with gains of their own ---------------------------------------------------------------------------

let vendors = [], wasAnswered = false;
const vendor = () => vendors.find(({ name }) => name === at("vendor").value);
const showSystem = () => {
  const of = vendor();
  at("system").hidden = !signals || Boolean(log);
  at("input-range-label").hidden = !of?.counts_output;
  at("input-range").placeholder = of ? `0..${of.full_input}` : "";
  at("output-range-label").hidden = !of?.has_range_of_measurement;
};
for (const id of SYSTEM) at(id).onchange = async () => {
  const of = vendor();
  if (!of?.counts_output) at("input-range").value = "";
  // The recorded input where it is larger than the controller's.
  else if (id === "vendor") at("input-range").value = signals.full_scale > of.full_input ? `0..${signals.full_scale}` : "";
  if (!of?.has_range_of_measurement) at("output-range").value = "";
  for (const name of SYSTEM) keep(name, at(name).value);
  showSystem();
  if (!wasAnswered) return;
  if (of?.has_range_of_measurement && !at("output-range").value) { say("This controller counts in percent: give the range of its measurement."); return at("output-range").focus(); }
  await pressed;
  if (isBusy) isWanted = true; else if (!report) identify();
};
// What to paste or to type in: the lines of the controller, else names and values.
const toType = () => drawn?.lines ?? (drawn?.named ?? []).map(({ name, unit, full }) => `${name} = ${Number(full.toPrecision(6))} ${unit}`.trim()).join("\n");
at("copy").onclick = async () => {
  try {
    await navigator.clipboard.writeText(toType());
    at("copied").textContent = "Copied.";
  } catch {
    at("lines").textContent = toType();
    at("lines").hidden = false;
    getSelection().selectAllChildren(at("lines"));
    at("copied").textContent = document.execCommand("copy") ? "Copied." : "Press Ctrl+C.";
  }
};
at("save-text").onclick = () => { save(`${toType()}\n`, `${stem()}.gains.txt`); at("copied").textContent = "Saved."; };
// Other columns are read after the press on a button that ended the typing: a button that is disabled or moves under a
// press is not clicked.
let isUnread = false, pressed = Promise.resolve();
addEventListener("pointerdown", () => {
  pressed = new Promise((done) => { for (const end of ["pointerup", "pointercancel"]) addEventListener(end, () => setTimeout(done), { once: true }); });
}, true);
at("more").onchange = async () => {
  keep("more", at("more").value);
  if (log) return;
  isUnread = true;
  await pressed;
  if (isUnread) readSignals();
};
at("loop").onchange = () => { belongs(); readSignals(); };
at("flight").onchange = () => { forgetSurvey(); fillLoops(); belongs(); readSignals(); };
at("settings-panel").ontoggle = () => { if (at("settings-panel").open && signals) redrawSignals(); };

// ---- Tables --------------------------------------------------------------------------------------------------------

const row = (cells) => {
  const line = make("tr");
  cells.forEach((cell, k) => line.append(k ? make("td", cell) : make("th", cell, { scope: "row" })));
  return line;
};
const VERDICTS = { change: "CHANGE", keep: "KEEP YOURS", first_gains: "FIRST GAINS", not_yet: "NOT YET" };
let surveyed;
const forgetSurvey = () => { surveyed = undefined; at("surveyed").hidden = at("all").hidden = true; };
// What to do about a loop, as the program's card says it.
const loopCard = ({ name, answer }) => {
  const card = make("div", null, { className: `card ${answer.verdict}` });
  const title = make("h3"), button = make("button", name, { type: "button" });
  button.onclick = () => openLoop(name);
  title.append(button);
  card.append(title, make("p", `${VERDICTS[answer.verdict]}: ${answer.reason.replace(/\.$/, "")}.`));
  if (answer.verdict !== "change" && answer.verdict !== "first_gains") return card;
  const table = make("table"), body = make("tbody"), head = make("tr");
  for (const title of ["gain", "now", "half", "full"]) head.append(make("th", title, { scope: "col" }));
  table.append(make("thead"), body);
  table.tHead.append(head);
  for (const gain of answer.gains) body.append(row([gain.unit ? `${gain.name} (${gain.unit})` : gain.name, ...[gain.now, gain.half, gain.full].map((value) => shown(value, 3))]));
  const { now, half, full } = answer.figures ?? {};
  body.append(row(["phase margin", ...[now, half, full].map((of) => degrees(of?.phase_margin_deg))]));
  card.append(table);
  return card;
};
// Every loop of the flight: the loops, or undefined if it failed.
const surveyAll = async () => {
  const style = at("style").value ? { style: at("style").value } : {};
  const of = file, settings = { ...flightSettings(), ...style, ...moreSettings() };
  const answer = await waited("Identifying every loop.", { message: { do: "survey", settings } });
  if (!answer || of !== file) return undefined;
  say(`Every loop in ${took()}.`);
  surveyed = answer;
  const cards = make("div", null, { className: "cards" });
  cards.append(...answer.loops.map(loopCard));
  at("surveyed").replaceChildren(cards);
  at("surveyed").hidden = false;
  at("all").hidden = !answer.parameters;
  return answer.loops;
};
at("survey").onclick = surveyAll;
const saveAll = (which) => {
  const { parameters } = surveyed;
  save(parameters[which], `${stem(false)}_all.${which === "apply" ? "" : "restore."}${parameters.ending}`);
  say(which === "apply" ? "The half step of all loops to change is saved. Save the file of the old parameters as well, before you fly." : "Saved: this file sets the old values again.");
};
at("save-all").onclick = () => saveAll("apply");
at("save-all-restore").onclick = () => saveAll("restore");

// ---- Identification ------------------------------------------------------------------------------------------------

// Whether a setting was changed during an identification, which is then repeated.
let isWanted = false;
const identify = async () => {
  if (isUnread) readSignals();
  await reading;
  hideAfter("result");
  const of = file, asked = settings();
  const answer = await waited("Identifying.", { message: { do: "identify", settings: asked } });
  if (isWanted) { isWanted = false; return identify(); }
  if (!answer || of !== file) return;
  if (JSON.stringify(asked) !== JSON.stringify(settings())) return say("The settings have changed: press Identify.");
  report = answer;
  wasAnswered = true;
  showResult();
};
at("identify").onclick = identify;
// Units of time are at the end of a key.
const unitOf = (key) => /rad_per_s$/.test(key) ? " (rad/s)" : /_s$/.test(key) ? " (s)" : "";
const showResult = () => {
  const isFound = report.verdict.kind === "identified";
  say(`${file.name}: ${isFound ? "identified" : "no process identified"} in ${took()}.`);
  at("system").hidden = Boolean(log) || !isFound;
  const found = report.process ?? {};
  at("verdict").className = isFound ? "verdict" : "verdict no";
  const answer = report.answer;
  at("verdict").textContent = `${VERDICTS[answer.verdict]}: ${answer.reason.replace(/\.$/, "")}.`;
  const known = isFound ? [`Identified: ${report.structure}, ${report.formula}.`, answer.sure, answer.watch] : [report.verdict.advice];
  at("advice").textContent = known.filter(Boolean).join(" ");
  const of = (name, value) => report.below?.includes(name) ? [`below ${shown(value.high)}`, "", ""] : [value.estimate, value.low, value.high].map((end) => shown(end));
  const rows = Object.entries(found).filter(([, value]) => value && typeof value === "object" && "low" in value);
  at("parameters").hidden = !rows.length;
  at("parameters").tBodies[0].replaceChildren(...rows.map(([name, value]) => row([value.symbol + unitOf(name), ...of(name, value)])));
  const groups = [["Remarks", report.remarks], ["Details", report.details]];
  at("remarks").replaceChildren(...groups.filter(([, all]) => all.length).flatMap(([title, all]) => {
    const list = make("ul");
    list.append(...all.map((one) => make("li", one)));
    return [make("h3", title), list];
  }));
  at("report").open = false;
  at("frame").removeAttribute("srcdoc");
  at("result").hidden = at("evidence").hidden = false;
  at("verdict").focus({ preventScroll: true });
  showDesign();
};
const save = (text, name) => {
  const link = make("a", null, { href: URL.createObjectURL(new Blob([text])), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
};
// Name of a file to save: that of the recording, and of a flight log its loop.
const stem = (hasLoop = true) => {
  const flight = log?.flights.length > 1 ? [`flight${at("flight").value}`] : [];
  return [file.name.replace(/\.[^.]*$/, ""), ...flight, ...(log && hasLoop ? at("loop").value.split(" ") : [])].join("_");
};
at("save-json").onclick = async () => { const of = report, { text } = await ask({ do: "json" }); if (of === report) save(text, `${stem()}.json`); };
const page = () => waited("Drawing the report.", { message: { do: "page" } });
at("save-report").onclick = async () => { const of = report, answer = await page(); if (answer && of === report) { say("The report is saved."); save(answer.text, `${stem()}.html`); } };
at("report").ontoggle = async () => {
  if (!at("report").open || at("frame").hasAttribute("srcdoc")) return;
  const of = report, answer = await page();
  if (!answer || of !== report) return;
  say("The report is drawn.");
  at("frame").onload = () => {
    const inside = at("frame").contentDocument;
    if (!inside?.body || !at("frame").hasAttribute("srcdoc")) return;
    themed();
    const fit = () => { if (inside.body) at("frame").style.height = `${inside.body.scrollHeight + 40}px`; };
    new ResizeObserver(fit).observe(inside.body);
    fit();
  };
  at("frame").srcdoc = answer.text;
};

// ---- Controller by hand --------------------------------------------------------------------------------------------

const STEPS = 1000, DECADES = 3;
let gains, proposal, against, past = [], future = [], scale, designs = [];
const only = (controller) => Object.fromEntries(NAMES.map((name) => [name, controller[name] ?? 0]));
const showDesign = async () => {
  at("design").hidden = !report.controllers;
  if (!report.controllers) return;
  const first = report.controller ?? report.controllers.find((one) => one.controller)?.controller ?? report.against?.controller ?? { kp: 0, ki: 0, kd: 0, filter_s: 0 };
  proposal = only(first);
  [past, future, designs] = [[], [], []];
  const crossover = report.margins?.gain_crossover_rad_per_s ?? 1, kp = proposal.kp || 1;
  // Middle of a slider whose proposed gain is zero.
  scale = { kp, ki: proposal.ki || 0.1 * kp * crossover, kd: proposal.kd || 0.1 * kp / crossover, filter_s: proposal.filter_s || 0.05 / crossover };
  buildSliders();
  for (const id of ["save-half", "save-whole", "save-restore", "steps"]) at(id).hidden = !log;
  exported("");
  isWhole = false;
  against = before && before.key !== file.key ? before : report.against ? { name: "gains in force", gains: only(report.against.controller) } : { name: "proposed gains", gains: proposal };
  at("calm").disabled = true;
  const of = report;
  await judgeAgainst();
  if (of !== report) return;
  [fromAddress, linked] = [linked, undefined];
  use(fromAddress ?? proposal);
  const answer = await ask({ do: "trade_off" });
  if (of !== report || answer.error || !answer.length) return;
  // Where noise limits the gains, sharper designs repeat the last one.
  designs = answer.filter((one, k) => !k || Math.abs(one.controller.kp / answer[k - 1].controller.kp - 1) > 1e-4 || Math.abs(one.controller.kd - answer[k - 1].controller.kd) > 1e-4 * Math.abs(one.controller.kd));
  Object.assign(at("calm"), { max: designs.length - 1, disabled: false });
  showCalm();
};
// The loop of another file, as it was drawn there: before and after a change.
let before;
at("keep-before").onclick = () => {
  before = { name: stem().replaceAll("_", " "), key: file.key, judged: drawn };
  exported("Kept: the next file is compared with this loop.");
  keepWork();
};
const judgeAgainst = async () => {
  if (against !== before) against.judged = await ask({ do: "judge", gains: against.gains });
  at("against-name").textContent = at("against-head").textContent = against.name;
};
// A slider: zero on its left, else a logarithmic scale about the proposal.
const position = (name, value) => value === 0 ? 0 : Math.min(Math.max(STEPS * (0.5 + Math.log10(Math.abs(value / scale[name])) / DECADES), 1), STEPS);
const valueAt = (name, place) => place === 0 ? 0 : scale[name] * 10 ** (DECADES * (place / STEPS - 0.5));
const buildSliders = () => at("gains").replaceChildren(...NAMES.map((name) => {
  const line = make("div", null, { className: "gain" });
  const slide = make("input", null, { type: "range", id: `slide-${name}`, min: 0, max: STEPS, step: 1 });
  const exact = make("input", null, { type: "number", id: `exact-${name}`, step: "any" });
  exact.setAttribute("aria-label", `${LABELS[name]}, exactly`);
  slide.oninput = () => { remember(slide); use({ ...gains, [name]: Number(valueAt(name, Number(slide.value)).toPrecision(4)) }); };
  slide.onchange = () => { slide.isMoving = false; };
  exact.onchange = () => { if (exact.value !== "" && Number.isFinite(Number(exact.value))) { remember(exact); exact.isMoving = false; use({ ...gains, [name]: Number(exact.value) }); } };
  line.append(make("label", LABELS[name], { htmlFor: slide.id }), slide, exact);
  return line;
}));
// One step of undo for a whole move of a slider.
const remember = (control) => { if (control.isMoving) return; control.isMoving = true; past.push(gains); future = []; };
let isAsking = false, wanted = null, rest;
const use = async (to) => {
  gains = to;
  at("undo").disabled = !past.length; at("redo").disabled = !future.length;
  for (const name of NAMES) {
    at(`slide-${name}`).value = position(name, gains[name]);
    at(`slide-${name}`).setAttribute("aria-valuetext", shown(gains[name]));
    if (document.activeElement !== at(`exact-${name}`)) at(`exact-${name}`).value = Number(gains[name].toPrecision(6));
    keep(name, same(gains, proposal) ? null : gains[name]);
  }
  at("origin").hidden = !isFromAddress();
  showCalm();
  clearTimeout(rest);
  wanted = { do: "judge", gains };
  if (!isAsking) await answerWanted();
};
// Answers what was asked for last, and draws its bands when the gains have been at rest.
const answerWanted = async () => {
  isAsking = true;
  while (wanted) {
    const message = wanted;
    wanted = null;
    const from = performance.now();
    // The compared responses over the same time.
    const of = report;
    if (message.bands && drawn?.end_s && against !== before) against.judged = await ask({ do: "judge", gains: against.gains, end_s: drawn.end_s });
    const answer = await ask(message);
    if (!of || of !== report) continue;
    drawDesign(answer);
    if (message.bands) continue;
    document.body.dataset.latencyMs = performance.now() - from;
    clearTimeout(rest);
    if (!wanted) rest = setTimeout(() => { wanted ??= { ...message, bands: true }; if (!isAsking) answerWanted(); }, 150);
  }
  isAsking = false;
};
const same = (a, b) => NAMES.every((name) => Math.abs(a[name] - b[name]) <= 1e-4 * Math.abs(b[name]));
const isFromAddress = () => Boolean(fromAddress) && same(gains, fromAddress);
const showCalm = () => {
  if (!designs.length || !gains || !report) return;
  const now = designs.findIndex(({ controller }) => same(gains, only(controller)));
  const isProposal = same(gains, proposal);
  const nearest = designs.reduce((best, { ms_limit }, k) => Math.abs(ms_limit - report.margins?.ms) < Math.abs(designs[best].ms_limit - report.margins?.ms) ? k : best, 0);
  if (now >= 0 || isProposal) at("calm").value = now >= 0 ? now : nearest;
  at("calm-text").textContent = isProposal ? report.controller?.style ?? "proposed" : now >= 0 ? `Ms at most ${designs[now].ms_limit}` : isFromAddress() ? "from the address" : "by hand";
};
at("calm").oninput = () => { remember(at("calm")); use(only(designs[at("calm").value].controller)); };
at("calm").onchange = () => { at("calm").isMoving = false; };
const change = (to) => { past.push(gains); future = []; use(to); };
at("proposed").onclick = () => change(proposal);
const undo = () => { if (past.length) { future.push(gains); use(past.pop()); } };
const redo = () => { if (future.length) { past.push(gains); use(future.pop()); } };
at("undo").onclick = undo;
at("redo").onclick = redo;
document.addEventListener("keydown", (event) => {
  if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z" || at("design").hidden || /^(text|number)$/.test(event.target.type)) return;
  event.preventDefault();
  if (event.shiftKey) redo(); else undo();
});
at("compare").onclick = async () => { const of = report; against = { name: "kept gains", gains }; await judgeAgainst(); if (of === report) use(gains); };
const degrees = (value) => value == null ? "–" : `${value.toFixed(1)}°`;
const percent = (value) => value == null ? "–" : `${(100 * value).toFixed(0)} %`;
const seconds = (value) => value == null ? "–" : value < 0.1 ? `${shown(1000 * value, 3)} ms` : `${shown(value, 3)} s`;
const FIGURES = [
  ["stable", (of) => of.is_stable ? "yes" : "no"],
  ["phase margin", (of) => degrees(of.figures.margins?.phase_margin_deg)],
  ["gain margin", (of) => shown(of.figures.margins?.gain_margin, 3)],
  ["delay margin", (of) => seconds(of.figures.margins?.delay_margin_s)],
  ["Ms", (of) => shown(of.figures.margins?.ms, 3)],
  ["Mt", (of) => shown(of.figures.margins?.mt, 3)],
  ["overshoot", (of) => percent(of.figures.step?.overshoot)],
  ["rise time", (of) => seconds(of.figures.step?.rise_time_s)],
  ["settling time", (of) => seconds(of.figures.step?.settling_time_s)],
  ["load: IAE", (of) => shown(of.figures.load_iae, 3)],
  ["load: peak", (of) => shown(of.figures.load_peak, 3)],
  ["noise at the actuator", (of) => percent(of.figures.noise_share)],
  ["stable over the error bars", (of) => percent(of.least?.stable)],
  ["least phase margin over them", (of) => degrees(of.least?.phase_margin_deg)],
  ["largest Ms over them", (of) => of.least && of.least.ms == null ? "infinite" : shown(of.least?.ms, 3)],
];
let drawn;
const drawDesign = (of) => {
  drawn = of;
  if (of.error) return say(of.error, true);
  const other = against.judged;
  at("named").tBodies[0].replaceChildren(...(of.named ?? []).map((gain) => row([gain.unit ? `${gain.name} (${gain.unit})` : gain.name, ...[gain.now, gain.half, gain.full].map((value) => shown(value))])));
  at("named").hidden = !of.named?.length;
  at("named").classList.toggle("first-gains", !of.named?.some(({ now }) => now != null));
  at("lines").textContent = of.lines ?? "";
  at("lines").hidden = !of.lines;
  at("copied").textContent = "";
  at("figures").tBodies[0].replaceChildren(...FIGURES.map(([name, text]) => row([name, text(of), other.error ? "–" : text(other)])));
  at("figures").tBodies[0].classList.toggle("bad", !of.is_stable);
  at("limits").textContent = of.asks ?? "";
  at("summary").textContent = of.is_stable ? `Phase margin ${degrees(of.figures.margins?.phase_margin_deg)}, Ms ${shown(of.figures.margins?.ms, 3)}.` : "The loop is unstable.";
  for (const id of ["copy", "save-text"]) at(id).disabled = !of.is_stable;
  for (const id of ["step", "effort", "load", "nyquist"]) if (!of.is_stable) at(id).replaceChildren(make("p", "The loop is unstable with these gains.", { className: "bad" }));
  if (!of.is_stable) return;
  const band = (rows, low, times) => rows ? times.map(([t], k) => [t, rows[k][low], rows[k][low + 1]]) : [];
  const responses = [["step", "step", 1, 0, "step of the set-point", "model"], ["effort", "step", 2, 2, "controller's output", "input"], ["load", "load", 1, 0, "step of the load", "model"]];
  for (const [id, from, column, low, y, hue] of responses) {
    const rows = of[from];
    if (!rows) { at(id).replaceChildren(make("p", "The response is too slow to simulate.", { className: "faint" })); continue; }
    const pick = (all) => (all ?? []).map((one) => [one[0], one[column]]);
    const curves = [{ points: pick(other.error ? [] : other[from]), hue: "reference", dash: true }, { points: pick(rows), hue }];
    const ends = band(of[`${from}_band`], low, rows);
    const xs = [0, of.end_s ?? 1], include = id === "step" ? [0, 1] : [0];
    const ys = plots.range([curves[1].points, ends, curves[0].points.filter(([x]) => x <= xs[1])], 1, include);
    plots.draw(at(id), { title: `${y} over time`, x: "time (s)", y, xs, ys, curves, bands: [{ rows: ends, hue }] });
  }
  const locus = (all) => (all ?? []).map(([, re, im]) => [re, im]);
  plots.draw(at("nyquist"), {
    title: "Nyquist's plot", x: "real part", y: "imaginary part", square: true, xs: [-2.6, 0.8], ys: [-1.9, 0.9],
    curves: [{ points: other.error ? [] : locus(other.open_loop), hue: "reference", dash: true }, { points: locus(of.open_loop), hue: "model" }],
    circles: [{ at: [-1, 0], radius: 1 / of.figures.margins.ms }], marks: [{ at: [-1, 0] }],
  });
};
const exported = (text, isBad = false) => { at("exported").textContent = text; at("exported").className = isBad ? "bad" : ""; };
// Whether gains that break limits are to be saved all the same.
const agreed = (question) => new Promise((done) => {
  at("ask-text").textContent = question;
  at("ask").returnValue = "";
  at("ask").onclose = () => { const isAgreed = at("ask").returnValue === "yes"; if (!isAgreed) exported("Not saved.", true); done(isAgreed); };
  at("ask").showModal();
});
at("ask-no").onclick = () => at("ask").close();
at("ask-yes").onclick = () => at("ask").close("yes");
at("save-gains").onclick = async () => {
  const of = report, chosen = gains;
  const { is_stable, figures, least, asks } = await ask({ do: "judge", gains: chosen, bands: true });
  if (of !== report || asks && !await agreed(asks)) return;
  save(JSON.stringify({ file: file.name, structure: of.structure, process: of.process, gains: chosen, judged: { is_stable, figures, least } }, null, 2), `${stem()}.gains.json`);
  exported("The gains are saved.");
};
// Whether the file saved last goes the whole way.
let isWhole = false;
// Saves one of the two files of the firmware: browsers ask before they save two at once.
const saveParameters = async (which, whole, says) => {
  const of = report, message = { do: "parameters", gains, whole, below_limits: which === "restore" };
  let answer = await ask(message);
  if (of !== report) return;
  if (answer.asks) {
    if (!await agreed(answer.asks) || of !== report) return;
    answer = await ask({ ...message, below_limits: true });
  }
  if (answer.error) return exported(answer.error, true);
  isWhole = whole;
  save(answer[which], `${stem()}.${which === "apply" ? "" : "restore."}${answer.ending}`);
  exported(which === "apply" ? `${says} ${answer.says} ${answer.broken ?? ""} Save the file of the old parameters as well, before you fly.` : says);
};
at("save-half").onclick = () => saveParameters("apply", false, "The half step is saved.");
at("save-whole").onclick = () => saveParameters("apply", true, "The whole step is saved.");
at("save-restore").onclick = () => saveParameters("restore", isWhole, "Saved: this file sets the old values again.");

// ---- Simulation ----------------------------------------------------------------------------------------------------

// Parameters, and a test that tells the process: the test of the page lists and tries each of them.
const PROCESSES = {
  soiptd: ["K=1, T_prop=0.0321, T_body=1.6886, tau=0.0237", "relay", "", 1000, ""],
  foptd: ["K=2, T=30, tau=5", "step", 200, 2, "--preroll 10"],
  soptd: ["K=2, T1=30, T2=5, tau=5", "step", 200, 2, "--preroll 10"],
  toptd: ["K=2, T1=30, T2=5, T3=2, tau=5", "prbs", 600, 2, "--pulse 10"],
  iptd: ["K=1, tau=0.1", "prbs", 60, 50, "--pulse 0.5"],
  integrator_lag: ["K=1, T=0.1, tau=0.05", "prbs", 60, 50, "--pulse 0.3"],
  double_integrator_lag: ["K/T_body=40, T_prop=0.05, tau=0.015", "relay", 8, 1000, ""],
  toiptd: ["K=1, T_prop=0.03, T_prop2=0.01, T_body=1.7, tau=0.02", "relay", 10, 1000, ""],
  resonant: ["K=1, w0=10, zeta=0.3, tau=0.02", "prbs", 40, 100, "--pulse 0.2"],
  resonant_lag: ["K=1, T=0.05, w0=10, zeta=0.3, tau=0.02", "prbs", 40, 100, "--pulse 0.15"],
};
at("s-process").append(...Object.keys(PROCESSES).map((name) => make("option", name)));
at("structure").append(...Object.keys(PROCESSES).map((name) => make("option", name)));
const setProcess = () => {
  const values = PROCESSES[at("s-process").value];
  ["parameters", "excitation", "duration", "rate", "more"].forEach((name, k) => { at(`s-${name}`).value = values[k]; });
};
at("s-process").onchange = setProcess;
setProcess();
const simulation = () => {
  const parameters = at("s-parameters").value.split(",").filter((part) => part.trim());
  const all = ["--process", [at("s-process").value, ...parameters].join(","), "--excitation", at("s-excitation").value];
  for (const [id, option] of [["amplitude", "--amplitude"], ["duration", "--duration"], ["rate", "--sample-rate"], ["noise", "--noise"], ["seed", "--seed"]]) {
    const { value } = at(`s-${id}`);
    if (value !== "") all.push(`${option}=${value}`);
  }
  return [...all, ...words(at("s-more").value)];
};
at("simulate").onclick = async () => {
  const answer = await waited("Simulating.", { message: { do: "simulate", options: simulation() } });
  if (answer) open(new Blob([answer.text]), "simulated.csv");
};
at("expect").onclick = async () => {
  const answer = await waited("Computing the bound.", { message: { do: "simulate", options: [...simulation(), "--expect"] } });
  at("expected").hidden = !answer;
  if (answer) { say("The intervals are those that an efficient estimator reaches."); at("expected").textContent = answer.text; }
};

// ---- Page ----------------------------------------------------------------------------------------------------------

const themed = () => {
  const inside = at("frame").contentDocument?.documentElement;
  const isDark = (root.dataset.theme || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light")) === "dark";
  if (inside && (inside.dataset.theme === "dark") !== isDark) at("frame").contentDocument.getElementById("theme")?.click();
};
at("theme").onclick = () => {
  const isDark = (root.dataset.theme || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light")) === "dark";
  root.dataset.theme = isDark ? "light" : "dark";
  keep("theme", root.dataset.theme);
  themed();
};
if (/^(light|dark)$/.test(kept.get("theme") ?? "")) root.dataset.theme = kept.get("theme");
at("file").onchange = () => {
  const [chosen] = at("file").files;
  if (chosen) open(chosen, chosen.name);
  // The same file can be chosen again.
  at("file").value = "";
};
at("example-hover").onclick = async () => open(new Blob([await unpacked("hover")]), "simulated_hover.csv");
at("example-flight").onclick = async () => open(new Blob([await unpacked("chirps")]), "px4_chirps.ulg");
at("cancel").onclick = async () => {
  busy(null);
  hideAfter("result");
  await start();
  say("Cancelled.");
  if (!file) return;
  const answer = await send({ file });
  if (answer.error || at("recording").hidden) return;
  await ask({ do: "signals", settings: loopSettings() });
};
// Another address in the same tab: settings of the open recording, or of none that is open.
addEventListener("hashchange", () => {
  const own = kept;
  readAddress();
  if (!file) return;
  if (kept.get("file") === file.key) return open(file.blob, file.name);
  [kept, linked] = [own, undefined];
  writeAddress();
  say("The address is that of another recording: its settings are not used.");
});
document.addEventListener("dragover", (event) => { event.preventDefault(); at("drop").classList.add("over"); });
document.addEventListener("dragleave", () => at("drop").classList.remove("over"));
document.addEventListener("drop", (event) => {
  event.preventDefault();
  at("drop").classList.remove("over");
  const [dropped] = event.dataTransfer.files;
  if (dropped) open(dropped, dropped.name);
});
// What was set by hand is lost with the page where the browser does not keep the file: it asks.
addEventListener("beforeunload", (event) => {
  if (file && file !== keptFile && [...CHOICES, ...NAMES].some((name) => kept.has(name))) event.preventDefault();
});
let widthDrawn = innerWidth;
addEventListener("resize", () => {
  if (innerWidth === widthDrawn) return;
  widthDrawn = innerWidth;
  if (signals) redrawSignals();
  if (report && drawn && !at("design").hidden) drawDesign(drawn);
});
(async () => {
  try {
    module = await WebAssembly.compile(await unpacked("wasm"));
    await start();
    vendors = (await ask({ do: "vendors" })).vendors;
    at("vendor").append(...vendors.map(({ name }) => make("option", name)));
    say("Ready.");
    document.body.dataset.readyMs = performance.now();
    const work = await keptWork();
    if (work && !file) { before = work.before; return open(work.blob, work.name, true); }
    at("hint").hidden = !kept.has("file") || Boolean(file);
  } catch (error) {
    say(`The studio cannot start in this browser: ${error.message}`, true);
  }
})();
