-- MM&A cell, as mmacell-proto.md describes it.
--
-- Copy this file into Wireshark's folder of personal Lua plugins. It takes TCP ports 2001 to 2003; "Decode As" for others. The
-- preferences are the options of section 11.

local mma = Proto("mmacell_proto", "MM&A cell")
local MAX_LEN = 64
local KINDS = { [2001] = "robot", [2002] = "platform" }
local ANY, ROBOT, PLATFORM = 1, 2, 3

mma.prefs.device = Pref.enum("Device", ANY, "On ports other than 2001 and 2002",
    { { 1, "any", ANY }, { 2, "robot", ROBOT }, { 3, "platform", PLATFORM } }, false)
mma.prefs.itr = Pref.bool("ITR", false, "ITR is STP, too")
mma.prefs.ovrd = Pref.bool("OVRD", false, "OVRD is OVR, too")
mma.prefs.clos = Pref.bool("CLOS", false, "CLOS is CLOSE, too")
mma.prefs.off = Pref.bool("OFF", false, "SRVOFF is SRVOF, too")
mma.prefs.lone_lf = Pref.bool("Lone line feed", false, "A line feed alone ends a line, too")
mma.prefs.blank = Pref.bool("Blank", false, "A blank may follow the sign of an integer")
mma.prefs.wide_integers = Pref.bool("Wide integers", false, "Five digits count, also beyond 16 bits")

local f = mma.fields
f.command = ProtoField.string("mmacell_proto.command", "Command")
f.on = ProtoField.bool("mmacell_proto.on", "Servo motors on")
f.percent = ProtoField.int32("mmacell_proto.percent", "Override, %", base.DEC)
f.mode = ProtoField.string("mmacell_proto.mode", "Mode")
f.axes = ProtoField.double("mmacell_proto.axes", "Axis, mm or rad")
f.camera = ProtoField.int32("mmacell_proto.camera", "Camera", base.DEC)
f.gripper = ProtoField.int32("mmacell_proto.gripper", "Gripper", base.DEC)
f.open = ProtoField.bool("mmacell_proto.open", "Open")
f.reply = ProtoField.string("mmacell_proto.reply", "Reply")
f.moving = ProtoField.bool("mmacell_proto.moving", "Moving")
f.servo = ProtoField.bool("mmacell_proto.servo", "Servo motors on")
f.override = ProtoField.int32("mmacell_proto.override", "Override, %", base.DEC)
f.error = ProtoField.int32("mmacell_proto.error", "Error number", base.DEC,
    { [0] = "none", [1] = "generic", [2] = "servo motor 1", [3] = "servo motor 2" })
f.decode_error = ProtoField.string("mmacell_proto.decode_error", "Error")
f.request_in = ProtoField.framenum("mmacell_proto.request_in", "Command in", base.NONE, frametype.REQUEST)
f.response_time = ProtoField.double("mmacell_proto.response_time", "Response time in seconds")

local group, severity = expert.group, expert.severity
local function rule(name, text, kind, level) return ProtoExpert.new("mmacell_proto." .. name, text, kind, level) end
local e = {
    malformed = rule("malformed", "A line that is no message", group.MALFORMED, severity.ERROR),
    refused = rule("refused", "Refused with an error number", group.RESPONSE_CODE, severity.NOTE),
    kind = rule("wrong_kind", "A status is the answer to STA alone, and STA has no other", group.PROTOCOL, severity.ERROR),
    unasked = rule("unasked", "Reply without a command", group.SEQUENCE, severity.WARN),
    early = rule("early", "Command before the reply to the last one", group.SEQUENCE, severity.WARN),
}
mma.experts = { e.malformed, e.refused, e.kind, e.unasked, e.early }

local stream_field = Field.new("tcp.stream")
local open_commands, matches = {}, {}

function mma.init()
    open_commands, matches = {}, {}
end

--- Reads fields one after the other; the first that does not fit raises its error.
local Reader = {}
Reader.__index = Reader

function Reader.new(tvb, content, tree) return setmetatable({ tvb = tvb, content = content, tree = tree, at = 1 }, Reader) end

function Reader:rest() return self.content:sub(self.at) end

--- The place of what was read since `from`.
function Reader:range(from) return self.tvb(from - 1, self.at - from) end

function Reader:take(count)
    if #self:rest() < count then error({ kind = "short" }) end
    self.at = self.at + count
    return self.content:sub(self.at - count, self.at - 1)
end

function Reader:characters(layout)
    for wanted in layout:gmatch(".") do
        local found = self:take(1)
        local fits = wanted == "S" and found:match("[+-]") or wanted == "9" and found:match("%d") or found == wanted
        if not fits then error({ kind = "unexpected" }) end
        if wanted == "S" and layout == "S99999" and mma.prefs.blank and self:rest():sub(1, 1) == " " then self:take(1) end
    end
end

function Reader:number(layout)
    local from = self.at
    self:characters(layout)
    local text = self.content:sub(from, self.at - 1):gsub("[+ ]", "")
    return tonumber(text) + 0, from
end

function Reader:integer(field, limit)
    local value, from = self:number("S99999")
    if (value < -32768 or value > 32767) and not mma.prefs.wide_integers then error({ kind = "integer_range" }) end
    if limit and (value < 0 or value > limit) then error({ kind = "percent" }) end
    self.tree:add(field, self:range(from), value)
    return value
end

function Reader:flag(field)
    local from, found = self.at, self:take(1)
    if found ~= "T" and found ~= "F" then error({ kind = "unexpected" }) end
    self.tree:add(field, self:range(from), found == "T")
    return found == "T"
end

--- The rest of the line, one of `words`.
function Reader:word(words)
    local rest, begins = self:rest(), false
    for _, word in ipairs(words) do
        if rest == word then self.at = #self.content + 1 return word end
    end
    for _, word in ipairs(words) do
        if rest:sub(1, #word) == word then error({ kind = "trailing" }) end
        begins = begins or word:sub(1, #rest) == rest
    end
    error({ kind = begins and "short" or "unexpected" })
end

function Reader:axes(is_robot)
    local layouts = is_robot and { "S999.999", "S999.999", "S999.999", "S99.9999" } or { "S99.9999", "S99.9999" }
    for _, layout in ipairs(layouts) do
        local value, from = self:number(layout)
        self.tree:add(f.axes, self:range(from), value)
    end
end

local COMMANDS = {
    STA = function() end, STP = function() end, RST = function() end, CLO = function() end,
    SRV = function(reader)
        local from, word = reader.at, reader:word(mma.prefs.off and { "ON", "OF", "OFF" } or { "ON", "OF" })
        reader.tree:add(f.on, reader:range(from), word == "ON")
    end,
    OVR = function(reader)
        if mma.prefs.ovrd and reader:rest():sub(1, 1) == "D" then reader:take(1) end
        reader:integer(f.percent, 100)
    end,
    MOV = function(reader)
        local mode = ({ A = "absolute", R = "relative" })[reader:take(1)]
        if not mode then error({ kind = "unexpected" }) end
        reader.tree:add(f.mode, reader.tvb(3, 1), mode)
        reader:axes(#reader:rest() >= 32)
    end,
    ACQ = function(reader) reader:integer(f.camera) end,
    HND = function(reader)
        reader:integer(f.gripper)
        local from = reader.at
        local word = reader:word(mma.prefs.clos and { "OPEN", "CLOSE", "CLOS" } or { "OPEN", "CLOSE" })
        reader.tree:add(f.open, reader:range(from), word == "OPEN")
    end,
}

local function read_command(reader)
    local word = reader:take(3)
    local name = word == "ITR" and mma.prefs.itr and "STP" or word
    if not COMMANDS[name] then error({ kind = "unknown_command" }) end
    reader.tree:add(f.command, reader.tvb(0, 3), name)
    COMMANDS[name](reader)
    return name
end

local function read_reply(reader, is_robot)
    local word = reader:take(2)
    if word == "ER" then
        reader.tree:add(f.reply, reader.tvb(0, 2), "error")
        if reader:integer(f.error) == 0 then error({ kind = "error_zero" }) end
        return "error"
    end
    if word ~= "OK" then error({ kind = "unknown_reply" }) end
    local kind = reader:rest() == "" and "ok" or "status"
    reader.tree:add(f.reply, reader.tvb(0, 2), kind)
    if kind == "status" then
        reader:flag(f.moving)
        if is_robot == nil then is_robot = #reader:rest() >= 32 end
        reader:axes(is_robot)
        reader:flag(f.servo)
        reader:integer(f.override, 100)
        reader:integer(f.error)
    end
    return kind
end

local function match(pinfo, tree, at, name, from_device)
    local key = pinfo.number .. ":" .. at
    if not pinfo.visited then
        local stream = stream_field().value
        local command, now = open_commands[stream], tonumber(tostring(pinfo.abs_ts))
        if not from_device then
            matches[key] = { early = command ~= nil }
            open_commands[stream] = { number = pinfo.number, time = now, name = name }
        elseif command then
            matches[key] = { number = command.number, time = now - command.time, name = command.name }
            open_commands[stream] = nil
        else
            matches[key] = { unasked = true }
        end
    end
    local found = matches[key] or {}
    if found.early then tree:add_proto_expert_info(e.early) end
    if found.unasked then tree:add_proto_expert_info(e.unasked) end
    if found.number then
        tree:add(f.request_in, found.number):set_generated()
        tree:add(f.response_time, found.time):set_generated()
        if name == "ok" and found.name == "STA" or name == "status" and found.name ~= "STA" then
            tree:add_proto_expert_info(e.kind)
        end
    end
end

--- The fields of a line that cannot be read are not shown.
local function show_line(tvb, content, pinfo, tree, at, from_device)
    local kinds = { [ROBOT] = true, [PLATFORM] = false }
    local kind = KINDS[pinfo.match_uint]
    local is_robot = kinds[mma.prefs.device]
    if kind then is_robot = kind == "robot" end
    local function read(line)
        local reader = Reader.new(tvb, content, line)
        local name = from_device and read_reply(reader, is_robot) or not from_device and read_command(reader)
        if reader:rest() ~= "" then error({ kind = "trailing" }) end
        return name
    end
    local ignore = { add = function() end }
    local good, found = pcall(read, ignore)
    local line = tree:add(mma, tvb)
    if #content + 2 > MAX_LEN then good, found = false, { kind = "too_long" } end
    if not good then
        if type(found) ~= "table" then error(found) end
        line:add(f.decode_error, tvb(), found.kind)
        line:add_proto_expert_info(e.malformed)
        return "Error " .. found.kind
    end
    read(line)
    if found == "error" then line:add_proto_expert_info(e.refused) end
    match(pinfo, line, at, found, from_device)
    return content
end

--- The first end of a line from `at`: where the next line begins, and how many characters the end has.
local function find_end(text, at)
    local from = at
    while true do
        local feed = text:find("\n", from, true)
        if not feed then return end
        if feed > at and text:sub(feed - 1, feed - 1) == "\r" then return feed + 1, 2 end
        if mma.prefs.lone_lf then return feed + 1, 1 end
        from = feed + 1
    end
end

function mma.dissector(tvb, pinfo, tree)
    pinfo.cols.protocol = "MM&A"
    local from_device = pinfo.src_port == pinfo.match_uint
    local text, info, at = tvb:raw(), {}, 1
    while at <= #text do
        local next_line, size = find_end(text, at)
        if not next_line and #text - at + 1 < MAX_LEN then
            pinfo.desegment_offset = at - 1
            pinfo.desegment_len = DESEGMENT_ONE_MORE_SEGMENT
            break
        end
        if not next_line then
            -- What is too long is shown as far as it has come.
            next_line, size = #text + 1, 0
        end
        local content = text:sub(at, next_line - size - 1)
        table.insert(info, show_line(tvb(at - 1, next_line - at):tvb(), content, pinfo, tree, at, from_device))
        at = next_line
    end
    if #info > 0 then pinfo.cols.info = table.concat(info, ", ") end
end

for port = 2001, 2003 do DissectorTable.get("tcp.port"):add(port, mma) end
DissectorTable.get("tcp.port"):add_for_decode_as(mma)
