"use strict";
(function () {
  const data = JSON.parse(document.getElementById("scene").textContent);
  const $ = (id) => document.getElementById(id);

  // ---- arrays: base64 of little-endian numbers ----
  function bytes(text) {
    const raw = atob(text);
    const out = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
    return out.buffer;
  }
  const floats = (text) => new Float32Array(bytes(text));
  const integers = (text) => new Uint32Array(bytes(text));

  // ---- the stage ----
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  } catch (error) {
    $("trouble").textContent = "This browser cannot draw in 3D: WebGL is switched off.";
    $("trouble").hidden = false;
    return;
  }
  renderer.setClearColor(0xffffff);
  renderer.setPixelRatio(window.devicePixelRatio);
  $("stage").appendChild(renderer.domElement);
  const scene = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(30, 1, 0.01, 100);
  camera.up.set(0, 0, 1);
  scene.add(camera);
  scene.add(new THREE.AmbientLight(0xffffff, 0.5));
  for (const [x, y, z, strength] of [[0.5, 0.8, 1, 0.42], [-1, 0.2, 0.8, 0.25]]) {
    const light = new THREE.DirectionalLight(0xffffff, strength);
    light.position.set(x, y, z);
    camera.add(light);
  }
  const controls = new THREE.OrbitControls(camera, renderer.domElement);

  // Coordinates are relative to the middle, in units of the half diagonal: single precision would
  // otherwise lose the details of a small part far from the origin.
  const movers = [];
  const layers = {};

  function layer(name, label, colour, object, shown) {
    if (!object) return;
    object.visible = shown;
    scene.add(object);
    layers[name] = object;
    const row = document.createElement("label");
    const box = document.createElement("input");
    box.type = "checkbox";
    box.id = "show-" + name;
    box.checked = shown;
    box.addEventListener("change", () => { object.visible = box.checked; draw(); });
    const swatch = document.createElement("i");
    swatch.style.background = colour;
    row.append(box, swatch, label);
    $("layers").appendChild(row);
  }

  // Geometry whose positions are interpolated between the frames of the amplitudes.
  function moving(frames, index, geometry, normals) {
    const arrays = frames.map(floats);
    const count = index ? index.length * 3 : arrays[0].length;
    const position = new THREE.BufferAttribute(new Float32Array(count), 3);
    geometry.setAttribute("position", position);
    movers.push((low, share) => {
      const a = arrays[Math.min(low, arrays.length - 1)], b = arrays[Math.min(low + 1, arrays.length - 1)], out = position.array;
      for (let i = 0; i < count; i++) {
        const j = index ? 3 * index[(i / 3) | 0] + (i % 3) : i;
        out[i] = a[j] + share * (b[j] - a[j]);
      }
      position.needsUpdate = true;
      if (normals) geometry.computeVertexNormals();
      geometry.boundingSphere = null;
      geometry.boundingBox = null;
    });
    return geometry;
  }

  function lines(frames, index, colour, opacity) {
    const geometry = moving(frames, integers(index), new THREE.BufferGeometry(), false);
    const look = { color: colour, transparent: opacity < 1, opacity };
    const object = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial(look));
    object.frustumCulled = false;
    return object;
  }

  function surface(skin, colours) {
    const geometry = moving(skin.frames, null, new THREE.BufferGeometry(), true);
    geometry.setIndex(new THREE.BufferAttribute(integers(skin.triangles), 1));
    const material = new THREE.MeshLambertMaterial({
      side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 2,
    });
    if (colours) {
      const face = integers(skin.face), triangles = integers(skin.triangles);
      const paint = new Float32Array(geometry.attributes.position.array.length);
      const plain = data.palette.map((each) => new THREE.Color(each));
      for (let t = 0; t < face.length; t++) {
        const tint = plain[colours[face[t]] % plain.length];
        for (let i = 0; i < 3; i++) tint.toArray(paint, 3 * triangles[3 * t + i]);
      }
      geometry.setAttribute("color", new THREE.BufferAttribute(paint, 3));
      material.vertexColors = true;
    } else {
      material.color.set(data.colours.before);
    }
    const mesh = new THREE.Mesh(geometry, material);
    mesh.frustumCulled = false;
    return mesh;
  }

  function group(...members) {
    const all = new THREE.Group();
    all.add(...members);
    return all;
  }

  function disc() {
    const size = 64, canvas = document.createElement("canvas");
    canvas.width = canvas.height = size;
    const pen = canvas.getContext("2d");
    pen.fillStyle = "#fff";
    pen.beginPath();
    pen.arc(size / 2, size / 2, size / 2 - 2, 0, 2 * Math.PI);
    pen.fill();
    return new THREE.CanvasTexture(canvas);
  }
  const dot = disc();

  // The control points of a net, or those of empty cells alone, which are hidden.
  function points(net, hidden) {
    const locked = new Uint8Array(bytes(net.locked)), empty = new Uint8Array(bytes(net.hidden));
    const chosen = [...empty.keys()].filter((i) => (empty[i] === 1) === hidden);
    const geometry = moving(net.frames, chosen, new THREE.BufferGeometry(), false);
    const paint = new Float32Array(geometry.attributes.position.array.length);
    const free = new THREE.Color(hidden ? data.colours.hidden : data.colours.point);
    const held = hidden ? free : new THREE.Color(data.colours.locked);
    chosen.forEach((i, place) => (locked[i] ? held : free).toArray(paint, 3 * place));
    geometry.setAttribute("color", new THREE.BufferAttribute(paint, 3));
    const material = new THREE.PointsMaterial({
      size: 8 * window.devicePixelRatio, sizeAttenuation: false, map: dot, alphaTest: 0.5,
      vertexColors: true,
    });
    const object = new THREE.Points(geometry, material);
    object.frustumCulled = false;
    return object;
  }

  function arrows(text) {
    const ends = floats(text);
    const all = new THREE.Group();
    for (let i = 0; i < ends.length; i += 6) {
      const from = new THREE.Vector3(ends[i], ends[i + 1], ends[i + 2]);
      const to = new THREE.Vector3(ends[i + 3], ends[i + 4], ends[i + 5]);
      const way = to.clone().sub(from), length = way.length();
      if (!(length > 0)) continue;
      const head = Math.min(0.35 * length, 0.06);
      const arrow = new THREE.ArrowHelper(
        way.normalize(), from, length, data.colours.drag, head, 0.5 * head);
      all.add(arrow);
    }
    return all.children.length ? all : null;
  }

  const colours = integers(data.faces.colour);
  if (data.before) {
    layer("before", "Mesh before", data.colours.before, group(
      surface(data.before, null), lines(data.before.frames, data.before.outline, data.colours.line, 0.6)
    ), false);
  }
  const after = surface(data.after, colours);
  layer("after", data.before ? "Exact faces" : "Faces", data.palette[0], after, true);
  layer("edges", "Edges of faces", data.colours.line,
    lines(data.after.frames, data.after.outline, data.colours.line, 1), true);
  if (data.lattices.length) {
    const parts = data.lattices.map((net) => group(
      lines(net.frames, net.lines, data.colours.lattice, 0.9), points(net, false)));
    layer("lattice", "Lattice", data.colours.lattice, group(...parts), true);
  }
  if (data.hidden_count) {
    layer("hidden", `Hidden control points (${data.hidden_count})`, data.colours.hidden,
      group(...data.lattices.map((net) => points(net, true))), data.hidden_points);
    $("show-hidden").addEventListener("change", () => {
      look(camera.position.clone().sub(controls.target).normalize());
    });
  }
  if (data.drags) layer("drags", "Drags", data.colours.drag, arrows(data.drags), true);
  if (data.cells) {
    const place = floats(data.cells), geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(place, 3));
    const look = { color: data.colours.cell, transparent: true, opacity: 0.5 };
    const object = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial(look));
    layer("cells", "Octree cells", data.colours.cell, object, false);
  }
  $("facts").textContent = data.facts;

  // ---- amplitude ----
  function amplitude(value) {
    const s = data.amplitudes;
    let low = 0;
    while (low < s.length - 2 && value > s[low + 1]) low++;
    const share = s.length > 1 ? (value - s[low]) / (s[low + 1] - s[low]) : 0;
    movers.forEach((move) => move(low, share));
    $("amplitude").value = String(Math.round(100 * value));
    $("amplitude-value").textContent = Math.round(100 * value) + " %";
    draw();
  }
  $("amplitude-row").hidden = data.amplitudes.length < 2;
  $("amplitude").addEventListener("input", (event) => amplitude(event.target.value / 100));
  $("rest").addEventListener("click", () => amplitude(0));
  $("full").addEventListener("click", () => amplitude(1));

  // ---- view ----
  let waiting = false;
  function draw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      renderer.render(scene, camera);
      document.documentElement.dataset.drawn = String(
        1 + Number(document.documentElement.dataset.drawn || 0));
    });
  }
  // Look at all that is shown, from a direction.
  function look(direction) {
    const all = layers.hidden && layers.hidden.visible;
    const [x, y, z, radius] = data.sight[all ? 1 : 0];
    const half = (camera.fov * Math.PI) / 360;
    const narrow = Math.min(1, camera.aspect);
    const distance = (1.05 * radius) / Math.sin(Math.atan(Math.tan(half) * narrow));
    controls.target.set(x, y, z);
    camera.position.copy(controls.target).addScaledVector(direction, distance);
    controls.update();
    draw();
  }
  function fit() {
    look(new THREE.Vector3(...data.direction).normalize());
  }
  function resize() {
    const width = window.innerWidth, height = window.innerHeight;
    camera.aspect = width / height;
    // The panel covers the left side: centre the model in the rest.
    const covered = width > 700 ? 250 : 0;
    camera.setViewOffset(width, height, -covered / 2, 0, width, height);
    camera.updateProjectionMatrix();
    renderer.setSize(width, height);
    draw();
  }
  window.addEventListener("resize", resize);
  $("fit").addEventListener("click", fit);
  controls.addEventListener("change", draw);

  // ---- facts of the face under the pointer ----
  const ray = new THREE.Raycaster();
  const faceOf = integers(data.after.face);
  const deviation = data.faces.deviation ? floats(data.faces.deviation) : null;
  let asked = null;
  function point(event) {
    const asking = asked === null;
    asked = event;
    if (asking) requestAnimationFrame(tell);
  }
  function tell() {
    const event = asked;
    asked = null;
    const tip = $("tip");
    tip.hidden = true;
    if (!after.visible || event.buttons) return;
    const place = new THREE.Vector2(
      (2 * event.clientX) / window.innerWidth - 1, 1 - (2 * event.clientY) / window.innerHeight);
    ray.setFromCamera(place, camera);
    const hit = ray.intersectObject(after)[0];
    if (!hit) return;
    const face = faceOf[hit.faceIndex];
    const words = [`Face ${face}: ${data.degrees[integers(data.faces.degree)[face]]}`];
    if (deviation) words.push(`deviation ${deviation[face].toExponential(1)} ${data.unit}`);
    tip.textContent = words.join("\n");
    tip.style.left = Math.min(event.clientX + 14, window.innerWidth - 290) + "px";
    tip.style.top = event.clientY + 16 + "px";
    tip.hidden = false;
  }
  renderer.domElement.addEventListener("pointermove", point);
  renderer.domElement.addEventListener("pointerleave", () => { $("tip").hidden = true; });

  resize();
  fit();
  amplitude(1);
  document.documentElement.dataset.ready = "yes";
})();
