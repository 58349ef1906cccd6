// Corrections: swap, join, cut, delete, "it is right"; undo and redo. Each is a line beside the log, never in it.

import { send } from "./api.js";
import { toast } from "./dom.js";
import { frameNow, set, state } from "./store.js";

let refresh = async () => {};
export const afterwards = (run) => (refresh = run); // what is to be asked anew when something was corrected

const span = (begin, end) => (end === undefined ? `from frame ${begin} on` : begin ? `in frames ${begin} to ${end}` : `up to frame ${end}`);
const WORDS = {
  swap: ({ ids, begin, end }) => `Swapped ${ids[0]} and ${ids[1]} ${span(begin, end)}`,
  join: ({ ids }) => `Joined ${ids[0]} into ${ids[1]}`,
  cut: ({ ids, begin }) => `Cut ${ids[0]}: from frame ${begin} on it is ${ids[1]}`,
  delete: ({ ids, begin, end }) => `Deleted ${ids[0]}${begin || end !== undefined ? ` ${span(begin, end)}` : ""}`,
  confirm: () => "Marked as right",
};

// One after the other, so that an undo undoes what was asked for before it.
let before = Promise.resolve();
function correct(value, options) {
  return (before = before.then(() => corrected(value, options)));
}

async function corrected(value, { quiet = false } = {}) {
  if (!state.session.writable) {
    toast("To correct, open the address that `perdure view` printed: it holds the token.", { bad: true });
    return null;
  }
  try {
    const { done, ...standing } = await send("POST", `runs/${state.run}/corrections`, value);
    set({ standing });
    await refresh();
    if (!quiet && typeof done !== "string") toast(WORDS[done.do](done), { action: { label: "Undo", run: undo } });
    return done;
  } catch (error) {
    toast(error.message, { bad: true });
    return null;
  }
}

// The doubt that an action on some ids settles: the one that is looked at, if it is about one of them.
const settles = (ids) => {
  const looked = state.doubt;
  return looked && !looked.looked && looked.key && ids.some((id) => looked.ids.includes(id)) ? { event: looked.key } : {};
};

export const swap = (one, other, when = {}, about = settles([one, other])) =>
  correct({ do: "swap", ids: [one, other], begin: frameNow(), ...when, ...about });
export const join = async (one, into, about = settles([one, into])) => {
  const done = await correct({ do: "join", ids: [one, into], begin: 0, ...about });
  if (done && state.selected === one) set({ selected: into, partner: 0 });
};
export const cut = (one, begin = frameNow(), about = settles([one])) => correct({ do: "cut", ids: [one, 0], begin, ...about });
export const remove = (one, when = {}, about = settles([one])) => correct({ do: "delete", ids: [one], begin: 0, ...when, ...about });
export const confirm = (doubt) => correct({ do: "confirm", ids: doubt.ids, begin: doubt.begin, event: doubt.key }, { quiet: true });

export async function undo() {
  await before;
  if (!state.standing?.undo) return toast("There is nothing to undo");
  const what = state.standing.undo;
  if (await correct({ do: "undo" })) toast(`Undone: ${what}`);
  return undefined;
}

export async function redo() {
  await before;
  if (!state.standing?.redo) return toast("There is nothing to do again");
  const what = state.standing.redo;
  if (await correct({ do: "redo" })) toast(`Done again: ${what}`);
  return undefined;
}
