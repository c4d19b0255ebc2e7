// Who saves: a name that this browser remembers, and what is asked where somebody else has saved the same meanwhile.

import { announce, element } from "./dom.js";

const KEPT = "author";

export class Author {
  /** what: is saved with the name, as in "change". */
  constructor(what) {
    this.what = what;
    this.input = element("input", { type: "text", maxlength: "80", placeholder: "Your name", "aria-label": `Your name, saved with every ${what}`, autocomplete: "name", oninput: () => this.written(), onkeydown: (event) => this.pressed(event), onchange: () => localStorage.setItem(KEPT, this.input.value) });
    this.input.value = localStorage.getItem(KEPT) ?? "";
    this.isAskedFor = false;
  }

  /** The name; where there is none it is asked for. */
  get name() {
    const name = this.input.value.trim();
    if (!name) {
      announce(`Write your name: it is saved with every ${this.what}.`, "error");
      this.isAskedFor = true;
      this.input.focus();
    }
    return name;
  }

  /** Enter accepts the name, and returns the keyboard to what it was asked for; in a form it sends the form. */
  pressed(event) {
    if (event.key !== "Enter" || this.input.form || !this.input.value.trim()) return;
    this.input.blur();
    const place = document.querySelector("main .stage") ?? document.getElementById("main");
    place.focus({ preventScroll: true });
  }

  /** Takes the request for the name away once there is one. */
  written() {
    if (this.isAskedFor) announce("");
    this.isAskedFor = false;
  }
}

/** Says in `place` that something was not saved, and lets a person choose; verb: what somebody else has done; details: elements on it. */
export function showConflict(place, verb, details, { keep, take }) {
  const own = element("button", { type: "button", onclick: keep }, "Save mine over it");
  const theirs = element("button", { type: "button", onclick: take }, "Take theirs");
  const both = element("p", {}, "Theirs is saved, and stays in the history if you save yours over it. If you take theirs, yours is lost.");
  place.replaceChildren(element("div", { class: "conflict" }, element("b", {}, `Not saved: somebody else has ${verb} the same.`), details, both, element("div", { class: "line" }, own, theirs)));
  own.focus();
}
