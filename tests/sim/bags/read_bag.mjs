// Reads a bag with the MCAP libraries of JavaScript, as Foxglove does, and prints what it found:
//   node read_bag.mjs FOLDER_OF_NODE_MODULES BAG.mcap
import { createRequire } from "node:module";
import { open } from "node:fs/promises";

const require = createRequire(`${process.argv[2]}/`);
const { McapIndexedReader } = require("@mcap/core");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const { decompress } = require("fzstd");

const file = await open(process.argv[3]);
const readable = {
  size: async () => BigInt((await file.stat()).size),
  read: async (offset, length) => {
    const { buffer } = await file.read(new Uint8Array(Number(length)), 0, Number(length), Number(offset));
    return buffer;
  },
};
const reader = await McapIndexedReader.Initialize({
  readable,
  decompressHandlers: { zstd: (data, size) => decompress(data, new Uint8Array(Number(size))) },
});
const decoders = new Map();
for (const schema of reader.schemasById.values()) {
  const definition = new TextDecoder().decode(schema.data);
  decoders.set(schema.id, new MessageReader(parse(definition, { ros2: true })));
}
const counts = {}, sums = {};
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  const said = decoders.get(channel.schemaId).readMessage(message.data);
  counts[channel.topic] = (counts[channel.topic] ?? 0) + 1;
  if (said.positions) for (const value of said.positions) sums[channel.topic] = (sums[channel.topic] ?? 0) + value;
}
await file.close();
const episodes = Number(counts["/episode"]);
console.log(JSON.stringify({ profile: reader.header.profile, counts, sums, episodes }));
