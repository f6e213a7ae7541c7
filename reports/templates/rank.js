// A rank as it is written everywhere: with = after it where several share it.

/** @type {(rank: number | null | undefined, shared?: boolean) => string} */
export const rankText = (rank, shared) => (rank === null || rank === undefined ? "–" : `${rank}${shared ? "=" : ""}`);

/**
 * What writes the rank of an entrant of a table.
 * @param {{ rank: number | null }[]} rows
 * @returns {(rank: number | null | undefined) => string}
 */
export const rankIn = (rows) => {
  /** @type {Map<number | null | undefined, number>} */
  const holders = new Map();
  for (const { rank } of rows) holders.set(rank, (holders.get(rank) ?? 0) + 1);
  return (rank) => rankText(rank, (holders.get(rank) ?? 0) > 1);
};
