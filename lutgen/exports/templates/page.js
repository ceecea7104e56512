const data = "DATA";
const NAMES = { melanin: "Melanin", eumelanin: "Eumelanin share", hemoglobin: "Blood" };
const FRAMES = Number(location.hash.slice(1)) || 48;  // pictures averaged; page.html#8 is enough for a slow machine
const SHADOW = 1024, PICTURE_PX = 1.6e6;
const $ = (query) => document.querySelector(query);
const canvas = $("canvas");
const state = { skin: [0, 0, 0], turn: 0.36, tilt: 0.03, far: 965, frame: 0 };

// The axes: a slider stands at t in 0 to 1, the warp of its value.
const axes = Object.entries("AXES");
const valueAt = (axis, t) => Math.min(axis.high, Math.max(axis.low, axis.unwarp(t)));

const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
const unpacked = async (name) => {
  const stream = new Blob([bytes(data.packed[name])]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
};
// Differences, one component after the other: summed up and woven together again.
const summed = async (name, Kind, parts) => {
  const differences = new Kind(await unpacked(name)), out = new Kind(differences.length), count = differences.length / parts;
  for (let part = 0; part < parts; part++) {
    const sum = new Kind(1);
    for (let i = 0; i < count; i++) { sum[0] += differences[part * count + i]; out[i * parts + part] = sum[0]; }
  }
  return out;
};

async function mesh(gl) {
  const { vertices, low, span } = data.mesh, vao = gl.createVertexArray();
  const packed = await summed("positions", Uint16Array, 3);
  const positions = Float32Array.from(packed, (v, i) => low[i % 3] + span[i % 3] * v / 65535);
  const arrays = [
    [positions, 3, gl.FLOAT, false], [await summed("facing", Int8Array, 3), 3, gl.BYTE, true],
    [await summed("corners", Uint16Array, 2), 2, gl.UNSIGNED_SHORT, true],
    [await summed("sky", Uint8Array, 1), 1, gl.UNSIGNED_BYTE, true],
  ];
  gl.bindVertexArray(vao);
  arrays.forEach(([values, parts, kind, share], i) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(i);
    gl.vertexAttribPointer(i, parts, kind, share, 0, 0);
  });
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, await summed("index", Uint16Array, 1), gl.STATIC_DRAW);
  return { vao, corners: data.mesh.corners, vertices };
}

// The key light, moved over its width from frame to frame: averaged, its shadow is soft.
function keyLight(frame) {
  const turn = frame * 2.39996323, wide = 0.11 * Math.sqrt((frame + 0.5) / FRAMES);
  const way = unit([-0.62 + wide * Math.cos(turn), 0.62 + wide * Math.sin(turn), 0.72]);
  const center = [0, -45, 0], view = looking(center.map((v, k) => v + 400 * way[k]), center);
  const box = [1 / 240, 0, 0, 0, 0, 1 / 240, 0, 0, 0, 0, -1 / 400, 0, 0, 0, -1, 1];
  return [way, times(box, view)];
}

const radical = (i, base) => { let f = 1, r = 0; for (; i > 0; i = Math.floor(i / base)) r += (f /= base) * (i % base); return r; };

async function start() {
  const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, preserveDrawingBuffer: true });
  if (!gl) throw new Error("This page needs WebGL 2, which this browser does not offer.");
  if (!gl.getExtension("EXT_color_buffer_float") && !gl.getExtension("EXT_color_buffer_half_float")) {
    throw new Error("This page needs half-float render targets, which this graphics driver does not offer.");
  }
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  const programs = {
    shadow: program(gl, "shadow", "shadow"), head: program(gl, "head", "head"), row: program(gl, "screen", "row"),
    gather: program(gl, "screen", "gather"), finish: program(gl, "screen", "finish"),
  };
  const color = ktx2(gl, await unpacked("skin_color.ktx2")), profile = ktx2(gl, await unpacked("skin_profile.ktx2"));
  const [pigments, bumps] = [await picture(gl, "pigments"), await picture(gl, "bumps")], head = await mesh(gl);
  const row = target(gl, data.quantiles, 1, 1), shadow = target(gl, SHADOW, SHADOW, 0, depths(gl, SHADOW, SHADOW));
  gl.bindTexture(gl.TEXTURE_2D, shadow.depth);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_COMPARE_FUNC, gl.LEQUAL);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
  const flat = (image) => [gl.TEXTURE_2D, image], lut = [gl.TEXTURE_3D, color];
  let scene = null, sum = null;

  function resize() {
    const box = canvas.getBoundingClientRect(), wanted = window.devicePixelRatio || 1;
    const scale = Math.min(wanted, Math.sqrt(PICTURE_PX / Math.max(box.width * box.height, 1)));
    const [width, height] = [box.width, box.height].map((v) => Math.max(1, Math.round(v * scale)));
    if (sum && canvas.width === width && canvas.height === height) return;
    [canvas.width, canvas.height] = [width, height];
    forget(gl, scene); forget(gl, sum);
    [scene, sum] = [target(gl, width, height, 4, depths(gl, width, height)), target(gl, width, height, 1)];
  }

  function swatch() {
    const box = canvas.getBoundingClientRect(), own = $("#swatch").getBoundingClientRect();
    const x = canvas.width / box.width, y = canvas.height / box.height;
    return [(own.left - box.left) * x, (box.bottom - own.bottom) * y, (own.right - box.left) * x, (box.bottom - own.top) * y];
  }

  let waiting = false;
  function ask() {
    if (!waiting) requestAnimationFrame(render);
    waiting = true;
  }

  function render() {
    waiting = false;
    resize();
    const { width, height } = canvas, focal = 3.1 * Math.min(height, 1.15 * width), near = 300, beyond = 3000;
    const aim = [0, -35, 0], [c, s] = [Math.cos(state.tilt), Math.sin(state.tilt)];
    const eye = aim.map((v, k) => v + state.far * [Math.sin(state.turn) * c, s, Math.cos(state.turn) * c][k]);
    const view = looking(eye, aim), jitter = [radical(state.frame + 1, 2) - 0.5, radical(state.frame + 1, 3) - 0.5];
    const projection = [2 * focal / width, 0, 0, 0, 0, 2 * focal / height, 0, 0,
                        0, 0, (near + beyond) / (near - beyond), -1, 0, 0, 2 * near * beyond / (near - beyond), 0];
    const [key, light_view] = keyLight(state.frame), skin = state.skin;
    gl.disable(gl.BLEND);
    gl.enable(gl.DEPTH_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, shadow.frame);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    draw(gl, programs.shadow, shadow, { light_view }, head.corners, head.vao);
    gl.bindFramebuffer(gl.FRAMEBUFFER, scene.frame);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    draw(gl, programs.head, scene, {
      view, projection, light_view, center: [2 * jitter[0] / width, 2 * jitter[1] / height], skin, key,
      mapped: Number($("#mapped").checked), pigments: flat(pigments), bumps: flat(bumps), shadow: flat(shadow.depth),
    }, head.corners, head.vao);
    gl.disable(gl.DEPTH_TEST);
    if (state.frame === 0) {
      draw(gl, programs.row, row, { profile: flat(profile), skin });
      gl.bindFramebuffer(gl.FRAMEBUFFER, sum.frame);
      gl.clear(gl.COLOR_BUFFER_BIT);
    }
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE);
    const [entering, surface, place, gloss] = scene.colors.map(flat);
    draw(gl, programs.gather, sum, {
      entering, surface, place, gloss, row: flat(row.colors[0]), lut, focal, frame: state.frame,
      middle: [width / 2 + jitter[0], height / 2 + jitter[1]], scatters: Number($("#scatters").checked),
    });
    gl.disable(gl.BLEND);
    draw(gl, programs.finish, null, { sum: flat(sum.colors[0]), lut, skin, swatch: swatch() });
    if (state.frame === 0) tell();
    state.frame += 1;
    document.body.dataset.frames = state.frame;
    if (state.frame < FRAMES) ask();
  }

  function tell() {
    const [left, bottom, right, top] = swatch(), pixel = new Uint8Array(4);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.readPixels((left + right) / 2, (bottom + top) / 2, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    const hex = [...pixel.slice(0, 3)].map((v) => v.toString(16).padStart(2, "0")).join("");
    $("#note b").textContent = "#" + hex.toUpperCase();
    $("#note span").textContent = "sRGB " + [...pixel.slice(0, 3)].join(" ");
  }
  return () => { state.frame = 0; ask(); };
}

function controls(redraw) {
  const sliders = axes.map(([name, axis], k) => {
    const label = document.createElement("label"), shown = document.createElement("output"), slider = document.createElement("input");
    Object.assign(slider, { type: "range", min: 0, max: 1, step: "any", id: name, disabled: axis.low === axis.high });
    label.append(NAMES[name], shown, slider);
    $("#sliders").append(label);
    slider.addEventListener("input", () => { state.skin[k] = valueAt(axis, Number(slider.value)); changed(); });
    return { slider, shown };
  });
  const buttons = Object.entries(data.presets).map(([name, skin]) => {
    const button = document.createElement("button");
    Object.assign(button, { textContent: name.replace("-", " "), id: "preset-" + name });
    const [r, g, b] = data.swatches[name];
    button.style.background = `rgb(${r} ${g} ${b})`;
    button.style.color = 0.3 * r + 0.6 * g + 0.1 * b > 120 ? "#1b1510" : "#f4ece6";
    button.addEventListener("click", () => { state.skin = [...skin]; changed(); });
    $("#presets").append(button);
    return [button, skin];
  });
  function changed() {
    axes.forEach(([, axis], k) => {
      const t = axis.warp(state.skin[k]);
      if (Math.abs(t - Number(sliders[k].slider.value)) > 1e-6) sliders[k].slider.value = t;
      sliders[k].shown.textContent = (100 * state.skin[k]).toPrecision(3) + " %";
      sliders[k].shown.dataset.value = state.skin[k];
    });
    for (const [button, skin] of buttons) button.setAttribute("aria-pressed", skin.every((v, k) => v === state.skin[k]));
    redraw();
  }
  for (const id of ["#scatters", "#mapped"]) $(id).addEventListener("change", redraw);
  canvas.addEventListener("pointermove", (event) => {
    if (!event.buttons) return;
    canvas.setPointerCapture(event.pointerId);
    state.turn -= 0.008 * event.movementX;
    state.tilt = Math.max(-0.6, Math.min(0.9, state.tilt + 0.006 * event.movementY));
    redraw();
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    state.far = Math.max(450, Math.min(2000, state.far * Math.exp(0.001 * event.deltaY)));
    redraw();
  }, { passive: false });
  window.addEventListener("resize", redraw);
  const first = Object.values(data.presets)[1] || Object.values(data.presets)[0];
  state.skin = first ? [...first] : axes.map(([, axis]) => valueAt(axis, 0.4));
  changed();
}

start().then(controls).catch((error) => {
  $("#problem").hidden = false;
  $("#problem").textContent = error.message;
  throw error;
});
