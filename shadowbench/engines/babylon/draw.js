// Babylon.js: https://doc.babylonjs.com/features/featuresDeepDive/lights/shadows
const { BABYLON } = globalThis;
const FILTERS = {
  none: BABYLON.ShadowGenerator.FILTER_NONE,
  poisson: BABYLON.ShadowGenerator.FILTER_POISSONSAMPLING,
  esm: BABYLON.ShadowGenerator.FILTER_EXPONENTIALSHADOWMAP,
  blur_esm: BABYLON.ShadowGenerator.FILTER_BLUREXPONENTIALSHADOWMAP,
  close_esm: BABYLON.ShadowGenerator.FILTER_CLOSEEXPONENTIALSHADOWMAP,
  blur_close_esm: BABYLON.ShadowGenerator.FILTER_BLURCLOSEEXPONENTIALSHADOWMAP,
  pcf: BABYLON.ShadowGenerator.FILTER_PCF,
  pcss: BABYLON.ShadowGenerator.FILTER_PCSS,
};
const vector = ([x, y, z]) => new BABYLON.Vector3(-x, y, z); // scenes are left-handed: the loader of glTF mirrors x
let engine, scene, meshes;

export function open({ canvas, width, height }) {
  engine = new BABYLON.Engine(canvas, false, { preserveDrawingBuffer: true });
  engine.setSize(width, height);
  return BABYLON.Engine.Version;
}

export async function load({ glb }) {
  scene?.dispose();
  scene = new BABYLON.Scene(engine);
  scene.clearColor = new BABYLON.Color4(0, 0, 0, 1);
  await BABYLON.AppendSceneAsync(new Uint8Array(glb), scene, { pluginExtension: ".glb" });
  [...scene.lights, ...scene.cameras].forEach((own) => own.dispose());
  scene.activeCamera = new BABYLON.FreeCamera("", BABYLON.Vector3.Zero(), scene);
  meshes = scene.meshes.filter((mesh) => mesh.getTotalVertices() > 0);
}

const LIGHTS = {
  directional: ({ direction }) => new BABYLON.DirectionalLight("", vector(direction), scene),
  spot: ({ position, direction, cone }) => // 0: without a soft rim
    new BABYLON.SpotLight("", vector(position), vector(direction), BABYLON.Tools.ToRadians(cone), 0, scene),
  point: ({ position }) => new BABYLON.PointLight("", vector(position), scene),
};

export async function draw({ camera: pose, light: lamp, box, params, shadows, exposure }) {
  const { height, near: minZ, far: maxZ, position, up, target } = pose, fov = BABYLON.Tools.ToRadians(pose.fov_y);
  const camera = scene.activeCamera, [right, top] = [(height / 2) * pose.aspect, height / 2];
  camera.mode = BABYLON.Camera[height ? "ORTHOGRAPHIC_CAMERA" : "PERSPECTIVE_CAMERA"];
  Object.assign(camera, { position: vector(position), upVector: vector(up), fov, minZ, maxZ });
  Object.assign(camera, { orthoLeft: -right, orthoRight: right, orthoBottom: -top, orthoTop: top });
  camera.setTarget(vector(target));
  scene.lights.slice().forEach((former) => former.dispose()); // with their maps
  const light = LIGHTS[lamp.kind](lamp);
  light.intensity = Math.PI * exposure; // of which a white surface reflects 1 / π
  light.specular = BABYLON.Color3.Black();
  light.falloffType = BABYLON.Light.FALLOFF_STANDARD; // which the range ends, without an end by default
  Object.assign(light, { shadowMinZ: box.near ?? 0, shadowMaxZ: box.far ?? box.depth });
  if (lamp.kind === "directional") {
    // The engine's view of the light has the y axis up; the projection undoes it, and then does as the box says.
    const look = BABYLON.Matrix.LookAtLH(...[box.position, box.target, box.up].map(vector));
    const lens = BABYLON.Matrix.OrthoLH(box.width, box.height, 0, box.depth);
    light.position = vector(box.position);
    light.customProjectionMatrixBuilder = (view, _, result) =>
      BABYLON.Matrix.Invert(view).multiply(look).multiplyToRef(lens, result);
  }
  const shadow = shadows && generator(light, params);
  for (const mesh of meshes) {
    const { casts = true, receives = true } = mesh.metadata?.gltf?.extras ?? {};
    mesh.receiveShadows = shadows && receives;
    if (shadow && casts) shadow.addShadowCaster(mesh, false);
  }
  do {
    scene.render(); // without what is still compiled
    await new Promise(requestAnimationFrame);
  } while (!scene.isReady(true) || !meshes.every((mesh) => mesh.isReady(true)));
  scene.render();
}

function generator(light, params) {
  const kind = params.cascades > 1 ? BABYLON.CascadedShadowGenerator : BABYLON.ShadowGenerator;
  const shadow = Object.assign(new kind(params.size, light), { numCascades: params.cascades });
  shadow.filter = FILTERS[params.filter];
  shadow.filteringQuality = BABYLON.ShadowGenerator[`QUALITY_${params.quality.toUpperCase()}`];
  shadow.contactHardeningLightSizeUVRatio = params.light_size;
  shadow.depthScale = params.depth_scale;
  const { bias, normal_bias: normalBias, back_faces: forceBackFacesOnly } = params;
  return Object.assign(shadow, { bias, normalBias, forceBackFacesOnly });
}
