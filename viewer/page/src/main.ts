// The page: joins connection, model and picture, and what the user does with them.
import 'uplot/dist/uPlot.min.css';
import './style.css';
import {COLOURINGS, colourBar, type Colouring} from './cloud.ts';
import {Connection, type Command, type Link} from './connection.ts';
import {Model} from './model.ts';
import {eventColour, type Theme} from './palette.ts';
import {Sight} from './sight.ts';
import {Stage, contextOf, type Layer, type View} from './stage.ts';
import {Strip} from './strip.ts';
import {Timeline, clock, describe, lateStretches, lateTally, length, lostStretches, tally, type Tally} from './timeline.ts';
import {NO_ID, PROTOCOL, State, type Binary, type Keyframe, type KeyframeImage, type LiveFrame, type MapEvent, type Text} from './wire.ts';

const $ = <T extends HTMLElement>(id: string): T => document.getElementById(id) as T;

/** An element with text and children; what a user or file named is never taken for HTML. */
function make(tag: string, text = '', ...children: Node[]): HTMLElement {
  const element = document.createElement(tag);
  element.textContent = text;
  element.append(...children);
  return element;
}

const LAYERS: [Layer | 'image', string, string][] = [
  ['points', 'Points', ''], ['surface', 'Surface', ''], ['keyframes', 'Keyframes', '--keyframe'], ['final', 'Final path', '--final'],
  ['causal', 'Causal path', '--causal'], ['truth', 'True path', '--truth'], ['covisible', 'Covisibility', '--covisible'],
  ['marginalised', 'Marginalised', '--marginalised'], ['returns', 'Closed loops', '--back'], ['grid', 'Grid', ''],
  ['image', 'Camera image', ''],
];
const KEYS: [string, string][] = [
  ['drag', 'turn; right button or two fingers: move; wheel or pinch: zoom'],
  ['1 2 3', 'follow, from above, free'], ['space', 'play or stop'], ['← →', 'a second back, on'], ['end', 'now'],
  ['M', 'measure between two points'], ['P K C E', 'points, keyframes, causal path, edges'], ['I', 'camera image'],
  ['S', 'save a picture'], ['F', 'full screen'], ['T', 'dark or light'], ['esc', 'let go of what is selected'], ['H', 'these keys'],
];
const PERIODIC_MS = 200;
const MOST_LISTED = 100;  // events
const SILENT_S = 2;       // without a frame

/** Of the panel that says how the engine is doing. */
interface Line {
  name: string;
  value: string;
  /** What that means. */
  why: string;
  /** Left out where there is little room. */
  minor?: boolean;
  bad?: boolean;
}

/** Frames of a recording are read before their time has come. */
function queueLines(newest: LiveFrame, isReadAhead: boolean): Line[] {
  const queues: [string, number | null, string, string][] = [
    ['tracker', newest.framesWaiting, 'frame', isReadAhead ? ', read ahead' : ''],
    ['mapper', newest.keyframesWaiting, 'keyframe', ''], ['loop closer', newest.placesWaiting, 'keyframe', '']];
  return queues.flatMap(([thread, length, what, when]) => (length === null ? [] : [{
    name: `${thread}’s queue`, value: `${length} ${what}${length === 1 ? '' : 's'}${when}`,
    why: `${what}s that wait for the ${thread}${when ? ', or for their time to come' : ''}`}]));
}

function troubleLine(name: string, {frames, commonest}: Tally, why: string): Line {
  return {name, value: frames === 0 ? 'none' : `${frames.toLocaleString('en')}${commonest ? `: ${commonest}` : ''}`, why, bad: frames > 0};
}

/** By the queue, and by the camera, where anybody counts those. */
function droppedLine(dropped: number, lost: number | null): Line {
  const byCamera = lost === null ? '' : `, ${lost.toLocaleString('en')} lost by the camera`;
  return {name: 'dropped', value: `${dropped === 0 ? 'none' : dropped.toLocaleString('en')}${byCamera}`,
    why: 'frames that were never tracked: a newer one was there, or no room to wait; lost by the camera: they never came from its driver',
    bad: dropped + (lost ?? 0) > 0};
}

class Page {
  // First, so that the server answers while WebGL is being set up. Nothing is heard before the page has been made.
  private readonly connection = new Connection({
    binary: (message) => this.take(message),
    text: (message) => this.read(message),
    link: (state, message) => this.showLink(state, message),
    fault: (error) => showFault(error),
  });
  readonly model = new Model();
  readonly stage: Stage;
  readonly strip = new Strip($('strip'), this.model);
  readonly timeline = new Timeline($('timeline'), $('tip'), this.model);
  readonly sight: Sight;
  private link: Link = 'connecting';
  private measuring = false;
  private playing = 0;
  private stale = true;
  private part: number | 'camera' | 'all' = 'camera';

  constructor(context: WebGL2RenderingContext) {
    this.stage = new Stage($('stage'), context, this.model);
    this.sight = new Sight($('sight'), this.model, this.stage.cloud);
    history.replaceState(null, '', '/');  // the token is in a cookie by now, and needs no second place
    this.makePanels();
    this.listen();
    const wish = matchMedia('(prefers-color-scheme: light)').matches ? 'light' : 'dark';
    this.setTheme((localStorage.getItem('theme') as Theme | null) ?? wish);
    setInterval(() => this.refresh(), PERIODIC_MS);
  }

  private take(message: Binary): void {
    if (message.kind === 'keyframe image') {
      this.showKeyframeImage(message);
    } else if (message.kind === 'image') {
      this.sight.take(message);
    } else if (message.kind === 'surface') {
      this.stage.surface.take(message);
      this.stage.redraw();
    } else if (message.kind === 'measured') {
      this.sight.takeMeasured(message);
    } else if (message.kind === 'frames') {
      this.model.addLive(message.frames);
      this.stage.redraw();
    } else {
      if (message.whole) this.stage.cloud.clear();
      this.model.take(message);
      this.stage.cloud.take(message.points, message.pointsGone);
      const isPathAlone = !message.whole && message.points.length + message.keyframes.length + message.edges.length +
        message.pointsGone.length + message.keyframesGone.length + message.edgesGone.length === 0;
      if (isPathAlone) this.stage.pathGrew();
      else this.stage.changed();
    }
    this.stale = true;
  }

  private read(message: Text): void {
    if (message.hello) {
      this.model.forget();
      this.stage.surface.clear();  // of the run before this one
      this.model.hello = message.hello;
      if (!speaksTheSame(message.hello.protocol)) return;
      document.title = `${message.hello.title} – Twofold`;
      $('title').textContent = $('title').title = message.hello.title;
      document.body.classList.toggle('finished', message.hello.kind === 'map' || !message.hello.hasTimes);
      $('no-events').textContent = message.hello.kind === 'live' ? 'none yet' : 'none';
      this.makeStages();
      this.nameKeyframes(message.hello.kind === 'live');
      this.makeColours();
      this.hideWhatIsNot();
      $('commands').hidden = !message.hello.control;
    }
    if (message.state) {
      this.model.mappingPaused = message.state.mappingPaused;
      $('pause-mapping').setAttribute('aria-pressed', String(this.model.mappingPaused));
      $('pause-mapping').textContent = this.model.mappingPaused ? 'Resume mapping' : 'Pause mapping';
    }
    if (message.reasons) this.model.reasons = message.reasons;
    if (message.truth) {
      this.model.truth = message.truth;
      const {scale} = message.truth;
      $('name-truth').textContent = scale === 1 ? 'True path' : `True path × ${scale.toPrecision(3)}`;
      this.hideWhatIsNot();
    }
    if (message.events) {
      this.model.addEvents(message.events);
      this.makeEvents();
    }
    this.stage.changed();
    this.stale = true;
  }

  private showLink(state: Link, message: string): void {
    this.link = state;
    if (state === 'ended') {
      this.stage.cloud.settle();
      this.stage.changed();
    }
    if (state === 'ended') $('commands').hidden = true;
    $('message').textContent = message;
    $('message').hidden = state === 'open';
    $('message').classList.toggle('calm', state === 'ended');
    this.stale = true;
  }

  /** Whatever is text, a few times a second. */
  private refresh(): void {
    if (this.stage.drawn === 0) return;  // the picture comes first
    this.sight.draw();
    if (this.playing) this.play();
    if (this.silence() > 0) this.stale = true;
    // Pieces become chunks between two pictures, also when no message comes any more.
    if ($('layer-surface').parentElement!.hidden === this.stage.surface.size > 0) this.stale = true;
    if (!this.stale) return;
    this.stale = false;
    this.choosePart();
    this.showState();
    this.showFigures();
    this.showEngine();
    if ($('strip').clientWidth > 0) this.strip.draw(this.stage.time);
    this.timeline.draw();
    this.showKeyframe();
    this.showTape();
    this.showBar();
    this.hideWhatIsNot();
    document.body.dataset.ready = String(this.model.keyframes.size > 0);
  }

  /** Parts have worlds of their own: shown is the camera's, one that was chosen, or all at once. */
  private choosePart(): void {
    const parts = this.model.parts();
    $('part-row').hidden = parts.length < 2;
    const select = $<HTMLSelectElement>('part');
    const wanted = ['camera', 'all', ...parts.map(([part]) => String(part))];
    if ([...select.options].map((option) => option.value).join() !== wanted.join()) {
      select.replaceChildren(new Option('the camera’s', 'camera'), new Option('all, unrelated', 'all'),
        ...parts.map(([part, keyframes]) => new Option(`${part} (${keyframes} keyframes)`, String(part))));
      select.value = String(this.part);
    }
    const camera = this.stage.pose()?.part ?? parts[0]?.[0] ?? null;
    const shown = this.part === 'all' || parts.length < 2 ? null : this.part === 'camera' ? camera : this.part;
    if (shown === this.stage.part) return;
    this.stage.part = shown;
    this.stage.changed();
  }

  private showState(): void {
    const pill = $('state');
    const newest = this.model.live.at(-1);
    const set = (text: string, kind: string) => {
      pill.textContent = pill.title = text;
      pill.className = `pill ${kind}`;
    };
    if (this.link === 'connecting') return set('connecting', '');
    if (this.link === 'broken') return set('no connection', 'bad');
    const kind = this.model.hello?.kind ?? 'live';
    if (this.stage.time !== null) return set(`at ${clock(this.stage.time)}: back to ${kind === 'live' ? 'now' : 'the end'}`, 'middling');
    if (kind === 'map') return set('map file', '');
    if (kind === 'finished') return set('finished', '');
    if (this.link === 'ended') return set('ended', '');
    if (!newest) return set('waiting for frames', '');
    if (newest.state !== State.tracked) {
      const name = newest.state === State.lost ? 'lost' : 'unplaced';
      const reason = this.model.reasons[newest.reason];
      return set(reason ? `${name}: ${reason}` : name, 'bad');
    }
    if (newest.effort === 0) return set('tracked', 'good');
    const efforts = this.model.hello?.efforts ?? [];
    const saved = efforts.slice(1, newest.effort + 1);
    set(`tracked, saving work (${newest.effort} of ${Math.max(newest.effort, efforts.length - 1)})`, 'middling');
    pill.title = `effort level ${newest.effort} of ${Math.max(newest.effort, efforts.length - 1)}, because poses came late: ${saved.join('; ')}`;
  }

  /** Seconds for which a run that goes on has told no frame; 0: none that are worth a word. */
  private silence(): number {
    const {liveAt, hello} = this.model;
    if (liveAt === null || hello?.kind !== 'live' || this.link !== 'open') return 0;
    const seconds = (performance.now() - liveAt) / 1000;
    return seconds > SILENT_S ? seconds : 0;
  }

  private showFigures(): void {
    const {hello, path} = this.model;
    const count = (n: number) => n.toLocaleString('en');
    const figures: [string, string][] = [['keyframes', count(this.model.keyframes.size)], ['points', count(this.stage.cloud.size)]];
    if (hello?.kind !== 'map') figures.unshift(['frame', count(this.model.live.at(-1)?.frame ?? path.at(-1)?.frame ?? 0)]);
    $('figures').replaceChildren(...figures.map(([name, value]) => make('div', '', make('dt', name), make('dd', value))));
  }

  /** How the engine is doing, in words: how far behind, what waits for which thread, what was left out and why. */
  private showEngine(): void {
    const {hello, live} = this.model;
    const newest = live.at(-1);
    const lines: Line[] = [];
    if (hello?.kind === 'live' && newest) lines.push(this.lagLine(newest), ...queueLines(newest, hello.pacedBy === 'recording'));
    const late = lateTally(this.model);
    const lost = tally(lostStretches(this.model));
    lines.push(troubleLine('late', late, 'poses that came when the next frame was there already; beside their number, why most of them did'));
    lines.push(troubleLine('lost', lost, 'frames without a pose; beside their number, why most of them have none'));
    const dropped = newest?.framesDropped ?? this.model.path.reduce((sum, frame) => sum + (frame.state === State.dropped ? 1 : 0), 0);
    lines.push(droppedLine(dropped, newest?.framesLost ?? null));
    if (newest && newest.effort > 0) lines.push({name: 'saves work', value: hello?.efforts[newest.effort] ?? `effort level ${newest.effort}`, why: 'what the tracker leaves out last, because poses came late', bad: true});
    if (newest) lines.push({name: 'points found', value: `${(100 * newest.trackedShare).toFixed(0)} %`, why: 'of the points of the map that were searched in the newest frame', minor: true});
    $('engine').replaceChildren(...lines.map((line) => {
      const item = make('div', '', make('dt', line.name), make('dd', line.value));
      item.title = `${line.value}: ${line.why}`;
      item.dataset.name = line.name;
      item.classList.toggle('minor', line.minor ?? false);
      item.classList.toggle('bad', line.bad ?? false);
      return item;
    }));
  }

  private lagLine(newest: LiveFrame): Line {
    const {hello} = this.model;
    const period = this.model.periodMs();
    const silence = this.silence();
    const took = newest.latencyMs < 1000 ? `${newest.latencyMs.toFixed(1)} ms` : `${(newest.latencyMs / 1000).toFixed(1)} s`;
    if (!hello?.pacedBy) return {name: silence ? 'no frame for' : 'pose after', value: silence ? `${silence.toFixed(0)} s` : took, why: 'from when the newest frame was taken up to its pose; nobody said that this run keeps a pace'};
    const name = `behind the ${hello.pacedBy}`;
    if (silence) return {name, value: `no frame for ${silence.toFixed(0)} s`, why: 'no pose has come for that long', bad: true};
    const frames = period > 0 ? `, ${(newest.latencyMs / period).toFixed(1)} frames` : '';
    const late = period > 0 && newest.latencyMs > period;
    // None waits beside it: the tracker was there before the frame was.
    const work = newest.stageMs.reduce((sum, ms) => sum + ms, 0);
    const slow = late && newest.framesWaiting === 0 && newest.latencyMs > 2 * work ? ': frames come late' : '';
    return {name, value: took + frames + slow, why: 'from the exposure of the newest frame to its pose; above one frame it is late. Frames that come late are slow to be read, decoded or rendered', bad: late};
  }

  private makePanels(): void {
    $('layers').replaceChildren(...LAYERS.map(([layer, name, colour]) => {
      const sample = make('i');
      if (colour) sample.style.background = `var(${colour})`;
      const box = document.createElement('input');
      box.type = 'checkbox';
      box.id = `layer-${layer}`;
      box.checked = true;
      box.addEventListener('change', () => this.setLayer(layer, box.checked));
      const words = make('span', name);
      words.id = `name-${layer}`;
      return make('label', '', sample, words, box);
    }));
    $('colouring').replaceChildren(...COLOURINGS.map((name) => new Option(name === 'observers' ? 'times seen' : name, name)));
    $('keys').replaceChildren(make('table', '', ...KEYS.map(([key, what]) => make('tr', '', make('td', '', make('kbd', key)), make('td', what)))));
    $('bar-colours').style.background = colourBar();
    const windows = make('small', 'window', ...['inner', 'outer', 'neither'].map((name) => {
      const word = make('b', name);
      word.className = name;
      return word;
    }));
    windows.id = 'windows';
    $('layer-keyframes').parentElement!.after(windows);
    this.nameKeyframes(true);
    this.setLayer('image', true);
    this.setView('follow');
  }

  /** Windows are a live run's: nobody knows those of a finished one. */
  private nameKeyframes(areLive: boolean): void {
    $('windows').hidden = !areLive;
    const sample = $('layer-keyframes').parentElement!.querySelector('i')!;
    sample.className = areLive ? 'three' : '';
    sample.style.background = areLive ? '' : 'var(--keyframe)';
  }

  private setLayer(layer: Layer | 'image', on: boolean): void {
    $<HTMLInputElement>(`layer-${layer}`).checked = on;
    if (layer === 'image') {
      this.connection.setImages(on);
      this.sight.setOn(on);
      return;
    }
    this.stage.layers[layer] = on;
    this.stage.changed();
  }
  private toggle(...layers: (Layer | 'image')[]): void {
    for (const layer of layers) this.setLayer(layer, !$<HTMLInputElement>(`layer-${layer}`).checked);
  }

  private makeStages(): void {
    const entry = (name: string, set: (sample: HTMLElement) => void) => {
      const sample = make('i');
      set(sample);
      return make('li', '', sample, make('span', name));
    };
    $('stages').replaceChildren(
      entry('exposure to pose', (i) => ((i.className = 'line'), (i.style.background = 'var(--text)'))),
      entry('budget', (i) => (i.className = 'dash')),
      ...Strip.legend(this.model.hello!.kind === 'live' ? this.model.hello!.stages : ['tracker']).map(([name, colour]) => entry(name, (i) => (i.style.background = colour))));
  }

  /** Colours that there is something for. */
  private makeColours(): void {
    const {hasDeviations, hasFirstSeen, hasObservers} = this.model.hello!;
    const known: Record<Colouring, boolean> = {height: true, part: true, age: hasFirstSeen, observers: hasObservers, deviation: hasDeviations};
    const select = $<HTMLSelectElement>('colouring');
    for (const option of select.options) option.disabled = option.hidden = !known[option.value as Colouring];
    if (!known[select.value as Colouring]) {
      select.value = 'height';
      this.stage.cloud.setColouring('height');
    }
  }

  /** Layers of which there is nothing are not offered. */
  private hideWhatIsNot(): void {
    const hello = this.model.hello;
    const edges = [...this.model.edges.values()];
    const has: Partial<Record<Layer | 'image', boolean>> = {
      causal: hello?.kind !== 'map', truth: this.model.truth !== null, image: hello?.kind === 'live',
      surface: this.stage.surface.size > 0,
      marginalised: edges.some((edge) => edge.marginalised), returns: edges.some((edge) => edge.loop > 0),
    };
    for (const [layer, there] of Object.entries(has)) $(`layer-${layer}`).parentElement!.hidden = !there;
  }

  /** What the lowest and the highest colour stand for. */
  private showBar(): void {
    const unit = this.model.isMetric ? ' m' : '';
    const [low, high] = this.stage.cloud.heights;
    const times = [...this.model.keyframes.values()].map((keyframe) => keyframe.t);
    const ends: Record<Colouring, [string, string] | null> = {
      height: [`${low.toFixed(1)}${unit}`, `${high.toFixed(1)}${unit} up`], part: null, observers: ['0', '20 times'],
      age: [clock(Math.min(...times, Infinity) || 0), clock(Math.max(...times, 0))],
      deviation: [this.model.isMetric ? '4 mm' : '0.004', this.model.isMetric ? '4 m' : '4'],
    };
    const shown = ends[$<HTMLSelectElement>('colouring').value as Colouring];
    $('bar').hidden = shown === null || this.stage.cloud.size === 0 || !this.stage.layers.points;
    if (!shown) return;
    $('bar-low').textContent = shown[0];
    $('bar-high').textContent = shown[1];
  }

  private makeEvents(): void {
    const listed = mostTelling(this.model.events, MOST_LISTED);
    $('no-events').hidden = listed.length > 0;
    $('more-events').hidden = listed.length === this.model.events.length;
    $('more-events').textContent = `and ${(this.model.events.length - listed.length).toLocaleString('en')} smaller ones, on the time line`;
    $('events').replaceChildren(...listed.map((event) => {
      const sample = make('i');
      sample.style.background = eventColour(event.kind);
      const [kind, ...rest] = describe(event, this.model.isMetric).split(' · ');
      const item = make('li', '', sample, make('div', kind, make('small', rest.join(' · '))), make('time', clock(event.t)));
      item.addEventListener('click', () => this.goTo(event));
      return item;
    }));
  }

  private goTo(event: MapEvent): void {
    this.timeline.set(event.t);
    this.setView('free');
    this.stage.event = event;
    this.stage.lookAt(event.after);
  }

  private setView(view: View): void {
    this.stage.setView(view);
    for (const button of document.querySelectorAll<HTMLButtonElement>('#views button')) button.classList.toggle('on', button.dataset.view === view);
  }
  private setTheme(theme: Theme): void {
    document.documentElement.dataset.theme = theme;
    localStorage.setItem('theme', theme);
    $('theme').textContent = theme === 'dark' ? 'Light' : 'Dark';
    this.stage.setTheme(theme);
    this.stale = true;
  }

  private command(command: Command): void {
    if (command === 'stop' && !confirm('End the run?')) return;
    this.connection.command(command);
  }

  private showKeyframe(): void {
    const keyframe = this.stage.selected === null ? undefined : this.model.keyframes.get(this.stage.selected);
    $('keyframe').hidden = !keyframe;
    if (!keyframe) return;
    const row = (name: string, value: string) => make('tr', '', make('td', name), make('td', value));
    const neighbours = this.model.neighbours(keyframe.id).sort((a, b) => b.sharedPoints - a.sharedPoints);
    const jump = neighbours.slice(0, 8).map((edge) => {
      const other = edge.from === keyframe.id ? edge.to : edge.from;
      const button = make('button', `${other} · ${edge.sharedPoints}`);
      button.title = `${edge.marginalised ? 'marginalised' : 'covisible'}, ${edge.sharedPoints} shared points`;
      button.addEventListener('click', () => this.select(other));
      return button;
    });
    const isLive = this.model.hello?.kind === 'live';  // others may not know all of it
    const frame = keyframe.frame === NO_ID ? 'of the loaded map' : `${keyframe.frame}, ${clock(keyframe.t)}`;
    const rows = [row('frame', frame), row('position', keyframe.position.map((x) => x.toFixed(2)).join(', ')),
      row('map part', String(keyframe.part)), row('neighbours', String(neighbours.length))];
    if (isLive) rows.push(row('window', ['neither', 'inner', 'outer'][keyframe.window]));
    if (isLive || keyframe.points > 0) rows.push(row('points it sees', String(keyframe.points)), row('can be recognised', keyframe.hasPlace ? 'yes' : 'no'));
    $('keyframe-text').replaceChildren(
      make('h2', `Keyframe ${keyframe.id}`),
      make('table', '', ...rows),
      make('p', '', ...jump));
  }
  private select(id: number | null): void {
    if (id === this.stage.selected) return;
    $('keyframe-image').hidden = $('no-keyframe-image').hidden = true;
    if (id !== null && this.model.hello?.keyframeImages) this.connection.askForKeyframe(id);
    this.stage.selected = id;
    this.stage.changed();
    this.stale = true;
  }

  /** If that keyframe is still the one that is selected. */
  private showKeyframeImage(image: KeyframeImage): void {
    if (image.keyframe !== this.stage.selected) return;
    const place = $<HTMLImageElement>('keyframe-image');
    $('no-keyframe-image').hidden = image.jpeg.length > 0;
    if (image.jpeg.length === 0) return;
    URL.revokeObjectURL(place.src);
    place.src = URL.createObjectURL(new Blob([image.jpeg], {type: 'image/jpeg'}));
    place.hidden = false;
  }

  private showTape(): void {
    const [from, to] = this.stage.measured;
    $('tape').hidden = !this.measuring;
    $('tape').textContent = !from ? 'click the first point' : !to ? 'click the second point' : length(from.distanceTo(to), this.model.isMetric);
  }
  private setMeasuring(on: boolean): void {
    this.measuring = on;
    this.stage.measured = [];
    $('measure').setAttribute('aria-pressed', String(on));
    $('stage').classList.toggle('measuring', on);
    this.stage.changed();
    this.stale = true;
  }

  private click(x: number, y: number): void {
    if (!this.measuring) {
      const picked = this.stage.pick(x, y, 'keyframe');
      this.select(picked && 'keyframe' in picked ? picked.keyframe.id : null);
      if (picked) $('side').classList.add('open');
      return;
    }
    const picked = this.stage.pick(x, y, 'point');
    if (!picked || !('point' in picked)) return;
    if (this.stage.measured.length === 2) this.stage.measured = [];
    this.stage.measured.push(picked.point);
    this.stage.changed();
    this.stale = true;
  }

  /** From an earlier moment, and from where an event was looked at. */
  private backToNow(): void {
    if (this.stage.time === null) return;
    this.timeline.set(null);
    this.setView('follow');
  }

  private savePicture(): void {
    this.stage.picture((blob) => {
      if (!blob) return;
      const link = document.createElement('a');
      link.href = URL.createObjectURL(blob);
      link.download = `twofold-${this.model.live.at(-1)?.frame ?? 'map'}.png`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  }

  private setPlaying(on: boolean): void {
    this.playing = on ? performance.now() : 0;
    if (on && this.stage.time === null) this.timeline.set(0);
    $('play').textContent = on ? '❚❚' : '▶';
  }
  /** At the run's own pace; longer ones so that half a minute shows all. */
  private play(): void {
    const now = performance.now();
    const speed = Math.max(1, this.model.endTime() / 30);
    this.timeline.move((speed * (now - this.playing)) / 1000);
    this.playing = now;
    if (this.stage.time === null) this.setPlaying(false);
  }

  private listen(): void {
    this.timeline.onTime = (time) => {
      this.stage.time = time;
      this.stage.event = null;
      this.stage.changed();
      this.stale = true;
    };
    this.timeline.onEvent = (event) => this.goTo(event);
    for (const button of document.querySelectorAll<HTMLButtonElement>('#views button'))
      button.addEventListener('click', () => this.setView(button.dataset.view as View));
    $('colouring').addEventListener('change', () => {
      this.stage.cloud.setColouring($<HTMLSelectElement>('colouring').value as Colouring);
      this.stage.redraw();
      this.stale = true;
    });
    $('size').addEventListener('input', () => {
      this.stage.cloud.setPointSize(Number($<HTMLInputElement>('size').value));
      this.stage.redraw();
    });
    $('part').addEventListener('change', () => {
      const value = $<HTMLSelectElement>('part').value;
      this.part = value === 'camera' || value === 'all' ? value : Number(value);
      this.stale = true;
    });
    const on = (id: string, act: () => void) => $(id).addEventListener('click', act);
    on('sight', () => this.sight.toggleSize());
    on('measure', () => this.setMeasuring(!this.measuring));
    on('shot', () => this.savePicture());
    on('full', () => void (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen()));
    on('theme', () => this.setTheme(document.documentElement.dataset.theme === 'dark' ? 'light' : 'dark'));
    on('help', () => $<HTMLDialogElement>('keys').showModal());
    on('keys', () => $<HTMLDialogElement>('keys').close());
    on('save-map', () => this.command('save map'));
    on('pause-mapping', () => this.command(this.model.mappingPaused ? 'resume mapping' : 'pause mapping'));
    on('stop', () => this.command('stop'));
    on('now', () => this.timeline.set(null));
    on('state', () => this.backToNow());
    on('play', () => this.setPlaying(!this.playing));
    on('open-show', () => $('show').classList.toggle('open'));
    on('open-side', () => $('side').classList.toggle('open'));
    this.listenToPointer();
    addEventListener('keydown', (event) => this.key(event));
  }

  /** A click is a press that hardly moved. */
  private listenToPointer(): void {
    let at = [0, 0];
    $('stage').addEventListener('pointerdown', (event) => (at = [event.offsetX, event.offsetY]));
    $('stage').addEventListener('pointerup', (event) => {
      if (Math.hypot(event.offsetX - at[0], event.offsetY - at[1]) < 5) this.click(event.offsetX, event.offsetY);
    });
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target instanceof HTMLSelectElement) return;
    const keys: Record<string, () => void> = {
      '1': () => this.setView('follow'), '2': () => this.setView('top'), '3': () => this.setView('free'),
      ' ': () => this.setPlaying(!this.playing), arrowleft: () => this.timeline.move(-1), arrowright: () => this.timeline.move(1),
      end: () => this.timeline.set(null), m: () => this.setMeasuring(!this.measuring), p: () => this.toggle('points'),
      k: () => this.toggle('keyframes'), c: () => this.toggle('causal'), e: () => this.toggle('covisible', 'marginalised', 'returns'),
      i: () => this.toggle('image'), s: () => this.savePicture(), f: () => $('full').click(), t: () => $('theme').click(),
      h: () => $('help').click(), '?': () => $('help').click(),
      escape: () => {
        this.setMeasuring(false);
        this.select(null);
      },
    };
    const act = keys[event.key.toLowerCase()];
    if (!act) return;
    event.preventDefault();
    act();
  }

  /** For tests: what is shown, in numbers. */
  report(): object {
    return {
      link: this.link, live: this.model.live.length, newest: this.model.live.at(-1)?.frame ?? -1, keyframes: this.model.keyframes.size,
      inner: this.windowSize(1), outer: this.windowSize(2), points: this.stage.cloud.size, path: this.model.path.length,
      events: this.model.events.length, lost: lostStretches(this.model), late: lateStretches(this.model), drawn: this.stage.drawn, frameMs: this.stage.frameMs, share: this.stage.drawnPoints / Math.max(1, this.stage.cloud.size),
      edges: this.model.edges.size, loops: [...this.model.edges.values()].filter((edge) => edge.loop > 0).length, truth: this.model.truth?.path.length ?? 0, mapVersion: this.model.mapVersion,
    };
  }
  private windowSize(window: number): number {
    return [...this.model.keyframes.values()].filter((keyframe: Keyframe) => keyframe.window === window).length;
  }
}

/** Newest first; of more than there is room for, those that moved the camera least are left out. */
function mostTelling(events: readonly MapEvent[], most: number): MapEvent[] {
  const weight = (event: MapEvent) => (event.kind === 'optimisation' ? event.moved : Infinity);
  const heaviest = [...events].sort((a, b) => (weight(b) > weight(a) ? 1 : weight(b) < weight(a) ? -1 : b.t - a.t)).slice(0, most);
  return heaviest.sort((a, b) => b.t - a.t);
}

/** What went wrong in the page itself, once. */
function showFault(error: unknown): void {
  console.error(error);
  if (!$('fault').hidden) return;
  $('fault').textContent = `this page has a fault, and what it shows may be wrong: ${error instanceof Error ? error.message : String(error)}`;
  $('fault').hidden = false;
}

/** A page of another version of the program is loaded anew, but not again and again. */
function speaksTheSame(protocol: number): boolean {
  if (protocol === PROTOCOL) {
    sessionStorage.removeItem('reloaded');
    return true;
  }
  if (sessionStorage.getItem('reloaded')) {
    showFault(new Error(`the program speaks version ${protocol}, the page ${PROTOCOL}`));
  } else {
    sessionStorage.setItem('reloaded', 'yes');
    location.reload();
  }
  return false;
}

function start(): void {
  const context = contextOf($('stage'));
  if (!context) {
    $('message').textContent = 'this browser has no WebGL 2, which the picture is drawn with: see its settings for hardware acceleration, or try another one';
    $('message').hidden = false;
    $('state').textContent = 'no picture';
    return;
  }
  window.twofold = new Page(context);
}

declare global {
  interface Window {
    twofold: Page;
  }
}
addEventListener('error', (event) => showFault(event.error ?? event.message));
start();
