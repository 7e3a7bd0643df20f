"use strict";
// The library in a thread of its own. Messages have an `id` and one of `module`, `file` or `message`; answers have the same
// `id`, `answer` and the size of the memory. News of progress have `work`, `done` and `all` (bytes, negative: not known).
let library, blob, reason;
const reader = new FileReaderSync();
const memory = () => new Uint8Array(library.memory.buffer);
const text = (at, length) => new TextDecoder().decode(memory().slice(at >>> 0, (at >>> 0) + length));
const page = {
  read(offset, target, length) {
    try {
      const part = new Uint8Array(reader.readAsArrayBuffer(blob.slice(offset, offset + length)));
      memory().set(part, target >>> 0);
      return part.length;
    } catch {
      return -1;
    }
  },
  progress: (work, length, done, all) => postMessage({ work: text(work, length), done, all }),
  stopped: (at, length) => { reason = text(at, length); },
};
const write = (string) => {
  const bytes = new TextEncoder().encode(string);
  const at = library.buffer(bytes.length) >>> 0;
  memory().set(bytes, at);
};
const ask = (message) => {
  write(JSON.stringify(message));
  const length = library.ask();
  return JSON.parse(text(library.answer(), length));
};
// Names a recording by its length, first and last bytes (FNV-1a).
const identity = (blob) => {
  let hash = 0x811c9dc5 ^ blob.size;
  for (const part of [blob.slice(0, 1 << 20), blob.slice(-(1 << 20))]) {
    for (const byte of new Uint8Array(reader.readAsArrayBuffer(part))) hash = Math.imul(hash ^ byte, 0x01000193);
  }
  return (hash >>> 0).toString(16);
};
onmessage = async ({ data: { id, module, file, message } }) => {
  let answer;
  try {
    if (module) {
      library = (await WebAssembly.instantiate(module, { page })).exports;
      library.start();
      answer = {};
    } else if (file) {
      blob = file.blob;
      write(file.name);
      library.file(blob.size);
      answer = { ...ask({ do: "open" }), key: identity(blob) };
    } else {
      answer = ask(message);
    }
  } catch (error) {
    const why = reason || error.message;
    answer = { stopped: true, error: `The library stopped (${why}). The file may need more memory than a page has: try the program.` };
  }
  postMessage({ id, answer, memoryBytes: library?.memory.buffer.byteLength });
};
