// A rank as it is written everywhere: the range of those that are possible. Runs of older versions did not keep the worst.

const rankText = (row) => {
  const { rank: best = null, worst_rank: worst = null } = row ?? {};
  if (best === null) return "–";
  if (worst === null) return `from ${best}`;
  return worst === best ? `${best}` : `${best} to ${worst}`;
};
