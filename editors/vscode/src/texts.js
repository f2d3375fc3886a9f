// What needs no editor: arguments, advice, and the page of a panel.

/** Whether a document is an LS file. @param {string} [language] the editor's name of its language */
exports.isOurs = (language) => language === "fanuc-ls";

/** The arguments of the language server. @param {string[]} others those of the settings */
exports.serverArguments = (others) => ["ls", "lsp", ...others];

/** Why a program does not run, and what to do. @param {string} path the program @param {unknown} error the error of its start */
exports.advice = (path, error) => {
    const text = error instanceof Error ? error.message : String(error);
    const code = error instanceof Error && "code" in error ? error.code : undefined;
    return code === "ENOENT" || /ENOENT/.test(text)
        ? `There is no program ${path}: install cellwire, or set cellwire.path to its file.`
        : `${path} does not run: ${text.trim()}`;
};

/** @param {string} text */
const escaped = (text) => text.replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);

/**
 * The page of a panel: the picture, and what was printed. The picture is data, so that nothing in it runs.
 * @param {string} name the file's name
 * @param {import("./draw").Drawn} drawn
 */
exports.page = (name, { svg, text, good }) => {
    const picture = svg ? `<img alt="Path of ${escaped(name)}" src="data:image/svg+xml;base64,${Buffer.from(svg).toString("base64")}">` : "";
    return `<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; style-src 'unsafe-inline'">
<style>
img { background: #fff; max-width: 100%; }
pre { white-space: pre-wrap; font-family: var(--vscode-editor-font-family); font-size: var(--vscode-editor-font-size); }
.bad { color: var(--vscode-errorForeground); }
</style>
</head>
<body>
${picture}
<pre${good ? "" : ' class="bad"'}>${escaped(text)}</pre>
</body>
</html>
`;
};
