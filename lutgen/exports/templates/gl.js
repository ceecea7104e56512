"use strict";
// Matrices by columns, as WebGL takes them.
const times = (a, b) => a.map((_, i) => [0, 1, 2, 3].reduce((s, k) => s + a[i % 4 + 4 * k] * b[4 * (i >> 2) + k], 0));
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (a) => a.map((v) => v / Math.hypot(...a));
const looking = (from, to) => {
  const z = unit(from.map((v, k) => v - to[k])), x = unit(cross([0, 1, 0], z)), y = cross(z, x);
  return [x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, from), -dot(y, from), -dot(z, from), 1];
};

function program(gl, vertex, fragment) {
  const linked = gl.createProgram();
  for (const [kind, name] of [[gl.VERTEX_SHADER, vertex + ".vert"], [gl.FRAGMENT_SHADER, fragment + ".frag"]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, "#version 300 es\n" + data.chunk + data.shaders[name]);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(name + ": " + gl.getShaderInfoLog(shader));
    gl.attachShader(linked, shader);
  }
  ["position", "normal", "corner", "sky"].forEach((name, i) => gl.bindAttribLocation(linked, i, name));
  gl.linkProgram(linked);
  if (!gl.getProgramParameter(linked, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(linked));
  return linked;
}

function texture(gl, kind, filter, upload) {
  const handle = gl.createTexture();
  gl.bindTexture(kind, handle);
  for (const axis of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R]) gl.texParameteri(kind, axis, gl.CLAMP_TO_EDGE);
  gl.texParameteri(kind, gl.TEXTURE_MAG_FILTER, filter);
  gl.texParameteri(kind, gl.TEXTURE_MIN_FILTER, filter);
  upload();
  return handle;
}

// A KTX2 file of one level in half floats; where its parts lie: KTX 2.0, section 3.
function ktx2(gl, file) {
  const head = new DataView(file), [width, height, depth] = [20, 24, 28].map((byte) => head.getUint32(byte, true));
  const start = Number(head.getBigUint64(80, true)), texels = new Uint16Array(file.slice(start));
  return depth
    ? texture(gl, gl.TEXTURE_3D, gl.LINEAR, () =>
        gl.texImage3D(gl.TEXTURE_3D, 0, gl.RGBA16F, width, height, depth, 0, gl.RGBA, gl.HALF_FLOAT, texels))
    : texture(gl, gl.TEXTURE_2D, gl.NEAREST, () =>
        gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA16F, width, height, 0, gl.RGBA, gl.HALF_FLOAT, texels));
}

async function picture(gl, name) {
  const options = { colorSpaceConversion: "none", premultiplyAlpha: "none" };
  const image = await createImageBitmap(new Blob([bytes(data.pictures[name])], { type: "image/jpeg" }), options);
  const uploaded = texture(gl, gl.TEXTURE_2D, gl.LINEAR, () =>
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, image));
  gl.generateMipmap(gl.TEXTURE_2D);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
  return uploaded;
}

const half = (gl, width, height) => texture(gl, gl.TEXTURE_2D, gl.NEAREST, () =>
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA16F, width, height));
const depths = (gl, width, height) => texture(gl, gl.TEXTURE_2D, gl.NEAREST, () =>
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, width, height));

function target(gl, width, height, count, depth) {
  const buffers = { frame: gl.createFramebuffer(), width, height, depth, colors: [] };
  gl.bindFramebuffer(gl.FRAMEBUFFER, buffers.frame);
  for (let i = 0; i < count; i++) {
    buffers.colors.push(half(gl, width, height));
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, buffers.colors[i], 0);
  }
  if (depth) gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, depth, 0);
  gl.drawBuffers(count ? buffers.colors.map((_, i) => gl.COLOR_ATTACHMENT0 + i) : [gl.NONE]);
  if (gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE) throw new Error("no half-float targets");
  return buffers;
}

function forget(gl, old) {
  if (!old) return;
  [...old.colors, old.depth].forEach((held) => held && gl.deleteTexture(held));
  gl.deleteFramebuffer(old.frame);
}

// One draw: `values` by name are numbers, vectors, matrices, or [kind, texture].
function draw(gl, shaders, into, values, corners, vao = null) {
  gl.bindFramebuffer(gl.FRAMEBUFFER, into ? into.frame : null);
  gl.viewport(0, 0, into ? into.width : canvas.width, into ? into.height : canvas.height);
  gl.useProgram(shaders);
  gl.bindVertexArray(vao);
  let place = 0;
  for (const [name, value] of Object.entries(values)) {
    const location = gl.getUniformLocation(shaders, name);
    if (Array.isArray(value) && value[1] instanceof WebGLTexture) {
      gl.activeTexture(gl.TEXTURE0 + place);
      gl.bindTexture(value[0], value[1]);
      gl.uniform1i(location, place++);
    } else if (typeof value === "number") {
      if (name === "frame") gl.uniform1i(location, value); else gl.uniform1f(location, value);
    } else if (value.length === 16) gl.uniformMatrix4fv(location, false, value);
    else gl["uniform" + value.length + "fv"](location, value);
  }
  if (vao) gl.drawElements(gl.TRIANGLES, corners, gl.UNSIGNED_SHORT, 0); else gl.drawArrays(gl.TRIANGLES, 0, 3);
}
