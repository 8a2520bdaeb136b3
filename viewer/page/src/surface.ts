// The surface's mesh: cells that come one by one, joined to chunks of many, each drawn at once.
import * as THREE from 'three';
import type {SurfaceMessage, SurfacePiece} from './wire.ts';

const CHUNK = 8;          // cells along an edge

const VERTEX = `
  attribute vec3 colour;
  varying vec3 shade;
  varying vec3 facing;
  void main() {
    shade = colour;
    facing = normalMatrix * normal;
    gl_Position = projectionMatrix * (modelViewMatrix * vec4(position, 1.0));
  }`;
// Lit from where one looks: whatever is seen is lit, and slopes are told apart.
const FRAGMENT = `
  varying vec3 shade;
  varying vec3 facing;
  void main() {
    float length2 = dot(facing, facing);
    float light = length2 > 0.0 ? abs(facing.z) * inversesqrt(length2) : 1.0;
    gl_FragColor = vec4(shade * (0.25 + 0.75 * light), 1.0);
  }`;

interface Chunk {
  pieces: Map<string, SurfacePiece>;
  mesh: THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial> | null;
}

export class Surface {
  readonly group = new THREE.Group();
  /** The map part that it is of. */
  part = 0;
  /** Triangles that are drawn. */
  size = 0;
  private readonly material = new THREE.ShaderMaterial({vertexShader: VERTEX, fragmentShader: FRAGMENT, side: THREE.DoubleSide});
  private readonly chunks = new Map<string, Chunk>();
  private readonly stale = new Set<string>();

  clear(): void {
    for (const chunk of this.chunks.values()) this.drop(chunk);
    this.chunks.clear();
    this.stale.clear();
    this.size = 0;
  }

  take(message: SurfaceMessage): void {
    if (message.whole) this.clear();
    this.part = message.part;
    for (const piece of message.pieces) {
      const key = piece.cell.map((at) => Math.floor(at / CHUNK)).join();
      let chunk = this.chunks.get(key);
      if (!chunk) this.chunks.set(key, (chunk = {pieces: new Map(), mesh: null}));
      if (piece.corners.length > 0) chunk.pieces.set(piece.cell.join(), piece);
      else chunk.pieces.delete(piece.cell.join());
      this.stale.add(key);
    }
  }

  /** Makes chunks anew, as many as there is time for, and one in any case. True: there are more. */
  update(budgetMs: number): boolean {
    const end = performance.now() + budgetMs;
    for (const key of this.stale) {
      this.stale.delete(key);
      this.make(this.chunks.get(key)!);
      if (performance.now() > end) break;
    }
    return this.stale.size > 0;
  }

  private drop(chunk: Chunk): void {
    if (!chunk.mesh) return;
    this.size -= chunk.mesh.geometry.getIndex()!.count / 3;
    this.group.remove(chunk.mesh);
    chunk.mesh.geometry.dispose();
    chunk.mesh = null;
  }

  private make(chunk: Chunk): void {
    this.drop(chunk);
    const geometry = join([...chunk.pieces.values()]);
    if (!geometry) return;
    chunk.mesh = new THREE.Mesh(geometry, this.material);
    this.size += geometry.getIndex()!.count / 3;
    this.group.add(chunk.mesh);
  }
}

function join(pieces: SurfacePiece[]): THREE.BufferGeometry | null {
  if (pieces.length === 0) return null;
  const vertices = pieces.reduce((sum, piece) => sum + piece.positions.length / 3, 0);
  const positions = new Float32Array(3 * vertices);
  const normals = new Int8Array(4 * vertices);
  const colours = new Uint8Array(4 * vertices);
  const corners = new Uint32Array(pieces.reduce((sum, piece) => sum + piece.corners.length, 0));
  let vertex = 0;
  let corner = 0;
  for (const piece of pieces) {
    positions.set(piece.positions, 3 * vertex);
    normals.set(piece.normals, 4 * vertex);
    colours.set(piece.colours, 4 * vertex);
    for (const index of piece.corners) corners[corner++] = vertex + index;
    vertex += piece.positions.length / 3;
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
  geometry.setAttribute('normal', new THREE.BufferAttribute(normals, 4, true));
  geometry.setAttribute('colour', new THREE.BufferAttribute(colours, 4, true));
  geometry.setIndex(new THREE.BufferAttribute(corners, 1));
  geometry.computeBoundingSphere();
  return geometry;
}
