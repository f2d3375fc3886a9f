// The extension: starts `cellwire ls lsp`, shows its state in the status bar, and draws the path of a program.
const { basename } = require("node:path");
const vscode = require("vscode");
const { LanguageClient, State } = require("vscode-languageclient/node");
const { advice, isOurs, page, serverArguments } = require("./texts");
const { draw } = require("./draw");

/** @type {LanguageClient | undefined} */
let client;
/** The change of the server that is under way: one at a time. */
let changing = Promise.resolve();

/** @param {vscode.ExtensionContext} context */
exports.activate = async (context) => {
    const status = vscode.window.createStatusBarItem("cellwire.server", vscode.StatusBarAlignment.Right);
    status.name = "FANUC LS";
    status.command = "cellwire.restart";
    const output = vscode.window.createOutputChannel("FANUC LS");
    const pictures = new Pictures(output);
    const show = () => (isOurs(vscode.window.activeTextEditor?.document.languageId) ? status.show() : status.hide());
    /** @param {string} icon @param {string} detail @param {boolean} [failed] */
    const report = (icon, detail, failed) => {
        status.text = `$(${icon}) FANUC LS`;
        status.tooltip = `${detail} Click to restart the language server.`;
        status.backgroundColor = failed ? new vscode.ThemeColor("statusBarItem.errorBackground") : undefined;
        show();
    };
    const restart = () => (changing = changing.then(() => stop()).then(() => start(output, report)));
    context.subscriptions.push(
        status,
        output,
        pictures,
        vscode.window.onDidChangeActiveTextEditor(show),
        vscode.workspace.onDidChangeConfiguration((event) => {
            if (event.affectsConfiguration("cellwire.path") || event.affectsConfiguration("cellwire.arguments")) restart();
        }),
        vscode.workspace.onDidSaveTextDocument((document) => pictures.saved(document)),
        vscode.commands.registerCommand("cellwire.restart", restart),
        vscode.commands.registerCommand("cellwire.picture", () => pictures.open(vscode.window.activeTextEditor?.document)),
    );
    await restart();
};

exports.deactivate = () => (changing = changing.then(stop));

async function stop() {
    const old = client;
    client = undefined;
    // A server that has died cannot be asked to stop, and its client may wait for it.
    const limit = new Promise((resolve) => setTimeout(resolve, 3000));
    await Promise.race([old?.dispose().catch(() => {}), limit]);
}

/** @param {vscode.OutputChannel} output @param {(icon: string, detail: string, failed?: boolean) => void} report */
async function start(output, report) {
    const settings = vscode.workspace.getConfiguration("cellwire");
    const path = settings.get("path", "cellwire");
    const run = { command: path, args: serverArguments(settings.get("arguments", [])), options: { cwd: folder() } };
    const created = new LanguageClient("cellwire", "FANUC LS", run, {
        // Not the old versions that a comparison shows.
        documentSelector: ["file", "untitled"].map((scheme) => ({ scheme, language: "fanuc-ls" })),
        outputChannel: output,
        // The message is in the status bar, and has the setting to look at.
        initializationFailedHandler: () => false,
    });
    client = created;
    created.onDidChangeState(({ newState }) => {
        if (client !== created) return;
        if (newState === State.Starting) report("sync~spin", `${path} is starting.`);
        else if (newState === State.Running) report("check", `${path} ${created.initializeResult?.serverInfo?.version ?? ""} is running.`);
        else report("error", `${path} has stopped.`, true);
    });
    try {
        await created.start();
    } catch (error) {
        const text = advice(path, error);
        report("error", text, true);
        output.appendLine(text);
        const choice = "Open Settings";
        vscode.window.showErrorMessage(text, choice).then((chosen) => {
            if (chosen === choice) vscode.commands.executeCommand("workbench.action.openSettings", "cellwire.path");
        });
    }
}

/** The folder that the programs run in: the first one of the workspace. */
function folder() {
    return vscode.workspace.workspaceFolders?.find(({ uri }) => uri.scheme === "file")?.uri.fsPath;
}

/** The panels with a path, one for each program; drawn again when it is saved. */
class Pictures {
    /** @param {vscode.OutputChannel} output */
    constructor(output) {
        this.output = output;
        /** @type {Map<string, { panel: vscode.WebviewPanel, stop?: AbortController }>} */
        this.panels = new Map();
    }

    /** @param {vscode.TextDocument} [document] */
    async open(document) {
        if (!document || !isOurs(document.languageId)) return;
        if (document.uri.scheme !== "file") {
            vscode.window.showErrorMessage("Save the program first: the simulation reads its file.");
            return;
        }
        if (document.isDirty && !(await document.save())) return;
        const name = basename(document.fileName);
        let shown = this.panels.get(document.fileName);
        if (!shown) {
            const place = { viewColumn: vscode.ViewColumn.Beside, preserveFocus: true };
            const panel = vscode.window.createWebviewPanel("cellwire.picture", `Path of ${name}`, place, { enableScripts: false });
            shown = { panel };
            this.panels.set(document.fileName, shown);
            panel.onDidDispose(() => {
                this.panels.get(document.fileName)?.stop?.abort();
                this.panels.delete(document.fileName);
            });
        }
        shown.panel.reveal(undefined, true);
        await this.draw(document.fileName);
    }

    /** @param {vscode.TextDocument} document */
    saved(document) {
        if (this.panels.get(document.fileName)?.panel.visible) this.draw(document.fileName);
    }

    /** @param {string} file */
    async draw(file) {
        const shown = this.panels.get(file);
        if (!shown) return;
        shown.stop?.abort();
        const stop = (shown.stop = new AbortController());
        const settings = vscode.workspace.getConfiguration("cellwire");
        const drawn = await draw(settings.get("path", "cellwire"), file, settings.get("runArguments", []), stop.signal);
        if (!stop.signal.aborted && this.panels.has(file)) shown.panel.webview.html = page(basename(file), drawn);
    }

    dispose() {
        for (const { panel } of [...this.panels.values()]) panel.dispose();
    }
}
