// Prints what an MCAP file of protobuf messages holds, as JSON: by topic its schema, how many messages
// there are, and the last one, decoded by the schema in the file. Fails if a checksum does not match.

import { open } from "node:fs/promises";

import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { FileHandleReadable } from "@mcap/nodejs";
import { loadDecompressHandlers } from "@mcap/support";
import protobuf from "protobufjs";
import "protobufjs/ext/descriptor/index.js";

const decompressHandlers = await loadDecompressHandlers();
const file = await open(process.argv[2]);

const stream = new McapStreamReader({ decompressHandlers });
stream.append(await file.readFile());
while (stream.nextRecord());
if (!stream.done()) throw new Error("the file has no end");

const readable = new FileHandleReadable(file);
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
const last = new Map();
for await (const message of reader.readMessages()) last.set(message.channelId, message);

const topics = {};
for (const [id, message] of last) {
  const channel = reader.channelsById.get(id);
  const schema = reader.schemasById.get(channel.schemaId);
  const kind = protobuf.Root.fromDescriptor(schema.data).lookupType(schema.name);
  topics[channel.topic] = {
    schema: schema.name,
    schema_encoding: schema.encoding,
    message_encoding: channel.messageEncoding,
    messages: Number(reader.statistics.channelMessageCounts.get(id)),
    last: kind.toObject(kind.decode(message.data), { longs: String, defaults: true }),
  };
}
console.log(JSON.stringify(topics));
await file.close();
