"use strict";
/* The key of this tab, calls that carry it, and event streams. EventSource cannot send a header: streams are
   fetched, and read here as the HTML standard says. */

const KEY_NAME = "morphid-api-key"; // in sessionStorage: gone with the tab, never sent by itself
const RETRY_MS = 2000; // before a lost stream is asked for again

const session = {
  get key() { return sessionStorage.getItem(KEY_NAME) ?? ""; },
  set key(text) { text ? sessionStorage.setItem(KEY_NAME, text) : sessionStorage.removeItem(KEY_NAME); },
  onRefused: () => {}, // what to do when the service wants another key
};

async function request(path, options = {}) {
  const key = session.key;
  const headers = { Accept: "application/json", ...options.headers };
  if (key) headers.Authorization = `Bearer ${key}`;
  const answer = await fetch(path, { ...options, headers, redirect: "error", referrerPolicy: "no-referrer" });
  if (answer.ok) return answer;
  const problem = await answer.json().catch(() => ({ title: `The service answered ${answer.status}` }));
  if (answer.status === 401 && key === session.key) session.onRefused(problem); // else there is another by now
  throw Object.assign(new Error(problem.detail), { status: answer.status, problem });
}

async function call(path, options = {}) {
  const answer = await request(path, options);
  return answer.status === 204 ? null : answer.json();
}

/* ---- event streams ---- */

/* Feed lines to the returned function; it gives each whole event to `onEvent(name, id, data)`. */
function eventReader(onEvent) {
  let name = "message", id = "", data = [];
  return (line) => {
    if (line === "") {
      if (data.length) onEvent(name, id, data.join("\n"));
      name = "message";
      data = [];
      return;
    }
    const [, field, value] = /^([^:]*):? ?(.*)$/s.exec(line);
    if (field === "event") name = value;
    else if (field === "id") id = value;
    else if (field === "data") data.push(value);
  };
}

async function readStream(body, onLine) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { value, done } = await reader.read();
    if (done) return;
    const lines = (rest + value).split("\n");
    rest = lines.pop();
    lines.forEach((line) => onLine(line.replace(/\r$/, "")));
  }
}

/* Follow a job until it has ended, through lost connections; `onEvent(name, data)`. */
function follow(job, onEvent, after = 0) {
  const abort = new AbortController();
  let seen = after, ended = false;
  const onWhole = (name, id, data) => {
    seen = Number(id) || seen;
    ended ||= FINAL.includes(name);
    if (!abort.signal.aborted) onEvent(name, JSON.parse(data));
  };
  (async () => {
    while (!ended && !abort.signal.aborted) {
      try {
        const options = { headers: { Accept: "text/event-stream" }, signal: abort.signal, cache: "no-store" };
        const answer = await request(`/jobs/${job}/events?after=${seen}`, options);
        if (answer.status === 204) return;
        await readStream(answer.body, eventReader(onWhole));
      } catch (error) {
        if (error.status && error.status < 500 && error.status !== 429) return; // asking again would not help
      }
      if (!ended && !abort.signal.aborted) await new Promise((wake) => setTimeout(wake, RETRY_MS));
    }
  })();
  return { close: () => abort.abort() };
}

/* ---- files ---- */

async function objectUrl(path) {
  return URL.createObjectURL(await (await request(path, { headers: { Accept: "*/*" } })).blob());
}

/* An address for `src`: the file's own where no key is needed, else a copy that was fetched with the key. */
function showImage(image, path) {
  if (!session.key) image.src = path;
  else objectUrl(path).then((url) => { image.onload = () => URL.revokeObjectURL(url); image.src = url; }).catch(() => {});
  return image;
}

/* A link to a file. A browser follows links without the key, so with one the file is fetched and saved. */
function fileLink(path, name, options, ...children) {
  const link = element("a", { href: path, ...options }, ...children);
  link.addEventListener("click", async (event) => {
    if (!session.key) return;
    event.preventDefault();
    try {
      const url = await objectUrl(path);
      element("a", { href: url, download: name }).click();
      setTimeout(() => URL.revokeObjectURL(url), 10000);
    } catch (error) {
      link.title = error.message;
    }
  });
  return link;
}
