// The catalogue view: one row for each capture, what needs a person first. Rows far off the screen are not in the page,
// and come from the server in blocks when they are scrolled to.

import { ask } from "../api.js";
import { announce, announceError, element, guarded } from "../dom.js";
import { bind } from "../keys.js";
import { offerMore, showReasons } from "./reasons.js";
import { cellsOf } from "./row.js";

const ROW_PX = 72;
const BLOCK = 100;
const POLL_MS = 2000;
/** Rows above and below the screen that are drawn too, and the pause in typing after which is searched. */
const SPARE_ROWS = 6;
const TYPING_MS = 120;
/** Name under which the browser's tab keeps the place in the list. */
const PLACE = "catalogue-place";
const STATES = ["failed", "doubtful", "running", "waiting", "warnings", "done", "new", "reading"];
const SORTS = [["attention", "What needs you first"], ["name", "Name"], ["date", "Newest first"], ["confident", "Least confident first"]];

export async function open(root, signal) {
  const view = new CatalogueView(root, signal);
  await view.load(true);
  view.goBack();
  view.poll();
}

class CatalogueView {
  constructor(root, signal) {
    this.signal = signal;
    this.blocks = new Map();
    this.asked = new Set();
    this.total = 0;
    this.revision = null;
    this.chosen = 0;
    this.states = new Set();
    const saved = new URLSearchParams(sessionStorage.getItem("catalogue") ?? "");
    this.search = element("input", { type: "search", placeholder: "Search names, verdicts, warnings", "aria-label": "Search", oninput: () => this.changed() });
    this.search.value = saved.get("search") ?? "";
    this.sort = element("select", { "aria-label": "Order", onchange: () => this.changed() },
      SORTS.map(([value, text]) => element("option", { value }, text)));
    this.sort.value = saved.get("sort") ?? "attention";
    for (const state of saved.getAll("state")) this.states.add(state);
    this.filters = element("div", { class: "filters", role: "group", "aria-label": "States" });
    this.summary = element("p", { class: "faint" });
    this.problem = element("div", { class: "problem", role: "alert" });
    this.space = element("div", { class: "rows", role: "list" });
    this.scroller = element("div", { class: "scroller", role: "region", tabindex: "0", "aria-label": "Captures", onscroll: () => { this.draw(); this.keepPlace(); } }, this.space);
    root.classList.add("catalogue");
    root.append(element("div", { class: "toolbar" }, this.search, this.filters, this.sort), this.problem, this.summary, this.scroller);
    addEventListener("resize", () => { this.draw(); offerMore([...this.space.children]); }, { signal });
    bind([
      ["/", "search", () => this.search.focus()],
      ["ArrowDown j", "next capture", () => this.move(1)],
      ["ArrowUp k", "previous capture", () => this.move(-1)],
      ["PageDown", "ten captures on", () => this.move(10)],
      ["PageUp", "ten captures back", () => this.move(-10)],
      ["Home", "first capture", () => this.move(-this.total)],
      ["End", "last capture", () => this.move(this.total)],
      ["Enter", "open the capture", () => this.follow()],
      ["i", "all that is said about the capture", () => this.tell(this.chosen)],
    ], signal);
    this.search.addEventListener("keydown", (event) => {
      if (event.key === "ArrowDown" || event.key === "Enter") this.scroller.focus();
    });
  }

  query(offset) {
    const query = new URLSearchParams({ search: this.search.value, sort: this.sort.value, offset, limit: BLOCK });
    for (const state of this.states) query.append("state", state);
    return query;
  }

  changed() {
    sessionStorage.setItem("catalogue", this.query(0));
    clearTimeout(this.timer);
    this.timer = setTimeout(guarded(() => {
      this.chosen = 0;
      this.scroller.scrollTop = 0;
      this.keepPlace();
      return this.load(true);
    }), TYPING_MS);
  }

  /** Fetches the rows on the screen; all others are fetched again when they are scrolled to. */
  async load(anew) {
    const first = anew ? 0 : Math.floor(this.scroller.scrollTop / ROW_PX / BLOCK);
    const last = anew ? 0 : Math.floor((this.scroller.scrollTop + this.scroller.clientHeight) / ROW_PX / BLOCK);
    const turn = (this.turn = (this.turn ?? 0) + 1);
    const wanted = [];
    for (let block = first; block <= last; block += 1) wanted.push(block);
    const answers = await Promise.all(wanted.map((block) => ask(`/api/captures?${this.query(block * BLOCK)}`, { signal: this.signal })));
    if (turn !== this.turn) return;
    this.blocks.clear();
    this.asked.clear();
    answers.forEach((answer, index) => this.take(answer, wanted[index]));
    // Blocks that come later may be newer: the first ones are asked for again as soon as they are older than the rest.
    this.revision = Math.min(...answers.map(({ revision }) => revision));
    this.draw();
  }

  take(answer, block) {
    this.blocks.set(block, answer.rows);
    this.total = answer.total;
    this.space.style.height = `${this.total * ROW_PX}px`;
    const all = (this.all = Object.values(answer.counts).reduce((sum, count) => sum + count, 0));
    const reading = answer.complete ? "" : " · reading the store";
    this.summary.textContent = `${this.total.toLocaleString("en")} of ${all.toLocaleString("en")} captures · ${answer.store}${reading}`;
    if (this.problem.textContent !== answer.problem) this.problem.textContent = answer.problem;
    this.drawFilters(answer.counts);
  }

  drawFilters(counts) {
    const text = JSON.stringify([counts, [...this.states]]);
    if (text === this.filtersShown) return;
    this.filtersShown = text;
    const focused = this.filters.contains(document.activeElement) ? document.activeElement.dataset.state : null;
    this.filters.replaceChildren(
      ...STATES.filter((state) => counts[state] || this.states.has(state)).map((state) =>
        element("button", {
          type: "button", class: `filter ${state}`, "data-state": state, "aria-pressed": String(this.states.has(state)),
          onclick: () => { if (!this.states.delete(state)) this.states.add(state); this.changed(); },
        }, element("span", { class: "dot", "aria-hidden": "true" }), `${state} ${(counts[state] ?? 0).toLocaleString("en")}`)),
    );
    if (focused) this.filters.querySelector(`[data-state=${focused}]`)?.focus();
  }

  draw() {
    const top = Math.max(0, Math.floor(this.scroller.scrollTop / ROW_PX) - SPARE_ROWS);
    const bottom = Math.min(this.total, Math.ceil((this.scroller.scrollTop + this.scroller.clientHeight) / ROW_PX) + SPARE_ROWS);
    const present = new Map([...this.space.children].map((row) => [Number(row.dataset.number), row]));
    for (const [number, row] of present) if (number < top || number >= bottom) row.remove();
    const made = [];
    for (let number = top; number < bottom; number += 1) {
      const block = Math.floor(number / BLOCK);
      const data = this.blocks.get(block)?.[number % BLOCK];
      if (!data) this.want(block);
      const text = JSON.stringify(data ?? null);
      const old = present.get(number);
      let row = old;
      if (old?.content !== text) {
        // The keyboard's place in a row is kept when the row is made anew.
        const focused = old?.contains(document.activeElement) ? document.activeElement.className : null;
        row = this.rowOf(number, data, old?.querySelector("img"));
        row.content = text;
        if (old?.isConnected) old.replaceWith(row);
        else this.space.append(row);
        made.push(row);
        if (focused) row.querySelector(`.${focused}`)?.focus({ preventScroll: true });
      }
      // In place: a row that is made anew between the press of a button and its release is not clicked.
      row.classList.toggle("chosen", number === this.chosen);
      for (const part of row.querySelectorAll("a, button")) part.tabIndex = number === this.chosen ? 0 : -1;
    }
    offerMore(made);
    this.empty?.remove();
    this.empty = null;
    if (this.total > 0) return;
    const text = this.all ? "No capture matches." : "There are no captures yet: `glint review CATALOGUE` shows those of a catalogue, `glint run CATALOGUE` computes them.";
    this.empty = element("p", { class: "empty" }, text);
    this.scroller.append(this.empty);
  }

  async want(block) {
    if (this.asked.has(block)) return;
    this.asked.add(block);
    const turn = this.turn;
    try {
      const answer = await ask(`/api/captures?${this.query(block * BLOCK)}`, { signal: this.signal });
      if (turn !== this.turn) return;
      this.take(answer, block);
      this.draw();
    } catch (error) {
      this.asked.delete(block);
      announceError(error);
    }
  }

  rowOf(number, data, image) {
    const row = element("div", { class: "row", role: "listitem", "data-number": String(number) });
    row.style.top = `${number * ROW_PX}px`;
    if (!data) return row;
    row.append(...cellsOf(data, image, () => this.tell(number)));
    row.addEventListener("mousedown", () => this.choose(number));
    return row;
  }

  choose(number) {
    this.chosen = Math.max(0, Math.min(this.total - 1, number));
    this.draw();
    this.keepPlace();
  }

  /** Remembers where the list was left, for whoever comes back from a capture. */
  keepPlace() {
    sessionStorage.setItem(PLACE, JSON.stringify({ chosen: this.chosen, top: this.scroller.scrollTop }));
  }

  goBack() {
    const { chosen, top } = JSON.parse(sessionStorage.getItem(PLACE) ?? '{"chosen": 0, "top": 0}');
    this.scroller.scrollTop = top;
    this.choose(chosen);
  }

  move(step) {
    this.choose(this.chosen + step);
    const top = this.chosen * ROW_PX;
    const { scrollTop, clientHeight } = this.scroller;
    if (top < scrollTop) this.scroller.scrollTop = top;
    else if (top + ROW_PX > scrollTop + clientHeight) this.scroller.scrollTop = top + ROW_PX - clientHeight;
    this.draw();
    this.space.querySelector(`[data-number="${this.chosen}"] a`)?.focus({ preventScroll: true });
  }

  follow() {
    this.space.querySelector(`[data-number="${this.chosen}"] a`)?.click();
  }

  /** Shows all that is said about a capture, and returns the keyboard to its row. */
  tell(number) {
    const data = this.blocks.get(Math.floor(number / BLOCK))?.[number % BLOCK];
    if (!data) return;
    showReasons(data, () => {
      // The browser returns it by itself, except to a row that was made anew meanwhile.
      if (document.activeElement === document.body) this.space.querySelector(`[data-number="${number}"] a`)?.focus({ preventScroll: true });
    });
  }

  poll() {
    const next = async () => {
      if (this.signal.aborted) return;
      try {
        if (!document.hidden) {
          const query = new URLSearchParams({ limit: 1, revision: this.revision });
          if (await ask(`/api/captures?${query}`, { signal: this.signal })) await this.load(false);
          if (document.getElementById("status").className === "error") announce("");
        }
      } catch (error) {
        announceError(error);
      }
      setTimeout(next, POLL_MS);
    };
    setTimeout(next, POLL_MS);
  }
}
