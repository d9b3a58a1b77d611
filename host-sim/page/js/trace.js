// The last twenty seconds, in fixed arrays: nothing is allocated while data streams.

const CAPACITY = 4096; // of 5 ms

export class Trace {
  constructor() {
    this.t = new Float64Array(CAPACITY);
    for (const name of ["depthLow", "depthHigh", "lawLow", "lawHigh", "motorLow", "motorHigh"]) {
      this[name] = new Float32Array(CAPACITY);
    }
    this.clear();
  }

  clear() {
    this.end = 0; // one past the newest, never wrapped
    this.begin = 0;
  }

  get newest() {
    return this.end > this.begin ? this.t[this.slot(this.end - 1)] : NaN;
  }

  /** Returns the place of entry `i`, counted from the first ever. */
  slot(i) {
    return i % CAPACITY;
  }

  /** Adds a bucket `[t_s, [depth], [law], [motor]]`; null becomes NaN and is not drawn. A clock that jumps back starts anew. */
  push([t, depth, law, motor]) {
    if (t < this.newest) {
      if (t > this.newest - 1) return;
      this.clear();
    }
    const at = this.slot(this.end);
    this.t[at] = t;
    this.depthLow[at] = depth[0] ?? NaN;
    this.depthHigh[at] = depth[1] ?? NaN;
    this.lawLow[at] = law[0] ?? NaN;
    this.lawHigh[at] = law[1] ?? NaN;
    this.motorLow[at] = motor[0] ?? NaN;
    this.motorHigh[at] = motor[1] ?? NaN;
    this.end++;
    if (this.end - this.begin > CAPACITY) this.begin++;
  }

  /** The first entry at or after `t`. */
  firstSince(t) {
    let low = this.begin;
    let high = this.end;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.t[this.slot(middle)] < t) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

/** The device's clock as it runs between messages, so that the plots scroll evenly however messages bunch. */
export class Clock {
  constructor() {
    this.offset = NaN;
    this.newest = NaN;
  }

  /** A pose of `t` seconds has just arrived, after a jump or in its turn. */
  hear(t, nowMs, jumped) {
    this.newest = t;
    const offset = t - nowMs / 1000;
    // A replay, a faster-than-life run or a restart jumps; the jitter of messages is smoothed away.
    if (jumped || !(Math.abs(offset - this.offset) < 0.25)) this.offset = offset;
    else this.offset += 0.05 * (offset - this.offset);
  }

  /** Returns the time of the device's clock, s; it stops when nothing arrives. */
  now(nowMs) {
    return Math.min(nowMs / 1000 + this.offset, this.newest + 0.1);
  }
}
