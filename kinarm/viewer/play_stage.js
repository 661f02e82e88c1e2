"use strict";

const GRASP = 0.06; // a pointer that passes the goal this closely takes it, as a share of the scale
const MOST_TRAIL = 400; // positions of the tool that are shown

/* ---------- the stage of a playground: a goal and obstacles that one moves ---------- */

class PlayStage extends Stage {
  constructor(viewer, data) {
    super(viewer, data);
    const { THREE } = this;
    this.solution = this.arm.ghost(data, 0x808890, 0.16);
    this.obstacles = data.obstacles.map((body, k) => this.find("obstacles", String(k)));
    const way = new THREE.BufferAttribute(new Float32Array(3 * MOST_TRAIL), 3);
    this.trail = new THREE.Line(new THREE.BufferGeometry().setAttribute("position", way), new THREE.LineBasicMaterial());
    this.trail.frustumCulled = false;
    this.find("goal").parent.add(this.trail);
    this.look(1);
  }

  theme(name) {
    super.theme(name);
    for (const material of [this.solution.material, this.trail.material]) {
      material.color.copy(this.colour(THEMES[name].ghost));
    }
  }

  /** Show joint positions, and a state with its tool's way and its nearest solution. */
  show(configuration, state, way, solution) {
    this.arm.show(configuration);
    this.solution.root.visible = Boolean(solution) && state.outcome !== "success";
    if (solution) {
      this.solution.show(solution.configuration);
    }
    this.showGoal(state.goal);
    this.mesh("goal", "cube").material.emissive.set(state.outcome === "success" ? 0x0b6b50 : 0x000000);
    const { geometry } = this.trail;
    geometry.attributes.position.copyArray(way.slice(-MOST_TRAIL).flat()).needsUpdate = true;
    geometry.setDrawRange(0, Math.min(way.length, MOST_TRAIL));
    const { touched, replaced } = state;
    this.flashAt(touched?.point);
    const found = touched || replaced;
    const bodies = found && found.pair !== null ? this.data.pairs[found.pair] : [];
    const joints = bodies.map((body) => this.data.bodies[body].joint).filter(Boolean);
    this.glow(joints, touched ? TOUCHED : this.data.colours.replaced);
    this.viewer.set_dirty();
  }

  showGoal([x, y, z, ...rest]) {
    const { THREE } = this;
    const node = this.find("goal");
    node.position.set(x, y, z);
    if (rest.length === 4) {
      node.quaternion.set(rest[1], rest[2], rest[3], rest[0]);
    } else if (rest.length === 3) {
      node.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), new THREE.Vector3(...rest));
    }
  }

  /* ---------- pointers ---------- */

  ray(event) {
    const { left, top, width, height } = this.viewer.renderer.domElement.getBoundingClientRect();
    const caster = new this.THREE.Raycaster();
    const at = { x: (2 * (event.clientX - left)) / width - 1, y: 1 - (2 * (event.clientY - top)) / height };
    caster.setFromCamera(at, this.viewer.camera);
    return caster;
  }

  /** What is under a pointer: { node, point }, the goal before all, or null. */
  under(event) {
    const { THREE } = this;
    const caster = this.ray(event);
    const goal = this.find("goal");
    const centre = goal.getWorldPosition(new THREE.Vector3());
    if (caster.ray.distanceToPoint(centre) < GRASP * this.data.scale * (event.pointerType === "touch" ? 1.6 : 1)) {
      return { node: goal, point: this.goalUnder(event) };
    }
    const [hit] = caster.intersectObjects([this.arm.root, ...this.obstacles], true);
    const node = hit && this.obstacles.find((obstacle) => hit.object === obstacle || obstacle.getObjectById(hit.object.id));
    return node ? { node, point: hit.point } : null;
  }

  /** The point nearest to the goal that a pointer points at. */
  goalUnder(event) {
    const { Vector3 } = this.THREE;
    return this.ray(event).ray.closestPointToPoint(this.find("goal").getWorldPosition(new Vector3()), new Vector3());
  }

  /** Follow a pointer that has taken something: how far it moved it, in the world [m]. */
  follower({ node, point }) {
    const { THREE, viewer } = this;
    // The goal moves across the view, obstacles along the floor.
    const normal = node === this.find("goal") ? viewer.camera.getWorldDirection(new THREE.Vector3()) : new THREE.Vector3(0, 1, 0);
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(normal, point);
    return (event) => {
      const met = this.ray(event).ray.intersectPlane(plane, new THREE.Vector3());
      return met && met.sub(point).applyQuaternion(viewer.scene.quaternion.clone().invert()).toArray();
    };
  }

  /** Where a point of the world is seen [pixels]. */
  onScreen(point) {
    this.viewer.render();
    const { x, y } = this.viewer.scene.localToWorld(new this.THREE.Vector3(...point.slice(0, 3))).project(this.viewer.camera);
    return [((1 + x) / 2) * window.innerWidth, ((1 - y) / 2) * window.innerHeight];
  }

  /** The camera's axes to the right, up and back, in the world. */
  get cameraAxes() {
    const axes = [new this.THREE.Vector3(), new this.THREE.Vector3(), new this.THREE.Vector3()];
    this.viewer.camera.matrixWorld.extractBasis(...axes);
    const turn = this.viewer.scene.quaternion.clone().invert();
    return axes.map((axis) => axis.applyQuaternion(turn).toArray());
  }
}
