// The map: the lap in the colours of what it loses, and where the car is.

// Red where time is lost beside the other lap, green where it is gained; full where it is 1 or more.
function lossColour(rate) {
  const share = Math.min(Math.abs(rate), 1);
  return `color-mix(in oklab, ${rate > 0 ? "var(--lost)" : "var(--won)"} ${Math.round(100 * share)}%, var(--even))`;
}

export function lapMap(map, pieceM) {
  const pieces = [...map.querySelectorAll(".piece")];
  for (const piece of pieces) piece.style.stroke = lossColour(Number(piece.dataset.lost));
  const here = map.querySelector("#here");
  return (place) => {
    here.toggleAttribute("hidden", place === null);
    if (place === null) return;
    const piece = pieces[Math.min(Math.floor(place / pieceM), pieces.length - 1)];
    const at = piece.getPointAtLength((piece.getTotalLength() * (place % pieceM)) / pieceM);
    here.setAttribute("transform", `translate(${at.x} ${at.y})`);
  };
}
