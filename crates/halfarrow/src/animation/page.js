const scene = JSON.parse(document.getElementById("scene").textContent);
const by = id => document.getElementById(id);
const module = new Blob([by("three").textContent], { type: "text/javascript" });
const THREE = await import(URL.createObjectURL(module));
const { Vector3, Quaternion } = THREE;
const ink = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const colours = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b8860b", "#56b4e9", "#7a3e9d", "#8c8c2b"];
const last = scene.times.length - 1;
const ends = [scene.times[0], scene.times[last]];

// How things stand at a time: between two frames, by the way from one to the other.
const now = { frame: 0, part: 0 };
const reach = t => {
  let low = 0, high = last;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (scene.times[middle] <= t) low = middle; else high = middle;
  }
  const span = scene.times[high] - scene.times[low];
  now.frame = low;
  now.part = span > 0 ? Math.min(Math.max((t - scene.times[low]) / span, 0), 1) : 0;
};
const between = (motion, read) => {
  if (motion.length === 1) return read(motion[0], motion[0], 0);
  return read(motion[now.frame], motion[Math.min(now.frame + 1, last)], now.part);
};
const point = (i, out) => between(scene.points[i], (a, b, s) => out.set(...a.map((x, k) => x + s * (b[k] - x))));
const other = new Quaternion();
const quaternion = (q, out) => out.set(q[1], q[2], q[3], q[0]);
const turn = (i, out) => between(scene.turns[i], (a, b, s) => quaternion(a, out).slerp(quaternion(b, other), s));
const angle = i => between(scene.angles[i], (a, b, s) => a[0] + s * (b[0] - a[0]));

// What is seen.
const stage = new THREE.Scene();
stage.add(new THREE.HemisphereLight(0xffffff, 0x8a8f98, 2.2));
const sun = new THREE.DirectionalLight(0xffffff, 1.6);
stage.add(sun);
const up = new Vector3(...scene.up);
const straight = new Vector3(0, 1, 0);
const groups = new Map();
const layer = (name, object) => {
  if (!groups.has(name)) groups.set(name, []);
  groups.get(name).push(object);
  return object;
};
const given = (color, otherwise) => color ? new THREE.Color().setRGB(...color, THREE.SRGBColorSpace) : new THREE.Color(otherwise);
const matter = (color, more) => new THREE.MeshStandardMaterial({ color, roughness: 0.65, metalness: 0.05, ...more });
const glass = { transparent: true, opacity: 0.38, depthWrite: false };

// Turned about y. What is no tube has light and dark sectors, so that it is seen to turn.
const lathe = (radius, inner, length) => {
  const [r, i, h] = [radius, inner, length / 2];
  const outline = [[i, -h], [r, -h], [r, h], [i, h]].concat(i > 0 ? [[i, -h]] : []);
  const sides = 48;
  const solid = new THREE.LatheGeometry(outline.map(([x, y]) => new THREE.Vector2(x, y)), sides).toNonIndexed();
  solid.computeVertexNormals();
  const place = solid.attributes.position;
  const shade = new Float32Array(place.count * 3);
  for (let corner = 0; corner < place.count; corner += 3) {
    let [x, z] = [0, 0];
    for (let k = 0; k < 3; k++) { x += place.getX(corner + k); z += place.getZ(corner + k); }
    const sector = Math.floor(8 * (Math.atan2(z, x) / (2 * Math.PI) + 0.5) + 1e-6);
    shade.fill(i > 0 || sector % 2 ? 1 : 0.55, 3 * corner, 3 * corner + 9);
  }
  solid.setAttribute("color", new THREE.BufferAttribute(shade, 3));
  return solid;
};
const coil = () => {
  const turns = 7, curve = new THREE.Curve();
  curve.getPoint = (s, out = new Vector3()) => {
    const wide = s < 0.08 || s > 0.92 ? 0 : 1;
    return out.set(wide * Math.cos(2 * Math.PI * turns * s), s, wide * Math.sin(2 * Math.PI * turns * s));
  };
  return curve;
};
const nice = x => {
  const ten = 10 ** Math.floor(Math.log10(x));
  return ten * [5, 2, 1].find(k => k * ten <= x * 1.001);
};
const cell = nice(scene.extent / 6);
// In pieces as long as a cell: some renderers leave out lines that pass the camera.
const lines = () => {
  const half = 40, corners = [];
  for (let i = -half; i <= half; i++) for (let k = -half; k < half; k++) {
    const [a, b, c] = [i * cell, k * cell, (k + 1) * cell];
    corners.push(b, a, 0, c, a, 0, a, b, 0, a, c, 0);
  }
  const grid = new THREE.BufferGeometry();
  grid.setAttribute("position", new THREE.Float32BufferAttribute(corners, 3));
  return new THREE.LineSegments(grid, new THREE.LineBasicMaterial({ color: ink("--soft"), transparent: true, opacity: 0.35 }));
};
const make = {
  axes: form => layer("axes", new THREE.AxesHelper(form.length)),
  box: (form, material) => {
    const solid = new THREE.Mesh(new THREE.BoxGeometry(...form.size), material);
    solid.add(new THREE.LineSegments(new THREE.EdgesGeometry(solid.geometry), new THREE.LineBasicMaterial({ color: 0x30363d, transparent: true, opacity: 0.5 })));
    quaternion(form.turned, solid.quaternion);
    return solid;
  },
  cylinder: (form, material) => {
    material.vertexColors = true;
    const solid = new THREE.Mesh(lathe(form.radius, form.inner, form.length), material);
    solid.quaternion.setFromUnitVectors(straight, new Vector3(...form.axis));
    return solid;
  },
  grid: () => layer("grid", lines()),
  mesh: (form, material) => {
    const surface = new THREE.BufferGeometry();
    surface.setAttribute("position", new THREE.Float32BufferAttribute(scene.meshes[form.mesh].corners, 3));
    surface.computeVertexNormals();
    material.side = THREE.DoubleSide;
    return new THREE.Mesh(surface, material);
  },
  sphere: (form, material) => new THREE.Mesh(new THREE.SphereGeometry(form.radius, 24, 16), material)
};
let painted = 0;
const bodies = scene.bodies.map(body => {
  const { kind } = body.form;
  const small = kind === "sphere" || (kind === "cylinder" && !body.equivalent && body.form.radius < 0.03 * scene.extent);
  const tube = kind === "cylinder" && body.form.inner > 0;
  const plain = small ? "#59636e" : tube ? "#3c4249" : body.spin !== null ? "#9fb3c8" : kind === "axes" || kind === "grid" ? "#000" : colours[painted++ % colours.length];
  const see = body.equivalent && body.spin === null ? glass : {};
  const solid = make[kind](body.form, matter(given(body.color, plain), see));
  const frame = new THREE.Group(), spinning = new THREE.Group();
  if (kind !== "axes" && kind !== "grid") layer(small ? "joints" : "bodies", frame);
  if (kind === "grid") solid.renderOrder = -1;
  spinning.position.set(...body.centre);
  spinning.add(solid);
  frame.add(spinning);
  stage.add(frame);
  return { ...body, frame, spinning, solid, axis: new Vector3(...(body.form.axis ?? [0, 0, 1])) };
});
const helix = coil();
const links = scene.links.map(link => {
  const shape = link.coil ? new THREE.BufferGeometry() : new THREE.CylinderGeometry(link.radius, link.radius, 1, 16).translate(0, 0.5, 0);
  const solid = new THREE.Mesh(shape, matter(given(link.color, link.coil ? "#c9762b" : "#7d8590")));
  layer(link.coil ? "springs" : "rods", solid);
  stage.add(solid);
  if (link.coil) {
    // A unit coil whose wire keeps its thickness: its windings are set anew for every length.
    const tube = new THREE.TubeGeometry(helix, 240, 1, 6);
    solid.geometry = tube;
    solid.wire = Float32Array.from(tube.attributes.normal.array);
    solid.middle = Float32Array.from(tube.attributes.position.array, (x, i) => x - tube.attributes.normal.array[i]);
  }
  return { ...link, solid };
});
const [from, to] = [new Vector3(), new Vector3()];
const stretch = ({ solid, radius, coil }, length) => {
  if (!coil) return solid.scale.set(1, Math.max(length, 1e-9), 1);
  const place = solid.geometry.attributes.position, wire = 0.16 * radius;
  for (let i = 0; i < place.array.length; i += 3) {
    place.array[i] = radius * solid.middle[i] + wire * solid.wire[i];
    place.array[i + 1] = length * solid.middle[i + 1] + wire * solid.wire[i + 1];
    place.array[i + 2] = radius * solid.middle[i + 2] + wire * solid.wire[i + 2];
  }
  place.needsUpdate = true;
  solid.geometry.computeBoundingSphere();
};

// The camera looks at a target, from a distance, under two angles about what is upward.
const renderer = (() => {
  try {
    return new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  } catch (why) {
    const note = document.createElement("p");
    note.textContent = "This browser shows nothing in space (no WebGL); the plots are beside.";
    by("view").append(note);
    return null;
  }
})();
const camera = new THREE.PerspectiveCamera(35, 1, scene.extent * 1e-3, scene.extent * 1e3);
camera.up.copy(up);
const across = new Vector3().crossVectors(up, Math.abs(up.y) < 0.9 ? straight : new Vector3(1, 0, 0)).normalize();
// Azimuth 0 is x where z is upward.
const ahead = Math.abs(up.y) < 0.9 ? across.clone() : new Vector3(0, 0, 1).addScaledVector(up, -up.z).normalize();
const side = new Vector3().crossVectors(up, ahead);
const eye = { target: new Vector3(), distance: 1, azimuth: 0, elevation: 0 };
const first = () => {
  reach(ends[0]);
  const box = new THREE.Box3();
  bodies.forEach(body => { if (body.form.kind !== "grid") box.expandByPoint(point(body.place, from)); });
  links.forEach(link => { box.expandByPoint(point(link.from, from)); box.expandByPoint(point(link.to, from)); });
  if (box.isEmpty()) box.expandByPoint(from.set(0, 0, 0));
  box.getCenter(eye.target);
  eye.distance = 1.55 * scene.extent;
  [eye.azimuth, eye.elevation] = scene.flat ? [0, 0] : [-0.95, 0.38];
  // A plane is looked at along z.
  if (scene.flat) eye.azimuth = Math.atan2(side.z, ahead.z);
};
const look = () => {
  const flat = Math.cos(eye.elevation);
  camera.position.copy(eye.target)
    .addScaledVector(ahead, eye.distance * flat * Math.cos(eye.azimuth))
    .addScaledVector(side, eye.distance * flat * Math.sin(eye.azimuth))
    .addScaledVector(up, eye.distance * Math.sin(eye.elevation));
  camera.lookAt(eye.target);
  camera.near = Math.max(eye.distance * 1e-3, scene.extent * 1e-5);
  camera.far = eye.distance * 1e2 + scene.extent * 1e2;
  camera.updateProjectionMatrix();
  sun.position.copy(camera.position).addScaledVector(up, eye.distance);
  sun.target.position.copy(eye.target);
  sun.target.updateMatrixWorld();
};
const pan = (x, y) => {
  const scale = 2 * eye.distance * Math.tan(camera.fov * Math.PI / 360) / by("view").clientHeight;
  const [right, above] = [new Vector3(), new Vector3()];
  camera.matrixWorld.extractBasis(right, above, from);
  eye.target.addScaledVector(right, -x * scale).addScaledVector(above, y * scale);
};
const pointers = new Map();
const view = by("view");
view.addEventListener("pointerdown", e => { view.setPointerCapture(e.pointerId); pointers.set(e.pointerId, e); });
["pointerup", "pointercancel"].forEach(name => view.addEventListener(name, e => pointers.delete(e.pointerId)));
view.addEventListener("contextmenu", e => e.preventDefault());
view.addEventListener("pointermove", e => {
  const before = pointers.get(e.pointerId);
  if (!before) return;
  const [x, y] = [e.clientX - before.clientX, e.clientY - before.clientY];
  const far = () => { const [a, b] = [...pointers.values()]; return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY); };
  const wide = pointers.size === 2 ? far() : 0;
  pointers.set(e.pointerId, e);
  if (pointers.size === 2) {
    eye.distance *= Math.min(Math.max(wide / Math.max(far(), 1), 0.5), 2);
    pan(x / 2, y / 2);
  } else if (before.buttons & 2 || e.shiftKey) {
    pan(x, y);
  } else {
    eye.azimuth -= x * 0.006;
    eye.elevation = Math.min(Math.max(eye.elevation + y * 0.006, -1.55), 1.55);
  }
  changed = true;
});
view.addEventListener("wheel", e => {
  e.preventDefault();
  eye.distance = Math.min(Math.max(eye.distance * Math.exp(e.deltaY * 0.001), scene.extent * 0.02), scene.extent * 60);
  changed = true;
}, { passive: false });

// Time.
let [t, playing, changed] = [ends[0], false, true];
let before = null;
const clock = x => x.toFixed(ends[1] - ends[0] < 0.1 ? 5 : 3);
const followed = new Vector3();
const show = () => {
  reach(t);
  bodies.forEach(body => {
    point(body.place, body.frame.position);
    turn(body.turn, body.frame.quaternion);
    if (body.spin !== null) body.spinning.quaternion.setFromAxisAngle(body.axis, angle(body.spin));
  });
  links.forEach(link => {
    point(link.from, from);
    point(link.to, to).sub(from);
    link.solid.position.copy(from);
    const length = to.length();
    if (length > 0) link.solid.quaternion.setFromUnitVectors(straight, to.divideScalar(length));
    stretch(link, length);
  });
  const body = scene.bodies[by("follow").value];
  if (body) {
    point(body.place, from);
    eye.target.add(from).sub(followed);
    followed.copy(from);
  }
  look();
  // Lines go on where the camera looks.
  bodies.filter(body => body.form.kind === "grid").forEach(({ frame, solid }) => {
    frame.updateMatrixWorld();
    const local = frame.worldToLocal(to.copy(eye.target));
    solid.position.set(Math.round(local.x / cell) * cell, Math.round(local.y / cell) * cell, 0);
  });
  renderer?.render(stage, camera);
  by("time").value = t;
  by("clock").textContent = `${clock(t)} of ${clock(ends[1])} s`;
  plots.forEach(plot => {
    const left = plot.valToPos(t, "x");
    if (plot.bbox) plot.setCursor({ left, top: plot.bbox.height / devicePixelRatio / 2 }, false);
  });
};
const tick = time => {
  if (playing && before !== null) {
    t += (time - before) / 1000 * Number(by("speed").value);
    if (t > ends[1]) t = ends[1] > ends[0] ? ends[0] + (t - ends[0]) % (ends[1] - ends[0]) : ends[0];
    changed = true;
  }
  before = time;
  if (changed) { changed = false; show(); }
  requestAnimationFrame(tick);
};
const play = on => { playing = on; by("play").textContent = on ? "Pause" : "Play"; };
by("play").onclick = () => play(!playing);
addEventListener("keydown", e => {
  if (e.code !== "Space" || ["INPUT", "SELECT", "BUTTON", "SUMMARY"].includes(e.target.tagName)) return;
  e.preventDefault();
  play(!playing);
});
[by("time").min, by("time").max] = ends;
by("time").oninput = e => { play(false); t = Number(e.target.value); changed = true; };
const options = (select, list, chosen) => list.forEach(([value, text]) => select.add(new Option(text, value, value === chosen, value === chosen)));
options(by("speed"), [0.05, 0.1, 0.25, 0.5, 1, 2, 5, 10].map(x => [x, x + " ×"]), 1);

// What is followed: of what moves far the largest at first.
const size = ({ form }) => form.size ? Math.max(...form.size) : form.length ? Math.max(form.length, 2 * (form.radius ?? 0)) : form.radius ?? scene.extent;
const solids = scene.bodies.map((body, i) => [i, body]).filter(([, body]) => body.form.kind !== "grid" && body.form.kind !== "axes");
const travel = ({ place }) => { const m = scene.points[place]; return Math.hypot(...m[0].map((x, k) => m[m.length - 1][k] - x)); };
const far = solids.filter(([, body]) => travel(body) > scene.extent).sort((a, b) => size(b[1]) - size(a[1]))[0];
options(by("follow"), [["", "nothing"], ...solids.map(([i, body]) => [i, body.name])], far ? far[0] : "");
const start = () => {
  const body = scene.bodies[by("follow").value];
  if (body) point(body.place, followed);
};
by("follow").onchange = () => { start(); if (scene.bodies[by("follow").value]) eye.target.copy(followed); changed = true; };
by("reset").onclick = () => { const here = t; first(); start(); reach(here); changed = true; };

// What is shown.
[...groups].forEach(([name, objects]) => {
  const label = document.createElement("label"), box = document.createElement("input");
  box.type = "checkbox";
  box.checked = true;
  box.onchange = () => { objects.forEach(o => { o.visible = box.checked; }); changed = true; };
  label.append(box, " ", name);
  by("shown").append(label);
});
by("grid").textContent = groups.has("grid") ? `grid ${Number(cell.toPrecision(3))} m` : "";

// Plots, one a unit.
let plots = [];
const chosen = new Set(scene.curves.slice(0, 3).map(curve => curve.name));
const read = x => x == null ? "–" : Number(x).toPrecision(5);
const draw = () => {
  plots.forEach(plot => plot.destroy());
  const curves = scene.curves.filter(curve => chosen.has(curve.name));
  const units = [...new Set(curves.map(curve => curve.unit))];
  const lines = { stroke: ink("--line"), width: 1 };
  const axis = { stroke: ink("--soft"), grid: lines, ticks: lines };
  const width = Math.max(by("plots").clientWidth, 120);
  plots = units.map(unit => {
    const own = curves.filter(curve => curve.unit === unit);
    const plot = new uPlot({
      width, height: 190,
      cursor: { y: false, drag: { x: false, y: false }, bind: { mousemove: () => null, mouseleave: () => null, mouseenter: () => null } },
      scales: { x: { time: false } },
      axes: [{ ...axis, label: "t in s", labelSize: 20 }, { ...axis, label: unit && unit !== "1" ? "in " + unit : " ", labelSize: 20, size: 62 }],
      series: [{ label: "t", value: (u, x) => read(x) }].concat(own.map((curve, k) => ({
        label: curve.name, stroke: colours[k % colours.length], width: 1.5, value: (u, x) => read(x), dash: k >= colours.length ? [7, 7] : undefined
      })))
    }, [scene.times].concat(own.map(curve => curve.values)), by("plots"));
    // A press or a drag in a plot goes to its time.
    const go = e => { if (e.buttons & 1) { play(false); t = Math.min(Math.max(plot.posToVal(e.clientX - plot.over.getBoundingClientRect().left, "x"), ends[0]), ends[1]); changed = true; } };
    plot.over.addEventListener("pointerdown", go);
    plot.over.addEventListener("pointermove", go);
    return plot;
  });
  changed = true;
};
const names = () => {
  const wanted = by("filter").value.toLowerCase();
  const fitting = scene.curves.filter(curve => curve.name.toLowerCase().includes(wanted));
  by("names").replaceChildren(...fitting.slice(0, 200).map(curve => {
    const item = document.createElement("li"), label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox";
    box.checked = chosen.has(curve.name);
    box.onchange = () => { chosen[box.checked ? "add" : "delete"](curve.name); draw(); };
    label.append(box, ` ${curve.name}`, curve.unit && curve.unit !== "1" ? ` in ${curve.unit}` : "");
    item.append(label);
    return item;
  }));
};
by("filter").oninput = names;
if (!scene.curves.length) by("columns").hidden = true;

const fit = () => {
  const [w, h] = [view.clientWidth, view.clientHeight];
  if (!renderer || !w || !h) return;
  renderer.setPixelRatio(devicePixelRatio);
  renderer.setSize(w, h);
  camera.aspect = w / h;
  // What fits upright fits across too.
  camera.fov = 35 * Math.max(1, h / w);
  changed = true;
};
const paper = () => { renderer?.setClearColor(ink("--sky")); draw(); };
if (renderer) view.prepend(renderer.domElement);
new ResizeObserver(() => { fit(); plots.forEach(plot => plot.setSize({ width: Math.max(by("plots").clientWidth, 120), height: plot.height })); }).observe(view);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paper);
names();
first();
start();
fit();
paper();
// `#t=1.5` opens the page at a time, still.
const at = /t=([0-9.eE+-]+)/.exec(location.hash);
if (at) t = Math.min(Math.max(Number(at[1]), ends[0]), ends[1]); else play(ends[1] > ends[0]);
requestAnimationFrame(tick);
