// A rank as it is written everywhere: the range of those that are possible. Runs of older versions did not keep the worst.

/** @param {{ rank?: number | null, worst_rank?: number | null } | undefined} row */
export const rankText = (row) => {
  const { rank: best = null, worst_rank: worst = null } = row ?? {};
  if (best === null) return "–";
  if (worst === null) return `from ${best}`;
  return worst === best ? `${best}` : `${best} to ${worst}`;
};
