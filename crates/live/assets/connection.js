// The websocket to the server: connects again by itself, and knows how old its data is.

const RETRY_MS = 300;
const PING_MS = 5000;
// Without a message for this time, the data is stale.
const SILENT_MS = 700;
// An estimate that is older than this is stale.
const OLD_S = 0.5;

export class Connection {
  constructor(onMessage, onChange) {
    this.onMessage = onMessage;
    this.onChange = onChange;
    this.heard = -Infinity;
    this.values = null;
    this.playback = null;
    this.opened = () => {};
    this.open();
    setInterval(() => this.onChange(this.state()), 100);
    setInterval(() => this.send("ping"), PING_MS);
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}/ws`);
    this.socket = socket;
    socket.onopen = () => this.opened();
    socket.onmessage = (event) => {
      const message = JSON.parse(event.data);
      this.heard = performance.now();
      if ("time_ns" in message) this.values = message;
      if ("playback" in message) this.playback = message.playback;
      this.onMessage(message);
    };
    socket.onclose = () => {
      if (this.socket === socket) setTimeout(() => this.open(), RETRY_MS);
    };
  }

  send(message) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  // What can be said of the data now.
  state() {
    const silent = performance.now() - this.heard;
    if (silent > SILENT_MS) {
      // A connection that hangs is given up.
      if (silent > 5000 && this.socket.readyState === WebSocket.OPEN) this.socket.close();
      return { stale: true, text: "No connection to the server. Connecting again." };
    }
    if (this.playback && !this.playback.playing) {
      return { stale: false, text: this.playback.ended ? "End of the log" : "Paused" };
    }
    const values = this.values;
    if (!values || !values.connected) {
      return { stale: true, text: "No recorder. The page continues when it runs." };
    }
    if (!values.time_ns) return { stale: true, text: "The recorder gives no estimate." };
    const age = (values.now_ns - values.time_ns) / 1e9;
    if (age > OLD_S) return { stale: true, text: `Stale: the last estimate is ${age.toFixed(1)} s old.` };
    return { stale: false, text: "Live" };
  }
}
