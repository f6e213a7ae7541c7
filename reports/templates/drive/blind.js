// A blind test: how far it has come, the questions after a race, and who was who once the ballot is cast.

import { all, byId, h } from "../race/element.js";

const ASKED = [
  ["again", "Would you race it again?"], ["fair", "Was it fair in contact?"],
  ["room", "Did it leave room?"], ["beatable", "Was it beatable?"],
];
const SCALE = [1, 2, 3, 4, 5];

export const momentOf = ({ time_s: time, nearest, apart_m: apart }) =>
  `${time.toFixed(1)} s${nearest === null ? "" : `, ${nearest} ${apart.toFixed(0)} m away`}`;

export function showBlind({ driver, races, missing, approve, rank, names }, onCast) {
  const panel = byId("blind");
  const called = (letter) => (names ? `${letter}: ${names[letter]}` : letter);
  const list = (letters, between) => letters.map(called).join(between) || "nobody";
  const said = rank.length ? [h("p", {}, "Approves: ", h("b", {}, list(approve, ", "))), h("p", {}, "Order: ", h("b", {}, list(rank, " > ")))] : [];
  all("#menu h1")[0].textContent = "Blind test drive";
  byId("choice").hidden = names !== null;
  panel.hidden = false;
  panel.replaceChildren(...(names
    ? [h("h2", {}, `${driver}'s ballot is cast`), ...said, h("p", { class: "keys" }, "You can close this page. The committee decides when enough of its members have voted.")]
    : [
      h("h2", {}, `${driver}'s ballot so far`),
      h("p", {}, "Races against ", Object.entries(races).map(([letter, count], i) => [i ? ", " : "", h("b", {}, letter), ` ${count}`]), "."),
      ...said,
      h("div", { class: "go" },
        h("button", { type: "button", disabled: missing.length > 0, onclick: onCast }, "Cast my ballot"),
        h("span", { class: "keys" }, missing.length ? `Meet ${missing.join(", ")} in a race first.` : "Then you are told who is who, and drive blind no more.")),
    ]));
}

export function questionsDialog({ letters, marks, longest }, { onAnswer, onDrop }) {
  const dialog = byId("questions", HTMLDialogElement);
  const choose = (name, options) => options.map(([value, text]) =>
    h("label", { class: "score" }, h("input", { type: "radio", name, value, required: true }), h("span", {}, text)));
  const better = h("fieldset", { class: "asked" }, h("legend", {}, "Which of the two?"), h("div", {}, choose("better", [...letters.map((letter) => [letter, letter]), ["", "Cannot tell"]])));
  /** @type {Set<string>} */
  const missed = new Set();
  const scores = letters.map((letter) => {
    const asked = h("fieldset", { class: "about" },
      ASKED.map(([name, words]) => h("fieldset", { class: "asked" }, h("legend", {}, words), h("div", {}, choose(`${letter} ${name}`, SCALE.map((value) => [value, String(value)]))))));
    const turn = (event) => {
      asked.disabled = event.target.checked;
      if (asked.disabled) missed.add(letter);
      else missed.delete(letter);
      better.disabled = missed.size > 0;
    };
    return h("fieldset", {}, h("legend", {}, letter), asked,
      h("label", { class: "check" }, h("input", { type: "checkbox", name: `${letter} missed`, onchange: turn }), h("span", {}, "I did not meet it")));
  });
  const form = h("form", {},
    h("p", { class: "keys" }, "1 is not at all, 5 is very much."),
    marks.length ? h("p", { class: "keys" }, `You marked ${marks.map(momentOf).join("; ")}.`) : "",
    h("div", { class: "pair" }, scores),
    better,
    h("label", { class: "words" }, h("span", {}, "In your own words"), h("textarea", { name: "text", rows: 3, maxlength: longest })),
    h("div", { class: "buttons" }, h("button", { class: "first", type: "submit" }, "Keep these answers"),
      h("button", { type: "button", onclick: () => { dialog.close(); onDrop(); } }, "Leave this race out")));
  form.onsubmit = (event) => {
    event.preventDefault();
    const data = new FormData(form);
    dialog.close();
    onAnswer({
      scores: Object.fromEntries(letters.map((letter) => [letter, missed.has(letter) ? null : Object.fromEntries(ASKED.map(([name]) => [name, Number(data.get(`${letter} ${name}`))]))])),
      better: data.get("better") || null,
      text: data.get("text"),
    });
  };
  dialog.replaceChildren(h("h2", {}, "How was it?"), form);
  // Whoever closes it has not answered.
  dialog.oncancel = (event) => event.preventDefault();
  if (!dialog.open) dialog.showModal();
}
