// "Run from here": the ordinary run of this capture, with its progress. It goes on without its server, and is found again.

import { ask, NO_ANSWER } from "../api.js";
import { announceError, duration, element, percent } from "../dom.js";

const POLL_MS = 700;
const RETRY_MS = 2500;
/** Times that a run is looked for after its server has ended, before it counts as ended too. */
const LOOKS = 12;

export class RunPanel {
  /** view.capture: path, that of a run (`path`/run), and `row`, that of a capture's row where it is another one. */
  constructor(view) {
    this.view = view;
    this.button = element("button", { type: "button", class: "primary", onclick: () => this.start() }, "Run from here ", element("kbd", {}, "g"));
    this.stopButton = element("button", { type: "button", hidden: true, onclick: () => this.stop() }, "Stop");
    this.state = element("div", { role: "status" });
    this.bar = element("progress", { max: 1, hidden: true });
    this.root = element("section", { class: "run", "aria-label": "Run" }, element("div", { class: "line" }, this.button, this.stopButton), this.bar, this.state);
    this.path = `${view.capture.path}/run`;
    this.row = view.capture.row ?? view.capture.path;
    this.find().catch(() => {});
  }

  /** Shows the run that is going on, also one that an earlier server has started. */
  async find() {
    const run = await ask(this.path, { signal: this.view.signal });
    if (run) return this.follow(run, run.state === "running");
    const row = await ask(this.row, { signal: this.view.signal });
    this.version ??= row.version;
    if (row.state === "running") this.followRow(row, 0);
    else if (row.state === "failed") this.show(`The last run failed: ${failureOf(row)}`, "doubt");
    else if (row.state === "reading") this.later(() => this.find().catch(() => {}), RETRY_MS);
  }

  async start() {
    // Begun by its key, a run may be far from what is shown beside the picture.
    this.root.scrollIntoView({ block: "nearest" });
    if (this.button.disabled) return;
    this.button.disabled = true;
    try {
      this.view.spheres.finish();
      if (!this.view.history.isDirty || (await this.view.save.save())) {
        this.version = (await ask(this.row, { signal: this.view.signal })).version;
        this.follow(await ask(this.path, { method: "POST", signal: this.view.signal }), true);
        return;
      }
    } catch (error) {
      announceError(error);
    }
    this.button.disabled = false;
  }

  /** Stops the run, which says itself when it has ended. */
  async stop() {
    this.stopButton.disabled = true;
    try {
      await ask(this.path, { method: "DELETE", signal: this.view.signal });
    } catch (error) {
      this.stopButton.disabled = false;
      announceError(error);
    }
  }

  /** share: part that is done, null where it is not known; canStop: whether the server has started the run itself. */
  show(text, kind = "", share = undefined, canStop = false) {
    const isRunning = share !== undefined;
    this.button.disabled = isRunning;
    this.stopButton.hidden = !canStop;
    this.bar.hidden = !isRunning;
    if (share) this.bar.value = share;
    else this.bar.removeAttribute("value");
    this.state.textContent = text;
    this.state.className = kind;
  }

  later(action, wait) {
    setTimeout(() => this.view.signal.aborted || action(), wait);
  }

  /** Asks for the state of the run again, or of the capture where the server knows of no run. */
  async look(looks = 0) {
    try {
      const run = await ask(this.path, { signal: this.view.signal });
      if (run) this.follow(run, true);
      else this.followRow(await ask(this.row, { signal: this.view.signal }), looks);
    } catch (error) {
      if (error.name === "AbortError") return;
      const absence = "The server does not answer. The run goes on without it: start glint review again.";
      this.show(error.status === NO_ANSWER ? absence : error.message, "doubt", null);
      this.later(() => this.look(), RETRY_MS);
    }
  }

  follow(run, wasRunning) {
    if (run.state === "running") {
      const share = run.total ? run.done / run.total : null;
      const stored = Object.values(run.stages).filter((seconds) => seconds === null).length;
      this.stopButton.disabled = run.is_stopping;
      const parts = [run.is_stopping ? "stopping" : run.stage || "starting", share === null ? "" : percent(share), run.seconds_left ? `about ${duration(run.seconds_left)} left` : `for ${duration(run.seconds)}`, stored ? `${stored} stages kept` : ""];
      this.show(parts.filter(Boolean).join(" · "), "", share, true);
      this.later(() => this.look(), POLL_MS);
      return;
    }
    if (run.state === "stopped") return this.show("stopped: what is finished is kept, and the next run goes on from there");
    const isFailed = run.state === "failed";
    this.show(isFailed ? `${run.error} → ${run.remedy}` : `done${run.version ? `: ${run.version}` : ""}`, isFailed ? "doubt" : "good");
    if (wasRunning && !isFailed) this.reload();
  }

  /** Follows a run by what is known of the capture: the server was started anew, and has not started this run. */
  followRow(row, looks) {
    if (row.version !== this.version && row.state !== "running" && row.state !== "reading") {
      this.show(`done: ${row.version}`, "good");
      this.reload();
    } else if (row.state === "failed") this.show(failureOf(row), "doubt");
    else if (row.state !== "running" && looks >= LOOKS) this.show("The run has ended with its server: run again, it goes on where it stopped.", "doubt");
    else {
      const parts = row.state === "running" ? [row.stage || "running", row.progress === null ? "" : percent(row.progress)] : ["looking for the run"];
      this.show(parts.filter(Boolean).join(" · "), "", row.progress ?? null);
      this.later(() => this.look(row.state === "running" ? 0 : looks + 1), RETRY_MS);
    }
  }

  reload() {
    this.later(() => this.view.isUnsaved || this.view.reload(), 400);
  }
}

/** Returns why a capture's last run failed, and what to do. */
function failureOf(row) {
  return row.remedy ? `${row.error} → ${row.remedy}` : row.error;
}
