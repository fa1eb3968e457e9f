"use strict";
// What the page works out, without looking at the page: tests run it by itself.

/** Numbers that came as base64. */
function decode(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Int16Array(bytes.buffer);
}

/** An episode's frames, of `size` numbers each. */
function framesOf(text, size) {
  const all = decode(text), frames = [];
  for (let at = 0; at < all.length; at += size) frames.push(all.subarray(at, at + size));
  return frames;
}

/** Let a property be worked out when it is asked for first. */
function whenAskedFor(owner, name, make) {
  Object.defineProperty(owner, name, {
    configurable: true,
    enumerable: true,
    get() {
      const value = make();
      Object.defineProperty(owner, name, { value, writable: true, configurable: true, enumerable: true });
      return value;
    },
  });
}

/** A cycle's number, of its two parts. */
const cycleNumber = (low, high) => low + 32768 * high;

/** Keepers but the player, nearest first: to the ball, or to the player itself where K1 counts. */
function ranked(places, numKeepers, player, ordering) {
  const keeps = player < numKeepers;
  const [x, y] = keeps && ordering === "k1" ? places[player] : places[places.length - 1];
  const far = (k) => Math.hypot(places[k][0] - x, places[k][1] - y);
  const others = [...Array(numKeepers).keys()].filter((k) => k !== player).sort((a, b) => far(a) - far(b));
  return keeps ? others : others.slice(1);
}

/** Means of the last values at each of them. */
function movingMean(values, window) {
  const means = [];
  let sum = 0;
  values.forEach((value, k) => {
    sum += value - (k >= window ? values[k - window] : 0);
    means.push(sum / Math.min(k + 1, window));
  });
  return means;
}

const FEW = 200; // episodes of which the chart shows also the longest

/** Up to where a chart of durations goes; of many, the longest 2 % may lie beyond. */
function chartTop(durations) {
  const sorted = [...durations].sort((a, b) => a - b);
  const last = sorted.length - 1;
  return Math.max(1, sorted[sorted.length <= FEW ? last : Math.floor(0.98 * last)] * 1.1);
}
