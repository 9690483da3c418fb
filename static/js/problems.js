// Lines of a log that were left out, in words.

/** One problem, whether it came as text or in parts. */
export function sentence(problem) {
  if (typeof problem === "string") return problem;
  const place = [problem.file, problem.line && `line ${problem.line}`].filter(Boolean).join(", ");
  return place ? `${place}: ${problem.reason}` : problem.reason;
}
