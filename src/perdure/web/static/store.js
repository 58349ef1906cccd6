// What is shown now, and who wants to know when it changes.

export const state = {
  session: null, // what the server shows, and whether this page may write
  run: 0, // number of the run that is shown
  about: null, // session.runs[run]
  standing: null, // what may change from moment to moment: /state
  frames: [], // numbers of all frames
  times: [], // their times in seconds
  at: 0, // place in `frames`
  playing: false,
  dragging: false, // the playhead
  speed: 1,
  selected: 0, // id
  partner: 0, // a second id, for swaps and joins
  doubt: null, // the doubt that is looked at
  hovered: 0,
  follow: false,
  beside: "", // "", "truth", or the number of another run
  tab: "doubts",
  events: null, // { doubts, events, doubtful, open }
  boxes: true, shapes: true, trails: true, labels: true, unseen: true,
  zones: null, // { features, chosen, drawing, file, dirty }
  ground: null, // { points, lengths, grid, file }
  score: null,
};

const listeners = new Map();

export function on(names, tell) {
  for (const name of names.split(" ")) {
    if (!listeners.has(name)) listeners.set(name, new Set());
    listeners.get(name).add(tell);
  }
}

export function set(changes) {
  const told = new Set();
  for (const [name, value] of Object.entries(changes)) {
    if (state[name] === value) continue;
    state[name] = value;
    for (const tell of listeners.get(name) ?? []) told.add(tell);
  }
  for (const tell of told) tell();
}

// Tells of a change inside a value that stays the same object.
export function touch(name) {
  for (const tell of listeners.get(name) ?? []) tell();
}

export const frameNow = () => state.frames[state.at] ?? 0;
export const timeNow = () => state.times[state.at] ?? 0;

// The place of a frame among those shown, or of the next one.
export function placeOf(frame) {
  const { frames } = state;
  if (!frames.length) return 0;
  const straight = frame - frames[0];
  if (frames[straight] === frame) return straight;
  let low = 0, high = frames.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (frames[middle] < frame) low = middle + 1; else high = middle;
  }
  return low;
}

export const timeOf = (frame) => state.times[placeOf(frame)] ?? 0;

export function clock(seconds) {
  const whole = Math.max(0, seconds), minutes = Math.floor(whole / 60);
  const rest = (whole - 60 * minutes).toFixed(2).padStart(5, "0");
  const hours = Math.floor(minutes / 60);
  return hours ? `${hours}:${String(minutes % 60).padStart(2, "0")}:${rest}` : `${minutes}:${rest}`;
}
