// A command that somebody is to type into a shell.
/** @param {string} word */
const quoted = (word) => (/^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replaceAll("'", `'"'"'`)}'`);
/** @param {string[]} words */
export const typed = (words) => words.map(quoted).join(" ");
