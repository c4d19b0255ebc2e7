// "Run from here": the ordinary run of this capture, with its progress.

import { ask } from "../api.js";
import { announce, duration, element, percent } from "../dom.js";

const POLL_MS = 700;

export class RunPanel {
  constructor(view) {
    this.view = view;
    this.button = element("button", { type: "button", class: "primary", onclick: () => this.start() }, "Run from here ", element("kbd", {}, "g"));
    this.state = element("div", { role: "status" });
    this.bar = element("progress", { max: 1, hidden: true });
    this.root = element("section", { class: "run", "aria-label": "Run" }, this.button, this.bar, this.state);
    this.path = `${view.capture.path}/run`;
    ask(this.path, { signal: view.signal }).then((run) => run && this.follow(run, run.state === "running")).catch(() => {});
  }

  async start() {
    if (this.button.disabled) return;
    try {
      this.view.spheres.finish();
      if (this.view.history.isDirty && !(await this.view.save.save())) return;
      this.follow(await ask(this.path, { method: "POST", signal: this.view.signal }), true);
    } catch (error) {
      announce(error.message, "error");
    }
  }

  follow(run, wasRunning) {
    const isRunning = run.state === "running";
    this.button.disabled = isRunning;
    this.bar.hidden = !isRunning;
    if (isRunning) {
      const share = run.total ? run.done / run.total : null;
      if (share === null) this.bar.removeAttribute("value");
      else this.bar.value = share;
      const stored = Object.values(run.stages).filter((seconds) => seconds === null).length;
      const parts = [run.stage || "starting", share === null ? "" : percent(share), duration(run.seconds), stored ? `${stored} stages kept` : ""];
      this.state.textContent = parts.filter(Boolean).join(" · ");
      this.state.className = "";
      setTimeout(async () => {
        if (this.view.signal.aborted) return;
        try {
          this.follow(await ask(this.path, { signal: this.view.signal }), true);
        } catch (error) {
          if (error.name !== "AbortError") setTimeout(() => this.follow(run, true), POLL_MS * 4);
        }
      }, POLL_MS);
      return;
    }
    this.state.className = run.state === "failed" ? "doubt" : "good";
    this.state.textContent = run.state === "failed" ? `${run.error} → ${run.remedy}` : `done${run.version ? `: ${run.version}` : ""}`;
    if (wasRunning && run.state === "done" && !this.view.history.isDirty) setTimeout(() => this.view.reload(), 400);
  }
}
