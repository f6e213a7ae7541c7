// Choosing a drive, calibrating a wheel, and the dialogs.

import { startNumber } from "../race/recording.js";
import { typed } from "../command.js";
import { byId, h } from "../race/element.js";
import { kept, newCalibration, pads } from "./inputs.js";
import { called, lapTime, ordinal, percent, titled } from "./words.js";

const AIDS = [["steering", "Steering aid: never turns the front wheels beyond their grip"], ["pedals", "Pedal aid: eases throttle and brake while the tyres turn"]];
const HELP = "Arrows or WASD drive. C view, N mirror, M marks a moment, L racing line, G circuit in small, V sound, B reference lap, P or Escape pause, R restart.";

const DIFFICULTIES = { chosen: "As ticked below", beginner: "Beginner", intermediate: "Intermediate", expert: "Expert", match: "Match me" };
const TEMPERS = { calm: "Calm", fair: "Fair", aggressive: "Aggressive" };

// What a difficulty means: opponents are handicapped by their pace alone, and that is told.
function meaning(difficulty, levels) {
  if (difficulty === "chosen") return "Policies drive as they were trained: no temperament changes them, only the built-in driver.";
  if (difficulty === "match") return "The built-in driver at paces among which your own finished drives here put you in the middle. Drive once before, alone or at any difficulty.";
  const [slow, fast] = levels[difficulty];
  return `The built-in driver at ${percent(slow)} to ${percent(fast)} of its pace.`;
}

export function newMenu({ choices, inputs, onGo }) {
  const form = byId("choice", HTMLFormElement);
  const last = kept.read("choice", {});
  const number = (name, value, most) => h("input", { name, type: "number", min: 1, max: most, value, required: true });
  const select = (name, options, chosen) =>
    h("select", { name }, options.map(([value, text]) => h("option", { value, selected: value === chosen }, text)));
  const field = (label, control) => h("label", { class: "field" }, h("span", {}, label), control);
  const check = (name, label, checked, value) => h("label", { class: "check" }, h("input", { type: "checkbox", name, checked, value }), h("span", {}, label));
  const named = (names) => names.map((name) => [name, titled(name)]);
  const opponents = h("div", {});
  const devices = h("select", { name: "device", onchange: (event) => inputs.choose(event.target.value) });
  const calibrate = h("button", { type: "button", onclick: () => calibration(inputs, listDevices) }, "Calibrate");
  const known = (name, names) => (names.includes(last[name]) ? last[name] : names[0]);

  function listDevices() {
    const found = [["keys", "Keys"], ...pads().map((pad) => [pad.id, pad.id])];
    devices.replaceChildren(...found.map(([value, text]) => h("option", { value, selected: value === inputs.device }, text)));
    calibrate.hidden = inputs.device === "keys";
  }
  devices.addEventListener("change", listDevices);
  for (const event of ["gamepadconnected", "gamepaddisconnected"]) addEventListener(event, listDevices);

  const [circuit, car] = [select("circuit", named(choices.circuits), known("circuit", choices.circuits)), select("car", named(choices.cars), known("car", choices.cars))];
  // Only who can drive there; all of the first kind are chosen, checkpoints before drivers.
  const { blind } = choices;
  const difficulty = select("difficulty", Object.entries(DIFFICULTIES), choices.difficulty ?? last.difficulty ?? choices.unchosen);
  const temper = select("temper", Object.entries(TEMPERS), choices.temper ?? last.temper ?? "fair");
  const means = h("p", { class: "keys" });
  function explain() {
    means.textContent = meaning(difficulty.value, choices.levels);
    opponents.hidden = !blind && difficulty.value !== "chosen";
  }
  difficulty.addEventListener("change", explain);
  function listOpponents() {
    const there = choices.opponents
      .map(({ name, drives }, index) => ({ name, index, there: drives.some(([a, b]) => a === circuit.value && b === car.value) }))
      .filter((one) => one.there);
    const chosen = blind ? there.filter(({ index }) => blind.next.includes(index)) : there.slice(0, Math.max(there.length - 2, 1));
    opponents.replaceChildren(...there.map((one) => check("opponent", called(one.name), chosen.includes(one), one.index)));
  }
  for (const control of [circuit, car]) control.addEventListener("change", listOpponents);

  form.replaceChildren(
    h("fieldset", {}, h("legend", {}, "Race"), field("Circuit", circuit), field("Car", car),
      field("Laps", number("laps", last.laps ?? 3, choices.most_laps)), field("Cars", number("cars", last.cars ?? 8, choices.most_cars)),
      field("My place", number("seat", blind ? 1 : (last.seat ?? 8), choices.most_cars)), field("My name", h("input", { name: "name", maxlength: 40, required: true, readonly: blind !== null, value: blind?.driver ?? last.name ?? "driver" }))),
    h("fieldset", {}, h("legend", {}, blind ? "Two finalists, in turn on the grid" : "Opponents, in turn on the grid"),
      blind ? h("p", { class: "keys" }, "From the first place you meet them: they have to pass you.") : [field("Difficulty", difficulty), field("Temperament", temper), means], opponents),
    h("fieldset", {}, h("legend", {}, "Controls"), field("With", devices), calibrate,
      AIDS.map(([name, label]) => check(`aid-${name}`, label, last.aids?.[name] ?? true, "on")), h("p", { class: "keys" }, HELP)),
    h("div", { class: "go" }, h("button", { class: "first", type: "submit" }, "Drive"), h("span", { class: "keys", id: "waiting" })),
  );
  listDevices();
  listOpponents();
  explain();
  form.onsubmit = (event) => {
    event.preventDefault();
    const data = new FormData(form);
    const whole = (name) => Number(data.get(name));
    const choice = {
      name: String(data.get("name")).trim(), circuit: data.get("circuit"), car: data.get("car"), laps: whole("laps"), cars: whole("cars"),
      seat: Math.min(whole("seat"), whole("cars")), opponents: data.getAll("opponent").map(Number),
      ...(blind ? {} : { difficulty: difficulty.value, temper: temper.value }),
      aids: Object.fromEntries(AIDS.map(([name]) => [name, data.has(`aid-${name}`)])),
    };
    kept.write("choice", choice);
    onGo(choice);
  };
}

// Asks for each control in turn.
function calibration(inputs, onDone) {
  const dialog = byId("calibrate", HTMLDialogElement);
  const id = inputs.device;
  const pad = () => pads().find((one) => one.id === id);
  const first = pad();
  if (!first) return;
  const steps = newCalibration(first);
  const words = h("p", {}, steps.words);
  const next = h("button", { class: "first", onclick: () => {
    const now = pad();
    if (!now || !steps.moves(now)) return;
    const made = steps.press(now);
    words.textContent = steps.words;
    if (!made) return;
    kept.write(`calibration of ${id}`, made);
    dialog.close();
    onDone();
  } }, "Noted");
  dialog.replaceChildren(h("h2", {}, "Calibrate"), h("p", {}, id), words, h("div", { class: "buttons" }, next, h("button", { onclick: () => dialog.close() }, "Cancel")));
  dialog.showModal();
}

export function pauseDialog({ aids, field, onGoOn, onRestart, onLeave, onAids }) {
  const dialog = byId("pause", HTMLDialogElement);
  const boxes = AIDS.map(([name, label]) =>
    h("label", { class: "check" }, h("input", { type: "checkbox", checked: aids[name], onchange: (event) => {
      aids[name] = event.target.checked;
      onAids(aids);
    } }), h("span", {}, label)));
  const button = (text, what, kind) => h("button", { class: kind, onclick: () => { dialog.close(); what(); } }, text);
  dialog.replaceChildren(h("h2", {}, "Pause"), ...(field ? [h("p", { class: "keys" }, field)] : []), ...boxes, h("p", { class: "keys" }, HELP),
    h("div", { class: "buttons" }, button("Go on", onGoOn, "first"), button("Restart", onRestart), button("Leave", onLeave)));
  dialog.oncancel = (event) => { event.preventDefault(); dialog.close(); onGoOn(); };
  if (!dialog.open) dialog.showModal();
}

export function resultDialog({ rows, car, recording, inputs, questions, forecast }, again, { onRestart, onLeave, onAsk }) {
  const dialog = byId("result", HTMLDialogElement);
  const head = h("tr", {}, ["", "", "Time", "Best lap", "Penalties", "Contacts"].map((text) => h("th", {}, text)));
  const body = rows.map((row) => h("tr", { class: row.car === car ? "own" : "" },
    [row.place, called(row.name), row.race_time_s === null ? row.ending.replace("_", " ") : lapTime(row.race_time_s), row.best_lap_s === null ? "–" : lapTime(row.best_lap_s), row.penalties, row.contacts].map((value) => h("td", {}, String(value)))));
  const button = (text, what, kind) => h("button", { class: kind, onclick: () => { dialog.close(); what(); } }, text);
  const own = rows.find((row) => row.car === car);
  dialog.replaceChildren(
    h("h2", {}, own.ending === "finished" ? `You came ${ordinal(own.place)} of ${rows.length}` : `Your race ended: ${own.ending.replace("_", " ")}`),
    ...(forecast ? [h("p", { id: "forecast" }, `Forecast: place ${forecast.place.toFixed(1)} of ${forecast.cars}, likely ${forecast.low === forecast.high ? forecast.low : `${forecast.low} to ${forecast.high}`}. You came ${ordinal(own.place)}.`)] : []),
    ...(again ? [again.node] : []),
    h("table", {}, h("thead", {}, head), h("tbody", {}, body)),
    ...(questions
      ? [h("div", { class: "buttons" }, button("Answer", () => onAsk(questions), "first"))]
      : [h("div", { class: "buttons" }, button("Again", onRestart, "first"), button("Another race", onLeave)),
         h("p", { class: "keys" }, "Look at it again: ", h("code", {}, typed(["nathlon", "replay", recording]))),
         h("p", { class: "keys" }, "What you did: ", h("code", {}, inputs)),
         h("p", { class: "keys" }, "Where you lose time: ", h("code", {}, typed(["nathlon", "coach", recording, "--car", startNumber(car)])))]));
  dialog.oncancel = (event) => { event.preventDefault(); dialog.close(); if (questions) onAsk(questions); else onLeave(); };
  dialog.showModal();
  again?.begin();
}
