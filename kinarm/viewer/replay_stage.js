"use strict";

const RIVAL = 0x56b4e9;

/* ---------- the stage of a replay: goal, ways of the tool, ghosts and contacts ---------- */

class ReplayStage extends Stage {
  constructor(viewer, data) {
    super(viewer, data);
    this.start = this.arm.ghost(data, 0x808890, 0.16);
    this.refused = this.arm.ghost(data, data.colours.collision, 0.34);
    this.rival = data.trials.some((trial) => trial.runs.length > 1) ? this.arm.ghost(data, RIVAL, 0.55) : null;
  }

  theme(name) {
    super.theme(name);
    this.start.material.color.copy(this.colour(THEMES[name].ghost));
    for (const trial of this.find("trials").children) {
      const random = trial.getObjectByName("random");
      random?.traverse((mesh) => mesh.material && mesh.material.color.copy(this.colour(THEMES[name].obstacle)));
    }
  }

  select(index) {
    const trial = this.data.trials[index];
    this.trial = trial;
    for (const group of this.find("trials").children) {
      group.visible = group.name === String(index);
    }
    this.traces = trial.runs.map((run, k) => run.states.length > 1 && this.mesh("trials", String(index), k ? "ghost" : "run"));
    if (this.traces[1]) {
      Object.assign(this.traces[1].material, { transparent: true, opacity: 0.5 });
    }
    this.find("goal", "halo").scale.setScalar(trial.tolerance / this.data.trials[0].tolerance);
    this.start.show(trial.runs[0].states[0]);
    if (this.rival) {
      this.rival.root.visible = trial.runs.length > 1;
    }
    const side = trial.goals[0][1] < 0 ? -1 : 1;
    if (!this.touched && side !== this.side) {
      this.look(side);
    }
  }

  /** Show a moment; between steps the joints move evenly, as they do in the simulator. */
  show(time) {
    const { trial } = this;
    trial.runs.forEach((run, k) => {
      const arm = k ? this.rival : this.arm;
      const last = run.states.length - 1;
      const at = Math.min(time, last);
      const step = Math.min(Math.floor(at), Math.max(last - 1, 0));
      const share = at - step;
      const next = run.states[Math.min(step + 1, last)];
      const exact = share === 0 ? run.states[step] : share === 1 ? next : null;
      arm.show(exact || run.states[step].map((value, axis) => value + share * (next[axis] - value)));
      if (this.traces[k]) {
        this.traces[k].geometry.setDrawRange(0, Math.ceil(at) * this.data.traceIndices);
        this.traces[k].visible = at > 0;
      }
    });
    // Goals follow each other at once, and moving ones are where they were after the last step.
    const goal = trial.goals[Math.min(Math.floor(time), trial.goals.length - 1)];
    this.find("goal").position.fromArray(goal);
    this.find("goal").quaternion.fromArray(goal, 3);
    for (const [path, offsets] of Object.entries(trial.moving)) {
      const step = Math.min(Math.floor(time), Math.max(offsets.length - 2, 0));
      const [before, after] = [offsets[step], offsets[Math.min(step + 1, offsets.length - 1)]];
      this.find(...path.split("/")).position.fromArray(before.map((value, k) => value + (time - step) * (after[k] - value)));
    }
    const main = trial.runs[0];
    const ended = time >= main.states.length - 1;
    this.start.root.visible = time > 0.5;
    this.over(main, ended);
    const bodies = ended ? null : main.replaced.find(([step]) => step === Math.floor(time))?.[1];
    if (bodies) {
      this.glow(bodies.map((body) => this.data.links[body]), this.data.colours.replaced);
    }
    this.viewer.set_dirty();
  }

  /** What shows only at the end: the cube lights up, or what touched does. */
  over(run, ended) {
    const cube = this.mesh("goal", "cube").material;
    cube.emissive.set(ended && run.outcome === "success" ? 0x0b6b50 : 0x000000);
    const touched = ended && run.outcome === "collision";
    this.refused.root.visible = touched && run.refused !== null;
    this.flashAt(touched ? run.contactPoint : null);
    if (this.refused.root.visible) {
      this.refused.show(run.refused);
    }
    const joints = touched ? (run.contact || []).map((body) => this.data.links[body]) : [];
    this.glow(joints);
  }

  /** Pose of a part of the arm, or of its rival; see `Stage.pose`. */
  poseOf(name, run = 0) {
    return this.pose(name, run ? this.rival : this.arm);
  }
}
