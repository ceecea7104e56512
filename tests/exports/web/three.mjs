// node three.mjs EXPORTS POINTS: three.js' own loaders read the exports; values at the points, as JSON.
//
// POINTS: {skins, coordinates, quantiles, size, counts}: skins and warped coordinates [N][3], quantiles [N].
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { MODULES, withPage } from "./browser.mjs";

const [exports, points] = process.argv.slice(2);
const html = `<!doctype html><script type="importmap">
{"imports": {"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/"}}</script>`;

const HEAD = `precision highp float; precision highp sampler2D; precision highp sampler3D;
uniform sampler2D points; uniform vec3 counts; out vec4 found;
vec4 point() { return texelFetch(points, ivec2(gl_FragCoord.x, 0), 0); }
vec3 texel(vec3 t, vec3 n) { return (t * (n - 1.0) + 0.5) / n; }
`;
const READS = {
  color: "uniform sampler3D data; void main() { found = vec4(lutgen_color(data, point().xyz), 1.0); }",
  ring: "uniform sampler2D data; void main() { found = lutgen_ring(data, point().w, point().xyz); }",
  cube: "uniform sampler3D data; void main() { found = texture(data, texel(point().xyz, counts)); }",
  strip: `uniform sampler2D data;
    void main() {  // x melanin in a tile, tiles along eumelanin, y hemoglobin; EXRLoader turns rows bottom-up
      vec3 t = texel(point().xyz, counts);
      float e = point().y * (counts.y - 1.0), first = min(floor(e), counts.y - 2.0);
      vec2 at = vec2((first + t.x) / counts.y, 1.0 - t.z);
      found = mix(texture(data, at), texture(data, at + vec2(1.0 / counts.y, 0.0)), e - first);
    }`,
};

const values = await withPage(
  { folders: { three: join(MODULES, "three"), exports }, texts: { "/": html } },
  async (page, base) => {
    await page.goto(base);
    return page.evaluate(async ({ points, HEAD, READS, chunk }) => {
      const THREE = await import("three");
      const { KTX2Loader } = await import("three/addons/loaders/KTX2Loader.js");
      const { LUTCubeLoader } = await import("three/addons/loaders/LUTCubeLoader.js");
      const { EXRLoader } = await import("three/addons/loaders/EXRLoader.js");
      const renderer = new THREE.WebGLRenderer(), scene = new THREE.Scene(), camera = new THREE.Camera();
      const ktx = new KTX2Loader().detectSupport(renderer), N = points.skins.length;
      const target = new THREE.WebGLRenderTarget(N, 1, { type: THREE.FloatType, depthBuffer: false });
      const shape = new THREE.BufferGeometry();
      shape.setAttribute("position", new THREE.Float32BufferAttribute([-1, -1, 0, 3, -1, 0, -1, 3, 0], 3));

      function read(texture, places, body, counts, before) {
        for (const name of ["minFilter", "magFilter"]) texture[name] = THREE.LinearFilter;
        for (const name of ["wrapS", "wrapT", "wrapR"]) texture[name] = THREE.ClampToEdgeWrapping;
        texture.generateMipmaps = false;
        texture.needsUpdate = true;
        const rows = Float32Array.from(places.flatMap((place, i) => [...place, points.quantiles[i]]));
        const data = new THREE.DataTexture(rows, N, 1, THREE.RGBAFormat, THREE.FloatType);
        data.needsUpdate = true;
        const material = new THREE.RawShaderMaterial({
          glslVersion: THREE.GLSL3, depthTest: false, depthWrite: false,
          uniforms: { data: { value: texture }, points: { value: data }, counts: { value: counts } },
          vertexShader: "in vec3 position; void main() { gl_Position = vec4(position, 1.0); }",
          fragmentShader: HEAD + before + body,
        });
        scene.clear();
        const mesh = new THREE.Mesh(shape, material);
        mesh.frustumCulled = false;
        scene.add(mesh);
        renderer.setRenderTarget(target);
        renderer.render(scene, camera);
        const out = new Float32Array(4 * N);
        renderer.readRenderTargetPixels(target, 0, 0, N, 1, out);
        return [...out];
      }

      const color = await ktx.loadAsync("/exports/three/skin_color.ktx2");
      const profile = await ktx.loadAsync("/exports/three/skin_profile.ktx2");
      const cube = await new LUTCubeLoader().setType(THREE.FloatType).loadAsync("/exports/cube/skin.cube");
      const strip = await new EXRLoader().loadAsync("/exports/exr/color_rec709.exr");
      const size = new THREE.Vector3(points.size, points.size, points.size), own = new THREE.Vector3(...points.counts);
      return {
        shape: [color.isData3DTexture, color.image.width, color.image.height, color.image.depth, color.colorSpace],
        color: read(color, points.skins, READS.color, own, chunk),
        ring: read(profile, points.skins, READS.ring, own, chunk),
        cube: read(cube.texture3D, points.coordinates, READS.cube, size, ""),
        strip: read(strip, points.coordinates, READS.strip, own, ""),
      };
    }, { points: JSON.parse(readFileSync(points)), HEAD, READS, chunk: readFileSync(join(exports, "three/skin.glsl"), "utf8") });
  },
);
console.log(JSON.stringify(values));
