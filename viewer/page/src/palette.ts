// Colours, of both themes; style.css shows the same in the legend.
import * as THREE from 'three';

export interface Palette {
  background: THREE.Color;
  grid: THREE.Color;
  camera: THREE.Color;
  final: THREE.Color;
  causal: THREE.Color;
  truth: THREE.Color;
  inner: THREE.Color;
  outer: THREE.Color;
  keyframe: THREE.Color;
  selected: THREE.Color;
  covisible: THREE.Color;
  marginalised: THREE.Color;
  back: THREE.Color;
  measure: THREE.Color;
}

export const EVENT_COLOURS: Record<string, string> = {
  'optimisation': '#8f9bb3',
  'loop': '#ffd166',
  'loop closure': '#ff5a5f',
  'pose graph': '#b388ff',
  'parts joined': '#00c2a8',
  'relocalisation': '#ffb000',
  'new part': '#ff8cc6',
  'lost': '#ff3b30',
  'late': '#f28e2b',
  'map saved': '#6ac8ff',
  'mapping paused': '#6ac8ff',
  'mapping resumed': '#6ac8ff',
  'run stopped': '#6ac8ff',
  'command failed': '#ff3b30',
};

export function eventColour(kind: string): string {
  return EVENT_COLOURS[kind] ?? '#8f9bb3';
}

function palette(names: Record<keyof Palette, string>): Palette {
  return Object.fromEntries(Object.entries(names).map(([name, hex]) => [name, new THREE.Color(hex)])) as unknown as Palette;
}

export const PALETTES = {
  dark: palette({
    background: '#0e1116', grid: '#232a35', camera: '#ffffff', final: '#2ee6a6', causal: '#ff6b9d', truth: '#9aa4b2',
    inner: '#ffb000', outer: '#3d9bff', keyframe: '#6b7a92', selected: '#ffffff', covisible: '#56657c',
    marginalised: '#9b7bff', back: '#ff5a5f', measure: '#fff36b',
  }),
  light: palette({
    background: '#f6f7f9', grid: '#d5dae2', camera: '#101418', final: '#00895e', causal: '#d6336c', truth: '#6b7686',
    inner: '#d97700', outer: '#1463d8', keyframe: '#a2abb9', selected: '#000000', covisible: '#9fb0c6',
    marginalised: '#7a4df0', back: '#d92d20', measure: '#b58900',
  }),
};
export type Theme = keyof typeof PALETTES;
