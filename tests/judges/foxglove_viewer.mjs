// Decodes live grasps with the client and the readers of Foxglove's makers: node foxglove_viewer.mjs ADDRESS
// Prints, once the server has ended, for each topic how many messages came and the digest of their numbers.
import { createHash } from "node:crypto";
import protocol from "@foxglove/ws-protocol";
import rosmsg from "@foxglove/rosmsg";
import serialization from "@foxglove/rosmsg2-serialization";
import { WebSocket } from "ws";

const client = new protocol.FoxgloveClient({
  ws: new WebSocket(process.argv[2], [protocol.FoxgloveClient.SUPPORTED_SUBPROTOCOL]),
});
const topics = new Map();

client.on("error", (error) => {
  console.error(error);
  process.exit(1);
});
client.on("advertise", (channels) => {
  for (const channel of channels) {
    if (channel.encoding !== "cdr" || channel.schemaEncoding !== "ros2msg") throw new Error(JSON.stringify(channel));
    const definitions = rosmsg.parse(channel.schema, { ros2: true });
    const topic = {
      name: channel.topic,
      type: channel.schemaName,
      reader: new serialization.MessageReader(definitions),
      count: 0,
      digest: createHash("sha256"),
    };
    topics.set(client.subscribe(channel.id), topic);
  }
  console.log(JSON.stringify({ subscribed: channels.map((channel) => channel.topic) }));
});
client.on("message", ({ subscriptionId, data }) => {
  const topic = topics.get(subscriptionId), message = topic.reader.readMessage(data);
  topic.count += 1;
  for (const value of Object.values(message)) {
    const numbers = Float64Array.from(typeof value === "object" ? value : [value], Number);
    topic.digest.update(new Uint8Array(numbers.buffer));
  }
});
client.on("close", () => {
  const found = [...topics.values()].map(({ name, type, count, digest }) => [name, { type, count, digest: digest.digest("hex") }]);
  console.log(JSON.stringify(Object.fromEntries(found)));
});
