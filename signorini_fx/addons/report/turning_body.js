// Draws the surface of a body by WebGL: colours are a field, a pointer turns it, sliders choose the
// load step and the magnification of displacements.
(() => {
  const figure = document.currentScript.parentElement;
  const find = (name) => figure.querySelector(name);
  const body = JSON.parse(find(".data").textContent);
  const unpack = (text, Kind) => new Kind(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const points = unpack(body.points, Float32Array);
  const triangles = unpack(body.triangles, Uint32Array);
  const edges = unpack(body.edges, Uint32Array);
  for (const step of body.steps) {
    step.displacement = unpack(step.displacement, Float32Array);
    for (const name in step.fields) step.fields[name] = unpack(step.fields[name], Float32Array);
  }
  const canvas = find("canvas");
  const gl = canvas.getContext("webgl2", { preserveDrawingBuffer: true, antialias: true });
  if (!gl) {
    find("figcaption").textContent = "This browser cannot draw in three dimensions (WebGL 2).";
    return;
  }

  // The middle of the body, and half its diagonal.
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  points.forEach((x, k) => { low[k % 3] = Math.min(low[k % 3], x); high[k % 3] = Math.max(high[k % 3], x); });
  const middle = low.map((x, k) => (x + high[k]) / 2);
  const radius = Math.hypot(...low.map((x, k) => high[k] - x)) / 2 || 1;

  const vertex = `#version 300 es
    in vec3 point, displacement; in float value;
    uniform mat3 turn; uniform vec3 middle; uniform vec2 moved; uniform vec4 sizes; uniform float lift;
    out vec3 seen; out float colour;
    void main() {
      seen = turn * (point + sizes.x * displacement - middle) / sizes.y;
      colour = value;
      gl_Position = vec4(sizes.w * (seen.x + moved.x) / sizes.z, sizes.w * (seen.y + moved.y), -0.2 * seen.z - lift, 1.0);
    }`;
  const fragment = `#version 300 es
    precision highp float;
    in vec3 seen; in float colour; out vec4 drawn;
    uniform sampler2D colours; uniform vec2 range; uniform bool line;
    void main() {
      if (line) { drawn = vec4(0.0, 0.0, 0.0, 0.35); return; }
      vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
      float light = 0.55 + 0.45 * abs(normal.z);
      bool none = isnan(colour) || colour > 3e38;
      float share = clamp((colour - range.x) / max(range.y - range.x, 1e-37), 0.0, 1.0);
      vec3 base = none ? vec3(0.82) : texture(colours, vec2(share * 15.0 / 16.0 + 0.5 / 16.0, 0.5)).rgb;
      drawn = vec4(light * base, 1.0);
    }`;
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  gl.useProgram(program);
  const at = (name) => gl.getUniformLocation(program, name);

  const buffers = {};
  function fill(name, values, width) {
    buffers[name] = buffers[name] || gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers[name]);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    const place = gl.getAttribLocation(program, name);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, width, gl.FLOAT, false, 0, 0);
  }
  const indices = [triangles, edges].map((values) => {
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, values, gl.STATIC_DRAW);
    return buffer;
  });
  const colours = new Uint8Array(body.colours.flatMap((text) => [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16)).concat(255)));
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 16, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, colours);
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.LINEAR);
  for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
  find(".bar").style.background = `linear-gradient(to right, ${body.colours.join(",")})`;

  const times = (a, b) => [0, 1, 2].map((i) => [0, 1, 2].map((j) => a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j]));
  const about = (axis, angle) => {
    const c = Math.cos(angle), s = Math.sin(angle);
    return axis === "x" ? [[1, 0, 0], [0, c, -s], [0, s, c]] : [[c, 0, s], [0, 1, 0], [-s, 0, c]];
  };
  // From the front, the right and above, z upwards; plane bodies as they are.
  const start = body.plane ? about("x", 0) : times(about("x", 0.42), times(about("y", -0.55), [[1, 0, 0], [0, 0, 1], [0, -1, 0]]));
  let turn = start, moved = [0, 0], zoom = 0.9;
  let step, values, range;

  function choose() {
    step = body.steps[+find(".step").value];
    values = step.fields[find(".field").value];
    // Colours end at the value that 99 % of the corners do not exceed, if the largest is far beyond it.
    const every = body.steps.flatMap((each) => Array.from(each.fields[find(".field").value] || []).filter(Number.isFinite)).sort((a, b) => a - b);
    const least = every[0], largest = every[every.length - 1], usual = every[Math.floor(0.99 * (every.length - 1))];
    range = [least, body.names || largest - least < 1.5 * (usual - least) || usual === least ? largest : usual];
    find(".name").textContent = step.name;
    find(".least").textContent = every.length ? least.toPrecision(3) : "none";
    find(".most").textContent = !every.length ? "" : range[1] < largest ? `${usual.toPrecision(3)} to ${largest.toPrecision(3)}` : largest.toPrecision(3);
    fill("displacement", step.displacement, 3);
    fill("value", values || new Float32Array(points.length / 3).fill(NaN), 1);
    draw();
  }
  const magnified = () => (+find(".scaled").value) * body.scale;
  function draw() {
    const ratio = window.devicePixelRatio || 1;
    canvas.width = canvas.clientWidth * ratio;
    canvas.height = canvas.clientHeight * ratio;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(1, 1, 1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE);
    gl.uniformMatrix3fv(at("turn"), true, turn.flat());
    gl.uniform3fv(at("middle"), middle);
    gl.uniform2fv(at("moved"), moved);
    gl.uniform2fv(at("range"), values ? range : [0, 1]);
    const aspect = canvas.width / canvas.height;
    gl.uniform4f(at("sizes"), magnified(), radius, aspect, aspect < 1 ? zoom * aspect : zoom);
    find(".times").textContent = String(+magnified().toPrecision(2));
    for (const [k, shape] of [gl.TRIANGLES, gl.LINES].entries()) {
      if (k && !find(".lines").checked) continue;
      gl.uniform1i(at("line"), k);
      gl.uniform1f(at("lift"), k * 4e-4);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, indices[k]);
      gl.drawElements(shape, [triangles, edges][k].length, gl.UNSIGNED_INT, 0);
    }
  }

  // The value below the pointer, or the name of the boundary: of the triangles there the nearest.
  function point(event) {
    const box = canvas.getBoundingClientRect();
    const aspect = box.width / box.height, size = aspect < 1 ? zoom * aspect : zoom;
    const x = ((event.clientX - box.left) / box.width * 2 - 1) * aspect / size - moved[0];
    const y = (1 - (event.clientY - box.top) / box.height * 2) / size - moved[1];
    const seen = Array.from({ length: points.length / 3 }, (_, n) => {
      const p = [0, 1, 2].map((i) => (points[3 * n + i] + magnified() * step.displacement[3 * n + i] - middle[i]) / radius);
      return turn.map((row) => row[0] * p[0] + row[1] * p[1] + row[2] * p[2]);
    });
    let best = [], nearest = -Infinity;
    for (let t = 0; t < triangles.length; t += 3) {
      const [p, q, r] = [0, 1, 2].map((i) => seen[triangles[t + i]]);
      const area = (q[0] - p[0]) * (r[1] - p[1]) - (r[0] - p[0]) * (q[1] - p[1]);
      const b = ((x - p[0]) * (r[1] - p[1]) - (r[0] - p[0]) * (y - p[1])) / area;
      const c = ((q[0] - p[0]) * (y - p[1]) - (x - p[0]) * (q[1] - p[1])) / area;
      const z = p[2] + b * (q[2] - p[2]) + c * (r[2] - p[2]);
      if (b >= 0 && c >= 0 && b + c <= 1 && z > nearest) {
        nearest = z;
        best = [1 - b - c, b, c].map((share, i) => [share, triangles[t + i]]);
      }
    }
    const mean = (of) => best.reduce((sum, [share, n]) => sum + share * of(n), 0);
    const value = values ? mean((n) => values[n]) : NaN;
    const place = best.length ? (body.plane ? [0, 1] : [0, 1, 2]).map((i) => mean((n) => points[3 * n + i])) : [];
    const what = body.names ? body.names[best.length && body.faces[best[0][1]]] : Number.isFinite(value) ? value.toPrecision(4) : "no value";
    find(".pointed").textContent = best.length ? `${what} at (${place.map((c) => Math.abs(c) < 1e-9 * radius ? 0 : +c.toPrecision(4)).join(", ")})` : "";
  }

  let held = null;
  canvas.addEventListener("pointerdown", (event) => { held = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointerup", () => { held = null; });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return point(event);
    const by = [event.clientX - held[0], event.clientY - held[1]];
    held = [event.clientX, event.clientY];
    if (event.shiftKey || body.plane) moved = [moved[0] + 2 * by[0] / canvas.clientHeight / zoom, moved[1] - 2 * by[1] / canvas.clientHeight / zoom];
    else turn = times(about("x", by[1] / 150), times(about("y", by[0] / 150), turn));
    draw();
  });
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom *= Math.exp(-event.deltaY / 800); draw(); }, { passive: false });
  canvas.addEventListener("dblclick", () => { turn = start; moved = [0, 0]; zoom = 0.9; draw(); });
  const names = new Set(body.steps.flatMap((each) => Object.keys(each.fields)));
  for (const name of names) find(".field").add(new Option(name));
  find(".step").max = body.steps.length - 1;
  find(".step").value = body.steps.length - 1;
  find(".steps").hidden = body.steps.length === 1;
  if (body.names) for (const name of [".scale", ".results"]) find(name).style.display = "none";
  for (const name of [".field", ".step", ".scaled", ".lines"]) find(name).addEventListener("input", choose);
  window.addEventListener("resize", draw);
  fill("point", points, 3);
  choose();
})();
