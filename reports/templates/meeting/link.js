// The connection to the server, and the token by which it knows the member.

const TOKEN = "nathlon room: token"; // under which it is kept for the tab; test drives read it there

// The token of the address: it goes out of it, into what the browser keeps for this tab.
export function takeToken() {
  const given = location.hash.slice(1);
  if (given && !given.startsWith("/")) {
    sessionStorage.setItem(TOKEN, given);
    history.replaceState(null, "", "#/questions");
  }
  return sessionStorage.getItem(TOKEN) ?? "";
}

/** @type {Record<number, string>} */
const CLOSED = {
  4001: "This address is of no member, or of a server that has ended since. Ask for a new one.",
  4002: "You have too many windows open. Close one and reload.",
};

/**
 * A connection that comes back by itself; `first` is said whenever it is open.
 * @param {string} address
 * @param {string} token
 * @param {() => object} first
 * @param {{ onWords: (words: any) => void, onState: (trouble: string) => void }} hears
 */
export function connect(address, token, first, { onWords, onState }) {
  /** @type {WebSocket} */
  let socket;
  const open = () => {
    socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      socket.send(token);
      socket.send(JSON.stringify(first()));
      onState("");
    };
    socket.onmessage = ({ data }) => onWords(JSON.parse(typeof data === "string" ? data : new TextDecoder().decode(data)));
    socket.onclose = ({ code }) => {
      onState(CLOSED[code] ?? "The server is gone; waiting for it to come back.");
      if (!CLOSED[code]) setTimeout(open, 1000);
    };
  };
  open();
  return (words) => {
    if (socket.readyState !== WebSocket.OPEN) return false;
    socket.send(JSON.stringify(words));
    return true;
  };
}
