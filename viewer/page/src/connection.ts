// The socket to the program: acknowledges what was dealt with, and comes back when it breaks.
import {decode, type Binary, type Text} from './wire.ts';

export type Link = 'connecting' | 'open' | 'broken' | 'ended';

export type Command = 'save map' | 'stop' | 'pause mapping' | 'resume mapping';

export interface Listener {
  binary(message: Binary): void;
  text(message: Text): void;
  link(state: Link, message: string): void;
}

const RETRY_MS = [500, 1000, 2000, 4000];

export class Connection {
  private socket: WebSocket | null = null;
  private tries = 0;
  private ended = false;
  private wantsImages = false;

  constructor(private readonly listener: Listener) {
    this.open();
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
    socket.onopen = () => {
      this.tries = 0;
      this.ended = false;
      if (this.wantsImages) this.send('images on');
      this.listener.link('open', '');
    };
    socket.onmessage = (event) => {
      if (typeof event.data === 'string') this.takeText(JSON.parse(event.data) as Text);
      else this.listener.binary(decode(event.data as ArrayBuffer));
      this.send('ack');
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
      const message = this.tries < 3 ? 'connection lost' : 'the program cannot be reached: it has ended, or the network is down';
      this.listener.link('broken', message);
    }
    setTimeout(() => this.open(), this.ended ? 5000 : wait);
  }
}
