// The viewer as a page of its own: messages go to the server that has sent the page.

import { mount } from "./viewer.js";

const NEWLINE = 10;

async function send(message) {
  const answer = await fetch("frame", {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(message),
  });
  if (!answer.ok) {
    throw new Error((await answer.text()).trim());
  }
  const bytes = new Uint8Array(await answer.arrayBuffer());
  const end = bytes.indexOf(NEWLINE); // a line of JSON, then the picture
  return { status: JSON.parse(new TextDecoder().decode(bytes.subarray(0, end))), picture: bytes.subarray(end + 1) };
}

// The connection is held open, so that each side notices when the other one ends.
async function waitForTheEnd(viewer) {
  try {
    const answer = await fetch("alive");
    if (answer.ok) {
      await answer.text();
    }
  } catch {
    // the connection broke, which is an end as well
  }
  viewer.end("The program has ended. This is the last picture that it drew.");
}

const viewer = mount(document.getElementById("viewer"), send, {
  onStatus: (status) => {
    document.title = `${status.title} – raster view`;
  },
});
waitForTheEnd(viewer);
