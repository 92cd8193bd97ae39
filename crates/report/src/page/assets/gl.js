// A small renderer: lit solids, ribbons of constant width, stars. Matrices are column-major arrays of 16, quaternions are
// scalar first as in the messages.
const V = {
  add: (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]],
  sub: (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]],
  scale: (a, s) => [a[0] * s, a[1] * s, a[2] * s],
  dot: (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2],
  cross: (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]],
  norm: (a) => Math.hypot(a[0], a[1], a[2]),
  unit: (a) => { const n = V.norm(a) || 1; return [a[0] / n, a[1] / n, a[2] / n]; },
};

const Q = {
  rotate(q, v) {
    const [w, x, y, z] = q, t = V.scale(V.cross([x, y, z], v), 2);
    return V.add(V.add(v, V.scale(t, w)), V.cross([x, y, z], t));
  },
  times: (a, b) => [
    a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
    a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]],
  turn: (axis, angle) => { const s = Math.sin(angle / 2), u = V.unit(axis); return [Math.cos(angle / 2), u[0] * s, u[1] * s, u[2] * s]; },
  rpy: ([r, p, y]) => Q.times(Q.turn([0, 0, 1], y), Q.times(Q.turn([0, 1, 0], p), Q.turn([1, 0, 0], r))),
  /** The shortest turn that takes z to `to`. */
  fromZ(to) {
    const u = V.unit(to), axis = V.cross([0, 0, 1], u), s = V.norm(axis);
    return s < 1e-9 ? (u[2] > 0 ? [1, 0, 0, 0] : [0, 1, 0, 0]) : Q.turn(axis, Math.atan2(s, u[2]));
  },
};

const M = {
  pose(p, q, s = [1, 1, 1]) {
    const x = Q.rotate(q, [s[0], 0, 0]), y = Q.rotate(q, [0, s[1], 0]), z = Q.rotate(q, [0, 0, s[2]]);
    return [...x, 0, ...y, 0, ...z, 0, ...p, 1];
  },
  times(a, b) {
    const out = new Array(16).fill(0);
    for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
    return out;
  },
  perspective(angle, aspect, near, far) {
    const f = 1 / Math.tan(angle / 2), d = 1 / (near - far);
    return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) * d, -1, 0, 0, 2 * far * near * d, 0];
  },
  look(eye, at, up) {
    const z = V.unit(V.sub(eye, at)), x = V.unit(V.cross(up, z)), y = V.cross(z, x);
    return [x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -V.dot(x, eye), -V.dot(y, eye), -V.dot(z, eye), 1];
  },
};

const Mesh = {
  /** Triangles with flat or given normals: positions and normals, six numbers per corner. */
  box() {
    const out = [];
    for (let axis = 0; axis < 3; axis++) for (const side of [-1, 1]) {
      const corner = (u, v) => { const p = [0, 0, 0]; p[axis] = side / 2; p[(axis + 1) % 3] = u / 2; p[(axis + 2) % 3] = v / 2; return p; };
      const n = [0, 0, 0]; n[axis] = side;
      const quad = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
      const order = side > 0 ? [0, 1, 2, 0, 2, 3] : [0, 2, 1, 0, 3, 2];
      for (const i of order) out.push(...quad[i], ...n);
    }
    return out;
  },
  /** Around z from -1/2 to 1/2, radius r0 below and r1 above. */
  cylinder(r0, r1, parts = 40) {
    const out = [], slope = r0 - r1;
    for (let i = 0; i < parts; i++) {
      const [a, b] = [i, i + 1].map((k) => (2 * Math.PI * k) / parts);
      const ring = (angle, r, z) => [r * Math.cos(angle), r * Math.sin(angle), z];
      const n = (angle) => V.unit([Math.cos(angle), Math.sin(angle), slope]);
      const side = [[ring(a, r0, -0.5), n(a)], [ring(b, r0, -0.5), n(b)], [ring(b, r1, 0.5), n(b)], [ring(a, r1, 0.5), n(a)]];
      for (const k of [0, 1, 2, 0, 2, 3]) out.push(...side[k][0], ...side[k][1]);
      for (const [r, z, s] of [[r0, -0.5, -1], [r1, 0.5, 1]]) {
        if (r === 0) continue;
        const fan = s > 0 ? [[0, 0, z], ring(a, r, z), ring(b, r, z)] : [[0, 0, z], ring(b, r, z), ring(a, r, z)];
        for (const p of fan) out.push(...p, 0, 0, s);
      }
    }
    return out;
  },
  sphere(rows = 20, columns = 36) {
    const out = [], at = (i, j) => {
      const a = (Math.PI * i) / rows, b = (2 * Math.PI * j) / columns;
      return [Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)];
    };
    for (let i = 0; i < rows; i++) for (let j = 0; j < columns; j++) {
      const quad = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
      for (const k of [0, 1, 2, 0, 2, 3]) out.push(...quad[k], ...quad[k]);
    }
    return out;
  },
};

const SOLID = [`
attribute vec3 position; attribute vec3 normal;
uniform mat4 model, view, lamp; varying vec3 n, world, local, face, shade;
void main() {
  vec4 w = model * vec4(position, 1.0); world = w.xyz;
  // Normals go with the inverse transpose; for a rotation times a scale that is the columns over their squared lengths.
  vec3 s = vec3(dot(model[0].xyz, model[0].xyz), dot(model[1].xyz, model[1].xyz), dot(model[2].xyz, model[2].xyz));
  n = model[0].xyz * normal.x / s.x + model[1].xyz * normal.y / s.y + model[2].xyz * normal.z / s.z;
  local = position * sqrt(s); face = normal;
  shade = (lamp * w).xyz * 0.5 + 0.5;
  gl_Position = view * w;
}`, `
precision highp float;
uniform vec4 colour; uniform vec3 eye, sun, up, lamplight; uniform float metal, rough, pattern, light; uniform sampler2D depths;
varying vec3 n, world, local, face, shade;
float hash(vec3 p) { p = fract(p * 0.3183099 + 0.1); p *= 17.0; return fract(p.x * p.y * p.z * (p.x + p.y + p.z)); }
float noise(vec3 x) {
  vec3 i = floor(x), f = fract(x); f = f * f * (3.0 - 2.0 * f);
  vec2 k = vec2(0.0, 1.0);
  return mix(mix(mix(hash(i), hash(i + k.yxx), f.x), mix(hash(i + k.xyx), hash(i + k.yyx), f.x), f.y),
             mix(mix(hash(i + k.xxy), hash(i + k.yxy), f.x), mix(hash(i + k.xyy), hash(i + k.yyy), f.x), f.y), f.z);
}
float stored(vec2 at) { return dot(texture2D(depths, at), vec4(1.0, 1.0 / 255.0, 1.0 / 65025.0, 1.0 / 16581375.0)); }
float daylight(float slope) {
  if (any(lessThan(shade, vec3(0.0))) || any(greaterThan(shade, vec3(1.0)))) return 1.0;
  float seen = 0.0, bias = 0.0012 + 0.004 * (1.0 - slope);
  for (int i = -1; i <= 1; i++) for (int j = -1; j <= 1; j++) seen += step(shade.z - bias, stored(shade.xy + vec2(float(i), float(j)) * (1.2 / 2048.0)));
  return seen / 9.0;
}
vec3 sky(vec3 d, float blur) {
  vec3 low = mix(vec3(0.035, 0.045, 0.07), vec3(0.42, 0.46, 0.52), light), high = mix(vec3(0.10, 0.13, 0.19), vec3(1.0, 1.02, 1.05), light);
  float box = smoothstep(0.55 + 0.3 * (1.0 - blur), 1.0, dot(d, lamplight));
  return mix(low, high, smoothstep(-0.6, 0.8, dot(d, up))) + box * mix(0.55, 0.35, blur);
}
void main() {
  vec3 m = normalize(n), v = normalize(eye - world), base = pow(colour.rgb, vec3(2.2));
  if (dot(m, v) < 0.0) m = -m;
  float r = rough, shine = metal;
  if (pattern > 0.5 && pattern < 1.5) {
    // Foil: creases that bend the normal.
    vec3 q = local * 9.0, e = vec3(0.05, 0.0, 0.0);
    vec3 bend = vec3(noise(q + e.xyy) - noise(q - e.xyy), noise(q + e.yxy) - noise(q - e.yxy), noise(q + e.yyx) - noise(q - e.yyx));
    q *= 2.7;
    bend += 0.5 * vec3(noise(q + e.xyy) - noise(q - e.xyy), noise(q + e.yxy) - noise(q - e.yxy), noise(q + e.yyx) - noise(q - e.yyx));
    m = normalize(m + 1.5 * bend);
  } else if (pattern > 1.5) {
    vec3 along = abs(face);
    vec2 at = along.x > 0.7 ? local.yz : along.y > 0.7 ? local.xz : local.xy;
    float width = pattern < 2.5 ? 0.09 : 0.05;
    // Lines no thinner than a pixel, and fainter where they would be: nothing flickers far away.
    float fine = clamp(length(eye - world) * 0.0011 / width, 0.004, 0.25), share = 0.016 / max(fine, 0.016);
    vec2 cell = abs(fract(at / width) - 0.5);
    float gap = smoothstep(0.484 - fine, 0.484 + fine * 0.3, max(cell.x, cell.y)) * share;
    if (pattern < 2.5) {
      base *= 0.8 + 0.4 * hash(vec3(floor(at / width), 3.0));
      base = mix(base, vec3(0.30, 0.33, 0.38), gap * 0.8);
    } else base *= 1.0 - 0.3 * gap;
  }
  float slope = max(dot(m, sun), 0.0), facing = max(dot(m, v), 0.001);
  vec3 h = normalize(sun + v), f0 = mix(vec3(0.04), base, shine);
  float day = slope * daylight(max(dot(normalize(n), sun), 0.0));
  float power = exp2(mix(9.0, 2.5, r)), glint = pow(max(dot(m, h), 0.0), power) * (power + 2.0) / 9.0;
  vec3 fresnel = f0 + (1.0 - f0) * pow(1.0 - facing, 5.0) * (1.0 - 0.7 * r);
  vec3 sunlight = vec3(3.0, 2.88, 2.7) * mix(1.0, 0.72, light);
  vec3 c = base * (1.0 - shine) * (sunlight * day * 0.62 + sky(m, 1.0) * 0.9)
         + f0 * glint * sunlight * day * 0.6 + fresnel * sky(reflect(-v, m), r) * mix(0.55, 1.0, shine);
  c += base * shine * day * sunlight * 0.16;
  c = c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14);
  float rim = pow(1.0 - facing, 3.0), a = colour.a < 1.0 ? clamp(colour.a + rim * 0.35, 0.0, 1.0) : 1.0;
  gl_FragColor = vec4(pow(clamp(c, 0.0, 1.0), vec3(1.0 / 2.2)) * a, a);
}`];

const SHADOW = [`
attribute vec3 position; uniform mat4 model, lamp; varying float z;
void main() { gl_Position = lamp * model * vec4(position, 1.0); z = gl_Position.z * 0.5 + 0.5; }`, `
precision highp float; varying float z;
void main() {
  vec4 p = fract(z * vec4(1.0, 255.0, 65025.0, 16581375.0));
  gl_FragColor = p - p.yzww * vec4(1.0 / 255.0, 1.0 / 255.0, 1.0 / 255.0, 0.0);
}`];

const RIBBON = [`
attribute vec3 a, b; attribute vec2 corner; attribute float along;
uniform mat4 view; uniform vec2 size; uniform float width, near; varying float s;
void main() {
  vec4 p = view * vec4(a, 1.0), q = view * vec4(b, 1.0);
  // Ends behind the eye are brought in front of it, or their projection would be nonsense.
  if (p.w < near && q.w > near) p = mix(p, q, (near - p.w) / (q.w - p.w));
  if (q.w < near && p.w > near) q = mix(q, p, (near - q.w) / (p.w - q.w));
  vec2 d = (q.xy / q.w - p.xy / p.w) * size; d = length(d) > 1e-6 ? normalize(d) : vec2(1.0, 0.0);
  vec4 o = corner.x < 0.5 ? p : q;
  gl_Position = o + vec4((vec2(-d.y, d.x) * corner.y + d * (corner.x - 0.5)) * width / size * o.w, 0.0, 0.0);
  s = along;
}`, `
precision highp float;
uniform vec4 colour, rest; uniform float now, dash; varying float s;
void main() {
  vec4 c = s > now ? rest : colour;
  if (dash > 0.0 && fract(s / dash) > 0.55) discard;
  gl_FragColor = vec4(c.rgb * c.a, c.a);
}`];

const STARS = [`
attribute vec3 position; attribute float size; uniform mat4 view; uniform vec3 eye; uniform float scale; uniform float reach; varying float bright;
void main() { gl_Position = view * vec4(eye + position * reach, 1.0); gl_PointSize = size * scale; bright = size; }`, `
precision highp float; varying float bright;
void main() { float r = length(gl_PointCoord - 0.5); float a = smoothstep(0.5, 0.1, r) * min(1.0, bright / 2.2); gl_FragColor = vec4(vec3(0.86, 0.9, 1.0) * a, a); }`];

class Renderer {
  constructor(canvas) {
    this.canvas = canvas;
    const gl = canvas.getContext("webgl", { antialias: true, alpha: true, premultipliedAlpha: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser offers no WebGL");
    this.gl = gl; this.meshes = new Map();
    this.solid = this.program(SOLID); this.ribbon = this.program(RIBBON); this.star = this.program(STARS); this.shadow = this.program(SHADOW);
    this.stand({ up: [0, 0, 1], back: [0, -1, 0], right: [1, 0, 0] });
    this.makeShadowMap();
    // Edges lie in their faces: the faces are drawn a little further away.
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.enable(gl.BLEND); gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    // A fixed sky: the same generator with the same seed on every page.
    let seed = 7; const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
    const sky = [];
    for (let i = 0; i < 900; i++) { const z = 2 * random() - 1, a = 2 * Math.PI * random(), r = Math.sqrt(1 - z * z); sky.push(r * Math.cos(a), r * Math.sin(a), z, 0.7 + 1.6 * random() ** 6 + 0.5 * random()); }
    this.sky = this.buffer(sky);
  }

  /** Where sun and sky are: above. */
  stand({ up, back, right }) {
    const of = (u, b, r) => V.unit(V.add(V.scale(up, u), V.add(V.scale(back, b), V.scale(right, r))));
    this.up = up; this.sun = of(0.62, 0.66, -0.42); this.lamplight = of(0.55, 0.75, 0.35);
  }

  makeShadowMap() {
    const { gl } = this, size = 2048;
    this.depths = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.depths);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, size, size, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
    for (const [key, value] of [[gl.TEXTURE_MIN_FILTER, gl.NEAREST], [gl.TEXTURE_MAG_FILTER, gl.NEAREST], [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) gl.texParameteri(gl.TEXTURE_2D, key, value);
    const depth = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, depth); gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT16, size, size);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.night = gl.createFramebuffer());
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.depths, 0);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  /** What the sun sees of a ball around `centre`, and of what stands in its light up to `depth` away: `draw` draws that. */
  shadows(centre, radius, depth, draw) {
    const { gl } = this, eye = V.add(centre, V.scale(this.sun, depth)), k = 1 / radius, f = 1 / depth;
    this.lamp = M.times([k, 0, 0, 0, 0, k, 0, 0, 0, 0, -f, 0, 0, 0, -1, 1], M.look(eye, centre, Math.abs(this.sun[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]));
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.night); gl.viewport(0, 0, 2048, 2048);
    gl.disable(gl.BLEND); gl.enable(gl.DEPTH_TEST); gl.clearColor(1, 1, 1, 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.casting = true; draw(); this.casting = false;
    gl.enable(gl.BLEND); gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  program([vertex, fragment]) {
    const { gl } = this, program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text); gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    const uniforms = {}, attributes = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) { const { name } = gl.getActiveUniform(program, i); uniforms[name] = gl.getUniformLocation(program, name); }
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_ATTRIBUTES); i++) { const { name } = gl.getActiveAttrib(program, i); attributes[name] = gl.getAttribLocation(program, name); }
    return { program, uniforms, attributes };
  }

  buffer(numbers) {
    const { gl } = this, buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer); gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
    return { buffer, numbers: numbers.length };
  }

  mesh(key, make) {
    if (!this.meshes.has(key)) this.meshes.set(key, this.buffer(make()));
    return this.meshes.get(key);
  }

  use(program, buffer, layout, stride) {
    const { gl } = this;
    gl.useProgram(program.program);
    for (let i = 0; i < 4; i++) gl.disableVertexAttribArray(i);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer.buffer);
    for (const [name, size, offset] of layout) {
      const at = program.attributes[name];
      if (at === undefined) continue;
      gl.enableVertexAttribArray(at); gl.vertexAttribPointer(at, size, gl.FLOAT, false, 4 * stride, 4 * offset);
    }
  }

  /** A polyline as ribbons; the numbers along it are what `now` and `dash` of the drawing refer to. */
  line(points, along) { return this.buffer(this.segments(points, along)); }

  forget(line) { this.gl.deleteBuffer(line.buffer); }

  segments(points, along) {
    const out = [];
    for (let i = 0; i + 1 < points.length; i++) {
      const [a, b, s, t] = [points[i], points[i + 1], along[i], along[i + 1]];
      for (const [end, side] of [[0, -1], [1, -1], [1, 1], [0, -1], [1, 1], [0, 1]]) out.push(...a, ...b, end, side, end ? t : s);
    }
    return out;
  }

  /** `unit` is how many metres are one unit of depth: what is seen lies within some of them. */
  begin(camera, dark, unit) {
    const { gl, canvas } = this, scale = Math.min(2, window.devicePixelRatio || 1);
    const w = Math.max(1, Math.round(canvas.clientWidth * scale)), h = Math.max(1, Math.round(canvas.clientHeight * scale));
    if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
    gl.viewport(0, 0, w, h); gl.clearColor(0, 0, 0, 0); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.scale = scale; this.eye = camera.eye; this.dark = dark; this.unit = unit;
    this.view = M.times(M.perspective(camera.angle, w / h, 0.03 * unit, 3000 * unit), M.look(camera.eye, camera.at, camera.up));
    if (dark) {
      gl.disable(gl.DEPTH_TEST);
      this.use(this.star, this.sky, [["position", 3, 0], ["size", 1, 3]], 4);
      gl.uniformMatrix4fv(this.star.uniforms.view, false, this.view); gl.uniform3fv(this.star.uniforms.eye, this.eye); gl.uniform1f(this.star.uniforms.scale, scale * 1.5); gl.uniform1f(this.star.uniforms.reach, 60 * unit);
      gl.drawArrays(gl.POINTS, 0, this.sky.numbers / 4);
    }
    gl.enable(gl.DEPTH_TEST);
  }

  draw(mesh, model, colour, { metal = 0, rough = 0.5, pattern = 0 } = {}) {
    const { gl } = this;
    if (this.casting) {
      if (colour[3] < 1) return;
      this.use(this.shadow, mesh, [["position", 3, 0]], 6);
      gl.uniformMatrix4fv(this.shadow.uniforms.model, false, model); gl.uniformMatrix4fv(this.shadow.uniforms.lamp, false, this.lamp);
      gl.drawArrays(gl.TRIANGLES, 0, mesh.numbers / 6);
      return;
    }
    const u = this.solid.uniforms;
    this.use(this.solid, mesh, [["position", 3, 0], ["normal", 3, 3]], 6);
    gl.bindTexture(gl.TEXTURE_2D, this.depths);
    gl.uniformMatrix4fv(u.model, false, model); gl.uniformMatrix4fv(u.view, false, this.view); gl.uniformMatrix4fv(u.lamp, false, this.lamp);
    gl.uniform4fv(u.colour, colour); gl.uniform3fv(u.eye, this.eye); gl.uniform3fv(u.sun, this.sun); gl.uniform3fv(u.up, this.up); gl.uniform3fv(u.lamplight, this.lamplight);
    gl.uniform1f(u.metal, metal); gl.uniform1f(u.rough, rough); gl.uniform1f(u.pattern, pattern); gl.uniform1f(u.light, this.dark ? 0 : 1);
    gl.depthMask(colour[3] >= 1);
    gl.polygonOffset(1, 2);
    gl.drawArrays(gl.TRIANGLES, 0, mesh.numbers / 6);
    gl.polygonOffset(0, 0);
    gl.depthMask(true);
  }

  /** The twelve edges of a unit box under `model`. */
  drawEdges(model, colour) {
    const at = (p) => [0, 1, 2].map((r) => model[r] * p[0] + model[4 + r] * p[1] + model[8 + r] * p[2] + model[12 + r]);
    const points = [];
    for (let axis = 0; axis < 3; axis++) for (const u of [-0.5, 0.5]) for (const v of [-0.5, 0.5]) {
      const end = (w) => { const p = [0, 0, 0]; p[axis] = w; p[(axis + 1) % 3] = u; p[(axis + 2) % 3] = v; return at(p); };
      points.push([end(-0.5), end(0.5)]);
    }
    const { gl } = this, numbers = points.flatMap((pair) => this.segments(pair, [0, 0]));
    if (!this.edges) this.edges = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.edges); gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.DYNAMIC_DRAW);
    this.drawLine({ buffer: this.edges, numbers: numbers.length }, 1.1, [...colour, 0.45]);
  }

  drawLine(line, width, colour, { rest = colour, now = 1e30, dash = 0 } = {}) {
    const { gl } = this, u = this.ribbon.uniforms;
    this.use(this.ribbon, line, [["a", 3, 0], ["b", 3, 3], ["corner", 2, 6], ["along", 1, 8]], 9);
    gl.uniformMatrix4fv(u.view, false, this.view); gl.uniform2f(u.size, this.canvas.width, this.canvas.height);
    gl.uniform1f(u.width, width * this.scale); gl.uniform4fv(u.colour, colour); gl.uniform4fv(u.rest, rest);
    gl.uniform1f(u.now, now); gl.uniform1f(u.dash, dash); gl.uniform1f(u.near, 0.02 * this.unit);
    gl.drawArrays(gl.TRIANGLES, 0, line.numbers / 9);
  }

  /** Where a point of the world is on the canvas, CSS pixels; null behind the eye. */
  project(p) {
    const m = this.view, c = [0, 1, 3].map((r) => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r]);
    return c[2] < 0.02 * this.unit ? null : [(c[0] / c[2] + 1) / 2 * this.canvas.clientWidth, (1 - c[1] / c[2]) / 2 * this.canvas.clientHeight];
  }
}
