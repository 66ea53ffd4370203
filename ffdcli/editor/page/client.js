// Additions to the client of viser, run before it. client.py fills in {{pause}}.
(() => {
  "use strict";
  // The address bar keeps the address with which the page was opened.
  history.replaceState = () => {};

  // A browser asks before it leaves a page only if the page wants it to.
  addEventListener("beforeunload", (event) => {
    if (document.querySelector("[data-ffd-unsaved]")) event.preventDefault();
  });

  let down = false;
  let moved = false;
  const release = () => { down = moved = false; };
  addEventListener("pointerdown", () => { down = true; }, true);
  addEventListener("pointermove", () => { moved = down; }, true);
  addEventListener("pointerup", release, true);
  addEventListener("pointercancel", release, true);

  // viser sends 20 positions of the mouse a second. A drawn model that follows at 30 needs more of
  // them. Only this pause of its client lasts 50 ms while the mouse is down.
  const wait = window.setTimeout.bind(window);
  window.setTimeout = (run, delay, ...given) =>
    wait(run, down && delay === 50 ? {{pause}} : delay, ...given);

  // three.js computes normals through accessors, and it looks for the mouse in every triangle, also
  // during a drag, which needs no answer. For large models both take longer than a frame. Its scenes
  // and renderers announce themselves to this object.
  const large = 20000;
  const hasOwn = (object, name) => Object.prototype.hasOwnProperty.call(object, name);
  const owner = (object, name) => {
    while (object && !hasOwn(object, name)) object = Object.getPrototypeOf(object);
    return object;
  };

  function computeNormals(slow) {
    return function () {
      const { position, normal } = this.attributes;
      if (!this.index || !position || !normal || normal.count !== position.count) {
        return slow.call(this);
      }
      const corners = this.index.array, at = position.array, sum = normal.array;
      sum.fill(0);
      for (let i = 0; i < corners.length; i += 3) {
        const a = 3 * corners[i], b = 3 * corners[i + 1], c = 3 * corners[i + 2];
        const ux = at[b] - at[a], uy = at[b + 1] - at[a + 1], uz = at[b + 2] - at[a + 2];
        const vx = at[c] - at[a], vy = at[c + 1] - at[a + 1], vz = at[c + 2] - at[a + 2];
        const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
        sum[a] += x; sum[a + 1] += y; sum[a + 2] += z;
        sum[b] += x; sum[b + 1] += y; sum[b + 2] += z;
        sum[c] += x; sum[c + 1] += y; sum[c + 2] += z;
      }
      for (let i = 0; i < sum.length; i += 3) {
        const x = sum[i], y = sum[i + 1], z = sum[i + 2];
        const scale = 1 / (Math.sqrt(x * x + y * y + z * z) || 1);
        sum[i] = x * scale; sum[i + 1] = y * scale; sum[i + 2] = z * scale;
      }
      normal.needsUpdate = true;
      return undefined;
    };
  }

  function hasten(mesh) {
    const geometries = owner(mesh.geometry, "computeVertexNormals");
    const meshes = owner(mesh, "raycast");
    geometries.computeVertexNormals = computeNormals(geometries.computeVertexNormals);
    const raycast = meshes.raycast;
    meshes.raycast = function (...given) {
      const count = this.geometry?.attributes?.position?.count ?? 0;
      if (!(moved && count > large)) raycast.apply(this, given);
    };
  }

  const announced = new EventTarget();
  announced.addEventListener("observe", ({ detail }) => {
    if (!detail.isScene) return;
    const add = detail.add;
    const objects = owner(detail, "add");
    objects.add = function (...given) {
      const mesh = given.find((each) => each?.isMesh && each.geometry);
      if (mesh) {
        objects.add = add;
        hasten(mesh);
      }
      return add.apply(this, given);
    };
  });
  window.__THREE_DEVTOOLS__ = announced;
})();
