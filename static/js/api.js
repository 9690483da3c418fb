// The JSON API. Every failure becomes an ApiError whose message is meant for people.

export class ApiError extends Error {
  constructor(message, status = 0, kind = "") {
    super(message);
    this.status = status;
    this.kind = kind;
  }
}

const OFFLINE = "The server does not answer. Is segmap still running? The page tries again by itself.";

export const get = (url, options) => call(url, options);
export const post = (url, body = {}, options = {}) =>
  call(url, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body), ...options });

/** Fetch a file for saving: its bytes, and the name the server gives it. */
export async function file(url) {
  const response = await reach(url);
  if (!response.ok) throw await failure(response);
  return { blob: await response.blob(), name: fileName(response) };
}

/** The error a response body describes: {"error": {"message", "kind"}}, or the status where it does not. */
export function described(status, body) {
  const error = body?.error;
  const message = error?.message ?? `The server answered with status ${status}.`;
  return new ApiError(message, status, error?.kind ?? "");
}

/** Ask the API for anything. */
export async function call(url, options) {
  const response = await reach(url, options);
  if (!response.ok) throw await failure(response);
  return response.json();
}

async function reach(url, options) {
  try {
    return await fetch(url, options);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new ApiError(OFFLINE);
  }
}

async function failure(response) {
  const body = await response.json().catch(nothing);
  return described(response.status, body);
}

/** An answer without a body is none; a request that was taken back is not an answer at all. */
function nothing(error) {
  if (error.name === "AbortError") throw error;
  return null;
}

function fileName(response) {
  const disposition = response.headers.get("Content-Disposition") ?? "";
  const plain = /filename="?([^";]+)"?/.exec(disposition)?.[1];
  const encoded = /filename\*=utf-8''([^;]+)/i.exec(disposition)?.[1];
  return encoded ? decodeURIComponent(encoded) : plain ?? "";
}
