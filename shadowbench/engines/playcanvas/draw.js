// PlayCanvas: https://developer.playcanvas.com/user-manual/graphics/lighting/shadows/
import * as pc from "playcanvas";

const FILTERS = {
  pcf1: pc.SHADOW_PCF1_32F,
  pcf3: pc.SHADOW_PCF3_32F,
  pcf5: pc.SHADOW_PCF5_32F,
  vsm16: pc.SHADOW_VSM_16F,
  vsm32: pc.SHADOW_VSM_32F,
  pcss: pc.SHADOW_PCSS_32F,
};
let app, root, camera, light, asset;

export async function open({ canvas, width, height }) {
  const device = { deviceTypes: [pc.DEVICETYPE_WEBGL2], antialias: false, preserveDrawingBuffer: true };
  const options = new pc.AppOptions();
  options.graphicsDevice = await pc.createGraphicsDevice(canvas, device);
  options.componentSystems = [pc.RenderComponentSystem, pc.CameraComponentSystem, pc.LightComponentSystem];
  options.resourceHandlers = [pc.ContainerHandler, pc.TextureHandler];
  app = new pc.AppBase(canvas);
  app.init(options);
  app.setCanvasFillMode(pc.FILLMODE_NONE);
  app.setCanvasResolution(pc.RESOLUTION_FIXED, width, height);
  app.autoRender = false;
  app.scene.ambientLight = new pc.Color(0, 0, 0);
  app.start();
  return pc.version;
}

export async function load({ glb, view }) {
  [root, camera, light].forEach((former) => former?.destroy());
  light = null;
  asset?.unload();
  const url = URL.createObjectURL(new Blob([glb]));
  asset = new pc.Asset("scene", "container", { url, filename: "scene.glb" });
  app.assets.add(asset);
  app.assets.load(asset);
  await new Promise((loaded, failed) => asset.ready(loaded) && asset.on("error", failed));
  URL.revokeObjectURL(url);
  root = asset.resource.instantiateRenderEntity();
  app.root.addChild(root);
  ["light", "camera"].forEach((kind) => root.findComponents(kind).forEach((own) => own.entity.removeComponent(kind)));
  for (const { name, casts, receives } of view.meshes) {
    const parts = root.findByName(name)?.findComponents("render") ?? [];
    parts.forEach((part) => Object.assign(part, { castShadows: casts, receiveShadows: receives }));
  }
  const plain = { clearColor: pc.Color.BLACK, toneMapping: pc.TONEMAP_NONE, gammaCorrection: pc.GAMMA_SRGB };
  camera = new pc.Entity("camera");
  camera.addComponent("camera", plain);
  app.root.addChild(camera);
}

export async function draw({ camera: pose, light: lamp, box, params, shadows, exposure }) {
  const { fov_y: fov, height, near: nearClip, far: farClip, position, up, target } = pose;
  const lens = height ? { projection: pc.PROJECTION_ORTHOGRAPHIC, orthoHeight: height / 2 } : { fov };
  Object.assign(camera.camera, { projection: pc.PROJECTION_PERSPECTIVE, ...lens, nearClip, farClip });
  camera.setPosition(...position);
  camera.lookAt(new pc.Vec3(...target), new pc.Vec3(...up));
  const type = { directional: "directional", spot: "spot", point: "omni" }[lamp.kind];
  const { filter, size: shadowResolution, distance: shadowDistance, cascades: numCascades, bias: shadowBias } = params;
  if (type !== "directional") {
    // Spots and points share an atlas, whose filter is the scene's; its shaders compile with these alone.
    if (!filter.startsWith("pcf")) throw new Error(`PlayCanvas has no ${filter} of ${lamp.kind} lights`);
    Object.assign(app.scene.lighting, { shadowType: FILTERS[filter], shadowAtlasResolution: params.atlas });
  }
  const map = { shadowResolution, shadowDistance, numCascades, shadowBias, normalOffsetBias: params.normal_bias };
  const cone = { innerConeAngle: 0.4999 * lamp.cone, outerConeAngle: 0.5 * lamp.cone, range: 2 * box.far }; // no rim
  light?.destroy();
  light = new pc.Entity("light");
  const shadow = { castShadows: shadows, shadowType: FILTERS[filter], ...map };
  const intensity = exposure < 1 ? exposure ** (1 / 2.2) : exposure; // below 1 the engine takes it as a colour
  light.addComponent("light", { type, intensity, ...shadow, ...(box.far && cone) });
  app.root.addChild(light);
  light.setPosition(...(lamp.position ?? [0, 0, 0]));
  light.setRotation(new pc.Quat().setFromDirections(pc.Vec3.DOWN, new pc.Vec3(...(lamp.direction ?? [0, -1, 0]))));
  for (let frame = 0; frame < 2; frame++) {
    app.renderNextFrame = true;
    await new Promise((drawn) => app.once("frameend", drawn));
  }
}
