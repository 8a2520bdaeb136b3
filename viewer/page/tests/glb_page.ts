// A page of glb.mjs: reads both mesh files of a run as others read them, holds them against each other, and draws the GLB.
import * as THREE from 'three';
import {GLTFLoader} from 'three/addons/loaders/GLTFLoader.js';
import {PLYLoader} from 'three/addons/loaders/PLYLoader.js';

type Triple = [number, number, number];
type Attribute = THREE.BufferAttribute | THREE.InterleavedBufferAttribute | undefined;

const STEEP = 0.7;  // of a triangle's normal along y: it looks up or down

const renderer = new THREE.WebGLRenderer({antialias: true, preserveDrawingBuffer: true});
renderer.setSize(innerWidth, innerHeight);
document.body.append(renderer.domElement);

/** The largest difference of two attributes' first three components; infinite where one is missing or shorter. */
function apart(a: Attribute, b: Attribute): number {
  if (!a || !b || a.count !== b.count) return Infinity;
  let most = 0;
  for (let n = 0; n < a.count; ++n) for (let k = 0; k < 3; ++k) most = Math.max(most, Math.abs(a.getComponent(n, k) - b.getComponent(n, k)));
  return most;
}

/** Of the mesh as it stands in the scene: how many triangles look up, and at what height; how many down; the share, by area, that goes round as normals say. */
function facing(mesh: THREE.Mesh) {
  const {position, normal} = mesh.geometry.attributes;
  const index = mesh.geometry.index!;
  const [a, b, c, across, other] = Array.from({length: 5}, () => new THREE.Vector3());
  const up: number[] = [];
  let [down, area, agree] = [0, 0, 0];
  for (let i = 0; i < index.count; i += 3) {
    const corners = [a, b, c].map((corner, k) => corner.fromBufferAttribute(position, index.getX(i + k)).applyMatrix4(mesh.matrixWorld));
    across.subVectors(b, a).cross(other.subVectors(c, a));
    const size = across.length();
    across.divideScalar(size || 1);
    area += size;
    if (across.y > STEEP) up.push(corners.reduce((sum, corner) => sum + corner.y / 3, 0));
    if (across.y < -STEEP) ++down;
    other.fromBufferAttribute(normal, index.getX(i)).transformDirection(mesh.matrixWorld);
    if (across.dot(other) > 0) agree += size;
  }
  up.sort((x, y) => x - y);
  return {up: up.length, down, height: up[up.length >> 1], agree: agree / area};
}

function draw(scene: THREE.Object3D, box: THREE.Box3) {
  const stage = new THREE.Scene();
  stage.background = new THREE.Color('#202830');
  const light = new THREE.DirectionalLight('#ffffff', 1.5);
  light.position.set(1, 3, 2);
  stage.add(scene, light, new THREE.HemisphereLight('#ffffff', '#808080', 2));
  const camera = new THREE.PerspectiveCamera(40, innerWidth / innerHeight, 0.01, 100);
  const middle = box.getCenter(new THREE.Vector3());
  camera.position.set(0.6, 0.7, 1).normalize().multiplyScalar(1.2 * box.getSize(new THREE.Vector3()).length()).add(middle);
  camera.lookAt(middle);
  renderer.render(stage, camera);
}

async function look(folder: string, up: Triple) {
  const {scene} = await new GLTFLoader().loadAsync(`${folder}/surface.glb`);
  const ply = await new PLYLoader().loadAsync(`${folder}/surface.ply`);
  const meshes: THREE.Mesh[] = [];
  scene.updateMatrixWorld(true);
  scene.traverse((object) => object instanceof THREE.Mesh && meshes.push(object));
  const [mesh] = meshes;
  const {position, normal, color} = mesh.geometry.attributes;
  const box = new THREE.Box3().setFromObject(scene, true);
  draw(scene, box);
  const colour = [0, 0, 0];
  for (let n = 0; n < color.count; ++n) for (let k = 0; k < 3; ++k) colour[k] += color.getComponent(n, k) / color.count;
  return {
    meshes: meshes.length,
    metal: (mesh.material as THREE.MeshStandardMaterial).metalness,
    triangles: mesh.geometry.index!.count / 3,
    vertices: position.count,
    // From what the PLY file of the same run has.
    apart: {
      positions: apart(position, ply.attributes.position),
      normals: apart(normal, ply.attributes.normal),
      colours: apart(color, ply.attributes.color),
      triangles: apart(triples(mesh.geometry), triples(ply)),
    },
    colour,
    up: new THREE.Vector3(...up).transformDirection(mesh.matrixWorld).toArray(),
    box: {min: box.min.toArray(), size: box.getSize(new THREE.Vector3()).toArray()},
    facing: facing(mesh),
  };
}

function triples(geometry: THREE.BufferGeometry): Attribute {
  return geometry.index ? new THREE.BufferAttribute(geometry.index.array, 3) : undefined;
}

/** A grey picture in the shades of a colour: the bytes of a PNG file, base64. */
async function tinted(file: string, colour: string) {
  const picture = await createImageBitmap(await (await fetch(file)).blob());
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [picture.width, picture.height];
  const context = canvas.getContext('2d')!;
  context.drawImage(picture, 0, 0);
  context.globalCompositeOperation = 'multiply';
  context.fillStyle = colour;
  context.fillRect(0, 0, canvas.width, canvas.height);
  return canvas.toDataURL('image/png').split(',')[1];
}

Object.assign(window, {look, tinted});
