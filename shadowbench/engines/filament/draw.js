// Filament: https://google.github.io/filament/Filament.html#imagingpipeline/shadows
let Filament, engine, renderer, swapChain, loader, camera, view, scene, asset, lamp;

export async function open({ canvas, width, height }) {
  await new Promise((ready) => globalThis.Filament.init([], ready)); // which assigns it anew
  ({ Filament } = globalThis);
  engine = Filament.Engine.create(canvas, { preserveDrawingBuffer: true, antialias: false });
  [swapChain, renderer, loader] = [engine.createSwapChain(), engine.createRenderer(), engine.createAssetLoader()];
  camera = engine.createCamera(Filament.EntityManager.get().create());
  camera.setExposureDirect(1);
  view = engine.createView();
  view.setCamera(camera);
  view.setViewport([0, 0, width, height]);
  view.setPostProcessingEnabled(false); // pictures are linear then
  renderer.setClearOptions({ clearColor: [0, 0, 0, 1], clear: true });
  return "1.53.4"; // it does not say
}

export async function load({ glb, view: { meshes } }) {
  extinguish();
  if (asset) loader.destroyAsset(asset);
  if (scene) engine.destroyScene(scene);
  scene = engine.createScene();
  view.setScene(scene);
  asset = loader.createAsset(new Uint8Array(glb));
  await new Promise((loaded) => asset.loadResources(loaded, null, ""));
  const renderables = engine.getRenderableManager();
  asset.getRenderableEntities().forEach((entity) => scene.addEntity(entity));
  for (const { name, casts, receives } of meshes) {
    for (const entity of asset.getEntitiesByName(name).filter((entity) => renderables.hasComponent(entity))) {
      renderables.setCastShadows(renderables.getInstance(entity), casts);
      renderables.setReceiveShadows(renderables.getInstance(entity), receives);
    }
  }
}

const KINDS = { directional: "DIRECTIONAL", spot: "SPOT", point: "POINT" };

export async function draw({ camera: pose, light, box, shadows, exposure }) {
  const { fov_y, height, aspect, near, far } = pose, up = height / 2;
  if (height) camera.setProjection(Filament.Camera$Projection.ORTHO, -aspect * up, aspect * up, -up, up, near, far);
  else camera.setProjectionFov(fov_y, aspect, near, far, Filament.Camera$Fov.VERTICAL);
  camera.lookAt(pose.position, pose.target, pose.up);
  extinguish();
  lamp = Filament.EntityManager.get().create();
  const full = Math.PI * exposure; // of which a white surface reflects 1 / π
  const builder = Filament.LightManager.Builder(Filament.LightManager$Type[KINDS[light.kind]]);
  builder.color([1, 1, 1]).castShadows(shadows);
  if (light.direction) builder.direction(light.direction);
  if (light.kind === "directional") builder.intensity(full);
  else {
    // It falls off with the squared distance. In lumens: of all directions, for a spot of a cone of 120°.
    const lumens = full * (box.far / 2) ** 2 * Math.PI * (light.kind === "point" ? 4 : 1);
    builder.position(light.position).intensity(lumens).falloff(100 * box.far);
  }
  const half = (light.cone * Math.PI) / 360;
  if (light.kind === "spot") builder.spotLightCone(half, half);
  builder.build(engine, lamp);
  scene.addEntity(lamp);
  for (let frame = 0; frame < 2; frame++) {
    renderer.render(swapChain, view);
    await new Promise(requestAnimationFrame);
  }
}

function extinguish() {
  if (!lamp) return;
  scene.remove(lamp);
  engine.destroyEntity(lamp);
  lamp = null;
}
