// The socket to the program: acknowledges what was dealt with, and comes back when it breaks.
import {decode, type Binary, type Text} from './wire.ts';

export type Link = 'connecting' | 'open' | 'broken' | 'ended';

export type Command = 'save map' | 'stop' | 'pause mapping' | 'resume mapping';

export interface Listener {
  binary(message: Binary): void;
  text(message: Text): void;
  link(state: Link, message: string): void;
  /** A message that could not be dealt with. */
  fault(error: unknown): void;
}

const RETRY_MS = [500, 1000, 2000, 4000];
/** A network that is gone without a word leaves a socket open for ever: after so long without a message the other side is asked, and given up when it does not answer. */
const ASK_MS = 5000;
const ANSWER_MS = 10000;

export class Connection {
  private socket: WebSocket | null = null;
  private tries = 0;
  private ended = false;
  private wantsImages = false;
  private heard = 0;  // when something came from the other side, or it was called
  private asked: number | null = null;  // when, since then

  constructor(private readonly listener: Listener) {
    this.open();
    setInterval(() => this.watch(), 1000);
  }

  /** Counted from the question, not from the last message: a page in the background has its timers a minute apart. */
  private watch(): void {
    const socket = this.socket;
    if (!socket || socket.readyState >= WebSocket.CLOSING) return;
    const now = performance.now();
    if (this.asked !== null && now - this.asked > ANSWER_MS) {
      socket.onopen = socket.onmessage = socket.onclose = null;
      socket.close();
      this.retry();
    } else if (this.asked === null && now - this.heard > ASK_MS) {
      this.asked = now;
      this.send('still there?');  // or it is not open yet
    }
  }

  private hear(): void {
    this.heard = performance.now();
    this.asked = null;
  }

  setImages(on: boolean): void {
    this.wantsImages = on;
    this.send(on ? 'images on' : 'images off');
  }

  askForKeyframe(id: number): void {
    this.send(`keyframe ${id}`);
  }

  command(text: Command): void {
    this.send(text);
  }

  private send(text: string): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(text);
  }

  private open(): void {
    const socket = new WebSocket(`ws://${location.host}/live`);
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    this.hear();
    socket.onopen = () => {
      this.hear();
      this.tries = 0;
      this.ended = false;
      if (this.wantsImages) this.send('images on');
      this.listener.link('open', '');
    };
    socket.onmessage = (event) => {
      this.hear();
      try {
        if (typeof event.data === 'string') this.takeText(JSON.parse(event.data) as Text);
        else this.listener.binary(decode(event.data as ArrayBuffer));
      } catch (error) {
        this.listener.fault(error);
      }
      this.send('ack');  // else nothing more would come
    };
    socket.onclose = () => this.retry();
  }

  private takeText(message: Text): void {
    if (message.status?.ended) {
      this.ended = true;
      this.listener.link('ended', message.status.message);
    }
    this.listener.text(message);
  }

  /** A run that has ended is not missed; its program may stay away for good. */
  private retry(): void {
    const wait = RETRY_MS[Math.min(this.tries++, RETRY_MS.length - 1)];
    if (!this.ended) {
      this.listener.link('broken', 'connection lost');
      void this.askWhy();
    }
    setTimeout(() => this.open(), this.ended ? 5000 : wait);
  }

  /** A refused socket does not say why; the same address, asked as a page, does. */
  private async askWhy(): Promise<void> {
    const socket = this.socket;
    let why = 'the program cannot be reached: it has ended, or the network is down';
    try {
      const answer = await fetch('/live', {cache: 'no-store', signal: AbortSignal.timeout(4000)});
      why = answer.ok ? '' : (await answer.text()).trim();
    } catch { /* nobody there */ }
    if (why && this.socket === socket && socket && socket.readyState >= WebSocket.CLOSING) this.listener.link('broken', why);
  }
}
