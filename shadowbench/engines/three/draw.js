// three.js: https://threejs.org/docs/#api/en/lights/shadows/LightShadow
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

const FILTERS = { basic: THREE.BasicShadowMap, pcf: THREE.PCFShadowMap, vsm: THREE.VSMShadowMap };
const SIDES = { shipped: null, front: THREE.FrontSide, back: THREE.BackSide, both: THREE.DoubleSide };
let renderer, scene, light, meshes;

export function open({ canvas, width, height }) {
  renderer = new THREE.WebGLRenderer({ canvas, antialias: false, preserveDrawingBuffer: true });
  renderer.setPixelRatio(1);
  renderer.setSize(width, height, false);
  renderer.toneMapping = THREE.NoToneMapping;
  renderer.shadowMap.enabled = true;
  return THREE.REVISION;
}

export async function load({ glb }) {
  light?.dispose();
  light = null;
  meshes?.forEach((mesh) => [mesh.geometry, mesh.material].forEach((part) => part.dispose()));
  const { scene: root } = await new GLTFLoader().parseAsync(glb, "");
  scene = new THREE.Scene().add(root);
  meshes = [];
  const own = [];
  root.traverse((node) => {
    if (node.isLight || node.isCamera) own.push(node);
    if (node.isMesh) meshes.push(node);
  });
  own.forEach((node) => node.removeFromParent());
  for (const mesh of meshes) {
    mesh.castShadow = mesh.userData.casts ?? true;
    mesh.receiveShadow = mesh.userData.receives ?? true;
  }
}

const LIGHTS = {
  directional: () => new THREE.DirectionalLight(),
  spot: ({ cone }) => new THREE.SpotLight(undefined, 1, 0, THREE.MathUtils.degToRad(cone / 2), 0, 0), // no decay
  point: () => new THREE.PointLight(undefined, 1, 0, 0),
};

export function draw({ camera: pose, light: lamp, box, params, shadows, exposure }) {
  if (params.filter === "vsm" && lamp.kind === "point") throw new Error("three.js has no VSM of point lights");
  light?.dispose(); // with its map
  light?.removeFromParent();
  light = LIGHTS[lamp.kind](lamp);
  scene.add(light);
  light.intensity = Math.PI * exposure; // of which a white surface reflects 1 / π
  light.position.set(...(lamp.position ?? box.position));
  light.target?.position.copy(light.position).add(new THREE.Vector3(...lamp.direction));
  light.target?.updateMatrixWorld(); // it is not in the scene
  light.castShadow = shadows;
  const lens = light.shadow.camera;
  Object.assign(lens, { near: box.near ?? 0, far: box.far ?? box.depth });
  if (lamp.kind === "directional") {
    const [x, y] = [box.width / 2, box.height / 2];
    Object.assign(lens, { left: -x, right: x, bottom: -y, top: y });
    lens.up.set(...box.up);
  }
  lens.updateProjectionMatrix();
  light.shadow.mapSize.set(params.size, params.size);
  Object.assign(light.shadow, { bias: params.bias, normalBias: params.normal_bias, radius: params.radius });
  renderer.shadowMap.type = FILTERS[params.filter];
  for (const { material } of meshes) {
    material.shadowSide = SIDES[params.cast];
    material.needsUpdate = true;
  }
  const { fov_y, height, aspect, near, far } = pose, half = height / 2;
  const camera = height
    ? new THREE.OrthographicCamera(-aspect * half, aspect * half, half, -half, near, far)
    : new THREE.PerspectiveCamera(fov_y, aspect, near, far);
  camera.position.set(...pose.position);
  camera.up.set(...pose.up);
  camera.lookAt(...pose.target);
  renderer.render(scene, camera);
}
