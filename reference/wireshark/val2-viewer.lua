-- The link between a host and the workstation that draws its robot, as val2-viewer.md describes it.
--
-- README.md says how to install it.

local viewer = Proto("val2_viewer", "VAL II viewer")
local ENQ, LF, DOLLAR = 0x05, 0x0A, 0x24
local MAX_LEN = 100

viewer.prefs.host_is_server = Pref.bool("The host is the server of the TCP connection", true,
    "Whether the host, or the adapter at its port, accepted the connection")

local f = viewer.fields
f.request = ProtoField.bool("val2_viewer.request", "Request (ENQ)")
f.count = ProtoField.uint16("val2_viewer.count", "Count", base.DEC)
f.pose = ProtoField.int16("val2_viewer.pose", "Pose", base.DEC)
f.checksum = ProtoField.string("val2_viewer.checksum", "Checksum")
f.lost = ProtoField.uint16("val2_viewer.lost", "Packets lost before this one", base.DEC)
f.decode_error = ProtoField.string("val2_viewer.decode_error", "Error")
f.request_in = ProtoField.framenum("val2_viewer.request_in", "Request in", base.NONE, frametype.REQUEST)
f.response_time = ProtoField.double("val2_viewer.response_time", "Response time in seconds")

local function expert_of(name, text, group, severity)
    return ProtoExpert.new("val2_viewer." .. name, text, expert.group[group], expert.severity[severity])
end
local e = {
    checksum = expert_of("bad_checksum", "Bad checksum", "CHECKSUM", "ERROR"),
    corrupt = expert_of("corrupt", "Corrupt line", "MALFORMED", "ERROR"),
    unknown = expert_of("unknown", "Not a request", "PROTOCOL", "WARN"),
    unasked = expert_of("unasked", "Packet without a request", "SEQUENCE", "WARN"),
    again = expert_of("again", "Request before the answer to the last one", "SEQUENCE", "NOTE"),
    lost = expert_of("packets_lost", "Packets were lost, or the host was restarted", "SEQUENCE", "NOTE"),
}
viewer.experts = { e.checksum, e.corrupt, e.unknown, e.unasked, e.again, e.lost }

local NAMES = { "nx", "ny", "nz", "ox", "oy", "oz", "ax", "ay", "az", "px", "py", "pz" }
local stream_field = Field.new("tcp.stream")
local streams, matches = {}, {}

function viewer.init()
    streams, matches = {}, {}
end

local function stream_of()
    local number = stream_field()
    local key = number and number.value or 0
    streams[key] = streams[key] or {}
    return streams[key]
end

--- The numbers of a line and where they are; or nil and the error.
local function read_line(line)
    if line:sub(1, 6) ~= "$POSE," then return nil, "format" end
    local numbers, at = {}, 7
    for index = 1, 13 do
        if index > 1 then
            if line:sub(at, at) ~= "," then return nil, "format" end
            at = at + 1
        end
        local text = line:match("^-?%d+", at) or ""
        local value = tonumber(text)
        local low, high = index == 1 and 0 or -32768, index == 1 and 65535 or 32767
        if not value or tostring(math.floor(value)) ~= text or text == "-0" or value < low or value > high then
            return nil, "number"
        end
        table.insert(numbers, { value = value, at = at - 1, length = #text })
        at = at + #text
    end
    local xor = 0
    for place = 2, at - 1 do xor = bit.bxor(xor, line:byte(place)) end
    local found = line:match("^%*([%dA-F][%dA-F])", at)
    if not found then return nil, "format" end
    if found ~= string.format("%02X", xor) then return nil, "checksum" end
    return line:sub(at + 3) == "\r\n" and numbers or nil, "format"
end

local function match(pinfo, tree, at, count)
    local key = pinfo.number .. ":" .. at
    if not pinfo.visited then
        local stream, found = stream_of(), {}
        if stream.request then
            found.number = stream.request.number
            found.time = tonumber(tostring(pinfo.abs_ts)) - stream.request.time
        end
        if stream.count then found.lost = (count - stream.count - 1) % 65536 end
        stream.request, stream.count = nil, count
        matches[key] = found
    end
    local found = matches[key] or {}
    if found.number then
        tree:add(f.request_in, found.number):set_generated()
        tree:add(f.response_time, found.time):set_generated()
    else
        tree:add_proto_expert_info(e.unasked)
    end
    if (found.lost or 0) > 0 then
        tree:add(f.lost, found.lost):set_generated()
        tree:add_proto_expert_info(e.lost)
    end
end

local function show_error(range, tree, kind, info)
    local item = tree:add(viewer, range)
    item:add(f.decode_error, range, kind)
    item:add_proto_expert_info(kind == "checksum" and e.checksum or kind == "unknown" and e.unknown or e.corrupt)
    table.insert(info, "Error " .. kind)
end

local function show_line(tvb, pinfo, tree, at, length, info)
    local line = tvb:raw(at, length)
    local numbers, wrong = read_line(line)
    if not numbers then return show_error(tvb(at, length), tree, wrong, info) end
    local item = tree:add(viewer, tvb(at, length))
    for index, number in ipairs(numbers) do
        local range = tvb(at + number.at, number.length)
        if index == 1 then
            item:add(f.count, range, number.value)
        else
            item:add(f.pose, range, number.value):set_text(NAMES[index - 1] .. ": " .. number.value)
        end
    end
    item:add(f.checksum, tvb(at + length - 4, 2))
    match(pinfo, item, at, numbers[1].value)
    table.insert(info, "Pose " .. numbers[1].value)
end

local function dissect_lines(tvb, pinfo, tree, info)
    local bytes, at = tvb:bytes(), 0
    while at < tvb:len() do
        local is_line = bytes:get_index(at) == DOLLAR
        local limit = math.min(tvb:len(), at + MAX_LEN)
        local stop = at
        while stop < limit do
            local byte = bytes:get_index(stop)
            if byte == LF or byte == DOLLAR and stop > at then break end
            stop = stop + 1
        end
        if stop < limit and bytes:get_index(stop) == LF then
            stop = stop + 1
            show_line(tvb, pinfo, tree, at, stop - at, info)
        elseif stop < limit then
            show_error(tvb(at, stop - at), tree, is_line and "incomplete" or "noise", info)
        elseif limit - at == MAX_LEN then
            show_error(tvb(at, MAX_LEN), tree, is_line and "too_long" or "noise", info)
        else
            pinfo.desegment_offset = at
            pinfo.desegment_len = DESEGMENT_ONE_MORE_SEGMENT
            return
        end
        at = stop
    end
end

local function dissect_requests(tvb, pinfo, tree, info)
    for at = 0, tvb:len() - 1 do
        if tvb(at, 1):uint() == ENQ then
            local item = tree:add(viewer, tvb(at, 1))
            item:add(f.request, tvb(at, 1), true)
            local key = pinfo.number .. ":" .. at
            if not pinfo.visited then
                local stream = stream_of()
                matches[key] = { again = stream.request ~= nil }
                stream.request = { number = pinfo.number, time = tonumber(tostring(pinfo.abs_ts)) }
            end
            if (matches[key] or {}).again then item:add_proto_expert_info(e.again) end
            table.insert(info, "Request")
        else
            show_error(tvb(at, 1), tree, "unknown", info)
        end
    end
end

function viewer.dissector(tvb, pinfo, tree)
    pinfo.cols.protocol = "VAL viewer"
    local info = {}
    if (pinfo.src_port == pinfo.match_uint) == viewer.prefs.host_is_server then
        dissect_lines(tvb, pinfo, tree, info)
    else
        dissect_requests(tvb, pinfo, tree, info)
    end
    if #info > 0 then pinfo.cols.info = table.concat(info, ", ") end
end

DissectorTable.get("tcp.port"):add_for_decode_as(viewer)
