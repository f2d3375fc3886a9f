-- Laser machining robot, as laser-eb90.md describes it.
--
-- README.md says how to install it. The preferences are the options of section 11.

local laser = Proto("laser_eb90", "Laser machining robot")
local HEAD, FLAG, MARK, MAX_PAYLOAD = { 0xEB, 0x90, 0x82 }, 0xF0, 0x90, 512

local function choice(label, names)
    local entries = {}
    for index, name in ipairs(names) do entries[index] = { index, name, index } end
    return Pref.enum(label, 1, label, entries, false)
end
laser.prefs.controller_is_server = Pref.bool("The controller is the server of the TCP connection", true,
    "Whether the controller, or the adapter at its port, accepted the connection")
laser.prefs.tail = choice("Tail", { "printed", "etx", "either" })
laser.prefs.flag = choice("Flag", { "separate", "first_tag" })
laser.prefs.checksum = choice("Checksum", { "u8", "u16_le", "u16_be" })
laser.prefs.byte_order = choice("Byte order", { "little", "big" })
laser.prefs.checksum_negated = Pref.bool("Checksum negated", false, "The two's complement of the sum")
laser.prefs.checksum_with_flag = Pref.bool("Checksum with flag", false, "The sum counts the flag")
laser.prefs.tags_f32 = Pref.uint("Tag of floats", 0xF0)
laser.prefs.tags_i16 = Pref.uint("Tag of shorts", 0xF1)
laser.prefs.tags_u8 = Pref.uint("Tag of bytes", 0xF2)
laser.prefs.tags_char = Pref.uint("Tag of characters", 0xF3)

local CLASSES = { [1] = "interpreted", [2] = "immediate", [3] = "query" }
local ERROR_CODES = {
    [0xE001] = "bad_checksum", [0xE002] = "bad_frame", [0xE003] = "unknown_command",
    [0xE004] = "bad_batch", [0xE005] = "bad_parameters", [0xE006] = "queue_full",
}
local f = laser.fields
f.word = ProtoField.uint16("laser_eb90.word", "Word", base.HEX)
f.class = ProtoField.string("laser_eb90.class", "Class")
f.error_code = ProtoField.string("laser_eb90.error_code", "Error code")
f.tag = ProtoField.uint8("laser_eb90.tag", "Tag", base.HEX)
f.count = ProtoField.uint8("laser_eb90.count", "Count", base.DEC)
f.f32 = ProtoField.float("laser_eb90.f32", "Float")
f.i16 = ProtoField.int16("laser_eb90.i16", "Short", base.DEC)
f.u8 = ProtoField.uint8("laser_eb90.u8", "Byte", base.DEC)
f.char = ProtoField.string("laser_eb90.char", "Characters")
f.check = ProtoField.uint16("laser_eb90.check", "Check", base.HEX)
f.decode_error = ProtoField.string("laser_eb90.decode_error", "Error")
f.request_in = ProtoField.framenum("laser_eb90.request_in", "Request in", base.NONE, frametype.REQUEST)
f.response_time = ProtoField.double("laser_eb90.response_time", "Response time in seconds")

local group, severity = expert.group, expert.severity
local function rule(name, text, kind, level) return ProtoExpert.new("laser_eb90." .. name, text, kind, level) end
local e = {
    checksum = rule("bad_checksum", "Bad checksum", group.CHECKSUM, severity.ERROR),
    no_head = rule("no_head", "Bytes without a head", group.MALFORMED, severity.ERROR),
    flag = rule("bad_flag", "Bad frame flag", group.MALFORMED, severity.ERROR),
    stuffing = rule("bad_stuffing", "90h neither doubled nor a tail", group.MALFORMED, severity.ERROR),
    too_long = rule("too_long", "Payload of more than 512 bytes", group.MALFORMED, severity.ERROR),
    tag = rule("bad_tag", "No tag where one must be", group.MALFORMED, severity.ERROR),
    item = rule("bad_item", "Item longer than the payload", group.MALFORMED, severity.ERROR),
    no_word = rule("no_word", "The frame does not begin with a word", group.PROTOCOL, severity.WARN),
    not_finite = rule("not_finite", "Value that is not finite", group.PROTOCOL, severity.WARN),
    refused = rule("refused", "Answered with an error code", group.RESPONSE_CODE, severity.NOTE),
    other_word = rule("other_word", "The answer is another word than the request's", group.PROTOCOL, severity.WARN),
    unasked = rule("unasked", "Answer without a request", group.SEQUENCE, severity.WARN),
    early = rule("early", "Request before the answer to the last one", group.SEQUENCE, severity.NOTE),
}
local experts = {}
for _, info in pairs(e) do table.insert(experts, info) end
laser.experts = experts

local stream_field = Field.new("tcp.stream")
local open_requests, matches = {}, {}

function laser.init()
    open_requests, matches = {}, {}
end

--- The first head from `at` to before `to`, whole or cut off by `to`; `to` if there is none.
local function find_head(tvb, at, to)
    for place = at, to - 1 do
        local is_head = true
        for index, byte in ipairs(HEAD) do
            is_head = is_head and (place + index > to or tvb(place + index - 1, 1):uint() == byte)
        end
        if is_head then return place end
    end
    return to
end

local function item_size(tag)
    local p = laser.prefs
    return ({ [p.tags_f32] = 4, [p.tags_i16] = 2, [p.tags_u8] = 1, [p.tags_char] = 1 })[tag]
end

local function ends_with(byte)
    local tail = laser.prefs.tail
    return byte == (tail == 2 and 0x83 or 0x82) or tail == 3 and byte == 0x83
end

local function expected_check(payload)
    local p, sum = laser.prefs, 0
    for _, byte in ipairs(payload) do sum = sum + byte end
    if p.checksum_with_flag and p.flag == 1 then sum = sum + FLAG end
    if p.checksum_negated then sum = -sum end
    return sum % (p.checksum == 1 and 0x100 or 0x10000)
end

--- The error in the items of a payload.
local function check_items(payload)
    local at = 1
    while at <= #payload do
        local size = item_size(payload[at])
        if not size then return "tag" end
        at = at + 2 + size * (payload[at + 1] or 0)
        if at > #payload + 1 then return "item" end
    end
end

--- Reads the frame at `at`: its length and payload, or nil, an error and the bytes examined, or nothing if bytes are missing.
local function read_frame(tvb, at)
    local p, len, payload = laser.prefs, tvb:len() - at, {}
    local function byte(index) return tvb(at + index, 1):uint() end
    local i = 3
    if p.flag == 1 then
        if len <= 3 then return end
        if byte(3) ~= FLAG then return nil, "flag", 4 end
        i = 4
    end
    if len <= i then return end
    if not item_size(byte(i)) then return nil, "tag", i + 1 end
    while true do
        if i >= len then return end
        if byte(i) == MARK then
            if i + 1 >= len then return end
            i = i + 1
            if byte(i) ~= MARK then break end
        end
        if #payload == MAX_PAYLOAD then return nil, "too_long", i + 1 end
        table.insert(payload, byte(i))
        i = i + 1
    end
    if not ends_with(byte(i)) then return nil, "stuffing", i + 1 end
    local size = p.checksum == 1 and 1 or 2
    local total = i + 1 + size
    if total > len then return end
    local range = tvb(at + i + 1, size)
    local check = p.checksum == 2 and range:le_uint() or range:uint()
    if check ~= expected_check(payload) then return nil, "checksum", total end
    local wrong = check_items(payload)
    if wrong then return nil, wrong, total end
    return total, payload, check
end

local function utf8_of_latin1(range)
    return (range:raw():gsub("[\128-\255]", function(c)
        local code = c:byte()
        return string.char(0xC0 + math.floor(code / 64), 0x80 + code % 64)
    end))
end

--- Shows the items of a payload; returns its first word.
local function show_items(payload, tree)
    local p, at, first = laser.prefs, 0, nil
    while at < payload:len() do
        local tag, count = payload(at, 1):uint(), payload(at + 1, 1):uint()
        local size = item_size(tag)
        local item = tree:add(laser, payload(at, 2 + size * count), "Item")
        item:add(f.tag, payload(at, 1))
        item:add(f.count, payload(at + 1, 1))
        local is_word = tag == p.tags_i16 and count == 1
        local add = function(field, range)
            if p.byte_order == 2 then return item:add(field, range) end
            return item:add_le(field, range)
        end
        if is_word then
            local value = payload(at + 2, 2)
            local word = p.byte_order == 2 and value:uint() or value:le_uint()
            add(f.word, value)
            if at == 0 then first = word end
        end
        if tag == p.tags_char then
            item:add(f.char, payload(at + 2, count), count > 0 and utf8_of_latin1(payload(at + 2, count)) or "")
        else
            local field = tag == p.tags_f32 and f.f32 or tag == p.tags_i16 and f.i16 or f.u8
            for index = 0, count - 1 do
                local range = payload(at + 2 + index * size, size)
                local shown = add(field, range)
                if size == 4 then
                    local value = p.byte_order == 2 and range:float() or range:le_float()
                    if value ~= value or math.abs(value) == math.huge then shown:add_proto_expert_info(e.not_finite) end
                end
            end
        end
        at = at + 2 + size * count
    end
    return first
end

local function match(pinfo, tree, at, word, from_controller)
    local key = pinfo.number .. ":" .. at
    if not pinfo.visited then
        local stream = stream_field()
        stream = stream and stream.value or 0
        local request, now = open_requests[stream], tonumber(tostring(pinfo.abs_ts))
        if not from_controller then
            matches[key] = { early = request ~= nil }
            open_requests[stream] = { number = pinfo.number, time = now, word = word }
        elseif request then
            matches[key] = { number = request.number, time = now - request.time, word = request.word }
            open_requests[stream] = nil
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
        if word ~= found.word and not ERROR_CODES[word] then tree:add_proto_expert_info(e.other_word) end
    end
end

local function show_frame(range, payload, check, pinfo, tree, at, from_controller)
    local bytes = ByteArray.new()
    bytes:set_size(#payload)
    for index, byte in ipairs(payload) do bytes:set_index(index - 1, byte) end
    local word = show_items(bytes:tvb("Unstuffed payload"), tree)
    local code, class = ERROR_CODES[word], CLASSES[math.floor((word or 0) / 256)]
    if not word then
        tree:add_proto_expert_info(e.no_word)
    elseif code and from_controller then
        tree:add(f.error_code, range, code):add_proto_expert_info(e.refused)
    elseif class then
        tree:add(f.class, range, class)
    end
    local size = laser.prefs.checksum == 1 and 1 or 2
    tree:add(f.check, range(range:len() - size, size), check)
    match(pinfo, tree, at, word, from_controller)
    local name = from_controller and (code or "Answer") or class or "Frame"
    return word and string.format("%s %04X", name, word) or name
end

function laser.dissector(tvb, pinfo, tree)
    pinfo.cols.protocol = "Laser EB90"
    local from_controller = (pinfo.src_port == pinfo.match_uint) == laser.prefs.controller_is_server
    local info, at = {}, 0
    while at < tvb:len() do
        local head = find_head(tvb, at, tvb:len())
        local length, payload, check, kind
        if head > at then
            kind, length = "no_head", head - at
        elseif tvb:len() - at >= #HEAD then
            length, payload, check = read_frame(tvb, at)
            if not length and payload then
                kind, length = payload, find_head(tvb, at + 1, at + check) - at
            end
        end
        if not length then
            pinfo.desegment_offset = at
            pinfo.desegment_len = DESEGMENT_ONE_MORE_SEGMENT
            break
        end
        local range = tvb(at, length)
        local frame = tree:add(laser, range)
        if kind then
            frame:add(f.decode_error, range, kind)
            frame:add_proto_expert_info(e[kind])
            table.insert(info, "Error " .. kind)
        else
            table.insert(info, show_frame(range, payload, check, pinfo, frame, at, from_controller))
        end
        at = at + length
    end
    if #info > 0 then pinfo.cols.info = table.concat(info, ", ") end
end

DissectorTable.get("tcp.port"):add_for_decode_as(laser)
