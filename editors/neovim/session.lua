-- A session: diagnostics are seen, a call leads to its program, a register and a program are renamed, the layout is corrected, the server is
-- killed and started again. Each step is printed; the first that is not as expected ends it with status 1. `.ci/editors` runs it:
--   nvim --clean --headless -c 'luafile session.lua'     EXAMPLE is editors/example, FOLDER a copy of it, CELLWIRE the tool

local folder, tool = vim.env.FOLDER, vim.env.CELLWIRE
vim.g.cellwire = { tool, "ls", "lsp" }
vim.o.hidden = true
vim.o.swapfile = false
dofile(vim.fn.fnamemodify(debug.getinfo(1, "S").source:sub(2), ":p:h") .. "/cellwire.lua")

local function say(text) io.stdout:write(text, "\n") end

local function check(what, holds, found)
    say(what)
    if holds then return end
    say("  is not so: " .. vim.inspect(found))
    vim.cmd("cquit 1")
end

-- Waits until a condition holds, 10 s at most; returns the seconds.
local function wait(what, condition)
    local start = vim.loop.hrtime()
    check(what, vim.wait(10000, condition, 5), { waited = 10, diagnostics = vim.diagnostic.get(0) })
    return (vim.loop.hrtime() - start) / 1e9
end

local function open(name) vim.cmd("edit " .. vim.fn.fnameescape(folder .. "/" .. name)) end
local function texts() return vim.tbl_map(function(it) return it.lnum + 1 .. ": " .. it.message end, vim.diagnostic.get(0)) end
local function line(number) return vim.fn.getline(number) end
local function find(text) return assert(vim.fn.search("\\V" .. text, "w") > 0, text) end
local function read(name)
    local file = io.open(folder .. "/" .. name)
    return file and file:read("a")
end

-- A request at the cursor, and its answer.
local function ask(method, others)
    local params = vim.tbl_extend("force", vim.lsp.util.make_position_params(), others or {})
    local answers = vim.lsp.buf_request_sync(0, method, params, 10000) or {}
    local _, answer = next(answers)
    return answer and answer.result, answer and answer.err
end

open("PICK.LS")
wait("PICK.LS is open, and the server has started", function()
    local _, client = next(vim.lsp.buf_get_clients(0))
    return client and client.initialized
end)
check("it has the type fanucls", vim.bo.filetype == "fanucls", vim.bo.filetype)

find("JMP LBL[1]")
vim.cmd("silent substitute/LBL\\[1\\]/LBL[7]/")
wait("a jump to a label that is not there: a diagnostic", function() return #vim.diagnostic.get(0) > 0 end)
for _, text in ipairs(texts()) do say("  " .. text:gsub("\n", "; ")) end
check("it is at the jump", vim.tbl_contains(vim.tbl_map(function(it) return it.lnum end, vim.diagnostic.get(0)), vim.fn.line(".") - 1), texts())
vim.cmd("silent undo")
wait("undone: no diagnostic", function() return #vim.diagnostic.get(0) == 0 end)

find("CALL GRIP")
vim.fn.search("GRIP")
local found = ask("textDocument/definition")
local target = found and (found.uri or (found[1] and (found[1].uri or found[1].targetUri)))
check("the definition of GRIP is GRIP.LS", target and target:match("GRIP%.LS$"), found)

find("DO[1:")
local answer, refused = ask("textDocument/hover")
local shown = answer and answer.contents and answer.contents.value or ""
check("hover: " .. vim.trim(shown):gsub("\n+", "; "), shown:find("stack full", 1, true) ~= nil, answer or refused)

find("R[1:sheets]=0")
vim.lsp.buf.rename("parts")
wait("R[1] is renamed to parts", function() return line("."):find("R%[1:parts%]=0") ~= nil end)
vim.cmd("silent wall")
check("no line has the old name", not read("PICK.LS"):find("R[1:sheets]", 1, true), read("PICK.LS"))
local expected = io.open(vim.env.EXAMPLE .. "/PICK.LS"):read("a"):gsub("R%[1:sheets%]", "R[1:parts]")
check("the file is else as it was", read("PICK.LS") == expected, vim.fn.system({ "diff", vim.env.EXAMPLE .. "/PICK.LS", folder .. "/PICK.LS" }))

find("J P[1:home] 50%")
vim.fn.setline(".", (line("."):gsub("50%% FINE    ;", "50%%   FINE;")))
local spoiled = line(".")
if vim.lsp.buf.format then vim.lsp.buf.format() else vim.lsp.buf.formatting_sync() end
check("layout: " .. vim.trim(spoiled) .. " becomes " .. vim.trim(line(".")), line(".") == "   9:J P[1:home] 50% FINE    ;", line("."))

find("CALL GRIP")
vim.fn.search("GRIP")
vim.lsp.buf.rename("HAND")
wait("GRIP is renamed to HAND in its calls", function() return line("."):find("CALL HAND(", 1, true) ~= nil end)
vim.cmd("silent wall")
check("and in /PROG", (read("HAND.LS") or read("GRIP.LS")):find("^/PROG  HAND\n") ~= nil, vim.fn.readdir(folder))

local id = next(vim.lsp.buf_get_clients(0))
vim.loop.kill(tonumber(vim.fn.system({ "pgrep", "-P", vim.fn.getpid(), "-f", "ls lsp" })), "sigkill")
wait("the server is killed", function() return vim.lsp.client_is_stopped(id) end)
vim.cmd("CellwireRestart")
find("JMP LBL[1]")
vim.cmd("silent substitute/LBL\\[1\\]/LBL[8]/")
wait("another is started, and has a diagnostic", function() return #vim.diagnostic.get(0) > 0 end)
vim.cmd("qall!")
