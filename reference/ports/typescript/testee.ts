/** Answers the requests of the checks, one JSON object a line. */

import { createInterface } from "node:readline";
import { answerOf } from "./testee-answers.js";

for await (const line of createInterface({ input: process.stdin })) {
  if (line.trim() !== "") console.log(answerOf(line));
}
