// The WebSocket to the program: connects, connects again for as long as the page is open, and knows how old the data is.
// The messages to the page are documented in host-sim/device-sim/src/page/messages.rs, those from it in session/control.rs there.

const RETRY_MS = [250, 500, 1000, 2000];
/** A server that says nothing for so long is gone, though the socket may not know: it speaks at least every 250 ms. */
const SILENT_MS = 4000;
/** Data of the needle older than this is shown as old. */
const STALE_MS = 1000;
/** A page that was just opened is still connecting for so long. */
const CONNECTING_MS = 2000;

export class Link {
  /** @param {(message: object) => void} onMessage called with every message of the server */
  constructor(onMessage) {
    this.onMessage = onMessage;
    this.open = false;
    this.bornAt = performance.now();
    this.attempts = 0;
    this.lastMessageAt = -Infinity;
    this.lastPoseAt = performance.now();
    this.stopOwed = false;
    this.connect();
    setInterval(() => this.watch(), 500);
  }

  connect() {
    const socket = new WebSocket(`ws://${location.host}/live`);
    this.socket = socket;
    this.startedAt = performance.now();
    socket.onopen = () => {
      this.open = true;
      this.attempts = 0;
      this.lastMessageAt = performance.now();
      if (this.stopOwed) this.send({ do: "stop" });
    };
    socket.onmessage = (event) => {
      const message = JSON.parse(event.data);
      this.lastMessageAt = performance.now();
      if (message.type === "frame" && message.pose) this.lastPoseAt = this.lastMessageAt;
      this.onMessage(message);
    };
    socket.onclose = () => {
      if (this.socket !== socket) return;
      this.open = false;
      const wait = RETRY_MS[Math.min(this.attempts++, RETRY_MS.length - 1)];
      setTimeout(() => this.connect(), wait);
    };
  }

  /** Gives up a connection that is open in name only. */
  watch() {
    const since = Math.max(this.lastMessageAt, this.startedAt);
    if (this.socket.readyState < WebSocket.CLOSING && performance.now() - since > SILENT_MS) this.socket.close();
  }

  /**
   * Sends a wish of the person. Without a connection only a stop is kept for later: it is safe to arrive late,
   * anything else is not.
   * @returns {boolean} whether it was sent
   */
  send(message) {
    if (this.open && this.socket.readyState === WebSocket.OPEN) {
      this.socket.send(JSON.stringify(message));
      if (message.do === "stop") this.stopOwed = false;
      return true;
    }
    if (message.do === "stop") this.stopOwed = true;
    return false;
  }

  /** Milliseconds since the last news of the needle. */
  get dataAge() {
    return performance.now() - this.lastPoseAt;
  }

  /** @returns {"connecting" | "live" | "stale" | "lost"} just opened, live data, old data of a running program, or no program */
  get condition() {
    const young = this.lastMessageAt === -Infinity && performance.now() - this.bornAt < CONNECTING_MS;
    if (young) return "connecting";
    if (!this.open) return "lost";
    return this.dataAge > STALE_MS ? "stale" : "live";
  }
}
