// A command that somebody is to type into a shell.
const quoted = (word) => (/^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replaceAll("'", `'"'"'`)}'`);
export const typed = (words) => words.map(quoted).join(" ");
