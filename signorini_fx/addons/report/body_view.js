// A body in 3D that can be turned: its surface with a field in colours, and its foundations.
function turn(place) {
  var data = JSON.parse(place.querySelector("script").textContent);
  var canvas = document.createElement("canvas");
  var gl = canvas.getContext("webgl", { antialias: true });
  if (!gl || !gl.getExtension("OES_standard_derivatives") || !gl.getExtension("OES_element_index_uint")) return;
  place.hidden = false;
  function element(kind, parent, text, name) {
    var made = document.createElement(kind);
    if (text) made.textContent = text;
    if (name) made.className = name;
    return parent.appendChild(made);
  }
  function bytes(text) {
    return Uint8Array.from(atob(text), function (letter) { return letter.charCodeAt(0); });
  }
  function buffer(kind, text) {
    var made = gl.createBuffer();
    gl.bindBuffer(kind, made);
    gl.bufferData(kind, bytes(text), gl.STATIC_DRAW);
    return made;
  }
  function part(from) {
    var found = { at: ["points", "motion", "values"].map(function (name) { return buffer(gl.ARRAY_BUFFER, from[name]); }) };
    ["triangles", "lines"].forEach(function (name) {
      found[name] = buffer(gl.ELEMENT_ARRAY_BUFFER, from[name]);
      found[name].count = bytes(from[name]).length / 4;
    });
    return found;
  }
  function shader(kind, text) {
    var made = gl.createShader(kind);
    gl.shaderSource(made, text);
    gl.compileShader(made);
    gl.attachShader(program, made);
  }
  var program = gl.createProgram();
  shader(gl.VERTEX_SHADER, "attribute vec3 p, m; attribute float v; uniform mat4 view; uniform float factor, pull;" +
    "varying vec3 q; varying float w; void main() { q = p + factor * m; w = v; gl_Position = view * vec4(q, 1.0);" +
    "gl_Position.z -= pull * gl_Position.w; }");
  shader(gl.FRAGMENT_SHADER, "#extension GL_OES_standard_derivatives : enable\nprecision highp float;" +
    "varying vec3 q; varying float w; uniform sampler2D map; uniform vec2 limits; uniform vec3 eye; uniform vec4 plain;" +
    "void main() { float share = clamp((w - limits.x) / (limits.y - limits.x), 0.0, 1.0);" +
    "vec3 colour = plain.a > 0.0 ? plain.rgb : texture2D(map, vec2((0.5 + 255.0 * share) / 256.0, 0.5)).rgb;" +
    "vec3 normal = cross(dFdx(q), dFdy(q)); float size = length(normal);" +
    "float light = plain.a == 1.0 || size == 0.0 ? 1.0 : 0.5 + 0.5 * abs(dot(normal, normalize(eye - q))) / size;" +
    "gl_FragColor = vec4(colour * light, 1.0); }");
  gl.linkProgram(program);
  gl.useProgram(program);
  var names = ["view", "factor", "limits", "eye", "plain", "pull"], at = {};
  names.forEach(function (name) { at[name] = gl.getUniformLocation(program, name); });
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, bytes(data.colours));
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
  gl.enable(gl.DEPTH_TEST);
  gl.clearColor(1, 1, 1, 1);
  var body = part(data.body), grounds = data.grounds.map(part);

  var frame = element("div", place, "", "frame");
  frame.appendChild(canvas);
  var letters = ["x", "y", "z"].map(function (name, k) {
    var size = parseFloat((data.high[k] - data.low[k]).toPrecision(4));
    return element("span", frame, name + ": " + size + (data.unit ? " " + data.unit : ""));
  });
  var mark = element("span", frame, data.largest ? "\u25e6 " + data.largest.value : "", "mark");
  var bar = element("p", place, "", "bar"), colours = bytes(data.colours), stops = [];
  for (var k = 0; k < 256; k += 15) stops.push("rgb(" + Array.from(colours.slice(3 * k, 3 * k + 3)).join() + ")");
  element("span", bar, String(parseFloat(data.limits[0].toPrecision(3))));
  element("i", bar).style.background = "linear-gradient(to right, " + stops.join() + ")";
  element("span", bar, parseFloat(data.limits[1].toPrecision(3)) + "   " + data.label);
  var controls = element("p", place, "", "buttons");
  var slider = element("input", element("label", controls, "displacement \u00d7 "));
  slider.type = "range";
  slider.min = 0;
  slider.max = 200;
  slider.value = data.bends ? 100 / data.factor : 100;
  var told = element("span", controls, "", "told");
  var mesh = element("input", element("label", controls, "mesh "));
  mesh.type = "checkbox";
  var middle = data.low.map(function (low, k) { return 0.5 * (low + data.high[k]); });
  var size = Math.hypot.apply(null, data.low.map(function (low, k) { return data.high[k] - low; })) || 1;
  var state;
  function reset(azimuth, lift) {
    state = { azimuth: azimuth, lift: lift, away: 1.7 * size, centre: middle.slice() };
    draw();
  }
  [["reset", data.azimuth, data.lift], ["x", 0, 0], ["y", -90, 0], ["z", -90, 90]].forEach(function (view) {
    var name = view[0] === "reset" ? view[0] : "along " + view[0];
    element("button", controls, name).onclick = function () { reset(view[1], view[2]); };
  });
  function axes() {
    var a = state.azimuth * Math.PI / 180, b = state.lift * Math.PI / 180;
    var ca = Math.cos(a), sa = Math.sin(a), cb = Math.cos(b), sb = Math.sin(b);
    return [[-sa, ca, 0], [-ca * sb, -sa * sb, cb], [ca * cb, sa * cb, sb]];
  }
  function dot(one, other) { return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]; }
  function show(what, mode, plain) {
    what.at.forEach(function (one, k) {
      gl.bindBuffer(gl.ARRAY_BUFFER, one);
      var where = gl.getAttribLocation(program, "pmv"[k]);
      gl.enableVertexAttribArray(where);
      gl.vertexAttribPointer(where, k < 2 ? 3 : 1, gl.FLOAT, false, 0, 0);
    });
    var kind = mode === gl.LINES ? what.lines : what.triangles;
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, kind);
    gl.uniform4fv(at.plain, plain);
    gl.uniform1f(at.pull, mode === gl.LINES ? 1e-3 : 0);  // lines are in front of the surface that they are on
    gl.drawElements(mode, kind.count, gl.UNSIGNED_INT, 0);
  }
  function draw() {
    var wide = canvas.clientWidth || 600, tall = canvas.clientHeight || 400, dots = window.devicePixelRatio || 1;
    canvas.width = wide * dots;
    canvas.height = tall * dots;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    var own = axes(), near = Math.max(state.away - 1.2 * size, 0.05 * size), far = state.away + 3 * size;
    var eye = state.centre.map(function (c, k) { return c + state.away * own[2][k]; });
    var focal = 3.2, ratio = wide / tall, zoom = Math.min(1, ratio) * focal;
    var rows = [
      own[0].concat(-dot(own[0], eye)).map(function (c) { return c * zoom / ratio; }),
      own[1].concat(-dot(own[1], eye)).map(function (c) { return c * zoom; }),
      own[2].concat(-dot(own[2], eye)).map(function (c) { return c * (far + near) / (near - far); }),
      own[2].concat(-dot(own[2], eye)).map(function (c) { return -c; })
    ];
    rows[2][3] += 2 * far * near / (near - far);
    var matrix = [];
    for (var column = 0; column < 4; column++) for (var row = 0; row < 4; row++) matrix.push(rows[row][column]);
    var factor = slider.value / 100 * data.factor;
    gl.uniformMatrix4fv(at.view, false, matrix);
    gl.uniform1f(at.factor, factor);
    gl.uniform2fv(at.limits, data.limits);
    gl.uniform3fv(at.eye, eye);
    show(body, gl.TRIANGLES, [0, 0, 0, 0]);
    if (mesh.checked) show(body, gl.LINES, [0.1, 0.1, 0.1, 1]);
    // A foundation that a magnified gap would bend is drawn where it is, or not at all.
    if (!data.bends || factor < 1.01) {
      gl.enable(gl.CULL_FACE);
      grounds.forEach(function (one) { show(one, gl.TRIANGLES, [0.86, 0.86, 0.86, 2]); });
      gl.disable(gl.CULL_FACE);
      grounds.forEach(function (one) { show(one, gl.LINES, [0.6, 0.6, 0.6, 1]); });
    }
    told.textContent = String(parseFloat(factor.toPrecision(3)));
    function seen(point) {
      var got = rows.map(function (row) { return dot(row, point) + row[3]; });
      return [got[0] / got[3], got[1] / got[3]];
    }
    if (data.largest) {
      var top = seen(data.largest.point.map(function (c, k) { return c + factor * data.largest.motion[k]; }));
      mark.style.left = 0.5 * wide * (1 + top[0]) - 6 + "px";
      mark.style.top = 50 - 50 * top[1] + "%";
    }
    // The length along each axis stands beside the lowest edge of the box, of the upright ones beside that on the left.
    var heart = seen(middle);
    letters.forEach(function (letter, k) {
      var best = null;
      for (var side = 0; side < 4; side++) {
        var point = middle.slice();
        point[(k + 1) % 3] = (side & 1 ? data.high : data.low)[(k + 1) % 3];
        point[(k + 2) % 3] = (side & 2 ? data.high : data.low)[(k + 2) % 3];
        var place = seen(point), along = k === 2 ? 0 : 1;
        if (!best || place[along] < best[along]) best = place;
      }
      var half = 0.5 * letter.offsetWidth + 2, x = 0.5 * wide * (1 + best[0] + 0.2 * (best[0] - heart[0]));
      letter.style.left = Math.max(half, Math.min(x, wide - half)) + "px";  // within the frame
      letter.style.top = 50 - 50 * (best[1] + 0.2 * (best[1] - heart[1])) + "%";
    });
  }
  var held = {};
  canvas.onpointerdown = function (event) {
    held[event.pointerId] = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  };
  canvas.onpointerup = canvas.onpointercancel = function (event) { delete held[event.pointerId]; };
  canvas.oncontextmenu = function (event) { event.preventDefault(); };
  canvas.onpointermove = function (event) {
    var last = held[event.pointerId];
    if (!last) return;
    var x = event.clientX - last[0], y = event.clientY - last[1];
    held[event.pointerId] = [event.clientX, event.clientY];
    if (event.shiftKey || event.buttons === 2) {
      var own = axes(), step = state.away / canvas.clientHeight / 1.2;
      state.centre = state.centre.map(function (c, k) { return c + step * (y * own[1][k] - x * own[0][k]); });
    } else {
      state.azimuth -= 0.4 * x;
      state.lift = Math.max(-90, Math.min(90, state.lift + 0.4 * y));
    }
    draw();
  };
  canvas.addEventListener("wheel", function (event) {
    event.preventDefault();
    state.away = Math.max(0.3 * size, Math.min(8 * size, state.away * Math.exp(0.001 * event.deltaY)));
    draw();
  }, { passive: false });
  slider.oninput = mesh.onchange = draw;
  window.addEventListener("resize", draw);
  reset(data.azimuth, data.lift);
}
document.querySelectorAll(".turn").forEach(turn);
