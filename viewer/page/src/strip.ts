// What each stage of the tracker took, frame by frame, with the budget line.
import uPlot from 'uplot';
import type {Model} from './model.ts';
import type {LiveFrame, PathFrame} from './wire.ts';

const SHOWN = 240;
const STAGES = ['#4e79a7', '#59a14f', '#edc948', '#f28e2b', '#b07aa1', '#76b7b2', '#ff9da7', '#9c755f'];

export class Strip {
  private plot: uPlot | null = null;
  private made = '';
  private top = 1;  // of the scale [ms]

  constructor(private readonly place: HTMLElement, private readonly model: Model) {
    new ResizeObserver(() => this.fit()).observe(place);
  }

  private fit(): void {
    this.plot?.setSize({width: this.place.clientWidth, height: this.place.clientHeight});
  }

  /** Up to `time`, or to the newest: of frames that came live their stages, of others what the tracker took in all. */
  draw(time: number | null): void {
    const isLive = this.model.live.length > 0;
    const frames = isLive ? this.model.live.slice(-SHOWN) : this.timed(time);
    if (this.place.clientWidth === 0 || frames.length < 2) return;
    const stages = isLive ? this.model.hello?.stages ?? [] : ['tracker'];
    const made = `${stages.join()} ${document.documentElement.dataset.theme}`;
    if (this.made !== made) {
      this.plot?.destroy();
      this.plot = this.make(stages);
      this.made = made;
    }
    const budget = this.model.periodMs();
    const work = usual(frames.map((frame) => frame.stageMs.reduce((sum, ms) => sum + ms, 0)));
    const latency = Math.max(work, usual(frames.map((frame) => frame.latencyMs)));  // that of runs without a pace is not known
    const most = budget > 0 ? Math.max(4 * budget, work) : latency;  // frames that queued for seconds shall not flatten all else
    this.top = Math.max(1, 1.3 * budget, 1.15 * Math.min(latency, most));
    this.plot!.setData([
      frames.map((frame) => frame.frame),
      ...this.stacked(frames, stages.length),
      frames.map((frame) => frame.latencyMs),
      frames.map(() => budget),
    ]);
  }

  private timed(time: number | null): (PathFrame & {stageMs: number[]})[] {
    const end = time === null ? this.model.path.length : this.model.indexOf((frame) => frame.t > time);
    return this.model.path.slice(Math.max(0, end - SHOWN), end).map((frame) => ({...frame, stageMs: [frame.trackingMs]}));
  }

  /** Sums of the stages, the largest first, so that each area covers the upper part of the one before. */
  private stacked(frames: Pick<LiveFrame, 'stageMs'>[], stages: number): number[][] {
    const sums: number[][] = [];
    for (let s = stages; s > 0; --s) sums.push(frames.map((frame) => frame.stageMs.slice(0, s).reduce((sum, ms) => sum + ms, 0)));
    return sums;
  }

  private make(stages: string[]): uPlot {
    const style = getComputedStyle(this.place);
    const text = style.getPropertyValue('--faint');
    const grid = {stroke: style.getPropertyValue('--track'), width: 1};
    const areas = stages.map((label, s) => ({label, fill: STAGES[s], stroke: STAGES[s], width: 0, points: {show: false}})).reverse();
    return onSoftwareCanvas(() => new uPlot({
      width: this.place.clientWidth,
      height: this.place.clientHeight,
      legend: {show: false},
      cursor: {show: false},
      scales: {x: {time: false}, y: {range: () => [0, this.top]}},
      axes: [
        {stroke: text, grid, ticks: {show: false}, size: 22, font: '10px system-ui', gap: 2, values: (_, frames) => frames.map((frame, n) => (n === 1 ? `frame ${frame}` : `${frame}`))},
        {stroke: text, grid, ticks: {show: false}, size: 44, font: '10px system-ui', gap: 2, values: (_, ms) => ms.map((x) => `${x} ms`)},
      ],
      series: [
        {}, ...areas,
        {label: 'exposure to pose', stroke: style.getPropertyValue('--text'), width: 1.5, points: {show: false}},
        {label: 'budget', stroke: '#ff5a5f', width: 1.5, dash: [6, 4], points: {show: false}},
      ],
    }, [[0], ...stages.map(() => [0]), [0], [0]], this.place));
  }

  static legend(stages: string[]): [string, string][] {
    return stages.map((name, s) => [name, STAGES[s]]);
  }
}

/**
 * uPlot makes its canvas itself, with a context that the graphics processor draws; where there is none, whoever draws waits until the big
 * picture is through, for seconds while its shaders are compiled. Plots are small: here the context is one that waits for nobody.
 */
function onSoftwareCanvas(make: () => uPlot): uPlot {
  const {prototype} = HTMLCanvasElement;
  const asBefore = prototype.getContext as (this: HTMLCanvasElement, kind: string, options?: object) => RenderingContext | null;
  prototype.getContext = function (this: HTMLCanvasElement, kind: string) {
    return asBefore.call(this, kind, {willReadFrequently: true});
  } as typeof prototype.getContext;
  try {
    return make();
  } finally {
    prototype.getContext = asBefore as typeof prototype.getContext;
  }
}

/** Nineteen out of twenty are less: a spike shall not flatten everything else. */
function usual(values: number[]): number {
  return [...values].sort((a, b) => a - b)[Math.floor(0.95 * (values.length - 1))];
}
