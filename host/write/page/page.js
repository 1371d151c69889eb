/* The page of `ovoid export -o view.html`: reads the scene from the elements above, draws it with
 * WebGL 2, and answers pointer and keys. Lengths are in angstrom. */
'use strict';
(async () => {
const byId = (id) => document.getElementById(id);
const scene = JSON.parse(byId('scene').textContent);
const canvas = byId('canvas');
const started = performance.now();

/* ---- data --------------------------------------------------------------------------------- */

async function unpack(id) {
    const text = atob(byId(id).textContent);
    const packed = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++)
        packed[i] = text.charCodeAt(i);
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'));
    return new Uint8Array(await new Response(stream).arrayBuffer());
}

/* Whole numbers as the differences from one to the next, in groups of seven bits, the sign last. */
function decode(bytes, at, count, put) {
    let value = 0;
    for (let i = 0; i < count; i++) {
        let part = 0, shift = 1, byte;
        do {
            byte = bytes[at++];
            part += (byte & 127) * shift;
            shift *= 128;
        } while (byte > 127);
        value += part % 2 ? -(part + 1) / 2 : part / 2;
        put(i, value);
    }
    return at;
}

async function readSurface(s) {
    const bytes = await unpack(s.id), n = s.vertices;
    const at = new Uint16Array(4 * n), normals = new Int16Array(2 * n);
    const corners = new Uint32Array(3 * s.triangles);
    let next = 0;
    for (let k = 0; k < 3; k++)
        next = decode(bytes, next, n, (i, v) => { at[4 * i + k] = v; });
    for (let k = 0; k < 2; k++)
        next = decode(bytes, next, n, (i, v) => { normals[2 * i + k] = v; });
    decode(bytes, next, corners.length, (i, v) => { corners[i] = v; });
    return { at, normals, corners };
}

async function readScalars(d) {
    const bytes = await unpack(d.id), values = new Int8Array(bytes.length);
    for (let i = 0, v = 0; i < bytes.length; i++) {
        v = (v + bytes[i]) & 255;
        values[i] = v - 127;
    }
    return values;
}

/* ---- drawing -------------------------------------------------------------------------------- */

const gl = canvas.getContext('webgl2', { antialias: true, alpha: false });
if (!gl || typeof DecompressionStream === 'undefined') {
    byId('message').textContent = 'This browser cannot draw the molecule: the page needs WebGL 2 ' +
        'and DecompressionStream.';
    return;
}

/* Light from over the left shoulder, and from the sky; what is further away fades a little. */
const shading = `
    uniform vec3 paper;
    uniform vec2 fade;
    vec3 shade(vec3 base, vec3 n, float depth) {
        if (n.z < 0.0) n = -n;
        float key = max(dot(n, normalize(vec3(-0.45, 0.65, 0.75))), 0.0);
        float fill = 0.5 + 0.5 * dot(n, normalize(vec3(0.3, 0.8, 0.3)));
        float edge = pow(1.0 - n.z, 3.0);
        vec3 h = normalize(vec3(-0.45, 0.65, 0.75) + vec3(0.0, 0.0, 1.0));
        vec3 lit = base * (0.30 + 0.28 * fill + 0.55 * key) * (1.0 - 0.35 * edge)
                 + 0.16 * pow(max(dot(n, h), 0.0), 40.0);
        float far = clamp((depth - fade.x) / fade.y, 0.0, 1.0);
        return pow(mix(lit, paper, 0.45 * far), vec3(1.0 / 2.2));
    }`;
const head = '#version 300 es\nprecision highp float;\nprecision highp int;\n';

function program(vertex, fragment) {
    const p = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
        const s = gl.createShader(type);
        gl.shaderSource(s, head + text);
        gl.compileShader(s);
        if (!gl.getShaderParameter(s, gl.COMPILE_STATUS))
            throw new Error(gl.getShaderInfoLog(s));
        gl.attachShader(p, s);
    }
    gl.linkProgram(p);
    if (!gl.getProgramParameter(p, gl.LINK_STATUS))
        throw new Error(gl.getProgramInfoLog(p));
    const uniforms = {};
    for (let i = gl.getProgramParameter(p, gl.ACTIVE_UNIFORMS); i-- > 0;) {
        const name = gl.getActiveUniform(p, i).name;
        uniforms[name] = gl.getUniformLocation(p, name);
    }
    return { p, uniforms };
}

const surfaceProgram = program(`
    layout(location = 0) in vec3 at;
    layout(location = 1) in vec2 folded;
    layout(location = 2) in float scalar;
    uniform mat4 view, projection;
    uniform vec4 box;
    out vec3 normal; out float value; out float depth;
    void main() {
        vec2 f = folded / 1023.0;
        vec3 n = vec3(f, 1.0 - abs(f.x) - abs(f.y));
        if (n.z < 0.0)
            n.xy = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
        normal = mat3(view) * normalize(n);
        value = scalar / 127.0;
        vec4 eye = view * vec4(at * box.w + box.xyz, 1.0);
        depth = -eye.z;
        gl_Position = projection * eye;
    }`, `
    in vec3 normal; in float value; in float depth;
    uniform vec3 colour;
    uniform float opacity;
    uniform bool coloured;
    uniform sampler2D palette;
    out vec4 pixel;
    ${shading}
    void main() {
        vec3 n = normalize(normal);
        vec3 base = coloured ? texture(palette, vec2(0.5 + 0.498 * value, 0.5)).rgb : colour;
        float a = opacity < 1.0 ? mix(opacity, 0.85, pow(1.0 - abs(n.z), 2.5)) : 1.0;
        pixel = vec4(shade(base, n, depth), a);
    }`);

const ellipsoidProgram = program(`
    layout(location = 0) in vec3 unit;
    layout(location = 3) in vec3 centre;
    layout(location = 4) in vec3 semi;
    layout(location = 5) in vec3 first;
    layout(location = 6) in vec3 second;
    uniform mat4 view, projection;
    uniform vec3 origin;
    uniform int chosen;
    out vec3 normal; out float depth; flat out float number; flat out float lit;
    void main() {
        mat3 axes = mat3(first, second, cross(first, second));
        normal = mat3(view) * (axes * (unit / semi));
        vec4 eye = view * vec4(origin + centre + axes * (unit * semi), 1.0);
        depth = -eye.z;
        number = float(gl_InstanceID);
        lit = gl_InstanceID == chosen ? 1.0 : 0.0;
        gl_Position = projection * eye;
    }`, `
    in vec3 normal; in float depth; flat in float number; flat in float lit;
    uniform vec3 dim;
    out vec4 pixel;
    ${shading}
    void main() {
        float turn = 2.399963 * number;
        float l = 0.76 + 0.05 * (mod(number, 3.0) - 1.0), a = 0.075 * cos(turn), b = 0.075 * sin(turn);
        vec3 c = vec3(l + 0.3963377774 * a + 0.2158037573 * b, l - 0.1055613458 * a - 0.0638541728 * b,
                      l - 0.0894841775 * a - 1.291485548 * b);
        c = c * c * c;
        vec3 base = vec3(4.0767416621 * c.x - 3.3077115913 * c.y + 0.2309699292 * c.z,
                         -1.2684380046 * c.x + 2.6097574011 * c.y - 0.3413193965 * c.z,
                         -0.0041960863 * c.x - 0.7034186147 * c.y + 1.707614701 * c.z);
        vec3 n = normalize(normal);
        base = mix(base * dim, vec3(1.0, 0.72, 0.12), lit);
        pixel = vec4(shade(clamp(base, 0.0, 1.0), n, depth) + 0.25 * lit * pow(1.0 - abs(n.z), 2.0), 1.0);
    }`);

function buffer(target, data) {
    const b = gl.createBuffer();
    gl.bindBuffer(target, b);
    gl.bufferData(target, data, gl.STATIC_DRAW);
    return b;
}

function attribute(location, size, type, stride, offset, divisor) {
    gl.enableVertexAttribArray(location);
    gl.vertexAttribPointer(location, size, type, false, stride, offset);
    if (divisor)
        gl.vertexAttribDivisor(location, divisor);
}

/* Of the difference: blue, where the model's surface lies inside, over white to red. Stops in sRGB,
 * between them straight lines in Oklab (B. Ottosson, 2020): equal differences look equal. */
function makePalette() {
    const stops = [0x1f3f8f, 0x3f7fc4, 0x9cc8e6, 0xf2f0ec, 0xf0b59a, 0xd4604a, 0x8f1a2e];
    const linear = (v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
    const lab = stops.map((hex) => {
        const [r, g, b] = [16, 8, 0].map((s) => linear((hex >> s & 255) / 255));
        const l = Math.cbrt(0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b);
        const m = Math.cbrt(0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b);
        const s = Math.cbrt(0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b);
        return [0.2104542553 * l + 0.793617785 * m - 0.0040720468 * s,
            1.9779984951 * l - 2.428592205 * m + 0.4505937099 * s,
            0.0259040371 * l + 0.7827717662 * m - 0.808675766 * s];
    });
    const encode = (v) => v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055;
    const texels = new Uint8Array(1024);
    for (let i = 0; i < 256; i++) {
        const at = i * 6 / 255, k = Math.min(5, Math.floor(at));
        const [l, a, b] = lab[k].map((v, j) => v + (at - k) * (lab[k + 1][j] - v));
        const c = [l + 0.3963377774 * a + 0.2158037573 * b, l - 0.1055613458 * a - 0.0638541728 * b,
            l - 0.0894841775 * a - 1.291485548 * b].map((v) => v ** 3);
        const rgb = [4.0767416621 * c[0] - 3.3077115913 * c[1] + 0.2309699292 * c[2],
            -1.2684380046 * c[0] + 2.6097574011 * c[1] - 0.3413193965 * c[2],
            -0.0041960863 * c[0] - 0.7034186147 * c[1] + 1.707614701 * c[2]];
        for (let j = 0; j < 3; j++)
            texels[4 * i + j] = Math.round(255 * encode(Math.min(1, Math.max(0, rgb[j]))));
        texels[4 * i + 3] = 255;
    }
    return texels;
}
const palette = makePalette();
gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
gl.texImage2D(gl.TEXTURE_2D, 0, gl.SRGB8_ALPHA8, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, palette);
for (const [name, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
    [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]])
    gl.texParameteri(gl.TEXTURE_2D, name, value);

/* Each block becomes buffers when it is first shown. */
const made = new Map();
function once(key, make) {
    if (!made.has(key))
        made.set(key, make());
    return made.get(key);
}

function surfaceOf(level, detail) {
    const s = scene.surfaces.find((x) => x.level === level && x.detail === detail);
    return once(s.id, async () => {
        const data = await readSurface(s);
        const array = gl.createVertexArray();
        gl.bindVertexArray(array);
        buffer(gl.ARRAY_BUFFER, data.at);
        attribute(0, 3, gl.UNSIGNED_SHORT, 8, 0);
        buffer(gl.ARRAY_BUFFER, data.normals);
        attribute(1, 2, gl.SHORT, 4, 0);
        buffer(gl.ELEMENT_ARRAY_BUFFER, data.corners);
        gl.bindVertexArray(null);
        return { array, count: data.corners.length, box: [...s.low, s.step], at: data.at, corners: data.corners };
    });
}

function differenceOf(surface, of, level, detail) {
    const d = scene.differences.find((x) => x.of === of && x.level === level && x.detail === detail);
    return d && once(d.id, async () => {
        const values = await readScalars(d);
        return { buffer: buffer(gl.ARRAY_BUFFER, values), largest: d.largest, values };
    });
}

/* A sphere from an icosahedron whose triangles are divided into four so many times. */
function sphere(times) {
    const g = (1 + Math.sqrt(5)) / 2, points = [], known = new Map();
    const add = (p) => {
        const length = Math.hypot(...p);
        return points.push(p.map((v) => v / length)) - 1;
    };
    for (const [a, b] of [[1, g], [-1, g], [1, -g], [-1, -g]]) {
        add([0, a, b]); add([a, b, 0]); add([b, 0, a]);
    }
    let faces = [];
    for (let a = 0; a < 12; a++)
        for (let b = a + 1; b < 12; b++)
            for (let c = b + 1; c < 12; c++) {
                const near = (i, j) => Math.hypot(...points[i].map((v, k) => v - points[j][k])) < 1.1;
                if (near(a, b) && near(b, c) && near(a, c))
                    faces.push([a, b, c]);
            }
    const middle = (a, b) => {
        const key = Math.min(a, b) * 65536 + Math.max(a, b);
        if (!known.has(key))
            known.set(key, add(points[a].map((v, k) => v + points[b][k])));
        return known.get(key);
    };
    for (let t = 0; t < times; t++) {
        const finer = [];
        for (const [a, b, c] of faces) {
            const [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            finer.push([a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]);
        }
        faces = finer;
    }
    return { points: new Float32Array(points.flat()), corners: new Uint16Array(faces.flat()) };
}

const RECORD = 14;
function ellipsoidsOf(level) {
    const l = scene.levels[level];
    return once(l.id, async () => {
        const bytes = await unpack(l.id);
        const values = new Float32Array(bytes.buffer, 0, RECORD * l.ellipsoids);
        const names = l.names ? JSON.parse(new TextDecoder().decode(await unpack(l.names))) : null;
        const ball = sphere(l.ellipsoids <= 1000 ? 3 : 2), array = gl.createVertexArray();
        gl.bindVertexArray(array);
        buffer(gl.ARRAY_BUFFER, ball.points);
        attribute(0, 3, gl.FLOAT, 12, 0);
        buffer(gl.ARRAY_BUFFER, values);
        for (let k = 0; k < 4; k++)
            attribute(3 + k, 3, gl.FLOAT, 4 * RECORD, 12 * k, 1);
        buffer(gl.ELEMENT_ARRAY_BUFFER, ball.corners);
        gl.bindVertexArray(null);
        return { array, values, names, count: l.ellipsoids, corners: ball.corners.length };
    });
}

/* ---- camera ---------------------------------------------------------------------------------- */

const FIELD = 24 * Math.PI / 180; /* of view, from the bottom to the top */
const start = {};
const camera = { turn: [0, 0, 0, 1], zoom: 1, shift: [0, 0] };

const times = (a, b) => [
    a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
    a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
    a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
    a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]];

/* The rotation about one of the screen's axes comes last. */
function turn(x, y, z) {
    const angle = Math.hypot(x, y, z);
    if (angle === 0)
        return;
    const s = Math.sin(angle / 2) / angle;
    const q = times([x * s, y * s, z * s, Math.cos(angle / 2)], camera.turn);
    const length = Math.hypot(...q);
    camera.turn = q.map((v) => v / length);
    draw();
}

/* Columns of the rotation. */
function rotation([x, y, z, w]) {
    return [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w),
        2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w),
        2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)];
}

const aspect = () => canvas.clientWidth / Math.max(1, canvas.clientHeight);

/* So far that the sphere about all of it fits, at a zoom of 1. */
function distance() {
    return scene.radius / Math.sin(FIELD / 2) / Math.min(1, aspect()) / camera.zoom;
}

/* Zooms and shifts so that a surface, as it is turned, fills the space between title and controls. */
function fit(surface) {
    const r = rotation(camera.turn), low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    const c = scene.centre, b = surface.box, every = Math.ceil(surface.at.length / 4 / 20000);
    for (let i = 0; i < surface.at.length; i += 4 * every) {
        const v = [0, 1, 2].map((k) => b[k] + b[3] * surface.at[i + k] - c[k]);
        for (let k = 0; k < 2; k++) {
            const x = r[k] * v[0] + r[3 + k] * v[1] + r[6 + k] * v[2];
            low[k] = Math.min(low[k], x);
            high[k] = Math.max(high[k], x);
        }
    }
    const top = 62, bottom = byId('bottom').offsetHeight + 8, height = canvas.clientHeight;
    const room = [canvas.clientWidth - 40, Math.max(80, height - top - bottom)];
    const pixels = Math.min(room[0] / Math.max(high[0] - low[0], 1), room[1] / Math.max(high[1] - low[1], 1));
    camera.zoom = 1;
    camera.zoom = 0.9 * pixels * 2 * distance() * Math.tan(FIELD / 2) / height;
    camera.shift = [-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2 + (bottom - top) / 2 / pixels / 0.9];
}

function matrices() {
    const r = rotation(camera.turn), c = scene.centre, d = distance(), a = aspect();
    const far = d + 1.2 * scene.radius, near = Math.max(d - 1.2 * scene.radius, 0.02 * scene.radius, 0.01);
    const f = 1 / Math.tan(FIELD / 2);
    const moved = [0, 1, 2].map((i) => -(r[i] * c[0] + r[3 + i] * c[1] + r[6 + i] * c[2]));
    return {
        view: [r[0], r[1], r[2], 0, r[3], r[4], r[5], 0, r[6], r[7], r[8], 0,
            moved[0] + camera.shift[0], moved[1] + camera.shift[1], moved[2] - d, 1],
        projection: [f / a, 0, 0, 0, 0, f, 0, 0, 0, 0, (near + far) / (near - far), -1,
            0, 0, 2 * near * far / (near - far), 0],
        near,
        fade: [d - 0.2 * scene.radius, 1.2 * scene.radius]
    };
}

/* The principal axes of the ellipsoids, or the box's, put the longest across. */
async function firstTurn() {
    if (!scene.levels.length)
        return;
    const e = await ellipsoidsOf(0), m = [0, 0, 0], s = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
    for (let i = 0; i < e.count; i++)
        for (let k = 0; k < 3; k++)
            m[k] += e.values[RECORD * i + k] / e.count;
    for (let i = 0; i < e.count; i++)
        for (let j = 0; j < 3; j++)
            for (let k = 0; k < 3; k++)
                s[j][k] += (e.values[RECORD * i + j] - m[j]) * (e.values[RECORD * i + k] - m[k]);
    const power = (without) => {
        let v = [0.6, 0.53, 0.6];
        for (let n = 0; n < 200; n++) {
            let w = s.map((row) => row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
            for (const u of without) {
                const dot = u[0] * w[0] + u[1] * w[1] + u[2] * w[2];
                w = w.map((x, k) => x - dot * u[k]);
            }
            const length = Math.hypot(...w);
            if (!(length > 1e-9))
                return null;
            v = w.map((x) => x / length);
        }
        return v;
    };
    const x = power([]), y = x && power([x]);
    if (!y)
        return;
    const across = aspect() >= 1 ? [x, y] : [y.map((v) => -v), x];
    const [a, b] = across, z = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    camera.turn = quaternion([a, b, z]);
}

/* Of the rotation with these rows. */
function quaternion(m) {
    const t = m[0][0] + m[1][1] + m[2][2];
    if (t > 0) {
        const w = Math.sqrt(1 + t) / 2;
        return [(m[2][1] - m[1][2]) / (4 * w), (m[0][2] - m[2][0]) / (4 * w),
            (m[1][0] - m[0][1]) / (4 * w), w];
    }
    const i = m[1][1] > m[0][0] ? (m[2][2] > m[1][1] ? 2 : 1) : (m[2][2] > m[0][0] ? 2 : 0);
    const j = (i + 1) % 3, k = (i + 2) % 3, q = [0, 0, 0, 0];
    q[i] = Math.sqrt(Math.max(0, 1 + m[i][i] - m[j][j] - m[k][k])) / 2;
    q[j] = (m[j][i] + m[i][j]) / (4 * q[i]);
    q[k] = (m[k][i] + m[i][k]) / (4 * q[i]);
    q[3] = (m[k][j] - m[j][k]) / (4 * q[i]);
    return q;
}

/* ---- what is shown ---------------------------------------------------------------------------- */

const both = scene.atoms !== null && scene.levels.length > 0;
const VIEWS = [
    { name: 'molecule', needs: scene.atoms !== null },
    { name: 'model', needs: scene.levels.length > 0 },
    { name: 'both', needs: both },
    { name: 'difference', needs: both },
    { name: 'ellipsoids', needs: scene.levels.length > 0 }
];
const COLOURS = { molecule: [0.86, 0.42, 0.12], model: [0.10, 0.32, 0.66] }; /* linear light */
const state = { view: both ? 'both' : scene.levels.length ? 'model' : 'molecule', level: 0, detail: 0,
    pointed: -1, picked: -1, /* ellipsoids */
    place: null, kept: null, /* of the difference: pointed at, and picked */
    dark: matchMedia('(prefers-color-scheme: dark)').matches };
let shown = null; /* buffers of what is on the canvas, replaced as a whole when they are there */
let asked = 0;

async function collect() {
    const { view, level, detail } = state, what = {};
    if (view === 'molecule' || view === 'both' || view === 'difference')
        what.molecule = await surfaceOf(-1, detail);
    if (view === 'model' || view === 'both')
        what.model = await surfaceOf(level, detail);
    if (view === 'difference')
        what.difference = await differenceOf(what.molecule, 'molecule', level, detail);
    if (scene.levels.length)
        what.ellipsoids = await ellipsoidsOf(level);
    what.view = view;
    what.level = level;
    return what;
}

async function show() {
    const mine = ++asked;
    const what = await collect();
    if (mine !== asked) /* something else has been asked for since */
        return;
    shown = what;
    tell();
    draw();
}

function drawSurface(m, surface, colour, opacity, values) {
    const { p, uniforms: u } = surfaceProgram;
    gl.useProgram(p);
    setCommon(u, m);
    gl.uniform4fv(u.box, surface.box);
    gl.uniform3fv(u.colour, colour);
    gl.uniform1f(u.opacity, opacity);
    gl.uniform1i(u.coloured, values ? 1 : 0);
    gl.uniform1i(u.palette, 0);
    gl.bindVertexArray(surface.array);
    if (values) {
        gl.bindBuffer(gl.ARRAY_BUFFER, values);
        attribute(2, 1, gl.BYTE, 1, 0);
    } else {
        gl.disableVertexAttribArray(2);
    }
    gl.drawElements(gl.TRIANGLES, surface.count, gl.UNSIGNED_INT, 0);
}

/* As glass: the nearest depth first, then its colour over what is behind. */
function drawGlass(m, surface, colour) {
    gl.colorMask(false, false, false, false);
    drawSurface(m, surface, colour, 0.5);
    gl.colorMask(true, true, true, true);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthFunc(gl.LEQUAL);
    drawSurface(m, surface, colour, 0.36);
    gl.disable(gl.BLEND);
    gl.depthFunc(gl.LESS);
}

function drawEllipsoids(m, e) {
    const { p, uniforms: u } = ellipsoidProgram;
    gl.useProgram(p);
    setCommon(u, m);
    gl.uniform3fv(u.origin, scene.origin);
    gl.uniform1i(u.chosen, state.pointed >= 0 ? state.pointed : state.picked);
    gl.uniform3fv(u.dim, state.picked >= 0 && state.pointed < 0 ? [0.75, 0.75, 0.75] : [1, 1, 1]);
    gl.bindVertexArray(e.array);
    gl.drawElementsInstanced(gl.TRIANGLES, e.corners, gl.UNSIGNED_SHORT, 0, e.count);
}

const linearPaper = () => state.dark ? [0.0070, 0.0093, 0.0130] : [0.93, 0.94, 0.955];
function setCommon(u, m) {
    gl.uniformMatrix4fv(u.view, false, m.view);
    gl.uniformMatrix4fv(u.projection, false, m.projection);
    gl.uniform3fv(u.paper, linearPaper());
    gl.uniform2fv(u.fade, m.fade);
}

function paint() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width || canvas.height !== height) {
        canvas.width = width;
        canvas.height = height;
    }
    const m = matrices(), paper = state.dark ? [0.078, 0.094, 0.118] : [0.969, 0.973, 0.980];
    gl.viewport(0, 0, width, height);
    gl.clearColor(...paper, 1);
    gl.enable(gl.DEPTH_TEST);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (shown.view === 'molecule')
        drawSurface(m, shown.molecule, COLOURS.molecule, 1);
    else if (shown.view === 'model')
        drawSurface(m, shown.model, COLOURS.model, 1);
    else if (shown.view === 'difference')
        drawSurface(m, shown.molecule, COLOURS.molecule, 1, shown.difference.buffer);
    else if (shown.view === 'ellipsoids')
        drawEllipsoids(m, shown.ellipsoids);
    else {
        drawSurface(m, shown.model, COLOURS.model, 1);
        drawGlass(m, shown.molecule, COLOURS.molecule);
    }
    showScale();
    showDot(m);
}

let waiting = false;
function draw() {
    if (waiting || !shown)
        return;
    waiting = true;
    requestAnimationFrame(() => {
        waiting = false;
        paint();
    });
}

/* A place that was picked goes along with the molecule, unless it is turned away. */
function showDot(m) {
    const dot = byId('dot'), kept = shown.view === 'difference' && state.kept;
    dot.hidden = true;
    if (!kept)
        return;
    const eye = [0, 1, 2].map((k) => m.view[k] * kept.at[0] + m.view[4 + k] * kept.at[1] +
        m.view[8 + k] * kept.at[2] + m.view[12 + k]);
    const n = [0, 1, 2].map((k) => m.view[k] * kept.normal[0] + m.view[4 + k] * kept.normal[1] +
        m.view[8 + k] * kept.normal[2]);
    if (-eye[2] < m.near || n[0] * eye[0] + n[1] * eye[1] + n[2] * eye[2] > 0)
        return;
    const pixels = canvas.clientHeight / (2 * Math.tan(FIELD / 2) * -eye[2]);
    dot.hidden = false;
    dot.style.left = canvas.clientWidth / 2 + eye[0] * pixels + 'px';
    dot.style.top = canvas.clientHeight / 2 - eye[1] * pixels + 'px';
}

/* ---- text ------------------------------------------------------------------------------------ */

const format = (v, digits) => v.toFixed(digits).replace('-', '−');
const plain = (n) => String(n).replace(/\B(?=(\d{3})+$)/g, '\u202f');

function tell() {
    for (const button of byId('views').children) {
        const on = button.dataset.view === state.view;
        button.setAttribute('aria-checked', on);
        button.tabIndex = on ? 0 : -1;
    }
    byId('level').value = state.level;
    byId('detail').value = state.detail;
    byId('legend').hidden = state.view !== 'difference';
    if (shown.difference)
        byId('largest').textContent = 'largest ' + format(shown.difference.largest, 2) + ' Å';
    byId('message').hidden = true;
    canvas.dataset.view = shown.view;
    canvas.dataset.level = shown.level;
    tellChosen();
}

/* A length that reads well, about a hundred pixels of it, at the middle of the molecule. */
function showScale() {
    const pixel = 2 * distance() * Math.tan(FIELD / 2) / canvas.clientHeight;
    const power = 10 ** Math.floor(Math.log10(110 * pixel));
    const length = [5, 2, 1].find((v) => v * power <= 110 * pixel) * power;
    byId('scale').style.width = length / pixel + 'px';
    byId('length').textContent = Number(length.toPrecision(2)) + ' Å';
}

function addTerm(list, name, text) {
    const term = document.createElement('dt'), meaning = document.createElement('dd');
    term.textContent = name;
    meaning.textContent = text;
    list.append(term, meaning);
}

const NAMES = 24; /* residues that are shown, of more the number */
function shorten(text) {
    let left = NAMES;
    const parts = text.split(/(, |; )/);
    if ((parts.length + 1) / 2 <= left)
        return text;
    return parts.slice(0, 2 * left - 1).join('') + ' and ' + ((parts.length + 1) / 2 - left) + ' more';
}

/* What was pointed at or picked. */
function tellChosen() {
    if (!shown)
        return;
    const place = shown.view === 'difference' ? state.place || state.kept : null;
    byId('mark').hidden = !place;
    if (place)
        tellPlace(place);
    else
        tellEllipsoid();
}

/* Colours end at the range: beyond it a place is known to be beyond, and no more. */
function tellPlace({ value, beyond }) {
    const heading = document.createElement('h2'), text = document.createElement('p');
    const digits = scene.range < 0.1 ? 4 : 2, flat = Number(Math.abs(value).toFixed(digits)) === 0;
    heading.textContent = (beyond ? 'more than ' : '') + (value > 0 && !flat ? '+' : '') +
        format(flat ? 0 : value, digits) + ' Å';
    text.textContent = flat ? 'the surfaces meet here'
        : 'the model’s surface lies ' + (value > 0 ? 'outside' : 'inside') + ' here';
    byId('mark').style.left = 50 + 50 * value / scene.range + '%';
    byId('card').replaceChildren(heading, text);
    byId('card').hidden = false;
}

function tellEllipsoid() {
    const card = byId('card'), i = state.pointed >= 0 ? state.pointed : state.picked;
    card.hidden = i < 0 || !shown.ellipsoids || shown.view !== 'ellipsoids';
    if (card.hidden)
        return;
    const e = shown.ellipsoids, v = e.values.subarray(RECORD * i, RECORD * i + RECORD);
    const heading = document.createElement('h2'), list = document.createElement('dl');
    heading.textContent = 'Ellipsoid ' + (i + 1);
    if (v[13] >= 0)
        addTerm(list, 'atoms', String(v[13]));
    addTerm(list, 'amplitude', Number(v[12].toPrecision(4)).toString());
    const semi = [...v.subarray(3, 6)].sort((a, b) => b - a);
    addTerm(list, 'semi-axes', semi.map((s) => format(s, 2)).join(' × ') + ' Å');
    addTerm(list, 'centre', [0, 1, 2].map((k) => format(v[k] + scene.origin[k], 1)).join(', ') + ' Å');
    if (e.names && e.names[i]) {
        const names = document.createElement('dd');
        names.className = 'names';
        names.textContent = shorten(e.names[i]);
        list.append(names);
    }
    card.replaceChildren(heading, list);
}

/* ---- pointing ---------------------------------------------------------------------------------- */

/* Of a point of the canvas: x / -z and y / -z of what is seen there, in front of the eye. */
function slopes(x, y) {
    const h = Math.tan(FIELD / 2);
    return [(2 * x / canvas.clientWidth - 1) * h * aspect(), (1 - 2 * y / canvas.clientHeight) * h];
}

/* Of each vertex x / -z and y / -z, counted from a point of the canvas, and 1 / -z. Behind the eye
 * they are no numbers, and no triangle with such a corner is met. */
function project(surface, view, [px, py]) {
    const { at, box } = surface, v = view, n = at.length / 4;
    const seen = surface.seen = surface.seen || new Float32Array(3 * n);
    for (let i = 0; i < n; i++) {
        const a = box[0] + box[3] * at[4 * i], b = box[1] + box[3] * at[4 * i + 1];
        const c = box[2] + box[3] * at[4 * i + 2];
        const z = -(v[2] * a + v[6] * b + v[10] * c + v[14]), w = z > 0 ? 1 / z : NaN;
        seen[3 * i] = (v[0] * a + v[4] * b + v[8] * c + v[12]) * w - px;
        seen[3 * i + 1] = (v[1] * a + v[5] * b + v[9] * c + v[13]) * w - py;
        seen[3 * i + 2] = w;
    }
    return seen;
}

/* The nearest triangle about 0, 0 of what project() made, and the share of each corner there. */
function triangleAt(corners, seen, nearest) {
    let best = 0, found = null;
    for (let t = 0; t < corners.length; t += 3) {
        const i = 3 * corners[t], j = 3 * corners[t + 1], k = 3 * corners[t + 2];
        const x0 = seen[i], x1 = seen[j], x2 = seen[k], y0 = seen[i + 1], y1 = seen[j + 1], y2 = seen[k + 1];
        if (x0 > 0 && x1 > 0 && x2 > 0 || x0 < 0 && x1 < 0 && x2 < 0 ||
            y0 > 0 && y1 > 0 && y2 > 0 || y0 < 0 && y1 < 0 && y2 < 0)
            continue;
        const a = x1 * y2 - x2 * y1, b = x2 * y0 - x0 * y2, c = x0 * y1 - x1 * y0, sum = a + b + c;
        if (!(a >= 0 && b >= 0 && c >= 0 || a <= 0 && b <= 0 && c <= 0) || sum === 0)
            continue;
        const shares = [a * seen[i + 2] / sum, b * seen[j + 2] / sum, c * seen[k + 2] / sum];
        const w = shares[0] + shares[1] + shares[2];
        if (w > best && w * nearest < 1) {
            best = w;
            found = { t, shares: shares.map((s) => s / w) };
        }
    }
    return found;
}

/* The place of the difference that is seen at a point of the canvas, null for none: where it is, which
 * way is out, and the difference there (Å). */
function placeAt(x, y) {
    if (!shown || shown.view !== 'difference')
        return null;
    const surface = shown.molecule, { at, box, corners } = surface, m = matrices();
    const hit = triangleAt(corners, project(surface, m.view, slopes(x, y)), m.near);
    if (!hit)
        return null;
    const three = [0, 1, 2].map((c) => corners[hit.t + c]);
    const p = three.map((i) => [0, 1, 2].map((k) => box[k] + box[3] * at[4 * i + k]));
    const mixed = (values) => values.reduce((sum, v, c) => sum + hit.shares[c] * v, 0);
    const values = three.map((i) => shown.difference.values[i]);
    const [u, v] = [1, 2].map((c) => p[c].map((q, k) => q - p[0][k]));
    return {
        at: [0, 1, 2].map((k) => mixed(p.map((q) => q[k]))),
        normal: [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]],
        value: mixed(values) / 127 * scene.range,
        beyond: Math.abs(mixed(values)) > 126.5
    };
}

/* The ellipsoid that the line of sight through a point of the canvas meets first, -1 for none: in
 * the frame where an ellipsoid is the unit sphere, the nearer solution of |o + t d| = 1. */
function ellipsoidAt(x, y) {
    const e = shown && shown.view === 'ellipsoids' && shown.ellipsoids;
    if (!e)
        return -1;
    const r = rotation(camera.turn);
    const eye = [-camera.shift[0], -camera.shift[1], distance()], ray = [...slopes(x, y), -1];
    const back = (v) => [0, 1, 2].map((k) => r[3 * k] * v[0] + r[3 * k + 1] * v[1] + r[3 * k + 2] * v[2]);
    const from = back(eye).map((v, k) => v + scene.centre[k] - scene.origin[k]), along = back(ray);
    let best = -1, nearest = Infinity;
    for (let i = 0; i < e.count; i++) {
        const v = e.values, b = RECORD * i, o = [], s = [];
        const a1 = [v[b + 6], v[b + 7], v[b + 8]], a2 = [v[b + 9], v[b + 10], v[b + 11]];
        const a3 = [a1[1] * a2[2] - a1[2] * a2[1], a1[2] * a2[0] - a1[0] * a2[2], a1[0] * a2[1] - a1[1] * a2[0]];
        [a1, a2, a3].forEach((a, k) => {
            const q = 1 / v[b + 3 + k];
            o[k] = q * (a[0] * (from[0] - v[b]) + a[1] * (from[1] - v[b + 1]) + a[2] * (from[2] - v[b + 2]));
            s[k] = q * (a[0] * along[0] + a[1] * along[1] + a[2] * along[2]);
        });
        const A = s[0] * s[0] + s[1] * s[1] + s[2] * s[2], B = o[0] * s[0] + o[1] * s[1] + o[2] * s[2];
        const C = o[0] * o[0] + o[1] * o[1] + o[2] * o[2] - 1, D = B * B - A * C;
        if (D < 0)
            continue;
        const t = (-B - Math.sqrt(D)) / A;
        if (t > 0 && t < nearest) {
            nearest = t;
            best = i;
        }
    }
    return best;
}

function point(i) {
    if (state.pointed === i)
        return;
    state.pointed = i;
    tellChosen();
    draw();
}

function pick(i, place = null) {
    state.picked = i;
    state.pointed = -1;
    state.kept = place;
    state.place = null;
    tellChosen();
    draw();
}

/* Looking for a place of the difference goes through all triangles: once a frame is enough. */
let looking = null; /* where the pointer is, while a frame is waited for */
function look(x, y) {
    point(ellipsoidAt(x, y));
    if (!shown || shown.view !== 'difference')
        return;
    if (!looking)
        requestAnimationFrame(() => {
            state.place = looking && placeAt(...looking);
            looking = null;
            tellChosen();
        });
    looking = [x, y];
}

const fingers = new Map();
let moved = 0;
canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    moved = fingers.size > 1 ? 1000 : 0;
});

function shiftBy(dx, dy) {
    const pixel = 2 * distance() * Math.tan(FIELD / 2) / canvas.clientHeight;
    camera.shift[0] += dx * pixel;
    camera.shift[1] -= dy * pixel;
    draw();
}

function zoomBy(factor) {
    camera.zoom = Math.min(60, Math.max(0.2, camera.zoom * factor));
    draw();
}

function pinch(id, x, y) {
    const other = [...fingers.entries()].find(([key]) => key !== id)[1], before = fingers.get(id);
    const gap = (p) => Math.max(20, Math.hypot(p[0] - other[0], p[1] - other[1]));
    zoomBy(gap([x, y]) / gap(before));
    shiftBy((x - before[0]) / 2, (y - before[1]) / 2);
}

canvas.addEventListener('pointermove', (event) => {
    const before = fingers.get(event.pointerId), x = event.clientX, y = event.clientY;
    if (!before) {
        if (event.pointerType !== 'touch')
            look(x, y);
        return;
    }
    const dx = x - before[0], dy = y - before[1], speed = 5 / Math.min(canvas.clientWidth, canvas.clientHeight);
    moved += Math.abs(dx) + Math.abs(dy);
    if (fingers.size > 1)
        pinch(event.pointerId, x, y);
    else if (event.shiftKey || event.buttons & 6)
        shiftBy(dx, dy);
    else
        turn(dy * speed, dx * speed, 0);
    fingers.set(event.pointerId, [x, y]);
});

for (const name of ['pointerup', 'pointercancel'])
    canvas.addEventListener(name, (event) => {
        fingers.delete(event.pointerId);
        if (name === 'pointerup' && moved < 4)
            pick(ellipsoidAt(event.clientX, event.clientY), placeAt(event.clientX, event.clientY));
    });
canvas.addEventListener('pointerleave', () => {
    point(-1);
    state.place = looking = null;
    tellChosen();
});
canvas.addEventListener('contextmenu', (event) => event.preventDefault());
canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    zoomBy(Math.exp(-event.deltaY * (event.deltaMode ? 0.03 : 0.0012)));
}, { passive: false });

/* ---- controls ---------------------------------------------------------------------------------- */

function setView(name) {
    const view = VIEWS.find((v) => v.name === name);
    if (!view || !view.needs)
        return;
    state.view = name;
    state.pointed = -1;
    state.place = state.kept = null;
    show();
}

function setLevel(level) {
    if (!scene.levels[level])
        return;
    state.level = level;
    state.picked = state.pointed = -1;
    state.place = state.kept = null;
    show();
}

function setDetail(detail) {
    state.detail = detail;
    state.place = state.kept = null;
    show();
}

function setTheme(dark) {
    state.dark = dark;
    document.documentElement.classList.toggle('dark', dark);
    byId('theme').textContent = dark ? 'light' : 'dark';
    draw();
}

function reset() {
    camera.turn = [...start.turn];
    fit(shown.molecule || shown.model || start.surface);
    pick(-1);
}

function toggleKeys(on = byId('help').hidden) {
    byId('help').hidden = !on;
    byId('keys').setAttribute('aria-expanded', on);
}

/* N and P: through the ellipsoids one by one, also without a pointer. */
function step(by) {
    const e = scene.levels[state.level];
    if (!e)
        return;
    const next = state.picked < 0 ? (by > 0 ? 0 : e.ellipsoids - 1)
        : (state.picked + by + e.ellipsoids) % e.ellipsoids;
    if (state.view !== 'ellipsoids')
        setView('ellipsoids');
    if (shown)
        pick(next);
}

const details = [...new Set(scene.surfaces.map((s) => s.detail))].sort();
const KEYS = {
    ArrowLeft: () => turn(0, -0.12, 0), ArrowRight: () => turn(0, 0.12, 0),
    ArrowUp: () => turn(-0.12, 0, 0), ArrowDown: () => turn(0.12, 0, 0),
    q: () => turn(0, 0, 0.12), e: () => turn(0, 0, -0.12),
    '+': () => zoomBy(1.15), '=': () => zoomBy(1.15), '-': () => zoomBy(1 / 1.15), '−': () => zoomBy(1 / 1.15),
    n: () => step(1), p: () => step(-1), Escape: () => { toggleKeys(false); pick(-1); },
    l: () => setLevel((state.level + 1) % scene.levels.length),
    d: () => setDetail(details[(details.indexOf(state.detail) + 1) % details.length]),
    r: reset, t: () => setTheme(!state.dark), h: () => toggleKeys(), '?': () => toggleKeys()
};

window.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === 'SELECT')
        return;
    const view = VIEWS[Number(event.key) - 1], key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (event.key.startsWith('Arrow') && event.target.getAttribute('role') === 'radio')
        return;
    if (view)
        setView(view.name);
    else if (KEYS[key])
        KEYS[key]();
    else
        return;
    event.preventDefault();
});

function makeViews() {
    const group = byId('views'), there = VIEWS.filter((v) => v.needs);
    VIEWS.forEach((v, i) => {
        if (!v.needs)
            return;
        const button = document.createElement('button');
        button.type = 'button';
        button.textContent = v.name;
        button.title = v.name + ' (' + (i + 1) + ')';
        button.dataset.view = v.name;
        button.setAttribute('role', 'radio');
        button.addEventListener('click', () => setView(v.name));
        group.append(button);
    });
    group.addEventListener('keydown', (event) => { /* as radio buttons do */
        const by = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[event.key];
        if (!by)
            return;
        event.preventDefault();
        const at = there.findIndex((v) => v.name === state.view);
        const next = there[(at + by + there.length) % there.length].name;
        setView(next);
        group.querySelector('[data-view="' + next + '"]').focus();
    });
}

function makeSelect(id, options, choose) {
    const select = byId(id);
    options.forEach(([value, text]) => select.add(new Option(text, value)));
    select.addEventListener('change', () => choose(Number(select.value)));
    byId(id + '-label').hidden = options.length < 2;
}

function makeLegend() {
    const context = byId('bar').getContext('2d');
    context.putImageData(new ImageData(new Uint8ClampedArray(palette), 256, 1), 0, 0);
    for (const share of [-1, -0.5, 0, 0.5, 1]) {
        const tick = document.createElement('span');
        const text = Number((share * scene.range).toPrecision(3));
        tick.textContent = (text > 0 ? '+' : '') + String(text).replace('-', '−') + (share === 1 ? ' Å' : '');
        byId('ticks').append(tick);
    }
    byId('legend').setAttribute('aria-label', 'Colours from ' + -scene.range + ' Å, blue: the model\'s ' +
        'surface lies inside the molecule\'s, to ' + scene.range + ' Å, red: outside');
}

function makeControls() {
    makeViews();
    makeSelect('level', scene.levels.map((l, i) => [i, plain(l.ellipsoids)]), setLevel);
    const names = { 0: 'fine', 1: 'coarse' };
    makeSelect('detail', details.map((d) => [d, names[d]]), setDetail);
    byId('reset').addEventListener('click', reset);
    byId('theme').addEventListener('click', () => setTheme(!state.dark));
    byId('keys').addEventListener('click', () => toggleKeys());
    makeLegend();
    const parts = [];
    if (scene.atoms !== null)
        parts.push(plain(scene.atoms) + ' atoms');
    if (scene.levels.length)
        parts.push(plain(scene.levels[0].ellipsoids) + ' ellipsoids');
    byId('summary').textContent = parts.join(' · ');
}

/* ---- beginning --------------------------------------------------------------------------------- */

/* Some browsers take the drawing away from pages in the background, and give it back empty. */
canvas.addEventListener('webglcontextlost', (event) => event.preventDefault());
canvas.addEventListener('webglcontextrestored', () => location.reload());

makeControls();
setTheme(state.dark);
await firstTurn();
start.turn = [...camera.turn];
const wanted = location.hash.slice(1);
if (VIEWS.some((v) => v.name === wanted && v.needs))
    state.view = wanted;
new ResizeObserver(draw).observe(canvas);
start.surface = await surfaceOf(scene.atoms !== null ? -1 : 0, 0);
fit(start.surface);
await show();
paint();
canvas.dataset.ready = Math.round(performance.now() - started);
})().catch((error) => {
    document.getElementById('message').hidden = false;
    document.getElementById('message').textContent = 'The page could not be shown: ' + error.message;
    throw error;
});
