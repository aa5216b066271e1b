// A Foxglove client that subscribes to everything, as a process of its own that can be stopped.

import WebSocket from "ws";

const socket = new WebSocket(process.argv[2], ["foxglove.sdk.v1"]);
let subscriptions = 0;
let isReading = false;
socket.on("message", (data, isBinary) => {
  if (isBinary) {
    if (!isReading) console.log("reads");
    isReading = true;
    return;
  }
  const { op, channels = [] } = JSON.parse(data);
  if (op !== "advertise") return;
  const wanted = channels.map(({ id }) => ({ id: (subscriptions += 1), channelId: id }));
  socket.send(JSON.stringify({ op: "subscribe", subscriptions: wanted }));
});
socket.on("close", () => console.log("closed"));
socket.on("error", () => console.log("closed"));
