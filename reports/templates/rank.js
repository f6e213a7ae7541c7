// A rank as it is written everywhere: with = after it where several share it.

export const rankText = (rank, shared) => (rank === null || rank === undefined ? "–" : `${rank}${shared ? "=" : ""}`);

// The rank of an entrant of a table, written.
export const rankIn = (rows) => {
  const holders = new Map();
  for (const { rank } of rows) holders.set(rank, (holders.get(rank) ?? 0) + 1);
  return (rank) => rankText(rank, holders.get(rank) > 1);
};
