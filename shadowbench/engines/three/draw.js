// three.js: https://threejs.org/docs/#api/en/lights/shadows/LightShadow
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

const FILTERS = { basic: THREE.BasicShadowMap, pcf: THREE.PCFShadowMap, vsm: THREE.VSMShadowMap };
const SIDES = { front: THREE.FrontSide, back: THREE.BackSide, both: THREE.DoubleSide };
let renderer, scene, camera, light, materials;

export function open({ canvas, size }) {
  renderer = new THREE.WebGLRenderer({ canvas, antialias: false, preserveDrawingBuffer: true });
  renderer.setPixelRatio(1);
  renderer.setSize(size, size, false);
  renderer.toneMapping = THREE.NoToneMapping;
  return THREE.REVISION;
}

export async function load({ glb, view }) {
  const { scene: root } = await new GLTFLoader().parseAsync(glb, "");
  scene = new THREE.Scene().add(root);
  materials = new Set();
  const own = [];
  root.traverse((node) => {
    if (node.isLight || node.isCamera) own.push(node);
    if (!node.isMesh) return;
    node.castShadow = node.userData.casts ?? true;
    node.receiveShadow = node.userData.receives ?? true;
    materials.add(node.material);
  });
  own.forEach((node) => node.removeFromParent());
  const { fov_y, near, far, position, up, target } = view.camera;
  camera = new THREE.PerspectiveCamera(fov_y, 1, near, far);
  camera.position.set(...position);
  camera.up.set(...up);
  camera.lookAt(...target);
}

export function draw({ light: lamp, box, params, shadows, exposure }) {
  light?.dispose();
  light?.removeFromParent();
  light = lamp.kind === "directional" ? new THREE.DirectionalLight() : lamp.kind === "spot" ? new THREE.SpotLight() : new THREE.PointLight();
  scene.add(light);
  light.intensity = Math.PI * exposure;
  light.castShadow = shadows;
  const { camera: lens, mapSize } = light.shadow;
  if (box) {
    light.position.set(...box.position);
    light.target.position.set(...box.target);
    scene.add(light.target);
    lens.up.set(...box.up);
    Object.assign(lens, { left: -box.width / 2, right: box.width / 2, bottom: -box.height / 2, top: box.height / 2, near: 0, far: box.depth });
    lens.updateProjectionMatrix();
  }
  mapSize.set(params.map_size, params.map_size);
  light.shadow.bias = params.bias;
  light.shadow.normalBias = params.normal_bias;
  renderer.shadowMap.enabled = shadows;
  renderer.shadowMap.type = FILTERS[params.filter];
  for (const material of materials) {
    material.shadowSide = params.cast === "shipped" ? null : SIDES[params.cast];
    material.needsUpdate = true;
  }
  renderer.render(scene, camera);
}
