// Writes recordings by MCAP's own library, in every layout it knows: node write_mcap.mjs FOLDER
// Each holds 20 images of 16x8 pixels of value i on /camera/image at i / 10 s, and as many messages on /other.
import { compress as zstd, isLoaded } from "@foxglove/wasm-zstd";
import { McapWriter } from "@mcap/core";
import lz4 from "lz4js";
import { open } from "node:fs/promises";

const WIDTH = 16, HEIGHT = 8, IMAGES = 20;

function imageMessage(i) {
  const bytes = new Uint8Array(256);
  const view = new DataView(bytes.buffer, 4);
  let at = 0;
  const align = (size) => { at += (size - (at % size)) % size; };
  const u32 = (value) => { align(4); view.setUint32(at, value, true); at += 4; };
  const text = (value) => {
    u32(value.length + 1);
    for (const c of value) view.setUint8(at++, c.charCodeAt(0));
    view.setUint8(at++, 0);
  };
  bytes[1] = 1; // little-endian CDR
  u32(Math.floor(i / 10));
  u32((i % 10) * 1e8);
  text("camera");
  u32(HEIGHT);
  u32(WIDTH);
  text("mono8");
  view.setUint8(at++, 0);
  u32(WIDTH);
  u32(WIDTH * HEIGHT);
  for (let p = 0; p < WIDTH * HEIGHT; ++p) view.setUint8(at++, i);
  return bytes.subarray(0, 4 + at);
}

class FileWriter {
  #file;
  #position = 0n;
  constructor(file) { this.#file = file; }
  async write(bytes) {
    await this.#file.write(bytes);
    this.#position += BigInt(bytes.byteLength);
  }
  position() { return this.#position; }
}

async function write(path, options) {
  const file = await open(path, "w");
  const writer = new McapWriter({ writable: new FileWriter(file), chunkSize: 1024, ...options });
  await writer.start({ profile: "ros2", library: "test" });
  const encode = (text) => new TextEncoder().encode(text);
  const channel = async (topic, type) => writer.registerChannel({
    topic, messageEncoding: "cdr", metadata: new Map([["offered_qos_profiles", ""]]),
    schemaId: await writer.registerSchema({ name: type, encoding: "ros2msg", data: encode("# fields") }),
  });
  const other = await channel("/other", "std_msgs/msg/String");
  const images = await channel("/camera/image", "sensor_msgs/msg/Image");
  for (let i = 0; i < IMAGES; ++i) {
    const time = BigInt(i) * 100000000n;
    const message = { sequence: i, publishTime: time, logTime: time };
    await writer.addMessage({ ...message, channelId: other, data: new Uint8Array(300) });
    await writer.addMessage({ ...message, channelId: images, data: imageMessage(i) });
  }
  await writer.addMetadata({ name: "about", metadata: new Map([["what", "a test"]]) });
  await writer.addAttachment({ name: "a", logTime: 0n, createTime: 0n, mediaType: "text/plain", data: encode("b") });
  await writer.end();
  await file.close();
}

const folder = process.argv[2];
await isLoaded;
const compressed = {
  plain: {},
  zstd: { compressChunk: (data) => ({ compression: "zstd", compressedData: zstd(data, 3) }) },
  lz4: { compressChunk: (data) => ({ compression: "lz4", compressedData: lz4.compress(data) }) },
};
const layouts = {
  whole: {},
  unindexed: { useMessageIndex: false },
  unrepeated: { repeatSchemas: false, repeatChannels: false },
  bare: { repeatSchemas: false, repeatChannels: false, useStatistics: false, useSummaryOffsets: false,
          useChunkIndex: false, useMessageIndex: false, useAttachmentIndex: false, useMetadataIndex: false },
};
for (const [name, compression] of Object.entries(compressed)) {
  for (const [layout, options] of Object.entries(layouts))
    await write(`${folder}/${name}_${layout}.mcap`, { ...compression, ...options });
}
await write(`${folder}/unchunked.mcap`, { useChunks: false });
