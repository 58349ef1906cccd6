// Asking the server.

const KEY = "perdure-token";
const found = new URLSearchParams(location.hash.slice(1)).get("token");
if (found) {
  sessionStorage.setItem(KEY, found);
  history.replaceState(null, "", location.pathname); // not left where a screenshot shows it
}
const token = sessionStorage.getItem(KEY) ?? "";

async function answered(path, options = {}) {
  let answer;
  try {
    answer = await fetch(`/api/${path}`, { ...options, headers: { ...options.headers, "X-Perdure-Token": token } });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Error("the viewer does not answer; is `perdure view` still running?");
  }
  if (!answer.ok) {
    const told = await answer.json().catch(() => ({}));
    throw Object.assign(new Error(told.error ?? `the viewer answers ${answer.status}`), { status: answer.status });
  }
  return answer;
}

export const ask = async (path, options) => (await answered(path, options)).json();
export const bytes = async (path, options) => (await answered(path, options)).arrayBuffer();
export const blob = async (path, options) => (await answered(path, options)).blob();
export async function roughly(path) {
  const answer = await answered(path);
  return [await answer.blob(), Number(answer.headers.get("x-frame"))];
}
export const send = (method, path, value) =>
  ask(path, { method, headers: { "content-type": "application/json" }, body: JSON.stringify(value) });
