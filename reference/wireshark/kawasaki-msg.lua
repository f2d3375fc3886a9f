-- Kawasaki robot and PC, as kawasaki-msg.md describes them, with the default table of messages (KM-18).
--
-- README.md says how to install it.

local kawasaki = Proto("kawasaki_msg", "Kawasaki robot messages")
local MAX_LEN, LONGEST_PACKET, ASCII, UDP = 4096, 4096, 1, 3

kawasaki.prefs.pc_is_server = Pref.bool("The PC is the server of the TCP connection", true, "Over UDP: that it has the port of Decode As")
kawasaki.prefs.charset = Pref.enum("Character set", ASCII, "Of names and fields", { { 1, "ascii", ASCII }, { 2, "latin1", 2 } }, false)
kawasaki.prefs.max_number = Pref.uint("Highest job number", 9999, "After it comes 1")
kawasaki.prefs.reply_timeout = Pref.uint("Reply timeout in ms", 1000, "How long the robot waits for an answer")

local PHASES = { [0] = "idle", "starting", "active", "ending", "interrupted", "alarm" }
-- Who sends a message, what its fields are, and whether an empty one is allowed.
local MESSAGES = {
    TilausAlkaa = { role = "order_start", from = "pc", "order", "number" },
    TilausKuittaus = { role = "order_ack", from = "robot", "order" },
    Tyo = { role = "job", from = "pc", "order", "number", "kind", "x1", "y1", "x2", "y2" },
    TyoKuittaus = { role = "job_ack", from = "robot", "order", "number" },
    TyoPyynto = { role = "job_request", from = "robot", "order", "number" },
    TyoTauko = { role = "pause", from = "robot", "order", "queued" },
    TilausLoppuu = { role = "order_end", from = "pc", "order" },
    TilausKeskeytyy = { role = "order_interrupt", from = "pc", "order" },
    LoppuKuittaus = { role = "end_ack", from = "robot", "ended", "order", "executed" },
    Tila = { role = "status", "order", "phase", "queued", "executed", "ended" },
    Huuhaa = { role = "filler" },
}
local RANGES = {
    order = { 0, 65535 }, ended = { 0, 65535 }, phase = { 0, 255 }, number = { 1, 9999 }, queued = { 1, 9999 },
    executed = { 1, 9999 }, kind = { 1, 2 }, x1 = { -9999999, 9999999 }, y1 = { -9999999, 9999999 },
    x2 = { -9999999, 9999999 }, y2 = { -9999999, 9999999 },
}
local MAY_BE_EMPTY = { ended = true, queued = true, executed = true }

local f = kawasaki.fields
f.name = ProtoField.string("kawasaki_msg.name", "Name")
f.role = ProtoField.string("kawasaki_msg.role", "Message")
f.header = ProtoField.string("kawasaki_msg.header", "Header field")
f.length = ProtoField.uint16("kawasaki_msg.length", "Length of the data part", base.DEC)
f.fields = ProtoField.string("kawasaki_msg.fields", "Field")
local LABELS = {
    order = "Order", ended = "Order that ended", number = "Job", queued = "Last queued or sent", executed = "Executed up to",
    x1 = "Begins at x, 0.01 mm", y1 = "Begins at y, 0.01 mm", x2 = "Ends at x, 0.01 mm", y2 = "Ends at y, 0.01 mm",
}
for name, label in pairs(LABELS) do f[name] = ProtoField.int32("kawasaki_msg." .. name, label, base.DEC) end
f.phase = ProtoField.uint8("kawasaki_msg.phase", "Phase", base.DEC, PHASES)
f.kind = ProtoField.int32("kawasaki_msg.kind", "Kind", base.DEC, { "draw", "move" })
f.decode_error = ProtoField.string("kawasaki_msg.decode_error", "Error")
f.message_error = ProtoField.string("kawasaki_msg.message_error", "Not used")
f.request_in = ProtoField.framenum("kawasaki_msg.request_in", "Answers frame", base.NONE, frametype.REQUEST)
f.response_time = ProtoField.double("kawasaki_msg.response_time", "Response time in seconds")

local group, severity = expert.group, expert.severity
local function rule(name, text, kind, level) return ProtoExpert.new("kawasaki_msg." .. name, text, kind, level) end
local e = {
    length = rule("bad_length", "The length is not that of the data part", group.CHECKSUM, severity.ERROR),
    garbage = rule("garbage", "Bytes between two messages", group.MALFORMED, severity.WARN),
    malformed = rule("malformed", "Corrupt message", group.MALFORMED, severity.ERROR),
    unknown = rule("unknown_name", "The table has no such message", group.UNDECODED, severity.WARN),
    field = rule("bad_field", "A field does not fit", group.PROTOCOL, severity.ERROR),
    side = rule("wrong_side", "A message of the other end's", group.PROTOCOL, severity.ERROR),
    unasked = rule("unasked", "The PC sends though the robot did not", group.SEQUENCE, severity.WARN),
    long = rule("packet_too_long", "More than 4096 bytes without a message of the robot's", group.PROTOCOL, severity.WARN),
    late = rule("late", "Answer after the robot's reply timeout", group.SEQUENCE, severity.WARN),
    not_requested = rule("not_requested", "Job that the robot has not asked for", group.SEQUENCE, severity.WARN),
    jump = rule("job_jump", "The job's number is not the next and not the one that was asked for", group.SEQUENCE, severity.WARN),
    ack_jump = rule("ack_jump", "No job of this number was sent", group.SEQUENCE, severity.WARN),
    order = rule("wrong_order", "Not the order that was sent last", group.SEQUENCE, severity.NOTE),
    refused = rule("refused", "The order is not accepted", group.RESPONSE_CODE, severity.NOTE),
    alarm = rule("alarm", "The robot raises an alarm", group.RESPONSE_CODE, severity.WARN),
}
local experts = {}
for _, info in pairs(e) do table.insert(experts, info) end
kawasaki.experts = experts

local tcp_stream, udp_stream = Field.new("tcp.stream"), Field.new("udp.stream")
local streams, found_in = {}, {}

function kawasaki.init()
    streams, found_in = {}, {}
end

local function number_of(text)
    local value = tonumber(text:match("^[ \t\n\f\r]*(%-?%d+)[ \t\n\f\r]*$"))
    return value and value >= -2147483648 and value <= 2147483647 and value or nil
end

local function utf8_of_latin1(text)
    return (text:gsub("[\128-\255]", function(c)
        local code = c:byte()
        return string.char(0xC0 + math.floor(code / 64), 0x80 + code % 64)
    end))
end

--- The first byte from `from` on that cannot be in a header or a data part.
local function find_mark(text, from)
    local at = text:find(kawasaki.prefs.charset == ASCII and "[<>#\128-\255]" or "[<>#]", from)
    return at, at and text:sub(at, at)
end

local function wrong_mark(byte) return byte:byte() < 128 and "mark" or "not_ascii" end

--- The message at the beginning of `text` (section 5.1): its parts, or nil and an error, or nil for more.
local function read_message(text)
    text = text:sub(1, MAX_LEN)
    local function more() return nil, #text == MAX_LEN and "too_long" or nil end
    local header_end, mark = find_mark(text, 2)
    if not header_end then return more() end
    if mark ~= "#" then return nil, wrong_mark(mark) end
    local header = text:sub(2, header_end - 1)
    local front, length_text = header:match("^(.*)%$(.-)$")
    local length = front and number_of(length_text)
    if not length or length < 0 then return nil, "no_length" end
    if header:sub(1, 1) == "$" then return nil, "no_name" end
    if header_end + length + 2 > MAX_LEN then return nil, "too_long" end
    local data_end
    data_end, mark = find_mark(text, header_end + 1)
    if not data_end then return more() end
    if mark ~= "#" then return nil, wrong_mark(mark) end
    if data_end - header_end - 1 ~= length then return nil, "length" end
    local last = text:sub(data_end + 1, data_end + 1)
    if last == "" then return more() end
    if last ~= ">" then return nil, last == "<" and "mark" or "no_end_mark" end
    return { front = front, length_at = 2 + #front + 1, length = length, header_end = header_end, data_end = data_end }
end

--- The values between two `$`, each with its place; none in an empty text where `at` is that of a data part.
local function split(text, at)
    local values = {}
    for value, next_at in (text .. "$"):gmatch("([^$]*)%$()") do
        table.insert(values, { text = value, at = at + next_at - 2 - #value })
    end
    return values
end

--- What the message's fields are, by name, or nil and why it is not used.
local function read_fields(message, fields)
    local values = {}
    for index, name in ipairs(message) do
        local field = fields[index] or { text = "" }
        if not (field.text == "" and MAY_BE_EMPTY[name]) then
            if not fields[index] then return nil, "field_count" end
            local value, range = number_of(field.text), RANGES[name]
            if not value then return nil, "not_a_number" end
            if value < range[1] or value > range[2] then return nil, "out_of_range" end
            values[name] = value
        end
    end
    if #fields > #message then return nil, "field_count" end
    return values
end

--- How far a number is ahead of another: 1 for the next (KM-44).
local function ahead(number, of) return (number - of) % math.max(kawasaki.prefs.max_number, 1) end

--- What the messages before make of one of the PC's.
local function follow_pc(stream, role, values, now, length, seen, first_of_frame)
    local since = stream.robot and (not stream.pc or stream.robot.order > stream.pc.order)
    stream.bytes = (since and 0 or stream.bytes or 0) + length
    if since then
        seen.number, seen.time = stream.robot.number, now - stream.robot.time
        if seen.time * 1000 > kawasaki.prefs.reply_timeout then table.insert(seen, e.late) end
        stream.asked = stream.request
        stream.request = nil
    elseif first_of_frame and (not stream.robot or now - stream.pc.time > 0.1) then
        table.insert(seen, e.unasked)
    end
    if stream.bytes > LONGEST_PACKET and stream.bytes - length <= LONGEST_PACKET then table.insert(seen, e.long) end
    if role == "order_start" or role == "order_end" or role == "order_interrupt" then
        stream[role == "order_start" and "start" or "finish"] = { number = seen.frame, time = now, order = values.order }
        if role == "order_start" then stream.job, stream.last_sent, stream.executed = nil, nil, nil end
    elseif role == "job" then
        local function is_after(job)
            return job and job.order == values.order and ahead(values.number, job.number) == 1
        end
        -- Of jobs that are sent again the next is the one after the last that was.
        local is_next = is_after(stream.job) or is_after(stream.last_sent)
        local is_asked = stream.asked and stream.asked.order == values.order and stream.asked.job == values.number
        if not stream.asked then
            table.insert(seen, e.not_requested)
        elseif not is_next and not is_asked then
            table.insert(seen, e.jump)
        end
        -- What is sent again does not take back what was sent.
        local is_again = stream.job and stream.job.order == values.order
            and ahead(stream.job.number, values.number) < kawasaki.prefs.max_number / 2
        if not is_again then stream.job = values end
        stream.last_sent = values
        stream.sent_in[values.number] = { number = seen.frame, time = now }
    end
end

--- What the messages before make of one of the robot's.
local function follow_robot(stream, role, values, now, seen)
    local function answers(request)
        if request then seen.number, seen.time = request.number, now - request.time end
    end
    local job = stream.job
    if role == "job_request" then
        stream.request = { order = values.order, job = values.number }
        if job and job.order == values.order and ahead(values.number, job.number) > 1
            and ahead(values.number, job.number) < kawasaki.prefs.max_number / 2 then
            table.insert(seen, e.ack_jump)
        end
    elseif role == "job_ack" then
        local is_ours = job and job.order == values.order
        if job and not is_ours then table.insert(seen, e.order) end
        if is_ours then
            answers(stream.sent_in[values.number])
            local from = stream.executed or 0
            if ahead(values.number, from) > ahead(job.number, from) then table.insert(seen, e.ack_jump) end
            stream.executed = values.number
        end
    elseif role == "order_ack" then
        answers(stream.start)
        if stream.start and values.order ~= stream.start.order then table.insert(seen, e.refused) end
        stream.start = nil
    elseif role == "end_ack" then
        answers(stream.finish)
        stream.finish = nil
    elseif role == "status" and values.phase == 5 then
        table.insert(seen, e.alarm)
    end
end

--- What is to be shown of a message besides itself, found in the first pass: experts, the frame that it answers, the time since.
local function follow(pinfo, at, from_pc, role, values, length)
    local key = pinfo.number .. ":" .. at
    if pinfo.visited then return found_in[key] or {} end
    local id = pinfo.port_type == UDP and "udp" .. udp_stream().value or tcp_stream().value
    local stream = streams[id] or { sent_in = {}, count = 0 }
    streams[id] = stream
    stream.count = stream.count + 1
    local now = tonumber(tostring(pinfo.abs_ts))
    local seen = { frame = pinfo.number }
    local side = from_pc and "pc" or "robot"
    local before = stream[side]
    if from_pc then
        follow_pc(stream, role, values, now, length, seen, not before or before.number ~= pinfo.number)
    else
        follow_robot(stream, role, values, now, seen)
    end
    stream[side] = { number = pinfo.number, time = now, order = stream.count }
    found_in[key] = seen
    return seen
end

local function show_message(tvb, text, message, pinfo, tree, at, from_pc)
    local front = split(message.front, 1)
    local name = front[1].text
    local entry = MESSAGES[name]
    local item = tree:add(kawasaki, tvb)
    item:add(f.name, tvb(1, #name), utf8_of_latin1(name))
    if entry then item:add(f.role, tvb(1, #name), entry.role):set_generated() end
    for index = 2, #front do
        item:add(f.header, tvb(front[index].at, #front[index].text), utf8_of_latin1(front[index].text))
    end
    item:add(f.length, tvb(message.length_at - 1, message.header_end - message.length_at), message.length)
    local data = text:sub(message.header_end + 1, message.data_end - 1)
    local fields = data == "" and {} or split(data, message.header_end)
    local values, wrong = {}, "unknown_name"
    if entry then values, wrong = read_fields(entry, fields) end
    for index, field in ipairs(fields) do
        local range, label = tvb(field.at, #field.text), entry and entry[index]
        local value = item:add(f.fields, range, utf8_of_latin1(field.text))
        if values and values[label] then value:append_text(" (" .. label .. ")"):add(f[label], range, values[label]) end
    end
    local is_foreign = entry and entry.from and (entry.from == "pc") ~= from_pc
    if is_foreign then wrong, values = "not_expected", nil end
    if wrong then
        item:add(f.message_error, tvb(), wrong):set_generated()
        item:add_proto_expert_info(is_foreign and e.side or entry and e.field or e.unknown)
    end
    local seen = follow(pinfo, at, from_pc, values and entry and entry.role, values or {}, tvb:len())
    if seen.number then
        item:add(f.request_in, seen.number):set_generated()
        item:add(f.response_time, seen.time):set_generated()
    end
    for _, info in ipairs(seen) do item:add_proto_expert_info(info) end
    local number = values and entry and (entry.role ~= "order_start" and values.number or values.ended or values.order)
    local word = utf8_of_latin1(name) .. (number and " " .. number or "")
    item:append_text(", " .. word)
    return word
end

local function show_error(range, kind, tree)
    local item = tree:add(kawasaki, range)
    item:add(f.decode_error, range, kind)
    item:add_proto_expert_info(kind == "length" and e.length or kind == "garbage" and e.garbage or e.malformed)
    return "Error " .. kind
end

--- Jobs in a row are one word.
local function summary(info)
    local words = {}
    for _, word in ipairs(info) do
        local begin, last = (words[#words] or ""):match("^(Tyo %d+)%D-(%d*)$")
        local number = tonumber(word:match("^Tyo (%d+)$"))
        if number and begin and number == tonumber(last ~= "" and last or begin:sub(5)) + 1 then
            words[#words] = begin .. "–" .. number
        else
            table.insert(words, word)
        end
    end
    return table.concat(words, ", ")
end

function kawasaki.dissector(tvb, pinfo, tree)
    pinfo.cols.protocol = "Kawasaki"
    local from_pc = (pinfo.src_port == pinfo.match_uint) == kawasaki.prefs.pc_is_server
    local is_datagram = pinfo.port_type == UDP
    local text, info, at = tvb:raw(), {}, 1
    while at <= #text do
        local message, kind, after
        if text:sub(at, at) == "<" then
            message, kind = read_message(text:sub(at, at + MAX_LEN - 1))
            after = message and at + message.data_end + 1
        else
            kind = "garbage"
        end
        if not message and not kind and is_datagram then kind = "incomplete" end
        -- What is wrong ends where the next message begins.
        if kind then after = text:find("<", at + 1, true) end
        if kind and not after and (is_datagram or #text - at >= MAX_LEN) then after = #text + 1 end
        if not after then
            pinfo.desegment_offset = at - 1
            pinfo.desegment_len = DESEGMENT_ONE_MORE_SEGMENT
            break
        end
        local range = tvb(at - 1, after - at)
        if message then
            local part = text:sub(at, after - 1)
            table.insert(info, show_message(range:tvb(), part, message, pinfo, tree, at, from_pc))
        else
            table.insert(info, show_error(range, kind, tree))
        end
        at = after
    end
    if #info > 0 then pinfo.cols.info = summary(info) end
end

DissectorTable.get("tcp.port"):add_for_decode_as(kawasaki)
DissectorTable.get("udp.port"):add_for_decode_as(kawasaki)
