// The path of a program: what `cellwire ls run --out` writes and prints.
const { execFile } = require("node:child_process");
const { mkdtemp, readFile, rm } = require("node:fs/promises");
const { tmpdir } = require("node:os");
const { dirname, join } = require("node:path");
const { advice } = require("./texts");

/** @typedef {{ svg?: string, text: string, good: boolean }} Drawn the picture, if there is one; what was printed; whether the program has ended as it should */

/**
 * Simulates a program and draws its path.
 * @param {string} path the program `cellwire`
 * @param {string} file the LS file
 * @param {string[]} others more arguments of `ls run`
 * @param {AbortSignal} [signal] ends the simulation
 * @returns {Promise<Drawn>}
 */
exports.draw = async (path, file, others, signal) => {
    const folder = await mkdtemp(join(tmpdir(), "cellwire-"));
    try {
        const args = ["ls", "run", file, "--out", folder, ...others];
        const options = { cwd: dirname(file), signal, maxBuffer: 64 << 20, windowsHide: true };
        const { text, good } = await new Promise((resolve) => {
            execFile(path, args, options, (error, stdout, stderr) => {
                const started = !error || typeof error.code === "number";
                resolve({ text: started ? stderr + stdout : advice(path, error), good: !error });
            });
        });
        const svg = await readFile(join(folder, "path.svg"), "utf8").catch(() => undefined);
        return { svg, text, good };
    } finally {
        await rm(folder, { recursive: true, force: true });
    }
};
