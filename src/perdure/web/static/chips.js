// Ids in their colours, and words for kinds of events.

import { colourOf, css, readableOn } from "./colours.js";
import { h } from "./dom.js";
import { set } from "./store.js";

export function chip(id, { inert = false } = {}) {
  const look = { background: css(colourOf(id)), color: readableOn(colourOf(id)) };
  if (inert) return h("span", { class: "chip", style: look }, String(id));
  const choose = (event) => {
    event.stopPropagation();
    set({ selected: id, partner: 0 });
  };
  return h("button", { class: "chip", style: look, "aria-label": `Id ${id}`, title: `Select ${id}`, onclick: choose }, String(id));
}

const WORDS = {
  resolved: "Identity resolved", found_again: "Found again", mended: "Mended", exchanged: "Identities exchanged",
  joined: "Joined over a border",
  approximated: "Approximated", lost: "Lost", narrow: "Narrow link", appeared: "Appeared inside", entered: "Entered",
  left: "Left", merge: "Merge", split: "Split", mixed: "Mixed", occluded: "Hidden", partly_occluded: "Partly hidden",
  suspended: "Suspended", light: "Light changed", removed: "Something removed", abandoned: "Something left behind",
  context: "Context", exchange: "Exchange", switch: "Switch", invented: "Invented", resolution: "Wrong resolution",
};
export const words = (kind) => WORDS[kind] ?? kind.replaceAll("_", " ");
