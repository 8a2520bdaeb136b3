// A viewer without a browser: reads and acknowledges, or reads nothing at all.
import {connect} from 'node:net';

function textFrame(text) {
  return Buffer.concat([Buffer.from([0x81, 0x80 | text.length, 0, 0, 0, 0]), Buffer.from(text)]);
}

export class Reader {
  constructor(address, reads) {
    const {hostname, port} = new URL(address);
    this.messages = 0;
    this.bytes = 0;
    this.pending = Buffer.alloc(0);
    this.open = false;
    void fetch(address).then((page) => this.watch(hostname, port, page.headers.get('set-cookie').split(';')[0], reads));
  }
  watch(hostname, port, cookie, reads) {
    this.socket = connect(Number(port), hostname);
    this.socket.on('error', () => {});
    this.socket.write(`GET /live HTTP/1.1\r\nHost: ${hostname}:${port}\r\nOrigin: http://${hostname}:${port}\r\nUpgrade: websocket\r\n` +
      `Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n` +
      `Cookie: ${cookie}\r\n\r\n`);
    if (reads) this.socket.on('data', (data) => this.take(data));
    else this.socket.pause();
  }
  take(data) {
    this.bytes += data.length;
    this.pending = Buffer.concat([this.pending, data]);
    if (!this.open) {
      const end = this.pending.indexOf('\r\n\r\n');
      if (end < 0) return;
      this.open = true;
      this.pending = this.pending.subarray(end + 4);
    }
    while (this.skipFrame());
  }
  /** Frames of a server are not masked. */
  skipFrame() {
    const p = this.pending;
    if (p.length < 2) return false;
    const short = p[1] & 0x7f;
    const head = short < 126 ? 2 : short === 126 ? 4 : 10;
    if (p.length < head) return false;
    const length = short < 126 ? short : short === 126 ? p.readUInt16BE(2) : Number(p.readBigUInt64BE(2));
    if (p.length < head + length) return false;
    this.pending = p.subarray(head + length);
    if ((p[0] & 0x80) !== 0 && (p[0] & 0x0f) < 8) {
      ++this.messages;
      this.socket.write(textFrame('ack'));
    }
    return true;
  }
  close() {
    this.socket.destroy();
  }
}
