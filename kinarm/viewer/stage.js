"use strict";

const THEMES = {
  light: { back: 0xeef1f4, floor: 0xd3d9df, grid: 0xb4bdc7, obstacle: 0x8f9aa8, slab: 0xb3bdc8, ghost: 0x4d5a68, sky: 0.3, sun: 0.62 },
  dark: { back: 0x1a1f25, floor: 0x171c22, grid: 0x3c4753, obstacle: 0x3d4752, slab: 0x586573, ghost: 0xb4c1ce, sky: 0.22, sun: 0.6 },
};
const TOUCHED = 0x8c2f00;
const BEHIND = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 8 }; // gives way to what coincides

/* ---------- the arm: joint values to poses ---------- */

class ArmModel {
  constructor(THREE, root, description) {
    this.THREE = THREE;
    this.root = root;
    this.axes = description.axes;
    this.frames = [root];
    for (let k = 1; k <= this.axes.length; k++) {
      this.frames.push(this.frames[k - 1].children.find((child) => child.name === `axis_${k}`));
    }
    this.tool = new THREE.Group();
    this.tool.position.fromArray(description.tool);
    this.frames[this.axes.length].add(this.tool);
  }

  show(configuration) {
    const { THREE } = this;
    this.axes.forEach((axis, k) => {
      const [w, x, y, z] = axis.rotation;
      const frame = this.frames[k + 1];
      const direction = new THREE.Vector3(...axis.axis);
      frame.position.fromArray(axis.translation);
      frame.quaternion.set(x, y, z, w);
      if (axis.slides) {
        frame.position.addScaledVector(direction.applyQuaternion(frame.quaternion), configuration[k]);
      } else {
        frame.quaternion.multiply(new THREE.Quaternion().setFromAxisAngle(direction, configuration[k]));
      }
    });
  }

  /** A translucent copy; a pass that draws only depth keeps its inside from showing. */
  ghost(description, colour, opacity) {
    const { THREE } = this;
    const root = this.root.clone(true);
    const material = new THREE.MeshStandardMaterial({
      color: new THREE.Color(colour).convertSRGBToLinear(), roughness: 0.7, transparent: true, opacity, depthWrite: false, ...BEHIND,
    });
    const depth = new THREE.MeshBasicMaterial({ colorWrite: false, transparent: true, ...BEHIND });
    const meshes = [];
    root.traverse((node) => node.isMesh && meshes.push(node));
    for (const mesh of meshes) {
      const veil = mesh.clone();
      Object.assign(mesh, { material, castShadow: false, receiveShadow: false, renderOrder: 2 });
      Object.assign(veil, { material: depth, castShadow: false, receiveShadow: false, renderOrder: 1 });
      mesh.parent.add(veil);
    }
    this.root.parent.add(root);
    const copy = new ArmModel(THREE, root, description);
    copy.material = material;
    return copy;
  }
}

/* ---------- the stage: an arm, what stands around it, light and camera ---------- */

class Stage {
  constructor(viewer, data) {
    this.viewer = viewer;
    this.data = data;
    this.THREE = MeshCat.THREE;
    const { THREE } = this;
    viewer.renderer.outputEncoding = THREE.sRGBEncoding;
    viewer.renderer.domElement.tabIndex = -1;
    viewer.renderer.setClearAlpha(0); // the page's own background shows through
    viewer.scene.background = null;
    viewer.scene.traverse((node) => node.isMesh && node.material.color.convertSRGBToLinear());
    this.light();
    this.arm = new ArmModel(THREE, this.find("arm"), data);
    this.tint = this.finishes();
    this.flash = this.find("flash");
    this.mesh("flash").renderOrder = 9;
    this.mesh("flash").material.depthTest = false;
    this.mesh("flash").castShadow = false;
    this.find("floor").traverse((node) => { node.castShadow = false; });
    this.find("goal").traverse((node) => { node.castShadow = node.castShadow && node.material && !node.material.transparent; });
    this.camera();
  }

  find(...path) {
    return this.viewer.scene_tree.find(["meshcat", ...path]).object;
  }

  mesh(...path) {
    return this.find(...path, "<object>");
  }

  /** A sky, a light against hard shadows, and soft reflections of a bright room. */
  light() {
    const { THREE, viewer } = this;
    viewer.scene_tree.find(["Lights"]).object.visible = false;
    this.sky = new THREE.HemisphereLight(0xffffff, 0xb9c0c8);
    const fill = new THREE.DirectionalLight(0xdce8ff, 0.3);
    fill.position.set(-2.5, 1.8, -2.2);
    viewer.scene.add(this.sky, fill);
    const room = new THREE.Scene();
    const panel = (colour, size, place) => {
      const mesh = new THREE.Mesh(new THREE.BoxGeometry(...size), new THREE.MeshBasicMaterial({ color: colour, side: THREE.DoubleSide }));
      mesh.position.set(...place);
      room.add(mesh);
    };
    panel(0x5c6066, [12, 8, 12], [0, 2, 0]);
    panel(0xffffff, [5, 0.1, 2.4], [1, 5.4, 1]);
    panel(0xe8f0ff, [0.1, 3, 6], [-5.5, 2.5, 0]);
    panel(0xfff4e4, [6, 2.4, 0.1], [0, 3, 5.6]);
    const generator = new THREE.PMREMGenerator(viewer.renderer);
    viewer.scene.environment = generator.fromScene(room, 0.03).texture;
    generator.dispose();
  }

  /** Materials of the arm by joint, to light up what touches. */
  finishes() {
    return this.arm.frames.map((frame) =>
      frame.children.filter((child) => child.name.startsWith("part_")).map((part) => part.children[0].material));
  }

  /** Light up what some joints carry, of which something touches, or would have. */
  glow(joints, colour = TOUCHED) {
    this.tint.forEach((materials, joint) => {
      for (const material of materials) {
        material.emissive.set(joints.includes(joint) ? colour : 0x000000);
      }
    });
  }

  /** Show a ball at a contact, or none. */
  flashAt(point) {
    this.flash.visible = Boolean(point);
    if (point) {
      this.flash.position.fromArray(point);
    }
  }

  pulse(seconds) {
    const swing = 0.5 - 0.5 * Math.cos(2 * Math.PI * 1.1 * seconds);
    this.flash.scale.setScalar(1 + 1.1 * swing);
    this.mesh("flash").material.opacity = 0.75 - 0.45 * swing;
    this.viewer.set_dirty();
  }

  colour(value) {
    return new this.THREE.Color(value).convertSRGBToLinear();
  }

  theme(name) {
    const { viewer } = this;
    const look = THEMES[name];
    viewer.scene.fog = new this.THREE.Fog(look.back, 1, 2); // mixed in after the conversion to sRGB
    this.clear();
    const paint = (value, node) => node.traverse((mesh) => mesh.material && mesh.material.color.copy(this.colour(value)));
    paint(look.floor, this.find("floor"));
    paint(look.grid, this.find("grid"));
    for (const part of this.find("obstacles").children.flatMap((obstacle) => obstacle.children)) {
      paint(part.name === "top" ? look.slab : look.obstacle, part);
    }
    this.sky.intensity = look.sky;
    this.mesh("sun").intensity = look.sun;
    viewer.set_dirty();
  }

  camera() {
    const { viewer } = this;
    viewer.camera.fov = 30;
    viewer.camera.near = 0.05 * this.data.scale;
    this.side = 0;
    this.touched = false;
    viewer.controls.addEventListener("start", () => { this.touched = true; });
    viewer.controls.addEventListener("change", () => this.clear());
    if (window.self !== window.top) { // within another page, the wheel scrolls that one until the scene is touched
      const stage = viewer.dom_element;
      viewer.controls.enableZoom = false;
      stage.addEventListener("pointerdown", () => { viewer.controls.enableZoom = true; });
      stage.addEventListener("pointerleave", () => { viewer.controls.enableZoom = false; });
    }
    viewer.controls.minDistance = 0.3 * this.data.scale;
    viewer.controls.maxDistance = 7 * Math.max(this.data.scale, 1);
    viewer.controls.maxPolarAngle = 1.54;
    window.addEventListener("resize", () => this.touched || this.look(this.side));
  }

  /** Let the floor fade out behind the scene, wherever that is seen from. */
  clear() {
    const { fog } = this.viewer.scene;
    fog.near = this.viewer.camera.position.length() + 0.2;
    fog.far = fog.near + 3.6;
  }

  /** Look from behind, on the side (1 left, -1 right) where the goal is, past card and dock. */
  look(side) {
    const { viewer, THREE } = this;
    const [width, height] = [window.innerWidth, window.innerHeight];
    const [card, dock] = ["card", "dock"].map((id) => document.getElementById(id));
    const tall = width <= 640;
    const narrow = width <= 1000 ? 1 : 0;
    const free = {
      width: width - (tall ? 0 : 0.64 * card.offsetWidth * narrow),
      height: height - dock.offsetHeight - (tall ? card.offsetHeight : 0) - 24,
    };
    const away = 0.96 * Math.max(height / free.height, (1.32 * height) / free.width);
    const right = tall ? 0 : 0.32 * card.offsetWidth * narrow;
    const up = (dock.offsetHeight - (tall ? card.offsetHeight : 0)) / 2;
    viewer.camera.setViewOffset(width, height, -right, up, width, height);
    viewer.controls.target.set(0.05, 0.3, -0.1 * side).multiplyScalar(this.data.scale);
    const eye = new THREE.Vector3(-2.35, 1.5, -1.85 * side).multiplyScalar(away * this.data.scale);
    viewer.camera.position.copy(viewer.controls.target).add(eye);
    this.side = side;
    this.touched = false;
    viewer.set_dirty();
  }

  /** Look from a place at a target, both in the world [m]; this stays until the view is reset. */
  lookFrom(eye, target) {
    const { viewer } = this;
    viewer.camera.clearViewOffset();
    viewer.controls.target.set(target[0], target[2], -target[1]);
    viewer.camera.position.set(eye[0], eye[2], -eye[1]);
    viewer.controls.update();
    this.touched = true;
    viewer.set_dirty();
  }

  /** Pose of "base", "axis_1", ... or "tool" of an arm in the world, column by column. */
  pose(name, arm = this.arm) {
    const node = name === "tool" ? arm.tool : name === "base" ? arm.root : arm.frames[Number(name.slice(5))];
    const { scene } = this.viewer;
    scene.updateMatrixWorld(true);
    return scene.matrixWorld.clone().invert().multiply(node.matrixWorld).toArray();
  }

  /** What there is to see: meshes with their boxes, and the triangles that were drawn. */
  census() {
    const meshes = [];
    this.viewer.render();
    this.arm.root.traverse((node) => {
      if (node.isMesh) {
        const bounds = new this.THREE.Box3().setFromObject(node);
        meshes.push([...bounds.min.toArray(), ...bounds.max.toArray()]);
      }
    });
    return { meshes, triangles: this.viewer.renderer.info.render.triangles };
  }
}
