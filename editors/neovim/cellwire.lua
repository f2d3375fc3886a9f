-- LS files in neovim, 0.7 and later, by its own client: copy this file into ~/.config/nvim/plugin/.
-- The command of the server is vim.g.cellwire; without it, { "cellwire", "ls", "lsp" }.

local group = vim.api.nvim_create_augroup("cellwire", {})

vim.api.nvim_create_autocmd({ "BufRead", "BufNewFile" }, {
    group = group,
    pattern = { "*.ls", "*.LS", "*.Ls" },
    callback = function() vim.bo.filetype = "fanucls" end,
})

-- The workspace of a file: its repository, or else its folder.
local function root(file)
    local folder = vim.fn.fnamemodify(file, ":p:h")
    local found = vim.fn.finddir(".git", vim.fn.fnameescape(folder) .. ";")
    return found == "" and folder or vim.fn.fnamemodify(found, ":p:h:h")
end

-- The client of each workspace.
local clients = {}

local function attach(buffer)
    local folder = root(vim.api.nvim_buf_get_name(buffer))
    if not clients[folder] or vim.lsp.client_is_stopped(clients[folder]) then
        clients[folder] = vim.lsp.start_client({
            name = "cellwire",
            cmd = vim.g.cellwire or { "cellwire", "ls", "lsp" },
            root_dir = folder,
            workspace_folders = { { name = folder, uri = vim.uri_from_fname(folder) } },
        })
    end
    if clients[folder] then vim.lsp.buf_attach_client(buffer, clients[folder]) end
end

vim.api.nvim_create_autocmd("FileType", {
    group = group,
    pattern = "fanucls",
    callback = function(args)
        local buffer = args.buf
        vim.bo[buffer].expandtab = false -- the header has tabs
        vim.bo[buffer].omnifunc = "v:lua.vim.lsp.omnifunc"
        attach(buffer)
        local function map(keys, action) vim.keymap.set("n", keys, action, { buffer = buffer }) end
        map("gd", vim.lsp.buf.definition)
        map("K", vim.lsp.buf.hover)
        map("<F2>", function() vim.lsp.buf.rename() end)
        map("<F4>", function() vim.lsp.buf.code_action() end)
        map("<F3>", function() (vim.lsp.buf.format or vim.lsp.buf.formatting_sync)() end)
    end,
})

vim.api.nvim_create_user_command("CellwireRestart", function()
    for folder, id in pairs(clients) do
        vim.lsp.stop_client(id)
        clients[folder] = nil
    end
    for _, buffer in ipairs(vim.api.nvim_list_bufs()) do
        if vim.bo[buffer].filetype == "fanucls" then attach(buffer) end
    end
end, {})
