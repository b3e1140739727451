// The WebSocket, and what the run that is shown offers and does.
export const run = {status: {}, offers: new Set(), heard: 0};
let socket = null;

export function send(message) {
  if (isOpen()) socket.send(JSON.stringify(message));
}

export function isOpen() {
  return socket !== null && socket.readyState === WebSocket.OPEN;
}

export function connect(tell, receive, changed) {
  socket = new WebSocket((location.protocol === "https:" ? "wss://" : "ws://") + location.host + "/live");
  socket.binaryType = "arraybuffer";
  socket.onopen = () => changed("connected", "good");
  socket.onclose = event => {
    changed(event.reason || "not connected", "bad");
    setTimeout(connect, 1000, tell, receive, changed);
  };
  socket.onmessage = event => {
    run.heard = performance.now();
    if (typeof event.data === "string") return tell(JSON.parse(event.data));
    const lengths = new DataView(event.data), json = lengths.getUint32(0, true), jpeg = lengths.getUint32(4, true);
    const moment = JSON.parse(new TextDecoder().decode(new Uint8Array(event.data, 12, json)));
    receive(moment, event.data.slice(12 + json, 12 + json + jpeg), event.data.slice(12 + json + jpeg));
  };
}
